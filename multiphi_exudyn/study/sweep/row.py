"""A finished run as a row: its parameters, its key, its values as JSON has them, and its arrays as bytes."""

from __future__ import annotations

import hashlib
import io
import json
import math
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError

__all__ = ["STATUSES", "Row", "checked", "key_of", "pack", "plain"]

STATUSES = ("ok", "failed", "over budget")


@dataclass(frozen=True)
class Row:
    """How the run with these parameters ended.

    status: "ok", "failed" or "over budget"; message: the cause where it is not "ok". elapsed_s: s of wall clock.
    environment: machine and versions. finished: ISO 8601, UTC.
    """

    parameters: Mapping[str, Any]
    status: str
    message: str
    values: Mapping[str, Any]
    elapsed_s: float
    environment: Mapping[str, Any]
    finished: str


def key_of(parameters: Mapping[str, Any]) -> str:
    """sha256 of the parameters' canonical JSON."""
    canonical = json.dumps(checked(parameters), sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(canonical.encode()).hexdigest()


def checked(parameters: Mapping[str, Any], place: str = "parameters") -> dict[str, Any]:
    """The parameters as JSON has them, all numbers finite."""
    if not isinstance(parameters, Mapping):
        raise MultiPhiTypeError(f"{place}: {type(parameters).__name__}; need a mapping from names to values")
    return plain(parameters, place, _refused)


def plain(value: Any, place: str, not_finite: Callable[[float, str], Any] = lambda value, place: None) -> Any:
    """``value`` as JSON has it: NumPy's numbers become Python's, tuples lists; ``not_finite`` answers for nan, inf."""
    if isinstance(value, np.generic):
        value = value.item()
    if value is None or isinstance(value, (bool, str)):
        return value
    if isinstance(value, int):
        return int(value)
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else not_finite(value, place)
    if isinstance(value, (list, tuple)):
        return [plain(item, f"{place}[{index}]", not_finite) for index, item in enumerate(value)]
    if isinstance(value, Mapping) and all(isinstance(name, str) for name in value):
        return {str(name): plain(item, f"{place}[{name!r}]", not_finite) for name, item in value.items()}
    kind = "a mapping with names that are no text" if isinstance(value, Mapping) else type(value).__name__
    raise MultiPhiValueError(f"{place}: {kind}; need numbers, text, bool, None, lists and mappings of them")


def pack(histories: Mapping[str, np.ndarray]) -> bytes:
    """The arrays as a compressed npz file."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, array in histories.items():
            with archive.open(f"{name}.npy", "w") as entry:
                np.lib.format.write_array(entry, np.asarray(array), allow_pickle=False)
    return buffer.getvalue()


def _refused(value: float, place: str) -> Any:
    raise MultiPhiValueError(f"{place}: {value}; need a finite number")
