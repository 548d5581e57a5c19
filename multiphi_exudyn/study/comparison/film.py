"""What an animation shows: a scene's beams in two models beside each other, frame by frame.

A shape is the deflection w(x, t) at the nodes of the mesh both models are made from; every node is a point of the
structure here, which leaves matrices and mesh as they are. A stop stands where its contact would touch the beam,
z(t) = w(x_c, t) - g(t) / c with gap g and coefficient c of the contact, so one that moves is seen to move. Several
beams stand where placement.py puts them: those that meet touch when their lines touch.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.mechanics.beam import Beam
from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.study.comparison.placement import Placement, coefficient, meeting, placements
from multiphi_exudyn.study.running.runners import run_model
from multiphi_exudyn.study.running.runs import ModelRun
from multiphi_exudyn.study.scene.mechanics import mechanics_of
from multiphi_exudyn.study.scene.scene_file import CraigBamptonModel, FullModel
from multiphi_exudyn.study.scene.scenes import Scene
from multiphi_exudyn.study.scene.workbench import Workbench, mesh_nodes, prepare

__all__ = ["FRAME_RATE", "Film", "Line", "Stage", "Stop", "Take", "film_of", "run_stage", "stage_of"]

FRAME_RATE = 25.0  # frames a second
PERIOD_SHOWN = 10.0  # s, for the longest period of the open structure: bounces of a hundredth of it last several frames
LONGEST = 40.0  # s, of a film whose slow motion nobody has chosen
MOST_FRAMES = 3000  # two minutes, some 15 MB: beyond that a typing error is likelier than a wish
ROOM = 0.2  # between groups of beams that have nothing to do with each other, of the height they take


@dataclass(frozen=True)
class Line:
    """A beam: where its nodes are drawn, x (k,) [m], its height when undeformed [m], its deflection (k, frames) [m]."""

    name: str
    x: np.ndarray
    height: float
    deflection: np.ndarray


@dataclass(frozen=True)
class Stop:
    """A contact at x [m]: its z (frames,) [m], and whether it is closed (frames,).

    side: of the beam on which the stop is, "below" or "above"; "between" for a contact of two beams, which has no stop
    and stands midway.
    """

    name: str
    x: float
    side: Literal["below", "above", "between"]
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
class Laid:
    """A beam and where it is drawn: its nodes' x (k,) [m] on itself; nodes: names of the points there."""

    name: str
    x: np.ndarray
    nodes: tuple[str, ...]
    place: Placement


@dataclass(frozen=True)
class Stage:
    """A scene ready to be filmed: the nodes of its beams are points of the bench.

    models: the reduced model's name and the reference's; judged: points a film may follow; slow: see Film.
    """

    bench: Workbench
    models: tuple[str, str]
    judged: tuple[str, ...]
    beams: Mapping[str, Laid]
    slow: float


def stage_of(scene: Scene, model: str | None = None, reference: str | None = None, slow: float | None = None) -> Stage:
    """Check what is asked for and build what both models share; none asked for: the scene's own.

    Raises MultiPhiValueError, one line, for a model that cannot be filmed, matrices and a film of no or endless length.
    """
    models = _chosen(scene, model, reference)
    scene = _with_reference(scene, models[1])
    mechanics = mechanics_of(scene)
    beams = mechanics.beams
    if beams is None:
        raise MultiPhiValueError(f"{scene.path}: structure: got matrices, need beams, whose shapes are drawn along x")
    mesh = mesh_nodes(scene, mechanics)
    judged = scene.file.outputs.judged_points or scene.file.outputs.points or mechanics.points
    places = placements(beams, mechanics.contacts)
    laid = {name: Laid(name, x, _node_points(name, x), places[name]) for name, x in mesh.items()}
    nodes = [point for each in laid.values() for point in each.nodes]
    shown = dict.fromkeys([*judged, *(point for c in mechanics.contacts for point in meeting(c)), *nodes])
    parts = {name: _with_nodes(beam, mesh[name]) for name, beam in beams.parts.items()}
    bench = prepare(_with_points(scene, tuple(shown)), replace(mechanics, beams=replace(beams, parts=parts)))
    factor = _checked(slow, bench.t_end) if slow is not None else _slow_motion(bench)
    return Stage(replace(bench, repeats=1), models, tuple(judged), laid, factor)


