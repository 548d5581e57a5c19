"""Motions that constraints prescribe by functions of time: q = q_0 + S z + e^T u(t).

    C e_k = -dg/du_k,   S^T M e_k = 0

u (k,) [m, rad] is the change of a constraint's offset since the reduction, e (k, n_full) the displacement of the system
by a unit of each component, g(q, t) the constraints and C their Jacobian. As e is orthogonal to S in the mass metric,
u'' does not act on z: the load of such a motion is p(t) = -S^T (K e^T u + C e^T u'), even where the speed u' jumps. An
offset on velocities is integrated over time.
"""

from __future__ import annotations

import bisect
import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import exudyn as exu
import numpy as np

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.exudyn_plugin.convert.items.directions import Directions
from multiphi_exudyn.exudyn_plugin.convert.items.items import is_active
from multiphi_exudyn.exudyn_plugin.convert.linearisation.constraints import residuals
from multiphi_exudyn.exudyn_plugin.convert.linearisation.timed_loads import (
    SAMPLE_TIMES,
    ReadsSystem,
    SystemPlaceholder,
    checked,
)
from multiphi_exudyn.mathematics.functions.piecewise_exponential import PiecewiseExponential
from multiphi_exudyn.mechanics.loads.loads import VaryingLoad
from multiphi_exudyn.mechanics.loads.time_functions import Smooth

__all__ = ["Component", "PrescribedMotion", "RateLoad", "check_offsets", "prescribed_motions"]

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
            _value(item, i, start, placeholder)


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
        present, value = _offset(item), _value(item, i, start, placeholder)
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


def _value(
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
