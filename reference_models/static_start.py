"""Static start: the force along z at one point under which another deflects as far as asked.

The force is found by the secant method on the nonlinear static solution, contacts included, from the
linear contact-free guess; the solution becomes the system's initial state and the force is taken off. The force has
grown slowly, and friction carries what that leaves in its bristle.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import exudyn as exu
import numpy as np

from multiphi_exudyn.errors import NumericalFailure
from reference_models.beam_system import BeamSystem

__all__ = ["static_start"]

DEFLECTION_TOLERANCE = 1e-9  # of the deflection asked for
SECANT_STEPS = 40  # a contact that closes on the way takes half a dozen


def static_start(
    system: BeamSystem, coordinate: int, deflection: float, guess: float, simulation_settings: Any
) -> float:
    """Make the static solution the initial state and return its force [N].

    coordinate: index of the ODE2 coordinate that is to take the value ``deflection`` [m]; guess: force [N].
    Raises NumericalFailure where the static solver or the secant method does not converge.
    """
    initial = exu.ConfigurationType.Initial
    straight = system.mbs.systemData.GetSystemState(initial)

    def miss(force: float) -> float:
        system.mbs.systemData.SetSystemState(straight, initial)
        return _deflection(system, coordinate, force, simulation_settings) - deflection

    for connector in system.frictions:
        connector.pull_slowly(system.mbs)
    force = _secant(miss, guess, -deflection, DEFLECTION_TOLERANCE * abs(deflection))
    for connector in system.frictions:
        connector.let_go(system.mbs)
    system.mbs.SetLoadParameter(system.load, "load", 0.0)
    return force


def _deflection(system: BeamSystem, coordinate: int, force: float, simulation_settings: Any) -> float:
    system.mbs.SetLoadParameter(system.load, "load", force)
    try:
        system.mbs.SolveStatic(simulation_settings, updateInitialValues=True)
    except exu.SolverError as error:
        cause = system.mbs.sys["staticSolver"].GetErrorString() or str(error)
        raise NumericalFailure(f"static start: {cause.strip()} at a force of {force:g} N") from error
    return float(system.mbs.systemData.GetODE2Coordinates()[coordinate])


def _secant(miss: Callable[[float], float], guess: float, miss_at_zero: float, tolerance: float) -> float:
    last, last_miss, force = 0.0, miss_at_zero, guess
    for _ in range(SECANT_STEPS):
        missed = miss(force)
        if abs(missed) <= tolerance:
            return force
        if not np.isfinite(missed) or missed == last_miss:
            break
        last, last_miss, force = force, missed, force - missed * (force - last) / (missed - last_miss)
    raise NumericalFailure(f"static start: no force found, {missed:g} m off at {force:g} N")
