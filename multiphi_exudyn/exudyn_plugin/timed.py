"""What user functions of time do to an Exudyn system: loads and forces, and motions that constraints prescribe.

    p(t) = rows^T u(t)                       loads, forces of ObjectGenericODE2
    q = q_0 + S z + e^T u(t),   C e_k = -dg/du_k,   S^T M e_k = 0        motions

Loads: u (k,) [N, N m] is the value of a user function of time alone, rows (k, n_full) are the generalised forces of a
unit of each component at the current state. For the force f(t, q, q') of an ObjectGenericODE2, u is its change with
time at the current state, f(t, q_0, v_0) - f(t_0, q_0, v_0).

Motions: u (k,) [m, rad] is the change of a constraint's offset since the reduction, e (k, n_full) the displacement of
the system by a unit of each component, g(q, t) the constraints and C their Jacobian. As e is orthogonal to S in the
mass metric, u'' does not act on z: the load of such a motion is p(t) = -S^T (K e^T u + C e^T u'), even where the speed
u' jumps. An offset on velocities is integrated over time.
"""

from __future__ import annotations

import bisect
import functools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import exudyn as exu
import numpy as np

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.exudyn_plugin.items import is_active, user_function, value_key
from multiphi_exudyn.exudyn_plugin.system import Directions, generalised_forces, residuals, static_solver
from multiphi_exudyn.mathematics.piecewise_exponential import PiecewiseExponential
from multiphi_exudyn.mechanics.arguments import is_real
from multiphi_exudyn.mechanics.loads import FunctionLoad, VaryingLoad
from multiphi_exudyn.mechanics.time_functions import Smooth

__all__ = [
    "Component",
    "PrescribedMotion",
    "RateLoad",
    "TimedLoad",
    "check_offsets",
    "function_loads",
    "prescribed_motions",
    "timed_forces",
    "timed_loads",
]

SAMPLE_TIMES = np.concatenate(
    [[0.0], np.geomspace(1e-6, 1e3, 64)]
)  # s after the reduction: times at which forces are compared
MOST = 30  # components of one force that change with time: each becomes a load
UNIT = 1e-6  # m, rad: change of an offset, by whose effect its direction is determined
FINE, COARSE = 1e-3, 1e-2  # of the time scale: steps of the first and of the second derivative
_OFFSETS = {"ConnectorCoordinate": 1, "JointGeneric": 6}  # constraints with offsets by user functions, components
_AHEAD = np.array([-25, 48, -36, 16, -3]) / 12, np.array([35, -104, 114, -56, 11]) / 12  # at 0 to 4 steps
_AROUND = np.array([1, -8, 0, 8, -1]) / 12, np.array([-1, 16, -30, 16, -1]) / 12  # at -2 to 2 steps
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(7)
KEPT = 100_000  # values of a user function: several loads evaluate it at the same times
HALVINGS = 20  # of an interval of integration, in search of a jump
INTEGRATED = 1e-12  # of an integral of the absolute values: error of one interval


@dataclass(frozen=True, eq=False)
class TimedLoad:
    """A load by a function of time: rows (k, n_full), value: u (k,) of the time t [s] since the reduction."""

    rows: np.ndarray
    value: Callable[[float], np.ndarray]


def timed_loads(mbs: Any, loads: Sequence[Mapping[str, Any]], start: float) -> dict[int, TimedLoad | str]:
    """Loads by user functions of time, by index, or the reason why one is not; t = 0 is the time ``start`` [s].

    The user functions have to be switched off.
    """
    placeholder = SystemPlaceholder(dict(mbs.variables))
    values = {i: _value(load, start, placeholder) for i, load in enumerate(loads) if user_function(load)}
    return {i: value if isinstance(value, str) else TimedLoad(_rows(mbs, i), value) for i, value in values.items()}


def timed_forces(mbs: Any, objects: Sequence[Mapping[str, Any]], start: float) -> dict[int, TimedLoad]:
    """Changes with time of the forces of ObjectGenericODE2, by index; t = 0 is the time ``start`` [s]."""
    placeholder = SystemPlaceholder(dict(mbs.variables))
    forces = {
        i: _force_change(mbs, i, item["forceUserFunction"]["function"], start, placeholder)
        for i, item in enumerate(objects)
        if item["objectType"] == "GenericODE2" and item["forceUserFunction"]
    }
    return {i: force for i, force in forces.items() if force}


