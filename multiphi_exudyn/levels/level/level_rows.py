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
from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, compiled, entry
from multiphi_exudyn.mathematics.eigenproblems.modes import align_signs, has_clusters
from multiphi_exudyn.mathematics.orthonormal import scalar_product, write_following, write_span
from multiphi_exudyn.mathematics.round_off import ZERO

__all__ = ["LevelRows", "level_rows"]

CLUSTERED, DONE, VIOLATED = 0, 1, 2
SCRATCH = 3  # vectors of a least squares solution, beside its columns


@dataclass(frozen=True)
class LevelRows:
    """Modes of unique signs (m, r), D (r, r), rows of gaps (l, r), of forces from eta and from eta' (k, r).

    following: whether the closed rigid links alone determine the gap of each link (l,).
    """

    vectors: np.ndarray
    damping: np.ndarray
    gaps: np.ndarray
    forces: np.ndarray
    force_rates: np.ndarray
    following: np.ndarray


def level_rows(
    base: ModalBase,
    closed: list[int],
    stiffnesses: list[float],
    squares: np.ndarray,
    vectors: np.ndarray,
    accuracy: float,
    check: bool,
) -> LevelRows | None:
    """Return the rows of a level of omega^2 (r,) and modes (m, r); None where omega^2 are equal, if this is checked.

    closed: links, of which rigid ones are independent. stiffnesses: of all closed directions. accuracy: mu, which
    limits that of omega^2. Raises NumericalFailure for omega^2 that violate the interlacing theorem.
    """
    (m, r), links, k = vectors.shape, len(base.links), len(closed)
    places = [p for p, i in enumerate(closed) if base.links[i].rigid]
    c = len(places)
    numbers, modes = np.empty(r * (links + r + 2 * k)), np.array(vectors.T, order="C")
    values, damping = numbers[: r * links].reshape(links, r), numbers[r * links : r * (links + r)].reshape(r, r)
    np.matmul(base.directions.T, vectors, out=values)
    damped = np.ascontiguousarray(base.damped(vectors, closed).T)
    np.matmul(modes, damped.T, out=damping)
    scratch = np.empty(r + (SCRATCH + c) * m + c * c + links)
    stiffening, softening = sum(each > 0 for each in stiffnesses), sum(each < 0 for each in stiffnesses)
    described = np.array(closed + [closed[p] for p in places] + places, int)
    outcome = fill_rows(
        base.level_numbers, squares, modes.ravel(), damped.ravel(), numbers, described, scratch,
        m, r, len(base.points), links, k, c, stiffening, softening, INTERLACING * accuracy, int(check),
    )  # fmt: skip
    if outcome == VIOLATED:
        raise NumericalFailure(
            "level: its modes are not accurate (interlacing violated); are units and magnitudes of mass and stiffness "
            "right?"
        )
    forces, following = numbers[r * (links + r) :].reshape(2, k, r), scratch[len(scratch) - links :] != 0.0
    return LevelRows(modes.T, damping, values, forces[0], forces[1], following) if outcome == DONE else None


@compiled
def write_rows(
    base: Numbers,
    squares: Numbers,
    modes: Numbers,
    damped: Numbers,
    numbers: Numbers,
    closed: Ints,
    scratch: Numbers,
    m: int,
    r: int,
    points: int,
    links: int,
    k: int,
    c: int,
    stiffening: int,
    softening: int,
    slack: float,
    check: int,
) -> int:
    """Make the signs of modes (r, m) unique, and write all rows; return whether this is DONE, or why not.

    base: ``ModalBase.level_numbers``. damped: C_l psi (r, m), overwritten. numbers: gaps (l, r), D (r, r), forces
    (2, k, r), the first two for modes of any sign. closed: numbers of the k closed links, of the c rigid ones, and
    places of these among the closed ones. scratch: signs (r,), memory, and at the end flags of links that rigid ones
    hold.
    """
    observed, damping = links + points, r * links
    lengths, below = observed + m, observed + m + links
    rows, following = below + 3 * m + 2 * links, r + (SCRATCH + c) * m + c * c
    if check == 1 and has_clusters(squares, r) == 1:
        return CLUSTERED
    align_signs(modes, base, numbers, base, rows, scratch, m, r, links, points)
    if not interlaces(base, squares, below, m, r, stiffening, softening, slack):
        return VIOLATED
    for i in range(r):
        for j in range(r):
            numbers[damping + i * r + j] *= scratch[i] * scratch[j]
        for j in range(m if scratch[i] < 0.0 else 0):
            damped[i * m + j] = -damped[i * m + j]
    write_span(base, rows, lengths, closed, k, scratch, r, m, c)
    write_following(base, rows, lengths, scratch, r, following, m, links, c)
    for i in range(links):
        for j in range(r):
            if abs(numbers[i * r + j]) <= ZERO * base[lengths + i] or scratch[following + i] == 1.0:
                numbers[i * r + j] = 0.0
    write_spring_forces(base, numbers, closed, below + 3 * m, damping + r * r, r, links, k)
    if c > 0:
        write_reactions(base, squares, modes, damped, numbers, closed, scratch, below + 2 * m, damping + r * r, m, r,
                        links, k, c)  # fmt: skip
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
def write_spring_forces(
    base: Numbers, numbers: Numbers, closed: Ints, restoring: int, forces: int, r: int, links: int, k: int
) -> None:
    """Write the forces of closed links due to their gaps and gap velocities; springs of rigid ones have none."""
    for p in range(k):
        link = closed[p]
        for j in range(r):
            numbers[forces + p * r + j] = base[restoring + link] * numbers[link * r + j]
            numbers[forces + (k + p) * r + j] = base[restoring + links + link] * numbers[link * r + j]


