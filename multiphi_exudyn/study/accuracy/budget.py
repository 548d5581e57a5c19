"""Error budget: the difference between the full beam and the Multi-Phi body, part by part, each with its cause.

A ladder of models y_0 ... y_n leads down from the full beam; each rung changes one thing, so that

    d = y_0 - y_n = sum d_i,   d_i = y_i - y_(i+1),   size_i = ||d_i|| / ||y_ref||,   share_i = <d_i, d> / <d, d>

The norm runs over the samples of a window and over one judged point or all of them; y_ref is the converged full
beam, or the uppermost rung where that is missing. Shares add up to 1; a negative one makes up for another part.
A rung's own uncertainty u_i is computed from runs in which nothing changes that should matter; a part's is
u_i + u_(i+1). Each part is measured once more, to a repeat of its lower rung that no uncertainty was taken from:
those parts miss the total by the residual ||sum (y_i - repeat_i)|| / ||y_ref||, to be no larger than the bound sum u_i.
All rungs have the start, the contacts, the damping and, by linearising it, the mesh of one full beam.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.study.model_kinds import FullModel, ModelSpec, ReducedModel, UserObjectModel
from multiphi_exudyn.study.running.runners import run_model
from multiphi_exudyn.study.running.runs import ModelRun
from multiphi_exudyn.study.scene_elements import DisplacedStart, LoadedStart
from multiphi_exudyn.study.setup import Setup

__all__ = ["CAUSES", "Budget", "Rung", "budget", "decomposition"]

STEPS, GEOMETRY, CONTACT, TRUNCATION, BODY = CAUSES = (
    "time integration",
    "geometric nonlinearity",
    "contact law",
    "modal truncation",
    "time integration of the user object",
)
WORKING, CONVERGED = "full-working-step", "full-converged"
LADDERS = {  # below the full beam: rung -> cause of its difference to the next one
    "rigid": {"linear-compliant": CONTACT, "linear-rigid": TRUNCATION, "multiphi-rigid": BODY, "user-object-rigid": ""},
    "compliant": {"linear-compliant": TRUNCATION, "multiphi-compliant": BODY, "user-object-compliant": ""},
}
HALVINGS = 3  # of the full beam's step, at most; at least two, or the last one would be its own uncertainty
SETTLED = 0.05  # of the difference to the linear beam: a halving that changes less ends them
DISTURBANCES = (1e-9, -1e-9)  # of the start, relative
REPEAT = 0.5e-9  # of the start in a repeat
NEARBY = 0.93  # of the full beam's step in a repeat
BODY_STEP = 1e-4  # s, of the user object where the scene names none

View = Callable[[ModelRun], np.ndarray]  # a run's history as one vector, relative to ||y_ref||


@dataclass(frozen=True)
class Rung:
    """One model of a ladder.

    label: in plain words. cause: of the difference to the next rung; empty for the last. run: the model's answer.
    uncertainty_runs: cause -> runs that differ from ``run`` in nothing that should matter.
    repeat: one more such run, held out from the uncertainty; none for the working step, which is never a lower rung.
    """

    name: str
    label: str
    cause: str
    run: ModelRun
    uncertainty_runs: Mapping[str, tuple[ModelRun, ...]] = field(default_factory=dict)
    repeat: ModelRun | None = None


@dataclass(frozen=True)
class Budget:
    """The ladders of one scene: "rigid", the paper's contact, and "compliant"; modes: r of their truncated rungs."""

    setup: Setup
    modes: int
    ladders: Mapping[str, tuple[Rung, ...]]

    def values(self) -> dict[str, Any]:
        """All of it as numbers and words that JSON can hold; group "all": the judged points together."""
        scene, judged = self.setup.scene, self.setup.judged_points
        groups = {"all": judged} | {point: (point,) for point in judged}
        return {
            "scene": scene.name,
            "parameter_set": self.setup.mechanics.parameter_set,
            "start": _start(self.setup).model_dump(),
            "modes": self.modes,
            "dofs": self.setup.structure.n,
            "rungs": {rung.name: _rung_values(rung) for rungs in self.ladders.values() for rung in rungs},
            "windows": {
                f"{until:g}": {
                    ladder: {group: decomposition(rungs, points, until) for group, points in groups.items()}
                    for ladder, rungs in self.ladders.items()
                }
                for until in self.setup.windows
            },
        }


def budget(setup: Setup, modes: int, step: float | None = None, progress: bool = True) -> Budget:
    """Run every rung of both ladders on the setup's scene; a rung that fails is missing, with its cause.

    modes: r of the truncated rungs. step: the full beam's working step [s]; none given: that of the reference's
    coarser copy, or the reference's own. progress: shown for the runs of the full beam.
    """
    _check(setup, modes, step)
    reduced = {name: _reduced_rung(setup, name, modes) for name in dict.fromkeys(itertools.chain(*LADDERS.values()))}
    full = _full_rungs(setup, step, reduced["linear-compliant"].run, progress)
    ladders = {
        ladder: (*full, *(replace(reduced[name], cause=cause) for name, cause in causes.items()))
        for ladder, causes in LADDERS.items()
    }
    return Budget(setup, modes, ladders)


