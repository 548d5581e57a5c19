"""The secular equation: eigenvalues and vectors of a diagonal matrix to which one direction's stiffness is added.

    diag(d) + k p p^T:   1/k + sum_i p_i^2 / (d_i - x) = 0   (held rigidly: 1/k = 0),   v_i = p_i / (d_i - x)

There is one root between two neighbours among the d. LAPACK's dlasd4 finds each as a distance from the nearer of them,
in sqrt(x) and sqrt(d), by the middle way between secant and Newton; so eigenvalues have the relative accuracy of the d,
whatever k is, and the vectors are orthogonal to round-off; but for the two roots beside a d that round-off alone tells
from them: their vectors are right together, and not one by one. What has no part in p is left as it is (deflation):
components that are zero or round-off, and of equal d all but one direction.
Source: R.-C. Li, Solving secular equations stably and efficiently, LAPACK Working Note 89 (1993).
"""

from __future__ import annotations

import itertools
import math

import numpy as np
from scipy.linalg.lapack import dlasd4

__all__ = ["rank_one_modes"]

EQUAL = 4 * np.finfo(float).eps  # of d: nearer ones are equal
ABSENT = 1e-16  # of |p| with weights 1 / d: smaller components have no part in it
NOISE = 2e-14  # of |p|: round-off of modes that do not move in this direction


def rank_one_modes(d: np.ndarray, p: np.ndarray, stiffness: float, count: int) -> tuple[np.ndarray, np.ndarray] | None:
    """The ``count`` lowest eigenvalues, ascending, and vectors (m, count); None where roots between the d are fewer.

    d: (m,), ascending, none negative. stiffness: k > 0, inf for the motions with p.v = 0 alone.
    """
    turns, own = _turns(d, p), p
    if turns:
        own = p.copy()
        for first, last, turn in turns:
            own[first:last] = np.eye(1, last - first)[0] * float(turn[:, 0] @ p[first:last])
    sizes = own * own / (d + d[min(count, len(d) - 1)])
    present = (sizes > ABSENT**2 * sizes.sum()) & (np.abs(own) > NOISE * math.sqrt(p @ p))
    if count < len(d) and not turns and present.all():
        return _roots(d, p, stiffness, count)
    poles, left = np.flatnonzero(present), np.flatnonzero(~present)[:count]
    roots = min(count, len(poles) - 1)
    if roots < 1 or (roots < count and np.isfinite(stiffness)) or roots + len(left) < count:
        return None
    found = _roots(d[poles], own[poles], stiffness, roots)
    if found is None:
        return None
    values = np.concatenate([found[0], d[left]])
    order = np.argsort(values, kind="stable")[:count]
    vectors = np.zeros((len(d), len(values)))
    vectors[poles, :roots] = found[1]
    vectors[left, np.arange(roots, len(values))] = 1.0
    vectors = vectors[:, order]
    for first, last, turn in turns:
        vectors[first:last] = turn @ vectors[first:last]
    return values[order], vectors


def _turns(d: np.ndarray, p: np.ndarray) -> list[tuple[int, int, np.ndarray]]:
    """Of every cluster of equal d its first, one past its last, and a rotation whose first column is along p."""
    apart = d[1:] - d[:-1] > EQUAL * d[1:]
    if apart.all():
        return []
    edges = [0, *(np.flatnonzero(apart) + 1).tolist(), len(d)]
    turns = []
    for first, last in itertools.pairwise(edges):
        if last - first > 1:
            along = p[first:last, None]
            turns.append((first, last, np.linalg.qr(np.hstack([along, np.eye(last - first)]))[0]))
    return turns


def _roots(d: np.ndarray, p: np.ndarray, stiffness: float, count: int) -> tuple[np.ndarray, np.ndarray] | None:
    """The ``count`` lowest roots, and their vectors of unit length; None where the iteration fails."""
    omega, length = np.sqrt(d), math.sqrt(p @ p)
    along, size = p / length, stiffness * length**2
    apart = np.empty((count, len(d)))  # d - x
    for i in range(count):
        below, _, above, failed = dlasd4(i, omega, along, size)
        if failed:
            return None
        np.multiply(below, above, out=apart[i])
    before, after = (apart.ravel()[i :: len(d) + 1][:count] for i in range(2))  # the neighbours'
    values = np.where(after < -before, d[1 : count + 1] - after, d[:count] - before)
    vectors = along / apart
    vectors *= 1 / np.sqrt(np.einsum("ij,ij->i", vectors, vectors))[:, None]
    return values, vectors.T
