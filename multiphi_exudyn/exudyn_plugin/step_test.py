"""Certified test that no event occurs within a time step, from the states at its two ends.

For the signal s of an exit (core/law) the cubic Hermite interpolant of s, s' at both ends has an error of at
most h^4/384 max|s''''|, and it is not less than the smallest of its Bernstein coefficients: s > 0 on the whole step if

    min(s0, s0 + h s0'/3, s1 - h s1'/3, s1) > h^4/384 |[P R] A^3 S^-1| max |S z'| exp(sigma h)

s = P eta + R eta' + c, z = (eta, eta'), z' = A z + constant, S = diag(|omega|, I). |S z'| is an energy norm of the
velocities. Under a constant force its growth rate is at most sigma, mostly zero: it is positive for a growing mode
(omega^2 < 0) and where friction that is proportional to pressure supplies energy (levels/level/sliding.py). So the
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

Own loads of a body during one run: those that vary in time, as modal forces and as channels (excitation.py).

    p = P w(t) + Q w'(t)

w are the channels, the time functions of the loads. Without loads that vary there are none, and p is zero.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

import multiphi_exudyn._core as core
from multiphi_exudyn.exudyn_plugin.discretised_level import SteppedLevel
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mathematics.piecewise_exponential import PiecewiseExponential
from multiphi_exudyn.mechanics.loads import Load
from multiphi_exudyn.time.excitation import Excitation
from multiphi_exudyn.time.loaded_level import LoadedLevel
from multiphi_exudyn.time.loaded_levels import LoadedLevels
from multiphi_exudyn.time.state import Phase, Row, State

NEGLIGIBLE = float(np.finfo(float).eps)  # of a signal: smaller values count as zero
FINER = 10.0  # smooth time functions of loads are approximated to a tenth of their tolerance
CHUNK = 256  # steps whose channels are evaluated at once


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
    stepped: SteppedLevel, level: LoadedLevel, rows: list[Row], step: float, direct_reactions: np.ndarray
) -> Conditions:
    """Conditions for the signals ``rows`` (c,) of xi in one level, and steps of length ``step`` [s].

    direct_reactions: L (c, m) of these signals, without columns under loads that vary. A motion without fourth
    derivative has the bound of round-off instead: of the displacement of a step, or of the gap if no mode changes it.
    """
    s, q = stepped.size, level.excitation.prescribed
    (position, held), (rate, _) = (
        np.split(part, [s + q], axis=1) for part in _signal_matrices(stepped, rows, level.excitation.channels)
    )
    modal_position, modal_rate, none = position[:, :s], rate[:, :s], np.zeros((len(rows), s))
    order, factor = (1, step**2 / 8) if q else (3, core.CUBIC_REMAINDER * step**4)
    derivative_bounds, growth = _derivative_bounds(stepped, modal_position, modal_rate, order), _growth(stepped, step)
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
        np.hstack([signals @ stepped.to_physical, further]) / scales[:, None]
        for signals in (value - slope, value, value + slope)
    )
    count = len(rows) if not q else 0
    entries = direct_reactions.shape[1], held.shape[1], 2 * q
    return Conditions(
        behind[:count], both, ahead[:count], _energy_norm(stepped), *entries, bool(np.any(direct_reactions))
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


def _signal_matrices(stepped: SteppedLevel, rows: list[Row], channels: int) -> tuple[np.ndarray, np.ndarray]:
    """Matrices P and R (c, s + q) of the signals, padded to the body's size."""
    modes, size, count = stepped.modes, stepped.size, len(rows)
    padded = np.zeros((2, count, size + channels))
    for part, values in zip(padded, ([row.position for row in rows], [row.rate for row in rows]), strict=True):
        coefficients = np.reshape(values, (count, modes + channels))
        part[:, :modes], part[:, size:] = coefficients[:, :modes], coefficients[:, modes:]
    return padded[0], padded[1]


def _omega(stepped: SteppedLevel) -> np.ndarray:
    return np.asarray(np.sqrt(np.abs(stepped.squares)))


