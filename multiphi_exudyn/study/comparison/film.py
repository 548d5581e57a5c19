"""What an animation shows: a scene's beams in two models beside each other, frame by frame.

A shape is the deflection w(x, t) at the nodes of the mesh both models are made from; every node is a point of the
structure here, which leaves matrices and mesh as they are. A stop stands where its contact would touch the beam,
z(t) = w(x_c, t) - g(t) / c with gap g and coefficient c of the contact, so one that moves is seen to move.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from multiphi_exudyn.beam import Beam
from multiphi_exudyn.contact import UnilateralContact
from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.study.running.runners import run_model
from multiphi_exudyn.study.running.runs import ModelRun
from multiphi_exudyn.study.scene.mechanics import mechanics_of
from multiphi_exudyn.study.scene.scene_file import CraigBamptonModel, FullModel
from multiphi_exudyn.study.scene.scenes import Scene
from multiphi_exudyn.study.scene.workbench import Workbench, mesh_nodes, prepare
from reference_models.beams import as_beams

__all__ = ["FRAME_RATE", "Film", "Line", "Stage", "Stop", "Take", "film_of", "run_stage", "stage_of"]

FRAME_RATE = 25.0  # frames a second
PERIOD_SHOWN = 10.0  # s, for the longest period of the open structure: bounces of a hundredth of it last several frames
LONGEST = 40.0  # s, of a film whose slow motion nobody has chosen
MOST_FRAMES = 3000  # two minutes, some 15 MB: beyond that a typing error is likelier than a wish


@dataclass(frozen=True)
class Line:
    """A beam: nodes x (k,) [m], its height when undeformed [m], and its deflection (k, frames) [m]."""

    name: str
    x: np.ndarray
    height: float
    deflection: np.ndarray


@dataclass(frozen=True)
class Stop:
    """A stop at x [m]: its z (frames,) [m], and whether its contact is closed (frames,). below: under the beam."""

    name: str
    x: float
    below: bool
    z: np.ndarray
    closed: np.ndarray


@dataclass(frozen=True)
class Take:
    """One model in a film. history: (frames,) [m], of the film's point."""

    run: ModelRun
    lines: tuple[Line, ...]
    stops: tuple[Stop, ...]
    history: np.ndarray


@dataclass(frozen=True)
class Film:
    """Two takes at the same times (frames,) [s], ``slow`` times slower than they happen; the second is the reference.

    point: the judged point that moves most in the reference.
    """

    title: str
    slow: float
    time: np.ndarray
    point: str
    takes: tuple[Take, Take]


@dataclass(frozen=True)
class Stage:
    """A scene ready to be filmed: its nodes x (k,) [m] are points of the bench, named by ``nodes``.

    models: the reduced model's name and the reference's; judged: points a film may follow; slow: see Film.
    """

    bench: Workbench
    models: tuple[str, str]
    judged: tuple[str, ...]
    x: np.ndarray
    nodes: tuple[str, ...]
    slow: float


def stage_of(scene: Scene, model: str | None = None, reference: str | None = None, slow: float | None = None) -> Stage:
    """Check what is asked for and build what both models share; none asked for: the scene's own.

    Raises MultiPhiValueError, one line, for a model that cannot be filmed, matrices and a film of no or endless length.
    """
    models = _chosen(scene, model, reference)
    scene = _with_reference(scene, models[1])
    mechanics = mechanics_of(scene)
    if mechanics.beam is None:
        raise MultiPhiValueError(
            f"{scene.path}: structure: got matrices or several beams, need one beam, whose shape is drawn along x"
        )
    x = mesh_nodes(scene, mechanics)
    nodes = {f"x = {place!r} m": float(place) for place in x.tolist()}
    judged = scene.file.outputs.judged_points or scene.file.outputs.points or mechanics.points
    shown = dict.fromkeys([*judged, *_struck(mechanics.contacts), *nodes])
    beam = replace(mechanics.beam, points={**mechanics.beam.points, **nodes})
    bench = prepare(_with_points(scene, tuple(shown)), replace(mechanics, beams=as_beams(beam)))
    factor = _checked(slow, bench.t_end) if slow is not None else _slow_motion(bench)
    return Stage(replace(bench, repeats=1), models, tuple(judged), x, tuple(nodes), factor)


