"""Rows of a level, in one compiled pass: from its modes the gaps, the damping matrix and the forces of closed contacts.

Each direction of positive stiffness added interlaces: omega_i(open) <= omega_i(level) <= omega_i+c(open), one of
negative stiffness downwards; asserted here. The force of a closed compliant contact follows from its gap. The reactions
rho (c,) of rigid contacts H_r are, in every mode, a least squares solution of

    (Omega^2 - omega^2) psi - (force of the springs) = H_r rho,   C_l psi = H_r rho'

the first one weighted by 1 / (Omega^2 + |omega^2|), in which no mode of the base outweighs the others.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.errors import NumericalFailure
from multiphi_exudyn.levels.base.modal_base import INTERLACING, ModalBase
from multiphi_exudyn.mathematics.compiling.compiled import Numbers, compiled, entry
from multiphi_exudyn.mathematics.eigenproblems.modes import align_signs, has_clusters
from multiphi_exudyn.mathematics.round_off import ZERO

__all__ = ["LevelRows", "level_rows"]

CLUSTERED, DONE, VIOLATED = 0, 1, 2
SCRATCH = 2  # vectors of a least squares solution, beside its columns


@dataclass(frozen=True)
class LevelRows:
    """Modes of unique signs (m, r), D (r, r), rows of gaps (l, r), of forces from eta and from eta' (k, r)."""

    vectors: np.ndarray
    damping: np.ndarray
    gaps: np.ndarray
    forces: np.ndarray
    force_rates: np.ndarray


def level_rows(
    base: ModalBase,
    closed: list[int],
    stiffnesses: list[float],
    squares: np.ndarray,
    vectors: np.ndarray,
    following: np.ndarray,
    accuracy: float,
    check: bool,
) -> LevelRows | None:
    """Return the rows of a level of omega^2 (r,) and modes (m, r); None where omega^2 are equal, if this is checked.

    stiffnesses: of all closed directions. following: links (l,) whose gaps are constant. accuracy: mu, which limits
    that of omega^2. Raises NumericalFailure for omega^2 that violate the interlacing theorem.
    """
    observed, (m, r), links, k = base.observed_rows[0], vectors.shape, len(base.links), len(closed)
    rigid = [base.links[i].rigid for i in closed]
    c = sum(rigid)
    numbers = np.empty(r * (m + len(observed) + r + 2 * k))
    at_values = r * m
    at_damping = at_values + r * len(observed)
    at_forces = at_damping + r * r
    modes, values = numbers[:at_values].reshape(r, m), numbers[at_values:at_damping].reshape(len(observed), r)
    damping, damped = numbers[at_damping:at_forces].reshape(r, r), base.damped(vectors, closed)
    forces = numbers[at_forces:].reshape(2, k, r)
    modes[:] = vectors.T
    np.matmul(observed, vectors, out=values)
    np.matmul(modes, damped, out=damping)
    directions, restoring = base.directions.T[closed], base.restoring[:, closed]
    scratch = np.empty(r + (SCRATCH + c) * m + c * (c + 1))
    work = np.concatenate([damped.T, directions, restoring, closed, rigid, following, scratch], axis=None)
    stiffening, softening = sum(each > 0 for each in stiffnesses), sum(each < 0 for each in stiffnesses)
    outcome = write_level(
        base.level_numbers, squares, numbers, work, m, r, len(observed), links, k, c, stiffening, softening,
        INTERLACING * accuracy, int(check),
    )  # fmt: skip
    if outcome == VIOLATED:
        raise NumericalFailure(
            "level: its modes are not accurate (interlacing violated); are units and magnitudes of mass and stiffness "
            "right?"
        )
    return LevelRows(modes.T, damping, values[:links], *forces) if outcome == DONE else None


@compiled
def write_rows(
    base: Numbers,
    squares: Numbers,
    numbers: Numbers,
    work: Numbers,
    m: int,
    r: int,
    observed: int,
    links: int,
    k: int,
    c: int,
    stiffening: int,
    softening: int,
    slack: float,
    check: int,
) -> int:
    """Make the signs of modes unique, and write all rows; return whether this is DONE, or why not.

    base: ``ModalBase.level_numbers``. numbers: modes (r, m), values of observed rows (observed, r), D (r, r), forces
    (2, k, r). work: C_l psi (r, m); of closed links directions (k, m), forces for a unit gap and a unit gap velocity
    (2, k), their numbers and whether they are rigid (k,), as c of them are; whether gaps are constant (l,); scratch.
    """
    values, damping, given = m * r, (m + observed) * r, (r + k) * m
    following, lengths, below = given + 4 * k, observed + m, observed + m + links
    signs = following + links
    if check == 1 and has_clusters(squares, r) == 1:
        return CLUSTERED
    align_signs(numbers, base, numbers, values, work, signs, m, r, observed)
    if not interlaces(base, squares, below, m, r, stiffening, softening, slack):
        return VIOLATED
    for i in range(r):
        for j in range(r):
            numbers[damping + i * r + j] *= work[signs + i] * work[signs + j]
        for j in range(m):
            work[i * m + j] *= work[signs + i]
    for i in range(links):
        for j in range(r):
            if abs(numbers[values + i * r + j]) <= ZERO * base[lengths + i] or work[following + i] == 1.0:
                numbers[values + i * r + j] = 0.0
    write_spring_forces(numbers, work, values, damping + r * r, given, r, k)
    if c > 0:
        write_reactions(base, squares, numbers, work, below + 2 * m, damping + r * r, signs + r, m, r, k, c)
    return DONE


