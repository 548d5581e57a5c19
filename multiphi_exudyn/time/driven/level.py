"""Levels under an excitation: what varies as prescribed coordinates, xi = (eta, w) (eqs. 38.4 to 38.6).

    x = Psi eta + y_inf + R w,   R w = (K_l^-1 - Psi omega^-2 Psi^T) (b w + k h s w)  +  Y w

w (q,) the channels, b and s their patterns and stops (driven/excitation.py). The first part is the quasi-static
deflection of the modes left out (its inertia is neglected, its strain and the work of the load on it are not). Y holds
the motion of rigid stops, the static shapes of eq. (38.5) with x_k(t); it has inertia:

    eta'' + D eta' + omega^2 eta = P w + Q w',   P = Psi^T (b + k h s),   on w' as a channel of its own
                                                 P = Psi^T (c h s - C Y),   Q = -Psi^T Y

In xi every gap and contact force is again linear, so rows, maps between levels, events and energies are those of
levels under static loads, with q more columns.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.events.transition import LoadedLevel, Transition, modal_projection
from multiphi_exudyn.levels.level import Level
from multiphi_exudyn.mathematics.least_distance import FOLLOWING
from multiphi_exudyn.mathematics.round_off import ZERO, drop_round_off
from multiphi_exudyn.time.driven.excitation import Excitation, columns

__all__ = ["DrivenLevel", "DrivenTransition", "ExtendedLevel"]


@dataclass(frozen=True)
class ExtendedLevel(Level):
    """A level in the coordinates xi = (eta, w) (r + q): its rows and vectors have q more columns.

    speeds: gap velocities (c, r + q) without the quasi-static part. squares and damping are zero on w.
    """

    speeds: np.ndarray

    @property
    def speed_rows(self) -> np.ndarray:
        """Gap velocities (c, r + q) as impacts see them."""
        return self.speeds


@dataclass(frozen=True)
class DrivenLevel(LoadedLevel):
    """A level under static and varying loads, in the coordinates xi = (eta, w).

    plain: the level under the static loads alone. force, force_rate: P, Q (r, q). carried: Y (m, q).
    excitation: of the run.
    """

    plain: LoadedLevel
    force: np.ndarray
    force_rate: np.ndarray
    carried: np.ndarray
    excitation: Excitation

    @classmethod
    def under(cls, plain: LoadedLevel, excitation: Excitation) -> DrivenLevel:
        """``plain`` with the channels of an excitation."""
        own = plain.level
        parts = _prescribed(own, excitation)
        directions, sizes = own.base.directions.T, own.base.magnitudes[0].T
        gap_columns = directions @ parts.shapes - excitation.stops
        speeds = directions @ parts.carried - excitation.stops
        held = ~np.any(own.gap_rows, axis=1)[:, None]  # what no mode moves, the channels move by round-off only
        moved, slack = np.abs(excitation.stops), FOLLOWING / ZERO
        gap_columns = np.where(held, drop_round_off(gap_columns, slack * (sizes @ parts.terms + moved)), gap_columns)
        speeds = np.where(held, drop_round_off(speeds, slack * (sizes @ np.abs(parts.carried) + moved)), speeds)
        none = np.zeros(excitation.channels)
        level = ExtendedLevel(
            closed=own.closed,
            indices=own.indices,
            base=own.base,
            squares=np.concatenate([own.squares, none]),
            vectors=np.hstack([own.vectors, parts.shapes]),
            damping=np.pad(own.damping, (0, excitation.channels)),
            gap_rows=np.hstack([own.gap_rows, gap_columns]),
            force_rows=np.hstack([own.force_rows, parts.contact_force]),
            force_rate_rows=np.hstack([own.force_rate_rows, parts.contact_force_rate]),
            neutral=own.neutral,
            computed=np.concatenate([own.computed, none]),
            kept_beyond=own.kept_beyond,
            speeds=np.hstack([own.gap_rows, speeds]),
        )
        return cls(
            level=level,
            asymptotic=plain.asymptotic,
            gap_constants=plain.gap_constants,
            plain=plain,
            force=parts.force,
            force_rate=parts.force_rate,
            carried=parts.carried,
            excitation=excitation,
        )

    def split(self, xi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """eta (r, ...) and w (q, ...) of xi."""
        r = self.plain.level.modes
        return xi[:r], xi[r:]

    def motion(self, velocity: np.ndarray) -> np.ndarray:
        """y' (m, ...) of xi', without the quasi-static part: Psi eta' + Y w'."""
        eta_t, w_t = self.split(velocity)
        return np.asarray(self.plain.level.vectors @ eta_t + self.carried @ w_t)

    def kinetic(self, velocity: np.ndarray) -> np.ndarray:
        """Kinetic energy [J] of (r + q,) or of every column."""
        if not np.any(self.carried):
            return self.plain.kinetic(self.split(velocity)[0])
        return np.asarray(0.5 * np.sum(self.motion(velocity) ** 2, axis=0))

    def strain(self, displacement: np.ndarray) -> np.ndarray:
        """Strain energy [J] as ``Base.strain`` has it, for (r + q,) or every column."""
        base, index = self.level.base, list(self.level.indices)
        y = self.configuration(displacement)
        springs = base.stiffnesses[index]
        springs = np.where(np.isinf(springs), 0.0, springs)
        gaps = (self.level.gap_rows[index] @ displacement).T + self.gap_constants[index]
        bent = 0.5 * (np.sum((base.modes.omega * y.T) ** 2, axis=-1) + gaps**2 @ springs)
        return np.asarray(bent - y.T @ base.preload + base.energy_offset)

    def potential(self, displacement: np.ndarray) -> float:
        """Strain energy less the potential f.x of the loads [J] at their present values."""
        load = self.excitation.load(self.split(displacement)[1])
        return float(self.strain(displacement) - load @ self.configuration(displacement))

    def configuration(self, displacement: np.ndarray) -> np.ndarray:
        """y (m, ...) in base coordinates."""
        moved = self.level.vectors @ displacement
        return np.asarray((moved.T + self.asymptotic.configuration).T)


@dataclass(frozen=True)
class DrivenTransition(Transition):
    """The map of eq. (38.6) between levels in the coordinates xi; w stays what it is."""

    source: DrivenLevel
    target: DrivenLevel

    @functools.cached_property
    def matrix(self) -> np.ndarray:
        """[[Psi_m^T Psi_l, Psi_m^T (R_l - R_m)], [0, 1]]."""
        return self._map(
            self.source.level.vectors[:, self._modes :], self.target.level.vectors[:, self._target_modes :]
        )

    @functools.cached_property
    def velocity_matrix(self) -> np.ndarray:
        """[[Psi_m^T Psi_l, Psi_m^T (Y_l - Y_m)], [0, 1]]."""
        return self._map(self.source.carried, self.target.carried)

    @functools.cached_property
    def offset(self) -> np.ndarray:
        """c (r_m + q,)."""
        jump = self.source.asymptotic.configuration - self.target.asymptotic.configuration
        return np.concatenate([self.target.plain.level.vectors.T @ jump, np.zeros(self.source.excitation.channels)])

    @property
    def _modes(self) -> int:
        return self.source.plain.level.modes

    @property
    def _target_modes(self) -> int:
        return self.target.plain.level.modes

    def _map(self, source: np.ndarray, target: np.ndarray) -> np.ndarray:
        own, q = self.target.plain.level, self.source.excitation.channels
        prescribed = own.vectors.T @ (source - target)
        return np.block(
            [[modal_projection(own, self.source.plain.level), prescribed], [np.zeros((q, self._modes)), np.eye(q)]]
        )


@dataclass(frozen=True)
class _Prescribed:
    """What a level makes of the channels: see DrivenLevel; shapes: R (m, q), and of which terms they are the sum."""

    shapes: np.ndarray
    terms: np.ndarray
    carried: np.ndarray
    force: np.ndarray
    force_rate: np.ndarray
    contact_force: np.ndarray
    contact_force_rate: np.ndarray


def _prescribed(level: Level, excitation: Excitation) -> _Prescribed:
    base, index = level.base, list(level.indices)
    rigid = np.isinf(base.stiffnesses[index])
    stops, directions = excitation.stops[index], base.directions[:, index]
    springs = np.where(rigid, 0.0, base.stiffnesses[index])
    pushed = directions @ (springs[:, None] * stops)
    force = level.vectors.T @ (excitation.patterns + pushed)
    loaded, forces_loaded = _beyond(level, excitation.patterns)
    unloaded = np.zeros_like(excitation.patterns)
    moved, forces_moved = _at_rest(level, unloaded, -stops)
    carried, _ = _at_rest(level, unloaded, np.where(rigid[:, None], -stops, 0.0))
    centre = _centre(force, level.computed)
    modal = centre - _centre(force, level.squares) - _centre(level.vectors.T @ pushed, level.computed)
    shapes = loaded + moved + level.vectors @ modal
    contact_force = forces_loaded + forces_moved + level.force_rows @ modal
    rate, contact_rate = np.zeros_like(force), np.zeros_like(contact_force)
    pinned = directions[:, rigid]
    for k, derivative in enumerate(excitation.rate_of):
        if derivative >= 0:
            dampers = base.dampings[index] * (stops[:, k] - directions.T @ carried[:, k])  # their forces at w' = 1
            damped = base.damping @ carried[:, k] - directions @ dampers
            force[:, derivative] -= level.vectors.T @ damped
            rate[:, derivative] -= level.vectors.T @ carried[:, k]
            contact_force[~rigid, derivative] += dampers[~rigid]
            contact_force[rigid, derivative] += np.linalg.lstsq(pinned, damped, rcond=None)[0]
            contact_rate[rigid, derivative] += np.linalg.lstsq(pinned, carried[:, k], rcond=None)[0]
    terms = np.abs(moved) + np.abs(level.vectors) @ np.abs(centre)
    return _Prescribed(shapes, terms, carried, force, rate, contact_force, contact_rate)


def _centre(force: np.ndarray, squares: np.ndarray) -> np.ndarray:
    """omega^-2 P (r, q), zero on zero-frequency modes."""
    return np.divide(force, squares[:, None], out=np.zeros_like(force), where=squares[:, None] != 0)


def _at_rest(level: Level, loads: np.ndarray, gaps: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Configurations (m, q) and contact forces (k, q) under loads (m, q), the closed contacts with gaps (k, q)."""
    found = [level.static_response(load, gap) for load, gap in zip(loads.T, gaps.T, strict=True)]
    return columns([y for _, y in found], len(loads)), columns([forces for forces, _ in found], len(gaps))


def _beyond(level: Level, patterns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Configurations (m, q) and contact forces (k, q) of loads at rest, without the part of the level's modes.

    (K_l^-1 - Psi omega^-2 Psi^T) b as K_l^-1 (1 - Psi Psi^T) b: where a kept mode is soft, both terms of the former
    are large. What is left of its part is round-off.
    """
    psi = level.vectors
    left = patterns - psi @ (psi.T @ patterns)
    y, forces = _at_rest(level, left, np.zeros((len(level.indices), left.shape[1])))
    part = psi.T @ y
    return y - psi @ part, forces - level.force_rows @ part
