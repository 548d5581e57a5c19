"""Loads of an Exudyn system by user functions of time alone: p(t) = rows^T u(t).

u (k,) [N, N m] what the user function returns, one number or a vector, rows (k, n_full) the generalised force of a unit
of each component at the current state.
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

__all__ = ["TimedLoad", "function_loads", "timed_loads"]


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
        return f"its user function is none of time alone ({' '.join(str(error).split())})"
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