def _scaled_stiffness(stepped: SteppedLevel) -> np.ndarray:
    """K diag(1/|omega|) (s, s), zero for modes of zero frequency, on which K does not act."""
    omega, coupling = _omega(stepped), stepped.stiffness - np.diag(stepped.squares)
    scaled = np.divide(coupling, omega, out=np.zeros_like(coupling), where=omega > 0)
    return np.asarray(scaled + np.diag(np.sign(stepped.squares) * omega))


def _growth(stepped: SteppedLevel, duration: float) -> float:
    """Bound exp(sigma t) of the growth of |S z'| in a time t; sigma: largest eigenvalue of S A S^-1's symmetric part.

    G. G. Dahlquist, Stability and error bounds in the numerical integration of ordinary differential equations, 1958.
    """
    upper, s = np.diag(_omega(stepped)) - _scaled_stiffness(stepped).T, stepped.size
    symmetric_part = (
        np.block([[np.zeros((s, s)), upper], [upper.T, -stepped.modal_damping - stepped.modal_damping.T]]) / 2
    )
    return math.exp(max(float(np.linalg.eigvalsh(symmetric_part)[-1]), 0.0) * duration)


def _energy_norm(stepped: SteppedLevel) -> np.ndarray:
    """Matrix (2 s, 3 s) from (q, q', q'') to S z'."""
    scale = np.concatenate([_omega(stepped), np.ones(stepped.size)])
    return np.asarray(scale[:, None] * stepped.to_physical[stepped.size :])


def _derivative_bounds(stepped: SteppedLevel, position: np.ndarray, rate: np.ndarray, power: int) -> np.ndarray:
    """|[P R] A^power S^-1| (c,) of the rows [P R] (c, 2 s), also where omega = 0; [P R] A = [-R K, P - R D]."""
    damping, stiffness = stepped.modal_damping, stepped.stiffness
    for _ in range(power - 1):
        position, rate = -rate @ stiffness, position - rate @ damping
    return np.asarray(
        np.linalg.norm(np.hstack([-rate @ _scaled_stiffness(stepped), position - rate @ damping]), axis=1)
    )


def jump_times(excitation: Excitation) -> np.ndarray:
    """Times at which a channel jumps, ascending [s]."""
    times = np.unique(np.concatenate([history.jump_times() for history in excitation.histories]))
    return np.asarray(times[times > 0])


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


