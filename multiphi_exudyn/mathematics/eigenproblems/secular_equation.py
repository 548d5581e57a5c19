"""The secular equation: eigenvalues and vectors of a diagonal matrix to which one direction's stiffness is added.

    diag(d) + k p p^T:   1/k + sum_i p_i^2 / (d_i - x) = 0   (held rigidly: 1/k = 0),   v_i = p_i / (d_i - x)

There is one root between two neighbours d_l < d_u. It is found as a distance from the nearer of them, by zeros of

    c + a / (d_l - x) + b / (d_u - x)

whose c, a and b follow from the sums over the d up to d_l and from d_u on, and from their slopes; so eigenvalues have
the relative accuracy of the d, whatever k is, and the vectors are orthogonal to round-off; but for the two roots beside
a d that round-off alone tells from them: their vectors are right together, and not one by one. What has no part in p is
left as it is (deflation): components that are zero or round-off, and of equal d all but one direction.
Source: R.-C. Li, Solving secular equations stably and efficiently, LAPACK Working Note 89 (1993).
"""

from __future__ import annotations

import itertools
import math

import numpy as np

from multiphi_exudyn.mathematics.compiling.compiled import Numbers, compiled, entry

__all__ = ["rank_one_modes"]

EQUAL = 4 * float(np.finfo(float).eps)  # of d: nearer ones are equal
ABSENT = 1e-16  # of |p| with weights 1 / d: smaller components have no part in it
NOISE = 2e-14  # of |p|: round-off of modes that do not move in this direction

EPSILON = float(np.finfo(float).eps)
ROUNDED = 8.0  # of the round-off of one term: what their sum may have
SLOW = 0.1  # of the value before: a step that leaves more is followed by one of the other kind
MOST_STEPS = 100  # of a root; three to eight are typical
FAR = 16.0  # times the d beside the highest root: sums over larger d are power series of x
ORDERS = 14  # of such a series, the next one is round-off
SIZE, SLOPE_BELOW, SLOPE_ABOVE, SERIES = range(4)  # sums: their round-off over epsilon, slopes to d_l and beyond
SUMS = SERIES + ORDERS
NOT_WHOLE = -1


def rank_one_modes(d: np.ndarray, p: np.ndarray, stiffness: float, count: int) -> tuple[np.ndarray, np.ndarray] | None:
    """The ``count`` lowest eigenvalues, ascending, and vectors (m, count); None where roots between the d are fewer.

    d: (m,), ascending, none negative. stiffness: k > 0, inf for the motions with p.v = 0 alone.
    """
    if count < len(d):
        numbers = _arranged(d, p, count)
        outcome = find_roots(numbers, len(d), count, 1 / stiffness, 1)
        if outcome != NOT_WHOLE:
            return _found(numbers, len(d), count) if outcome else None
    turns, own = _turns(d, p), p
    if turns:
        own = p.copy()
        for first, last, turn in turns:
            own[first:last] = np.eye(1, last - first)[0] * float(turn[:, 0] @ p[first:last])
    sizes = own * own / (d + d[min(count, len(d) - 1)])
    present = (sizes > ABSENT**2 * sizes.sum()) & (np.abs(own) > NOISE * math.sqrt(p @ p))
    poles, left = np.flatnonzero(present), np.flatnonzero(~present)[:count]
    roots = min(count, len(poles) - 1)
    if roots < 1 or (roots < count and np.isfinite(stiffness)) or roots + len(left) < count:
        return None
    numbers = _arranged(d[poles], own[poles], roots)
    if not find_roots(numbers, len(poles), roots, 1 / stiffness, 0):
        return None
    found = _found(numbers, len(poles), roots)
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


def _arranged(d: np.ndarray, p: np.ndarray, count: int) -> np.ndarray:
    """d and p (m,), and room for so many roots, as ``roots`` has them."""
    m = len(d)
    numbers = np.empty(2 * m + SUMS + count * (1 + m))
    numbers[:m], numbers[m : 2 * m] = d, p
    return numbers


