"""Certified test that no event occurs within a time step, from the states at its two ends.

For the signal s of an exit (events/law) the cubic Hermite interpolant of s, s' at both ends has an error of at
most h^4/384 max|s''''|, and it is not less than the smallest of its Bernstein coefficients: s > 0 on the whole step if

    min(s0, s0 + h s0'/3, s1 - h s1'/3, s1) > h^4/384 |[P R] A^3 S^-1| max |S z'| exp(sigma h)

s = P eta + R eta' + c, z = (eta, eta'), z' = A z + constant, S = diag(|omega|, I). |S z'| is an energy norm of the
velocities. Under a constant force its growth rate is at most sigma, mostly zero: it is positive for a growing mode
(omega^2 < 0) and where friction that is proportional to pressure supplies energy (levels/level/sliding.py). So the
values at the two ends bound it in between, for any constant force. A step that fails the test is computed again exactly
(step_by_step.py): the test may fail without an event, but it never passes with one. Forces f on points add L f to s
(modal_force.py), with the mean f of the step: the value at each end, with half its change as an error bound.

Under loads that vary, s depends on xi = (eta, w), and linear interpolation has an error of at most h^2/8 max|s''|:

    min(s0, s1) > h^2/8 (|[P R] A S^-1| max|S z'| + |R| |p'| + |P_w| |w''| + |R_w| |w'''|),
    max |S z'| <= (max at the ends + h |p'|) exp(sigma h)

p = P w + Q w' is the modal force. The bounds of the channels hold for the whole run; a kink of a sampled time function
counts as the second derivative 2 |jump of w'| / h. A step in which a time function itself jumps always fails the test.

Both conditions are a matrix times x = (q, q', q'', 1, f, stick positions, w, w') at the ends. Exudyn's own state is
read without a copy.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.events.excitation.excitation import Excitation
from multiphi_exudyn.events.excitation.loaded_level import LoadedLevel
from multiphi_exudyn.events.transitions.state import Row
from multiphi_exudyn.exudyn_plugin.coupling.stepped_level import SteppedLevel
from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, compiled, entry
from multiphi_exudyn.mathematics.functions.piecewise_exponential import PiecewiseExponential
from multiphi_exudyn.mathematics.search.signal_bounds import HERMITE

__all__ = ["Conditions", "StepTest", "conditions_of", "jump_times"]

NEGLIGIBLE = float(np.finfo(float).eps)  # of a signal: smaller values count as zero

TIME, STEP, ROUNDING, CLEARANCE, SPEED, ANNOUNCED_END = range(6)  # numbers
SIZE, POINTS, HELD, CHANNELS, FIRST_AHEAD, BEHIND_COUNT, CONDITION_COUNT, HAS_POINT_FORCES = range(8)  # ints
START, END, MATRIX, NORM, MULTIPLIERS = range(8, 13)  # ints


@compiled
def step_is_clear(
    q: Numbers, q_t: Numbers, q_tt: Numbers, multipliers: Numbers, ints: Ints, numbers: Numbers, t: float
) -> int:
    """1 if no event can have occurred in the step that ends at t [s]; its end is then the start of the next step."""
    ends = abs(t - numbers[TIME] - numbers[STEP]) <= numbers[ROUNDING]
    if not ends or (ints[CHANNELS] > 0 and numbers[ANNOUNCED_END] != t):
        return 0
    s, x = ints[SIZE], ints[END]
    for i in range(s):
        numbers[x + i] = q[i]
        numbers[x + s + i] = q_t[i]
        numbers[x + 2 * s + i] = q_tt[i]
    for k in range(ints[POINTS]):
        numbers[x + 3 * s + 1 + k] = multipliers[ints[ints[MULTIPLIERS] + k]]
    width, square, row = 3 * s + 1 + ints[POINTS] + ints[HELD] + ints[CHANNELS], 0.0, ints[NORM]
    for _ in range(2 * s):
        total = 0.0
        for i in range(3 * s):
            total += numbers[row + i] * numbers[x + i]
        square += total * total
        row += 3 * s
    speed = math.sqrt(square)
    limit = max(speed, numbers[SPEED])
    if ints[HAS_POINT_FORCES] == 1:
        limit += half_change(ints, numbers, width)
    if not numbers[CLEARANCE] > limit:
        return 0
    clearance, row = math.inf, ints[MATRIX]
    for k in range(ints[CONDITION_COUNT]):
        total = 0.0
        for i in range(width):
            total += numbers[row + i] * numbers[x + i]
        if k < ints[BEHIND_COUNT] and not total > limit:
            return 0
        if k >= ints[FIRST_AHEAD]:
            clearance = min(clearance, total)
        row += width
    ints[END] = ints[START]
    ints[START] = x
    numbers[TIME] = t
    numbers[CLEARANCE] = clearance
    numbers[SPEED] = speed
    return 1


@compiled
def half_change(ints: Ints, numbers: Numbers, width: int) -> float:
    """Largest difference of L f between its mean and either end of a step, in units of the conditions."""
    first, largest = 3 * ints[SIZE] + 1, 0.0
    for k in range(ints[CONDITION_COUNT]):
        row, total = ints[MATRIX] + k * width, 0.0
        for i in range(first, first + ints[POINTS]):
            total += numbers[row + i] * (numbers[ints[END] + i] - numbers[ints[START] + i])
        largest = max(largest, 0.5 * abs(total))
    return largest


step_test = entry(step_is_clear)


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


class StepTest:
    """The test in one level, for steps of length ``step`` [s]; ``is_step_clear(t)`` is called at the end of each.

    views: q, q', q'' (s,) in the system's current state, and all its multipliers. indices: of f among the multipliers.
    """

    def __init__(
        self,
        conditions: Conditions,
        step: float,
        rounding: float,
        views: Sequence[np.ndarray],
        indices: Sequence[int],
    ) -> None:
        parts = conditions.behind, conditions.both, conditions.ahead
        self._matrix, self._norm = np.vstack(parts), conditions.norm
        behind, both, _ = (len(part) for part in parts)
        self._first_ahead, size, (count, width) = behind, conditions.norm.shape[1] // 3, self._matrix.shape
        first = ANNOUNCED_END + 1
        self._width, matrix = width, first + 2 * width
        self._numbers = np.concatenate([np.zeros(matrix), self._matrix.ravel(), self._norm.ravel()])
        self._numbers[[STEP, ROUNDING, TIME]] = step, rounding, math.nan
        self._numbers[[first + 3 * size, first + width + 3 * size]] = 1.0
        entries = conditions.points, conditions.held, conditions.channels
        sizes = size, *entries, behind, behind + both, count, int(conditions.has_point_forces)
        starts = first, first + width, matrix, matrix + count * width, MULTIPLIERS + 1
        self._ints = np.array([*sizes, *starts, *indices], dtype=np.int64)
        self._views = tuple(views)
        self.is_step_clear = step_test.bound(*views, self._ints, self._numbers)

    @property
    def time(self) -> float:
        """Start of the present step [s]."""
        return float(self._numbers[TIME])

    @property
    def start(self) -> np.ndarray:
        """A copy of (q, q', q'', 1, f) at the start of the present step."""
        first = self._ints[START]
        return self._numbers[first : first + 3 * self._ints[SIZE] + 1 + self._ints[POINTS]].copy()

    def begin(self, time: float, x: np.ndarray, armed: bool) -> None:
        """Begin a step at a time [s] with x; while a phase is not armed the test fails, so that its end is found."""
        first, end, numbers = self._ints[START], self._ints[END], self._numbers
        numbers[first : first + self._width] = x
        unchanged = slice(3 * self._ints[SIZE] + 1 + self._ints[POINTS], self._width - self._ints[CHANNELS])
        numbers[end + unchanged.start : end + unchanged.stop] = x[unchanged]
        speed = self._norm.dot(x[: self._norm.shape[1]])
        clearance = np.min(self._matrix[self._first_ahead :].dot(x), initial=math.inf) if armed else -math.inf
        numbers[TIME], numbers[CLEARANCE], numbers[SPEED] = time, clearance, math.sqrt(speed.dot(speed))

    def set_end_channels(self, t: float, channels: np.ndarray) -> None:
        """Set w, w' (2 q,) at the end t [s] of the present step; not to be called for a step in which they jump."""
        first = self._ints[END] + self._width
        self._numbers[first - len(channels) : first] = channels
        self._numbers[ANNOUNCED_END] = t


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
    order, factor = (1, step**2 / 8) if q else (3, HERMITE * step**4)
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
