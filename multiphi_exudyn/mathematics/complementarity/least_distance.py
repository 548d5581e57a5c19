"""Least distance programming: the shortest x that linear inequalities allow, by the dual active set method.

    min |x|^2,  A x >= b;    x = A^T p,  p >= 0,  p . (A x - b) = 0

From x = 0 on the inequality that is violated most becomes an equality, beside all before it that still push; one that
would have to pull leaves on the way. The equalities are independent of each other at every step, |x| grows with every
step, so no set comes back, and an inequality that follows from those that push, and contradicts them, is found.

Sources: D. Goldfarb, A. Idnani, A numerically stable dual method for solving strictly convex quadratic programs,
Math. Programming 27 (1983); C. L. Lawson, R. J. Hanson, Solving Least Squares Problems, 1974, ch. 23.
"""

from __future__ import annotations

import numpy as np

from multiphi_exudyn.errors import NumericalFailure
from multiphi_exudyn.mathematics.round_off import ZERO

__all__ = ["FOLLOWING", "INDEPENDENT", "Infeasible", "least_distance"]

INDEPENDENT = 1e-10  # of its length: what is left of a direction beside others, below which it follows from them
FOLLOWING = 10 * INDEPENDENT  # of its terms: what an inequality that follows from others may lack beside them
ALIKE = 1e-10  # of the largest lack: those that lack as much to round-off are one, and the first of them enters
SETS = 20  # tried for every inequality: far fewer are needed


class Infeasible(NumericalFailure):
    """No x meets all inequalities; ``rows``: positions of those that exclude each other."""

    def __init__(self, rows: list[int]) -> None:
        super().__init__(f"inequalities {', '.join(map(str, rows))} exclude each other")
        self.rows = rows


def least_distance(rows: np.ndarray, least: np.ndarray, sizes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(x (r,), p (k,)) for A = ``rows`` (k, r) and b = ``least`` (k,), the sum of terms of these ``sizes`` (k,).

    An inequality holds where what it lacks is round-off of its terms, and beside those that it follows from where it is
    as small as what is left of its row beside theirs may be. The rows with p > 0 are independent of each other. Raises
    Infeasible where no x meets all of them, NumericalFailure where round-off keeps the sets from settling.
    """
    if len(least) == 1:
        return _single(rows[0], float(least[0]), float(sizes[0]))
    lengths = np.linalg.norm(rows, axis=1)
    lengths[lengths == 0] = 1.0
    units, wanted, sizes = rows / lengths[:, None], least / lengths, sizes / lengths
    x, pushing, shares = np.zeros(rows.shape[1]), list[int](), np.zeros(0)
    slack = np.full(len(least), ZERO)
    for _ in range(SETS * (len(least) + 1)):
        lacking, terms = wanted - units @ x, sizes + np.linalg.norm(x)
        lacking[pushing] = 0.0
        lacking[lacking <= slack * terms] = 0.0
        if not np.any(lacking):
            multipliers = np.zeros(len(least))
            multipliers[pushing] = shares
            return x, multipliers / lengths
        entering = int(np.argmax(lacking >= (1 - ALIKE) * np.max(lacking)))
        try:
            pushing, shares = _entered(units, lacking[entering], pushing, shares, entering)
        except Infeasible:
            if slack[entering] > ZERO or lacking[entering] > FOLLOWING * terms[entering]:
                raise
            slack[entering] = FOLLOWING
            continue
        x, shares = _meeting(units[pushing], wanted[pushing])
    raise NumericalFailure("least distance: round-off decides which inequalities are active")


def _single(row: np.ndarray, least: float, size: float) -> tuple[np.ndarray, np.ndarray]:
    """``least_distance`` of one inequality: the step along its row that it lacks."""
    square = float(row @ row)
    if least <= ZERO * size:
        return np.zeros(len(row)), np.zeros(1)
    if square == 0.0:
        raise Infeasible([0])
    return row * (least / square), np.array([least / square])


def _entered(
    units: np.ndarray, lacking: float, pushing: list[int], shares: np.ndarray, entering: int
) -> tuple[list[int], np.ndarray]:
    """The equalities, and their shares, after one more has come in and those that would have to pull have gone.

    lacking: of the one that enters.
    """
    share = 0.0
    while True:
        taken, way = _split(units[pushing], units[entering])
        falling = np.flatnonzero(taken > 0)
        steps = shares[falling] / taken[falling]
        until = float(np.min(steps, initial=np.inf))
        reach = float(way @ way)
        whole = lacking / reach if reach > 0 else np.inf
        step = min(until, whole)
        if not np.isfinite(step):
            raise Infeasible([*sorted(pushing), entering])
        shares, share = shares - step * taken, share + step
        lacking -= step * reach
        if whole <= until:
            return [*pushing, entering], np.append(shares, share)
        gone = int(falling[np.argmin(steps)])
        pushing, shares = pushing[:gone] + pushing[gone + 1 :], np.delete(shares, gone)


def _split(units: np.ndarray, row: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(shares of ``units`` in a row, what is left of it beside them); nothing is left of one that follows from them.

    It does where they are as many as unknowns, whatever the round-off that nearly parallel ones leave.
    """
    if not len(units):
        return np.zeros(0), row
    taken = np.linalg.lstsq(units.T, row, rcond=None)[0]
    left = row - taken @ units
    return taken, left if len(units) < len(row) and np.linalg.norm(left) > INDEPENDENT else np.zeros_like(row)


def _meeting(units: np.ndarray, wanted: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The shortest x with units x = wanted, and the shares of its rows, none where one is round-off below zero."""
    q, r = np.linalg.qr(units.T)
    along = np.linalg.solve(r.T, wanted)
    return q @ along, np.maximum(np.linalg.solve(r, along), 0.0)
