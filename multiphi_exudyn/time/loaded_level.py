"""Loaded level: a level under the loads of one run, in the coordinates xi = (eta, w), with its energies.

    x = Psi eta + y_inf + R w        w (q,) the channels of varying loads and stops, q >= 0 (core/channels.hpp)

In xi the rows, maps between levels, events and energies are those of a level under static loads, with q more columns.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

import multiphi_exudyn._core as core
from multiphi_exudyn.display import Shown
from multiphi_exudyn.levels.base.modal_base import ModalBase
from multiphi_exudyn.levels.level.level import Level
from multiphi_exudyn.mechanics.element import ElementState, Exit
from multiphi_exudyn.time.excitation import Excitation

__all__ = ["Channels", "LoadedLevel", "Rest", "StrainForm"]


@dataclass(frozen=True)
class StrainForm:
    """1/2 weights . (rows xi + offsets)^2 + linear . xi + constant: no difference of large energies."""

    weights: np.ndarray
    rows: np.ndarray
    offsets: np.ndarray
    linear: np.ndarray
    constant: float

    def __call__(self, xi: np.ndarray) -> np.ndarray:
        """Return the strain energy [J] of xi (n,), or of every column of (n, k)."""
        stretched = self.rows.dot(xi).T + self.offsets
        return np.asarray(0.5 * (stretched * stretched).dot(self.weights) + self.linear.dot(xi) + self.constant)


class Rest(NamedTuple):
    """Static response of a level to gaps and static loads, x_inf of eq. (38.4).

    configuration: y_inf (m,). forces: lambda_inf of the links that act (k,) [N]. drive: modal force (r,) on the
    zero-frequency modes, zero on the others; static_drive: the same before a steady channel takes it over. load: f
    (m,). strain: energy of y_inf [J].
    """

    configuration: np.ndarray
    forces: np.ndarray
    drive: np.ndarray
    static_drive: np.ndarray
    load: np.ndarray
    strain: float


class Channels(NamedTuple):
    """P, Q (r, q): force and force_rate; Y (m, q): carried; R (m, q): shapes (core/channels.hpp)."""

    force: np.ndarray
    force_rate: np.ndarray
    carried: np.ndarray
    shapes: np.ndarray


class LevelWithChannels(Level):
    """A level in the coordinates xi = (eta, w) (r + q,); squares and damping are zero on w."""

    def __init__(self, modal: Level, channels: Channels, of_core: core.Level) -> None:
        self.base, self.indices, self.closed, self.kept_beyond = (
            modal.base,
            modal.indices,
            modal.closed,
            modal.kept_beyond,
        )
        self._modal, q = modal, channels.force.shape[1]
        self.squares = np.concatenate([modal.squares, np.zeros(q)])
        self.computed = np.concatenate([modal.computed, np.zeros(q)])
        self.vectors = np.hstack([modal.vectors, channels.shapes])
        self.damping = np.pad(modal.damping, (0, q))
        self.damping_matrix = np.pad(modal.damping_matrix, (0, q))
        self.coupling = np.pad(modal.coupling, (0, q))
        self.gap_rows = of_core.gap_rows
        self.force_rows, self.force_rate_rows = of_core.force_rows, of_core.force_velocity_rows

    def __getstate__(self) -> dict[str, Any]:
        return dict(vars(self))

    @property
    def static_shares(self) -> dict[str, float]:
        """Those of the level without channels."""
        return self._modal.static_shares


class LoadedLevel(Shown):
    """A level under static and varying loads, in the coordinates xi = (eta, w) (r + q,).

    modal: the level with its r modes, without channels. excitation: of the run. of_core: the core's level, None in a
    copy. entries: values kept with this level.
    """

    def __init__(self, modal: Level, excitation: Excitation, of_core: core.Level) -> None:
        self.modal, self.excitation, self.of_core = modal, excitation, of_core
        self.states: tuple[int, ...] = of_core.key
        self.entries = dict[Any, Any]()

    def _facts(self) -> Iterator[tuple[str, str]]:
        yield "states", str(self.states)
        yield "modes", str(self.modal.modes)
        yield "channels", str(self.excitation.channels)

    def __getstate__(self) -> dict[str, Any]:
        read = ("level", "channels", "asymptotic", "gap_constants", "speed_rows", "stored", "signals")
        arrays = {name: getattr(self, name) for name in read}
        kept = {key: value for key, value in vars(self).items() if key not in ("of_core", "entries", "response")}
        return {**kept, **arrays, "of_core": None, "entries": {}}

    @property
    def base(self) -> ModalBase:
        """The coordinates that all levels share."""
        return self.modal.base

    @property
    def width(self) -> int:
        """Number r + q of coordinates xi."""
        return self.modal.modes + self.excitation.channels

    @functools.cached_property
    def level(self) -> Level:
        """The level in xi, ``modal`` without channels."""
        if not self.excitation.channels:
            return self.modal
        return LevelWithChannels(self.modal, self.channels, self.of_core)

    @functools.cached_property
    def channels(self) -> Channels:
        """Its response to the channels of the excitation."""
        of_core = self.of_core
        force, rate = of_core.channel_force, of_core.channel_force_rate
        return Channels(force, rate, of_core.carried, of_core.channel_shapes)

    @functools.cached_property
    def asymptotic(self) -> Rest:
        """The equilibrium about which it moves while w = 0."""
        of_core = self.of_core
        return Rest(
            configuration=of_core.configuration,
            forces=of_core.forces,
            drive=of_core.drive,
            static_drive=of_core.static_drive,
            load=of_core.load,
            strain=of_core.static_strain,
        )

    @functools.cached_property
    def gap_constants(self) -> np.ndarray:
        """Gaps (l,) [m] of all links at xi = 0."""
        return self.of_core.gap_constants

    @functools.cached_property
    def speed_rows(self) -> np.ndarray:
        """Gap velocities (l, r + q) in impacts from xi', without the quasi-static part of varying loads."""
        return self.of_core.velocity_rows

    @functools.cached_property
    def stored(self) -> float:
        """Strain energy [J] of links that keep a stretch without holding."""
        return self.of_core.stored

    @functools.cached_property
    def signals(self) -> list[tuple[np.ndarray, np.ndarray, float]]:
        """Signals s of all exits as rows (n,) of xi and xi', and constants, in the order of ``exits``."""
        guards = [guard.signal for guard in self.of_core.guards]
        return [(signal.displacement, signal.velocity, signal.constant) for signal in guards]

    @property
    def exits(self) -> list[tuple[int, Exit]]:
        """All ways out of the states of its elements, with the index of the element."""
        return [(i, exit_) for i in range(len(self.states)) for exit_ in self.state_of(i).exits]

    def state_of(self, element: int) -> ElementState:
        """Return the state of an element."""
        return self.base.contacts[element].states[self.states[element]]

    def asked_state(self, element: int, exit_: Exit) -> int:
        """Return the number of the state that an exit of an element requests."""
        states = self.base.contacts[element].states
        return next(number for number, state in enumerate(states) if state.name == exit_.asked)

    def force_shares(self, element: int, exit_: Exit) -> list[tuple[int, float]]:
        """Return the shares of link forces in an exit's signal, with their indices among the links that hold."""
        links, places = self.base.link_indices[element], self.modal.indices
        return [(places.index(links[share.link]), share.force) for share in exit_.shares if share.force]

    @property
    def response(self) -> core.ModalResponse:
        """Closed form of the modes' motion."""
        return self.of_core.response if self.of_core is not None else self.modal.response

    @functools.cached_property
    def pushes(self) -> np.ndarray:
        """Constant forces (l,) [N] of its elements along the directions of their first links."""
        given = [pushed[state] for pushed, state in zip(self.base.pushes_of_states, self.states, strict=True)]
        return np.array([*given, *[0.0] * (len(self.base.links) - len(given))])

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

    def configuration(self, displacement: np.ndarray) -> np.ndarray:
        """Return y (m, ...) in base coordinates."""
        return np.asarray((self.level.vectors @ displacement).T + self.asymptotic.configuration).T

    def kinetic(self, velocity: np.ndarray) -> np.ndarray:
        """Return the kinetic energy [J] of xi' (r + q,), or of every column."""
        moving = self.motion(velocity) if np.any(self.channels.carried) else self.split(velocity)[0]
        return np.asarray(0.5 * np.add.reduce(moving * moving))

    def energy(self, displacement: np.ndarray, velocity: np.ndarray) -> float:
        """Return the kinetic and strain energy [J] of xi, xi' (r + q,)."""
        return float(self.kinetic(velocity) + self.strain(displacement))

    def strain(self, displacement: np.ndarray) -> np.ndarray:
        """Return the strain energy [J] of xi (r + q,) or of every column.

        Frequencies that were given count in it.
        """
        return self.strain_form(displacement)

    @functools.cached_property
    def strain_form(self) -> StrainForm:
        """The strain energy as a form in xi.

        Rows of 1/2 |Omega y|^2 are a triangular factor of Omega (V, y_inf), those of springs their gaps.
        """
        own, base = self.level, self.base
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
        load = self.excitation.static + self.excitation.patterns @ self.split(displacement)[1]
        return float(self.strain(displacement) - load @ self.configuration(displacement))

    def rubbing(self, element: int) -> tuple[np.ndarray, np.ndarray, float]:
        """Return the friction force T [N] due to the force of a link: rows of xi and xi', and constant; else zeros."""
        own, rubs = self.level, self.state_of(element).rubs
        if rubs is None:
            return np.zeros(own.modes), np.zeros(own.modes), 0.0
        k = own.indices.index(own.base.link_indices[element][rubs[0]])
        return rubs[1] * own.force_rows[k], rubs[1] * own.force_rate_rows[k], rubs[1] * self.asymptotic.forces[k]

    def stretch(self, element: int) -> tuple[np.ndarray, float]:
        """Return the stretch [m] of an element's friction spring while it slips: row (r + q,) of xi, and constant."""
        base, (row, _, constant) = self.base, self.rubbing(element)
        held = next(k for k in base.link_indices[element] if base.links[k].held)
        return row / base.stiffnesses[held], self.state_of(element).stretch + constant / base.stiffnesses[held]

    @functools.cached_property
    def rubbing_elements(self) -> tuple[int, ...]:
        """Elements whose friction force is proportional to the force of a link."""
        if not self.base.held:
            return ()
        return tuple(i for i in range(len(self.states)) if self.state_of(i).rubs is not None)

    @functools.cached_property
    def follows(self) -> np.ndarray:
        """Rows (s, r + q + 1) of the stretches of these elements' springs, times the root of the stiffness."""
        rows, base = list[np.ndarray](), self.base
        for i in self.rubbing_elements:
            stiffness = next(base.stiffnesses[k] for k in base.link_indices[i] if base.links[k].held)
            if np.isfinite(stiffness):
                rows.append(np.sqrt(stiffness) * np.append(*self.stretch(i)))
        return np.array(rows).reshape(-1, self.width + 1)
