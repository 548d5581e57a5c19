"""Rows of a complementarity problem that are between their bounds: what they bear, and how it moves with another row.

    A_C x = -b_C,   x = x_0 + G_C^T z_C,   A_C^T = Q R,   S = Q^T G_C^T,   S z_C = R^-T (-b_C) - Q^T x_0

C: the free rows, x_0 what those at their bounds make. R alone is inverted where G is A (S is R then), not its square.
A row at a bound that is tied to a free one, its leader, pushes in step with it: it belongs to that one's column of G.
"""

from __future__ import annotations

import math

from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, compiled
from multiphi_exudyn.mathematics.complementarity.least_distance import INDEPENDENT

__all__ = [
    "PROBLEM",
    "bound",
    "factor",
    "free_row",
    "leave",
    "meet",
    "move_free",
    "norm",
    "product",
    "release_row",
    "tied",
]

# given: sizes; where A and G (k, stride), b, the sizes of its terms, low, high (k,) begin, in the ints the leaders
# (k,), -1 for none, and mu (k,); where x (r,) and z (k,) go
COUNT, UNKNOWNS, STRIDE, ROWS, PUSHES, VALUES, SIZES, LOWS, HIGHS, LEADERS, TIES, X, Z = range(13)
EXCLUDING, EXCLUDED_ROWS = 13, 14  # how many rows exclude each other, and where they are listed
# worked in, rows of length one: ints, then numbers
SIDES, FREE, FREE_COUNT, CHANGING, CHANGED_TO = range(15, 20)  # the row that changes sides next, and to which
UNITS, PUSH_UNITS, LENGTHS, PUSH_LENGTHS, OFFSETS, TERMS, BELOWS, ABOVES, RATIOS, SLACKS = range(20, 30)
LACKING, RESULTS, SHARES, MOVES, Q, R, S, ALONG, LEFT, WAY, PUSHED = range(30, 41)
PROBLEM = 41  # ints of the record

BELOW, BETWEEN, ABOVE, WAITING = -1, 0, 1, 2  # sides; WAITING: between bounds, and not yet dealt with


@compiled
def norm(numbers: Numbers, vector: int, count: int) -> float:
    """Length of a vector."""
    total = 0.0
    for i in range(count):
        total += numbers[vector + i] * numbers[vector + i]
    return math.sqrt(total)


@compiled
def product(numbers: Numbers, one: int, other: int, count: int) -> float:
    """Product of two vectors."""
    total = 0.0
    for i in range(count):
        total += numbers[one + i] * numbers[other + i]
    return total


@compiled
def tied(ints: Ints, problem: int, row: int) -> int:
    """The leader to which a row at one of its bounds is tied, -1 for none."""
    side = ints[ints[problem + SIDES] + row]
    return -1 if side in (BETWEEN, WAITING) else ints[ints[problem + LEADERS] + row]


@compiled
def bound(ints: Ints, numbers: Numbers, problem: int, row: int, side: int) -> float:
    """The bound of a row on a side."""
    leader, offset = ints[ints[problem + LEADERS] + row], ints[problem + BELOWS if side < 0 else problem + ABOVES]
    if leader < 0:
        return numbers[offset + row]
    return (
        numbers[offset + row] + side * numbers[ints[problem + RATIOS] + row] * numbers[ints[problem + SHARES] + leader]
    )


@compiled
def push(ints: Ints, numbers: Numbers, problem: int, row: int) -> None:
    """PUSHED (r,): how a row pushes, with those that are tied to it."""
    r, pushed, units = ints[problem + UNKNOWNS], ints[problem + PUSHED], ints[problem + PUSH_UNITS]
    for i in range(r):
        numbers[pushed + i] = numbers[units + row * r + i]
    for k in range(ints[problem + COUNT]):
        if ints[ints[problem + LEADERS] + k] == row and tied(ints, problem, k) == row:
            share = ints[ints[problem + SIDES] + k] * numbers[ints[problem + RATIOS] + k]
            for i in range(r):
                numbers[pushed + i] += share * numbers[units + k * r + i]


@compiled
def free_row(ints: Ints, problem: int, row: int) -> None:
    """A row comes between its bounds."""
    ints[ints[problem + FREE] + ints[problem + FREE_COUNT]] = row
    ints[problem + FREE_COUNT] += 1
    ints[ints[problem + SIDES] + row] = BETWEEN


