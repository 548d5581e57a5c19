"""Exudyn's solver settings: of a silent run in equal steps, and those that run a stiff beam against stiff contacts.

The latter run it fast, and are chosen by measurement: modified Newton unless asked otherwise (a full one costs four
times as much), contacts switched in up to five iterations inside a step, none of them asking for another step size, a
sparse factorisation whose pattern is reused. Nothing is written to a file.
"""

from __future__ import annotations

import math
from typing import Any

import exudyn as exu

from reference_models.full_beam_settings import FullBeamSettings

__all__ = ["fixed_steps", "simulation_settings"]

SMALLEST_STEP = 1 / 256  # of the step: an iteration that still fails there will not converge at all
STATIC_RELATIVE = 1e-8  # Newton tolerances of the static start; the absolute one, in N, lies above the
STATIC_ABSOLUTE = 1e-6  # round-off of an axial stiffness of 1e9 N/m
SWITCHES = 5  # contact iterations in a time step; one is not enough from 1e7 N/m on
STATIC_SWITCHES = 20  # in a static solution, where they are to end in the right state


def fixed_steps(t_end: float, steps: int, write_period: float | None = None) -> Any:
    """Settings of a run in equal steps from 0 to t_end [s] that prints nothing and writes no file.

    write_period: of sensors [s], None for Exudyn's own.
    """
    found = exu.SimulationSettings()
    found.timeIntegration.numberOfSteps = steps
    found.timeIntegration.endTime = t_end
    found.timeIntegration.verboseMode = 0
    found.solution.file.write = False
    if write_period is not None:
        found.solution.sensors.writePeriod = write_period
    return found


def simulation_settings(settings: FullBeamSettings, t_end: float) -> Any:
    """Settings of a static start and of a dynamic run of t_end [s]."""
    found = exu.SimulationSettings()
    found.solution.file.write = False
    found.linearSolver.solverType = exu.LinearSolverType.EigenSparse
    found.linearSolver.reuseAnalyzedPattern = True
    _set_dynamic(found.timeIntegration, settings, t_end)
    _set_static(found.staticSolver)
    return found


def _set_dynamic(integration: Any, settings: FullBeamSettings, t_end: float) -> None:
    integration.endTime = t_end
    integration.numberOfSteps = max(1, math.ceil(t_end / settings.step - 1e-6))
    integration.minimumStepSize = settings.step * SMALLEST_STEP
    integration.verboseMode = 0
    integration.generalizedAlpha.spectralRadius = settings.spectral_radius
    integration.newton.useModifiedNewton = not settings.full_newton
    integration.newton.relativeTolerance = settings.newton_tolerance
    integration.newton.absoluteTolerance = settings.newton_tolerance
    _set_switching(integration.discontinuous, SWITCHES)


def _set_static(static: Any) -> None:
    static.numberOfLoadSteps = 1  # halved by the solver where one step is too much
    static.verboseMode = 0
    static.newton.relativeTolerance = STATIC_RELATIVE
    static.newton.absoluteTolerance = STATIC_ABSOLUTE
    _set_switching(static.discontinuous, STATIC_SWITCHES)


def _set_switching(discontinuous: Any, iterations: int) -> None:
    discontinuous.useRecommendedStepSize = False
    discontinuous.ignoreMaxIterations = True
    discontinuous.maxIterations = iterations
    discontinuous.iterationTolerance = 1.0
