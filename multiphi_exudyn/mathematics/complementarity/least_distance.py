"""Least distance programming: the shortest x that linear inequalities allow, by the dual active set method.

    min |x|^2,  A x >= b;    x = A^T p,  p >= 0,  p . (A x - b) = 0

Starting at x = 0 the most violated inequality becomes an equality, beside the active ones; one whose multiplier would
become negative is removed. The equalities are linearly independent at every step, and |x| grows with every step, so no
set recurs, and an inequality that depends on the active ones and contradicts them is found.

Sources: D. Goldfarb, A. Idnani, A numerically stable dual method for solving strictly convex quadratic programs,
Math. Programming 27 (1983); C. L. Lawson, R. J. Hanson, Solving Least Squares Problems, 1974, ch. 23.
"""

from __future__ import annotations

import numpy as np

from multiphi_exudyn.errors import NumericalFailure
from multiphi_exudyn.mathematics.round_off import ALIKE, FOLLOWING, INDEPENDENT, ZERO

__all__ = ["Infeasible", "least_distance"]

SETS = 20  # tried for every inequality: far fewer are needed


class Infeasible(NumericalFailure):
    """No x satisfies all inequalities; ``rows``: positions of those that exclude each other."""

    def __init__(self, rows: list[int]) -> None:
        super().__init__(f"inequalities {', '.join(map(str, rows))} exclude each other")
        self.rows = rows


def least_distance(rows: np.ndarray, least: np.ndarray, sizes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return (x (r,), p (k,)) for A = ``rows`` (k, r) and b = ``least`` (k,), the sum of terms of these ``sizes`` (k,).

    An inequality holds where its violation is round-off of its terms, or, if it depends on active ones, as small as the
    remainder of its row allows. The rows with p > 0 are linearly independent. Raises Infeasible where no x satisfies
    all of them, NumericalFailure where round-off prevents convergence.
    """
    if len(least) == 1:
        return _single(rows[0], float(least[0]), float(sizes[0]))
    lengths = np.linalg.norm(rows, axis=1)
    lengths[lengths == 0] = 1.0
    units, targets, sizes = rows / lengths[:, None], least / lengths, sizes / lengths
    x, active, shares = np.zeros(rows.shape[1]), list[int](), np.zeros(0)
    slack = np.full(len(least), ZERO)
    for _ in range(SETS * (len(least) + 1)):
        violations, terms = targets - units @ x, sizes + np.linalg.norm(x)
        violations[active] = 0.0
        violations[violations <= slack * terms] = 0.0
        if not np.any(violations):
            multipliers = np.zeros(len(least))
            multipliers[active] = shares
            return x, multipliers / lengths
        entering = int(np.argmax(violations >= (1 - ALIKE) * np.max(violations)))
        try:
            active, shares = _add_active(units, violations[entering], active, shares, entering)
        except Infeasible:
            if slack[entering] > ZERO or violations[entering] > FOLLOWING * terms[entering]:
                raise
            slack[entering] = FOLLOWING
            continue
        x, shares = _solve_equalities(units[active], targets[active])
    raise NumericalFailure("least distance: round-off decides which inequalities are active")


def _single(row: np.ndarray, least: float, size: float) -> tuple[np.ndarray, np.ndarray]:
    """Return ``least_distance`` of one inequality: a step along its row."""
    square = float(row @ row)
    if least <= ZERO * size:
        return np.zeros(len(row)), np.zeros(1)
    if square == 0.0:
        raise Infeasible([0])
    return row * (least / square), np.array([least / square])


def _add_active(
    units: np.ndarray, violation: float, active: list[int], shares: np.ndarray, entering: int
) -> tuple[list[int], np.ndarray]:
    """Return the active rows and their shares after one has entered and those of negative share are removed.

    violation: of the row that enters.
    """
    share = 0.0
    while True:
        coefficients, direction = _split(units[active], units[entering])
        decreasing = np.flatnonzero(coefficients > 0)
        steps = shares[decreasing] / coefficients[decreasing]
        longest = float(np.min(steps, initial=np.inf))
        reach = float(direction @ direction)
        full_step = violation / reach if reach > 0 else np.inf
        step = min(longest, full_step)
        if not np.isfinite(step):
            raise Infeasible([*sorted(active), entering])
        shares, share = shares - step * coefficients, share + step
        violation -= step * reach
        if full_step <= longest:
            return [*active, entering], np.append(shares, share)
        removed = int(decreasing[np.argmin(steps)])
        active, shares = active[:removed] + active[removed + 1 :], np.delete(shares, removed)


def _split(units: np.ndarray, row: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return (coefficients of ``units`` in a row, its remainder beside them), zero for a dependent row.

    A row is dependent where there are as many units as unknowns, whatever round-off nearly parallel ones leave.
    """
    if not len(units):
        return np.zeros(0), row
    coefficients = np.linalg.lstsq(units.T, row, rcond=None)[0]
    remainder = row - coefficients @ units
    return coefficients, remainder if len(units) < len(row) and np.linalg.norm(
        remainder
    ) > INDEPENDENT else np.zeros_like(row)


def _solve_equalities(units: np.ndarray, targets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the shortest x with units x = targets, and the shares of its rows, not below zero."""
    q, r = np.linalg.qr(units.T)
    components = np.linalg.solve(r.T, targets)
    return q @ components, np.maximum(np.linalg.solve(r, components), 0.0)
