"""Modal base: the coordinates in which every level is a small dense problem, whatever n is.

    x = Phi y,   y = Phi^T M x

Phi (n, m) are the open structure's own modes, so the mass is the identity and the stiffness diag(Omega^2). They are all
of them where that is affordable, else the lowest ones and, orthogonal to them, what Krylov vectors of contacts and
points leave (build_base.py). A set of closed contacts then adds

    closed rigid contacts      H_r^T y = -gap
    closed compliant contacts  K_l = diag(Omega^2) + H_c diag(k) H_c^T,   C_l = C + H_c diag(c) H_c^T
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.display import Shown, names
from multiphi_exudyn.levels.closed_directions import ClosedDirections
from multiphi_exudyn.mathematics.bounded_cache import BoundedCache
from multiphi_exudyn.mathematics.eigenproblems.modes import Modes
from multiphi_exudyn.mathematics.round_off import drop_round_off
from multiphi_exudyn.mechanics.arguments import Matrix
from multiphi_exudyn.mechanics.element import Element
from multiphi_exudyn.mechanics.element_table import ElementTable

__all__ = ["ModalBase", "parallel"]

PARALLEL = 1e-14  # of the largest component: directions that differ by less differ by round-off
INTERLACING = 1e-8  # relative violation of the interlacing theorem that is still round-off
EPSILON = float(np.finfo(float).eps)
CLOSED_SETS = 8  # of contacts, whose directions are kept: a level asks for them when it is built and when it is loaded
CANCELLED = 1e-13  # of sum |k|: a total stiffness of a force law below it is round-off of zero


@dataclass(frozen=True, repr=False)
class ModalBase(ElementTable, Shown):
    """The structure and its contacts in coordinates y of its own modes, x = Phi y.

    modes: of the open structure, (n, m). points: (k, m), rows of its points. damping: C (m, m). directions: H (m, l) of
    the l links; pushes: F (m, l), along which their forces act. contacts: elements (c,) as given, whose first links
    come first (element.py). complete: whether m = n. mass: M (n, n), the structure's own.
    exact: how many of its modes, the lowest, are the structure's own. served: modes that levels may have at most.
    further: rows (k, n) that it holds beside those of contacts and points. error: of omega^2 of sample levels.
    """

    modes: Modes
    points: np.ndarray
    damping: np.ndarray
    directions: np.ndarray
    pushes: np.ndarray
    contacts: tuple[Element, ...]
    complete: bool
    mass: Matrix
    exact: int
    served: int
    further: np.ndarray
    error: float

    def _facts(self) -> Iterator[tuple[str, str]]:
        yield "coordinates", f"{self.modes.count} of {len(self.modes.shapes)}"
        yield "contacts", names([contact.name for contact in self.contacts])

    def coordinates(self, x: np.ndarray) -> np.ndarray:
        """y = Phi^T M x (m,) or (m, k) of configurations (n,) or (n, k), zero where it is round-off.

        Of a mode that alone moves a contact it would give one at rest a speed.
        """
        if self.complete:
            onto, sizes = self.projection
            return drop_round_off(onto @ x, sizes @ np.abs(x))
        shapes = self.modes.shapes.T
        return drop_round_off(shapes @ (self.mass @ x), np.abs(shapes) @ (abs(self.mass) @ np.abs(x)))

    @functools.cached_property
    def projection(self) -> tuple[np.ndarray, np.ndarray]:
        """Phi^T M and |Phi|^T |M| (m, n), of a complete base: no larger than its modes."""
        shapes = self.modes.shapes
        onto, sizes = (self.mass @ shapes).T, (abs(self.mass) @ np.abs(shapes)).T
        return np.ascontiguousarray(onto), np.ascontiguousarray(sizes)

    def modal_load(self, load: np.ndarray) -> np.ndarray:
        """Phi^T f (m,) of a load (n,), zero where it is round-off: a weight bends no body that falls freely."""
        shapes = self.modes.shapes.T
        return drop_round_off(shapes @ load, np.abs(shapes) @ np.abs(load))

    @functools.cached_property
    def magnitudes(self) -> tuple[np.ndarray, np.ndarray]:
        """|H| (m, l) and |gaps| (l,): with them a gap's round-off is judged."""
        return np.abs(self.directions), np.abs(self.gaps)

    @functools.cached_property
    def lengths(self) -> np.ndarray:
        """|h| (l,) in these coordinates: with them the round-off of a mode's gap is judged."""
        return np.linalg.norm(self.directions, axis=0)

    @functools.cached_property
    def units(self) -> np.ndarray:
        """Directions (m, l) as unit vectors, zero where no mode of the base moves a contact."""
        return self.directions / np.where(self.lengths > 0, self.lengths, 1.0)

    @functools.cached_property
    def seen(self) -> tuple[np.ndarray, np.ndarray]:
        """Rows (k, m) of links and points, and what a mode of unit length can move them by, then the coordinates."""
        rows = np.vstack([self.directions.T, self.points])
        return rows, np.concatenate([np.linalg.norm(rows, axis=1), np.ones(self.modes.count)])

    @functools.cached_property
    def direction_indices(self) -> list[int]:
        """For every link itself, or the first one that has its direction up to its sign."""
        return parallel(self.directions)

    @functools.cached_property
    def direction_signs(self) -> np.ndarray:
        """Sign (c,) of every contact's direction to the one that stands for it."""
        along = np.sum(self.directions * self.directions[:, self.direction_indices], axis=0)
        return np.where(along < 0, -1, 1)

    def pressing(self, element: int) -> dict[int, int]:
        """The links of an element that have no held place, and the sign of their directions to its own."""
        places = [k for k in self.link_indices[element] if not self.links[k].held]
        return {k: int(self.direction_signs[k] * self.direction_signs[element]) for k in places}

    @functools.cached_property
    def preload(self) -> np.ndarray:
        """Load (m,) of the constant forces of all force laws."""
        total = np.zeros(self.modes.count)
        for i, law in self.laws.items():
            total -= law.constant * self.directions[:, i]
        return total

    @functools.cached_property
    def energy_offset(self) -> float:
        """Strain energy [J] of the constant forces of all force laws at q = 0: a law has none at its centre."""
        return -sum(law.constant * law.centre for law in self.laws.values())

    def gaps_at(self, configuration: np.ndarray, initial: np.ndarray) -> np.ndarray:
        """Gaps (l,) [m] at y (m,), from those at y = 0."""
        return np.asarray(self.directions.T @ configuration + initial)

    def strain(self, configuration: np.ndarray, closed: Sequence[int], gaps: np.ndarray) -> float:
        """Strain energy [J] of y (m,), of the compliant ones among these closed contacts, and of constant forces.

        gaps: (l,) there.
        """
        constant = float(self.squares.dot(configuration * configuration)) / 2 + self.energy_offset
        if self.laws:
            constant -= float(self.preload @ configuration)
        if not len(closed):
            return constant
        index = list(closed)
        closing = gaps[index]
        return constant + 0.5 * float(self.springs[index] @ (closing * closing))

    @functools.cached_property
    def squares(self) -> np.ndarray:
        """Omega^2 (m,) [rad2/s2]."""
        return self.modes.omega**2

    @functools.cached_property
    def square_bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Omega^2 (m,) less and more what of the interlacing theorem round-off may violate."""
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
        """C_l (m, m) in these coordinates: the structure's damping and that of closed viscous contacts."""
        viscous = [i for i in closed if self.dampings[i]]
        if not viscous:
            return self.damping
        directions = self.directions[:, viscous]
        return np.asarray(self.damping + (directions * self.dampings[viscous]) @ directions.T)

    def largest_damping(self, closed: Sequence[int]) -> float:
        """The largest number in C_l: as C_l is positive semidefinite, it stands on the diagonal."""
        own = np.diagonal(self.damping) + self.directions[:, closed] ** 2 @ self.dampings[closed]
        return float(own.max(initial=0.0))

    def damped(self, vectors: np.ndarray, closed: Sequence[int]) -> np.ndarray:
        """C_l v (m, k) of vectors (m, k), without the matrix."""
        own = self._own_damping
        found = self.damping @ vectors if own is None else own[:, None] * vectors
        viscous = [i for i in closed if self.dampings[i]]
        if viscous:
            directions = self.directions[:, viscous]
            found += (directions * self.dampings[viscous]) @ (directions.T @ vectors)
        return np.asarray(found)

    @functools.cached_property
    def _own_damping(self) -> np.ndarray | None:
        """The structure's damping (m,) of every mode where it is modal, None where it couples them."""
        own = np.diagonal(self.damping)
        return own.copy() if np.count_nonzero(self.damping) == np.count_nonzero(own) else None

    def closed_at(self, closed: tuple[int, ...]) -> ClosedDirections:
        """``closed_directions`` with the gaps that contacts have at y = 0; of the sets asked for last they are kept."""
        return self._kept_closed.get_or_build(closed, lambda: self.closed_directions(closed, self.gaps[list(closed)]))

    @functools.cached_property
    def _kept_closed(self) -> BoundedCache[tuple[int, ...], ClosedDirections]:
        return BoundedCache(CLOSED_SETS)

    def closed_directions(self, closed: Sequence[int], gaps: np.ndarray) -> ClosedDirections:
        """Closed contacts with their gaps (k,), those of one direction taken together, but two rigid ones never."""
        along = [self.direction_indices[i] for i in closed]
        if len(set(along)) == len(along):
            index, alone = list(closed), tuple((i,) for i in closed)
            return ClosedDirections(
                alone, self.directions[:, along], self.stiffnesses[index], self.direction_signs[index] * gaps
            )
        groups: dict[int, list[int]] = {}
        given = dict(zip(closed, gaps.tolist(), strict=True))
        for i in closed:
            groups.setdefault(self.direction_indices[i], []).append(i)
        together = [part for members in groups.values() for part in self._held_once(members)]
        stiffness, offsets = np.zeros((2, len(together)))
        for j, members in enumerate(together):
            k, signed = self.stiffnesses[members], self.direction_signs[members] * [given[i] for i in members]
            stiffness[j] = np.sum(k)
            rigid = np.isinf(k)
            if len(members) == 1 or np.any(rigid):
                offsets[j] = signed[np.argmax(rigid)]
                continue
            if abs(stiffness[j]) <= CANCELLED * np.sum(np.abs(k)):
                stiffness[j] = 0.0
            offsets[j] = np.sum(k * signed) / (stiffness[j] or 1.0)
        directions = self.directions[:, [self.direction_indices[members[0]] for members in together]]
        return ClosedDirections(tuple(map(tuple, together)), directions, stiffness, offsets)

    def _held_once(self, members: list[int]) -> list[list[int]]:
        """Contacts of one direction, every rigid one but the first on its own."""
        further = [i for i in members if math.isinf(self.stiffnesses[i])][1:]
        return [[i for i in members if i not in further], *([i] for i in further)]

    def contact_forces(self, closed_directions: ClosedDirections, along: np.ndarray, gaps: np.ndarray) -> np.ndarray:
        """lambda (l,) [N] from the forces (d,) along closed directions and the gaps (l,) there; zero where open.

        Springs of one direction have what their gaps say, and a rigid contact among them the rest.
        """
        forces = np.zeros(len(self.links))
        if all(len(members) == 1 for members in closed_directions.members):
            index = [i for (i,) in closed_directions.members]
            forces[index] = self.direction_signs[index] * along
            return forces
        for members, force in zip(closed_directions.members, along.tolist(), strict=True):
            index, held = list(members), [i for i in members if math.isinf(self.stiffnesses[i])]
            if len(index) > 1:
                springs = [i for i in index if i not in held]
                moved = self.direction_signs[held[0]] * gaps[held[0]] if held else 0.0  # round-off of zero
                forces[springs] = -self.stiffnesses[springs] * (gaps[springs] - self.direction_signs[springs] * moved)
                force -= self.direction_signs[springs] @ forces[springs]
                index = held
            forces[index] = self.direction_signs[index] * force
        return forces


def parallel(directions: np.ndarray) -> list[int]:
    """For every column of (m, l) itself, or the first one that is the same up to its sign."""
    first, alone = list[int](), list[int]()
    for i, one in enumerate(directions.T):
        others = directions[:, alone]
        apart = [np.max(np.abs(one[:, None] - sign * others), axis=0) for sign in (1, -1)]
        same = np.flatnonzero(np.minimum(*apart) <= PARALLEL * np.max(np.abs(others), axis=0))
        first.append(alone[same[0]] if len(same) else i)
        alone += [] if len(same) else [i]
    return first
