"""Growing array: rows are added part by part, without a copy of the earlier rows each time."""

from __future__ import annotations

import numpy as np

__all__ = ["GrowingArray"]

BLOCK = 2**15  # largest number of rows of a block: a megabyte, freed when blocks are joined
FILLED = 8  # at most one row in so many is empty


class GrowingArray:
    """Array to which parts are added, in blocks that are joined when it is read.

    A block is filled before the next one, which has room for a ``FILLED``-th of the rows so far, up to ``BLOCK``.

    count: number of rows so far. bytes: memory of the blocks.
    """

    def __init__(self, empty: np.ndarray) -> None:
        self._blocks, self._used = [empty], 0  # rows used in the last block
        self.count = self.bytes = 0

    def add(self, part: np.ndarray) -> None:
        """Add a part; all parts but the first are copied."""
        if not len(part):
            return
        if not self.count:
            self._blocks, self._used, self.count, self.bytes = [part], len(part), len(part), part.nbytes
            return
        last = self._blocks[-1]
        fitting = min(len(last) - self._used, len(part))
        last[self._used : self._used + fitting] = part[:fitting]
        self._used += fitting
        if remaining := len(part) - fitting:
            last = np.empty((max(min(BLOCK, self.count // FILLED), remaining), *part.shape[1:]), part.dtype)
            last[:remaining] = part[fitting:]
            self._blocks.append(last)
            self._used = remaining
            self.bytes += last.nbytes
        self.count += len(part)

    @property
    def whole(self) -> np.ndarray:
        """All rows as one array."""
        if len(self._blocks) > 1:
            self._blocks[-1] = self._blocks[-1][: self._used]
            whole, end = np.empty((self.count, *self._blocks[0].shape[1:]), self._blocks[0].dtype), self.count
            while self._blocks:  # each block is freed as soon as it is copied
                start = end - len(self._blocks[-1])
                whole[start:end] = self._blocks.pop()
                end = start
            self._blocks, self._used, self.bytes = [whole], self.count, whole.nbytes
        return self._blocks[0]
