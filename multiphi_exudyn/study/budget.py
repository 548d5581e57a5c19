"""Error budget: the difference between the full beam and the Multi-Phi body, part by part, each with its cause.

A ladder of models y_0 ... y_n leads down from the full beam; each rung changes one thing, so that

    d = y_0 - y_n = sum d_i,   d_i = y_i - y_(i+1),   size_i = ||d_i|| / ||y_ref||,   share_i = <d_i, d> / <d, d>

The norm runs over the samples of a window and over one judged point or all of them; y_ref is the converged full
beam, or the uppermost rung where that is missing. Shares add up to 1; a negative one makes up for another part.
A rung's own uncertainty u_i is computed from runs in which nothing changes that should matter; a part's is
u_i + u_(i+1). All rungs have the start, the contacts, the damping and, by linearising it, the mesh of one full beam.
"""

from __future__ import annotations

import itertools
import math
import textwrap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pandas as pd
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.study.model_kinds import FullModel, ModelSpec, ReducedModel, UserObjectModel
from multiphi_exudyn.study.plots import COLOURS, FULL, NOTE, REFERENCE, STYLE, panels
from multiphi_exudyn.study.runners import run_model
from multiphi_exudyn.study.runs import ModelRun
from multiphi_exudyn.study.scene_elements import DisplacedStart, LoadedStart
from multiphi_exudyn.study.setup import Setup

__all__ = ["CAUSES", "Rung", "budget", "budget_figure", "decomposition"]

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
BODY_STEP = 1e-4  # s, of the user object where the scene names none
PALE = 0.35  # opacity of a bar no larger than its uncertainty
FLOOR = 1e-13  # of ||y_ref||: round-off; smaller bars lie below the picture
HIGHEST = 50.0  # of ||y_ref||: room for shares and causes above the largest differences
LINE_LENGTH = 110  # characters of a missing rung's cause
TOTAL: dict[str, Any] = {"color": REFERENCE, "ls": "--", "lw": 1.4}

View = Callable[[ModelRun], np.ndarray]  # a run's history as one vector, relative to ||y_ref||


@dataclass(frozen=True)
class Rung:
    """One model of a ladder.

    label: in plain words. cause: of the difference to the next rung; empty for the last. run: the model's answer.
    uncertainty_runs: cause -> runs that differ from ``run`` in nothing that should matter.
    """

    name: str
    label: str
    cause: str
    run: ModelRun
    uncertainty_runs: Mapping[str, tuple[ModelRun, ...]] = field(default_factory=dict)


def budget(setup: Setup, modes: int, progress: bool = True) -> dict[str, Any]:
    """Run every rung of both ladders, "rigid", the paper's contact, and "compliant"; their values as JSON has them.

    modes: r of the truncated rungs. progress: shown for the runs of the full beam. A rung that fails is missing, with
    its cause; "all" among the points of a window: the judged points together.
    """
    _check(setup, modes)
    reduced = {name: _reduced_rung(setup, name, modes) for name in dict.fromkeys(itertools.chain(*LADDERS.values()))}
    full = _full_rungs(setup, reduced["linear-compliant"].run, progress)
    ladders = {
        ladder: (*full, *(replace(reduced[name], cause=cause) for name, cause in causes.items()))
        for ladder, causes in LADDERS.items()
    }
    judged = setup.judged_points
    groups = {"all": judged} | {point: (point,) for point in judged}
    return {
        "scene": setup.scene.name,
        "parameter_set": setup.mechanics.parameter_set,
        "start": _start(setup).model_dump(),
        "modes": modes,
        "dofs": setup.structure.n,
        "rungs": {rung.name: _rung_values(rung) for rungs in ladders.values() for rung in rungs},
        "windows": {
            f"{until:g}": {
                ladder: {group: decomposition(rungs, points, until) for group, points in groups.items()}
                for ladder, rungs in ladders.items()
            }
            for until in setup.windows
        },
    }


def decomposition(rungs: Sequence[Rung], points: Sequence[str], until: float) -> dict[str, Any] | None:
    """Parts between the rungs that ran, over these points from 0 to ``until`` [s], relative to ||y_ref||.

    None for fewer than two rungs, and for points that the reference leaves at rest. A part across a missing rung has
    the causes of both its sides; an uncertainty is None where one of its runs failed.
    """
    present = [rung for rung in rungs if rung.run.ok]
    reference = next((rung for rung in present if rung.name == CONVERGED), present[0] if present else None)
    scale = 0.0 if reference is None else _norm(_history(reference.run, points, until))
    if reference is None or len(present) < 2 or scale == 0:
        return None

    def view(run: ModelRun) -> np.ndarray:
        return _history(run, points, until) / scale

    own = [_uncertainty(rung, view) for rung in present]
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
    return {
        "reference": reference.name,
        "total": _norm(total),
        "uncertainty": _sum([own[0], own[-1]]),
        "parts": parts,
    }


def _history(run: ModelRun, points: Sequence[str], until: float) -> np.ndarray:
    """The points' displacements from 0 to ``until``, one after the other."""
    inside = run.time <= until * (1 + 1e-9)
    return np.concatenate([run.points[point][inside] for point in points])


def _uncertainty(rung: Rung, view: View) -> float | None:
    """Sum over the causes of the largest change of the answer; None where a run failed."""
    if not all(run.ok for runs in rung.uncertainty_runs.values() for run in runs):
        return None
    answer = view(rung.run)
    return math.fsum(max(_norm(view(run) - answer) for run in runs) for runs in rung.uncertainty_runs.values())


def _norm(vector: np.ndarray) -> float:
    return float(np.linalg.norm(vector))


