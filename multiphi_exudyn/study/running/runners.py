"""Runs one model of a scene; a failure is a run with its cause, not an exception.

Offline is what is done once for any start: discretisation, linearisation, modes, and here the static
start. Online is the solver alone, from the start to the end of the run.
"""

from __future__ import annotations

from multiphi_exudyn.errors import MultiPhiError
from multiphi_exudyn.study.running.body_runner import run_user_object
from multiphi_exudyn.study.running.craig_bampton_runner import run_craig_bampton
from multiphi_exudyn.study.running.full_runner import run_full
from multiphi_exudyn.study.running.reduced_runner import run_global_basis, run_reduced
from multiphi_exudyn.study.running.runs import ModelRun
from multiphi_exudyn.study.running.stepwise_runner import run_stepwise
from multiphi_exudyn.study.scene.scene_file import (
    CraigBamptonModel,
    FullModel,
    GlobalBasisModel,
    ReducedModel,
    StepwiseModel,
    UserObjectModel,
)
from multiphi_exudyn.study.scene.scenes import ModelSpec
from multiphi_exudyn.study.scene.workbench import Workbench
from multiphi_exudyn.time.warning_groups import kept_back

__all__ = ["label_of", "run_model"]


def run_model(
    bench: Workbench, name: str, progress: bool = True, retry: bool = False, horizon: bool = False
) -> ModelRun:
    """Run the scene's model ``name``; a failed run has status "failed" and its cause.

    retry: a full beam that fails is tried again at gentler settings; not for a study that judges the settings.
    horizon: a reduced model is run once more, nudged. Its warnings are those of the run, and not issued here.
    """
    with kept_back():
        return _run(bench, name, progress, retry, horizon)


def _run(bench: Workbench, name: str, progress: bool, retry: bool, horizon: bool) -> ModelRun:
    spec = bench.scene.models[name]
    label = label_of(bench, spec)
    try:
        if isinstance(spec, FullModel):
            return run_full(bench, spec, label, progress, retry)
        if isinstance(spec, UserObjectModel):
            return run_user_object(bench, spec, label)
        if isinstance(spec, CraigBamptonModel):
            return run_craig_bampton(bench, spec, label)
        if isinstance(spec, StepwiseModel):
            return run_stepwise(bench, spec, label)
        if isinstance(spec, GlobalBasisModel):
            return run_global_basis(bench, spec, label, horizon)
        return run_reduced(bench, spec, label, horizon)
    except (MultiPhiError, ArithmeticError, RuntimeError, ValueError) as error:
        cause = " ".join(str(error).split())
        return ModelRun(name, spec.kind, label, status="failed", message=cause)


def label_of(bench: Workbench, spec: ModelSpec) -> str:
    """How tables and figures call a model."""
    if isinstance(spec, FullModel):
        kind = "ANCF" if spec.beam == "ancf" else "geometrically exact"
        several = bench.mechanics.beam is None
        beam, each = ("beams", " each") if several else ("beam", "")
        return f"full Exudyn {beam}, {kind}, {spec.elements} elements{each}, step {spec.step * 1e6:g} µs"
    if isinstance(spec, CraigBamptonModel):
        given = bench.scene.file.start
        start = "" if given is None or given.load_at in bench.interface else ", start projected"
        reduced = f"{len(bench.interface)} interface points + {spec.modes} modes"
        return f"Craig-Bampton in Exudyn, {reduced}, step {spec.step * 1e6:g} µs{start}"
    if isinstance(spec, StepwiseModel):
        return f"solve_ivp, {spec.method}, rtol {spec.rtol:g}, compliant levels, r = {spec.modes}"
    kind = _levels(bench, spec.contact == "rigid")
    levels = f"{kind}, r = {spec.modes}"
    if isinstance(spec, ReducedModel) and spec.tolerance is not None:
        levels = f"{kind}, modes for a truncation error of {spec.tolerance:g}"
    if isinstance(spec, UserObjectModel):
        printed = ", printed frequencies" if bench.overrides else ""
        return f"Exudyn user object, {levels}{printed}, step {spec.step * 1e6:g} µs"
    if isinstance(spec, GlobalBasisModel):
        return f"global basis, {levels} from each of two"
    return f"Multi-Phi, {levels}{', printed frequencies' if bench.overrides else ''}"


def _levels(bench: Workbench, rigid: bool) -> str:
    contacts = bench.contacts(rigid)
    if not contacts:
        return "levels of force laws" if bench.mechanics.force_laws else "levels of friction"
    return f"{'rigid' if all(contact.rigid for contact in contacts) else 'compliant'} levels"
