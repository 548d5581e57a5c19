"""Least distance programming: the shortest x that linear inequalities allow.

    min |x|^2,  A x >= b;    x = A^T p,  p >= 0,  p . (A x - b) = 0

It is the small complementarity problem (core/complementarity.hpp) with G = A and bounds 0 <= p.
"""

from __future__ import annotations

import numpy as np

from multiphi_exudyn._core import SmallProblem
from multiphi_exudyn.errors import NumericalFailure

__all__ = ["Infeasible", "least_distance"]


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
    zero = np.zeros(len(least))
    problem = SmallProblem(rows, -least, sizes, lower=zero, upper=zero + np.inf)
    outcome = problem.solve(SmallProblem.Order.most_violated)
    if outcome == SmallProblem.Outcome.excluded:
        raise Infeasible(problem.excluding)
    if outcome != SmallProblem.Outcome.solved:
        raise NumericalFailure("least distance: round-off decides which inequalities are active")
    return problem.change, problem.multipliers
