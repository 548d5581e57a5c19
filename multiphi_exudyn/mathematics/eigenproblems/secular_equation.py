"""The secular equation: eigenvalues and vectors of a diagonal matrix to which one direction's stiffness is added.

    diag(d) + k p p^T:   1/k + sum_i p_i^2 / (d_i - x) = 0   (rigid: 1/k = 0),   v_i = p_i / (d_i - x)

There is one root between two neighbours d_l < d_u, and of a spring one above the highest d. It is found as a distance
from the nearer of them, by zeros of

    c + a / (d_l - x) + b / (d_u - x)

whose c, a and b follow from the sums over the d up to d_l and from d_u on, and from their slopes; so eigenvalues have
the relative accuracy of the d, for any k, and the vectors are orthogonal to round-off. The exception are two roots next
to a d from which they differ by round-off alone: their vectors are correct as a pair only. Unit vectors without a part
in p are deflated: components that are zero or round-off, and of equal d all but one direction.
Source: R.-C. Li, Solving secular equations stably and efficiently, LAPACK Working Note 89 (1993).
"""

from __future__ import annotations

import itertools
import math

import numpy as np

from multiphi_exudyn.mathematics.compiling.compiled import Numbers, compiled, entry
from multiphi_exudyn.mathematics.orthonormal import remove_direction

__all__ = ["rank_one_modes"]

EQUAL = 4 * float(np.finfo(float).eps)  # of d: nearer ones are equal
ABSENT = 1e-16  # of |p| with weights 1 / d: smaller components are deflated
NOISE = 2e-14  # of |p|: round-off of modes without motion in this direction

EPSILON = float(np.finfo(float).eps)
ROUNDED = 8.0  # round-off of a sum, in units of the round-off of one term
SLOW = 0.1  # of the previous value: after a step with less progress the other kind is used
MOST_STEPS = 100  # of a root; three to eight are typical
FAR = 16.0  # times the d beside the highest root: sums over larger d are power series of x
ORDERS = 14  # of such a series, the next one is round-off
SIZE, SLOPE_BELOW, SLOPE_ABOVE, SERIES = range(4)  # sums: their round-off over epsilon, slopes to d_l and beyond
SUMS = SERIES + ORDERS
DEFLATED = -1


def rank_one_modes(d: np.ndarray, p: np.ndarray, stiffness: float, count: int) -> tuple[np.ndarray, np.ndarray] | None:
    """Return the ``count`` lowest eigenvalues, ascending, and vectors (m, count); None where there are fewer.

    d: (m,), ascending, none negative. stiffness: k > 0, inf for the constraint p.v = 0.
    """
    if count < len(d):
        numbers = _memory(d, p, count)
        outcome = find_roots(numbers, len(d), count, 1 / stiffness, 1)
        if outcome != DEFLATED:
            return _solution(numbers, len(d), count) if outcome else None
    rotations, components = _cluster_rotations(d, p), p
    if rotations:
        components = p.copy()
        for first, last, rotation in rotations:
            components[first:last] = np.eye(1, last - first)[0] * float(rotation[:, 0] @ p[first:last])
    sizes = components * components / (d + d[min(count, len(d) - 1)])
    present = (sizes > ABSENT**2 * sizes.sum()) & (np.abs(components) > NOISE * math.sqrt(p @ p))
    poles, deflated = np.flatnonzero(present), np.flatnonzero(~present)[:count]
    given, weights = d[poles], components[poles]
    if 0 < len(poles) <= count and math.isfinite(stiffness):
        given, weights = _with_bound(given, weights, stiffness)
    roots = min(count, len(given) - 1)
    if roots < 1 or roots + len(deflated) < count:
        return None
    numbers = _memory(given, weights, roots)
    if not find_roots(numbers, len(given), roots, 1 / stiffness, 0):
        return None
    solution = _solution(numbers, len(given), roots)
    values = np.concatenate([solution[0], d[deflated]])
    order = np.argsort(values, kind="stable")[:count]
    vectors = np.zeros((len(d), len(values)))
    vectors[poles, :roots] = solution[1][: len(poles)]
    vectors[deflated, np.arange(roots, len(values))] = 1.0
    vectors = vectors[:, order]
    for first, last, rotation in rotations:
        vectors[first:last] = rotation @ vectors[first:last]
    return values[order], vectors


def _with_bound(d: np.ndarray, p: np.ndarray, stiffness: float) -> tuple[np.ndarray, np.ndarray]:
    """Return d and p with one more d, without a part in p, above the highest root, which is at most d_m + k |p|^2."""
    highest = float(d[-1])
    bound = highest + 2 * stiffness * float(p @ p)
    return (np.append(d, bound), np.append(p, 0.0)) if bound > highest * (1 + EQUAL) else (d, p)


def _cluster_rotations(d: np.ndarray, p: np.ndarray) -> list[tuple[int, int, np.ndarray]]:
    """Return for every cluster of equal d its first, one past its last, and a rotation with first column along p."""
    is_edge = d[1:] - d[:-1] > EQUAL * d[1:]
    if is_edge.all():
        return []
    edges = [0, *(np.flatnonzero(is_edge) + 1).tolist(), len(d)]
    rotations = []
    for first, last in itertools.pairwise(edges):
        if last - first > 1:
            column = p[first:last, None]
            rotations.append((first, last, np.linalg.qr(np.hstack([column, np.eye(last - first)]))[0]))
    return rotations


def _memory(d: np.ndarray, p: np.ndarray, count: int) -> np.ndarray:
    """Return the memory of ``roots``: d and p (m,), and space for ``count`` roots."""
    m = len(d)
    numbers = np.empty(2 * m + SUMS + count * (1 + m))
    numbers[:m], numbers[m : 2 * m] = d, p
    return numbers


