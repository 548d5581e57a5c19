"""Base share: what the small base of a large structure does not hold of a start, of a row, or of its levels.

A start is judged in the norm of the mass matrix, a row by its static flexibility. A run takes what its loads act on
into the base (MultiPhiModel.holding), as it does contacts and points; one that goes on keeps the base of its start.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from multiphi_exudyn.levels.model import MultiPhiModel

__all__ = ["base_warnings", "row_warnings"]

OUTSIDE = 1e-3  # of a start, or of the static flexibility at a row
INEXACT = 1e-8  # of omega^2 of the levels on which a base was judged


def base_warnings(model: MultiPhiModel, loads: np.ndarray, **start: np.ndarray | None) -> Iterator[str]:
    """Of rows (k, n) of loads, of x and x' (n,) of a start by their names, and of the levels."""
    base = model.base
    if base.error > INEXACT:
        yield f"base: squares of frequencies of levels may be off by {base.error:.2g}; need more modes, or modes='all'"
    for row in model.lacking(loads):
        yield from _told(model, model.outside(row), "the static flexibility at a load")
    for name, given in start.items():
        if given is not None:
            yield from _told(model, _of_start(model, np.asarray(given, float)), f"the start's {name}")


def row_warnings(model: MultiPhiModel, row: np.ndarray) -> Iterator[str]:
    """Of a row (n,) that is no point."""
    yield from _told(model, model.outside(row), "the static flexibility at a row")


def _of_start(model: MultiPhiModel, given: np.ndarray) -> float:
    """|x - Phi Phi^T M x| / |x| in the norm of M."""
    shapes, mass = model.base.modes.shapes, model.base.mass
    left = given - shapes @ (shapes.T @ (mass @ given))
    whole = float(given @ (mass @ given))
    return math.sqrt(max(float(left @ (mass @ left)), 0.0) / whole) if whole > 0 else 0.0


def _told(model: MultiPhiModel, share: float, what: str) -> Iterator[str]:
    if share >= OUTSIDE:
        yield (
            f"base: {100 * share:.2g} % of {what} lies outside the {model.base.modes.count} coordinates of the levels' "
            "base; give the model more modes, or make it a point"
        )
