"""Run one model of a scene; a failure gives a run with a cause, not an exception.

Every kind of model (multiphi_exudyn.study.model_kinds) has a runner.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from multiphi_exudyn.errors import MultiPhiError
from multiphi_exudyn.study.running.body_runner import BodyRunner
from multiphi_exudyn.study.running.craig_bampton_runner import CraigBamptonRunner
from multiphi_exudyn.study.running.full_runner import FullRunner
from multiphi_exudyn.study.running.reduced_runner import GlobalBasisRunner, ReducedRunner, TrainedBasisRunner
from multiphi_exudyn.study.running.runner import Runner
from multiphi_exudyn.study.running.runs import ModelRun
from multiphi_exudyn.study.running.stepwise_runner import SplittingRunner, StepwiseRunner
from multiphi_exudyn.study.setup import Setup
from multiphi_exudyn.time.model_warnings import kept_back

__all__ = ["ready_model", "run_model"]

RUNNERS: Mapping[str, type[Runner]] = {
    "reduced": ReducedRunner,
    "user-object": BodyRunner,
    "full": FullRunner,
    "craig-bampton": CraigBamptonRunner,
    "solve-ivp": StepwiseRunner,
    "global-basis": GlobalBasisRunner,
    "pod-basis": TrainedBasisRunner,
    "splitting": SplittingRunner,
}


def run_model(setup: Setup, name: str, progress: bool = True, retry: bool = False, horizon: bool = False) -> ModelRun:
    """Run the scene's model ``name``; a failed run has status "failed" and its cause.

    retry: run a failed full beam again with smaller steps and more damping; not for a study of these settings.
    horizon: run a reduced model once more from a perturbed start. Warnings are stored in the run, not issued.
    """
    spec = setup.scene.models[name]
    runner = RUNNERS[spec.kind](setup, spec, progress, retry, horizon)
    with kept_back():
        label = runner.label
        try:
            return runner.run()
        except (MultiPhiError, ArithmeticError, RuntimeError, ValueError) as error:
            cause = " ".join(str(error).split())
            return ModelRun(name, spec.kind, label, status="failed", message=cause)


def ready_model(setup: Setup, name: str) -> Callable[[], float]:
    """Prepare the scene's model ``name`` and run it once; every call runs it again and returns the solver's time [s].

    Raises where the model fails.
    """
    spec = setup.scene.models[name]
    return RUNNERS[spec.kind](setup, spec).ready()