def _found(numbers: np.ndarray, m: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """The ``count`` lowest roots, and their vectors of unit length."""
    found = numbers[2 * m + SUMS :]
    return found[:count], found[count:].reshape(count, m).T


@compiled
def is_whole(numbers: Numbers, m: int, count: int) -> int:
    """Whether no two d are equal, and all take part in p, so that nothing is left as it is; numbers: d, p (m,)."""
    square, weighted, reference = 0.0, 0.0, numbers[count]
    for j in range(m):
        if j + 1 < m and numbers[j + 1] - numbers[j] <= EQUAL * numbers[j + 1]:
            return 0
        own = numbers[m + j] * numbers[m + j]
        square += own
        weighted += own / (numbers[j] + reference)
    for j in range(m):
        own = numbers[m + j] * numbers[m + j]
        if own <= NOISE * NOISE * square or own / (numbers[j] + reference) <= ABSENT * ABSENT * weighted:
            return 0
    return 1


@compiled
def roots(numbers: Numbers, m: int, count: int, yielding: float, asked: int) -> int:
    """Whether all are found. numbers: d, p (m,), sums, then roots (count,) and vectors (count, m); yielding: 1 / k.

    asked: 1 where it is NOT_WHOLE that has to come back if something is to be left as it is.
    """
    if asked == 1 and is_whole(numbers, m, count) == 0:
        return NOT_WHOLE
    sums, found, near = 2 * m, 2 * m + SUMS, count + 1
    while near < m and numbers[near] <= FAR * numbers[count]:
        near += 1
    expand(numbers, m, near)
    for i in range(count):
        vector = found + count + i * m
        lower, upper = numbers[m + i] * numbers[m + i], numbers[m + i + 1] * numbers[m + i + 1]
        gap = numbers[i + 1] - numbers[i]
        value = add_up(numbers, m, near, i, i, 0.5 * gap, yielding, vector)
        rest = value - 2.0 * (upper - lower) / gap
        if value >= 0.0:
            nearer, start = i, smaller_zero(rest, rest * gap + lower + upper, lower * gap)
        else:
            nearer, start = i + 1, -smaller_zero(-rest, lower + upper - rest * gap, upper * gap)
        distance = refined(numbers, m, near, i, nearer, start, yielding, vector)
        if distance == 0.0:
            return 0
        numbers[found + i] = numbers[nearer] + distance
        scale = 1.0 / math.sqrt(numbers[sums + SLOPE_BELOW] + numbers[sums + SLOPE_ABOVE])
        for j in range(near):
            numbers[vector + j] *= scale
        for j in range(near, m):
            numbers[vector + j] = scale * numbers[m + j] / (numbers[j] - numbers[nearer] - distance)
    return 1


@compiled
def expand(numbers: Numbers, m: int, near: int) -> None:
    """Sums over the d from ``near`` on of p^2 / d (d_near / d)^k, with which the powers of x / d_near are taken."""
    series = 2 * m + SERIES
    for k in range(ORDERS):
        numbers[series + k] = 0.0
    for j in range(near, m):
        part, ratio = numbers[m + j] * numbers[m + j] / numbers[j], numbers[near] / numbers[j]
        for k in range(ORDERS):
            numbers[series + k] += part
            part *= ratio


@compiled
def refined(
    numbers: Numbers, m: int, near: int, i: int, nearer: int, start: float, yielding: float, vector: int
) -> float:
    """The distance of root i from the nearer of its neighbours, iterated from ``start``; 0 where that fails."""
    sums, gap = 2 * m, numbers[i + 1] - numbers[i]
    lowest, highest = (0.0, 0.5 * gap) if nearer == i else (-0.5 * gap, 0.0)
    distance, before, by_weight = start, 0.0, 1
    for _ in range(MOST_STEPS):
        if not lowest < distance < highest:
            distance = 0.5 * (lowest + highest)
        value = add_up(numbers, m, near, i, nearer, distance, yielding, vector)
        below, above = numbers[sums + SLOPE_BELOW], numbers[sums + SLOPE_ABOVE]
        slope = below + above
        if abs(value) < EPSILON * (numbers[sums + SIZE] + abs(distance) * slope):
            return distance
        if value < 0.0:
            lowest = distance
        else:
            highest = distance
        if before * value > 0.0 and abs(value) > SLOW * abs(before):
            by_weight = 1 - by_weight
        before = value
        down, up = numbers[i] - numbers[nearer] - distance, numbers[i + 1] - numbers[nearer] - distance
        rest = value - down * below - up * above
        if by_weight == 1:
            own, other = (up, -gap) if nearer == i else (down, gap)
            rest = value - own * slope - other * numbers[vector + nearer] * numbers[vector + nearer]
        change = smaller_zero(rest, (down + up) * value - down * up * slope, down * up * value)
        if not change * value < 0.0:
            change = -value / slope
        if distance + change == distance:
            return distance
        distance += change
    return 0.0


@compiled
def smaller_zero(c: float, a: float, b: float) -> float:
    """Of c x^2 - a x + b the zero that tends to b / a as c vanishes, where a is positive."""
    root = math.sqrt(abs(a * a - 4.0 * b * c))
    if a > 0.0:
        return 2.0 * b / (a + root)
    return (a - root) / (2.0 * c) if c != 0.0 else 0.0


@compiled
def add_up(
    numbers: Numbers, m: int, near: int, i: int, nearer: int, distance: float, yielding: float, vector: int
) -> float:
    """The secular equation's left side at d_nearer + distance; slopes up to d_i and beyond; p / (d - x) to ``near``."""
    sums, origin = 2 * m, numbers[nearer]
    below, slope_below, above, slope_above = 0.0, 0.0, 0.0, 0.0
    for j in range(i + 1):
        ratio = numbers[m + j] / (numbers[j] - origin - distance)
        numbers[vector + j] = ratio
        below += numbers[m + j] * ratio
        slope_below += ratio * ratio
    for j in range(i + 1, near):
        ratio = numbers[m + j] / (numbers[j] - origin - distance)
        numbers[vector + j] = ratio
        above += numbers[m + j] * ratio
        slope_above += ratio * ratio
    if near < m:
        share, far, slope = (origin + distance) / numbers[near], 0.0, 0.0
        for k in range(ORDERS):
            slope = slope * share + far
            far = far * share + numbers[sums + SUMS - 1 - k]
        above += far
        slope_above += slope / numbers[near]
    numbers[sums + SIZE] = ROUNDED * (above - below) + yielding
    numbers[sums + SLOPE_BELOW], numbers[sums + SLOPE_ABOVE] = slope_below, slope_above
    return yielding + below + above


find_roots = entry(roots)
