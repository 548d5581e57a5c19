"""Slow-motion animation of a reduced model and its reference, as a GIF by matplotlib's PillowWriter.

One panel for each beam: the deflection w(x, t) of both models at the nodes of the mesh they are made from (every node
is made a point of the structure; matrices and mesh stay the same), and the position of each stop,
z(t) = w(x_c, t) - g(t) / c with gap g and coefficient c, so that moving stops and other beams move in the picture. The
last panel shows the history of the judged point that moves most.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.animation import PillowWriter
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.mechanics.arguments import one_of
from multiphi_exudyn.study.details import coefficients
from multiphi_exudyn.study.plots import BAND, COLOURS, REFERENCE, STYLE, grey_spans, panels
from multiphi_exudyn.study.runners import run_model
from multiphi_exudyn.study.runs import ModelRun
from multiphi_exudyn.study.scene import Scene, mechanics_of
from multiphi_exudyn.study.setup import Setup, mesh_nodes, prepare
from multiphi_exudyn.study.wording import seconds

__all__ = ["FRAME_RATE", "AnimatedScene", "gif", "moving_figure", "prepare_animation"]

FRAME_RATE = 25.0  # frames a second
PERIOD_SHOWN = 10.0  # s of animation for the longest period of the open structure: short bounces last several frames
LONGEST = 40.0  # s, of an animation with the default slow motion
MOST_FRAMES = 3000  # two minutes: more is probably a typing error
RESOLUTION = 76  # dots per inch: 700 pixels wide
MARGIN = 0.12  # of the range of the heights, above and below
CLOSED, OPEN = "#D55E00", "#BBBBBB"
WIDTHS = (2.0, 4.5)  # points, of the reduced model and of the reference below it

Move = Callable[[int], None]  # updates a part of the picture to a frame


@dataclass(frozen=True)
class AnimatedScene:
    """A scene prepared for an animation: the nodes of its beams are points of the structure.

    models: names of the reduced model and of the reference. judged: judged points. beams: name -> x (k,) [m] and point
    names of its nodes. slow: slow-motion factor.
    """

    setup: Setup
    models: tuple[str, str]
    judged: tuple[str, ...]
    beams: Mapping[str, tuple[np.ndarray, tuple[str, ...]]]
    slow: float

    @property
    def time(self) -> np.ndarray:
        """Times of the frames [s]."""
        return np.arange(0.0, self.setup.t_end, 1 / (FRAME_RATE * self.slow))

    def runs(self, progress: bool) -> dict[str, ModelRun]:
        """Run both models; a failed run has its cause."""
        return {name: run_model(self.setup, name, progress, retry=True) for name in self.models}

    def at(self, run: ModelRun, point: str) -> np.ndarray:
        """Displacement [mm] of a point in every frame."""
        return 1e3 * np.interp(self.time, run.time, run.points[point])


def prepare_animation(
    scene: Scene, model: str | None = None, reference: str | None = None, slow: float | None = None
) -> AnimatedScene:
    """Prepare the animation of a model and a reference; None: those of the scene. slow: slow-motion factor.

    Raises MultiPhiValueError for a model that cannot be drawn, for matrices, and for a length out of range.
    """
    models = _model_names(scene, model, reference)
    scene = _changed(scene, comparison=scene.file.comparison.model_copy(update={"reference": models[1]}))
    mechanics = mechanics_of(scene)
    beams = mechanics.beams
    if beams is None:
        raise MultiPhiValueError(f"{scene.path}: structure: got matrices, need beams, whose shapes are drawn along x")
    mesh = mesh_nodes(scene, beams)
    added = {name: {f"x = {place!r} m": place for place in x.tolist()} for name, x in mesh.items()}
    nodes = {name: (x, tuple(f"{name}.{node}" if name else node for node in added[name])) for name, x in mesh.items()}
    parts = {name: replace(beam, points={**beam.points, **added[name]}) for name, beam in beams.parts.items()}
    judged = scene.file.outputs.judged_points or scene.file.outputs.points or mechanics.points
    contact_points = [point for contact in mechanics.contacts for point in coefficients(contact)]
    node_points = [point for _, points in nodes.values() for point in points]
    shown = tuple(dict.fromkeys([*judged, *contact_points, *node_points]))
    scene = _changed(scene, outputs=scene.file.outputs.model_copy(update={"points": shown}))
    setup = replace(prepare(scene, replace(mechanics, beams=replace(beams, parts=parts))), repeats=1)
    return AnimatedScene(
        setup, models, tuple(judged), nodes, _slow_motion(setup) if slow is None else _checked_factor(slow, setup.t_end)
    )


def _changed(scene: Scene, **fields: Any) -> Scene:
    return replace(scene, file=scene.file.model_copy(update=fields))


def gif(animated: AnimatedScene, runs: Mapping[str, ModelRun], drawn: Callable[[], object] = lambda: None) -> bytes:
    """Return the animation of two finished runs as an endless GIF; drawn: called after every frame."""
    figure, move = moving_figure(animated, runs)
    writer = PillowWriter(fps=int(FRAME_RATE))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "animation.gif"
        with writer.saving(figure, path, RESOLUTION):
            for frame in range(len(animated.time)):
                move(frame)
                writer.grab_frame()
                drawn()
        return path.read_bytes()


@rc_context(STYLE | {"axes.grid": False, "legend.fontsize": 9})
def moving_figure(animated: AnimatedScene, runs: Mapping[str, ModelRun]) -> tuple[Figure, Move]:
    """Figure of both runs, and the function that updates it to a frame.

    A panel for each beam, with a mark for each stop, which is coloured while its contact is closed; a history below.
    """
    reduced, reference = (runs[name] for name in animated.models)
    figure, axes = panels([*[2.6] * len(animated.beams), 2.3])
    time, history = animated.time, axes[-1]
    shapes: list[tuple[Line2D, np.ndarray]] = []
    stops: list[tuple[Line2D, np.ndarray, np.ndarray]] = []
    tails: list[tuple[Line2D, np.ndarray]] = []
    for run, colour, width in ((reference, REFERENCE, WIDTHS[1]), (reduced, COLOURS[0], WIDTHS[0])):
        for (beam, (x, nodes)), panel in zip(animated.beams.items(), axes, strict=False):
            (line,) = panel.plot(x, x, color=colour, lw=width, label=run.name)
            shapes.append((line, np.array([animated.at(run, node) for node in nodes])))
            for along, up, z, closed in _stops(animated, run, beam):
                (mark,) = panel.plot([along], [0], marker="^" if up else "v", ms=2 * width, ls="none", zorder=3)
                stops.append((mark, z, closed))
        values = animated.at(run, _most_mobile_point(animated, run))
        history.plot(time, values, color=OPEN, lw=width / 2, zorder=0)
        (line,) = history.plot([], [], color=colour, lw=width / 2, marker="o", ms=width, markevery=[-1])
        tails.append((line, values))
    for (beam, (_, nodes)), panel in zip(animated.beams.items(), axes, strict=False):
        z = np.array([animated.at(run, node) for run in runs.values() for node in nodes])
        room = MARGIN * np.ptp(z) or 1.0
        panel.set(ylim=(np.min(z) - room, np.max(z) + room), ylabel=f"{beam} w [mm]".strip())
    axes[-2].set_xlabel("x [m]")
    axes[0].legend(loc="upper left")
    spans, meaning = grey_spans(reference)
    for start, end in spans:
        history.axvspan(start, end, color=BAND, lw=0, zorder=-1)
    history.set(xlabel="time [s]", ylabel=f"{_most_mobile_point(animated, reference)} [mm]", xlim=(0.0, time[-1]))
    history.set_title(meaning and f"grey: {meaning}", fontsize=9)
    run_times = "; ".join(f"{run.label}: {seconds(run.online_s)}" for run in (reduced, reference))
    title = f"{animated.setup.scene.file.title}, {animated.slow:g} times slower than in reality"
    figure.suptitle(f"{title}\ncomputed in: {run_times}", fontsize=9)
    clock = history.set_title("", fontsize=10, loc="right")
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # computed once, not in every frame

    def move(frame: int) -> None:
        for line, deflection in shapes:
            line.set_ydata(deflection[:, frame])
        for mark, z, closed in stops:
            mark.set(ydata=z[frame : frame + 1], color=CLOSED if closed[frame] else OPEN)
        for line, values in tails:
            line.set_data(time[: frame + 1], values[: frame + 1])
        clock.set_text(f"t = {time[frame]:.3f} s")

    return figure, move


def _stops(animated: AnimatedScene, run: ModelRun, beam: str) -> Iterator[tuple[float, bool, np.ndarray, np.ndarray]]:
    """Of each stop of a beam: its x [m], whether it is below, and in every frame its z [mm] and whether it is met."""
    beams = animated.setup.mechanics.beams
    assert beams is not None, "checked in prepare_animation"
    for contact in animated.setup.mechanics.contacts:
        closed = _closed(run.contact_intervals[contact.name], animated.time)
        gap = 1e3 * np.interp(animated.time, run.time, run.gaps[contact.name])
        for point, c in coefficients(contact).items():
            name, along = beams.points[point]
            if name == beam:
                yield along, c > 0, animated.at(run, point) - gap / c, closed


def _most_mobile_point(animated: AnimatedScene, run: ModelRun) -> str:
    """The judged point that moves most."""
    return max(animated.judged, key=lambda name: float(np.ptp(run.points[name])))


def _closed(intervals: np.ndarray, time: np.ndarray) -> np.ndarray:
    return np.any((intervals[:, :1] <= time) & (time <= intervals[:, 1:]), axis=0)


def _model_names(scene: Scene, model: str | None, reference: str | None) -> tuple[str, str]:
    """Names of the two models; not Craig-Bampton, which would have every node as an interface point."""
    drawable = [name for name, spec in scene.models.items() if spec.kind != "craig-bampton"]
    reduced = [name for name in drawable if scene.models[name].kind != "full"]
    if not reduced:
        raise MultiPhiValueError(f"{scene.path}: models: got none that is reduced, need one to draw")
    return (
        _checked_name("--model", reduced[0] if model is None else model, reduced),
        _checked_name("--reference", scene.file.comparison.reference if reference is None else reference, drawable),
    )


def _checked_name(option: str, name: str, allowed: list[str]) -> str:
    if name not in allowed:
        raise MultiPhiValueError(f"{option}: got {name!r}, need {one_of(name, allowed)}")
    return name


def _slow_motion(setup: Setup) -> float:
    """Default slow-motion factor, to one digit: bounces are visible, and the animation is at most LONGEST."""
    factor = min(PERIOD_SHOWN / setup.longest_period or math.inf, LONGEST / setup.t_end)
    return float(f"{factor:.0e}")


def _checked_factor(slow: float, t_end: float) -> float:
    least, most = 2 / (FRAME_RATE * t_end), MOST_FRAMES / (FRAME_RATE * t_end)
    if not least <= slow <= most:
        raise MultiPhiValueError(f"--slow: got {slow:g}, need {least:.4g} to {most:.4g} for {t_end:g} s")
    return slow