def decomposition(rungs: Sequence[Rung], points: Sequence[str], until: float) -> dict[str, Any] | None:
    """Parts between the rungs that ran, over these points from 0 to ``until`` [s], and how they add up.

    None for fewer than two rungs, and for points that the reference leaves at rest. Sizes are relative to ||y_ref||;
    an uncertainty is None where one of its runs failed. sum_of_sizes: no total can be larger. explained: whether the
    residual is within its bound.
    """
    present = [rung for rung in rungs if rung.run.ok]
    reference = next((rung for rung in present if rung.name == CONVERGED), present[0] if present else None)
    scale = 0.0 if reference is None else _norm(_history(reference.run, points, until))
    if reference is None or len(present) < 2 or scale == 0:
        return None

    def view(run: ModelRun) -> np.ndarray:
        return _history(run, points, until) / scale

    own = [_uncertainty(rung, view) for rung in present]
    parts = _parts(rungs, present, own, view)
    sizes = [part["size"] for part in parts]
    residual, bound = _residual(present[1:], view), _sum(own[1:])
    return {
        "reference": reference.name,
        "total": _norm(view(present[0].run) - view(present[-1].run)),
        "uncertainty": _sum([own[0], own[-1]]),
        "sum_of_sizes": math.fsum(sizes),
        "root_sum_of_squares": math.hypot(*sizes),
        "residual": residual,
        "bound": bound,
        "explained": None if residual is None or bound is None else residual <= bound,
        "parts": parts,
    }


def _history(run: ModelRun, points: Sequence[str], until: float) -> np.ndarray:
    """The points' displacements from 0 to ``until``, one after the other."""
    inside = run.time <= until * (1 + 1e-9)
    return np.concatenate([run.points[point][inside] for point in points])


def _parts(
    rungs: Sequence[Rung], present: Sequence[Rung], own: Sequence[float | None], view: View
) -> list[dict[str, Any]]:
    """Between neighbouring rungs that ran; a part across a missing rung has the causes of both its sides."""
    answers = [view(rung.run) for rung in present]
    total = answers[0] - answers[-1]
    square = float(total @ total)
    parts = []
    for i, (upper, lower) in enumerate(itertools.pairwise(present)):
        difference, uncertainty = answers[i] - answers[i + 1], _sum(own[i : i + 2])
        part = {
            "upper": upper.name,
            "lower": lower.name,
            "cause": " and ".join(rung.cause for rung in rungs[rungs.index(upper) : rungs.index(lower)]),
            "size": _norm(difference),
            "share": float(difference @ total) / square if square > 0 else None,
            "uncertainty": uncertainty,
            "significant": None if uncertainty is None else _norm(difference) > uncertainty,
        }
        parts.append(part)
    return parts


def _uncertainty(rung: Rung, view: View) -> float | None:
    """Sum over the causes of the largest change of the answer; None where a run failed."""
    if not all(run.ok for runs in rung.uncertainty_runs.values() for run in runs):
        return None
    answer = view(rung.run)
    return math.fsum(max(_norm(view(run) - answer) for run in runs) for runs in rung.uncertainty_runs.values())


def _residual(lower: Sequence[Rung], view: View) -> float | None:
    """What parts measured to the repeats of their lower rungs miss of the total; None where a repeat is missing."""
    pairs = [(rung.run, rung.repeat) for rung in lower if rung.repeat is not None and rung.repeat.ok]
    return _norm(np.sum([view(run) - view(repeat) for run, repeat in pairs], 0)) if len(pairs) == len(lower) else None


def _norm(vector: np.ndarray) -> float:
    return float(np.linalg.norm(vector))


