"""Certified test that nothing happens within a time step, from the states at its two ends.

For a contact's function s (events/decision.py) the cubic Hermite interpolant of s, s' at both ends is off by at most
h^4/384 max|s''''|, and it lies above the least of its Bernstein coefficients: s > 0 on the whole step if

    min(s0, s0 + h s0'/3, s1 - h s1'/3, s1) > h^4/384 |[P R] A^3 S^-1| max |S z'| exp(sigma h)

s = P eta + R eta' + c, z = (eta, eta'), z' = A z + constant, S = diag(|omega|, I). |S z'| is an energy norm of the
velocities: under a constant force it grows no faster than with a rate sigma, that of a growing mode (omega^2 < 0) or
what friction that goes with pressure feeds (levels/sliding.py), mostly not at all, so the values at the two ends bound
it in between, whatever that force is. What fails the test is looked at exactly (step_by_step.py): the test may not
decide, but it does not err. Of forces f on points s also holds L f (modal_force.py), of the step's mean: what stands at
each end, less half its change.

Under loads that vary, s of xi = (eta, w), linear interpolation is off by at most h^2/8 max|s''|:

    min(s0, s1) > h^2/8 (|[P R] A S^-1| max|S z'| + |R| |p'| + |P_w| |w''| + |R_w| |w'''|),
    max |S z'| <= (max at the ends + h |p'|) exp(sigma h)

p = P w + Q w' the modal force. The channels enter by bounds that hold for the whole run; a kink of a sampled course
counts as the second derivative 2 |jump of w'| / h. Steps in which a course itself jumps are never taken for clear.

Either is a matrix times x = (q, q', q'', 1, f, places that links hold, w, w') at the ends. Exudyn's own state is read
where it stands.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.events.excitation import Excitation
from multiphi_exudyn.events.loaded_level import LoadedLevel
from multiphi_exudyn.events.state import Row
from multiphi_exudyn.exudyn_plugin.coupling.stepped_level import SteppedLevel
from multiphi_exudyn.mathematics.compiled import Ints, Numbers, compiled, entry
from multiphi_exudyn.mathematics.piecewise_exponential import PiecewiseExponential
from multiphi_exudyn.mathematics.signal_bounds import HERMITE

__all__ = ["Conditions", "StepTest", "conditions_of", "jump_times"]

NEGLIGIBLE = float(np.finfo(float).eps)  # of a contact's function: what no test needs to tell from zero

TIME, STEP, ROUNDING, CLEARANCE, SPEED, TOLD = range(6)  # numbers
SIZE, POINTS, HELD, CHANNELS, LATER, BEHIND, ALL, DIRECT, START, END, MATRIX, NORM, MULTIPLIERS = range(13)  # ints


@compiled
def step_is_clear(
    q: Numbers, q_t: Numbers, q_tt: Numbers, multipliers: Numbers, ints: Ints, numbers: Numbers, t: float
) -> int:
    """1 where nothing can have happened in the step that ends at t [s], whose end is then the start of the next."""
    ends = abs(t - numbers[TIME] - numbers[STEP]) <= numbers[ROUNDING]
    if not ends or (ints[CHANNELS] > 0 and numbers[TOLD] != t):
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
    if ints[DIRECT] == 1:
        limit += half_change(ints, numbers, width)
    if not numbers[CLEARANCE] > limit:
        return 0
    clearance, row = math.inf, ints[MATRIX]
    for k in range(ints[ALL]):
        total = 0.0
        for i in range(width):
            total += numbers[row + i] * numbers[x + i]
        if k < ints[BEHIND] and not total > limit:
            return 0
        if k >= ints[LATER]:
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
    """How far L f of the mean can be from that of either end of a step, in units of the conditions."""
    first, largest = 3 * ints[SIZE] + 1, 0.0
    for k in range(ints[ALL]):
        row, total = ints[MATRIX] + k * width, 0.0
        for i in range(first, first + ints[POINTS]):
            total += numbers[row + i] * (numbers[ints[END] + i] - numbers[ints[START] + i])
        largest = max(largest, 0.5 * abs(total))
    return largest


clear = entry(step_is_clear)


@dataclass(frozen=True)
class Conditions:
    """What has to exceed |norm (q, q', q'')| in one level, as rows of x, see the module's docstring.

    behind, both, ahead: (.., n), for the step before a state, for either, for the step after it. norm: S z' (2 s, 3 s).
    points, held, channels: how many entries of x are f, held places, and w with w'. direct: whether f counts.
    """

    behind: np.ndarray
    both: np.ndarray
    ahead: np.ndarray
    norm: np.ndarray
    points: int
    held: int
    channels: int
    direct: bool


class StepTest:
    """The test in one level, for the steps of a run of length ``step`` [s]; ``clear(t)`` is called at the end of each.

    views: q, q', q'' (s,) in the system's current state, and all its multipliers. places: of f among these.
    """

    def __init__(
        self,
        conditions: Conditions,
        step: float,
        rounding: float,
        views: Sequence[np.ndarray],
        places: Sequence[int],
    ) -> None:
        parts = conditions.behind, conditions.both, conditions.ahead
        self._matrix, self._norm = np.vstack(parts), conditions.norm
        behind, both, _ = (len(part) for part in parts)
        self._later, size, (count, width) = behind, conditions.norm.shape[1] // 3, self._matrix.shape
        first = TOLD + 1
        self._width, matrix = width, first + 2 * width
        self._numbers = np.concatenate([np.zeros(matrix), self._matrix.ravel(), self._norm.ravel()])
        self._numbers[[STEP, ROUNDING, TIME]] = step, rounding, math.nan
        self._numbers[[first + 3 * size, first + width + 3 * size]] = 1.0
        entries = conditions.points, conditions.held, conditions.channels
        sizes = size, *entries, behind, behind + both, count, int(conditions.direct)
        starts = first, first + width, matrix, matrix + count * width, MULTIPLIERS + 1
        self._ints = np.array([*sizes, *starts, *places], dtype=np.int64)
        self._kept = tuple(views)
        self.clear = clear.bound(*views, self._ints, self._numbers)

    @property
    def time(self) -> float:
        """When [s] the present step began."""
        return float(self._numbers[TIME])

    @property
    def start(self) -> np.ndarray:
        """A copy of (q, q', q'', 1, f) at the start of the present step."""
        first = self._ints[START]
        return self._numbers[first : first + 3 * self._ints[SIZE] + 1 + self._ints[POINTS]].copy()

    def begin(self, time: float, x: np.ndarray, armed: bool) -> None:
        """A step begins at a time [s] with x; what ends a phase that is not armed is looked for exactly."""
        first, end, numbers = self._ints[START], self._ints[END], self._numbers
        numbers[first : first + self._width] = x
        kept = slice(3 * self._ints[SIZE] + 1 + self._ints[POINTS], self._width - self._ints[CHANNELS])
        numbers[end + kept.start : end + kept.stop] = x[kept]
        speed = self._norm.dot(x[: self._norm.shape[1]])
        clearance = np.min(self._matrix[self._later :].dot(x), initial=math.inf) if armed else -math.inf
        numbers[TIME], numbers[CLEARANCE], numbers[SPEED] = time, clearance, math.sqrt(speed.dot(speed))

    def tell(self, t: float, channels: np.ndarray) -> None:
        """The step that ends at t [s] ends with w, w' (2 q,); not called for one in which they jump."""
        first = self._ints[END] + self._width
        self._numbers[first - len(channels) : first] = channels
        self._numbers[TOLD] = t


def conditions_of(
    stepped: SteppedLevel, level: LoadedLevel, rows: list[Row], step: float, direct: np.ndarray
) -> Conditions:
    """For the functions ``rows`` (c,) of xi in one level, and steps of length ``step`` [s].

    direct: L (c, m) for them, of no columns under loads that vary. Free motion has no fourth derivative: then round-off
    of the way that max |S z'| makes in a step, or for a contact that no mode moves of its gap, stands in for it.
    """
    s, q = stepped.size, level.excitation.prescribed
    (along, held), (rate, _) = (
        np.split(part, [s + q], axis=1) for part in _padded(stepped, rows, level.excitation.channels)
    )
    own, own_rate, none = along[:, :s], rate[:, :s], np.zeros((len(rows), s))
    order, share = (1, step**2 / 8) if q else (3, HERMITE * step**4)
    gains, swell = _gains(stepped, own, own_rate, order), _swell(stepped, step)
    constants = np.array([row.constant for row in rows]).reshape(-1)
    scales = np.maximum(share * gains, _least(along, rate, constants, step)) * swell
    first, second, third = _bounds(level.excitation, step)
    forced = _forced(level, first, second)
    extra = (np.linalg.norm(own_rate, axis=1) + step * gains * swell) * forced
    extra += np.abs(along[:, s:]) @ second + np.abs(rate[:, s:]) @ third
    beside = np.hstack([(constants - share * extra)[:, None], direct, held, along[:, s:], rate[:, s:]])
    value, turned = np.hstack([own, own_rate, none]), np.hstack([none, own, own_rate]) * (step / 3)
    behind, both, ahead = (
        np.hstack([functions @ stepped.physical, beside]) / scales[:, None]
        for functions in (value - turned, value, value + turned)
    )
    count = len(rows) if not q else 0
    entries = direct.shape[1], held.shape[1], 2 * q
    return Conditions(behind[:count], both, ahead[:count], _energy_norm(stepped), *entries, bool(np.any(direct)))


def _forced(level: LoadedLevel, first: np.ndarray, second: np.ndarray) -> float:
    """Bound of |p'| from those of |w'| and |w''| (q,)."""
    q = len(first)
    force, force_rate = np.abs(level.channels.force[:, :q]), np.abs(level.channels.force_rate[:, :q])
    return float(np.linalg.norm(force @ first + force_rate @ second))


def _least(along: np.ndarray, rate: np.ndarray, constants: np.ndarray, step: float) -> np.ndarray:
    way = step**2 * np.linalg.norm(along, axis=1) + step * np.linalg.norm(rate, axis=1)
    return NEGLIGIBLE * np.where(way > 0, way, np.where(constants != 0, np.abs(constants), 1.0))


def _padded(stepped: SteppedLevel, rows: list[Row], channels: int) -> tuple[np.ndarray, np.ndarray]:
    """P and R (c, s + q) of functions."""
    modes, size, count = stepped.modes, stepped.size, len(rows)
    padded = np.zeros((2, count, size + channels))
    for part, values in zip(padded, ([row.position for row in rows], [row.rate for row in rows]), strict=True):
        found = np.reshape(values, (count, modes + channels))
        part[:, :modes], part[:, size:] = found[:, :modes], found[:, modes:]
    return padded[0], padded[1]


def _omega(stepped: SteppedLevel) -> np.ndarray:
    return np.asarray(np.sqrt(np.abs(stepped.squares)))


def _pulling(stepped: SteppedLevel) -> np.ndarray:
    """K diag(1/|omega|) (s, s), zero where omega is: K acts on no mode of zero frequency."""
    omega, coupling = _omega(stepped), stepped.stiffness - np.diag(stepped.squares)
    found = np.divide(coupling, omega, out=np.zeros_like(coupling), where=omega > 0)
    return np.asarray(found + np.diag(np.sign(stepped.squares) * omega))


def _swell(stepped: SteppedLevel, duration: float) -> float:
    """How much |S z'| can grow in this time: exp(sigma t), sigma the largest eigenvalue of S A S^-1's symmetric part.

    G. G. Dahlquist, Stability and error bounds in the numerical integration of ordinary differential equations, 1958.
    """
    upper, s = np.diag(_omega(stepped)) - _pulling(stepped).T, stepped.size
    flow = np.block([[np.zeros((s, s)), upper], [upper.T, -stepped.own_damping - stepped.own_damping.T]]) / 2
    return math.exp(max(float(np.linalg.eigvalsh(flow)[-1]), 0.0) * duration)


def _energy_norm(stepped: SteppedLevel) -> np.ndarray:
    """S z' (2 s,) from (q, q', q'')."""
    scale = np.concatenate([_omega(stepped), np.ones(stepped.size)])
    return np.asarray(scale[:, None] * stepped.physical[stepped.size :])


def _gains(stepped: SteppedLevel, along: np.ndarray, rate: np.ndarray, power: int) -> np.ndarray:
    """|[P R] A^power S^-1| of every row [P R] (2 s,), also where omega = 0; [P R] A = [-R K, P - R D]."""
    damping, stiffness = stepped.own_damping, stepped.stiffness
    for _ in range(power - 1):
        along, rate = -rate @ stiffness, along - rate @ damping
    return np.asarray(np.linalg.norm(np.hstack([-rate @ _pulling(stepped), along - rate @ damping]), axis=1))


def jump_times(excitation: Excitation) -> np.ndarray:
    """When a channel jumps, ascending [s]."""
    times = np.unique(np.concatenate([history.jump_times() for history in excitation.histories]))
    return np.asarray(times[times > 0])


def _bounds(excitation: Excitation, step: float) -> np.ndarray:
    """Bounds (3, q) of |w'|, |w''|, |w'''| of the channels, kinks counted for steps of this length."""
    return np.array([_smooth_bounds(history, step) for history in excitation.histories]).reshape(-1, 3).T


def _smooth_bounds(history: PiecewiseExponential, step: float) -> tuple[float, float, float]:
    first = history.derivative
    second, third = first.derivative, first.derivative.derivative
    return first.largest, second.largest + _kinks(first, step), third.largest + _kinks(second, step)


def _kinks(derivative: PiecewiseExponential, step: float) -> float:
    """Second derivative that stands for the jumps of a first one within a step."""
    shortest = float(np.min(np.diff(derivative.breaks)))
    inner = derivative.jumps[1:-1] if len(derivative.jumps) > 2 else np.zeros(1)
    return 2 * float(np.max(np.abs(inner), initial=0.0)) / step * (1 + step / shortest)
