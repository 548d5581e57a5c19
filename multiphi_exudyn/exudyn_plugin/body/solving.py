"""SolveDynamic with Multi-Phi bodies: what they need of the solver is checked before it starts.

Inside a run Exudyn wraps what a body raises in an error of its own, which blames the user's functions. Called as a
method of the system or from Exudyn's modules, SolveDynamic checks before, and so does an explicit solver that is called
itself; what a body raises in a run comes out as it is. A run of the implicit solver, by SolveDynamic or not, in which
the bodies have not been called to its end raises then.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import exudyn as exu
import exudyn.solver

from multiphi_exudyn.errors import MultiPhiError
from multiphi_exudyn.exudyn_plugin.body.run_checks import check_integration
from multiphi_exudyn.exudyn_plugin.body.switching import BODIES, check_solver

__all__ = ["install_checks"]

IMPLICIT = (exu.DynamicSolverType.GeneralizedAlpha, exu.DynamicSolverType.TrapezoidalIndex2)
_CHECKED = "_multiPhiChecked"  # marks a function that checks already


def install_checks() -> None:
    """Let Exudyn's SolveDynamic check what Multi-Phi bodies need; systems without them are solved as before."""
    for place in (exu.MainSystem, exu, exu.solver):
        present = place.SolveDynamic
        if not hasattr(present, _CHECKED):
            place.SolveDynamic = _checked(present)
    for solver, watched in ((exu.MainSolverImplicitSecondOrder, _watched), (exu.MainSolverExplicit, _refused)):
        if not hasattr(solver.SolveSystem, _CHECKED):
            solver.SolveSystem = watched(solver.SolveSystem)


def _checked(solve: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(solve)
    def solve_dynamic(
        mbs: Any, simulationSettings: Any = None, solverType: Any = None, *given: Any, **named: Any
    ) -> Any:
        bodies = mbs.variables.get(BODIES)
        if bodies is not None and bodies.installed(mbs):
            settings = exu.SimulationSettings() if simulationSettings is None else simulationSettings
            kind = settings.timeIntegration.solverType if solverType is None else solverType
            check_solver(kind in IMPLICIT, kind.name, bodies)
            for body in bodies.values():
                check_integration(body, settings, trapezoidal=kind == exu.DynamicSolverType.TrapezoidalIndex2)
        with _own_errors():
            return solve(mbs, simulationSettings, solverType, *given, **named)

    setattr(solve_dynamic, _CHECKED, True)
    return solve_dynamic


def _watched(solve: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(solve)
    def solve_system(solver: Any, mbs: Any, *given: Any, **named: Any) -> Any:
        bodies = mbs.variables.get(BODIES)
        if bodies is None:
            return solve(solver, mbs, *given, **named)
        bodies.begin()
        try:
            with _own_errors():
                found = solve(solver, mbs, *given, **named)
        except BaseException:
            bodies.clock.next_time = -math.inf
            raise
        if solver.output.finishedSuccessfully:
            bodies.check_called(solver.it.currentTime)
        return found

    setattr(solve_system, _CHECKED, True)
    return solve_system


def _refused(solve: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(solve)
    def solve_system(solver: Any, mbs: Any, *given: Any, **named: Any) -> Any:
        bodies = mbs.variables.get(BODIES)
        if bodies is not None and bodies.installed(mbs):
            check_solver(False, type(solver).__name__, bodies)
        return solve(solver, mbs, *given, **named)

    setattr(solve_system, _CHECKED, True)
    return solve_system


@contextmanager
def _own_errors() -> Iterator[None]:
    """What a body raised in a user function of Exudyn, without Exudyn's error around it."""
    try:
        yield
    except Exception as error:
        if isinstance(error.__cause__, MultiPhiError):
            raise error.__cause__ from None
        raise