@compiled
def release_row(ints: Ints, numbers: Numbers, problem: int, row: int, side: int) -> None:
    """A row comes to its bound; with a leader that comes to zero those that are tied to it do."""
    shares, sides = ints[problem + SHARES], ints[problem + SIDES]
    ints[sides + row] = side
    numbers[shares + row] = bound(ints, numbers, problem, row, side)
    for k in range(ints[problem + COUNT]):
        if ints[ints[problem + LEADERS] + k] == row and numbers[shares + row] == 0.0 and ints[sides + k] == BETWEEN:
            ints[sides + k] = BELOW
            numbers[shares + k] = bound(ints, numbers, problem, k, BELOW)
    free, found = ints[problem + FREE], 0
    for a in range(ints[problem + FREE_COUNT]):
        if ints[sides + ints[free + a]] == BETWEEN:
            ints[free + found] = ints[free + a]
            found += 1
    ints[problem + FREE_COUNT] = found


@compiled
def factor(ints: Ints, numbers: Numbers, problem: int) -> None:
    """Q (k, r) with orthonormal rows, R (k, k) above its diagonal, by Gram-Schmidt, each row twice; and S (k, k)."""
    r, count, q = ints[problem + UNKNOWNS], ints[problem + COUNT], ints[problem + Q]
    triangle, free, pushed = ints[problem + R], ints[problem + FREE], ints[problem + PUSHED]
    for a in range(ints[problem + FREE_COUNT]):
        own = q + a * r
        for i in range(r):
            numbers[own + i] = numbers[ints[problem + UNITS] + ints[free + a] * r + i]
        for b in range(ints[problem + FREE_COUNT]):
            numbers[triangle + b * count + a] = 0.0
        for _ in range(2):
            for b in range(a):
                share = product(numbers, q + b * r, own, r)
                numbers[triangle + b * count + a] += share
                for i in range(r):
                    numbers[own + i] -= share * numbers[q + b * r + i]
        length = norm(numbers, own, r)
        numbers[triangle + a * count + a] = length
        for i in range(r):
            numbers[own + i] /= length if length > 0.0 else 1.0
    for a in range(ints[problem + FREE_COUNT]):
        if ints[problem + UNITS] != ints[problem + PUSH_UNITS]:
            push(ints, numbers, problem, ints[free + a])
        for b in range(ints[problem + FREE_COUNT]):
            if ints[problem + UNITS] == ints[problem + PUSH_UNITS]:
                numbers[ints[problem + S] + b * count + a] = numbers[triangle + b * count + a]
            else:
                numbers[ints[problem + S] + b * count + a] = product(numbers, q + b * r, pushed, r)


@compiled
def eliminate(ints: Ints, numbers: Numbers, problem: int, x: int) -> None:
    """x (k,) from S x, in place, by elimination with the largest pivots; S is spent."""
    count, found, s = ints[problem + COUNT], ints[problem + FREE_COUNT], ints[problem + S]
    for a in range(found):
        best = a
        for b in range(a + 1, found):
            if abs(numbers[s + b * count + a]) > abs(numbers[s + best * count + a]):
                best = b
        if best != a:
            for c in range(a, found):
                kept = numbers[s + a * count + c]
                numbers[s + a * count + c] = numbers[s + best * count + c]
                numbers[s + best * count + c] = kept
            kept = numbers[x + a]
            numbers[x + a] = numbers[x + best]
            numbers[x + best] = kept
        for b in range(a + 1, found):
            if numbers[s + b * count + a] != 0.0:
                share = numbers[s + b * count + a] / numbers[s + a * count + a]
                for c in range(a + 1, found):
                    numbers[s + b * count + c] -= share * numbers[s + a * count + c]
                numbers[x + b] -= share * numbers[x + a]
    for a in range(found - 1, -1, -1):
        total = numbers[x + a]
        for b in range(a + 1, found):
            total -= numbers[s + a * count + b] * numbers[x + b]
        pivot = numbers[s + a * count + a]
        numbers[x + a] = total / pivot if pivot != 0.0 else 0.0


@compiled
def move_free(ints: Ints, numbers: Numbers, problem: int, row: int, way: float) -> float:
    """MOVES (k,) of the free rows and WAY (r,), that of x, as a row goes by ``way``, 1 or -1; how fast its w follows.

    Zero, and x stands still, where the row follows from the free ones.
    """
    r, found, free = ints[problem + UNKNOWNS], ints[problem + FREE_COUNT], ints[problem + FREE]
    left, along, goes, pushed = ints[problem + LEFT], ints[problem + ALONG], ints[problem + WAY], ints[problem + PUSHED]
    factor(ints, numbers, problem)
    push(ints, numbers, problem, row)
    for i in range(r):
        numbers[left + i] = numbers[ints[problem + UNITS] + row * r + i]
        numbers[goes + i] = way * numbers[pushed + i]
    for b in range(found):
        numbers[along + b] = 0.0
    leave(ints, numbers, problem, left, -1)
    leave(ints, numbers, problem, goes, along)
    eliminate(ints, numbers, problem, along)
    for b in range(found):
        numbers[along + b] = -numbers[along + b]
        numbers[ints[problem + MOVES] + ints[free + b]] = numbers[along + b]
    if ints[problem + UNITS] != ints[problem + PUSH_UNITS] and found > 0:
        for i in range(r):
            numbers[goes + i] = way * numbers[pushed + i]
        push_free(ints, numbers, problem, along, goes)
        leave(ints, numbers, problem, goes, -1)
    follows = found > 0 and (found >= r or norm(numbers, left, r) <= INDEPENDENT)
    for i in range(r):
        numbers[goes + i] = 0.0 if follows else numbers[goes + i]
    return product(numbers, left, goes, r)


