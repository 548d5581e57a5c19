"""Links that rigid contacts hold: their directions are in the span of those of closed rigid contacts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from multiphi_exudyn.levels.base.modal_base import LENGTHS, ModalBase
from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, compiled, entry
from multiphi_exudyn.mathematics.eigenproblems.orthonormal import add_direction, scalar_product

__all__ = ["independent", "write_following"]

ALMOST = 0.99  # of a direction's square: with a smaller part in the span of others it is independent of them


def independent(base: ModalBase, rigid: Sequence[int]) -> bool:
    """Return whether the directions of these rigid contacts are linearly independent: they can be closed together."""
    m, k = base.modes.count, len(rigid)
    if k <= 1 or k > m:
        return k <= m and not any(base.unmoved[i] for i in rigid)
    lengths, memory = len(base.links) * (m + LENGTHS), np.empty((k + 1) * m)
    return bool(span(base.link_numbers, 0, lengths, np.array(rigid, int), 0, memory, 0, m, k))


@compiled
def write_span(
    links: Numbers, directions: int, lengths: int, rigid: Ints, first: int, scratch: Numbers, basis: int, m: int, k: int
) -> int:
    """Write unit vectors (k, m) of the space of k rigid links; return 1 where these are independent, else 0.

    links: holds the directions (m,) of all links from ``directions`` on, and their lengths from ``lengths`` on. rigid:
    numbers of the rigid ones, from ``first`` on. scratch: from ``basis`` on the unit vectors, and memory (m,).
    """
    for p in range(k):
        link = rigid[first + p]
        if add_direction(links, directions + link * m, links[lengths + link], scratch, basis, m, p) == 0:
            return 0
    return 1


@compiled
def write_following(
    links: Numbers, directions: int, lengths: int, scratch: Numbers, basis: int, flags: int, m: int, count: int, k: int
) -> None:
    """Set flags (count,) of links that k rigid ones hold, and of those that no mode moves.

    links: as in ``write_span``. scratch: from ``basis`` on what that has written, (k, m), and memory (m,); from
    ``flags`` on the flags.
    """
    for link in range(count):
        length, direction, square = links[lengths + link], directions + link * m, 0.0
        for p in range(k if length > 0.0 else 0):
            share = scalar_product(scratch, basis + p * m, links, direction, m) / length
            square += share * share
        scratch[flags + link] = 1.0 if length == 0.0 else 0.0
        if square > ALMOST and add_direction(links, direction, length, scratch, basis, m, k) == 0:
            scratch[flags + link] = 1.0


span = entry(write_span)
