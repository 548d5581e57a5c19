"""Runs a Craig-Bampton component with contact elements inside Exudyn.

The start is that of the linear model, projected on the component: exact where the load acts on an interface point.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from multiphi_exudyn.levels.model import MultiPhiModel
from multiphi_exudyn.study.running.energy_gain import energy_gain
from multiphi_exudyn.study.running.runs import How, ModelRun, interval_array
from multiphi_exudyn.study.running.timing import repeated, timed
from multiphi_exudyn.study.scene.model_kinds import CraigBamptonModel
from multiphi_exudyn.study.scene.workbench import Workbench, start_configuration
from reference_models.craig_bampton import CraigBampton, craig_bampton
from reference_models.craig_bampton_run import (
    CraigBamptonRun,
    CraigBamptonSettings,
    interface_contacts,
    solve_craig_bampton,
)
from reference_models.full_run import closed_intervals
from reference_models.point_contact import PointContact

__all__ = ["craig_bampton_label", "run_craig_bampton"]

FINER = 10  # samples of a gap for each recorded one, between which its crossings are interpolated


@dataclass(frozen=True)
class _Task:
    """Component, contacts, start q (b + m,), and the strain energy [J] that projecting the start has dropped."""

    component: CraigBampton
    contacts: tuple[PointContact, ...]
    start: np.ndarray
    dropped: float


def craig_bampton_label(bench: Workbench, spec: CraigBamptonModel) -> str:
    """How tables and figures call it."""
    given = bench.scene.file.start
    start = "" if given is None or given.load_at in bench.interface else ", start projected"
    reduced = f"{len(bench.interface)} interface points + {spec.modes} modes"
    return f"Craig-Bampton in Exudyn, {reduced}, step {spec.step * 1e6:g} µs{start}"


def run_craig_bampton(bench: Workbench, spec: CraigBamptonModel, label: str, how: How) -> ModelRun:
    """Reduce, solve, sample; a run that gains energy has failed, as a full one has."""
    task, building = timed(lambda: _task(bench, spec))
    settings = CraigBamptonSettings(
        spec.step, spec.newton_tolerance, spec.spectral_radius, output_step=bench.scene.file.outputs.interval
    )

    def solve() -> tuple[CraigBamptonRun, float]:
        result = solve_craig_bampton(task.component, task.contacts, task.start, bench.t_end, settings)
        return result, result.wall_s

    recorded, first, repeats = repeated(solve, bench.repeats)
    energy = _energy(task, recorded)
    message = recorded.cause or energy_gain(recorded.time, energy)
    run = ModelRun(
        name=spec.name,
        kind=spec.kind,
        label=label,
        dofs=task.component.dofs,
        status="failed" if message else "ok",
        message=message,
        steps=recorded.steps,
        offline_s=bench.structure_s + building,
        first_s=first,
        repeats_s=repeats,
    )
    if not run.ok:
        return run
    fields, sampling = timed(lambda: _histories(bench, task, recorded))
    ledger = {"truncation_strain": task.dropped}
    return replace(run, energy_time=recorded.time, energy=energy, ledger=ledger, sampling_s=sampling, **fields)


def _task(bench: Workbench, spec: CraigBamptonModel) -> _Task:
    contacts = bench.contacts(rigid=False)
    component = craig_bampton(bench.structure, bench.interface, spec.modes)
    x = start_configuration(bench, MultiPhiModel(bench.structure, contacts))
    start = component.coordinates(x)
    left = x - component.shapes @ start
    return _Task(component, interface_contacts(contacts), start, 0.5 * float(left @ (bench.structure.stiffness @ left)))


def _energy(task: _Task, recorded: CraigBamptonRun) -> np.ndarray:
    """Kinetic + strain energy (s,) [J], the contact springs included."""
    q, v, own = recorded.coordinates, recorded.velocities, task.component
    energy = 0.5 * np.einsum("ti,ti->t", v @ own.mass, v) + 0.5 * np.einsum("ti,ti->t", q @ own.stiffness, q)
    for contact in task.contacts:
        energy += contact.energy(contact.gap + contact.coefficient * q[:, own.interface.index(contact.point)])
    return energy


def _histories(bench: Workbench, task: _Task, recorded: CraigBamptonRun) -> dict[str, Any]:
    """The fields of a ModelRun that the recorded steps give, on the common grid."""
    motion = CubicHermiteSpline(recorded.time, recorded.coordinates, recorded.velocities)
    on_grid = motion(bench.time)
    points = {name: on_grid @ (bench.structure.row(name) @ task.component.shapes) for name in bench.points}
    fine = np.linspace(0.0, bench.t_end, FINER * (len(recorded.time) - 1) + 1)
    fields: dict[str, Any] = {"time": bench.time, "points": points}
    for contact in task.contacts:
        coordinate = task.component.interface.index(contact.point)
        gap = contact.gap + contact.coefficient * on_grid[:, coordinate]
        between = CubicHermiteSpline(
            recorded.time, recorded.coordinates[:, coordinate], recorded.velocities[:, coordinate]
        )
        fine_gap = contact.gap + contact.coefficient * between(fine)
        of_contact = {
            "gaps": gap,
            "contact_force": contact.force(gap),
            "contact_intervals": interval_array(closed_intervals(fine, fine_gap)),
            "impulse": float(np.trapezoid(contact.force(fine_gap), fine)),
        }
        for name, value in of_contact.items():
            fields.setdefault(name, {})[contact.name] = value
    return fields