@compiled
def leave(ints: Ints, numbers: Numbers, problem: int, vector: int, shares: int) -> None:
    """What is left of a vector (r,) beside the free rows, in place; its parts along Q are added to shares, -1 for none.

    Twice, for the round-off of nearly parallel rows.
    """
    r, q = ints[problem + UNKNOWNS], ints[problem + Q]
    for _ in range(2):
        for b in range(ints[problem + FREE_COUNT]):
            share = product(numbers, q + b * r, vector, r)
            if shares >= 0:
                numbers[shares + b] += share
            for i in range(r):
                numbers[vector + i] -= share * numbers[q + b * r + i]


@compiled
def push_free(ints: Ints, numbers: Numbers, problem: int, shares: int, vector: int) -> None:
    """Add to a vector (r,) what the free rows push with these shares (k,)."""
    r, pushed = ints[problem + UNKNOWNS], ints[problem + PUSHED]
    for a in range(ints[problem + FREE_COUNT]):
        push(ints, numbers, problem, ints[ints[problem + FREE] + a])
        for i in range(r):
            numbers[vector + i] += numbers[shares + a] * numbers[pushed + i]


@compiled
def meet(ints: Ints, numbers: Numbers, problem: int) -> None:
    """x and the shares z of the free rows, the others where they are; none beyond its bound by round-off."""
    r, found, count, free = (
        ints[problem + UNKNOWNS],
        ints[problem + FREE_COUNT],
        ints[problem + COUNT],
        ints[problem + FREE],
    )
    x, q, triangle, along = ints[problem + X], ints[problem + Q], ints[problem + R], ints[problem + ALONG]
    shares, kept = ints[problem + SHARES], ints[problem + LEFT]
    factor(ints, numbers, problem)
    follow_leaders(ints, numbers, problem)
    push_fixed(ints, numbers, problem)
    for a in range(found):
        reached = -numbers[ints[problem + OFFSETS] + ints[free + a]]
        for b in range(a):
            reached -= numbers[triangle + b * count + a] * numbers[along + b]
        pivot = numbers[triangle + a * count + a]
        numbers[along + a] = reached / pivot if pivot != 0.0 else 0.0
    for a in range(found):
        numbers[kept + a] = numbers[along + a]
        numbers[along + a] -= product(numbers, q + a * r, x, r)
    if ints[problem + UNITS] == ints[problem + PUSH_UNITS]:
        for a in range(found):
            for i in range(r):
                numbers[x + i] += numbers[along + a] * numbers[q + a * r + i]
    eliminate(ints, numbers, problem, along)
    if ints[problem + UNITS] != ints[problem + PUSH_UNITS]:
        push_free(ints, numbers, problem, along, x)
        for a in range(found):
            missing = numbers[kept + a] - product(numbers, q + a * r, x, r)
            for i in range(r):
                numbers[x + i] += missing * numbers[q + a * r + i]
    for a in range(found):
        numbers[shares + ints[free + a]] = numbers[along + a]
    follow_leaders(ints, numbers, problem)


@compiled
def follow_leaders(ints: Ints, numbers: Numbers, problem: int) -> None:
    """Rows that are tied to a leader have the share that goes with its share."""
    for k in range(ints[problem + COUNT]):
        if tied(ints, problem, k) >= 0:
            side = ints[ints[problem + SIDES] + k]
            numbers[ints[problem + SHARES] + k] = bound(ints, numbers, problem, k, side)


@compiled
def push_fixed(ints: Ints, numbers: Numbers, problem: int) -> None:
    """x_0 (r,): what the rows push that are not free; of those tied to a free one what is not in step with it."""
    r, x, units = ints[problem + UNKNOWNS], ints[problem + X], ints[problem + PUSH_UNITS]
    for i in range(r):
        numbers[x + i] = 0.0
    for k in range(ints[problem + COUNT]):
        side, leader = ints[ints[problem + SIDES] + k], tied(ints, problem, k)
        share = numbers[ints[problem + SHARES] + k]
        if leader >= 0 and ints[ints[problem + SIDES] + leader] == BETWEEN:
            share = numbers[ints[problem + BELOWS if side < 0 else problem + ABOVES] + k]
        if side != BETWEEN and share != 0.0:
            for i in range(r):
                numbers[x + i] += share * numbers[units + k * r + i]
