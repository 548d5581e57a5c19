"""Setting out: x, x' (n,) in coordinates of a complete base, and whether a contact is near, by one compiled call.

    y = Phi^T M x,   y' = Phi^T M x'                          zero where they are round-off of their terms

    h.y - b > a |h| (|y| + |t y'|)                            of a gap that is not near zero

Most starts touch nothing: they are spared what first_state.py asks of every contact.
"""

from __future__ import annotations

import math

import numpy as np

from multiphi_exudyn.levels.modal_base import ModalBase
from multiphi_exudyn.mathematics.compiling.compiled import Numbers, compiled, entry
from multiphi_exudyn.mathematics.round_off import clear_products

__all__ = ["SettingOut"]


@compiled
def is_far(room: Numbers, sizes: Numbers, n: int, links: int, near: float) -> int:
    """1 where no gap is near zero; 0 where one may be.

    room: x, x', y, y', t and the row sums of ``sizes``, (n,) each, h / |h| and b / |h| of every link, (n + 1,); y and
    y' lose what is round-off. sizes: |Phi|^T |M| (n, n). near: a.
    """
    y, v, times, units, squares, moved = 2 * n, 3 * n, 4 * n, 6 * n, 0.0, 0.0
    clear_products(room, y, 0, sizes, 5 * n, n)
    clear_products(room, v, n, sizes, 5 * n, n)
    for i in range(n):
        squares += room[y + i] * room[y + i]
        moved += (room[v + i] * room[times + i]) * (room[v + i] * room[times + i])
    length = math.sqrt(squares) + math.sqrt(moved)
    for k in range(links):
        row = units + k * (n + 1)
        gap = -room[row + n]
        for i in range(n):
            gap += room[row + i] * room[y + i]
        if not gap > near * length:
            return 0
    return 1 if length < math.inf else 0


looked = entry(is_far)


class SettingOut:
    """Starts in a complete base. times: t (n,) [s]; units, bounds: h / |h| (n, l), b / |h| (l,); near: a."""

    def __init__(self, base: ModalBase, times: np.ndarray, units: np.ndarray, bounds: np.ndarray, near: float) -> None:
        n, (onto, sizes) = len(times), base.projection
        links = np.vstack([units, bounds]).T
        room = np.concatenate([np.zeros(4 * n), times, sizes.sum(axis=1), links.ravel()])
        self._onto, (self._x, self._x_t, self._y, self._y_t) = onto, room[: 4 * n].reshape(4, n)
        self._given = room, sizes.ravel(), n, len(links), near

    def coordinates(
        self, x: np.ndarray | None, x_t: np.ndarray | None, compiled: bool | None
    ) -> tuple[np.ndarray, np.ndarray, bool]:
        """y, y' (n,) of x, x' (n,), None for zero, and whether one sees that no gap is near zero."""
        for given, place, result in ((x, self._x, self._y), (x_t, self._x_t, self._y_t)):
            if given is None:
                place[:] = result[:] = 0.0
            else:
                place[:] = given
                self._onto.dot(place, out=result)
        far = (looked.plain if compiled is False else looked)(*self._given)
        return self._y.copy(), self._y_t.copy(), far == 1