@compiled
def write_reactions(
    base: Numbers,
    squares: Numbers,
    modes: Numbers,
    damped: Numbers,
    numbers: Numbers,
    closed: Ints,
    scratch: Numbers,
    omega_squares: int,
    forces: int,
    m: int,
    r: int,
    links: int,
    k: int,
    c: int,
) -> None:
    """Write the reactions of the c rigid links among k closed ones; those of springs are there. Overwrites ``damped``.

    A weight of zero Omega^2 and omega^2 is the largest other one of its mode.
    """
    directions, weights, residual = omega_squares + m + 2 * links, r, r + m
    for j in range(r):
        square, smallest = abs(squares[j]), math.inf
        for i in range(m if square == 0.0 else 0):
            if 0.0 < base[omega_squares + i] < smallest:
                smallest = base[omega_squares + i]
        for i in range(m):
            total = base[omega_squares + i] + square
            scratch[weights + i] = 1.0 / (total if total > 0.0 else (smallest if smallest < math.inf else 1.0))
            scratch[residual + i] = (base[omega_squares + i] - squares[j]) * modes[j * m + i]
        for p in range(k):
            force, direction = numbers[forces + p * r + j], directions + closed[p] * m
            for i in range(m if force != 0.0 else 0):
                scratch[residual + i] -= base[direction + i] * force
        fit(base, directions, closed, k, scratch, r, scratch, residual, numbers, forces + j, m, r, c, 1)
    for i in range(m):
        scratch[weights + i] = 1.0
    fit(base, directions, closed, k, scratch, r, damped, 0, numbers, forces + k * r, m, r, c, r)


@compiled
def fit(
    base: Numbers,
    directions: int,
    closed: Ints,
    first: int,
    scratch: Numbers,
    weights: int,
    residuals: Numbers,
    start: int,
    result: Numbers,
    place: int,
    m: int,
    r: int,
    c: int,
    count: int,
) -> None:
    """Set the coefficients of c rigid directions that fit each residual (count, m) best, by Gram-Schmidt.

    closed: from ``first`` on the numbers of the rigid links, then the rows, of r, in which their coefficients begin at
    ``place``. directions: where those of all links begin. The residuals are overwritten. scratch, from ``weights`` on:
    weights (m,), memory for a residual and a weighted column (m,), columns (c, m) and a triangle (c, c).
    """
    weighted, columns = weights + 2 * m, weights + SCRATCH * m
    triangle = columns + c * m
    for p in range(c):
        direction = directions + closed[first + p] * m
        for i in range(m):
            scratch[columns + p * m + i] = base[direction + i]
    for p in range(c):
        column = columns + p * m
        for i in range(m):
            scratch[weighted + i] = scratch[weights + i] * scratch[column + i]
        square = scalar_product(scratch, weighted, scratch, column, m)
        for q in range(p + 1, c):
            other = columns + q * m
            share = scalar_product(scratch, weighted, scratch, other, m) / square
            scratch[triangle + p * c + q] = share
            for i in range(m):
                scratch[other + i] -= share * scratch[column + i]
        for q in range(count):
            other = start + q * m
            share = scalar_product(scratch, weighted, residuals, other, m) / square
            result[place + closed[first + c + p] * r + q] = share
            for i in range(m if p + 1 < c else 0):
                residuals[other + i] -= share * scratch[column + i]
    for p in range(c - 1, -1, -1):
        row = place + closed[first + c + p] * r
        for q in range(p + 1, c):
            other, share = place + closed[first + c + q] * r, scratch[triangle + p * c + q]
            for j in range(count):
                result[row + j] -= share * result[other + j]


fill_rows = entry(write_rows)