def _force_change(
    mbs: Any, index: int, function: Any, start: float, placeholder: SystemPlaceholder
) -> TimedLoad | None:
    """Components that change with time; None without any, for too many, and for a function that reads the system."""
    indices = mbs.systemData.GetObjectLTGODE2(exu.ObjectIndex(index))
    q, q_t = mbs.systemData.GetODE2Coordinates(), mbs.systemData.GetODE2Coordinates_t()

    def force(t: float) -> np.ndarray:
        return np.array(
            function(placeholder, start + float(t), index, list(q[indices]), list(q_t[indices])), dtype=float
        )

    try:
        values = np.array([force(t) for t in SAMPLE_TIMES])
    except Exception:  # any error of the user's function: the force is taken at its present value
        return None
    varying = np.flatnonzero(np.any(values != values[0], axis=0))
    if not 0 < len(varying) <= MOST:
        return None
    return TimedLoad(np.eye(len(q))[np.array(indices)[varying]], lambda t: (force(t) - values[0])[varying])


def function_loads(timed: TimedLoad, basis: np.ndarray) -> Iterator[FunctionLoad]:
    """One load for each component that moves the structure."""
    for k, row in enumerate(timed.rows):
        if np.any(row @ basis):
            yield FunctionLoad(row @ basis, _component(timed.value, k))


def _component(value: Callable[[float], np.ndarray], k: int) -> Callable[[Any], float]:
    return lambda t: float(value(t)[k])


def _value(
    load: Mapping[str, Any], start: float, placeholder: SystemPlaceholder
) -> Callable[[float], np.ndarray] | str:
    """u(t), or the reason why it is not a function of time alone."""
    present, user = load[value_key(load)], load[user_function(load)]
    if user["type"] != "Python":
        return f"its user function is of type {user['type']}, need Python"
    function, size = user["function"], np.size(present)

    def value(t: float) -> np.ndarray:
        return np.array(function(placeholder, start + float(t), present), dtype=float).reshape(size)

    try:
        value(0.0)
    except Exception as error:  # any error of the user's function
        return f"its user function depends on more than time ({' '.join(str(error).split())})"
    return value


class ReadsSystem(MultiPhiValueError):
    """A user function that reads the system."""


def checked(what: str, evaluate: Callable[[float], Any], size: int) -> Callable[[float], np.ndarray]:
    """A user function of time with its values (size,) checked; what: the item and its function, for the errors."""
    needed = "a finite number" if size == 1 else f"{size} finite numbers"

    def value(t: float) -> np.ndarray:
        time = float(t)
        try:
            given = evaluate(time)
        except ReadsSystem:
            raise
        except Exception as error:  # any error of the user's function
            cause = " ".join(f"{type(error).__name__} {error}".split())
            raise MultiPhiValueError(f"{what}: got {cause} at t = {time:g} s, need {needed}") from error
        values = np.array(given) if is_real(given) or (size > 1 and np.shape(given) == (size,)) else np.array("")
        if values.dtype.kind not in "biuf" or not np.all(np.isfinite(values)):
            raise MultiPhiValueError(f"{what}: got {given!r} at t = {time:g} s, need {needed}")
        return values.astype(float).reshape(size)

    return value


class SystemPlaceholder:
    """Argument of a user function in place of the system, which does not exist in the model's run.

    variables: those of the system at the reduction.
    """

    def __init__(self, variables: dict[str, Any]) -> None:
        self.variables = variables

    def __getattr__(self, name: str) -> Any:
        raise ReadsSystem(f"it reads mbs.{name}")


def _rows(mbs: Any, index: int) -> np.ndarray:
    """Generalised force (k, n_full) of a unit of each component of a load whose present value is zero."""
    load = exu.LoadIndex(index)
    key = value_key(mbs.GetLoad(load))
    zero = mbs.GetLoad(load)[key]
    with static_solver(mbs) as solver:
        without = generalised_forces(mbs, solver)
        try:
            rows = []
            for unit in np.eye(np.size(zero)):
                mbs.SetLoadParameter(load, key, unit if np.ndim(zero) else 1.0)
                rows.append(generalised_forces(mbs, solver) - without)
        finally:
            mbs.SetLoadParameter(load, key, zero)
    return np.array(rows)


@dataclass(frozen=True, eq=False)
class PrescribedMotion:
    """q = q_0 + S z + directions^T value(t): directions (k, n_full), value: u (k,) of the time t [s], zero at t = 0.

    item: type and name of the constraint. scale: of the time [s] in which u changes. speed: u' (k,), if it is given.
    """

    item: str
    directions: np.ndarray
    value: Callable[[float], np.ndarray]
    scale: float
    speed: Callable[[float], np.ndarray] | None = None

    def derivative(self, t: float, order: int) -> np.ndarray:
        """u, u' or u'' (k,), by the order; derivatives that are not given by differences of fourth order."""
        if order == 0:
            return self.value(t)
        if self.speed:
            return self.speed(t) if order == 1 else _difference(self.speed, t, FINE * self.scale, 1)
        return _difference(self.value, t, (FINE if order == 1 else COARSE) * self.scale, order)


