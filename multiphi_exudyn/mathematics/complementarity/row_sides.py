"""Sides of the rows of a complementarity problem: violated rows, the row to drive, and the next change of a side."""

from __future__ import annotations

from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, compiled
from multiphi_exudyn.mathematics.complementarity.free_rows import (
    ABOVE,
    ABOVES,
    BELOW,
    BELOWS,
    BETWEEN,
    CHANGED_TO,
    CHANGING,
    COUNT,
    DIRECTION,
    FREE_COUNT,
    HIGHS,
    LEADERS,
    LENGTHS,
    LOWS,
    MOVES,
    OFFSETS,
    PUSH_LENGTHS,
    PUSH_UNITS,
    PUSHES,
    RATIOS,
    REMAINDER,
    RESULTS,
    ROWS,
    SHARES,
    SIDES,
    SIZES,
    SLACKS,
    STRIDE,
    TERMS,
    TIES,
    UNITS,
    UNKNOWNS,
    VALUES,
    VIOLATIONS,
    WAITING,
    X,
    add_free_row,
    bound,
    factor,
    project_out,
)
from multiphi_exudyn.mathematics.orthonormal import norm, scalar_product
from multiphi_exudyn.mathematics.round_off import ALIKE, FOLLOWING, INDEPENDENT, ZERO

__all__ = [
    "accept_dependent_row",
    "choose_sides",
    "first_change",
    "free_balanced_rows",
    "most_violated_row",
    "scale",
    "update_violations",
]


@compiled
def scale(ints: Ints, numbers: Numbers, problem: int) -> None:
    """Scale the rows of A and G to length one, and all else accordingly; set every z to zero or its nearest bound."""
    r, leaders, same = ints[problem + UNKNOWNS], ints[problem + LEADERS], ints[problem + ROWS] == ints[problem + PUSHES]
    for k in range(ints[problem + COUNT]):
        same = same and ints[leaders + k] < 0
    scale_rows(ints, numbers, problem, ROWS, UNITS, LENGTHS)
    if same:
        ints[problem + PUSH_UNITS] = ints[problem + UNITS]
        ints[problem + PUSH_LENGTHS] = ints[problem + LENGTHS]
    else:
        ints[problem + PUSH_UNITS] = ints[problem + UNITS] + ints[problem + COUNT] * r
        ints[problem + PUSH_LENGTHS] = ints[problem + LENGTHS] + ints[problem + COUNT]
        scale_rows(ints, numbers, problem, PUSHES, PUSH_UNITS, PUSH_LENGTHS)
    ints[problem + FREE_COUNT] = 0
    for k in range(ints[problem + COUNT]):
        length, pushes = numbers[ints[problem + LENGTHS] + k], numbers[ints[problem + PUSH_LENGTHS] + k]
        low, high = pushes * numbers[ints[problem + LOWS] + k], pushes * numbers[ints[problem + HIGHS] + k]
        numbers[ints[problem + OFFSETS] + k] = numbers[ints[problem + VALUES] + k] / length
        numbers[ints[problem + TERMS] + k] = numbers[ints[problem + SIZES] + k] / length
        numbers[ints[problem + SLACKS] + k] = ZERO
        numbers[ints[problem + BELOWS] + k] = low
        numbers[ints[problem + ABOVES] + k] = high
        if ints[leaders + k] >= 0:
            leading = numbers[ints[problem + PUSH_LENGTHS] + ints[leaders + k]]
            numbers[ints[problem + RATIOS] + k] = numbers[ints[problem + TIES] + k] * pushes / leading
        numbers[ints[problem + SHARES] + k] = min(max(0.0, low), high)
        side = BELOW if low >= 0.0 else WAITING
        ints[ints[problem + SIDES] + k] = ABOVE if high <= 0.0 and low < 0.0 else side


