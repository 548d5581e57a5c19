"""Certified test that no event occurs within a time step, from the states at its two ends.

For the signal s of an exit (core/law) the cubic Hermite interpolant of s, s' at both ends has an error of at
most h^4/384 max|s''''|, and it is not less than the smallest of its Bernstein coefficients: s > 0 on the whole step if

    min(s0, s0 + h s0'/3, s1 - h s1'/3, s1) > h^4/384 |[P R] A^3 S^-1| max |S z'| exp(sigma h)

s = P eta + R eta' + c, z = (eta, eta'), z' = A z + constant, S = diag(|omega|, I). |S z'| is an energy norm of the
velocities. Under a constant force its growth rate is at most sigma, mostly zero: it is positive for a growing mode
(omega^2 < 0) and where friction that is proportional to pressure supplies energy (levels). So the
values at the two ends bound it in between, for any constant force. A step that fails the test is computed again exactly
(coupled.py): the test may fail without an event, but it never passes with one. Forces f on points add L f to s
(coupled.py), with the mean f of the step: the value at each end, with half its change as an error bound.

Under loads that vary, s depends on xi = (eta, w), and linear interpolation has an error of at most h^2/8 max|s''|:

    min(s0, s1) > h^2/8 (|[P R] A S^-1| max|S z'| + |R| |p'| + |P_w| |w''| + |R_w| |w'''|),
    max |S z'| <= (max at the ends + h |p'|) exp(sigma h)

p = P w + Q w' is the modal force. The bounds of the channels hold for the whole run; a kink of a sampled time function
counts as the second derivative 2 |jump of w'| / h. A step in which a time function itself jumps always fails the test.

Both conditions are a matrix times x = (q, q', q'', 1, f, stick positions, w, w') at the ends. The core tests them
(core/step_test.hpp) and reads Exudyn's own state without a copy.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

import multiphi_exudyn._core as core
from multiphi_exudyn.exudyn_plugin.discretised_level import DiscretisedLevel
from multiphi_exudyn.exudyn_plugin.own_loads import OwnLoads
from multiphi_exudyn.mathematics.piecewise_exponential import PiecewiseExponential
from multiphi_exudyn.time.excitation import Excitation
from multiphi_exudyn.time.loaded_level import LoadedLevel
from multiphi_exudyn.time.state import Row

__all__ = ["conditions", "step_test"]

NEGLIGIBLE = float(np.finfo(float).eps)  # of a signal: smaller values count as zero


@dataclass(frozen=True)
class Conditions:
    """Rows of x that have to exceed |norm (q, q', q'')| in one level, see the module's docstring.

    behind, both, ahead: (.., n), for the step before a state, for both steps, and for the step after it. norm: S z'
    (2 s, 3 s). points, held, channels: numbers of entries of x for f, for stick positions, and for w with w'.
    has_point_forces: whether L f is not zero.
    """

    behind: np.ndarray
    both: np.ndarray
    ahead: np.ndarray
    norm: np.ndarray
    points: int
    held: int
    channels: int
    has_point_forces: bool


def step_test(
    conditions: Conditions, step: float, rounding: float, views: Sequence[np.ndarray], point_forces: Sequence[int]
) -> core.StepTest:
    """Return the test for steps of length ``step`` [s] in one level; its ``is_step_clear(t)`` ends each of them.

    views: q, q', q'' (s,) in the system's current state, and all its multipliers. point_forces: indices of f among the
    multipliers.
    """
    parts = conditions.behind, conditions.both, conditions.ahead
    behind, both, _ = (len(part) for part in parts)
    rows = core.StepConditions(
        rows=np.vstack(parts),
        end_count=behind + both,
        first_at_start=behind,
        norm=conditions.norm,
        points=conditions.points,
        held=conditions.held,
        channels=conditions.channels,
        has_point_forces=conditions.has_point_forces,
    )
    q, q_t, q_tt, multipliers = views
    return core.StepTest(rows, step, rounding, q, q_t, q_tt, multipliers, point_forces)


def conditions_of(
    discretised: DiscretisedLevel, level: LoadedLevel, rows: list[Row], step: float, direct_reactions: np.ndarray
) -> Conditions:
    """Conditions for the signals ``rows`` (c,) of xi in one level, and steps of length ``step`` [s].

    direct_reactions: L (c, m) of these signals, without columns under loads that vary. A motion without fourth
    derivative has the bound of round-off instead: of the displacement of a step, or of the gap if no mode changes it.
    """
    s, q = discretised.size, level.excitation.prescribed
    (position, held), (rate, _) = (
        np.split(part, [s + q], axis=1) for part in _signal_matrices(discretised, rows, level.excitation.channels)
    )
    modal_position, modal_rate, none = position[:, :s], rate[:, :s], np.zeros((len(rows), s))
    order, factor = (1, step**2 / 8) if q else (3, core.CUBIC_REMAINDER * step**4)
    derivative_bounds, growth = (
        _derivative_bounds(discretised, modal_position, modal_rate, order),
        _growth(discretised, step),
    )
    constants = np.array([row.constant for row in rows]).reshape(-1)
    scales = np.maximum(factor * derivative_bounds, _round_off_bound(position, rate, constants, step)) * growth
    first, second, third = _bounds(level.excitation, step)
    force_rate = _force_rate_bound(level, first, second)
    channel_terms = (np.linalg.norm(modal_rate, axis=1) + step * derivative_bounds * growth) * force_rate
    channel_terms += np.abs(position[:, s:]) @ second + np.abs(rate[:, s:]) @ third
    constant = (constants - factor * channel_terms)[:, None]
    further = np.hstack([constant, direct_reactions, held, position[:, s:], rate[:, s:]])
    value = np.hstack([modal_position, modal_rate, none])
    slope = np.hstack([none, modal_position, modal_rate]) * (step / 3)
    behind, both, ahead = (
        np.hstack([signals @ discretised.to_physical, further]) / scales[:, None]
        for signals in (value - slope, value, value + slope)
    )
    count = len(rows) if not q else 0
    entries = direct_reactions.shape[1], held.shape[1], 2 * q
    return Conditions(
        behind[:count], both, ahead[:count], _energy_norm(discretised), *entries, bool(np.any(direct_reactions))
    )


def _force_rate_bound(level: LoadedLevel, first: np.ndarray, second: np.ndarray) -> float:
    """Bound of |p'| from the bounds of |w'| and |w''| (q,)."""
    q = len(first)
    force, force_rate = np.abs(level.channels.force[:, :q]), np.abs(level.channels.force_rate[:, :q])
    return float(np.linalg.norm(force @ first + force_rate @ second))


def _round_off_bound(position: np.ndarray, rate: np.ndarray, constants: np.ndarray, step: float) -> np.ndarray:
    """Bound (c,) of a signal's round-off, for |S z'| = 1."""
    displacement = step**2 * np.linalg.norm(position, axis=1) + step * np.linalg.norm(rate, axis=1)
    return NEGLIGIBLE * np.where(displacement > 0, displacement, np.where(constants != 0, np.abs(constants), 1.0))


def _signal_matrices(discretised: DiscretisedLevel, rows: list[Row], channels: int) -> tuple[np.ndarray, np.ndarray]:
    """Matrices P and R (c, s + q) of the signals, padded to the body's size."""
    modes, size, count = discretised.modes, discretised.size, len(rows)
    padded = np.zeros((2, count, size + channels))
    for part, values in zip(padded, ([row.position for row in rows], [row.rate for row in rows]), strict=True):
        coefficients = np.reshape(values, (count, modes + channels))
        part[:, :modes], part[:, size:] = coefficients[:, :modes], coefficients[:, modes:]
    return padded[0], padded[1]


def _omega(discretised: DiscretisedLevel) -> np.ndarray:
    return np.asarray(np.sqrt(np.abs(discretised.squares)))


def _scaled_stiffness(discretised: DiscretisedLevel) -> np.ndarray:
    """K diag(1/|omega|) (s, s), zero for modes of zero frequency, on which K does not act."""
    omega, coupling = _omega(discretised), discretised.stiffness - np.diag(discretised.squares)
    scaled = np.divide(coupling, omega, out=np.zeros_like(coupling), where=omega > 0)
    return np.asarray(scaled + np.diag(np.sign(discretised.squares) * omega))


def _growth(discretised: DiscretisedLevel, duration: float) -> float:
    """Bound exp(sigma t) of the growth of |S z'| in a time t; sigma: largest eigenvalue of S A S^-1's symmetric part.

    G. G. Dahlquist, Stability and error bounds in the numerical integration of ordinary differential equations, 1958.
    """
    upper, s = np.diag(_omega(discretised)) - _scaled_stiffness(discretised).T, discretised.size
    symmetric_part = (
        np.block([[np.zeros((s, s)), upper], [upper.T, -discretised.modal_damping - discretised.modal_damping.T]]) / 2
    )
    return math.exp(max(float(np.linalg.eigvalsh(symmetric_part)[-1]), 0.0) * duration)


def _energy_norm(discretised: DiscretisedLevel) -> np.ndarray:
    """Matrix (2 s, 3 s) from (q, q', q'') to S z'."""
    scale = np.concatenate([_omega(discretised), np.ones(discretised.size)])
    return np.asarray(scale[:, None] * discretised.to_physical[discretised.size :])


def _derivative_bounds(discretised: DiscretisedLevel, position: np.ndarray, rate: np.ndarray, power: int) -> np.ndarray:
    """|[P R] A^power S^-1| (c,) of the rows [P R] (c, 2 s), also where omega = 0; [P R] A = [-R K, P - R D]."""
    damping, stiffness = discretised.modal_damping, discretised.stiffness
    for _ in range(power - 1):
        position, rate = -rate @ stiffness, position - rate @ damping
    return np.asarray(
        np.linalg.norm(np.hstack([-rate @ _scaled_stiffness(discretised), position - rate @ damping]), axis=1)
    )


def _bounds(excitation: Excitation, step: float) -> np.ndarray:
    """Bounds (3, q) of |w'|, |w''|, |w'''| of the channels, with kinks spread over a step of this length [s]."""
    return np.array([_smooth_bounds(history, step) for history in excitation.histories]).reshape(-1, 3).T


def _smooth_bounds(history: PiecewiseExponential, step: float) -> tuple[float, float, float]:
    first = history.derivative
    second, third = first.derivative, first.derivative.derivative
    return first.largest, second.largest + _kink_bound(first, step), third.largest + _kink_bound(second, step)


def _kink_bound(derivative: PiecewiseExponential, step: float) -> float:
    """Bound of the derivative that replaces the jumps of ``derivative`` within a step."""
    shortest = float(np.min(np.diff(derivative.breaks)))
    inner = derivative.jumps[1:-1] if len(derivative.jumps) > 2 else np.zeros(1)
    return 2 * float(np.max(np.abs(inner), initial=0.0)) / step * (1 + step / shortest)


def conditions(loads: OwnLoads, discretised: DiscretisedLevel, step: float, direct_reactions: np.ndarray) -> Conditions:
    """Conditions under which nothing happens in a step, in a level; direct_reactions: L (k, m) of its links."""
    key = "conditions", discretised.step, step, direct_reactions.shape, direct_reactions.tobytes()

    def make() -> Conditions:
        level = loads.loaded_levels.level(discretised.states)
        rows = [Row(*signal) for signal in level.signals]
        reactions = np.zeros((len(rows), direct_reactions.shape[1]))
        for k, (element, exit_) in enumerate(level.exits):
            for link, share in level.force_shares(element, exit_):
                reactions[k] += share * direct_reactions[link]
        return conditions_of(discretised, level, rows, step, reactions)

    return loads.loaded_levels.further(discretised.states, key, make)
