"""The folder of results."""

from __future__ import annotations

import tempfile
from pathlib import Path

from multiphi_exudyn.errors import MultiPhiValueError

__all__ = ["results_folder"]


def results_folder(path: Path) -> Path:
    """The folder, made where there is none; an error, before anything has run, where it cannot be written."""
    try:
        path.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=path):
            return path
    except OSError as error:
        raise MultiPhiValueError(
            f"--out: got {str(path)!r}, need a folder that can be written: {error.strerror}"
        ) from error