@compiled
def scale_rows(ints: Ints, numbers: Numbers, problem: int, given: int, units: int, lengths: int) -> None:
    """Set rows of length one (k, r) from rows (k, stride), and their lengths, 1 for a zero row."""
    r = ints[problem + UNKNOWNS]
    for k in range(ints[problem + COUNT]):
        row = ints[problem + given] + k * ints[problem + STRIDE]
        length = norm(numbers, row, r)
        length = 1.0 if length == 0.0 else length
        numbers[ints[problem + lengths] + k] = length
        for i in range(r):
            numbers[ints[problem + units] + k * r + i] = numbers[row + i] / length


@compiled
def update_violations(ints: Ints, numbers: Numbers, problem: int) -> None:
    """Set RESULTS, w (k,), and VIOLATIONS (k,) of the sides of rows that are not free, zero where it is round-off."""
    r, x, reach = (
        ints[problem + UNKNOWNS],
        ints[problem + X],
        norm(numbers, ints[problem + X], ints[problem + UNKNOWNS]),
    )
    for k in range(ints[problem + COUNT]):
        side, w = ints[ints[problem + SIDES] + k], numbers[ints[problem + OFFSETS] + k]
        for i in range(r):
            w += numbers[ints[problem + UNITS] + k * r + i] * numbers[x + i]
        numbers[ints[problem + RESULTS] + k] = w
        violation = abs(w) if side == WAITING else side * w
        if violation <= numbers[ints[problem + SLACKS] + k] * (numbers[ints[problem + TERMS] + k] + reach):
            violation = 0.0
        wide = side != BETWEEN and has_range(ints, numbers, problem, k) == 1
        numbers[ints[problem + VIOLATIONS] + k] = violation if wide else 0.0


@compiled
def most_violated_row(ints: Ints, numbers: Numbers, problem: int, in_turn: int) -> int:
    """Return the first of the most violated rows, to round-off, or of all violated ones (in_turn 1); -1 for none."""
    violations, largest = ints[problem + VIOLATIONS], 0.0
    for k in range(ints[problem + COUNT]):
        largest = max(largest, numbers[violations + k])
    for k in range(ints[problem + COUNT]):
        least = 0.0 if in_turn == 1 else (1.0 - ALIKE) * largest
        if numbers[violations + k] > 0.0 and numbers[violations + k] >= least:
            return k
    return -1


@compiled
def choose_sides(ints: Ints, numbers: Numbers, problem: int, leader: int) -> None:
    """Set the sides of rows tied to a leader that leaves zero, by the sign of their w; zero w makes them free."""
    reach = norm(numbers, ints[problem + X], ints[problem + UNKNOWNS])
    for k in range(ints[problem + COUNT]):
        if ints[ints[problem + LEADERS] + k] == leader and has_range(ints, numbers, problem, k) == 0:
            w, terms = numbers[ints[problem + RESULTS] + k], numbers[ints[problem + TERMS] + k] + reach
            ints[ints[problem + SIDES] + k] = BELOW if w > 0.0 else ABOVE
            if abs(w) <= numbers[ints[problem + SLACKS] + k] * terms and is_independent(ints, numbers, problem, k) == 1:
                add_free_row(ints, problem, k)


@compiled
def is_independent(ints: Ints, numbers: Numbers, problem: int, row: int) -> int:
    """Return 1 where a row is linearly independent of the free ones."""
    r, size, remainder = ints[problem + UNKNOWNS], ints[problem + FREE_COUNT], ints[problem + REMAINDER]
    factor(ints, numbers, problem)
    for i in range(r):
        numbers[remainder + i] = numbers[ints[problem + UNITS] + row * r + i]
    project_out(ints, numbers, problem, remainder, -1)
    return 1 if size < r and norm(numbers, remainder, r) > INDEPENDENT else 0


