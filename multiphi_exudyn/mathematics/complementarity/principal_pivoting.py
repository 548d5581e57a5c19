"""The small complementarity problem of contact and friction, in flat buffers, by principal pivoting.

    w = A x + b,   x = G^T z,   low <= z <= high:   z = low, w >= 0;  z = high, w <= 0;  between, w = 0

A (k, r) are the directions of displacement, G (k, r) those of force: W = A G^T is symmetric where G is A (contact
without friction), else not. The bounds of a row may be tied to another one, its leader n:

    low - mu z_n <= z <= high + mu z_n                                          (Coulomb's cone in a plane)

At every step all rows but those not yet handled are complementary. The most violated row is driven: its z moves until
its w is zero or z reaches a bound. Meanwhile free rows, between their bounds, keep w = 0; a free row that reaches a
bound is fixed there, and a fixed row whose w reaches zero becomes free. With W positive definite, or a P-matrix, every
row is driven once and the solution is unique. A row that depends linearly on free ones takes over their shares until
one of them reaches a bound; if none does, there is no solution (EXCLUDED). So an independent set of redundant rows
stays free, and none has to be removed before.

SOLVED is verified: every row is complementary but for round-off of its terms, and x = G^T z. Otherwise the result is
UNDECIDED. The record of a problem is that of free_rows.py, set by ``pose``.

Sources: R. W. Cottle, J.-S. Pang, R. E. Stone, The Linear Complementarity Problem, 1992, ch. 4 (the principal pivoting
method of Dantzig and Cottle); for G = A it is the method of D. Goldfarb, A. Idnani, Math. Programming 27 (1983).
"""

from __future__ import annotations

import math

from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, compiled
from multiphi_exudyn.mathematics.complementarity.free_rows import (
    ABOVE,
    ABOVES,
    BELOW,
    BELOWS,
    BETWEEN,
    CHANGED_TO,
    CHANGING,
    COMPONENTS,
    COUNT,
    DIRECTION,
    EXCLUDED_ROWS,
    EXCLUDING,
    FREE,
    HIGHS,
    LEADERS,
    LENGTHS,
    LOWS,
    MOVES,
    OFFSETS,
    PROBLEM,
    PUSH_LENGTHS,
    PUSH_UNITS,
    PUSHED,
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
    Q,
    R,
    S,
    X,
    Z,
    add_free_row,
    bound,
    fix_row,
    move_free,
    push_fixed,
    solve_free_rows,
    update_tied_shares,
)
from multiphi_exudyn.mathematics.complementarity.least_distance import SETS
from multiphi_exudyn.mathematics.complementarity.row_sides import (
    accept_dependent_row,
    choose_sides,
    first_change,
    most_violated_row,
    scale,
    update_violations,
)
from multiphi_exudyn.mathematics.orthonormal import norm, scalar_product
from multiphi_exudyn.mathematics.round_off import FOLLOWING, INDEPENDENT, ZERO

__all__ = ["EXCLUDED", "PROBLEM", "SOLVED", "UNDECIDED", "lay_out", "pose", "problem_ints", "problem_numbers", "solve"]

SOLVED, EXCLUDED, UNDECIDED = 0, 1, 2  # UNDECIDED: round-off prevents convergence of the sides
APART = 1e-9  # of its terms: shift of a row so that it does not reach zero together with another one
VERIFIED = 1e-12  # of the sum of |z|: largest difference of x and G^T z


def problem_numbers(count: int, unknowns: int) -> int:
    """Return the count of working numbers of a problem."""
    return 3 * count * unknowns + 2 * count * count + 14 * count + 3 * unknowns


def problem_ints(count: int) -> int:
    """Return the count of ints of a problem, including its record."""
    return PROBLEM + 3 * count


def lay_out(ints: Ints, problem: int, count: int, unknowns: int, numbers_at: int) -> None:
    """Set the memory offsets of a problem with at most so many rows and unknowns; its ints follow its record."""
    ints_at = problem + PROBLEM
    for part in (SIDES, FREE, EXCLUDED_ROWS):
        ints[problem + part] = ints_at
        ints_at += count
    for part in (UNITS, PUSH_UNITS, Q):
        ints[problem + part] = numbers_at
        numbers_at += count * unknowns
    for part in (R, S):
        ints[problem + part] = numbers_at
        numbers_at += count * count
    for part in (REMAINDER, DIRECTION, PUSHED):
        ints[problem + part] = numbers_at
        numbers_at += unknowns if part != REMAINDER else max(unknowns, count)
    for part in (LENGTHS, PUSH_LENGTHS, OFFSETS, TERMS, BELOWS, ABOVES, RATIOS, SLACKS, VIOLATIONS, RESULTS):
        ints[problem + part] = numbers_at
        numbers_at += count
    for part in (SHARES, MOVES, COMPONENTS):
        ints[problem + part] = numbers_at
        numbers_at += count


