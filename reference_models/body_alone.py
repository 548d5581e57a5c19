"""A Multi-Phi body alone in an Exudyn system: the same question as the native run, answered by Exudyn's solver."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import exudyn as exu
import numpy as np

from multiphi_exudyn.errors import MultiPhiError, NumericalFailure
from multiphi_exudyn.exudyn_plugin import BodyHistories, CreateMultiPhiBody, body_histories
from multiphi_exudyn.levels.equilibrium.static_equilibrium import Equilibrium
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mechanics.loads import Load
from reference_models.exudyn_quiet import cpu_limit, quiet
from reference_models.solver_settings import fixed_steps

__all__ = ["solve_body_alone"]


def solve_body_alone(
    model: MultiPhiModel,
    start: np.ndarray | Equilibrium | None,
    t_end: float,
    steps: int,
    points: Sequence[str],
    *,
    velocity: np.ndarray | None = None,
    loads: Sequence[Load] = (),
    matched: bool = True,
    cpu_limit_s: float | None = None,
) -> tuple[BodyHistories, float]:
    """Histories of the body released from ``start``, with ``velocity``, x' (n,), and the solver's CPU time [s].

    start: x (n,), or an equilibrium. steps: equal trapezoidal steps from 0 to t_end [s]; the body's modes are
    ``matched`` to them or left as they are.
    points: names recorded. Raises NumericalFailure where the CPU limit stops the solver.
    """
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    step = t_end / steps if matched else None
    with quiet(), cpu_limit(cpu_limit_s):
        still, x = (start, None) if isinstance(start, Equilibrium) else (None, start)
        items = CreateMultiPhiBody(mbs, model, "body", x, velocity, loads, matchedStepSize=step, start=still)
        mbs.Assemble()
        settings = _simulation_settings(t_end, steps)
        started = time.process_time()
        try:
            mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.TrapezoidalIndex2)
        except Exception as error:  # Exudyn's own, around what a user function of the body has raised
            if isinstance(error.__cause__, MultiPhiError):
                raise error.__cause__ from None
            raise
        elapsed = time.process_time() - started
        if mbs.sys["dynamicSolver"].output.simulationTimeout:
            raise NumericalFailure(f"CPU limit of {cpu_limit_s:g} s reached")
    return body_histories(mbs, items, points), elapsed


def _simulation_settings(t_end: float, steps: int) -> Any:
    settings = fixed_steps(t_end, steps, write_period=t_end / steps)
    settings.timeIntegration.newton.useModifiedNewton = True
    settings.timeIntegration.reuseConstantMassMatrix = True
    return settings
