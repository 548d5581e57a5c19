"""Runs one model of a scene, and times it; a failure is a run with its cause, not an exception.

Offline is what is done once for any start: discretisation, linearisation, modes, and here the static
start. Online leads from the start to the histories of points and gaps. A reduced model builds a level
when it first visits it, so its first run is longer than its repeats; both are kept.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from typing import Any, TypeVar

import numpy as np

from multiphi_exudyn.errors import MultiPhiError
from multiphi_exudyn.model import MultiPhiModel
from multiphi_exudyn.simulate import simulate
from multiphi_exudyn.study.runs import ModelRun
from multiphi_exudyn.study.scene_file import DisplacedStart, FullModel, ReducedModel, UserObjectModel
from multiphi_exudyn.study.workbench import Workbench, damping_matrix, start_configuration
from multiphi_exudyn.trajectory import Trajectory
from reference_models.full_beam import FullRun

__all__ = ["label_of", "run_model"]

T = TypeVar("T")

REPEATS = 7  # of a model's online part, as far as they fit
REPEAT_BUDGET_S = 2.0  # s; a run that takes longer is timed once
ENERGY_INTERVAL = 1e-3  # s, between samples of the energy


def run_model(bench: Workbench, name: str, progress: bool = True) -> ModelRun:
    """Run the scene's model ``name``; a failed run has status "failed" and its cause."""
    spec = bench.scene.models[name]
    try:
        if isinstance(spec, FullModel):
            return _run_full(bench, spec, progress)
        if isinstance(spec, UserObjectModel):
            return _run_user_object(bench, spec)
        return _run_reduced(bench, spec)
    except (MultiPhiError, ArithmeticError, RuntimeError, ValueError) as error:
        cause = " ".join(str(error).split())
        return ModelRun(name, spec.kind, label_of(bench, spec), status="failed", message=cause)


def label_of(bench: Workbench, spec: ReducedModel | UserObjectModel | FullModel) -> str:
    """How tables and figures call a model."""
    if isinstance(spec, FullModel):
        kind = "ANCF" if spec.beam == "ancf" else "geometrically exact"
        return f"full Exudyn beam, {kind}, {spec.elements} elements, step {spec.step * 1e6:g} µs"
    rigid = all(contact.rigid for contact in bench.contacts(spec.contact == "rigid"))
    levels = f"{'rigid' if rigid else 'compliant'} levels, r = {spec.modes}"
    if isinstance(spec, UserObjectModel):
        return f"Exudyn user object, {levels}, step {spec.step * 1e6:g} µs"
    return f"Multi-Phi, {levels}"


def _repeated(run: Callable[[], tuple[T, float]]) -> tuple[T, float, tuple[float, ...]]:
    """Of a run that gives (result, seconds): the first result, its time, and the times of the repeats."""
    result, first = run()
    repeats: list[float] = []
    while len(repeats) < REPEATS and first + sum(repeats) < REPEAT_BUDGET_S:
        repeats.append(run()[1])
    return result, first, tuple(repeats)


def _timed(run: Callable[[], T]) -> tuple[T, float]:
    started = time.perf_counter()
    result = run()
    return result, time.perf_counter() - started


def _run_reduced(bench: Workbench, spec: ReducedModel) -> ModelRun:
    (model, start), building = _timed(lambda: _reduced_start(bench, spec))
    trajectory, first, repeats = _repeated(
        lambda: _timed(lambda: simulate(model, bench.t_end, displacement=start))
    )
    run = ModelRun(
        name=spec.name,
        kind=spec.kind,
        label=label_of(bench, spec),
        dofs=trajectory.segments[0].level.level.modes if trajectory.segments else 0,
        status=trajectory.status,
        message=trajectory.message,
        steps=len(trajectory.events),
        offline_s=bench.structure_s + building,
        first_s=first,
        repeats_s=repeats,
    )
    return replace(run, **_sampled(bench, trajectory)) if run.ok else run


def _reduced_start(bench: Workbench, spec: ReducedModel) -> tuple[MultiPhiModel, np.ndarray]:
    model = bench.model(spec)
    return model, start_configuration(bench, model)


def _sampled(bench: Workbench, trajectory: Trajectory) -> dict[str, Any]:
    """The fields of a ModelRun that a trajectory gives."""
    contacts = [contact.name for contact in trajectory.model.contacts]

    def histories() -> dict[str, Any]:
        points = {name: trajectory.at(name, bench.time) for name in bench.points}
        return {"points": points, "gaps": {name: trajectory.gap(name, bench.time) for name in contacts}}

    fields, elapsed = _timed(histories)
    energy_time = np.linspace(0.0, bench.t_end, round(bench.t_end / ENERGY_INTERVAL) + 1)
    ledger = trajectory.ledger
    return fields | {
        "time": bench.time,
        "contact_force": {name: trajectory.contact_force(name, bench.time) for name in contacts},
        "contact_intervals": {name: _intervals(trajectory.contact_intervals(name)) for name in contacts},
        "impulse": {name: trajectory.contact_impulse(name, 0.0, bench.t_end) for name in contacts},
        "energy_time": energy_time,
        "energy": trajectory.energy(energy_time),
        "ledger": asdict(ledger) | {"residual": ledger.residual},
        "sampling_s": elapsed,
    }


def _run_full(bench: Workbench, spec: FullModel, progress: bool) -> ModelRun:
    beam = bench.full_beam(spec)
    damping = damping_matrix(replace(beam.structure, damping=bench.mechanics.damping))
    measured_at, displacement = _start_displacement(bench)

    def solve() -> tuple[FullRun, float]:
        result = beam.run(
            bench.t_end,
            load_at=bench.scene.file.start.load_at,
            measured_at=measured_at,
            displacement=displacement,
            damping=damping,
            progress=progress,
        )
        return result, result.online_s

    result, first, repeats = _repeated(solve)
    run = ModelRun(
        name=spec.name,
        kind=spec.kind,
        label=label_of(bench, spec),
        dofs=result.dofs,
        status=result.status,
        message=result.message,
        steps=result.steps,
        offline_s=result.offline_s,
        first_s=first,
        repeats_s=repeats,
    )
    return replace(run, **_of_full(bench, result)) if run.ok else run


def _of_full(bench: Workbench, result: FullRun) -> dict[str, Any]:
    """The fields of a ModelRun that a full run gives."""
    balance = result.balance
    assert balance is not None, "a run that is ok has a balance"
    return {
        "time": bench.time,
        "points": {name: result.points[name] for name in bench.points},
        "gaps": result.gaps,
        "contact_force": result.contact_force,
        "contact_intervals": {name: _intervals(given) for name, given in result.contact_intervals.items()},
        "impulse": {
            name: float(np.trapezoid(force, result.time)) for name, force in result.contact_force.items()
        },
        "energy_time": result.energy_time,
        "energy": result.energy,
        "ledger": {
            "initial": balance.initial,
            "damping": balance.dissipated,
            "final": balance.final,
            "residual": balance.initial - balance.dissipated - balance.final,
            "worst_gain": balance.worst_gain * balance.initial,
        },
    }


def _start_displacement(bench: Workbench) -> tuple[str, float]:
    """(point, displacement [m]) that the full model's static load has to reach."""
    start = bench.scene.file.start
    if isinstance(start, DisplacedStart):
        return start.measured_at, start.displacement
    model = MultiPhiModel(bench.structure, bench.contacts(rigid=False))
    return start.load_at, float(bench.structure.row(start.load_at) @ start_configuration(bench, model))


def _intervals(given: Sequence[tuple[float, float]]) -> np.ndarray:
    return np.array(given, dtype=float).reshape(-1, 2)
