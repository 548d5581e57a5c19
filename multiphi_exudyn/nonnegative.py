"""Non-negative least squares: argmin |A x - b| over x >= 0, by active sets.

    x_P = argmin |A_P x_P - b|,  x = 0 elsewhere,  A^T (b - A x) <= 0 where x = 0

A column enters P where the residual pushes it most, unless its own share would come out negative; columns whose share
turns negative leave on the way there. |A x - b| falls with every set, so none comes back.

``scipy.optimize.nnls`` answers wrongly, without a word, where round-off makes several columns equally willing
(1.15 and later); contacts at rest beside one that is struck are such columns.

Source: C. L. Lawson, R. J. Hanson, Solving Least Squares Problems, 1974, ch. 23.
"""

from __future__ import annotations

import numpy as np

from multiphi_exudyn.errors import NumericalFailure

__all__ = ["nonnegative_least_squares"]

ROUND_OFF = 1e-15  # of the terms of A^T (b - A x): a push below it is none
SETS = 10  # tried for every column: with distinct residuals far fewer are


def nonnegative_least_squares(matrix: np.ndarray, target: np.ndarray) -> np.ndarray:
    """x (k,) >= 0 with the least |A x - b|, for A (m, k) and b (m,).

    Raises NumericalFailure where round-off keeps the sets from settling.
    """
    x, refused = np.zeros(matrix.shape[1]), np.zeros(matrix.shape[1], bool)
    sizes = np.abs(matrix).T
    for _ in range(SETS * (len(x) + 1)):
        push = matrix.T @ (target - matrix @ x)
        noise = ROUND_OFF * (sizes @ (np.abs(target) + np.abs(matrix) @ x))
        willing = (push > noise) & (x == 0) & ~refused
        if not np.any(willing):
            return x
        entering = int(np.argmax(np.where(willing, push, 0.0)))
        passive = x > 0
        passive[entering] = True
        wanted = _shares(matrix, target, passive)
        if wanted[entering] <= 0:
            refused[entering] = True
            continue
        x = _admissible(matrix, target, x, wanted, passive)
        refused[:] = False
    raise NumericalFailure("non-negative least squares: round-off decides which contacts press")


def _shares(matrix: np.ndarray, target: np.ndarray, passive: np.ndarray) -> np.ndarray:
    """The least squares solution with these columns alone."""
    x = np.zeros(len(passive))
    x[passive] = np.linalg.lstsq(matrix[:, passive], target, rcond=None)[0]
    return x


def _admissible(
    matrix: np.ndarray, target: np.ndarray, x: np.ndarray, wanted: np.ndarray, passive: np.ndarray
) -> np.ndarray:
    """From x towards the solution ``wanted`` of the columns ``passive``, those left out that turn negative."""
    while np.any(negative := passive & (wanted <= 0)):
        ways = x[negative] / (x[negative] - wanted[negative])
        nearest = np.flatnonzero(negative)[int(np.argmin(ways))]
        x = np.maximum(x + np.min(ways) * (wanted - x), 0.0)
        passive = passive & (x > 0)
        passive[nearest] = False
        wanted = _shares(matrix, target, passive)
    return wanted
