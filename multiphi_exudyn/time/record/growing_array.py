"""Growing: an array that a run adds to, part by part, without copying what is there each time."""

from __future__ import annotations

import numpy as np

__all__ = ["Growing"]

BLOCK = 2**15  # rows of a block at most: a megabyte, that goes back to the system when blocks are joined
FILLED = 8  # of so many rows one is empty at most


class Growing:
    """An array to which parts are added, in blocks that are joined when somebody looks at it.

    A block is filled before the next; that has room for a ``FILLED``-th of the rows so far, up to ``BLOCK``.

    count: rows so far. bytes: what the blocks take.
    """

    def __init__(self, empty: np.ndarray) -> None:
        self._blocks, self._used = [empty], 0  # of the last block
        self.count = self.bytes = 0

    def add(self, part: np.ndarray) -> None:
        """Add a part, which is copied unless it is the first."""
        if not len(part):
            return
        if not self.count:
            self._blocks, self._used, self.count, self.bytes = [part], len(part), len(part), part.nbytes
            return
        last = self._blocks[-1]
        fitting = min(len(last) - self._used, len(part))
        last[self._used : self._used + fitting] = part[:fitting]
        self._used += fitting
        if rest := len(part) - fitting:
            last = np.empty((max(min(BLOCK, self.count // FILLED), rest), *part.shape[1:]), part.dtype)
            last[:rest] = part[fitting:]
            self._blocks.append(last)
            self._used = rest
            self.bytes += last.nbytes
        self.count += len(part)

    @property
    def whole(self) -> np.ndarray:
        """All parts."""
        if len(self._blocks) > 1:
            self._blocks[-1] = self._blocks[-1][: self._used]
            whole, end = np.empty((self.count, *self._blocks[0].shape[1:]), self._blocks[0].dtype), self.count
            while self._blocks:  # each goes as soon as it is copied
                start = end - len(self._blocks[-1])
                whole[start:end] = self._blocks.pop()
                end = start
            self._blocks, self._used, self.bytes = [whole], self.count, whole.nbytes
        return self._blocks[0]