class Component:
    """A sum of the components of a prescribed motion, or of its speed, as a function of time [s]: weights.values(t)."""

    def __init__(self, item: str, values: Callable[[float], np.ndarray], weights: np.ndarray) -> None:
        self.item, self._values, self._weights = item, values, weights

    def __call__(self, t: Any) -> float:
        """The sum at one time [s]."""
        return float(self._weights @ self._values(t))

    def __deepcopy__(self, memo: Any) -> Component:
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        raise MultiPhiTypeError(
            f"pickle: got the motion that {self.item} prescribes, a Python function, which cannot be pickled; keep a "
            "run with Trajectory.save, or pickle its displacements; the model alone can be pickled"
        )


@dataclass(frozen=True, eq=False)
class RateLoad(VaryingLoad):
    """A load by the rate of a function of time, f(t) = p u'(t), of the polynomials that approximate u.

    The impulse of a jump of u has no part in them: a jump is refused.
    """

    function: Component

    @property
    def course(self) -> Any:
        """u'(t)."""
        return _Rate(self.function)


@dataclass(frozen=True)
class _Rate:
    """u', as a function of time of a load."""

    function: Component

    def history(self, end: float, finer: float = 1.0) -> PiecewiseExponential:
        """u' up to ``end`` [s]."""
        motion = Smooth(self.function).history(end, finer)
        jumps = np.isin(motion.breaks, motion.jump_times()) & (motion.breaks > 0) & (motion.breaks < end)
        if np.any(jumps):
            first = int(np.argmax(jumps))
            raise MultiPhiValueError(
                f"{self.function.item}: got a motion that jumps by {abs(motion.jumps[first]):.3g} m or rad at t = "
                f"{motion.breaks[first]:.6g} s, to which its dampers answer with an impulse; need a gradual rise"
            )
        return motion.derivative


def check_offsets(mbs: Any, objects: Sequence[Mapping[str, Any]], start: float) -> None:
    """Refuse user functions of offsets that give no finite numbers at the time ``start`` [s], by their items."""
    placeholder = SystemPlaceholder(dict(mbs.variables))
    for i, item in enumerate(objects):
        if _offset_function(item) and is_active(item):
            _offset_value(item, i, start, placeholder)


def prescribed_motions(
    mbs: Any, solver: Any, objects: Sequence[Mapping[str, Any]], start: float, directions: Directions
) -> dict[int, PrescribedMotion | str]:
    """Motions by offsets of constraints, by index, or the reason why one is not a function of time; t = 0 is ``start``.

    directions: of the constraints at the current state, which meets them.
    """
    placeholder = SystemPlaceholder(dict(mbs.variables))
    found: dict[int, PrescribedMotion | str] = {}
    for i, item in enumerate(objects):
        if not (_offset_function(item) or _has_speed(item)) or not is_active(item):
            continue
        present, value = _offset(item), _offset_value(item, i, start, placeholder)
        if isinstance(value, str):
            found[i] = value
            continue
        slopes = _slopes(mbs, solver, i, item, present if _is_of_velocity(item) else value(0.0))
        rows = np.array([directions.solve(np.zeros(len(directions.mass)), -slope) for slope in slopes])
        found[i] = _motion(_named(item), rows, value, _is_of_velocity(item))
    return found


def _is_of_velocity(item: Mapping[str, Any]) -> bool:
    return bool(item.get("velocityLevel", False))


def _offset_function(item: Mapping[str, Any]) -> Any:
    """The user function that Exudyn's constraint on positions or velocities evaluates, 0 without one."""
    if item["objectType"] not in _OFFSETS:
        return 0
    return item["offsetUserFunction_t" if _is_of_velocity(item) else "offsetUserFunction"]


def _has_speed(item: Mapping[str, Any]) -> bool:
    return item["objectType"] == "ConnectorCoordinate" and _is_of_velocity(item) and item["offset"] != 0


def _offset(item: Mapping[str, Any]) -> Any:
    """Present parameter of an item's offset, the last argument of its user function."""
    return item["offset"] if item["objectType"] == "ConnectorCoordinate" else item["offsetUserFunctionParameters"]


def _offset_value(
    item: Mapping[str, Any], index: int, start: float, placeholder: SystemPlaceholder
) -> Callable[[float], np.ndarray] | str:
    """The offset (k,) as a function of time, or the reason why it is none."""
    user, parameter, size = _offset_function(item), _offset(item), _OFFSETS[item["objectType"]]
    if not user:
        return lambda t: np.array([float(parameter)])
    if user["type"] != "Python":
        return f"its user function is of type {user['type']}, need Python"
    function = user["function"]

    value = checked(f"{_named(item)} offset", lambda t: function(placeholder, start + t, index, parameter), size)
    try:
        value(0.0)
    except ReadsSystem as error:
        return f"its user function depends on more than time ({error})"
    return value


