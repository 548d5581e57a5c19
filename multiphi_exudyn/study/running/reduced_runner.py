"""Runs a Multi-Phi model by itself, or one basis for all of its levels.

A level is built when it is first visited, so the first run is longer than its repeats; both are kept.
"""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import Any

import numpy as np

from multiphi_exudyn.levels.model import MultiPhiModel
from multiphi_exudyn.levels.static_equilibrium import Equilibrium
from multiphi_exudyn.mathematics.compiled import available, compile_entries
from multiphi_exudyn.study.running.runs import How, ModelRun, interval_array
from multiphi_exudyn.study.running.timing import repeated, timed
from multiphi_exudyn.study.scene.model_kinds import GlobalBasisModel, ReducedModel, TrainedBasisModel
from multiphi_exudyn.study.scene.workbench import Workbench, start_of
from multiphi_exudyn.time.simulate import simulate
from multiphi_exudyn.time.trajectory import Trajectory
from multiphi_exudyn.time.truncation import truncation_indicator
from reference_models.global_basis import global_basis
from reference_models.pod_basis import pod_basis

__all__ = [
    "ENERGY_INTERVAL",
    "global_label",
    "level_words",
    "modes_words",
    "printed_words",
    "reduced_label",
    "run_global_basis",
    "run_reduced",
    "run_trained_basis",
    "trained_label",
]

ENERGY_INTERVAL = 1e-3  # s, between samples of the energy
APART = 0.01  # of the motion, by which a run and a nudged one differ at the end of its horizon: what a reader sees


def level_words(bench: Workbench, rigid: bool) -> str:
    """Which levels a model has, as part of its label."""
    contacts = bench.contacts(rigid)
    if not contacts:
        return "levels of force laws" if bench.mechanics.force_laws else "levels of friction"
    return f"{'rigid' if all(contact.rigid for contact in contacts) else 'compliant'} levels"


def modes_words(modes: object) -> str:
    """How many modes a model has: "r = 12", "all modes"."""
    return "all modes" if modes == "all" else f"r = {modes}"


def printed_words(bench: Workbench) -> str:
    """That levels have printed frequencies, as part of a label."""
    return ", printed frequencies" if bench.overrides else ""


def reduced_label(bench: Workbench, spec: ReducedModel) -> str:
    """How tables and figures call it."""
    chosen = f"modes for a truncation error of {spec.tolerance:g}" if spec.tolerance else modes_words(spec.modes)
    return f"Multi-Phi, {level_words(bench, spec.rigid)}, {chosen}{printed_words(bench)}"


def global_label(bench: Workbench, spec: GlobalBasisModel) -> str:
    """How tables and figures call it."""
    return f"global basis, {level_words(bench, spec.rigid)}, r = {spec.modes} from each of two"


def run_reduced(bench: Workbench, spec: ReducedModel, label: str, how: How) -> ModelRun:
    """The model of a scene's entry from the scene's start; how.horizon: whether it is run once more, nudged."""
    (model, start), building = timed(lambda: _reduced_start(bench, spec))
    run, trajectory = _run(bench, spec, label, model, start, building, how)
    return replace(run, indicators=_indicators(bench, trajectory)) if run.ok else run


def run_global_basis(bench: Workbench, spec: GlobalBasisModel, label: str, how: How) -> ModelRun:
    """The structure projected on one basis, from its own static equilibrium; with all its modes exact in time."""
    (model, start), building = timed(lambda: _global_start(bench, spec))
    return _run(bench, spec, label, model, start, building, how)[0]


def trained_label(bench: Workbench, spec: TrainedBasisModel) -> str:
    """How tables and figures call it."""
    return f"POD basis of {spec.training:g} s, {level_words(bench, spec.rigid)}, r = {spec.modes}"


def run_trained_basis(bench: Workbench, spec: TrainedBasisModel, label: str, how: How) -> ModelRun:
    """The structure on a basis of snapshots; the training run is part of what is done offline."""
    (model, start), building = timed(lambda: _trained_start(bench, spec))
    return _run(bench, spec, label, model, start, building, how)[0]


