"""What acts on a full beam in time: forces on the coordinates of its linear structure, and ways of its stops.

    f(t) = sum_j p_j u_j(t),   g_i = h_i.x + gap_i - z_i(t)

Loads are those of multiphi_exudyn.mechanics.loads and mean the same here: a load is its row p and its course u; gravity
is p = M e; a moving base is the frame x is measured in, so that it acts by its inertia force, p = -M e and u = z'', and
moves a stop that stays behind by z_i = -(h_i.e) z. This is exact for large displacements too: the mass matrix of both
beams is constant, and their elastic forces do not change when the frame is shifted. M e is the whole inertia only where
e is ``FullBeam.transverse``; see there. Loads and motions set in at t = 0.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.mathematics.piecewise_exponential import PiecewiseExponential
from multiphi_exudyn.mechanics.loads import BaseMotion, ConstantLoad, Gravity, Load, StopMotion, VaryingLoad
from multiphi_exudyn.mechanics.structure import LinearStructure
from reference_models.point_contact import PointContact

__all__ = ["Actions", "Way", "actions_of"]

BEYOND = 1 + 1e-6  # of the run's end: histories reach past the last step, whose time is rounded


@dataclass(frozen=True)
class Way:
    """z(t) = sum of factor * history(t) [m], of one stop."""

    parts: tuple[tuple[float, PiecewiseExponential], ...]

    def at(self, time: np.ndarray) -> np.ndarray:
        """z (k,) at times (k,)."""
        return np.sum([factor * history.at(time) for factor, history in self.parts], axis=0)

    def rate(self, time: np.ndarray) -> np.ndarray:
        """z' (k,) at times (k,)."""
        return np.sum([factor * history.derivative.at(time) for factor, history in self.parts], axis=0)


@dataclass(frozen=True)
class Actions:
    """rows: p (m, n) in the structure's coordinates. courses: their u, m histories. ways: z of contacts, by name."""

    rows: np.ndarray
    courses: tuple[PiecewiseExponential, ...]
    ways: Mapping[str, Way]

    @property
    def none(self) -> bool:
        """True where nothing acts and nothing is moved."""
        return not (self.courses or self.ways)

    def values(self, time: np.ndarray) -> np.ndarray:
        """u (k, m) at times (k,)."""
        return np.array([course.at(time) for course in self.courses]).reshape(len(self.courses), len(time)).T


def actions_of(
    structure: LinearStructure, contacts: Sequence[PointContact], loads: Sequence[Load], t_end: float
) -> Actions:
    """The loads up to t_end [s]; raises MultiPhiValueError or MultiPhiTypeError for one that cannot act here."""
    rows: list[np.ndarray] = []
    courses: list[PiecewiseExponential] = []
    ways: dict[str, list[tuple[float, PiecewiseExponential]]] = {}
    end = t_end * BEYOND
    for load in loads:
        if isinstance(load, (ConstantLoad, Gravity)):
            rows.append(load.row(structure))
            courses.append(PiecewiseExponential.constant(1.0))
        elif isinstance(load, VaryingLoad):
            rows.append(structure.row(load.at))
            courses.append(load.course.history(end))
        elif isinstance(load, StopMotion):
            _check_names("stop motion contact", [load.contact], contacts)
            ways.setdefault(load.contact, []).append((1.0, load.course.history(end)))
        elif isinstance(load, BaseMotion):
            _check_names("fixed_stops", load.fixed_stops, contacts)
            moved, history = structure.row(load.direction), load.course.history(end)
            rows.append(-(structure.mass @ moved))
            courses.append(history.derivative.derivative)
            for contact in contacts:
                if contact.name in load.fixed_stops:
                    along = float(structure.row(contact.direction) @ moved)
                    ways.setdefault(contact.name, []).append((-along, history))
        else:
            raise MultiPhiTypeError(f"loads: got {type(load).__name__}, need loads of multiphi_exudyn.mechanics.loads")
    return Actions(
        np.array(rows).reshape(len(rows), structure.n),
        tuple(courses),
        {name: Way(tuple(parts)) for name, parts in ways.items()},
    )


def _check_names(what: str, names: Sequence[str], contacts: Sequence[PointContact]) -> None:
    known = [contact.name for contact in contacts]
    for name in names:
        if name not in known:
            raise MultiPhiValueError(f"{what}: got {name!r}, need one of: {', '.join(known) or 'none'}")
