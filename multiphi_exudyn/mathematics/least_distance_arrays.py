"""Least distance programming in flat buffers, for the loop: least_distance.py says what it computes, and how.

    min |x|^2,  A x >= b;    x = A^T p,  p >= 0,  p . (A x - b) = 0

Scratch memory of a problem with k inequalities in r unknowns, a record in the numbers: units (k, r), wanted (k,),
sizes (k,), lengths (k,), slack (k,), what is lacking (k,), Q (k, r), R (k, k), shares (k,) before and (k,) while one
enters, taken (k,), left (r,); in the ints: how many exclude each other; who pushes (k,) before, and (k,) while one
enters; those that exclude each other (k,).
"""

from __future__ import annotations

import math

from multiphi_exudyn.mathematics.compiled import Ints, Numbers, compiled
from multiphi_exudyn.mathematics.least_distance import ALIKE, FOLLOWING, INDEPENDENT, SETS
from multiphi_exudyn.mathematics.round_off import ZERO

__all__ = ["EXCLUDED", "SOLVED", "UNDECIDED", "least_distance_ints", "least_distance_numbers", "norm"]
__all__ += ["shortest_vector"]

SOLVED, EXCLUDED, UNDECIDED = 0, 1, 2  # answers: no x meets all; round-off keeps the sets from settling


def least_distance_numbers(count: int, unknowns: int) -> int:
    """Numbers that such a problem works in."""
    return 2 * count * unknowns + count * count + 8 * count + unknowns


def least_distance_ints(count: int) -> int:
    """Ints that it works in."""
    return 3 * count + 1


@compiled
def shortest_vector(
    ints: Ints,
    numbers: Numbers,
    rows: int,
    stride: int,
    least: int,
    sizes: int,
    count: int,
    unknowns: int,
    x: int,
    multipliers: int,
    scratch: int,
    scratch_ints: int,
) -> int:
    """x (r,) and p (k,) for rows (k, stride) of A, b = ``least`` and the sizes of its terms (k,).

    SOLVED; EXCLUDED, with the number of inequalities that exclude each other in the first of the ints and they
    themselves in the last k; or UNDECIDED.
    """
    for i in range(unknowns):
        numbers[x + i] = 0.0
    for k in range(count):
        numbers[multipliers + k] = 0.0
    if count == 1:
        return only_one(ints, numbers, rows, least, sizes, unknowns, x, multipliers, scratch_ints)
    k2 = count * unknowns
    lengths, slack, lacking = scratch + k2 + 2 * count, scratch + k2 + 3 * count, scratch + k2 + 4 * count
    shares, pushing = scratch + 2 * k2 + 5 * count + count * count, scratch_ints + 1
    scale_rows(numbers, rows, stride, least, sizes, count, unknowns, scratch)
    pushers = 0
    for _ in range(SETS * (count + 1)):
        entering = most_lacking(ints, numbers, x, count, unknowns, pushing, pushers, scratch)
        if entering < 0:
            for a in range(pushers):
                k = ints[pushing + a]
                numbers[multipliers + k] = numbers[shares + a] / numbers[lengths + k]
            return SOLVED
        entered = enter(ints, numbers, count, unknowns, pushers, entering, scratch, scratch_ints)
        if entered < 0:
            terms = numbers[scratch + k2 + count + entering] + norm(numbers, x, unknowns)
            if numbers[slack + entering] > ZERO or numbers[lacking + entering] > FOLLOWING * terms:
                return EXCLUDED
            numbers[slack + entering] = FOLLOWING
            continue
        pushers = entered
        for a in range(pushers):
            ints[pushing + a] = ints[pushing + count + a]
        meet(ints, numbers, x, count, unknowns, pushers, scratch, scratch_ints)
    return UNDECIDED


@compiled
def only_one(
    ints: Ints,
    numbers: Numbers,
    row: int,
    least: int,
    sizes: int,
    unknowns: int,
    x: int,
    multipliers: int,
    scratch_ints: int,
) -> int:
    """One inequality: the step along its row that it lacks."""
    square = 0.0
    for i in range(unknowns):
        square += numbers[row + i] * numbers[row + i]
    if numbers[least] <= ZERO * numbers[sizes]:
        return SOLVED
    if square == 0.0:
        ints[scratch_ints] = 1
        ints[scratch_ints + 3] = 0
        return EXCLUDED
    numbers[multipliers] = numbers[least] / square
    for i in range(unknowns):
        numbers[x + i] = numbers[row + i] * numbers[multipliers]
    return SOLVED


