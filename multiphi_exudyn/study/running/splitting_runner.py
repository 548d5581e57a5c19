"""Runs a Craig-Bampton component by exact free motion and penalty forces in between (reference_models/splitting.py)."""

from __future__ import annotations

import functools

import numpy as np

from multiphi_exudyn.levels.model import MultiPhiModel
from multiphi_exudyn.mathematics.compiled import available, compile_entries
from multiphi_exudyn.study.running.runs import How, ModelRun
from multiphi_exudyn.study.running.stepwise_runner import sampled
from multiphi_exudyn.study.running.timing import repeated, timed
from multiphi_exudyn.study.scene.model_kinds import SplittingModel
from multiphi_exudyn.study.scene.workbench import Workbench, start_configuration
from reference_models.splitting import splitting

__all__ = ["run_splitting", "splitting_label"]


def splitting_label(bench: Workbench, spec: SplittingModel) -> str:
    """How tables and figures call it."""
    return f"Strang splitting, {spec.modes} + {len(bench.interface)} modes, step {1e6 * spec.step:g} us"


def run_splitting(bench: Workbench, spec: SplittingModel, label: str, how: How) -> ModelRun:
    """Start, step, sample; an explosion is a failed run."""
    contacts = bench.contacts(rigid=False)
    component, building = timed(lambda: splitting(bench.structure, contacts, bench.interface, spec.modes))
    start, starting = timed(lambda: start_configuration(bench, MultiPhiModel(bench.structure, contacts)))
    if available():
        compile_entries()  # before the clock starts: a machine pays it once
    with np.errstate(over="ignore", invalid="ignore"):
        solved, first, repeats = repeated(
            lambda: timed(lambda: component.run(start, bench.t_end, spec.step)), bench.repeats
        )
    run = ModelRun(
        name=spec.name,
        kind=spec.kind,
        label=label,
        dofs=len(component.squares),
        status="ok" if solved.finite else "failed",
        message="" if solved.finite else "its motion has grown beyond all numbers",
        steps=solved.steps,
        offline_s=bench.structure_s + building + starting,
        first_s=first,
        repeats_s=repeats,
    )
    histories = functools.partial(solved.histories, bench.structure)
    return sampled(bench, run, histories, solved.contact_intervals) if run.ok else run
