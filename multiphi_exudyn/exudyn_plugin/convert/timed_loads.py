"""What of an Exudyn system acts by user functions of time: p(t) = rows^T u(t).

u (k,) [N, N m] what the user function of a load returns, one number or a vector, if it is one of time alone; rows
(k, n_full) the generalised force of a unit of each component at the current state. Of the force f(t, q, q') of an
ObjectGenericODE2 u is how it changes with time where the system stands, f(t, q_0, v_0) - f(t_0, q_0, v_0).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import exudyn as exu
import numpy as np

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.exudyn_plugin.convert.geometric_stiffness import generalised_forces, static_solver
from multiphi_exudyn.exudyn_plugin.convert.items import user_function, value_key
from multiphi_exudyn.mechanics.loads import FunctionLoad

__all__ = ["TimedLoad", "function_loads", "timed_forces", "timed_loads"]

TRIED = np.concatenate(
    [[0.0], np.geomspace(1e-6, 1e3, 64)]
)  # s after the reduction: at which forces are seen to change
MOST = 30  # components of one force that change with time: each is a load of its own


@dataclass(frozen=True, eq=False)
class TimedLoad:
    """A load by a function of time: rows (k, n_full), value: u (k,) of the time t [s] since the reduction."""

    rows: np.ndarray
    value: Callable[[float], np.ndarray]


def timed_loads(mbs: Any, loads: Sequence[Mapping[str, Any]], start: float) -> dict[int, TimedLoad | str]:
    """Loads by user functions, by index, or why one is none of time alone; t = 0 is the time ``start`` [s].

    The user functions have to be switched off.
    """
    known = _NoSystem(dict(mbs.variables))
    found = {i: _value(load, start, known) for i, load in enumerate(loads) if user_function(load)}
    return {i: value if isinstance(value, str) else TimedLoad(_rows(mbs, i), value) for i, value in found.items()}


def timed_forces(mbs: Any, objects: Sequence[Mapping[str, Any]], start: float) -> dict[int, TimedLoad]:
    """What changes with time of the forces of ObjectGenericODE2, by index; t = 0 is the time ``start`` [s]."""
    known = _NoSystem(dict(mbs.variables))
    found = {
        i: _changing(mbs, i, item["forceUserFunction"]["function"], start, known)
        for i, item in enumerate(objects)
        if item["objectType"] == "GenericODE2" and item["forceUserFunction"]
    }
    return {i: force for i, force in found.items() if force}


def _changing(mbs: Any, index: int, function: Any, start: float, known: _NoSystem) -> TimedLoad | None:
    """The components that change; None for none, for too many, and for a function that reads more of the system."""
    own = mbs.systemData.GetObjectLTGODE2(exu.ObjectIndex(index))
    q, q_t = mbs.systemData.GetODE2Coordinates(), mbs.systemData.GetODE2Coordinates_t()

    def force(t: float) -> np.ndarray:
        return np.array(function(known, start + float(t), index, list(q[own]), list(q_t[own])), dtype=float)

    try:
        tried = np.array([force(t) for t in TRIED])
    except Exception:  # whatever the user's function raises: the force is taken as it is at present
        return None
    moving = np.flatnonzero(np.any(tried != tried[0], axis=0))
    if not 0 < len(moving) <= MOST:
        return None
    return TimedLoad(np.eye(len(q))[np.array(own)[moving]], lambda t: (force(t) - tried[0])[moving])


def function_loads(timed: TimedLoad, basis: np.ndarray) -> Iterator[FunctionLoad]:
    """One load for each component that moves the structure."""
    for k, row in enumerate(timed.rows):
        if np.any(row @ basis):
            yield FunctionLoad(row @ basis, _component(timed.value, k))


def _component(value: Callable[[float], np.ndarray], k: int) -> Callable[[Any], float]:
    return lambda t: float(value(t)[k])


def _value(load: Mapping[str, Any], start: float, known: _NoSystem) -> Callable[[float], np.ndarray] | str:
    """u(t), or why it is none of time alone."""
    present, held = load[value_key(load)], load[user_function(load)]
    if held["type"] != "Python":
        return f"its user function is of type {held['type']}, need Python"
    function, size = held["function"], np.size(present)

    def value(t: float) -> np.ndarray:
        return np.array(function(known, start + float(t), present), dtype=float).reshape(size)

    try:
        value(0.0)
    except Exception as error:  # whatever the user's function raises
        return f"its user function depends on more than time ({' '.join(str(error).split())})"
    return value


class _NoSystem:
    """What a load's user function gets instead of the system, which is not there in the model's run.

    variables: what the system's are at the reduction.
    """

    def __init__(self, variables: dict[str, Any]) -> None:
        self.variables = variables

    def __getattr__(self, name: str) -> Any:
        raise MultiPhiValueError(f"it reads mbs.{name}")


def _rows(mbs: Any, index: int) -> np.ndarray:
    """Generalised force (k, n_full) of a unit of each component of a load whose present value is zero."""
    load = exu.LoadIndex(index)
    key = value_key(mbs.GetLoad(load))
    nothing = mbs.GetLoad(load)[key]
    with static_solver(mbs) as solver:
        without = generalised_forces(mbs, solver)
        try:
            rows = []
            for unit in np.eye(np.size(nothing)):
                mbs.SetLoadParameter(load, key, unit if np.ndim(nothing) else 1.0)
                rows.append(generalised_forces(mbs, solver) - without)
        finally:
            mbs.SetLoadParameter(load, key, nothing)
    return np.array(rows)