@compiled
def scale_rows(
    numbers: Numbers, rows: int, stride: int, least: int, sizes: int, count: int, unknowns: int, scratch: int
) -> None:
    """Rows of length one, with what they want and the sizes of its terms to the same scale."""
    wanted = scratch + count * unknowns
    for k in range(count):
        length = norm(numbers, rows + k * stride, unknowns)
        length = 1.0 if length == 0.0 else length
        for i in range(unknowns):
            numbers[scratch + k * unknowns + i] = numbers[rows + k * stride + i] / length
        numbers[wanted + k] = numbers[least + k] / length
        numbers[wanted + count + k] = numbers[sizes + k] / length
        numbers[wanted + 2 * count + k] = length
        numbers[wanted + 3 * count + k] = ZERO


@compiled
def norm(numbers: Numbers, vector: int, count: int) -> float:
    """Length of a vector."""
    total = 0.0
    for i in range(count):
        total += numbers[vector + i] * numbers[vector + i]
    return math.sqrt(total)


@compiled
def most_lacking(
    ints: Ints, numbers: Numbers, x: int, count: int, unknowns: int, pushing: int, pushers: int, scratch: int
) -> int:
    """The first inequality of those that x violates most, to round-off; -1 where it violates none."""
    wanted = scratch + count * unknowns
    lacking, reach, largest = wanted + 4 * count, norm(numbers, x, unknowns), 0.0
    for k in range(count):
        value = numbers[wanted + k]
        for i in range(unknowns):
            value -= numbers[scratch + k * unknowns + i] * numbers[x + i]
        if value <= numbers[wanted + 3 * count + k] * (numbers[wanted + count + k] + reach):
            value = 0.0
        numbers[lacking + k] = value
    for a in range(pushers):
        numbers[lacking + ints[pushing + a]] = 0.0
    for k in range(count):
        largest = max(largest, numbers[lacking + k])
    for k in range(count):
        if largest > 0.0 and numbers[lacking + k] >= (1.0 - ALIKE) * largest:
            return k
    return -1


@compiled
def enter(
    ints: Ints,
    numbers: Numbers,
    count: int,
    unknowns: int,
    pushers: int,
    entering: int,
    scratch: int,
    scratch_ints: int,
) -> int:
    """How many push after one more has come in and those that would have to pull have gone; -1 where it cannot."""
    k2 = count * unknowns
    lacking = numbers[scratch + k2 + 4 * count + entering]
    shares = scratch + 2 * k2 + 5 * count + count * count
    trial, taken, pushing = shares + count, shares + 2 * count, scratch_ints + 1 + count
    excluded = pushing + count
    for a in range(pushers):
        ints[pushing + a] = ints[scratch_ints + 1 + a]
        numbers[trial + a] = numbers[shares + a]
    share = 0.0
    while True:
        reach = split(ints, numbers, count, unknowns, pushers, entering, scratch, scratch_ints)
        until, gone = math.inf, -1
        for a in range(pushers):
            if numbers[taken + a] > 0.0 and numbers[trial + a] / numbers[taken + a] < until:
                until, gone = numbers[trial + a] / numbers[taken + a], a
        whole = lacking / reach if reach > 0.0 else math.inf
        step = min(until, whole)
        if not step < math.inf:
            ints[scratch_ints] = pushers + 1
            for a in range(pushers):
                ints[excluded + a] = ints[pushing + a]
            ints[excluded + pushers] = entering
            return -1
        for a in range(pushers):
            numbers[trial + a] -= step * numbers[taken + a]
        share += step
        lacking -= step * reach
        if whole <= until:
            ints[pushing + pushers] = entering
            return pushers + 1
        pushers -= 1
        for a in range(gone, pushers):
            ints[pushing + a] = ints[pushing + a + 1]
            numbers[trial + a] = numbers[trial + a + 1]


