"""Runs a Multi-Phi model as a body inside Exudyn."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from multiphi_exudyn.exudyn_plugin import BodyHistories
from multiphi_exudyn.levels.model import MultiPhiModel
from multiphi_exudyn.levels.static_equilibrium import Equilibrium
from multiphi_exudyn.study.running.reduced_runner import level_words, printed_words
from multiphi_exudyn.study.running.runs import How, ModelRun, interval_array, way
from multiphi_exudyn.study.running.timing import repeated, timed
from multiphi_exudyn.study.scene.model_kinds import UserObjectModel
from multiphi_exudyn.study.scene.workbench import Workbench, start_of
from reference_models.body_alone import solve_body_alone

__all__ = ["body_label", "run_user_object"]


@dataclass(frozen=True)
class _Task:
    """What one run needs: model, start, number of steps."""

    model: MultiPhiModel
    start: Equilibrium
    steps: int


def body_label(bench: Workbench, spec: UserObjectModel) -> str:
    """How tables and figures call it."""
    levels = f"{level_words(bench, spec.rigid)}, r = {spec.modes}{printed_words(bench)}"
    return f"Exudyn user object, {levels}, step {spec.step * 1e6:g} µs"


def run_user_object(bench: Workbench, spec: UserObjectModel, label: str, how: How) -> ModelRun:
    """Add the body to an empty system, its modes matched to the step, and solve."""
    task, building = timed(lambda: _task(bench, spec))
    recorded, first, repeats = repeated(
        lambda: solve_body_alone(task.model, task.start, bench.t_end, task.steps, bench.points, loads=bench.loads),
        bench.repeats,
    )
    histories, sampling = timed(lambda: _histories(bench, recorded))
    return ModelRun(
        name=spec.name,
        kind=spec.kind,
        label=label,
        dofs=task.model.level(()).modes,
        steps=task.steps,
        offline_s=bench.structure_s + building,
        first_s=first,
        repeats_s=repeats,
        sampling_s=sampling,
        warnings=recorded.warnings,
        **histories,
    )


def _task(bench: Workbench, spec: UserObjectModel) -> _Task:
    model = bench.model(spec)
    steps = int(np.ceil(bench.t_end / spec.step * (1 - 1e-9)))
    return _Task(model, start_of(bench, model), steps)


def _histories(bench: Workbench, recorded: BodyHistories) -> dict[str, Any]:
    """The fields of a ModelRun that the body's sensors give, on the common grid, without force laws."""
    contacts = [contact.name for contact in bench.mechanics.contacts]
    points = {
        name: CubicHermiteSpline(recorded.time, values, recorded.velocities[name])(bench.time)
        for name, values in recorded.points.items()
    }
    return {
        "time": bench.time,
        "points": points,
        "gaps": {name: np.interp(bench.time, recorded.time, recorded.gaps[name]) for name in contacts},
        "contact_force": {
            name: np.interp(bench.time, recorded.time, recorded.contact_force[name]) for name in contacts
        },
        "contact_intervals": {name: interval_array(recorded.contact_intervals[name]) for name in contacts},
        "impulse": {name: _impulse(recorded, name) for name in contacts},
        "friction_force": _interpolated(bench, recorded, recorded.friction_force),
        "slip": _interpolated(bench, recorded, recorded.slip),
        "stick_intervals": dict(recorded.stick_intervals),
        "ledger": _ledger(bench, recorded),
    }


def _interpolated(bench: Workbench, recorded: BodyHistories, given: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    return {name: np.interp(bench.time, recorded.time, values) for name, values in given.items()}


def _ledger(bench: Workbench, recorded: BodyHistories) -> dict[str, float]:
    """What left at events, and what friction has taken on its ways, which turn between the samples at the earliest."""
    rows = ["impact", "truncation_kinetic", "truncation_strain", *(["friction"] if recorded.slip else [])]
    lost = {row: float(sum(getattr(event.loss, row) for event in recorded.events)) for row in rows}
    for friction in bench.mechanics.frictions:
        lost["friction"] += friction.limit * way(recorded.slip[friction.name])
    for contact in bench.mechanics.contacts:
        if contact.friction:
            lost["friction"] += float(np.trapezoid(recorded.friction_force[contact.name], recorded.slip[contact.name]))
    return lost


def _impulse(recorded: BodyHistories, contact: str) -> float:
    """Of the recorded force by the trapezoidal rule, and of the impacts [N s]."""
    struck = sum(event.impulse for event in recorded.events if event.contact == contact)
    return float(np.trapezoid(recorded.contact_force[contact], recorded.time) + struck)
