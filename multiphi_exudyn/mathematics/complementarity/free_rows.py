"""Free rows of a complementarity problem, between their bounds: their shares, and how these move with another row.

    A_C x = -b_C,   x = x_0 + G_C^T z_C,   A_C^T = Q R,   S = Q^T G_C^T,   S z_C = R^-T (-b_C) - Q^T x_0

C: the free rows, x_0 the contribution of rows at their bounds. Where G is A, S is R, and R is inverted, not its square.
A row at a bound that is tied to a free row, its leader, moves with it: it belongs to the leader's column of G.
"""

from __future__ import annotations

from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, compiled
from multiphi_exudyn.mathematics.orthonormal import norm, scalar_product
from multiphi_exudyn.mathematics.round_off import INDEPENDENT

__all__ = [
    "PROBLEM",
    "active_leader",
    "add_free_row",
    "bound",
    "factor",
    "fix_row",
    "move_free",
    "project_out",
    "solve_free_rows",
]

# input: sizes; offsets of A and G (k, stride), b, the sizes of its terms, low, high (k,), in the ints the leaders (k,),
# -1 for none, and mu (k,); offsets of the results x (r,) and z (k,)
COUNT, UNKNOWNS, STRIDE, ROWS, PUSHES, VALUES, SIZES, LOWS, HIGHS, LEADERS, TIES, X, Z = range(13)
EXCLUDING, EXCLUDED_ROWS = 13, 14  # number of rows that exclude each other, offset of their list
# working memory, with rows of length one: ints, then numbers
SIDES, FREE, FREE_COUNT, CHANGING, CHANGED_TO = range(15, 20)  # the row that changes sides next, and to which
UNITS, PUSH_UNITS, LENGTHS, PUSH_LENGTHS, OFFSETS, TERMS, BELOWS, ABOVES, RATIOS, SLACKS = range(20, 30)
VIOLATIONS, RESULTS, SHARES, MOVES, Q, R, S, COMPONENTS, REMAINDER, DIRECTION, PUSHED = range(30, 41)
PROBLEM = 41  # ints of the record

BELOW, BETWEEN, ABOVE, WAITING = -1, 0, 1, 2  # sides; WAITING: between bounds, not yet handled


@compiled
def active_leader(ints: Ints, problem: int, row: int) -> int:
    """Return the leader to which a row at one of its bounds is tied, -1 for none."""
    side = ints[ints[problem + SIDES] + row]
    return -1 if side in (BETWEEN, WAITING) else ints[ints[problem + LEADERS] + row]


@compiled
def bound(ints: Ints, numbers: Numbers, problem: int, row: int, side: int) -> float:
    """Return the bound of a row on a side."""
    leader, offset = ints[ints[problem + LEADERS] + row], ints[problem + BELOWS if side < 0 else problem + ABOVES]
    if leader < 0:
        return numbers[offset + row]
    return (
        numbers[offset + row] + side * numbers[ints[problem + RATIOS] + row] * numbers[ints[problem + SHARES] + leader]
    )


@compiled
def set_push(ints: Ints, numbers: Numbers, problem: int, row: int) -> None:
    """Set PUSHED (r,): the column of G of a row, with those of rows tied to it."""
    r, pushed, units = ints[problem + UNKNOWNS], ints[problem + PUSHED], ints[problem + PUSH_UNITS]
    for i in range(r):
        numbers[pushed + i] = numbers[units + row * r + i]
    for k in range(ints[problem + COUNT]):
        if ints[ints[problem + LEADERS] + k] == row and active_leader(ints, problem, k) == row:
            share = ints[ints[problem + SIDES] + k] * numbers[ints[problem + RATIOS] + k]
            for i in range(r):
                numbers[pushed + i] += share * numbers[units + k * r + i]


@compiled
def add_free_row(ints: Ints, problem: int, row: int) -> None:
    """Make a row free: between its bounds."""
    ints[ints[problem + FREE] + ints[problem + FREE_COUNT]] = row
    ints[problem + FREE_COUNT] += 1
    ints[ints[problem + SIDES] + row] = BETWEEN


@compiled
def fix_row(ints: Ints, numbers: Numbers, problem: int, row: int, side: int) -> None:
    """Fix a row at its bound; rows tied to a leader of zero share are fixed too."""
    shares, sides = ints[problem + SHARES], ints[problem + SIDES]
    ints[sides + row] = side
    numbers[shares + row] = bound(ints, numbers, problem, row, side)
    for k in range(ints[problem + COUNT]):
        if ints[ints[problem + LEADERS] + k] == row and numbers[shares + row] == 0.0 and ints[sides + k] == BETWEEN:
            ints[sides + k] = BELOW
            numbers[shares + k] = bound(ints, numbers, problem, k, BELOW)
    free, count = ints[problem + FREE], 0
    for a in range(ints[problem + FREE_COUNT]):
        if ints[sides + ints[free + a]] == BETWEEN:
            ints[free + count] = ints[free + a]
            count += 1
    ints[problem + FREE_COUNT] = count