@compiled
def pose(
    ints: Ints,
    problem: int,
    count: int,
    unknowns: int,
    stride: int,
    rows: int,
    pushes: int,
    values: int,
    sizes: int,
    lows: int,
    highs: int,
    leaders: int,
    ties: int,
    x: int,
    z: int,
) -> None:
    """Set offsets of A, G (k, stride), b, sizes of its terms, bounds, leaders (ints), mu (k,), x (r,) and z (k,)."""
    ints[problem + COUNT] = count
    ints[problem + UNKNOWNS] = unknowns
    ints[problem + STRIDE] = stride
    ints[problem + ROWS] = rows
    ints[problem + PUSHES] = pushes
    ints[problem + VALUES] = values
    ints[problem + SIZES] = sizes
    ints[problem + LOWS] = lows
    ints[problem + HIGHS] = highs
    ints[problem + LEADERS] = leaders
    ints[problem + TIES] = ties
    ints[problem + X] = x
    ints[problem + Z] = z


@compiled
def solve(ints: Ints, numbers: Numbers, problem: int, in_turn: int) -> int:
    """Solve for x (r,) and z (k,); return SOLVED, EXCLUDED with the rows that exclude each other, or UNDECIDED.

    in_turn: 1 to drive violated rows in their order, 0 to drive the most violated row first.
    """
    count, x, z = ints[problem + COUNT], ints[problem + X], ints[problem + Z]
    for i in range(ints[problem + UNKNOWNS]):
        numbers[x + i] = 0.0
    for k in range(count):
        numbers[z + k] = 0.0
    if count == 1:
        return solve_single_row(ints, numbers, problem)
    outcome = attempt(ints, numbers, problem, in_turn, 0.0)
    if outcome != SOLVED:
        outcome = attempt(ints, numbers, problem, 1 - in_turn, 0.0)
    return outcome if outcome != UNDECIDED else attempt(ints, numbers, problem, in_turn, APART)


@compiled
def attempt(ints: Ints, numbers: Numbers, problem: int, in_turn: int, shift: float) -> int:
    """Return the outcome of driving the most violated row first, or rows in their order (in_turn).

    shift: of the terms, times k + 1, by which row k is moved until all rows are complementary: rows that reach zero at
    once could else change sides in an endless cycle.
    """
    scale(ints, numbers, problem)
    for k in range(ints[problem + COUNT]):
        numbers[ints[problem + OFFSETS] + k] += (k + 1) * shift * numbers[ints[problem + TERMS] + k]
    push_fixed(ints, numbers, problem)
    for _ in range(SETS * (ints[problem + COUNT] + 1)):
        update_violations(ints, numbers, problem)
        driven = most_violated_row(ints, numbers, problem, in_turn)
        if driven < 0 and shift == 0.0:
            return verify_solution(ints, numbers, problem)
        if driven < 0:
            for k in range(ints[problem + COUNT]):
                numbers[ints[problem + OFFSETS] + k] -= (k + 1) * shift * numbers[ints[problem + TERMS] + k]
            solve_free_rows(ints, numbers, problem)
            shift = 0.0
            continue
        outcome = drive_row(ints, numbers, problem, driven)
        if outcome != SOLVED:
            return outcome
    return UNDECIDED


@compiled
def solve_single_row(ints: Ints, numbers: Numbers, problem: int) -> int:
    """Solve a single row without a leader: the z of zero w, or the bound before it."""
    r, row, pushes = ints[problem + UNKNOWNS], ints[problem + ROWS], ints[problem + PUSHES]
    value, low, high = numbers[ints[problem + VALUES]], numbers[ints[problem + LOWS]], numbers[ints[problem + HIGHS]]
    square, z = scalar_product(numbers, row, numbers, pushes, r), min(max(0.0, low), high)
    if abs(value + square * z) > ZERO * numbers[ints[problem + SIZES]]:
        if square <= 0.0 and ((value < 0.0 and high == math.inf) or (value > 0.0 and low == -math.inf)):
            ints[problem + EXCLUDING] = 1
            ints[ints[problem + EXCLUDED_ROWS]] = 0
            return EXCLUDED
        if square < 0.0:
            return UNDECIDED
        away = low if value > 0.0 else high
        z = min(max(-value / square, low), high) if square > 0.0 else away
    numbers[ints[problem + Z]] = z
    for i in range(r):
        numbers[ints[problem + X] + i] = numbers[pushes + i] * z
    return SOLVED


