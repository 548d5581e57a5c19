"""The small complementarity problem of contact and friction, in flat buffers, by principal pivoting.

    w = A x + b,   x = G^T z,   low <= z <= high:   z = low, w >= 0;  z = high, w <= 0;  between, w = 0

A (k, r) are the directions in which unknowns are seen, G (k, r) those in which they push: W = A G^T is symmetric where
G is A (contact without friction), else not. The bounds of a row may be tied to another one, its leader n:

    low - mu z_n <= z <= high + mu z_n                                          (Coulomb's cone in a plane)

At every step all rows but those not yet dealt with are complementary. The one that is violated most is driven: its z
moves until its w is zero or z has come to a bound; those between their bounds keep w = 0, and who comes to a bound, or
is called away from one, changes sides on the way. With W positive definite, or a P-matrix, every row is driven once and
the solution is the only one. A row that follows from those between their bounds takes over what they bear until one of
them comes to a bound; if none does, there is no solution (EXCLUDED). So of redundant rows an independent set is left
between its bounds, and none has to be taken out before.

SOLVED is proved: every row is complementary but for round-off of its terms, and x is what the z push. Else the answer
is UNDECIDED. The record of a problem is that of free_rows.py, set by ``pose``.

Sources: R. W. Cottle, J.-S. Pang, R. E. Stone, The Linear Complementarity Problem, 1992, ch. 4 (the principal pivoting
method of Dantzig and Cottle); for G = A it is the way of D. Goldfarb, A. Idnani, Math. Programming 27 (1983).
"""

from __future__ import annotations

import math

from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, compiled
from multiphi_exudyn.mathematics.complementarity.free_rows import (
    ABOVE,
    ABOVES,
    ALONG,
    BELOW,
    BELOWS,
    BETWEEN,
    CHANGED_TO,
    CHANGING,
    COUNT,
    EXCLUDED_ROWS,
    EXCLUDING,
    FREE,
    HIGHS,
    LACKING,
    LEADERS,
    LEFT,
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
    Q,
    R,
    S,
    X,
    Z,
    bound,
    follow_leaders,
    free_row,
    meet,
    move_free,
    norm,
    product,
    push_fixed,
    release_row,
)
from multiphi_exudyn.mathematics.complementarity.least_distance import FOLLOWING, INDEPENDENT, SETS
from multiphi_exudyn.mathematics.complementarity.row_sides import (
    choose_sides,
    first_change,
    is_met,
    look,
    most_lacking,
    scale,
)
from multiphi_exudyn.mathematics.round_off import ZERO

__all__ = ["EXCLUDED", "PROBLEM", "SOLVED", "UNDECIDED", "lay_out", "pose", "problem_ints", "problem_numbers", "solve"]

SOLVED, EXCLUDED, UNDECIDED = 0, 1, 2  # no z is complementary; round-off keeps the sides from settling
APART = 1e-9  # of its terms: by which a row is moved so that it does not come to zero with another one
PROVED = 1e-12  # of all pushes: what x may differ from their sum


def problem_numbers(count: int, unknowns: int) -> int:
    """Numbers that a problem works in."""
    return 3 * count * unknowns + 2 * count * count + 14 * count + 3 * unknowns


def problem_ints(count: int) -> int:
    """Ints that it takes, its record first."""
    return PROBLEM + 3 * count


def lay_out(ints: Ints, problem: int, count: int, unknowns: int, numbers_at: int) -> None:
    """Give a problem of at most so many rows and unknowns its memory; that in the ints is behind its record."""
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
    for part in (LEFT, WAY, PUSHED):
        ints[problem + part] = numbers_at
        numbers_at += unknowns if part != LEFT else max(unknowns, count)
    for part in (LENGTHS, PUSH_LENGTHS, OFFSETS, TERMS, BELOWS, ABOVES, RATIOS, SLACKS, LACKING, RESULTS):
        ints[problem + part] = numbers_at
        numbers_at += count
    for part in (SHARES, MOVES, ALONG):
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
    """Where A, G (k, stride), b, the sizes of its terms, bounds, leaders (ints), mu (k,), x (r,) and z (k,) stand."""
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
    """x (r,) and z (k,); SOLVED, EXCLUDED with those rows that exclude each other, or UNDECIDED.

    in_turn: 1 where the first of redundant rows come to their bounds first, 0 where those violated most do.
    """
    count, x, z = ints[problem + COUNT], ints[problem + X], ints[problem + Z]
    for i in range(ints[problem + UNKNOWNS]):
        numbers[x + i] = 0.0
    for k in range(count):
        numbers[z + k] = 0.0
    if count == 1:
        return only_one(ints, numbers, problem)
    answer = attempt(ints, numbers, problem, in_turn, 0.0)
    if answer != SOLVED:
        answer = attempt(ints, numbers, problem, 1 - in_turn, 0.0)
    return answer if answer != UNDECIDED else attempt(ints, numbers, problem, in_turn, APART)