@compiled
def free_balanced_rows(ints: Ints, numbers: Numbers, problem: int) -> None:
    """Make rows of a solution free that are at a bound while w is zero to round-off, the last ones first.

    Whether such a row has come to its bound or to zero w is decided by round-off. Those that depend on free rows keep
    their bounds.
    """
    reach = norm(numbers, ints[problem + X], ints[problem + UNKNOWNS])
    for k in range(ints[problem + COUNT] - 1, -1, -1):
        balanced = abs(numbers[ints[problem + RESULTS] + k]) <= FOLLOWING * (numbers[ints[problem + TERMS] + k] + reach)
        at_bound = ints[ints[problem + SIDES] + k] in (BELOW, ABOVE) and has_range(ints, numbers, problem, k) == 1
        if balanced and at_bound and is_independent(ints, numbers, problem, k) == 1:
            add_free_row(ints, problem, k)


@compiled
def first_change(ints: Ints, numbers: Numbers, problem: int, driven: int, limit: float) -> float:
    """Return how far the driven row moves until a row, CHANGING, changes its side to CHANGED_TO; itself at zero w.

    Of rows that reach zero together to round-off, as parallel ones do, the driven one changes, or else the first one.
    """
    r, shares, way = ints[problem + UNKNOWNS], ints[problem + SHARES], ints[problem + DIRECTION]
    distance, least = limit, INDEPENDENT * norm(numbers, way, r)
    ints[problem + CHANGING] = driven
    ints[problem + CHANGED_TO] = BETWEEN
    for k in range(ints[problem + COUNT]):
        side, leader = ints[ints[problem + SIDES] + k], ints[ints[problem + LEADERS] + k]
        is_led = leader >= 0 and (leader == driven or ints[ints[problem + SIDES] + leader] == BETWEEN)
        if k == driven or side == BETWEEN:
            for s in range(BELOW, ABOVE + 1, 2):
                closing = s * numbers[ints[problem + MOVES] + k]
                if is_led:
                    closing -= numbers[ints[problem + RATIOS] + k] * numbers[ints[problem + MOVES] + leader]
                room = s * (bound(ints, numbers, problem, k, s) - numbers[shares + k])
                if closing > 0.0 and max(room, 0.0) / closing < distance:
                    distance = max(room, 0.0) / closing
                    ints[problem + CHANGING] = k
                    ints[problem + CHANGED_TO] = s
        elif (
            side != WAITING
            and numbers[ints[problem + VIOLATIONS] + k] == 0.0
            and (is_led or has_range(ints, numbers, problem, k) == 1)
        ):
            closing = side * scalar_product(numbers, ints[problem + UNITS] + k * r, numbers, way, r)
            room = max(-side * numbers[ints[problem + RESULTS] + k], 0.0)
            if closing > least and room / closing < (1.0 - ALIKE) * distance:
                distance = room / closing
                ints[problem + CHANGING] = k
                ints[problem + CHANGED_TO] = BETWEEN
    return distance


@compiled
def has_range(ints: Ints, numbers: Numbers, problem: int, row: int) -> int:
    """Return 1 where the bounds of a row differ."""
    return 1 if bound(ints, numbers, problem, row, BELOW) < bound(ints, numbers, problem, row, ABOVE) else 0


@compiled
def accept_dependent_row(ints: Ints, numbers: Numbers, problem: int, row: int, step: float) -> int:
    """Accept a row that depends on the free ones if its violation is as small as its remainder allows; 1 if so.

    It is not accepted where it can take over the share of one of them in a step of comparable size.
    """
    x, slack, total = ints[problem + X], ints[problem + SLACKS] + row, 0.0
    terms = numbers[ints[problem + TERMS] + row] + norm(numbers, x, ints[problem + UNKNOWNS])
    if numbers[ints[problem + VIOLATIONS] + row] > FOLLOWING * terms:
        return 0
    for k in range(ints[problem + COUNT]):
        total += abs(numbers[ints[problem + SHARES] + k])
    if numbers[ints[problem + VIOLATIONS] + row] > 0.0 and step <= 2.0 * total:
        return 0
    numbers[slack] = FOLLOWING
    numbers[ints[problem + VIOLATIONS] + row] = 0.0
    return 1
