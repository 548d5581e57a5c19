"""SolveDynamic with Multi-Phi bodies: their requirements on the solver are checked before it starts.

Exudyn wraps an error that a body raises during a run in an error about user functions. Therefore SolveDynamic checks
beforehand, as a method of the system and as a function of Exudyn's modules, and so does the explicit solver when it is
called itself; errors of bodies during a run are raised without Exudyn's wrapping. Any run of the implicit solver in
which the bodies were not called up to its end raises an error at its end. A static solution is repeated until the
levels of the bodies agree with it (static_solution.py).
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
from multiphi_exudyn.exudyn_plugin.body.solver.run_checks import check_integration
from multiphi_exudyn.exudyn_plugin.body.solver.static_solution import solve_static
from multiphi_exudyn.exudyn_plugin.body.solver.switching import BODIES, check_solver

__all__ = ["install_checks"]

IMPLICIT = (exu.DynamicSolverType.GeneralizedAlpha, exu.DynamicSolverType.TrapezoidalIndex2)
_CHECKED = "_multiPhiChecked"  # attribute of a function that already checks


def install_checks() -> None:
    """Make Exudyn's SolveDynamic check the requirements of Multi-Phi bodies; other systems are solved as before."""
    for owner in (exu.MainSystem, exu, exu.solver):
        present = owner.SolveDynamic
        if not hasattr(present, _CHECKED):
            owner.SolveDynamic = _with_check(present)
    for solver, wrapper in (
        (exu.MainSolverImplicitSecondOrder, _with_end_check),
        (exu.MainSolverExplicit, _with_refusal),
        (exu.MainSolverStatic, _with_levels),
    ):
        if not hasattr(solver.SolveSystem, _CHECKED):
            solver.SolveSystem = wrapper(solver.SolveSystem)


def _with_check(solve: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(solve)
    def solve_dynamic(
        mbs: Any, simulationSettings: Any = None, solverType: Any = None, *arguments: Any, **keywords: Any
    ) -> Any:
        bodies = mbs.variables.get(BODIES)
        if bodies is not None and bodies.is_installed(mbs):
            settings = exu.SimulationSettings() if simulationSettings is None else simulationSettings
            kind = settings.timeIntegration.solverType if solverType is None else solverType
            check_solver(kind in IMPLICIT, kind.name, bodies)
            for body in bodies.values():
                check_integration(body, settings, trapezoidal=kind == exu.DynamicSolverType.TrapezoidalIndex2)
        with _unwrapped_errors():
            return solve(mbs, simulationSettings, solverType, *arguments, **keywords)

    setattr(solve_dynamic, _CHECKED, True)
    return solve_dynamic


def _with_end_check(solve: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(solve)
    def solve_system(solver: Any, mbs: Any, *arguments: Any, **keywords: Any) -> Any:
        bodies = mbs.variables.get(BODIES)
        if bodies is None:
            return solve(solver, mbs, *arguments, **keywords)
        bodies.begin_run()
        try:
            with _unwrapped_errors():
                result = solve(solver, mbs, *arguments, **keywords)
        except BaseException:
            bodies.clock.next_time = -math.inf
            raise
        if solver.output.finishedSuccessfully:
            bodies.check_called(solver.it.currentTime)
            if not bodies.is_required:  # linear bodies are not called
                settings = arguments[0] if arguments else keywords["simulationSettings"]
                bodies.take_steps(
                    solver.it.currentTime - settings.timeIntegration.startTime, solver.it.currentStepIndex
                )
        return result

    setattr(solve_system, _CHECKED, True)
    return solve_system


def _with_levels(solve: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(solve)
    def solve_system(solver: Any, mbs: Any, *arguments: Any, **keywords: Any) -> Any:
        bodies = mbs.variables.get(BODIES)
        if bodies is None or not bodies.is_required:
            return solve(solver, mbs, *arguments, **keywords)

        def solve_once() -> bool:
            bodies.begin_run()
            done = bool(solve(solver, mbs, *arguments, **keywords))
            if done:
                bodies.check_called(solver.it.currentTime)
            return done

        with _unwrapped_errors():
            done = solve_static(solve_once, bodies.values())
        if done:
            bodies.warn()
        return done

    setattr(solve_system, _CHECKED, True)
    return solve_system


def _with_refusal(solve: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(solve)
    def solve_system(solver: Any, mbs: Any, *arguments: Any, **keywords: Any) -> Any:
        bodies = mbs.variables.get(BODIES)
        if bodies is not None and bodies.is_installed(mbs):
            check_solver(False, type(solver).__name__, bodies)
        return solve(solver, mbs, *arguments, **keywords)

    setattr(solve_system, _CHECKED, True)
    return solve_system


@contextmanager
def _unwrapped_errors() -> Iterator[None]:
    """Raise errors of bodies in user functions without Exudyn's error around them."""
    try:
        yield
    except Exception as error:
        if isinstance(error.__cause__, MultiPhiError):
            raise error.__cause__ from None
        raise
