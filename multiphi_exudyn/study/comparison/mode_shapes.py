"""Mode shapes and frequencies of a beam's levels, for drawing beside the published tables."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from multiphi_exudyn.beam import Beam, planar_beam
from multiphi_exudyn.model import MultiPhiModel
from multiphi_exudyn.structure import LinearStructure
from multiphi_exudyn.study.scene.workbench import ELEMENTS, Workbench
from reference_models.rig import PublishedLevel, published_frequencies

__all__ = ["LevelModes", "level_modes"]

SHOWN = 4  # modes, as many as the paper's tables list
STATIONS = 101  # places along the beam


@dataclass(frozen=True)
class LevelModes:
    """The lowest m modes of one level with its contacts rigid.

    closed: names of its closed contacts. frequencies: (m,) Hz, of the structure every reduced model of the
    scene has. shapes: (m, k) at x (k,) [m], largest value 1. masses, contacts: their places [m].
    published: what the paper prints for this level.
    """

    closed: tuple[str, ...]
    frequencies: np.ndarray
    x: np.ndarray
    shapes: np.ndarray
    masses: tuple[float, ...]
    contacts: tuple[float, ...]
    published: tuple[PublishedLevel, ...]

    @property
    def name(self) -> str:
        """ "open", or what is closed."""
        return " and ".join(self.closed) + " closed" if self.closed else "open"


def level_modes(bench: Workbench) -> tuple[LevelModes, ...]:
    """The open level and the one with every contact closed; none for matrices or several beams, which have no one x.

    Of contacts that cannot all be closed and rigid, each has its level: a stop below and one above the same point.
    """
    beam = bench.mechanics.beam
    if beam is None:
        return ()
    names = tuple(contact.name for contact in bench.mechanics.contacts)
    rows = np.array([bench.structure.row(contact.direction) for contact in bench.mechanics.contacts])
    together = not names or np.linalg.matrix_rank(rows) == len(names)
    closed = [names] if together else [(name,) for name in names]
    return tuple(_level_modes(bench, beam, each) for each in dict.fromkeys([(), *closed]))


def _level_modes(bench: Workbench, beam: Beam, closed: tuple[str, ...]) -> LevelModes:
    x = np.linspace(beam.start, beam.end, STATIONS)
    structure, rows = _beam_with_rows(beam, x)
    contacts = bench.contacts(rigid=True)
    shapes = rows @ MultiPhiModel(structure, contacts, modes=SHOWN).level(closed).shapes
    signs = np.sign(shapes[-1]) / np.max(np.abs(shapes), axis=0)
    places = (beam.points[c.direction] for c in contacts if c.name in closed and isinstance(c.direction, str))
    published = published_frequencies().values() if bench.mechanics.parameter_set else ()
    return LevelModes(
        closed=closed,
        frequencies=MultiPhiModel(bench.structure, contacts, modes=SHOWN).level(closed).frequencies,
        x=x,
        shapes=(shapes * signs).T,
        masses=tuple(mass.at for mass in beam.masses),
        contacts=tuple(places),
        published=tuple(column for column in published if column.level == closed),
    )


def _beam_with_rows(beam: Beam, x: np.ndarray) -> tuple[LinearStructure, np.ndarray]:
    """The beam's structure and the rows (k, n) that give its deflection at x (k,)."""
    stations = {f"{i}": float(place) for i, place in enumerate(x)}
    structure = planar_beam(replace(beam, points=dict(beam.points) | stations), ELEMENTS)
    return structure, np.array([structure.row(name) for name in stations])