def _solution(numbers: np.ndarray, m: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the ``count`` lowest roots, and their vectors of unit length."""
    results = numbers[2 * m + SUMS :]
    return results[:count], results[count:].reshape(count, m).T


@compiled
def needs_no_deflation(numbers: Numbers, m: int, count: int) -> int:
    """Return 1 where no d has to be deflated: no two are equal, and all take part in p; numbers: d, p (m,)."""
    square, weighted, reference = 0.0, 0.0, numbers[count]
    for j in range(m):
        if j + 1 < m and numbers[j + 1] - numbers[j] <= EQUAL * numbers[j + 1]:
            return 0
        square_of_p = numbers[m + j] * numbers[m + j]
        square += square_of_p
        weighted += square_of_p / (numbers[j] + reference)
    for j in range(m):
        square_of_p = numbers[m + j] * numbers[m + j]
        if (
            square_of_p <= NOISE * NOISE * square
            or square_of_p / (numbers[j] + reference) <= ABSENT * ABSENT * weighted
        ):
            return 0
    return 1


@compiled
def roots(numbers: Numbers, m: int, count: int, compliance: float, check_deflation: int) -> int:
    """Return 1 if all roots converge. numbers: d, p (m,), sums, then roots (count,) and vectors (count, m).

    compliance: 1 / k; vectors of a constraint are made orthogonal to p once more. check_deflation: 1 to return DEFLATED
    where a d has to be deflated.
    """
    if check_deflation == 1 and needs_no_deflation(numbers, m, count) == 0:
        return DEFLATED
    sums, results, near = 2 * m, 2 * m + SUMS, count + 1
    while near < m and numbers[near] <= FAR * numbers[count]:
        near += 1
    expand(numbers, m, near)
    for i in range(count):
        vector = results + count + i * m
        lower, upper = numbers[m + i] * numbers[m + i], numbers[m + i + 1] * numbers[m + i + 1]
        gap = numbers[i + 1] - numbers[i]
        value = secular_function(numbers, m, near, i, i, 0.5 * gap, compliance, vector)
        rest = value - 2.0 * (upper - lower) / gap
        if value >= 0.0:
            nearer, start = i, smaller_zero(rest, rest * gap + lower + upper, lower * gap)
        else:
            nearer, start = i + 1, -smaller_zero(-rest, lower + upper - rest * gap, upper * gap)
        distance = refine_root(numbers, m, near, i, nearer, start, compliance, vector)
        if distance == 0.0:
            return 0
        numbers[results + i] = numbers[nearer] + distance
        scale = 1.0 / math.sqrt(numbers[sums + SLOPE_BELOW] + numbers[sums + SLOPE_ABOVE])
        for j in range(near):
            numbers[vector + j] *= scale
        for j in range(near, m):
            numbers[vector + j] = scale * numbers[m + j] / (numbers[j] - numbers[nearer] - distance)
    if compliance == 0.0:
        remove_direction(numbers, m, numbers, results + count, m, count)
    return 1


@compiled
def expand(numbers: Numbers, m: int, near: int) -> None:
    """Set sums over the d from ``near`` on of p^2 / d (d_near / d)^k, the coefficients of powers of x / d_near."""
    series = 2 * m + SERIES
    for k in range(ORDERS):
        numbers[series + k] = 0.0
    for j in range(near, m):
        part, ratio = numbers[m + j] * numbers[m + j] / numbers[j], numbers[near] / numbers[j]
        for k in range(ORDERS):
            numbers[series + k] += part
            part *= ratio


@compiled
def refine_root(
    numbers: Numbers, m: int, near: int, i: int, nearer: int, start: float, compliance: float, vector: int
) -> float:
    """Return the distance of root i from its nearer neighbour, iterated from ``start``; 0 without convergence."""
    sums, gap = 2 * m, numbers[i + 1] - numbers[i]
    lowest, highest = (0.0, 0.5 * gap) if nearer == i else (-0.5 * gap, 0.0)
    distance, previous, by_weight = start, 0.0, 1
    for _ in range(MOST_STEPS):
        if not lowest < distance < highest:
            distance = 0.5 * (lowest + highest)
        value = secular_function(numbers, m, near, i, nearer, distance, compliance, vector)
        below, above = numbers[sums + SLOPE_BELOW], numbers[sums + SLOPE_ABOVE]
        slope = below + above
        if abs(value) < EPSILON * (numbers[sums + SIZE] + abs(distance) * slope):
            return distance
        if value < 0.0:
            lowest = distance
        else:
            highest = distance
        if previous * value > 0.0 and abs(value) > SLOW * abs(previous):
            by_weight = 1 - by_weight
        previous = value
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
    """Return the zero of c x^2 - a x + b that tends to b / a as c vanishes, if a > 0."""
    root = math.sqrt(abs(a * a - 4.0 * b * c))
    if a > 0.0:
        return 2.0 * b / (a + root)
    return (a - root) / (2.0 * c) if c != 0.0 else 0.0


@compiled
def secular_function(
    numbers: Numbers, m: int, near: int, i: int, nearer: int, distance: float, compliance: float, vector: int
) -> float:
    """Return the secular function at d_nearer + distance; set its slopes, and p / (d - x) up to ``near``."""
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
    numbers[sums + SIZE] = ROUNDED * (above - below) + compliance
    numbers[sums + SLOPE_BELOW], numbers[sums + SLOPE_ABOVE] = slope_below, slope_above
    return compliance + below + above


find_roots = entry(roots)
