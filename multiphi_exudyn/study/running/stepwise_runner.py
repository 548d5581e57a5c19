"""Runs the reduced equations of a Multi-Phi model through scipy's solve_ivp.

A step size control that is asked for too little can feed energy to the highest modes; such a run has failed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from multiphi_exudyn.study.running.energy_gain import energy_gain
from multiphi_exudyn.study.running.reduced_runner import ENERGY_INTERVAL, modes_words
from multiphi_exudyn.study.running.runs import How, ModelRun, interval_array
from multiphi_exudyn.study.running.timing import repeated, timed
from multiphi_exudyn.study.scene.model_kinds import StepwiseModel
from multiphi_exudyn.study.scene.workbench import Workbench, start_configuration
from reference_models.stepwise import StepwiseHistories, StepwiseRun, solve_stepwise

__all__ = ["run_stepwise", "sampled", "stepwise_label"]


def stepwise_label(bench: Workbench, spec: StepwiseModel) -> str:
    """How tables and figures call it."""
    return f"solve_ivp, {spec.method}, rtol {spec.rtol:g}, compliant levels, {modes_words(spec.modes)}"


def run_stepwise(bench: Workbench, spec: StepwiseModel, label: str, how: How) -> ModelRun:
    """Start, integrate, sample."""
    model = bench.model(spec)
    start, building = timed(lambda: start_configuration(bench, model))

    def solve() -> StepwiseRun:
        return solve_stepwise(model, bench.t_end, start, method=spec.method, rtol=spec.rtol)

    solved, first, repeats = repeated(lambda: timed(solve), bench.repeats)
    run = ModelRun(
        name=spec.name,
        kind=spec.kind,
        label=label,
        dofs=solved.segments[0].level.level.modes,
        status="failed" if solved.message else "ok",
        message=solved.message,
        steps=solved.steps,
        offline_s=bench.structure_s + building,
        first_s=first,
        repeats_s=repeats,
    )
    return sampled(bench, run, solved.histories, solved.contact_intervals) if run.ok else run


def sampled(
    bench: Workbench,
    run: ModelRun,
    histories_of: Callable[[Sequence[str], np.ndarray], StepwiseHistories],
    intervals_of: Callable[[str], list[tuple[float, float]]],
) -> ModelRun:
    """A run of a method with steps with its histories, or failed for an energy gain.

    histories_of: points at times (k,) [s]; intervals_of: when a contact is closed [s].
    """
    histories, sampling = timed(lambda: histories_of(bench.points, bench.time))
    energy_time = np.linspace(0.0, bench.t_end, round(bench.t_end / ENERGY_INTERVAL) + 1)
    energy = histories_of((), energy_time).energy
    gained = energy_gain(energy_time, energy)
    if gained:
        return replace(run, status="failed", message=gained)
    forces = histories.contact_force
    fields: dict[str, Any] = {
        "time": bench.time,
        "points": histories.points,
        "gaps": histories.gaps,
        "contact_force": forces,
        "contact_intervals": {name: interval_array(intervals_of(name)) for name in forces},
        "impulse": {name: float(np.trapezoid(force, bench.time)) for name, force in forces.items()},
    }
    return replace(run, energy_time=energy_time, energy=energy, sampling_s=sampling, **fields)
