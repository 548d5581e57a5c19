"""Mode shapes and frequencies of the levels a run was in, and their picture; of the rig beside the published tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.study.comparison.beam_places import beam_places, coefficients
from multiphi_exudyn.study.comparison.compare import Comparison
from multiphi_exudyn.study.comparison.figure_style import COLOURS, LINE, STYLE, WIDTH
from multiphi_exudyn.study.measures.metrics import level_durations
from multiphi_exudyn.study.setup import ELEMENTS, LinearBeams
from reference_models.beams import NAMELESS, Beams
from reference_models.rig import PublishedLevel, published_frequencies

__all__ = ["BeamShapes", "LevelModes", "level_modes", "mode_figure"]

MODE_COUNT = 4  # modes, as many as the paper's tables list
STATIONS = 101  # places along a beam
MOST_LEVELS = 4  # the open one, and those held longest
MOST_NAMED = 3  # closed contacts that a level's name lists
BEAM_SPACING = 2.3  # between beams drawn over each other, of the largest value of a mode


@dataclass(frozen=True)
class BeamShapes:
    """One beam in m modes: where it is drawn, x (k,) [m], shapes (m, k); masses, contacts (closed): their x [m]."""

    name: str
    x: np.ndarray
    shapes: np.ndarray
    masses: tuple[float, ...]
    contacts: tuple[float, ...]


@dataclass(frozen=True)
class LevelModes:
    """The lowest m modes of one level.

    closed: names of its closed contacts; of the paper's rig they are rigid, as in its tables, else as the scene has
    them. share: of the reference's run that it holds; None without one. frequencies: (m,) Hz, of the structure every
    reduced model of the scene has. beams: from top to bottom, the largest value of a mode on all of them is 1.
    published: what the paper prints for this level.
    """

    closed: tuple[str, ...]
    share: float | None
    frequencies: np.ndarray
    beams: tuple[BeamShapes, ...]
    published: tuple[PublishedLevel, ...]

    @property
    def name(self) -> str:
        """ "open", or what is closed."""
        if len(self.closed) > MOST_NAMED:
            return f"{len(self.closed)} contacts closed, {self.closed[0]} to {self.closed[-1]}"
        return " and ".join(self.closed) + " closed" if self.closed else "open"


def level_modes(comparison: Comparison) -> tuple[LevelModes, ...]:
    """The open level, a lone contact's closed one, and those the reference held longest; none for matrices."""
    setup, beams = comparison.setup, comparison.setup.mechanics.beams
    if beams is None:
        return ()
    contacts = setup.contacts(rigid=setup.mechanics.parameter_set is not None)
    held = level_durations(comparison.reference.contact_intervals, setup.t_end) if comparison.reference.ok else {}
    longest = sorted(held, key=lambda closed: -held[closed])
    alone = [(contacts[0].name,)] if len(contacts) == 1 else []
    model, (stations, rows) = MultiPhiModel(setup.structure, contacts, modes=MODE_COUNT), _stations(beams)
    drawn = MultiPhiModel(stations.structure, contacts, modes=MODE_COUNT)
    published = published_frequencies().values() if setup.mechanics.parameter_set else ()
    return tuple(
        LevelModes(
            closed=closed,
            share=held.get(closed, 0.0) / setup.t_end if held else None,
            frequencies=model.level(closed).frequencies[:MODE_COUNT],
            beams=_shapes(beams, contacts, closed, rows @ drawn.level(closed).shapes[:, :MODE_COUNT]),
            published=tuple(column for column in published if column.level == closed),
        )
        for closed in list(dict.fromkeys([(), *alone, *longest]))[:MOST_LEVELS]
    )


@rc_context(STYLE)
def mode_figure(levels: Sequence[LevelModes]) -> Figure:
    """The lowest mode shapes of every level: its beams, from top to bottom, along x."""
    figure = Figure(figsize=(WIDTH, (1.2 + 0.9 * len(levels[0].beams)) * len(levels) + 0.3))
    for part, level in zip(figure.subfigures(len(levels), 1, squeeze=False)[:, 0], levels, strict=True):
        held = "" if level.share is None else f": {100 * level.share:.3g} % of the reference's run"
        part.suptitle(level.name + held, x=0.01, ha="left", fontsize=10)
        row = part.subplots(1, len(level.frequencies), sharex=True, sharey=True, squeeze=False)[0]
        for mode, axes in enumerate(row):
            _draw_mode(axes, level, mode)
        names = [beam.name for beam in level.beams] if len(level.beams) > 1 else []
        row[0].set_yticks(-BEAM_SPACING * np.arange(len(names)), names, fontsize=9)
    return figure


def _stations(beams: Beams) -> tuple[LinearBeams, np.ndarray]:
    """The beams as linear elements with points at their stations, and the rows (beams, stations, n) of these."""
    parts = {
        name: replace(beam, points=dict(beam.points) | {f"{i}": x for i, x in enumerate(_along(beams, name).tolist())})
        for name, beam in beams.parts.items()
    }
    linear = LinearBeams(replace(beams, parts=parts), ELEMENTS)
    prefixes = ["" if name == NAMELESS else f"{name}." for name in parts]
    rows = [[linear.structure.row(f"{prefix}{i}") for i in range(STATIONS)] for prefix in prefixes]
    return linear, np.array(rows)


def _along(beams: Beams, name: str) -> np.ndarray:
    return np.linspace(beams.parts[name].start, beams.parts[name].end, STATIONS)


def _shapes(
    beams: Beams, contacts: Sequence[UnilateralContact], closed: Sequence[str], deflections: np.ndarray
) -> tuple[BeamShapes, ...]:
    """Every beam in the modes of a level, the largest value of each mode 1, the tip that moves most above zero.

    deflections: (beams, stations, m), beams in the scene's order.
    """
    tips = deflections[:, -1]
    most = np.take_along_axis(tips, np.argmax(np.abs(tips), axis=0)[None], axis=0)[0]
    scaled = deflections * np.where(most < 0, -1.0, 1.0) / np.max(np.abs(deflections), axis=(0, 1))
    of: Mapping[str, np.ndarray] = dict(zip(beams.parts, scaled, strict=True))
    met = [beams.points[point] for c in contacts if c.name in closed for point in coefficients(c)]
    return tuple(
        BeamShapes(
            name=name,
            x=_along(beams, name) + shift,
            shapes=of[name].T,
            masses=tuple(mass.at + shift for mass in beams.parts[name].masses),
            contacts=tuple(x + shift for beam, x in met if beam == name),
        )
        for name, shift in beam_places(beams, contacts).items()
    )


def _draw_mode(axes: Axes, level: LevelModes, mode: int) -> None:
    for number, beam in enumerate(level.beams):
        zero, shape = -BEAM_SPACING * number, beam.shapes[mode]
        axes.plot(beam.x[[0, -1]], [zero, zero], color=LINE, lw=0.8)
        axes.plot(beam.x, zero + shape, color=COLOURS[0], lw=1.6)
        for places, marker, colour in ((beam.masses, "s", "#000000"), (beam.contacts, "^", "#D55E00")):
            axes.plot(places, zero + np.interp(places, beam.x, shape), marker, color=colour, ms=6)
    axes.set_title(f"mode {mode + 1}, {level.frequencies[mode]:.2f} Hz", fontsize=9)
    axes.tick_params(axis="y", length=0)
    axes.set_xlabel("x [m]", fontsize=9)
    axes.grid(visible=False)