@compiled
def factor(ints: Ints, numbers: Numbers, problem: int) -> None:
    """Q (k, r) with orthonormal rows, R (k, k) above its diagonal, by Gram-Schmidt, each row twice; and S (k, k)."""
    r, count, q = ints[problem + UNKNOWNS], ints[problem + COUNT], ints[problem + Q]
    triangle, free, pushed = ints[problem + R], ints[problem + FREE], ints[problem + PUSHED]
    for a in range(ints[problem + FREE_COUNT]):
        row = q + a * r
        for i in range(r):
            numbers[row + i] = numbers[ints[problem + UNITS] + ints[free + a] * r + i]
        for b in range(ints[problem + FREE_COUNT]):
            numbers[triangle + b * count + a] = 0.0
        for _ in range(2):
            for b in range(a):
                share = scalar_product(numbers, q + b * r, numbers, row, r)
                numbers[triangle + b * count + a] += share
                for i in range(r):
                    numbers[row + i] -= share * numbers[q + b * r + i]
        length = norm(numbers, row, r)
        numbers[triangle + a * count + a] = length
        for i in range(r):
            numbers[row + i] /= length if length > 0.0 else 1.0
    for a in range(ints[problem + FREE_COUNT]):
        if ints[problem + UNITS] != ints[problem + PUSH_UNITS]:
            set_push(ints, numbers, problem, ints[free + a])
        for b in range(ints[problem + FREE_COUNT]):
            if ints[problem + UNITS] == ints[problem + PUSH_UNITS]:
                numbers[ints[problem + S] + b * count + a] = numbers[triangle + b * count + a]
            else:
                numbers[ints[problem + S] + b * count + a] = scalar_product(numbers, q + b * r, numbers, pushed, r)


@compiled
def eliminate(ints: Ints, numbers: Numbers, problem: int, x: int) -> None:
    """Solve S x = given (k,) in place, by Gaussian elimination with pivoting; S is overwritten."""
    count, size, s = ints[problem + COUNT], ints[problem + FREE_COUNT], ints[problem + S]
    for a in range(size):
        best = a
        for b in range(a + 1, size):
            if abs(numbers[s + b * count + a]) > abs(numbers[s + best * count + a]):
                best = b
        if best != a:
            for c in range(a, size):
                swapped = numbers[s + a * count + c]
                numbers[s + a * count + c] = numbers[s + best * count + c]
                numbers[s + best * count + c] = swapped
            swapped = numbers[x + a]
            numbers[x + a] = numbers[x + best]
            numbers[x + best] = swapped
        for b in range(a + 1, size):
            if numbers[s + b * count + a] != 0.0:
                share = numbers[s + b * count + a] / numbers[s + a * count + a]
                for c in range(a + 1, size):
                    numbers[s + b * count + c] -= share * numbers[s + a * count + c]
                numbers[x + b] -= share * numbers[x + a]
    for a in range(size - 1, -1, -1):
        total = numbers[x + a]
        for b in range(a + 1, size):
            total -= numbers[s + a * count + b] * numbers[x + b]
        pivot = numbers[s + a * count + a]
        numbers[x + a] = total / pivot if pivot != 0.0 else 0.0


@compiled
def move_free(ints: Ints, numbers: Numbers, problem: int, row: int, way: float) -> float:
    """Set MOVES (k,) of free rows and DIRECTION (r,) of x as a row moves by ``way``, 1 or -1; return the rate of its w.

    Both x and w stay constant where the row depends linearly on the free ones.
    """
    r, size, free = ints[problem + UNKNOWNS], ints[problem + FREE_COUNT], ints[problem + FREE]
    remainder, components, direction, pushed = (
        ints[problem + REMAINDER],
        ints[problem + COMPONENTS],
        ints[problem + DIRECTION],
        ints[problem + PUSHED],
    )
    factor(ints, numbers, problem)
    set_push(ints, numbers, problem, row)
    for i in range(r):
        numbers[remainder + i] = numbers[ints[problem + UNITS] + row * r + i]
        numbers[direction + i] = way * numbers[pushed + i]
    for b in range(size):
        numbers[components + b] = 0.0
    project_out(ints, numbers, problem, remainder, -1)
    project_out(ints, numbers, problem, direction, components)
    eliminate(ints, numbers, problem, components)
    for b in range(size):
        numbers[components + b] = -numbers[components + b]
        numbers[ints[problem + MOVES] + ints[free + b]] = numbers[components + b]
    if ints[problem + UNITS] != ints[problem + PUSH_UNITS] and size > 0:
        for i in range(r):
            numbers[direction + i] = way * numbers[pushed + i]
        push_free(ints, numbers, problem, components, direction)
        project_out(ints, numbers, problem, direction, -1)
    is_dependent = size > 0 and (size >= r or norm(numbers, remainder, r) <= INDEPENDENT)
    for i in range(r):
        numbers[direction + i] = 0.0 if is_dependent else numbers[direction + i]
    return scalar_product(numbers, remainder, numbers, direction, r)


