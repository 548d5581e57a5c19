"""Start projection: x, x' (n,) in coordinates of a complete base, and a check for near contacts, in one compiled call.

    y = Phi^T M x,   y' = Phi^T M x'                          zero where they are round-off of their terms

    h.y - b > a |h| (|y| + |t y'|)                            of a gap that is not near zero

Most starts touch nothing: they need none of the checks of every contact in start.py.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable

import numpy as np

from multiphi_exudyn.levels.base.modal_base import ModalBase
from multiphi_exudyn.mathematics.compiling.compiled import Numbers, compiled, entry
from multiphi_exudyn.mathematics.orthonormal import clear_products, norm, scalar_product

__all__ = ["StartProjection"]


@compiled
def is_far(arrays: Numbers, sizes: Numbers, n: int, links: int, near: float) -> int:
    """Return 1 where no gap is near zero, 0 where one may be.

    arrays: x, x', y, y', t and the row sums of ``sizes``, (n,) each, h / |h| and b / |h| of every link, (n + 1,); y and
    y' are cleared of round-off. sizes: |Phi|^T |M| (n, n). near: a.
    """
    y, v, times, units, velocity_squares = 2 * n, 3 * n, 4 * n, 6 * n, 0.0
    clear_products(arrays, y, 0, sizes, 5 * n, n)
    clear_products(arrays, v, n, sizes, 5 * n, n)
    for i in range(n):
        velocity_squares += (arrays[v + i] * arrays[times + i]) * (arrays[v + i] * arrays[times + i])
    length = norm(arrays, y, n) + math.sqrt(velocity_squares)
    for k in range(links):
        row = units + k * (n + 1)
        if not scalar_product(arrays, row, arrays, y, n) - arrays[row + n] > near * length:
            return 0
    return 1 if length < math.inf else 0


check_far = entry(is_far)


class StartProjection:
    """Projection of starts to a complete base.

    times: t (n,) [s]; units, bounds: h / |h| (n, l), b / |h| (l,); near: a.
    """

    def __init__(self, base: ModalBase, times: np.ndarray, units: np.ndarray, bounds: np.ndarray, near: float) -> None:
        n, (onto, sizes) = len(times), base.projection
        links = np.vstack([units, bounds]).T
        arrays = np.concatenate([np.zeros(4 * n), times, sizes.sum(axis=1), links.ravel()])
        self._onto, self._vectors = onto, arrays[: 4 * n].reshape(4, n)
        self._arguments = arrays, sizes.ravel(), n, len(links), near

    @functools.cached_property
    def _is_far(self) -> Callable[..., int]:
        """The compiled check of these arrays."""
        return check_far.bound(*self._arguments[:2])

    def coordinates(
        self, x: np.ndarray | None, x_t: np.ndarray | None, compiled: bool | None
    ) -> tuple[np.ndarray, np.ndarray, bool]:
        """Return y, y' (n,) of x, x' (n,), None for zero, and whether the bound shows that no gap is near zero."""
        vectors = self._vectors
        vectors[:] = 0.0
        for i, given in enumerate((x, x_t)):
            if given is not None:
                vectors[i] = given
                self._onto.dot(vectors[i], out=vectors[2 + i])
        far = self._check(compiled)
        y, v = vectors[2:].copy()
        return y, v, far

    def is_far_at_rest(self, y: np.ndarray, compiled: bool | None) -> bool:
        """Whether the bound shows that no gap is near zero at y (n,)."""
        self._vectors[:] = 0.0
        self._vectors[2] = y
        return self._check(compiled)

    def _check(self, compiled: bool | None) -> bool:
        """Clear y, y' of round-off, and return whether the bound shows that no gap is near zero."""
        is_far = check_far.plain(*self._arguments) if compiled is False else self._is_far(*self._arguments[2:])
        return bool(is_far)