def _run(
    bench: Workbench,
    spec: ReducedModel | GlobalBasisModel | TrainedBasisModel,
    label: str,
    model: MultiPhiModel,
    start: Equilibrium,
    building: float,
    how: How,
) -> tuple[ModelRun, Trajectory]:
    """Simulate and sample; steps are events, of which there are as many as the motion has."""

    def run_once() -> Trajectory:
        return simulate(model, bench.t_end, start=start, loads=bench.loads)

    if available():
        compile_entries()  # before the clock starts: a machine pays it once
    trajectory, first, repeats = repeated(lambda: timed(run_once), bench.repeats)
    run = ModelRun(
        name=spec.name,
        kind=spec.kind,
        label=label,
        dofs=trajectory.segments[0].level.level.modes if trajectory.segments else 0,
        status=trajectory.status,
        message=trajectory.message,
        steps=len(trajectory.events),
        offline_s=bench.structure_s + building,
        first_s=first,
        repeats_s=repeats,
        warnings=trajectory.warnings,
    )
    if not run.ok:
        return run, trajectory
    until = {f"{APART:g}": trajectory.horizon(APART)} if how.horizon else {}
    return replace(run, **_sampled(bench, trajectory), horizon_s=until), trajectory


def _indicators(bench: Workbench, trajectory: Trajectory) -> dict[str, float]:
    return {f"{until:g}": truncation_indicator(trajectory, until) for until in bench.windows}


def _reduced_start(bench: Workbench, spec: ReducedModel) -> tuple[MultiPhiModel, Equilibrium]:
    model = bench.model(spec)
    return model, start_of(bench, model)


def _global_start(bench: Workbench, spec: GlobalBasisModel) -> tuple[MultiPhiModel, Equilibrium]:
    contacts = bench.contacts(spec.rigid)
    assert spec.modes is not None, "filled in where the scene lists its models"
    projected = global_basis(bench.structure, contacts, spec.modes)
    model = MultiPhiModel(projected, bench.nonlinearities(spec.rigid), modes="all")
    return model, start_of(replace(bench, structure=projected), model)


def _trained_start(bench: Workbench, spec: TrainedBasisModel) -> tuple[MultiPhiModel, Equilibrium]:
    assert spec.modes is not None, "filled in where the scene lists its models"
    whole = MultiPhiModel(bench.structure, bench.nonlinearities(spec.rigid), modes="all")
    training = simulate(whole, min(spec.training, bench.t_end), start=start_of(bench, whole), loads=bench.loads)
    projected = pod_basis(training, spec.modes)
    model = MultiPhiModel(projected, bench.nonlinearities(spec.rigid), modes="all")
    return model, start_of(replace(bench, structure=projected), model)


def _sampled(bench: Workbench, trajectory: Trajectory) -> dict[str, Any]:
    """The fields of a ModelRun that a trajectory gives."""
    contacts = [contact.name for contact in bench.mechanics.contacts]
    frictions = bench.mechanics.rubbing

    def histories() -> dict[str, Any]:
        points = {name: trajectory.at(name, bench.time) for name in bench.points}
        return {"points": points, "gaps": {name: trajectory.gap(name, bench.time) for name in contacts}}

    fields, elapsed = timed(histories)
    energy_time = np.linspace(0.0, bench.t_end, round(bench.t_end / ENERGY_INTERVAL) + 1)
    ledger = trajectory.ledger
    return fields | {
        "time": bench.time,
        "contact_force": {name: trajectory.contact_force(name, bench.time) for name in contacts},
        "contact_intervals": {name: interval_array(trajectory.contact_intervals(name)) for name in contacts},
        "impulse": {name: trajectory.contact_impulse(name, 0.0, bench.t_end) for name in contacts},
        "friction_force": {name: trajectory.friction_force(name, bench.time) for name in frictions},
        "slip": {name: trajectory.slip(name, bench.time) for name in frictions},
        "stick_intervals": {name: trajectory.stick_intervals(name) for name in frictions},
        "energy_time": energy_time,
        "energy": trajectory.energy(energy_time),
        "ledger": asdict(ledger) | {"residual": ledger.residual},
        "sampling_s": elapsed,
    }
