"""Files of results: each appears whole or not at all."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from multiphi_exudyn.errors import MultiPhiValueError

__all__ = ["results_folder", "write_whole"]


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


def write_whole(path: Path, content: bytes) -> None:
    """Write beside the file and rename."""
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        Path(temporary).chmod(0o644)
        Path(temporary).replace(path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise
