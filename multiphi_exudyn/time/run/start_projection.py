"""Start projection: x, x' (n,) in coordinates of a complete base, and a check for near contacts, in one compiled call.

    y = Phi^T M x,   y' = Phi^T M x'                          zero where they are round-off of their terms

    h.y - b > a |h| (|y| + |t y'|)                            of a gap that is not near zero

Most starts touch nothing: they need none of the checks of every contact in start.py.
"""

from __future__ import annotations

import math

import numpy as np

from multiphi_exudyn.levels.base.modal_base import ModalBase
from multiphi_exudyn.mathematics.compiling.compiled import Numbers, compiled, entry
from multiphi_exudyn.mathematics.orthonormal import clear_products

__all__ = ["StartProjection"]


@compiled
def is_far(arrays: Numbers, sizes: Numbers, n: int, links: int, near: float) -> int:
    """Return 1 where no gap is near zero, 0 where one may be.

    arrays: x, x', y, y', t and the row sums of ``sizes``, (n,) each, h / |h| and b / |h| of every link, (n + 1,); y and
    y' are cleared of round-off. sizes: |Phi|^T |M| (n, n). near: a.
    """
    y, v, times, units, displacement_squares, velocity_squares = 2 * n, 3 * n, 4 * n, 6 * n, 0.0, 0.0
    clear_products(arrays, y, 0, sizes, 5 * n, n)
    clear_products(arrays, v, n, sizes, 5 * n, n)
    for i in range(n):
        displacement_squares += arrays[y + i] * arrays[y + i]
        velocity_squares += (arrays[v + i] * arrays[times + i]) * (arrays[v + i] * arrays[times + i])
    length = math.sqrt(displacement_squares) + math.sqrt(velocity_squares)
    for k in range(links):
        row = units + k * (n + 1)
        gap = -arrays[row + n]
        for i in range(n):
            gap += arrays[row + i] * arrays[y + i]
        if not gap > near * length:
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
        self._onto, (self._x, self._x_t, self._y, self._y_t) = onto, arrays[: 4 * n].reshape(4, n)
        self._arguments = arrays, sizes.ravel(), n, len(links), near

    def coordinates(
        self, x: np.ndarray | None, x_t: np.ndarray | None, known: np.ndarray | None, compiled: bool | None
    ) -> tuple[np.ndarray, np.ndarray, bool]:
        """Return y, y' (n,) of x, x' (n,), None for zero, and whether the bound shows that no gap is near zero.

        known: y, where that is known and x is None.
        """
        for given, place, result in ((x, self._x, self._y), (x_t, self._x_t, self._y_t)):
            if given is None:
                place[:] = result[:] = 0.0
            else:
                place[:] = given
                self._onto.dot(place, out=result)
        if known is not None:
            self._y[:] = known
        far = (check_far.plain if compiled is False else check_far)(*self._arguments)
        return self._y.copy(), self._y_t.copy(), far == 1
