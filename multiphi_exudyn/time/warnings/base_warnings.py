"""Base warnings: the parts of a start, a row or the levels that the small base of a large structure leaves out.

A start is judged in the norm of the mass matrix, a row by its static flexibility. The base of a run includes the rows
of its loads (MultiPhiModel.holding), like contacts and points; a continued run keeps the base of its start.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from multiphi_exudyn.levels.model.model import MultiPhiModel

__all__ = ["base_warnings", "row_warnings"]

OUTSIDE = 1e-3  # of a start, or of the static flexibility at a row
INEXACT = 1e-8  # of omega^2 of the levels on which a base was judged


def base_warnings(model: MultiPhiModel, loads: np.ndarray, **start: np.ndarray | None) -> Iterator[str]:
    """Warnings of rows (k, n) of loads, of x and x' (n,) of a start by their names, and of the levels."""
    base = model.base
    if base.error > INEXACT:
        yield f"base: squares of frequencies of levels may be off by {base.error:.2g}; need more modes, or modes='all'"
    for row in model.lacking(loads):
        yield from _base_warning(model, model.outside(row), "the static flexibility at a load")
    for name, vector in start.items():
        if vector is not None:
            yield from _base_warning(model, _share_outside(model, np.asarray(vector, float)), f"the start's {name}")


def row_warnings(model: MultiPhiModel, row: np.ndarray) -> Iterator[str]:
    """Warning of a row (n,) that is no point."""
    yield from _base_warning(model, model.outside(row), "the static flexibility at a row")


def _share_outside(model: MultiPhiModel, vector: np.ndarray) -> float:
    """|x - Phi Phi^T M x| / |x| in the norm of M."""
    shapes, mass = model.base.modes.shapes, model.base.mass
    outside = vector - shapes @ (shapes.T @ (mass @ vector))
    square = float(vector @ (mass @ vector))
    return math.sqrt(max(float(outside @ (mass @ outside)), 0.0) / square) if square > 0 else 0.0


def _base_warning(model: MultiPhiModel, share: float, what: str) -> Iterator[str]:
    """Warning where the share of something outside the base is not small."""
    if share >= OUTSIDE:
        yield (
            f"base: {100 * share:.2g} % of {what} lies outside the {model.base.modes.count} coordinates of the levels' "
            "base; give the model more modes, or make it a point"
        )
