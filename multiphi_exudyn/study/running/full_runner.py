"""Runs the full nonlinear beam."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from multiphi_exudyn.levels.model import MultiPhiModel
from multiphi_exudyn.mechanics.structure import damping_matrix
from multiphi_exudyn.study.running.runs import How, ModelRun, interval_array
from multiphi_exudyn.study.running.timing import repeated
from multiphi_exudyn.study.scene.model_kinds import FullModel
from multiphi_exudyn.study.scene.scene_file import DisplacedStart
from multiphi_exudyn.study.scene.workbench import Workbench, start_configuration
from reference_models.full_beam import FullBeam, FullRun
from reference_models.gentler import Attempt, attempts

__all__ = ["full_label", "run_full"]

STILL = 1e-6  # of the range of its way: a patch that moves less from sample to sample sticks


def full_label(bench: Workbench, spec: FullModel) -> str:
    """How tables and figures call it."""
    kind = "ANCF" if spec.beam == "ancf" else "geometrically exact"
    beam, each = ("beams", " each") if bench.mechanics.beam is None else ("beam", "")
    return f"full Exudyn {beam}, {kind}, {spec.elements} elements{each}, step {spec.step * 1e6:g} µs"


def run_full(bench: Workbench, spec: FullModel, label: str, how: How) -> ModelRun:
    """Run a full beam with the scene's damping on its own mesh; histories come on the common grid.

    how.retry: a run that fails is tried again at gentler settings (reference_models/gentler.py); its message then says
    at which, its time is that of all attempts.
    """
    beam = bench.full_beam(spec)
    damping = damping_matrix(replace(beam.structure, damping=bench.mechanics.damping))
    start, loads = _start(bench), bench.loads_on(beam)

    def solve(beam: FullBeam) -> FullRun:
        return beam.run(bench.t_end, damping=damping, loads=loads, progress=how.progress, **start)

    tried = attempts(beam, solve) if how.retry else [Attempt("as asked", solve(beam))]
    result, _, repeats = repeated(_after(tried[-1].run, lambda: solve(beam)), bench.repeats if len(tried) == 1 else 0)
    run = ModelRun(
        name=spec.name,
        kind=spec.kind,
        label=label,
        dofs=result.dofs,
        status=result.status,
        message=_message(tried),
        steps=result.steps,
        offline_s=result.offline_s,
        first_s=sum(attempt.run.online_s for attempt in tried),
        repeats_s=repeats,
    )
    return replace(run, **_of_full(bench, result)) if run.ok else run


def _after(first: FullRun, again: Callable[[], FullRun]) -> Callable[[], tuple[FullRun, float]]:
    """Gives the run there is already, then further ones, each with its time [s]."""
    runs = itertools.chain([first], iter(again, None))

    def run() -> tuple[FullRun, float]:
        result = next(runs)
        return result, result.online_s

    return run


def _message(tried: Sequence[Attempt]) -> str:
    """Of one attempt its own; of more, what was tried, and what made it run."""
    last = tried[-1]
    if len(tried) == 1:
        return last.run.message
    if last.run.status == "ok":
        return f"ran with gentler settings ({last.settings}); {'; '.join(attempt.told for attempt in tried[:-1])}"
    return f"failed with every setting; {'; '.join(attempt.told for attempt in tried)}"


def _of_full(bench: Workbench, result: FullRun) -> dict[str, Any]:
    """The fields of a ModelRun that a full run gives."""
    balance = result.balance
    assert balance is not None, "a run that is ok has a balance"
    return {
        "time": bench.time,
        "points": {name: result.points[name] for name in bench.points},
        "gaps": result.gaps,
        "contact_force": result.contact_force,
        "contact_intervals": {name: interval_array(given) for name, given in result.contact_intervals.items()},
        "impulse": {name: float(np.trapezoid(force, result.time)) for name, force in result.contact_force.items()},
        "friction_force": result.friction_force,
        "slip": result.slip,
        "stick_intervals": {name: _sticking(result.time, slip) for name, slip in result.slip.items()},
        "energy_time": result.energy_time,
        "energy": result.energy,
        "ledger": {
            "initial": balance.initial,
            "work_of_loads": balance.work,
            "damping": balance.dissipated,
            **({"friction": balance.friction} if result.slip else {}),
            "final": balance.final,
            "residual": balance.initial + balance.work - balance.dissipated - balance.friction - balance.final,
            "worst_gain": balance.worst_gain * balance.scale,
        },
    }


def _sticking(time: np.ndarray, slip: np.ndarray) -> np.ndarray:
    """When (m, 2) [s] a patch, whose way (k,) is known on a grid, stays where it is."""
    still = np.abs(np.diff(slip)) <= STILL * np.ptp(slip)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]]).astype(int)))
    return np.asarray(time[edges].reshape(-1, 2))


def _start(bench: Workbench) -> dict[str, Any]:
    """Where the full model's static load acts and what it has to reach; nothing for a start at rest."""
    start = bench.scene.file.start
    if start is None:
        return {}
    if isinstance(start, DisplacedStart):
        return start.model_dump()
    model = MultiPhiModel(bench.structure, bench.nonlinearities(rigid=False))
    reached = float(bench.structure.row(start.load_at) @ start_configuration(bench, model))
    return {"load_at": start.load_at, "measured_at": start.load_at, "displacement": reached}
