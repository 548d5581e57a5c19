"""Loads and forces of an Exudyn system by user functions of time: p(t) = rows^T u(t).

u (k,) [N, N m] is the value of a load's user function, a number or a vector, if it depends on time alone; rows
(k, n_full) are the generalised forces of a unit of each component at the current state. For the force f(t, q, q') of an
ObjectGenericODE2, u is its change with time at the current state, f(t, q_0, v_0) - f(t_0, q_0, v_0).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import exudyn as exu
import numpy as np

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.exudyn_plugin.convert.items.items import user_function, value_key
from multiphi_exudyn.exudyn_plugin.convert.linearisation.geometric_stiffness import generalised_forces, static_solver
from multiphi_exudyn.mechanics.loads.loads import FunctionLoad
from multiphi_exudyn.mechanics.structures.arguments import is_real

__all__ = [
    "SAMPLE_TIMES",
    "ReadsSystem",
    "SystemPlaceholder",
    "TimedLoad",
    "checked",
    "function_loads",
    "timed_forces",
    "timed_loads",
]

SAMPLE_TIMES = np.concatenate(
    [[0.0], np.geomspace(1e-6, 1e3, 64)]
)  # s after the reduction: times at which forces are compared
MOST = 30  # components of one force that change with time: each becomes a load


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