@compiled
def interlaces(
    base: Numbers, squares: Numbers, below: int, m: int, r: int, stiffening: int, softening: int, slack: float
) -> int:
    """Return 1 where omega^2 (r,) lie between those of the base, bounds (2, m) from ``below`` on, but for the slack."""
    for i in range(r - softening):
        if not squares[softening + i] >= base[below + i] - slack:
            return 0
    for i in range(min(r, m - stiffening)):
        if not squares[i] <= base[below + m + stiffening + i] + slack:
            return 0
    return 1


@compiled
def write_spring_forces(numbers: Numbers, work: Numbers, values: int, forces: int, given: int, r: int, k: int) -> None:
    """Write the forces of closed links due to their gaps and gap velocities; springs of rigid ones have none."""
    for p in range(k):
        gap = values + int(work[given + 2 * k + p]) * r
        for j in range(r):
            numbers[forces + p * r + j] = work[given + p] * numbers[gap + j]
            numbers[forces + (k + p) * r + j] = work[given + k + p] * numbers[gap + j]


@compiled
def write_reactions(
    base: Numbers,
    squares: Numbers,
    numbers: Numbers,
    work: Numbers,
    omega_squares: int,
    forces: int,
    scratch: int,
    m: int,
    r: int,
    k: int,
    c: int,
) -> None:
    """Write the reactions of the c rigid links among k closed ones; those of springs are there.

    A weight of zero Omega^2 and omega^2 is the largest other one of its mode.
    """
    directions, is_rigid, residual = r * m, (r + k) * m + 3 * k, scratch + m
    for j in range(r):
        square, smallest = abs(squares[j]), math.inf
        for i in range(m):
            total = base[omega_squares + i] + square
            if 0.0 < total < smallest:
                smallest = total
        for i in range(m):
            total = base[omega_squares + i] + square
            work[scratch + i] = 1.0 / (total if total > 0.0 else (smallest if smallest < math.inf else 1.0))
            work[residual + i] = (base[omega_squares + i] - squares[j]) * numbers[j * m + i]
        for p in range(k):
            force = numbers[forces + p * r + j]
            for i in range(m if force != 0.0 else 0):
                work[residual + i] -= work[directions + p * m + i] * force
        fit(numbers, work, forces + j, scratch, directions, is_rigid, m, r, k, c)
        for i in range(m):
            work[scratch + i] = 1.0
            work[residual + i] = work[j * m + i]
        fit(numbers, work, forces + k * r + j, scratch, directions, is_rigid, m, r, k, c)


@compiled
def fit(
    numbers: Numbers,
    work: Numbers,
    result: int,
    scratch: int,
    directions: int,
    is_rigid: int,
    m: int,
    r: int,
    k: int,
    c: int,
) -> None:
    """Set the coefficients of rigid directions that fit a residual best, at ``result`` in steps of r.

    By Gram-Schmidt orthogonalisation in the weighted product. scratch: weights and residual (m,), columns (c, m), and a
    triangle (c, c + 1).
    """
    residual, columns, triangle, q = scratch + m, scratch + 2 * m, scratch + (2 + c) * m, 0
    for p in range(k):
        if work[is_rigid + p] == 1.0:
            for i in range(m):
                work[columns + q * m + i] = work[directions + p * m + i]
            q += 1
    for p in range(c):
        column, row = columns + p * m, triangle + p * (c + 1)
        square = weighted_product(work, scratch, column, column, m)
        for q in range(p + 1, c + 1):
            other = columns + q * m if q < c else residual
            work[row + q] = weighted_product(work, scratch, column, other, m) / square
            for i in range(m if p + 1 < c else 0):
                work[other + i] -= work[row + q] * work[column + i]
    for p in range(c - 1, -1, -1):
        for q in range(p + 1, c):
            work[triangle + p * (c + 1) + c] -= work[triangle + p * (c + 1) + q] * work[triangle + q * (c + 1) + c]
    q = 0
    for p in range(k):
        if work[is_rigid + p] == 1.0:
            numbers[result + p * r] = work[triangle + q * (c + 1) + c]
            q += 1


@compiled
def weighted_product(numbers: Numbers, weights: int, a: int, b: int, m: int) -> float:
    """Return the sum of w a b over m elements, in two independent sums, which a processor adds up together."""
    even, odd = 0.0, 0.0
    for i in range(0, m - 1, 2):
        even += numbers[weights + i] * numbers[a + i] * numbers[b + i]
        odd += numbers[weights + i + 1] * numbers[a + i + 1] * numbers[b + i + 1]
    if m % 2 == 1:
        even += numbers[weights + m - 1] * numbers[a + m - 1] * numbers[b + m - 1]
    return even + odd


write_level = entry(write_rows)