def film_of(stage: Stage, runs: Mapping[str, ModelRun]) -> Film:
    """The film of two finished runs, by the names of their models."""
    time = np.arange(0.0, stage.bench.t_end, 1 / (FRAME_RATE * stage.slow))
    reduced, reference = (runs[name] for name in stage.models)
    point = max(stage.judged, key=lambda name: float(np.ptp(reference.points[name])))
    heights = _heights(stage, reference)
    takes = (_take(stage, reduced, time, point, heights), _take(stage, reference, time, point, heights))
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


def _node_points(beam: str, x: np.ndarray) -> tuple[str, ...]:
    """Names of the points at a beam's nodes."""
    return tuple(f"{beam}.{name}" if beam else name for name in _nodes(x))


def _with_nodes(beam: Beam, x: np.ndarray) -> Beam:
    return replace(beam, points={**beam.points, **_nodes(x)})


def _nodes(x: np.ndarray) -> dict[str, float]:
    return {f"x = {place!r} m": float(place) for place in x.tolist()}


def _heights(stage: Stage, run: ModelRun) -> dict[str, float]:
    """Height of every beam [m]: of its place in its group, each group below all that the one before it does."""
    heights: dict[str, float] = {}
    floor = None
    for group in sorted({laid.place.group for laid in stage.beams.values()}):
        members = [laid for laid in stage.beams.values() if laid.place.group == group]
        reached = [laid.place.height + np.array([run.points[name] for name in laid.nodes]) for laid in members]
        low, high = min(np.min(each) for each in reached), max(np.max(each) for each in reached)
        lift = 0.0 if floor is None else floor - ROOM * (high - low) - high
        heights |= {laid.name: laid.place.height + lift for laid in members}
        floor = low + lift
    return heights


def _take(stage: Stage, run: ModelRun, time: np.ndarray, point: str, heights: Mapping[str, float]) -> Take:
    lines = tuple(
        Line(
            laid.name or "beam",
            laid.x + laid.place.shift,
            heights[laid.name],
            np.array([_at(run, node, time) for node in laid.nodes]),
        )
        for laid in stage.beams.values()
    )
    contacts = stage.bench.mechanics.contacts
    stops = tuple(_stop(stage, run, contact, time, heights) for contact in contacts if len(meeting(contact)) in (1, 2))
    return Take(run, lines, stops, _at(run, point, time))


def _stop(
    stage: Stage, run: ModelRun, contact: UnilateralContact, time: np.ndarray, heights: Mapping[str, float]
) -> Stop:
    """A stop touches the beam where its gap is closed; between two beams there is what is midway."""
    beams, points = stage.bench.mechanics.beams, meeting(contact)
    assert beams is not None, "checked when the stage was built"
    of = [beams.points[point] for point in points]
    z = np.mean([heights[name] + _at(run, point, time) for point, (name, _) in zip(points, of, strict=True)], axis=0)
    x = float(np.mean([stage.beams[name].place.shift + along for name, along in of]))
    intervals = run.contact_intervals[contact.name]
    closed = np.any((intervals[:, :1] <= time) & (time <= intervals[:, 1:]), axis=0)
    if len(points) == 2:
        return Stop(contact.name, x, "between", z, closed)
    c = coefficient(contact)
    z = z - np.interp(time, run.time, run.gaps[contact.name]) / c
    return Stop(contact.name, x, "below" if c > 0 else "above", z, closed)


def _at(run: ModelRun, point: str, time: np.ndarray) -> np.ndarray:
    return np.interp(time, run.time, run.points[point])
