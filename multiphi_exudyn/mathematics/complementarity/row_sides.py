"""Sides of the rows of a complementarity problem: which are violated, who is driven, who changes sides on the way."""

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
    FREE_COUNT,
    HIGHS,
    LACKING,
    LEADERS,
    LEFT,
    LENGTHS,
    LOWS,
    MOVES,
    OFFSETS,
    PUSH_LENGTHS,
    PUSH_UNITS,
    PUSHES,
    RATIOS,
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
    WAITING,
    WAY,
    X,
    bound,
    factor,
    free_row,
    leave,
    norm,
    product,
)
from multiphi_exudyn.mathematics.complementarity.least_distance import ALIKE, FOLLOWING, INDEPENDENT
from multiphi_exudyn.mathematics.round_off import ZERO

__all__ = ["choose_sides", "first_change", "is_met", "look", "most_lacking", "scale"]


@compiled
def scale(ints: Ints, numbers: Numbers, problem: int) -> None:
    """Rows of A and G of length one, and all else to that scale; every z zero, or the bound next to it."""
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
    """Rows (k, stride) as rows of length one (k, r), and their lengths, 1 for none."""
    r = ints[problem + UNKNOWNS]
    for k in range(ints[problem + COUNT]):
        row = ints[problem + given] + k * ints[problem + STRIDE]
        length = norm(numbers, row, r)
        length = 1.0 if length == 0.0 else length
        numbers[ints[problem + lengths] + k] = length
        for i in range(r):
            numbers[ints[problem + units] + k * r + i] = numbers[row + i] / length


@compiled
def look(ints: Ints, numbers: Numbers, problem: int) -> None:
    """RESULTS: w (k,); LACKING: by how much rows that are not free violate their side, zero where it is round-off."""
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
        lacking = abs(w) if side == WAITING else side * w
        if lacking <= numbers[ints[problem + SLACKS] + k] * (numbers[ints[problem + TERMS] + k] + reach):
            lacking = 0.0
        wide = side != BETWEEN and is_wide(ints, numbers, problem, k) == 1
        numbers[ints[problem + LACKING] + k] = lacking if wide else 0.0


@compiled
def most_lacking(ints: Ints, numbers: Numbers, problem: int, in_turn: int) -> int:
    """The first row of those that are violated most, to round-off, or at all (in_turn 1); -1 where none is."""
    lacking, largest = ints[problem + LACKING], 0.0
    for k in range(ints[problem + COUNT]):
        largest = max(largest, numbers[lacking + k])
    for k in range(ints[problem + COUNT]):
        least = 0.0 if in_turn == 1 else (1.0 - ALIKE) * largest
        if numbers[lacking + k] > 0.0 and numbers[lacking + k] >= least:
            return k
    return -1


@compiled
def choose_sides(ints: Ints, numbers: Numbers, problem: int, leader: int) -> None:
    """Rows tied to a leader that leaves zero come to the side to which their w calls them, to none where it is zero."""
    reach = norm(numbers, ints[problem + X], ints[problem + UNKNOWNS])
    for k in range(ints[problem + COUNT]):
        if ints[ints[problem + LEADERS] + k] == leader and is_wide(ints, numbers, problem, k) == 0:
            w, terms = numbers[ints[problem + RESULTS] + k], numbers[ints[problem + TERMS] + k] + reach
            ints[ints[problem + SIDES] + k] = BELOW if w > 0.0 else ABOVE
            if abs(w) <= numbers[ints[problem + SLACKS] + k] * terms and is_apart(ints, numbers, problem, k) == 1:
                free_row(ints, problem, k)


@compiled
def is_apart(ints: Ints, numbers: Numbers, problem: int, row: int) -> int:
    """1 where a row does not follow from the free ones."""
    r, found, left = ints[problem + UNKNOWNS], ints[problem + FREE_COUNT], ints[problem + LEFT]
    factor(ints, numbers, problem)
    for i in range(r):
        numbers[left + i] = numbers[ints[problem + UNITS] + row * r + i]
    leave(ints, numbers, problem, left, -1)
    return 1 if found < r and norm(numbers, left, r) > INDEPENDENT else 0


@compiled
def first_change(ints: Ints, numbers: Numbers, problem: int, driven: int, whole: float) -> float:
    """How far the driven row goes until a row changes sides, CHANGING, to CHANGED_TO: itself where its w is zero.

    Those that come to zero with it, as rows of its own direction do, stay where they are.
    """
    r, shares, way = ints[problem + UNKNOWNS], ints[problem + SHARES], ints[problem + WAY]
    until, least = whole, INDEPENDENT * norm(numbers, way, r)
    ints[problem + CHANGING] = driven
    ints[problem + CHANGED_TO] = BETWEEN
    for k in range(ints[problem + COUNT]):
        side, leader = ints[ints[problem + SIDES] + k], ints[ints[problem + LEADERS] + k]
        led = leader >= 0 and (leader == driven or ints[ints[problem + SIDES] + leader] == BETWEEN)
        if k == driven or side == BETWEEN:
            for s in range(BELOW, ABOVE + 1, 2):
                closing = s * numbers[ints[problem + MOVES] + k]
                if led:
                    closing -= numbers[ints[problem + RATIOS] + k] * numbers[ints[problem + MOVES] + leader]
                room = s * (bound(ints, numbers, problem, k, s) - numbers[shares + k])
                if closing > 0.0 and max(room, 0.0) / closing < until:
                    until = max(room, 0.0) / closing
                    ints[problem + CHANGING] = k
                    ints[problem + CHANGED_TO] = s
        elif (
            side != WAITING
            and numbers[ints[problem + LACKING] + k] == 0.0
            and (led or is_wide(ints, numbers, problem, k) == 1)
        ):
            closing = side * product(numbers, ints[problem + UNITS] + k * r, way, r)
            room = max(-side * numbers[ints[problem + RESULTS] + k], 0.0)
            if closing > least and room / closing < min(until, (1.0 - ALIKE) * whole):
                until = room / closing
                ints[problem + CHANGING] = k
                ints[problem + CHANGED_TO] = BETWEEN
    return until


@compiled
def is_wide(ints: Ints, numbers: Numbers, problem: int, row: int) -> int:
    """1 where there is something between a row's bounds."""
    return 1 if bound(ints, numbers, problem, row, BELOW) < bound(ints, numbers, problem, row, ABOVE) else 0


@compiled
def is_met(ints: Ints, numbers: Numbers, problem: int, row: int, step: float) -> int:
    """1 where a row lacks no more beside those that it follows from than what is left of it beside them may make.

    Unless it can take over from one of them what they bear, in a step that is not far larger than that.
    """
    x, slack, borne = ints[problem + X], ints[problem + SLACKS] + row, 0.0
    terms = numbers[ints[problem + TERMS] + row] + norm(numbers, x, ints[problem + UNKNOWNS])
    if numbers[ints[problem + LACKING] + row] > FOLLOWING * terms:
        return 0
    for k in range(ints[problem + COUNT]):
        borne += abs(numbers[ints[problem + SHARES] + k])
    if numbers[ints[problem + LACKING] + row] > 0.0 and step <= 2.0 * borne:
        return 0
    numbers[slack] = FOLLOWING
    numbers[ints[problem + LACKING] + row] = 0.0
    return 1
