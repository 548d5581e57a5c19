"""Modal base: the coordinates in which every level is a small dense problem, whatever n is.

    x = Phi y,   y = Phi^T M x

Phi (n, m) are the open structure's own modes, so the mass is the identity and the stiffness diag(Omega^2). They are all
of them where that is affordable, else the lowest ones and, orthogonal to them, the remainders of
Krylov vectors of contacts and points (build_base.py). A set of closed contacts then adds

    closed rigid contacts      H_r^T y = -gap
    closed compliant contacts  K_l = diag(Omega^2) + H_c diag(k) H_c^T,   C_l = C + H_c diag(c) H_c^T
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse

from multiphi_exudyn._core import are_independent
from multiphi_exudyn.display import Shown, names
from multiphi_exudyn.levels.base.closed_directions import ClosedDirections
from multiphi_exudyn.mathematics.bounded_cache import BoundedCache
from multiphi_exudyn.mathematics.modes import Modes
from multiphi_exudyn.mathematics.round_off import drop_round_off
from multiphi_exudyn.mechanics.arguments import Matrix
from multiphi_exudyn.mechanics.element import Element
from multiphi_exudyn.mechanics.element_table import ElementTable

__all__ = ["ModalBase", "parallel"]

PARALLEL = 1e-14  # of the largest component: directions that differ by less differ by round-off
NEARLY_PARALLEL = 1 - 1e-6  # cosine of two directions that are compared closely
INTERLACING = 1e-8  # relative violation of the interlacing theorem that is still round-off
EPSILON = float(np.finfo(float).eps)
CLOSED_SETS = 8  # of contacts, whose directions are cached: a level needs them when it is built and when it is loaded
CANCELLED = 1e-13  # of sum |k|: a total stiffness of a force law below it is round-off of zero


@dataclass(frozen=True, repr=False)
class ModalBase(ElementTable, Shown):
    """The structure and its contacts in coordinates y of its own modes, x = Phi y.

    modes: of the open structure, (n, m). points: (k, m), rows of its points. damping: C (m, m). directions: H (m, l) of
    the l links; pushes: F (m, l), along which their forces act. contacts: elements (c,) as given, whose first links
    come first (element.py). complete: whether m = n. mass: M (n, n), the structure's own.
    exact_count: number of its lowest modes that are modes of the structure. most_level_modes: largest number of modes
    of a level. load_rows: rows (k, n) of loads that the base represents beside those of contacts and points. error: of
    omega^2 of sample levels, relative.
    """

    modes: Modes
    points: np.ndarray
    damping: np.ndarray
    directions: np.ndarray
    pushes: np.ndarray
    contacts: tuple[Element, ...]
    complete: bool
    mass: Matrix
    exact_count: int
    most_level_modes: int
    load_rows: np.ndarray
    error: float

    def _facts(self) -> Iterator[tuple[str, str]]:
        yield "coordinates", f"{self.modes.count} of {len(self.modes.shapes)}"
        yield "contacts", names([contact.name for contact in self.contacts])

    @property
    def structure_modes(self) -> Modes:
        """Those modes that are modes of the structure."""
        omega, shapes = self.modes.omega[: self.exact_count], self.modes.shapes[:, : self.exact_count]
        return dataclasses.replace(self.modes, omega=omega, shapes=shapes)

    def coordinates(self, x: np.ndarray) -> np.ndarray:
        """Return y = Phi^T M x (m,) or (m, k) of configurations (n,) or (n, k), with zeros in place of round-off.

        Round-off would give a contact at rest a speed.
        """
        if self.complete:
            projector, sizes = self.projection
            return drop_round_off(projector @ x, sizes @ np.abs(x))
        shapes = self.modes.shapes.T
        return drop_round_off(shapes @ (self.mass @ x), np.abs(shapes) @ (abs(self.mass) @ np.abs(x)))

    @functools.cached_property
    def projection(self) -> tuple[np.ndarray, np.ndarray]:
        """Phi^T M and |Phi|^T |M| (m, n), of a complete base, where they are no larger than the modes."""
        shapes = self.modes.shapes
        projector, sizes = (self.mass @ shapes).T, (abs(self.mass) @ np.abs(shapes)).T
        return np.ascontiguousarray(projector), np.ascontiguousarray(sizes)

    def modal_load(self, load: np.ndarray) -> np.ndarray:
        """Return Phi^T f (m,) of a load (n,), zero where it is round-off: weight bends no freely falling body."""
        shapes = self.modes.shapes.T
        return drop_round_off(shapes @ load, np.abs(shapes) @ np.abs(load))

    @functools.cached_property
    def magnitudes(self) -> tuple[np.ndarray, np.ndarray]:
        """|H| (m, l) and |gaps| (l,): the sizes that bound the round-off of a gap."""
        return np.abs(self.directions), np.abs(self.gaps)

    @functools.cached_property
    def lengths(self) -> np.ndarray:
        """|h| (l,) in these coordinates: the sizes that bound the round-off of a mode's gap."""
        return np.linalg.norm(self.directions, axis=0)

    @functools.cached_property
    def unmoved(self) -> np.ndarray:
        """Whether no mode of the base moves a link (l,)."""
        return self.lengths == 0

    @functools.cached_property
    def observed_rows(self) -> tuple[np.ndarray, np.ndarray]:
        """Rows (k, m) of links and points, and their largest values (k + m,) at a unit mode, coordinates last."""
        rows = np.vstack([self.directions.T, self.points])
        return rows, np.concatenate([np.linalg.norm(rows, axis=1), np.ones(self.modes.count)])

    @functools.cached_property
    def direction_rows(self) -> np.ndarray:
        """Directions (l, m) of links, row by row in memory."""
        return np.ascontiguousarray(self.directions.T)

    def independent(self, rigid: Sequence[int]) -> bool:
        """Return whether the directions of these rigid contacts are linearly independent: they can close together."""
        m, k = self.modes.count, len(rigid)
        if k <= 1 or k > m:
            return k <= m and not any(self.unmoved[i] for i in rigid)
        return bool(are_independent(self.direction_rows, self.lengths, list(rigid)))

    @functools.cached_property
    def direction_indices(self) -> list[int]:
        """For every link the index of the first link with the same direction up to its sign."""
        return parallel(self.directions)

    @functools.cached_property
    def direction_signs(self) -> np.ndarray:
        """Sign (c,) of every contact's direction relative to the first link with that direction (direction_indices)."""
        along = np.sum(self.directions * self.directions[:, self.direction_indices], axis=0)
        return np.where(along < 0, -1.0, 1.0)

    def pressing(self, element: int) -> dict[int, int]:
        """Return the links of an element without a held place, and the signs of their directions to its own."""
        links = [k for k in self.link_indices[element] if not self.links[k].held]
        return {k: int(self.direction_signs[k] * self.direction_signs[element]) for k in links}

    @functools.cached_property
    def preload(self) -> np.ndarray:
        """Modal load (m,) of the constant forces of all force laws."""
        total = np.zeros(self.modes.count)
        for i, law in self.laws.items():
            total -= law.constant * self.directions[:, i]
        return total

    @functools.cached_property
    def energy_offset(self) -> float:
        """Energy [J] of the constant forces of all force laws at q = 0: the energy of a law is zero at its centre."""
        return -sum(law.constant * law.centre for law in self.laws.values())

    def gaps_at(self, configuration: np.ndarray, initial: np.ndarray) -> np.ndarray:
        """Return the gaps (l,) [m] at y (m,), from those at y = 0."""
        return np.asarray(self.directions.T @ configuration + initial)

    @functools.cached_property
    def squares(self) -> np.ndarray:
        """Omega^2 (m,) [rad2/s2]."""
        return self.modes.omega**2

    @functools.cached_property
    def square_bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Omega^2 (m,) minus and plus the amount by which round-off may violate the interlacing theorem."""
        slack = INTERLACING * self.squares + EPSILON * self.squares.max(initial=0.0)
        return self.squares - slack, self.squares + slack

    @functools.cached_property
    def periods(self) -> np.ndarray:
        """1 / Omega (m,) [s/rad], zero of rigid-body modes."""
        omega = self.modes.omega
        return np.divide(1.0, omega, out=np.zeros_like(omega), where=omega > 0)

    @functools.cached_property
    def compliance(self) -> np.ndarray:
        """Omega^-2 (e,) [s2/rad2] of the elastic modes."""
        return self.modes.omega[self.modes.rigid :] ** -2.0

    def damping_matrix(self, closed: Sequence[int]) -> np.ndarray:
        """Return C_l (m, m) in these coordinates: damping of the structure and of closed viscous contacts."""
        viscous = [i for i in closed if self.dampings[i]]
        if not viscous:
            return self.damping
        directions = self.directions[:, viscous]
        return np.asarray(self.damping + (directions * self.dampings[viscous]) @ directions.T)

    def largest_damping(self, closed: Sequence[int]) -> float:
        """Return the largest element of C_l, which is on the diagonal, as C_l is positive semidefinite."""
        diagonal = np.diagonal(self.damping) + self.directions[:, closed] ** 2 @ self.dampings[closed]
        return float(diagonal.max(initial=0.0))

    def damped(self, vectors: np.ndarray, closed: Sequence[int]) -> np.ndarray:
        """Return C_l v (m, k) for vectors v (m, k), without forming C_l."""
        modal = self._modal_damping
        product = self.damping @ vectors if modal is None else modal[:, None] * vectors
        viscous = [i for i in closed if self.dampings[i]]
        if viscous:
            directions = self.directions[:, viscous]
            product += (directions * self.dampings[viscous]) @ (directions.T @ vectors)
        return np.asarray(product)

    @functools.cached_property
    def _modal_damping(self) -> np.ndarray | None:
        """Diagonal (m,) of the structure's damping matrix where it is diagonal, None where it couples modes."""
        diagonal = np.diagonal(self.damping)
        return diagonal.copy() if np.count_nonzero(self.damping) == np.count_nonzero(diagonal) else None

    def closed_at(self, closed: tuple[int, ...]) -> ClosedDirections:
        """Return ``closed_directions`` with the gaps at y = 0; those of the latest sets of contacts are cached."""
        return self._closed_cache.get_or_build(closed, lambda: self.closed_directions(closed, self.gaps[list(closed)]))

    @functools.cached_property
    def _closed_cache(self) -> BoundedCache[tuple[int, ...], ClosedDirections]:
        return BoundedCache(CLOSED_SETS)

    def closed_directions(self, closed: Sequence[int], gaps: np.ndarray) -> ClosedDirections:
        """Return the directions of closed contacts with gaps (k,), parallel ones merged, but no two rigid ones."""
        if len(closed) == 1:  # views
            (i,), first = closed, self.direction_indices[closed[0]]
            offset = self.direction_signs[i : i + 1] * gaps
            return ClosedDirections(((i,),), self.directions[:, first : first + 1], self.stiffnesses[i : i + 1], offset)
        first_links = [self.direction_indices[i] for i in closed]
        if len(set(first_links)) == len(first_links):
            index, single = list(closed), tuple((i,) for i in closed)
            return ClosedDirections(
                single, self.directions[:, first_links], self.stiffnesses[index], self.direction_signs[index] * gaps
            )
        groups: dict[int, list[int]] = {}
        gap_of = dict(zip(closed, gaps.tolist(), strict=True))
        for i in closed:
            groups.setdefault(self.direction_indices[i], []).append(i)
        merged = [part for members in groups.values() for part in self._split_rigid(members)]
        stiffness, offsets = np.zeros((2, len(merged)))
        for j, members in enumerate(merged):
            k, signed = self.stiffnesses[members], self.direction_signs[members] * [gap_of[i] for i in members]
            stiffness[j] = np.sum(k)
            rigid = np.isinf(k)
            if len(members) == 1 or np.any(rigid):
                offsets[j] = signed[np.argmax(rigid)]
                continue
            if abs(stiffness[j]) <= CANCELLED * np.sum(np.abs(k)):
                stiffness[j] = 0.0
            offsets[j] = np.sum(k * signed) / (stiffness[j] or 1.0)
        directions = self.directions[:, [self.direction_indices[members[0]] for members in merged]]
        return ClosedDirections(tuple(map(tuple, merged)), directions, stiffness, offsets)

    def _split_rigid(self, members: list[int]) -> list[list[int]]:
        """Return the groups of contacts of one direction: every rigid contact but the first is a group of its own."""
        further = [i for i in members if math.isinf(self.stiffnesses[i])][1:]
        return [[i for i in members if i not in further], *([i] for i in further)]

    def stiffness_sizes(self, closed: Sequence[int], vectors: np.ndarray) -> np.ndarray:
        """Return the sums (r,) of |stiffnesses| of the structure and of closed springs along modes (m, r).

        Of the stiffnesses themselves it is omega^2.
        """
        springs = np.where(np.isinf(self.stiffnesses[list(closed)]), 0.0, np.abs(self.stiffnesses[list(closed)]))
        return np.asarray(self.squares @ vectors**2 + springs @ (self.directions[:, list(closed)].T @ vectors) ** 2)

    def contact_forces(
        self, closed: list[int], closed_directions: ClosedDirections, along: np.ndarray, gaps: np.ndarray
    ) -> np.ndarray:
        """Return lambda (k,) [N] of closed contacts from forces (d,) along their directions and gaps (l,).

        The forces of springs of one direction follow from their gaps; a rigid contact among them has the remainder.
        """
        if closed_directions.members == tuple(zip(closed)):
            return np.asarray(self.direction_signs[closed] * along)
        forces = np.zeros(len(self.links))
        for members, force in zip(closed_directions.members, along.tolist(), strict=True):
            index, rigid = list(members), [i for i in members if math.isinf(self.stiffnesses[i])]
            if len(index) > 1:
                springs = [i for i in index if i not in rigid]
                offset = self.direction_signs[rigid[0]] * gaps[rigid[0]] if rigid else 0.0  # round-off of zero
                forces[springs] = -self.stiffnesses[springs] * (gaps[springs] - self.direction_signs[springs] * offset)
                force -= self.direction_signs[springs] @ forces[springs]
                index = rigid
            forces[index] = self.direction_signs[index] * force
        return forces[closed]


def parallel(directions: np.ndarray) -> list[int]:
    """Return for every column of (m, l) the index of the first column that is equal up to its sign."""
    lengths = np.linalg.norm(directions, axis=0)
    units = scipy.sparse.csc_array(directions / np.where(lengths > 0, lengths, 1.0))
    alike = scipy.sparse.csc_array(abs(units.T @ units) > NEARLY_PARALLEL)
    alike_columns = np.split(alike.indices, alike.indptr[1:-1])
    zeros, first = np.flatnonzero(lengths == 0), list(range(directions.shape[1]))
    for i, column in enumerate(directions.T):
        others = np.array([j for j in (alike_columns[i] if lengths[i] else zeros) if j < i and first[j] == j], int)
        distances = [np.max(np.abs(column[:, None] - sign * directions[:, others]), axis=0) for sign in (1, -1)]
        same = others[np.minimum(*distances) <= PARALLEL * np.max(np.abs(directions[:, others]), axis=0)]
        if len(same):
            first[i] = int(np.min(same))
    return first