def film_of(stage: Stage, runs: Mapping[str, ModelRun]) -> Film:
    """The film of two finished runs, by the names of their models."""
    time = np.arange(0.0, stage.bench.t_end, 1 / (FRAME_RATE * stage.slow))
    reduced, reference = (runs[name] for name in stage.models)
    point = max(stage.judged, key=lambda name: float(np.ptp(reference.points[name])))
    takes = (_take(stage, reduced, time, point), _take(stage, reference, time, point))
    return Film(stage.bench.scene.file.title, stage.slow, time, point, takes)


def run_stage(stage: Stage, progress: bool) -> dict[str, ModelRun]:
    """Both models of a stage, run; a failed one has its cause."""
    return {name: run_model(stage.bench, name, progress, retry=True) for name in stage.models}


def _chosen(scene: Scene, model: str | None, reference: str | None) -> tuple[str, str]:
    """Names of the two models; a Craig-Bampton component would get every node as an interface point."""
    filmed = [name for name, spec in scene.models.items() if not isinstance(spec, CraigBamptonModel)]
    reduced = [name for name in filmed if not isinstance(scene.models[name], FullModel)]
    if not reduced:
        raise MultiPhiValueError(f"{scene.path}: models: got none that is reduced, need one to film")
    return (
        _one_of("--model", reduced[0] if model is None else model, reduced),
        _one_of("--reference", scene.file.comparison.reference if reference is None else reference, filmed),
    )


def _one_of(option: str, given: str, known: list[str]) -> str:
    if given not in known:
        raise MultiPhiValueError(f"{option}: got {given!r}, need one of: {', '.join(known)}")
    return given


def _with_reference(scene: Scene, reference: str) -> Scene:
    comparison = scene.file.comparison.model_copy(update={"reference": reference})
    return replace(scene, file=scene.file.model_copy(update={"comparison": comparison}))


def _with_points(scene: Scene, points: tuple[str, ...]) -> Scene:
    outputs = scene.file.outputs.model_copy(update={"points": points})
    return replace(scene, file=scene.file.model_copy(update={"outputs": outputs}))


def _slow_motion(bench: Workbench) -> float:
    """Slow enough to see bounces, in a film that is not too long; one significant digit."""
    factor = min(PERIOD_SHOWN / bench.longest_period or math.inf, LONGEST / bench.t_end)
    return float(f"{factor:.0e}")


def _checked(slow: float, t_end: float) -> float:
    least, most = 2 / (FRAME_RATE * t_end), MOST_FRAMES / (FRAME_RATE * t_end)
    if not least <= slow <= most:
        raise MultiPhiValueError(f"--slow: got {slow:g}, need {least:.4g} to {most:.4g} for {t_end:g} s")
    return slow


def _take(stage: Stage, run: ModelRun, time: np.ndarray, point: str) -> Take:
    beam = stage.bench.mechanics.beam
    assert beam is not None, "checked when the stage was built"
    deflection = np.array([_at(run, name, time) for name in stage.nodes])
    contacts = [contact for contact in stage.bench.mechanics.contacts if len(_struck([contact])) == 1]
    stops = tuple(_stop(run, contact, beam, time) for contact in contacts)
    return Take(run, (Line("beam", stage.x, 0.0, deflection),), stops, _at(run, point, time))


def _stop(run: ModelRun, contact: UnilateralContact, beam: Beam, time: np.ndarray) -> Stop:
    ((point, coefficient),) = _coefficients(contact).items()
    z = _at(run, point, time) - np.interp(time, run.time, run.gaps[contact.name]) / coefficient
    intervals = run.contact_intervals[contact.name]
    closed = np.any((intervals[:, :1] <= time) & (time <= intervals[:, 1:]), axis=0)
    return Stop(contact.name, beam.points[point], coefficient > 0, z, closed)


def _at(run: ModelRun, point: str, time: np.ndarray) -> np.ndarray:
    return np.interp(time, run.time, run.points[point])


def _struck(contacts: tuple[UnilateralContact, ...] | list[UnilateralContact]) -> list[str]:
    """The points that contacts act on."""
    return [point for contact in contacts for point in _coefficients(contact)]


def _coefficients(contact: UnilateralContact) -> dict[str, float]:
    given = contact.direction
    if isinstance(given, str):
        return {given: 1.0}
    assert isinstance(given, Mapping), "contacts of a scene act on points"
    return dict(given)