def _sum(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return math.fsum(known) if len(known) == len(values) else None


def _check(setup: Setup, modes: int, step: float | None) -> None:
    most = setup.structure.n - setup.mechanics.direction_count
    if isinstance(modes, bool) or not isinstance(modes, int):
        raise MultiPhiTypeError(f"modes: got {modes!r}, need an integer")
    if not 1 <= modes <= most:
        raise MultiPhiValueError(f"modes: got {modes}, need 1 to {most} for this structure")
    if step is not None and not (math.isfinite(step) and step > 0):
        raise MultiPhiValueError(f"step: got {step!r}, need a finite time > 0 s")
    if setup.scene.file.start is None:
        raise MultiPhiValueError(f"scene: got {setup.scene.name} without a start, need one (the budget disturbs it)")
    if setup.overrides:
        raise MultiPhiValueError(
            f"scene: got {setup.scene.name} with printed frequencies, need a scene whose levels are of one structure"
        )


def _start(setup: Setup) -> DisplacedStart | LoadedStart:
    assert setup.scene.file.start is not None, "checked where the budget begins"
    return setup.scene.file.start


def _run(setup: Setup, spec: ModelSpec, disturbance: float = 0.0, progress: bool = False) -> ModelRun:
    """One model, once, on the setup's scene, its start scaled by 1 + ``disturbance``."""
    start = _start(setup)
    size = "displacement" if isinstance(start, DisplacedStart) else "force"
    scaled = start.model_copy(update={size: getattr(start, size) * (1 + disturbance)})
    file = setup.scene.file.model_copy(update={"start": scaled, "models": (spec,)})
    return run_model(replace(setup, scene=replace(setup.scene, file=file), repeats=0), spec.name, progress)


def _disturbed(setup: Setup, spec: ModelSpec) -> dict[str, tuple[ModelRun, ...]]:
    return {"disturbed start": tuple(_run(setup, spec, disturbance) for disturbance in DISTURBANCES)}


def _reduced_rung(setup: Setup, name: str, modes: int) -> Rung:
    """A rung below the full beam, by its name; its cause depends on the ladder."""
    kind, contact = name.rsplit("-", 1)
    given: dict[str, Any] = {"name": name, "contact": "rigid" if contact == "rigid" else "as-given"}
    if kind == "user-object":
        steps = [model.step for model in setup.scene.models.values() if isinstance(model, UserObjectModel)]
        body = UserObjectModel(kind="user-object", modes=modes, step=steps[0] if steps else BODY_STEP, **given)
        label = f"Exudyn user object, r = {modes}, step {1e6 * body.step:g} µs, {contact} contacts"
        return _body_rung(setup, body, label)
    spec = ReducedModel(kind="reduced", modes="all" if kind == "linear" else modes, **given)
    what = "linear beam, all modes" if kind == "linear" else f"Multi-Phi, r = {modes}"
    run, changed, repeat = _run(setup, spec), _disturbed(setup, spec), _run(setup, spec, REPEAT)
    return Rung(name, f"{what}, {contact} contacts", "", run, changed, repeat)


def _body_rung(setup: Setup, spec: UserObjectModel, label: str) -> Rung:
    half, third = (spec.model_copy(update={"step": spec.step / parts}) for parts in (2, 3))
    changed = _disturbed(setup, spec) | {"half the step": (_run(setup, half),)}
    return Rung(spec.name, label, "", _run(setup, spec), changed, _run(setup, third, REPEAT))


def _full_rungs(setup: Setup, step: float | None, linear: ModelRun, progress: bool) -> tuple[Rung, Rung]:
    """The full beam at its working step, and converged in step."""
    spec = _full_model(setup, step)
    if spec is None:
        none = ModelRun("full", "full", "full beam", status="failed", message="the scene has no full beam")
        return Rung(WORKING, none.label, STEPS, none), Rung(CONVERGED, none.label, GEOMETRY, none)
    specs = [spec.model_copy(update={"step": spec.step / 2**i}) for i in range(HALVINGS + 1)]
    runs = [_run(setup, specs[0], progress=progress)]
    while len(runs) <= HALVINGS and not _settled(setup, runs, linear):
        runs.append(_run(setup, specs[len(runs)], progress=progress))
    finest = specs[len(runs) - 1]
    repeat = _run(setup, finest.model_copy(update={"step": NEARBY * finest.step}), progress=progress)
    halved = {"last halving of the step": (runs[-2],)}
    labels = [f"full beam, step {1e6 * each.step:g} µs" for each in (spec, finest)]
    working = Rung(WORKING, labels[0], STEPS, runs[0], _disturbed(setup, spec))
    return working, Rung(CONVERGED, labels[1], GEOMETRY, runs[-1], halved, repeat)


def _full_model(setup: Setup, step: float | None) -> FullModel | None:
    """The reference, or the first full beam where that is none, at the working step."""
    models, roles = setup.scene.models, setup.scene.file.comparison
    full = [model for model in (models[roles.reference], *models.values()) if isinstance(model, FullModel)]
    if not full:
        return None
    coarser = models.get(roles.coarser or "")
    own = coarser.step if isinstance(coarser, FullModel) else full[0].step
    return full[0].model_copy(update={"step": own if step is None else step})


def _settled(setup: Setup, runs: Sequence[ModelRun], linear: ModelRun) -> bool:
    """Whether the last of at least two halvings changed little beside the difference to the linear beam."""
    if len(runs) < 3 or not (runs[-1].ok and runs[-2].ok and linear.ok):
        return False
    last, before, other = (_history(run, setup.judged_points, setup.t_end) for run in (runs[-1], runs[-2], linear))
    return _norm(last - before) <= SETTLED * _norm(last - other)


def _rung_values(rung: Rung) -> dict[str, Any]:
    run = rung.run
    failed = [f"{cause}: {o.message}" for cause, runs in rung.uncertainty_runs.items() for o in runs if not o.ok]
    known = {"label": rung.label, "status": run.status, "message": run.message, "dofs": run.dofs, "steps": run.steps}
    return known | {"online_s": run.online_s, "failed_uncertainty_runs": failed, "warnings": list(run.warnings)}
