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
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse

import multiphi_exudyn._core as core
from multiphi_exudyn.display import Shown, names
from multiphi_exudyn.mathematics.modes import Modes
from multiphi_exudyn.mathematics.round_off import drop_round_off
from multiphi_exudyn.mechanics.arguments import Matrix
from multiphi_exudyn.mechanics.element import Element
from multiphi_exudyn.mechanics.element_table import ElementTable

__all__ = ["ModalBase", "parallel"]

PARALLEL = 1e-14  # of the largest component: directions that differ by less differ by round-off
WITHOUT_GAPS = (  # what does not depend on the gaps of contacts
    "core_base",
    "energy_offset",
    "lengths",
    "periods",
    "preload",
    "projection",
    "squares",
    "unmoved",
)
NEARLY_PARALLEL = 1 - 1e-6  # cosine of two directions that are compared closely


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
    def core_base(self) -> core.Base:
        """The base as the core takes it, which builds levels from it."""
        return core.Base(
            squares=self.squares,
            rigid_body_modes=self.modes.rigid,
            damping=self.damping,
            directions=self.directions.T,
            force_directions=self.pushes.T,
            stiffnesses=self.stiffnesses,
            dampings=self.dampings,
            preload=self.preload,
            energy_offset=self.energy_offset,
            held=self.held,
            oblique=list(self.oblique),
            residual=self.residual,
            parallel=parallel(self.directions),
            general=self.general,
            points=self.points,
            names=["" if i in self.laws else link.name for i, link in enumerate(self.links)],
            labels=self.labels,
        )

    def with_gaps_of(self, contacts: Sequence[Element]) -> ModalBase:
        """Return this base for contacts that differ from its own in their gaps alone."""
        other = dataclasses.replace(self, contacts=tuple(contacts))
        vars(other).update({name: value for name, value in vars(self).items() if name in WITHOUT_GAPS})
        return other

    def __getstate__(self) -> dict[str, Any]:
        return {key: value for key, value in vars(self).items() if key != "core_base"}  # a copy makes its own

    def independent(self, rigid: Sequence[int]) -> bool:
        """Return whether the directions of these rigid contacts are linearly independent: they can close together."""
        return self.core_base.are_independent(list(rigid))

    def pressing(self, element: int) -> dict[int, int]:
        """Return the links of an element without a held place, and the signs of their directions to its own."""
        links = [k for k in self.link_indices[element] if not self.links[k].held]
        signs = self.core_base.orientation
        return {k: int(signs[k] * signs[element]) for k in links}

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
    def periods(self) -> np.ndarray:
        """1 / Omega (m,) [s/rad], zero of rigid-body modes."""
        omega = self.modes.omega
        return np.divide(1.0, omega, out=np.zeros_like(omega), where=omega > 0)

    def damping_matrix(self, closed: Sequence[int]) -> np.ndarray:
        """Return C_l (m, m) in these coordinates: damping of the structure and of closed viscous contacts."""
        viscous = [i for i in closed if self.dampings[i]]
        if not viscous:
            return self.damping
        directions = self.directions[:, viscous]
        return np.asarray(self.damping + (directions * self.dampings[viscous]) @ directions.T)


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