def _named(item: Mapping[str, Any]) -> str:
    return f"Object{item['objectType']} {item['name']!r}"


def _slopes(mbs: Any, solver: Any, index: int, item: Mapping[str, Any], offset: np.ndarray) -> np.ndarray:
    """dg/du (k, m) of the constraints by each component of an offset, by central differences."""
    item_index, key = exu.ObjectIndex(index), "offsetUserFunction_t" if _is_of_velocity(item) else "offsetUserFunction"
    single = item["objectType"] == "ConnectorCoordinate"
    slopes = []
    try:
        for unit in UNIT * np.eye(_OFFSETS[item["objectType"]]):
            ends = []
            for sign in (1, -1):
                moved = np.ravel(offset) + sign * unit
                mbs.SetObjectParameter(item_index, key, _constant(float(moved[0]) if single else list(moved)))
                ends.append(residuals(mbs, solver))
            slopes.append((ends[0] - ends[1]) / (2 * UNIT))
    finally:
        mbs.SetObjectParameter(item_index, key, item[key])
    return np.array(slopes)


def _constant(value: Any) -> Callable[..., Any]:
    return lambda *_: value


def _motion(item: str, rows: np.ndarray, offset: Callable[[float], np.ndarray], of_velocity: bool) -> PrescribedMotion:
    """Motion by the components of an offset that move anything."""
    moving = np.flatnonzero(np.any(rows, axis=1))
    first = offset(0.0)[moving]
    speed = functools.lru_cache(KEPT)(lambda t: offset(t)[moving]) if of_velocity else None
    value = functools.lru_cache(KEPT)(_Integral(speed) if speed else lambda t: offset(t)[moving] - first)
    return PrescribedMotion(item, rows[moving], value, _time_scale(speed or value), speed)


def _time_scale(function: Callable[[float], np.ndarray]) -> float:
    """Largest change of a function over its fastest rate [s], among the sampled times up to which it is defined."""
    values = list[np.ndarray]()
    try:
        for t in SAMPLE_TIMES:
            values.append(function(t))
    except MultiPhiValueError:  # a run that goes as far says so
        pass
    rates = np.abs(np.diff(values, axis=0)) / np.diff(SAMPLE_TIMES[: len(values)])[:, None]
    fastest, change = np.max(rates, initial=0.0), np.max(np.ptp(values, axis=0), initial=0.0)
    return float(change / fastest) if fastest > 0 else 1.0


def _difference(function: Callable[[float], np.ndarray], t: float, step: float, order: int) -> np.ndarray:
    """Derivative of order 1 or 2; one-sided at t = 0, before which there was no motion."""
    first, stencils = (0, _AHEAD) if t < 2 * step else (-2, _AROUND)
    values = [weight * function(t + (first + k) * step) for k, weight in enumerate(stencils[order - 1]) if weight]
    return np.asarray(np.sum(values, axis=0) / step**order)


class _Integral:
    """Integral of a function (k,) from 0 to t, summed from one time to the next."""

    def __init__(self, function: Callable[[float], np.ndarray]) -> None:
        self._function = function
        self._times, self._values = [0.0], [np.zeros(len(function(0.0)))]

    def __call__(self, t: float) -> np.ndarray:
        k = max(bisect.bisect_right(self._times, t) - 1, 0)
        value = self._values[k] + self._between(self._times[k], float(t), HALVINGS)
        if t > self._times[k]:
            self._times.insert(k + 1, float(t))
            self._values.insert(k + 1, value)
        return value

    def _between(self, start: float, end: float, halvings: int) -> np.ndarray:
        """Gauss quadrature, halved until both halves agree with the whole."""
        middle = (start + end) / 2
        whole, size = self._gauss(start, end)
        halves = self._gauss(start, middle)[0] + self._gauss(middle, end)[0]
        if not halvings or np.all(np.abs(halves - whole) <= INTEGRATED * size):
            return halves
        return self._between(start, middle, halvings - 1) + self._between(middle, end, halvings - 1)

    def _gauss(self, start: float, end: float) -> tuple[np.ndarray, np.ndarray]:
        """The integral, and that of the absolute values."""
        half = (end - start) / 2
        values = np.array([self._function(start + half * (1 + node)) for node in _NODES])
        return half * (_WEIGHTS @ values), abs(half) * (_WEIGHTS @ np.abs(values))
