"""Channels of a level: its response to the time-varying loads and stops, as prescribed coordinates (eqs. 38.4 to 38.6).

    x = Psi eta + y_inf + R w,   R w = (K_l^-1 - Psi omega^-2 Psi^T) (b w + k h s w)  +  Y w

xi = (eta, w), w (q,) the channels, b and s their patterns and stops (excitation.py). The first part is the quasi-static
response of the modes left out: their inertia is neglected, their strain and the work of the load on them are not. Y
holds the motion due to rigid stops, the static shapes of eq. (38.5) with x_k(t); it has inertia:

    eta'' + D eta' + omega^2 eta = P w + Q w',   P = Psi^T (b + k h s),   on w' as a channel of its own
                                                 P = Psi^T (c h s - C Y),   Q = -Psi^T Y

In xi every gap and contact force is again linear. Without channels xi = eta, and a level in xi is the level itself.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace

import numpy as np

from multiphi_exudyn.events.excitation.excitation import Excitation
from multiphi_exudyn.levels.level.level import Level
from multiphi_exudyn.levels.level.quasi_static import quasi_static_response, static_responses
from multiphi_exudyn.levels.level.sliding import SlidingLevel
from multiphi_exudyn.mathematics.round_off import FOLLOWING, ZERO, drop_round_off

__all__ = ["Channels"]

SMALL_DIFFERENCE = 1e-3  # of the sum of |stiffnesses| along a mode: a smaller omega^2 has lost three digits or more


@dataclass(frozen=True)
class Channels:
    """Forces, shapes and contact forces of a level due to the channels of an excitation.

    force, force_rate: P, Q (r, q). carried: Y (m, q). shapes: R (m, q); terms (m, q): the sizes of the terms R is a sum
    of. contact_force, contact_force_rate: forces (k, q) of the closed contacts at w = 1 and w' = 1.
    """

    force: np.ndarray
    force_rate: np.ndarray
    carried: np.ndarray
    shapes: np.ndarray
    terms: np.ndarray
    contact_force: np.ndarray
    contact_force_rate: np.ndarray

    @classmethod
    def none(cls, level: Level) -> Channels:
        """Return the channels of a level under static loads alone: there are none."""
        return _none(level.modes, level.base.modes.count, len(level.indices))

    @classmethod
    def of(cls, level: Level, excitation: Excitation) -> Channels:
        """Return the channels of a level under an excitation, with the friction that sliding contacts add to them."""
        if not isinstance(level, SlidingLevel):
            return cls._of(level, excitation, level)
        plain = cls._of(level.plain, excitation, level)
        prescribed, sliders = np.arange(plain.force.shape[1]) < excitation.prescribed, list(level.sliders)
        contact_force = np.where(prescribed, level.answered(plain.contact_force), plain.contact_force)
        contact_rate = level.answered(plain.contact_force_rate)
        force = plain.force + prescribed * (level.pulled @ contact_force[sliders])
        rate = plain.force_rate + level.pulled @ contact_rate[sliders]
        return replace(
            plain, force=force, force_rate=rate, contact_force=contact_force, contact_force_rate=contact_rate
        )

    @classmethod
    def _of(cls, level: Level, excitation: Excitation, static_level: Level) -> Channels:
        """Return the channels of a level without friction.

        static_level: its static response is that to constant channels.
        """
        base, index = level.base, list(level.indices)
        rigid, residual = base.rigid_links[index], np.isin(index, base.residual)
        stops, directions = excitation.stops[index], base.directions[:, index]
        springs = np.where(rigid | residual, 0.0, base.stiffnesses[index])
        pushed = level.vectors.T @ (directions @ (springs[:, None] * stops))
        pushed -= level.force_rows[residual].T @ stops[residual]
        force = level.vectors.T @ excitation.patterns + pushed
        loaded, forces_loaded = quasi_static_response(level, excitation.patterns)
        sizes = np.linalg.norm(excitation.patterns, axis=0) / np.linalg.norm(directions, axis=0)[:, None]
        forces_loaded = np.where(rigid[:, None], drop_round_off(forces_loaded, sizes), forces_loaded)
        unloaded = np.zeros_like(excitation.patterns)
        moved, forces_moved = static_responses(level, unloaded, -stops)
        if static_level is not level:
            constant = slice(excitation.prescribed, None)
            part = static_responses(static_level, unloaded[:, constant], -stops[:, constant])
            moved[:, constant], forces_moved[:, constant] = part
        carried, _ = static_responses(level, unloaded, np.where(rigid[:, None], -stops, 0.0))
        centre = _centre(force, level.computed)
        loaded = drop_round_off(loaded, np.abs(level.vectors) @ np.abs(centre))  # zero if the level has all modes
        sprung, soft = _centre(pushed, level.computed), _is_small_difference(level)
        if np.any(soft):
            sprung[soft] = (
                level.vectors[:, soft].T @ static_responses(level, unloaded, np.where(rigid[:, None], 0.0, -stops))[0]
            )
        modal = centre - _centre(force, level.squares) - sprung
        constant = slice(excitation.prescribed, None)  # motion is centred on the whole static response to these,
        force[:, constant], modal[:, constant] = 0.0, 0.0
        for k in range(excitation.prescribed, excitation.channels):  # and modes without a centre are driven
            force[:, k] = static_level.driving_force(unloaded[:, k], -stops[:, k])
        shapes = loaded + moved + level.vectors @ modal
        contact_force = forces_loaded + forces_moved + level.force_rows @ modal
        rate, contact_rate = np.zeros_like(force), np.zeros_like(contact_force)
        pinned = directions[:, rigid]
        for k, derivative in enumerate(excitation.rate_of):
            if derivative >= 0:
                dampers = base.dampings[index] * (stops[:, k] - directions.T @ carried[:, k])  # forces at w' = 1
                damped = base.damping @ carried[:, k] - directions @ dampers
                force[:, derivative] -= level.inertial.T @ damped
                rate[:, derivative] -= level.inertial.T @ carried[:, k]
                contact_force[~rigid, derivative] += dampers[~rigid]
                contact_force[rigid, derivative] += np.linalg.lstsq(pinned, damped, rcond=None)[0]
                contact_rate[rigid, derivative] += np.linalg.lstsq(pinned, carried[:, k], rcond=None)[0]
        terms = np.abs(moved) + np.abs(level.vectors) @ np.abs(centre)
        return cls(force, rate, carried, shapes, terms, contact_force, contact_rate)

    def extended(self, level: Level, stops: np.ndarray) -> Level:
        """Return the level in the coordinates xi = (eta, w) (r + q); stops: s (c, q).

        Squares and damping are zero on w.
        """
        directions, sizes = level.base.directions.T, level.base.magnitudes[0].T
        gap_columns, speeds = directions @ self.shapes - stops, directions @ self.carried - stops
        held = level.following[:, None]  # rows of redundant gaps: channels move these by round-off only
        moved, slack = np.abs(stops), FOLLOWING / ZERO
        gap_columns = np.where(held, drop_round_off(gap_columns, slack * (sizes @ self.terms + moved)), gap_columns)
        speeds = np.where(held, drop_round_off(speeds, slack * (sizes @ np.abs(self.carried) + moved)), speeds)
        closed = [i for i in level.indices if level.base.rigid_links[i]]
        fixed = held & ~np.any(stops[closed], axis=0)  # by contacts whose stops the channel does not move
        gap_columns, speeds = np.where(fixed, -stops, gap_columns), np.where(fixed, -stops, speeds)
        q = self.force.shape[1]
        return Level(
            closed=level.closed,
            indices=level.indices,
            base=level.base,
            squares=np.concatenate([level.squares, np.zeros(q)]),
            vectors=np.hstack([level.vectors, self.shapes]),
            damping=np.pad(level.damping, (0, q)),
            gap_rows=np.hstack([level.gap_rows, gap_columns]),
            following=level.following,
            speed_rows=np.hstack([level.gap_rows, speeds]),
            force_rows=np.hstack([level.force_rows, self.contact_force]),
            force_rate_rows=np.hstack([level.force_rate_rows, self.contact_force_rate]),
            neutral=level.neutral,
            computed=np.concatenate([level.computed, np.zeros(q)]),
            kept_beyond=level.kept_beyond,
            bending=level.bending,
        )


@functools.lru_cache(maxsize=64)
def _none(r: int, m: int, k: int) -> Channels:
    """No channels, of a level with r modes, m coordinates and k closed contacts."""
    of_modes, of_base, of_forces = (np.zeros((rows, 0)) for rows in (r, m, k))
    return Channels(of_modes, of_modes, of_base, of_base, of_base, of_forces, of_forces)


def _centre(force: np.ndarray, squares: np.ndarray) -> np.ndarray:
    """omega^-2 P (r, q), zero on zero-frequency modes."""
    return np.divide(force, squares[:, None], out=np.zeros_like(force), where=squares[:, None] != 0)


def _is_small_difference(level: Level) -> np.ndarray:
    """Return whether the omega^2 (r,) of each mode is a small difference of stiffnesses, and not zero.

    It has few digits, and the static response, large in such a mode, is removed from the mode as it was computed.
    """
    sizes = level.base.stiffness_sizes(level.indices, level.vectors)
    return np.asarray((np.abs(level.computed) <= SMALL_DIFFERENCE * sizes) & (level.computed != 0))