class OwnLoads:
    """Loads on a body of ``size`` coordinates from a time until ``end`` [s].

    loaded_levels: the levels under all loads. static_levels: those under the static loads alone. varies: whether a load
    varies in time, or a counter-surface moves.
    """

    def __init__(self, model: MultiPhiModel, loads: Sequence[Load], size: int, time: float, end: float) -> None:
        self.excitation = Excitation.of(model, loads, end, FINER)
        self.loaded_levels = LoadedLevels.under(model, self.excitation, time, end)
        self.varies = self.excitation.prescribed > 0
        self.static_levels = self.loaded_levels.alone
        self._size = size
        self._jumps = jump_times(self.excitation) if self.varies else np.zeros(0)
        self._step = self._chunk_start = math.nan
        self._values = np.zeros((0, 2, self.excitation.prescribed))

    def set_step(self, step: float) -> None:
        """Set the step size [s] of the run."""
        self._step = step

    def forces(self, states: tuple[int, ...], times: np.ndarray) -> np.ndarray:
        """Modal forces (k, s) of the varying loads at times (k,) [s], in a level."""
        if not self.varies:
            return np.zeros((len(times), self._size))
        return self._forces(states, self.excitation.values(times))

    def force_at(self, states: tuple[int, ...], time: float) -> np.ndarray:
        """Modal force (s,) of the varying loads at the end of a step."""
        return self._forces(states, self._channels(time)[None])[0] if self.varies else np.zeros(self._size)

    def channels_at(self, time: float) -> np.ndarray:
        """Channels w, w' (2 q,) at the end of a step; those of many steps are evaluated at once."""
        return self._channels(time).ravel() if self.varies else np.zeros(0)

    def has_jump(self, start: float, end: float, rounding: float) -> bool:
        """Whether a load jumps in a step or at its ends; all these times are rounded."""
        first = int(np.searchsorted(self._jumps, start - rounding))
        return first < len(self._jumps) and bool(self._jumps[first] <= end + rounding)

    def level_coordinates(
        self, stepped: SteppedLevel, eta: np.ndarray, eta_t: np.ndarray, held: np.ndarray, time: np.ndarray
    ) -> tuple[LoadedLevel, np.ndarray, np.ndarray]:
        """Level under all loads, and its coordinates xi, xi' (r + q + h, k) at times (k,) [s].

        held: stick positions (h, k) [m].
        """
        w, w_t = self.excitation.values(time).transpose(1, 2, 0)
        return self.loaded_levels.level(stepped.states), np.vstack([eta, w, held]), np.vstack([eta_t, w_t, 0 * held])

    def stepped_level(self, states: tuple[int, ...], step: float | None) -> SteppedLevel:
        """The solver's form of a level under the static loads; step: size [s] its modes are matched to, or None."""
        levels = self.static_levels
        return levels.further(
            states, ("stepped", step), lambda: SteppedLevel.of(levels.level(states), self._size, step)
        )

    def conditions(self, stepped: SteppedLevel, step: float, direct_reactions: np.ndarray) -> Conditions:
        """Conditions under which nothing happens in a step, in a level; direct_reactions: L (k, m) of its links."""
        key = "conditions", stepped.step, step, direct_reactions.shape, direct_reactions.tobytes()
        return self.loaded_levels.further(
            stepped.states, key, lambda: self._conditions(stepped, step, direct_reactions)
        )

    def _conditions(self, stepped: SteppedLevel, step: float, direct_reactions: np.ndarray) -> Conditions:
        level = self.loaded_levels.level(stepped.states)
        rows = [Row(*signal) for signal in level.signals]
        reactions = np.zeros((len(rows), direct_reactions.shape[1]))
        for k, (element, exit_) in enumerate(level.exits):
            for link, share in level.force_shares(element, exit_):
                reactions[k] += share * direct_reactions[link]
        return conditions_of(stepped, level, rows, step, reactions)

    def phases_of(self, state: State, time: float) -> tuple[Phase, ...]:
        """Phases of a state at a time [s]: as at its entry, but armed again where the exit's signal has risen."""
        if all(phase is Phase.ARMED for phase in state.phases):
            return state.phases
        level, r, drive = self.loaded_levels.level(state.states), state.level.modal.modes, self.excitation.drive(time)
        parts = (state.displacement, drive.values[0]), (state.velocity, drive.values[1]), (state.reach, drive.sizes[0])
        xi, xi_t, reach = (np.concatenate([x[:r], w, x[r:]]) for x, w in parts)
        signs = (row.sign(xi, xi_t, reach) for row in (Row(*signal) for signal in level.signals))
        signs_and_phases = zip(signs, state.phases, strict=True)
        return tuple(phase if sign <= 0 or phase is Phase.LANDING else Phase.ARMED for sign, phase in signs_and_phases)

    def _forces(self, states: tuple[int, ...], values: np.ndarray) -> np.ndarray:
        """Modal forces (k, s) of channels w, w' (k, 2, q), in a level."""
        level, forces, q = self.loaded_levels.level(states), np.zeros((len(values), self._size)), values.shape[2]
        force, rate = level.channels.force[:, :q], level.channels.force_rate[:, :q]
        drive_change = level.asymptotic.drive - level.asymptotic.static_drive  # of the stepped level's constant force
        forces[:, : level.modal.modes] = values[:, 0] @ force.T + values[:, 1] @ rate.T + drive_change
        return forces

    def _channels(self, t: float) -> np.ndarray:
        """Channels w, w' (2, q) at a time [s]."""
        position = (t - self._chunk_start) / self._step
        index = round(position) if math.isfinite(position) else -1
        if not (0 <= index < len(self._values) and abs(position - index) <= 1e-9 * max(1.0, t / self._step)):
            if not math.isfinite(self._step):
                return np.asarray(self.excitation.values(np.array([t]))[0])
            self._chunk_start, index = t, 0
            self._values = self.excitation.values(t + self._step * np.arange(CHUNK))
        return np.asarray(self._values[index])
