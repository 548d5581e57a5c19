"""Runs one model of a scene; a failure is a run with its cause, not an exception.

Every kind of model (multiphi_exudyn.study.scene.model_kinds) has a runner: how tables and figures call it, and its run.
Offline is what is done once for any start: discretisation, linearisation, modes, and here the static
start. Online is the solver alone, from the start to the end of the run.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from multiphi_exudyn.errors import MultiPhiError
from multiphi_exudyn.study.running.body_runner import body_label, run_user_object
from multiphi_exudyn.study.running.craig_bampton_runner import craig_bampton_label, run_craig_bampton
from multiphi_exudyn.study.running.full_runner import full_label, run_full
from multiphi_exudyn.study.running.reduced_runner import (
    global_label,
    reduced_label,
    run_global_basis,
    run_reduced,
    run_trained_basis,
    trained_label,
)
from multiphi_exudyn.study.running.runs import How, ModelRun
from multiphi_exudyn.study.running.splitting_runner import run_splitting, splitting_label
from multiphi_exudyn.study.running.stepwise_runner import run_stepwise, stepwise_label
from multiphi_exudyn.study.scene.workbench import Workbench
from multiphi_exudyn.time.warning_groups import kept_back

__all__ = ["RUNNERS", "Runner", "run_model"]


@dataclass(frozen=True)
class Runner:
    """label(bench, spec); run(bench, spec, label, how)."""

    label: Callable[[Workbench, Any], str]
    run: Callable[[Workbench, Any, str, How], ModelRun]


RUNNERS: Mapping[str, Runner] = {
    "reduced": Runner(reduced_label, run_reduced),
    "user-object": Runner(body_label, run_user_object),
    "full": Runner(full_label, run_full),
    "craig-bampton": Runner(craig_bampton_label, run_craig_bampton),
    "solve-ivp": Runner(stepwise_label, run_stepwise),
    "global-basis": Runner(global_label, run_global_basis),
    "pod-basis": Runner(trained_label, run_trained_basis),
    "splitting": Runner(splitting_label, run_splitting),
}


def run_model(
    bench: Workbench, name: str, progress: bool = True, retry: bool = False, horizon: bool = False
) -> ModelRun:
    """Run the scene's model ``name``; a failed run has status "failed" and its cause.

    retry: a full beam that fails is tried again at gentler settings; not for a study that judges the settings.
    horizon: a reduced model is run once more, nudged. Its warnings are those of the run, and not issued here.
    """
    spec = bench.scene.models[name]
    runner = RUNNERS[spec.kind]
    with kept_back():
        label = runner.label(bench, spec)
        try:
            return runner.run(bench, spec, label, How(progress, retry, horizon))
        except (MultiPhiError, ArithmeticError, RuntimeError, ValueError) as error:
            cause = " ".join(str(error).split())
            return ModelRun(name, spec.kind, label, status="failed", message=cause)
