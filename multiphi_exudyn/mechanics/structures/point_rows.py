"""Points of a structure: rows p of n numbers by name; the value of a point is p.x, a force F at it acts as p F."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from multiphi_exudyn.display import names
from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.mathematics.round_off import all_finite
from multiphi_exudyn.mechanics.structures.arguments import FLOAT, real_array
from multiphi_exudyn.mechanics.structures.dofs import DofTable, required_table

__all__ = ["PointRows", "checked_vector", "point_rows"]


class PointRows(Mapping[str, np.ndarray]):
    """Rows (n,) by name, built on access from their nonzero entries (indices, values)."""

    def __init__(self, n: int, entries: dict[str, tuple[np.ndarray, np.ndarray]]) -> None:
        self.n = n
        self._entries = entries

    def __getitem__(self, name: str) -> np.ndarray:
        row = np.zeros(self.n)
        indices, values = self._entries[name]
        row[indices] = values
        row.flags.writeable = False
        return row

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries)

    def __len__(self) -> int:
        return len(self._entries)

    def __contains__(self, name: object) -> bool:
        return name in self._entries

    def __repr__(self) -> str:
        return f"<rows of {self.n} degrees of freedom, by point: {names(list(self))}>"

    def restricted_to(self, moving: np.ndarray) -> PointRows:
        """Rows of these degrees of freedom alone; raise for a point that moves with the others only."""
        entries = {}
        for name in self:
            row = self[name]
            if np.any(row) and not np.any(row[moving]):
                raise MultiPhiValueError(f"points[{name!r}]: got a place that is fixed, need one that can move")
            indices = np.flatnonzero(row[moving])
            entries[name] = indices, row[moving][indices]
        return PointRows(len(moving), entries)


def point_rows(given: Any, n: int, dofs: DofTable | None) -> PointRows:
    """Rows of points from degrees of freedom, (node, component), or rows (n,)."""
    if isinstance(given, PointRows) and given.n == n:
        return given
    if not isinstance(given, Mapping):
        needed = f"{{name: DoF index, (node, component) or ({n},) row}}"
        raise MultiPhiTypeError(f"points: got {type(given).__name__}, need {needed}")
    return PointRows(n, {name: _point_entries(name, place, n, dofs) for name, place in given.items()})


def _point_entries(name: str, given: Any, n: int, dofs: DofTable | None) -> tuple[np.ndarray, np.ndarray]:
    if not isinstance(name, str) or not name:
        raise MultiPhiTypeError(f"points: got the name {name!r}, need a non-empty string")
    if isinstance(given, tuple) and len(given) == 2 and (n != 2 or dofs is not None or isinstance(given[1], str)):
        label = f"points[{name!r}]"
        return np.array([required_table(label, dofs).place(label, *given)]), np.ones(1)
    if isinstance(given, (int, np.integer)) and not isinstance(given, bool):
        if dofs is not None:
            raise MultiPhiValueError(
                f"points[{name!r}]: got {given}, need (node, component), as ({given}, 'uz'): the rows have nodes"
            )
        if not 0 <= given < n:
            raise MultiPhiValueError(f"points[{name!r}]: got DoF {given}, need 0 <= DoF < {n}")
        return np.array([given]), np.ones(1)
    row = checked_vector(f"points[{name!r}]", given, n)
    indices = np.flatnonzero(row)
    return indices, row[indices]


def checked_vector(name: str, given: Any, n: int) -> np.ndarray:
    """``given`` as finite (n,) numbers, not copied if it is a float array; name: of the argument, for errors."""
    is_float = type(given) is np.ndarray and given.dtype == FLOAT
    vector: np.ndarray = given if is_float else real_array(name, given, f"an ({n},) array of real numbers")
    if vector.shape != (n,):
        raise MultiPhiValueError(f"{name}: got shape {vector.shape}, need ({n},)")
    if not all_finite(vector):
        raise MultiPhiValueError(f"{name}: got a value that is NaN or infinite, need finite numbers")
    return vector
