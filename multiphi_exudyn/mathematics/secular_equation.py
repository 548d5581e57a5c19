"""The secular equation: eigenvalues and vectors of a diagonal matrix to which one direction's stiffness is added.

    diag(d) + k p p^T:   1/k + sum_i p_i^2 / (d_i - x) = 0   (held rigidly: 1/k = 0),   v_i = p_i / (d_i - x)

There is one root between two neighbours among the d. Each is found as a distance from the nearer of them, all at once,
by the middle way between secant and Newton; so eigenvalues have the relative accuracy of the d, whatever k is, and the
vectors are orthogonal to round-off. What has no part in p is left as it is (deflation): components that are zero, and
of equal d all but one direction.
Source: R.-C. Li, Solving secular equations stably and efficiently, LAPACK Working Note 89 (1993).
"""

from __future__ import annotations

import itertools

import numpy as np

__all__ = ["rank_one_modes"]

EQUAL = 4 * np.finfo(float).eps  # of d: nearer ones are equal
ABSENT = 1e-16  # of |p| with weights 1 / d: smaller components have no part in it
MOST_STEPS = 60  # of the iteration; three to six are typical, and bisection alone needs some fifty
LAST = 1e-9  # of the distance from a pole: a step that is smaller is the last, as the next would be its square


def rank_one_modes(d: np.ndarray, p: np.ndarray, stiffness: float, count: int) -> tuple[np.ndarray, np.ndarray] | None:
    """The ``count`` lowest eigenvalues, ascending, and vectors (m, count); None where roots between the d are fewer.

    d: (m,), ascending, none negative. stiffness: k > 0, inf for the motions with p.v = 0 alone.
    """
    turns = _turns(d, p)
    own = p.copy()
    for first, last, turn in turns:
        own[first:last] = np.eye(1, last - first)[0] * float(turn[:, 0] @ p[first:last])
    sizes = own**2 / (d + d[min(count, len(d) - 1)])
    present = sizes > ABSENT**2 * np.sum(sizes)
    poles, left = np.flatnonzero(present), np.flatnonzero(~present)[:count]
    roots = min(count, len(poles) - 1)
    if roots < 1 or (roots < count and np.isfinite(stiffness)) or roots + len(left) < count:
        return None
    with np.errstate(divide="ignore", invalid="ignore"):  # a step that is not finite is none
        found, beside = _roots(d[poles], own[poles], 1 / stiffness, roots)
    if not (len(left) or turns):
        return found, beside
    values = np.concatenate([found, d[left]])
    order = np.argsort(values, kind="stable")[:count]
    vectors = np.zeros((len(d), len(values)))
    vectors[poles, :roots] = beside
    vectors[left, np.arange(roots, len(values))] = 1.0
    vectors = vectors[:, order]
    for first, last, turn in turns:
        vectors[first:last] = turn @ vectors[first:last]
    return values[order], vectors


def _turns(d: np.ndarray, p: np.ndarray) -> list[tuple[int, int, np.ndarray]]:
    """Of every cluster of equal d its first, one past its last, and a rotation whose first column is along p."""
    apart = np.diff(d) > EQUAL * d[1:]
    if np.all(apart):
        return []
    edges = [0, *(np.flatnonzero(apart) + 1).tolist(), len(d)]
    turns = []
    for first, last in itertools.pairwise(edges):
        if last - first > 1:
            along = p[first:last, None]
            turns.append((first, last, np.linalg.qr(np.hstack([along, np.eye(last - first)]))[0]))
    return turns


def _roots(d: np.ndarray, p: np.ndarray, yielding: float, count: int) -> tuple[np.ndarray, np.ndarray]:
    """The ``count`` lowest roots, and their vectors of unit length; yielding: 1/k."""
    index, squared = np.arange(count), p * p
    half = (d[1 : count + 1] - d[:count]) / 2
    middle = yielding + (1 / ((d - d[:count, None]) - half[:, None])) @ squared
    nearer, other = index + (middle < 0), index + (middle >= 0)
    apart = d - d[nearer][:, None]
    low, high = np.where(middle < 0, -half, 0.0), np.where(middle < 0, 0.0, half)
    lower, upper = apart[index, index], apart[index, index + 1]
    below = (np.arange(len(d)) <= index[:, None]).astype(float)
    x = _first(middle, squared[nearer], squared[other], lower + upper)
    x = np.where((x > low) & (x < high), x, (low + high) / 2)
    for _ in range(MOST_STEPS):
        terms = p / (apart - x[:, None])
        value = yielding + terms @ p
        low, high = np.where(value < 0, x, low), np.where(value > 0, x, high)
        terms *= terms
        slope, before = np.sum(terms, axis=1), np.einsum("ij,ij->i", terms, below)
        stepped = x + _middle_way(value, before, slope - before, lower - x, upper - x)
        stepped = np.where((stepped >= low) & (stepped <= high) & (stepped != 0), stepped, (low + high) / 2)
        moved, x = np.abs(stepped - x), stepped
        if np.all(moved <= LAST * np.abs(x)):
            break
    vectors = (p / (apart - x[:, None])).T
    return d[nearer] + x, vectors / np.linalg.norm(vectors, axis=0)


def _first(middle: np.ndarray, own: np.ndarray, other: np.ndarray, apart: np.ndarray) -> np.ndarray:
    """Distances from the nearer poles at which c - own / x + other / (apart - x) is zero, whose middle value is given.

    apart: of the other pole from the nearer one, with its sign; so a distance has all its digits, small as it may be.
    """
    c = middle + 2 * (own - other) / apart
    a, b = c * apart + own + other, own * apart
    root = np.sqrt(np.maximum(a * a - 4 * b * c, 0.0))
    return np.where(a <= 0, (a - root) / (2 * c), 2 * b / (a + root))


def _middle_way(
    value: np.ndarray, before: np.ndarray, after: np.ndarray, lower: np.ndarray, upper: np.ndarray
) -> np.ndarray:
    """Steps to the roots of c + s / (lower - x) + S / (upper - x), which has the value and both parts of the slope.

    before, after: the slopes that poles below and above make. lower, upper: distances to the poles on either side.
    """
    a = (lower + upper) * value - lower * upper * (before + after)
    b, c = lower * upper * value, value - lower * before - upper * after
    root = np.sqrt(np.maximum(a * a - 4 * b * c, 0.0))
    return np.where(a <= 0, (a - root) / (2 * c), 2 * b / (a + root))