@compiled
def drive_row(ints: Ints, numbers: Numbers, problem: int, driven: int) -> int:
    """Move the z of a row until the row is complementary; return SOLVED, EXCLUDED or UNDECIDED."""
    sides, results = ints[problem + SIDES], ints[problem + RESULTS]
    way = -1.0 if numbers[results + driven] > 0.0 else 1.0
    choose_sides(ints, numbers, problem, driven)
    ints[sides + driven] = WAITING
    for _ in range(SETS * (ints[problem + COUNT] + 1)):
        progress = way * move_free(ints, numbers, problem, driven, way)
        numbers[ints[problem + MOVES] + driven] = way
        violation = max(-way * numbers[results + driven], 0.0)
        step = first_change(ints, numbers, problem, driven, violation / progress if progress > 0.0 else math.inf)
        if progress == 0.0 and accept_dependent_row(ints, numbers, problem, driven, step) == 1:
            way = -way  # its share moves to the free rows
            move_free(ints, numbers, problem, driven, way)
            numbers[ints[problem + MOVES] + driven] = way
            step = first_change(ints, numbers, problem, driven, math.inf)
        if not step < math.inf:
            list_excluded(ints, numbers, problem, driven)
            return EXCLUDED
        row, side = ints[problem + CHANGING], ints[problem + CHANGED_TO]
        move_rows(ints, numbers, problem, driven, step)
        if side != BETWEEN:
            fix_row(ints, numbers, problem, row, side)
        else:
            choose_sides(ints, numbers, problem, row)
            add_free_row(ints, problem, row)
        if row == driven:
            solve_free_rows(ints, numbers, problem)
            return SOLVED
    return UNDECIDED


@compiled
def list_excluded(ints: Ints, numbers: Numbers, problem: int, driven: int) -> None:
    """List the rows that exclude each other: the driven one, and the free ones that move with it without a bound."""
    ints[problem + EXCLUDING] = 0
    for k in range(ints[problem + COUNT]):
        moves = ints[ints[problem + SIDES] + k] == BETWEEN and abs(numbers[ints[problem + MOVES] + k]) > INDEPENDENT
        if moves or k == driven:
            ints[ints[problem + EXCLUDED_ROWS] + ints[problem + EXCLUDING]] = k
            ints[problem + EXCLUDING] += 1


@compiled
def move_rows(ints: Ints, numbers: Numbers, problem: int, driven: int, step: float) -> None:
    """Move the driven row and the free ones, and update x and w."""
    shares, moves, x, way = ints[problem + SHARES], ints[problem + MOVES], ints[problem + X], ints[problem + DIRECTION]
    for i in range(ints[problem + UNKNOWNS]):
        numbers[x + i] += step * numbers[way + i]
    for k in range(ints[problem + COUNT]):
        if k == driven or ints[ints[problem + SIDES] + k] == BETWEEN:
            numbers[shares + k] += step * numbers[moves + k]
    update_tied_shares(ints, numbers, problem)
    update_violations(ints, numbers, problem)


@compiled
def verify_solution(ints: Ints, numbers: Numbers, problem: int) -> int:
    """Set z; return SOLVED where every row is complementary and x = G^T z, else UNDECIDED."""
    r, x, missing, total, most = ints[problem + UNKNOWNS], ints[problem + X], ints[problem + PUSHED], 0.0, 0.0
    violation = 0.0
    reach, units = norm(numbers, x, r), ints[problem + PUSH_UNITS]
    for i in range(r):
        numbers[missing + i] = numbers[x + i]
    for k in range(ints[problem + COUNT]):
        share = numbers[ints[problem + SHARES] + k]
        share = max(min(share, bound(ints, numbers, problem, k, ABOVE)), bound(ints, numbers, problem, k, BELOW))
        total += abs(share)
        most = max(most, numbers[ints[problem + TERMS] + k])
        for i in range(r):
            numbers[missing + i] -= share * numbers[units + k * r + i]
        w, terms = abs(numbers[ints[problem + RESULTS] + k]), numbers[ints[problem + TERMS] + k] + reach
        if ints[ints[problem + SIDES] + k] == BETWEEN:
            violation = max(violation, w - FOLLOWING * terms)
        numbers[ints[problem + Z] + k] = share / numbers[ints[problem + PUSH_LENGTHS] + k]
    pushed = VERIFIED * (total + reach)
    return SOLVED if violation <= pushed and norm(numbers, missing, r) <= pushed + ZERO * most else UNDECIDED
