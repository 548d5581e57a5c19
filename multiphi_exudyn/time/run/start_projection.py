"""Start projection: x, x' (n,) in coordinates of a complete base, and a quick check for near contacts.

    y = Phi^T M x,   y' = Phi^T M x'                          zero where they are round-off of their terms

Most starts touch nothing: they need none of the checks of every contact in start.py (core/start_projection.hpp).
"""

from __future__ import annotations

import numpy as np

import multiphi_exudyn._core as core
from multiphi_exudyn.levels.base.modal_base import ModalBase

__all__ = ["StartProjection"]


class StartProjection:
    """Projection of starts to a complete base.

    times: t (n,) [s]; units, bounds: h / |h| (n, l), b / |h| (l,); near: a.
    """

    def __init__(self, base: ModalBase, times: np.ndarray, units: np.ndarray, bounds: np.ndarray, near: float) -> None:
        self._onto, sizes = base.projection
        self._vectors = np.zeros((4, len(times)))  # x, x', y, y'
        self._check = core.StartProjection(sizes, times, units.T, bounds, near)

    def coordinates(self, x: np.ndarray | None, x_t: np.ndarray | None) -> tuple[np.ndarray, np.ndarray, bool]:
        """Return y, y' (n,) of x, x' (n,), None for zero, and whether the bound shows that no gap is near zero."""
        vectors = self._vectors
        vectors[:] = 0.0
        for i, given in enumerate((x, x_t)):
            if given is not None:
                vectors[i] = given
                self._onto.dot(vectors[i], out=vectors[2 + i])
        far = self._check.is_far(vectors)
        y, v = vectors[2:].copy()
        return y, v, far

    def is_far_at_rest(self, y: np.ndarray) -> bool:
        """Whether the bound shows that no gap is near zero at y (n,)."""
        self._vectors[:] = 0.0
        self._vectors[2] = y
        return bool(self._check.is_far(self._vectors))