@compiled
def attempt(ints: Ints, numbers: Numbers, problem: int, in_turn: int, apart: float) -> int:
    """The answer where the row violated most is driven first, or rows in turn: round-off spoils either elsewhere.

    apart: of their terms, by which every row of another multiple is moved until all are complementary: where several
    come to zero at once they may change sides with each other for ever.
    """
    scale(ints, numbers, problem)
    for k in range(ints[problem + COUNT]):
        numbers[ints[problem + OFFSETS] + k] += (k + 1) * apart * numbers[ints[problem + TERMS] + k]
    push_fixed(ints, numbers, problem)
    for _ in range(SETS * (ints[problem + COUNT] + 1)):
        look(ints, numbers, problem)
        driven = most_lacking(ints, numbers, problem, in_turn)
        if driven < 0 and apart == 0.0:
            return proved(ints, numbers, problem)
        if driven < 0:
            for k in range(ints[problem + COUNT]):
                numbers[ints[problem + OFFSETS] + k] -= (k + 1) * apart * numbers[ints[problem + TERMS] + k]
            meet(ints, numbers, problem)
            apart = 0.0
            continue
        answer = drive(ints, numbers, problem, driven)
        if answer != SOLVED:
            return answer
    return UNDECIDED


@compiled
def only_one(ints: Ints, numbers: Numbers, problem: int) -> int:
    """One row, without a leader: the z that makes its w zero, or the bound before it."""
    r, row, pushes = ints[problem + UNKNOWNS], ints[problem + ROWS], ints[problem + PUSHES]
    value, low, high = numbers[ints[problem + VALUES]], numbers[ints[problem + LOWS]], numbers[ints[problem + HIGHS]]
    square, z = product(numbers, row, pushes, r), min(max(0.0, low), high)
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
def drive(ints: Ints, numbers: Numbers, problem: int, driven: int) -> int:
    """A row's z moves until the row is complementary; SOLVED, EXCLUDED or UNDECIDED."""
    sides, results = ints[problem + SIDES], ints[problem + RESULTS]
    way = -1.0 if numbers[results + driven] > 0.0 else 1.0
    choose_sides(ints, numbers, problem, driven)
    ints[sides + driven] = WAITING
    for _ in range(SETS * (ints[problem + COUNT] + 1)):
        progress = way * move_free(ints, numbers, problem, driven, way)
        numbers[ints[problem + MOVES] + driven] = way
        lacking = max(-way * numbers[results + driven], 0.0)
        step = first_change(ints, numbers, problem, driven, lacking / progress if progress > 0.0 else math.inf)
        if progress == 0.0 and is_met(ints, numbers, problem, driven, step) == 1:  # by others: its share goes to them
            way = -way
            move_free(ints, numbers, problem, driven, way)
            numbers[ints[problem + MOVES] + driven] = way
            step = first_change(ints, numbers, problem, driven, math.inf)
        if not step < math.inf:
            list_excluded(ints, numbers, problem, driven)
            return EXCLUDED
        row, side = ints[problem + CHANGING], ints[problem + CHANGED_TO]
        go(ints, numbers, problem, driven, step)
        if side != BETWEEN:
            release_row(ints, numbers, problem, row, side)
        else:
            choose_sides(ints, numbers, problem, row)
            free_row(ints, problem, row)
        if row == driven:
            meet(ints, numbers, problem)
            return SOLVED
    return UNDECIDED


@compiled
def list_excluded(ints: Ints, numbers: Numbers, problem: int, driven: int) -> None:
    """The rows that exclude each other: the driven one, and the free ones that would go on with it for ever."""
    ints[problem + EXCLUDING] = 0
    for k in range(ints[problem + COUNT]):
        moves = ints[ints[problem + SIDES] + k] == BETWEEN and abs(numbers[ints[problem + MOVES] + k]) > INDEPENDENT
        if moves or k == driven:
            ints[ints[problem + EXCLUDED_ROWS] + ints[problem + EXCLUDING]] = k
            ints[problem + EXCLUDING] += 1


@compiled
def go(ints: Ints, numbers: Numbers, problem: int, driven: int, step: float) -> None:
    """The driven row and the free ones move, x and w with them."""
    shares, moves, x, way = ints[problem + SHARES], ints[problem + MOVES], ints[problem + X], ints[problem + WAY]
    for i in range(ints[problem + UNKNOWNS]):
        numbers[x + i] += step * numbers[way + i]
    for k in range(ints[problem + COUNT]):
        if k == driven or ints[ints[problem + SIDES] + k] == BETWEEN:
            numbers[shares + k] += step * numbers[moves + k]
    follow_leaders(ints, numbers, problem)
    look(ints, numbers, problem)


@compiled
def proved(ints: Ints, numbers: Numbers, problem: int) -> int:
    """SOLVED, with z, where every row is complementary and x is what z pushes, else UNDECIDED."""
    r, x, missing, total, most = ints[problem + UNKNOWNS], ints[problem + X], ints[problem + PUSHED], 0.0, 0.0
    left = 0.0
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
            left = max(left, w - FOLLOWING * terms)
        numbers[ints[problem + Z] + k] = share / numbers[ints[problem + PUSH_LENGTHS] + k]
    pushed = PROVED * (total + reach)
    return SOLVED if left <= pushed and norm(numbers, missing, r) <= pushed + ZERO * most else UNDECIDED