@compiled
def factor(
    ints: Ints, numbers: Numbers, count: int, unknowns: int, pushers: int, scratch: int, scratch_ints: int
) -> None:
    """Q (k, r) with orthonormal rows and R (k, k) above its diagonal: rows of those that push = R^T Q.

    Gram-Schmidt, each row twice.
    """
    k2 = count * unknowns
    q, triangle, pushing = scratch + k2 + 5 * count, scratch + 2 * k2 + 5 * count, scratch_ints + 1 + count
    for a in range(pushers):
        own = q + a * unknowns
        for i in range(unknowns):
            numbers[own + i] = numbers[scratch + ints[pushing + a] * unknowns + i]
        for b in range(a):
            numbers[triangle + b * count + a] = 0.0
        for _ in range(2):
            for b in range(a):
                product = 0.0
                for i in range(unknowns):
                    product += numbers[q + b * unknowns + i] * numbers[own + i]
                numbers[triangle + b * count + a] += product
                for i in range(unknowns):
                    numbers[own + i] -= product * numbers[q + b * unknowns + i]
        length = norm(numbers, own, unknowns)
        numbers[triangle + a * count + a] = length
        for i in range(unknowns):
            numbers[own + i] /= length if length > 0.0 else 1.0


@compiled
def split(
    ints: Ints,
    numbers: Numbers,
    count: int,
    unknowns: int,
    pushers: int,
    entering: int,
    scratch: int,
    scratch_ints: int,
) -> float:
    """|way|^2 of what is left of a row beside those that push, zero where it follows from them; their shares in it."""
    k2 = count * unknowns
    factor(ints, numbers, count, unknowns, pushers, scratch, scratch_ints)
    q, taken = scratch + k2 + 5 * count, scratch + 2 * k2 + 7 * count + count * count
    left = taken + count
    for i in range(unknowns):
        numbers[left + i] = numbers[scratch + entering * unknowns + i]
    for b in range(pushers):
        numbers[taken + b] = 0.0
    for _ in range(2):
        for b in range(pushers):
            product = 0.0
            for i in range(unknowns):
                product += numbers[q + b * unknowns + i] * numbers[left + i]
            numbers[taken + b] += product
            for i in range(unknowns):
                numbers[left + i] -= product * numbers[q + b * unknowns + i]
    solve_upper(numbers, scratch + 2 * k2 + 5 * count, count, pushers, taken)
    length = norm(numbers, left, unknowns)
    return length * length if pushers == 0 or length > INDEPENDENT else 0.0


@compiled
def solve_upper(numbers: Numbers, triangle: int, stride: int, count: int, x: int) -> None:
    """x from R x, in place."""
    for a in range(count - 1, -1, -1):
        total = numbers[x + a]
        for b in range(a + 1, count):
            total -= numbers[triangle + a * stride + b] * numbers[x + b]
        pivot = numbers[triangle + a * stride + a]
        numbers[x + a] = total / pivot if pivot != 0.0 else 0.0


@compiled
def meet(
    ints: Ints, numbers: Numbers, x: int, count: int, unknowns: int, pushers: int, scratch: int, scratch_ints: int
) -> None:
    """The shortest x that meets those that push with equality, and their shares, none where one is round-off below."""
    k2 = count * unknowns
    factor(ints, numbers, count, unknowns, pushers, scratch, scratch_ints)
    wanted, q, triangle = scratch + k2, scratch + k2 + 5 * count, scratch + 2 * k2 + 5 * count
    shares, pushing = triangle + count * count, scratch_ints + 1 + count
    for i in range(unknowns):
        numbers[x + i] = 0.0
    for a in range(pushers):
        along = numbers[wanted + ints[pushing + a]]
        for b in range(a):
            along -= numbers[triangle + b * count + a] * numbers[shares + b]
        pivot = numbers[triangle + a * count + a]
        along = along / pivot if pivot != 0.0 else 0.0
        numbers[shares + a] = along
        for i in range(unknowns):
            numbers[x + i] += along * numbers[q + a * unknowns + i]
    solve_upper(numbers, triangle, count, pushers, shares)
    for a in range(pushers):
        numbers[shares + a] = max(numbers[shares + a], 0.0)
