"""Mode shapes and frequencies of the levels a run was in, for drawing; of the rig beside the published tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from multiphi_exudyn.levels.model import MultiPhiModel
from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.structure import LinearStructure
from multiphi_exudyn.study.comparison.compare import Comparison
from multiphi_exudyn.study.comparison.placement import Placement, meeting, placements
from multiphi_exudyn.study.measures.metrics import held_levels
from multiphi_exudyn.study.scene.discretised import LinearBeams
from multiphi_exudyn.study.scene.workbench import ELEMENTS
from reference_models.beams import NAMELESS, Beams
from reference_models.rig import PublishedLevel, published_frequencies

__all__ = ["BeamShapes", "LevelModes", "level_modes"]

SHOWN = 4  # modes, as many as the paper's tables list
STATIONS = 101  # places along a beam
MOST_LEVELS = 4  # the open one, and those held longest
LISTED = 3  # closed contacts that a level's name lists


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
        if len(self.closed) > LISTED:
            return f"{len(self.closed)} contacts closed, {self.closed[0]} to {self.closed[-1]}"
        return " and ".join(self.closed) + " closed" if self.closed else "open"


def level_modes(comparison: Comparison) -> tuple[LevelModes, ...]:
    """The open level, a lone contact's closed one, and those the reference held longest; none for matrices."""
    bench = comparison.bench
    if bench.mechanics.beams is None:
        return ()
    contacts = bench.contacts(rigid=bench.mechanics.parameter_set is not None)
    names = tuple(contact.name for contact in contacts)
    shares = _shares(comparison)
    longest = sorted(shares, key=lambda closed: -shares[closed])
    wanted = list(dict.fromkeys([(), *([names] if len(names) == 1 else []), *longest]))[:MOST_LEVELS]
    drawn = _Drawn.of(bench.mechanics.beams, contacts)
    published = published_frequencies().values() if bench.mechanics.parameter_set else ()
    return tuple(
        LevelModes(
            closed=closed,
            share=shares.get(closed, 0.0) if shares else None,
            frequencies=MultiPhiModel(bench.structure, contacts, modes=SHOWN).level(closed).frequencies[:SHOWN],
            beams=drawn.shapes(closed),
            published=tuple(column for column in published if column.level == closed),
        )
        for closed in wanted
    )


def _shares(comparison: Comparison) -> dict[tuple[str, ...], float]:
    """Closed contacts -> share of the reference's run; empty where it failed."""
    if not comparison.reference.ok:
        return {}
    end = comparison.bench.t_end
    return {closed: held / end for closed, held in held_levels(comparison.reference.contact_intervals, end).items()}


@dataclass(frozen=True)
class _Drawn:
    """Beams as linear elements whose deflection is known at stations: name -> x (k,) [m] and rows (k, n)."""

    beams: Beams
    contacts: Sequence[UnilateralContact]
    model: MultiPhiModel
    stations: Mapping[str, tuple[np.ndarray, np.ndarray]]
    places: Mapping[str, Placement]

    @classmethod
    def of(cls, beams: Beams, contacts: Sequence[UnilateralContact]) -> _Drawn:
        """The beams with points at their stations."""
        x = {name: np.linspace(beam.start, beam.end, STATIONS) for name, beam in beams.parts.items()}
        parts = {
            name: replace(beam, points=dict(beam.points) | {f"{i}": float(place) for i, place in enumerate(x[name])})
            for name, beam in beams.parts.items()
        }
        structure = LinearBeams(replace(beams, parts=parts), ELEMENTS).structure
        stations = {name: (along, _rows(structure, name)) for name, along in x.items()}
        model = MultiPhiModel(structure, contacts, modes=SHOWN)
        return cls(beams, contacts, model, stations, placements(beams, contacts))

    def shapes(self, closed: tuple[str, ...]) -> tuple[BeamShapes, ...]:
        """Every beam in the modes of a level, the largest value of each mode 1, the tip that moves most above zero."""
        modes = self.model.level(closed).shapes[:, :SHOWN]
        of = {name: rows @ modes for name, (_, rows) in self.stations.items()}
        tips = np.array([values[-1] for values in of.values()])
        most = np.take_along_axis(tips, np.argmax(np.abs(tips), axis=0)[None], axis=0)[0]
        scale = np.where(most < 0, -1.0, 1.0) / np.max(
            [np.max(np.abs(values), axis=0) for values in of.values()], axis=0
        )
        struck = [self.beams.points[point] for c in self.contacts if c.name in closed for point in meeting(c)]
        return tuple(
            BeamShapes(
                name=name,
                x=self.stations[name][0] + place.shift,
                shapes=(of[name] * scale).T,
                masses=tuple(mass.at + place.shift for mass in self.beams.parts[name].masses),
                contacts=tuple(x + place.shift for beam, x in struck if beam == name),
            )
            for name, place in sorted(self.places.items(), key=lambda item: (item[1].group, -item[1].height))
        )


def _rows(structure: LinearStructure, beam: str) -> np.ndarray:
    """Rows (k, n) that give the deflections of a beam at its stations."""
    names = (f"{i}" if beam == NAMELESS else f"{beam}.{i}" for i in range(STATIONS))
    return np.array([structure.row(name) for name in names])