def _sum(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return math.fsum(known) if len(known) == len(values) else None


def _check(setup: Setup, modes: int) -> None:
    most = setup.structure.n - setup.mechanics.direction_count
    if not 1 <= modes <= most:
        raise MultiPhiValueError(f"modes: got {modes}, need 1 to {most} for this structure")
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
        half = body.model_copy(update={"step": body.step / 2})
        changed = _disturbed(setup, body) | {"half the step": (_run(setup, half),)}
        return Rung(name, label, "", _run(setup, body), changed)
    spec = ReducedModel(kind="reduced", modes="all" if kind == "linear" else modes, **given)
    what = "linear beam, all modes" if kind == "linear" else f"Multi-Phi, r = {modes}"
    return Rung(name, f"{what}, {contact} contacts", "", _run(setup, spec), _disturbed(setup, spec))


def _full_rungs(setup: Setup, linear: ModelRun, progress: bool) -> tuple[Rung, Rung]:
    """The full beam at its working step, that of the reference's coarser copy, and converged in step."""
    spec = _full_model(setup)
    if spec is None:
        none = ModelRun("full", "full", "full beam", status="failed", message="the scene has no full beam")
        return Rung(WORKING, none.label, STEPS, none), Rung(CONVERGED, none.label, GEOMETRY, none)
    specs = [spec.model_copy(update={"step": spec.step / 2**i}) for i in range(HALVINGS + 1)]
    runs = [_run(setup, specs[0], progress=progress)]
    while len(runs) <= HALVINGS and not _settled(setup, runs, linear):
        runs.append(_run(setup, specs[len(runs)], progress=progress))
    labels = [f"full beam, step {1e6 * each.step:g} µs" for each in (spec, specs[len(runs) - 1])]
    return (
        Rung(WORKING, labels[0], STEPS, runs[0], _disturbed(setup, spec)),
        Rung(CONVERGED, labels[1], GEOMETRY, runs[-1], {"last halving of the step": (runs[-2],)}),
    )


def _full_model(setup: Setup) -> FullModel | None:
    """The reference, or the first full beam where that is none, at the working step."""
    models, roles = setup.scene.models, setup.scene.file.comparison
    full = [model for model in (models[roles.reference], *models.values()) if isinstance(model, FullModel)]
    if not full:
        return None
    coarser = models.get(roles.coarser or "")
    return full[0].model_copy(update={"step": coarser.step if isinstance(coarser, FullModel) else full[0].step})


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


@rc_context(STYLE)
def budget_figure(values: Mapping[str, Any]) -> Figure:
    """Bars of the parts, by ladder and window, from the values of a budget."""
    figure, (axes,) = panels([3.6])
    colour_of, causes = dict(zip(CAUSES, COLOURS, strict=False)), set[str]()
    left, places = 0.0, {}
    for until, ladders in values["windows"].items():
        for ladder, groups in ladders.items():
            if groups["all"] is not None:
                parts = pd.DataFrame(groups["all"]["parts"])
                _bars(axes, left + np.arange(len(parts)), parts, groups["all"]["total"], colour_of)
                places[left + (len(parts) - 1) / 2] = f"{ladder} contacts\nto {until} s"
                left += len(parts) + 1
                causes |= set(parts.cause)
    axes.set(yscale="log", ylim=(100 * FLOOR, 100 * HIGHEST), ylabel="difference [% of the reference]")
    axes.set_xticks(list(places), list(places.values()))
    axes.tick_params(axis="x", length=0)
    axes.grid(visible=False, axis="x")
    start = values["start"]
    size = f"{1e3 * start['displacement']:+g} mm" if "displacement" in start else f"{start['force']:+g} N"
    axes.set_title(f"{values['scene']}, {size}, r = {values['modes']}")
    failed = [f"missing: {r['label']}: {r['message']}" for r in values["rungs"].values() if r["status"] != "ok"]
    missing = "\n".join(textwrap.shorten(each, LINE_LENGTH, placeholder=" …") for each in failed)
    axes.text(0.01, 0.99, missing, transform=axes.transAxes, fontsize=7, va="top", color=NOTE)
    handles: list[Any] = [Patch(color=colour_of[cause], label=cause) for cause in CAUSES if cause in causes]
    handles += [Patch(color=FULL, label=cause) for cause in sorted(causes - set(CAUSES))]
    handles.append(Line2D([], [], **TOTAL, label="total, full beam to user object; above bars: shares of it [%]"))
    handles.append(Line2D([], [], color=REFERENCE, lw=0.9, marker="_", label="uncertainty; pale: larger than the part"))
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    return figure


def _bars(axes: Axes, places: np.ndarray, parts: pd.DataFrame, total: float, colour_of: Mapping[str, str]) -> None:
    heights = 100 * np.maximum(parts["size"], FLOOR)
    spread = 100 * parts.uncertainty.astype(float)
    whiskers = [np.minimum(spread, heights - 100 * FLOOR), spread]
    pairs = zip(parts.cause, parts.significant, strict=True)
    colours = [to_rgba(colour_of.get(cause, FULL), PALE if known is False else 1.0) for cause, known in pairs]
    bars = axes.bar(places, heights, 0.8, yerr=whiskers, color=colours, error_kw={"lw": 0.9, "capsize": 2})
    shares = [round(share) for share in 100 * parts.share.astype(float).fillna(0.0)]
    axes.bar_label(bars, [f"{share:+d}" if share else "0" for share in shares], padding=2, fontsize=6.5)
    axes.plot(places[[0, -1]] + [-0.5, 0.5], [100 * total] * 2, **TOTAL)
