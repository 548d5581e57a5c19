"""Loaded level: a level under the loads of one run, in the coordinates xi = (eta, w), with its energies.

    x = Psi eta + y_inf + R w        w (q,) the channels, q >= 0 (channels.py)

In xi the rows, maps between levels, events and energies are those of a level under static loads, with q more columns.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from multiphi_exudyn._core import ModalResponse
from multiphi_exudyn.display import Shown
from multiphi_exudyn.events.excitation.channels import Channels
from multiphi_exudyn.events.excitation.excitation import Excitation
from multiphi_exudyn.levels.base.modal_base import ModalBase
from multiphi_exudyn.levels.level.level import Asymptotic, Level

__all__ = ["LoadedLevel", "PotentialForm", "StrainForm"]


@dataclass(frozen=True)
class StrainForm:
    """1/2 weights . (rows xi + offsets)^2 + linear . xi + constant: no difference of large energies.

    Rows of 1/2 |Omega y|^2 are a triangular factor of Omega (V, y_inf), those of springs their gaps.
    """

    weights: np.ndarray
    rows: np.ndarray
    offsets: np.ndarray
    linear: np.ndarray
    constant: float

    def __call__(self, xi: np.ndarray) -> np.ndarray:
        """Return the strain energy [J] of xi (n,), or of every column of (n, k)."""
        stretched = self.rows.dot(xi).T + self.offsets
        return np.asarray(0.5 * (stretched * stretched).dot(self.weights) + self.linear.dot(xi) + self.constant)


@dataclass(frozen=True)
class PotentialForm:
    """constant + linear . xi + 1/2 squares . eta^2 + w . rows[:, :r] eta + 1/2 w . rows[:, r:] w; rows (q, r + q).

    To this adds 1/2 |follows (xi, 1)|^2, follows (s, r + q + 1): the energy of tangential springs whose stretch is
    proportional to the force of a link, as in slip.
    """

    constant: float
    linear: np.ndarray
    squares: np.ndarray
    rows: np.ndarray
    follows: np.ndarray

    def __call__(self, xi: np.ndarray) -> float:
        r = len(self.squares)
        eta, w = xi[:r], xi[r:]
        energy = self.linear @ xi + 0.5 * self.squares @ (eta * eta)
        if len(w):
            energy += w @ (self.rows[:, :r] @ eta + 0.5 * self.rows[:, r:] @ w)
        if len(self.follows):
            stretched = self.follows[:, :-1] @ xi + self.follows[:, -1]
            energy += 0.5 * stretched @ stretched
        return self.constant + float(energy)


@dataclass(frozen=True, repr=False)
class LoadedLevel(Shown):
    """A level under static and varying loads, in the coordinates xi = (eta, w) (r + q,).

    level: in xi, unchanged without channels. asymptotic: the equilibrium about which it moves while w = 0.
    gap_constants: gaps (c,) of all contacts at xi = 0. excitation: of the run. channels: the level's response to it.
    static: the level under its static loads alone, None if that is this one. own_states: numbers of its elements'
    states, None if they follow from the closed contacts. stored: strain energy [J] of links that keep a stretch without
    holding. entries: values kept with this level and with the maps into it (exits.py, defects.py), shared by levels
    that differ by their histories alone. lasting: the longest duration [s] of a motion in it.
    """

    level: Level
    asymptotic: Asymptotic
    gap_constants: np.ndarray
    excitation: Excitation
    channels: Channels
    static: LoadedLevel | None = None
    own_states: tuple[int, ...] | None = None
    stored: float = 0.0
    lasting: float = math.inf
    entries: dict[Any, Any] = field(default_factory=dict, repr=False, compare=False)

    def _facts(self) -> Iterator[tuple[str, str]]:
        yield "states", str(self.states)
        yield "modes", str(self.modal.modes)
        yield "channels", str(self.level.modes - self.modal.modes)

    @classmethod
    def of(
        cls,
        level: Level,
        load: np.ndarray,
        states: tuple[int, ...] | None = None,
        excitation: Excitation | None = None,
        lasting: float = math.inf,
    ) -> LoadedLevel:
        """Return ``level`` under a static load (m,) in base coordinates, its elements in these states.

        excitation: of this load alone, None to make one. lasting: the longest duration [s] of a motion.
        """
        equilibrium = level.asymptotic(load)
        gaps, constant = equilibrium.gaps, excitation or Excitation.constant(load, len(equilibrium.gaps))
        return cls(level, equilibrium, gaps, constant, Channels.none(level), own_states=states, lasting=lasting)

    def under(self, excitation: Excitation) -> LoadedLevel:
        """Return this level with the channels of an excitation; the last result is kept for other histories."""
        kept: LoadedLevel | None = self.entries.get("under")
        if kept is None or kept.excitation.shape != excitation.shape:
            kept = self.entries["under"] = self._under(excitation)
        return replace(kept, excitation=excitation)

    def _under(self, excitation: Excitation) -> LoadedLevel:
        channels, equilibrium = Channels.of(self.level, excitation), self.asymptotic
        if excitation.steady >= 0:
            force = channels.force.copy()
            force[:, excitation.steady] += equilibrium.drive
            channels = replace(channels, force=force)
            equilibrium = replace(equilibrium, drive=np.zeros_like(equilibrium.drive))
        return LoadedLevel(
            level=channels.extended(self.level, excitation.stops),
            asymptotic=equilibrium,
            gap_constants=self.gap_constants,
            excitation=excitation,
            channels=channels,
            static=self,
            own_states=self.states,
            stored=_stored(self.level.base, self.states),
        )

    def __getstate__(self) -> dict[str, Any]:
        return {key: value for key, value in vars(self).items() if key != "response"}  # of the core: a copy asks again

    @property
    def width(self) -> int:
        """Number r + q of coordinates xi."""
        return self.level.modes

    @property
    def alone(self) -> LoadedLevel:
        """The level under its static loads alone."""
        return self.static or self

    @property
    def modal(self) -> Level:
        """The level with its r modes, without channels."""
        return self.alone.level

    @functools.cached_property
    def response(self) -> ModalResponse:
        """Closed form of the modes' motion."""
        return self.alone.response if self.static else self.level.response_within(self.lasting)

    @functools.cached_property
    def states(self) -> tuple[int, ...]:
        """The number of every element's state: the level's key."""
        if self.own_states is not None:
            return self.own_states
        closed = set(self.level.indices)
        return tuple(int(i in closed) for i in range(len(self.gap_constants)))

    @functools.cached_property
    def pushes(self) -> np.ndarray:
        """Constant forces (l,) [N] of its elements along the directions of their first links."""
        base = self.level.base
        given = [pushed[state] for pushed, state in zip(base.pushes_of_states, self.states, strict=True)]
        return np.array([*given, *[0.0] * (len(base.links) - len(given))])

    @functools.cached_property
    def driven(self) -> bool:
        """Whether a static load that is not a channel acts on zero-frequency modes."""
        return bool(self.asymptotic.drive.any())

    def split(self, xi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return eta (r, ...) and w (q, ...) of xi."""
        r = self.modal.modes
        return xi[:r], xi[r:]

    def motion(self, velocity: np.ndarray) -> np.ndarray:
        """Return y' (m, ...) of xi', without the quasi-static part: Psi eta' + Y w'."""
        eta_t, w_t = self.split(velocity)
        return np.asarray(self.modal.inertial @ eta_t + self.channels.carried @ w_t)

    def kinetic(self, velocity: np.ndarray) -> np.ndarray:
        """Return the kinetic energy [J] of xi' (r + q,), or of every column."""
        moving = self.motion(velocity) if self._carries else self.split(velocity)[0]
        return np.asarray(0.5 * np.add.reduce(moving * moving))

    @functools.cached_property
    def _carries(self) -> bool:
        """Whether channels move rigid stops, and the structure with them."""
        return bool(np.any(self.channels.carried))

    def energy(self, displacement: np.ndarray, velocity: np.ndarray) -> float:
        """Return the kinetic and strain energy [J] of xi, xi' (r + q,)."""
        return float(self.kinetic(velocity) + self.strain(displacement))

    def strain(self, displacement: np.ndarray) -> np.ndarray:
        """Return the strain energy [J] of xi (r + q,) or of every column.

        Frequencies that were given count in it.
        """
        return self.strain_form(displacement)

    @property
    def strain_form(self) -> StrainForm:
        """The strain energy as a form in xi."""
        if "strain" not in self.entries:
            self.entries["strain"] = self._strain_form()
        form: StrainForm = self.entries["strain"]
        return form

    def _strain_form(self) -> StrainForm:
        own, base = self.level, self.level.base
        index = [i for i in own.indices if np.isfinite(base.stiffnesses[i])]
        motion = np.column_stack([own.vectors, self.asymptotic.configuration])
        bent = np.linalg.qr(base.modes.omega[:, None] * motion, mode="r")
        gaps = np.column_stack([own.gap_rows[index], self.gap_constants[index]])
        given = np.flatnonzero(own.squares != own.computed)
        stretched = self.follows
        rows = np.vstack([bent, gaps, np.eye(len(own.squares), motion.shape[1])[given], stretched])
        softer = (own.squares - own.computed)[given]
        weights = [np.ones(len(bent)), base.stiffnesses[index], softer, np.ones(len(stretched))]
        linear = -(base.preload @ motion)
        constant = base.energy_offset + self.stored + float(linear[-1])
        return StrainForm(np.concatenate(weights), rows[:, :-1], rows[:, -1], linear[:-1], constant)

    def potential(self, displacement: np.ndarray) -> float:
        """Return the strain energy less the potential f.x of the loads [J] at their present values."""
        return self.potential_form(displacement)

    @functools.cached_property
    def potential_form(self) -> PotentialForm:
        """The potential energy as a form in xi."""
        own, base, equilibrium, patterns = self.level, self.level.base, self.asymptotic, self.excitation.patterns
        y, r, q, static = equilibrium.configuration, self.modal.modes, patterns.shape[1], self.excitation.static
        modal = -self.alone.asymptotic.drive
        if base.general:
            modal += self.modal.vectors.T @ (equilibrium.load - static)  # constant forces of elements
        constant = equilibrium.strain + self.stored - float(static @ y)
        if not q:
            return PotentialForm(constant, modal, self.modal.squares, np.zeros((0, r)), self.follows)
        index = [i for i in own.indices if np.isfinite(base.stiffnesses[i])]
        springs, rows = base.stiffnesses[index], own.gap_rows[index]
        shapes, columns, pulled = own.vectors[:, r:], rows[:, r:], patterns.T @ own.vectors
        form = (base.squares[:, None] * shapes).T @ own.vectors + (columns.T * springs) @ rows - pulled
        form[:, r:] -= pulled[:, r:].T
        load = base.squares * y - base.preload - static
        along = shapes.T @ load + columns.T @ (springs * self.gap_constants[index]) - patterns.T @ y
        return PotentialForm(constant, np.concatenate([modal, along]), self.modal.squares, form, self.follows)

    def rubbing(self, element: int) -> tuple[np.ndarray, np.ndarray, float]:
        """Return the friction force T [N] due to the force of a link: rows of xi and xi', and constant; else zeros."""
        own, rubs = self.level, self.level.base.contacts[element].states[self.states[element]].rubs
        if rubs is None:
            return np.zeros(own.modes), np.zeros(own.modes), 0.0
        k = own.indices.index(own.base.link_indices[element][rubs[0]])
        return rubs[1] * own.force_rows[k], rubs[1] * own.force_rate_rows[k], rubs[1] * self.asymptotic.forces[k]

    def stretch(self, element: int) -> tuple[np.ndarray, float]:
        """Return the stretch [m] of an element's friction spring while it slips: row (r + q,) of xi, and constant."""
        base, (row, _, constant) = self.level.base, self.rubbing(element)
        held = next(k for k in base.link_indices[element] if base.links[k].held)
        stretch = base.contacts[element].states[self.states[element]].stretch
        return row / base.stiffnesses[held], stretch + constant / base.stiffnesses[held]

    @functools.cached_property
    def rubbing_elements(self) -> tuple[int, ...]:
        """Elements whose friction force is proportional to the force of a link."""
        if not self.level.base.held:
            return ()
        elements = enumerate(zip(self.level.base.contacts, self.states, strict=True))
        return tuple(i for i, (element, state) in elements if element.states[state].rubs is not None)

    @functools.cached_property
    def follows(self) -> np.ndarray:
        """Rows (s, r + q + 1) of the stretches of these elements' springs, times the root of the stiffness."""
        rows, base = list[np.ndarray](), self.level.base
        if not self.rubbing_elements:
            return np.zeros((0, self.level.modes + 1))
        for i in self.rubbing_elements:
            stiffness = next(base.stiffnesses[k] for k in base.link_indices[i] if base.links[k].held)
            if np.isfinite(stiffness):
                rows.append(np.sqrt(stiffness) * np.append(*self.stretch(i)))
        return np.array(rows).reshape(-1, self.level.modes + 1)

    def configuration(self, displacement: np.ndarray) -> np.ndarray:
        """Return y (m, ...) in base coordinates."""
        return np.asarray((self.level.vectors @ displacement).T + self.asymptotic.configuration).T


def _stored(base: ModalBase, states: Sequence[int]) -> float:
    """Return the strain energy [J] of links that keep a stretch in these states without holding."""
    stretches = ((element, element.states[state].stretch) for element, state in zip(base.contacts, states, strict=True))
    return sum(0.5 * element.stiffness * stretch**2 for element, stretch in stretches if stretch)