@compiled
def project_out(ints: Ints, numbers: Numbers, problem: int, vector: int, shares: int) -> None:
    """Subtract from a vector (r,) its parts along Q, in place; add these parts to shares, -1 for none.

    This is done twice, for the round-off of nearly parallel rows.
    """
    r, q = ints[problem + UNKNOWNS], ints[problem + Q]
    for _ in range(2):
        for b in range(ints[problem + FREE_COUNT]):
            share = scalar_product(numbers, q + b * r, numbers, vector, r)
            if shares >= 0:
                numbers[shares + b] += share
            for i in range(r):
                numbers[vector + i] -= share * numbers[q + b * r + i]


@compiled
def push_free(ints: Ints, numbers: Numbers, problem: int, shares: int, vector: int) -> None:
    """Add G^T z of the free rows with these shares (k,) to a vector (r,)."""
    r, pushed = ints[problem + UNKNOWNS], ints[problem + PUSHED]
    for a in range(ints[problem + FREE_COUNT]):
        set_push(ints, numbers, problem, ints[ints[problem + FREE] + a])
        for i in range(r):
            numbers[vector + i] += numbers[shares + a] * numbers[pushed + i]


@compiled
def solve_free_rows(ints: Ints, numbers: Numbers, problem: int) -> None:
    """Solve for x and the shares z of the free rows, with the others at their bounds."""
    r, size, count, free = (
        ints[problem + UNKNOWNS],
        ints[problem + FREE_COUNT],
        ints[problem + COUNT],
        ints[problem + FREE],
    )
    x, q, triangle, components = ints[problem + X], ints[problem + Q], ints[problem + R], ints[problem + COMPONENTS]
    shares, targets = ints[problem + SHARES], ints[problem + REMAINDER]
    factor(ints, numbers, problem)
    update_tied_shares(ints, numbers, problem)
    push_fixed(ints, numbers, problem)
    for a in range(size):
        target = -numbers[ints[problem + OFFSETS] + ints[free + a]]
        for b in range(a):
            target -= numbers[triangle + b * count + a] * numbers[components + b]
        pivot = numbers[triangle + a * count + a]
        numbers[components + a] = target / pivot if pivot != 0.0 else 0.0
    for a in range(size):
        numbers[targets + a] = numbers[components + a]
        numbers[components + a] -= scalar_product(numbers, q + a * r, numbers, x, r)
    if ints[problem + UNITS] == ints[problem + PUSH_UNITS]:
        for a in range(size):
            for i in range(r):
                numbers[x + i] += numbers[components + a] * numbers[q + a * r + i]
    eliminate(ints, numbers, problem, components)
    if ints[problem + UNITS] != ints[problem + PUSH_UNITS]:
        push_free(ints, numbers, problem, components, x)
        for a in range(size):
            difference = numbers[targets + a] - scalar_product(numbers, q + a * r, numbers, x, r)
            for i in range(r):
                numbers[x + i] += difference * numbers[q + a * r + i]
    for a in range(size):
        numbers[shares + ints[free + a]] = numbers[components + a]
    update_tied_shares(ints, numbers, problem)


@compiled
def update_tied_shares(ints: Ints, numbers: Numbers, problem: int) -> None:
    """Set the shares of tied rows from those of their leaders."""
    for k in range(ints[problem + COUNT]):
        if active_leader(ints, problem, k) >= 0:
            side = ints[ints[problem + SIDES] + k]
            numbers[ints[problem + SHARES] + k] = bound(ints, numbers, problem, k, side)


@compiled
def push_fixed(ints: Ints, numbers: Numbers, problem: int) -> None:
    """Set x to x_0 (r,): G^T z of the rows that are not free; of rows tied to a free one the constant part."""
    r, x, units = ints[problem + UNKNOWNS], ints[problem + X], ints[problem + PUSH_UNITS]
    for i in range(r):
        numbers[x + i] = 0.0
    for k in range(ints[problem + COUNT]):
        side, leader = ints[ints[problem + SIDES] + k], active_leader(ints, problem, k)
        share = numbers[ints[problem + SHARES] + k]
        if leader >= 0 and ints[ints[problem + SIDES] + leader] == BETWEEN:
            share = numbers[ints[problem + BELOWS if side < 0 else problem + ABOVES] + k]
        if side != BETWEEN and share != 0.0:
            for i in range(r):
                numbers[x + i] += share * numbers[units + k * r + i]
