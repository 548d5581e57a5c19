"""Histories of points and gaps of a full beam, from what was recorded at its steps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from multiphi_exudyn.beam import Beam
from reference_models.beam_system import AXIAL, DEFLECTION, BeamSystem
from reference_models.full_beam_settings import FullBeamSettings
from reference_models.point_contact import PointContact
from reference_models.recorder import Recorder

__all__ = ["Histories", "watched_coordinates"]


@dataclass(frozen=True)
class Histories:
    """Deflections [m] of points and gaps [m] of contacts by name, (s,) each, at times (s,) [s]."""

    time: np.ndarray
    points: dict[str, np.ndarray]
    gaps: dict[str, np.ndarray]

    @classmethod
    def recorded(
        cls, recorder: Recorder, beam: Beam, contacts: Sequence[PointContact], settings: FullBeamSettings
    ) -> Histories:
        """The recorded steps, up to the last one at which everything is finite."""
        time, watched = np.array(recorder.times), np.array(recorder.watched)
        count = np.argmin(np.append(np.all(np.isfinite(watched), axis=1), False))
        columns = watched[:count].T
        points = dict(zip(beam.points, columns, strict=False))
        pairs = columns[len(points) :].reshape(len(contacts), 2, count)
        gaps = {
            contact.name: contact.of_distance(_distance(contact, settings, *pair))
            for contact, pair in zip(contacts, pairs, strict=True)
        }
        return cls(time[:count], points, gaps)

    def at(self, time: np.ndarray) -> Histories:
        """The same at other times (k,), by cubic splines through the steps."""
        if len(self.time) < 2:
            return self
        return Histories(time, self._splined(self.points, time), self._splined(self.gaps, time))

    def _splined(self, given: dict[str, np.ndarray], time: np.ndarray) -> dict[str, np.ndarray]:
        return {name: CubicSpline(self.time, values)(time) for name, values in given.items()}


def watched_coordinates(system: BeamSystem, beam: Beam, contacts: Sequence[PointContact]) -> np.ndarray:
    """Indices of the coordinates a Histories needs: deflections, then (axial, deflection) of contacts."""
    points = [system.coordinate(x) for x in beam.points.values()]
    touching = [
        system.coordinate(beam.points[contact.point], component)
        for contact in contacts
        for component in (AXIAL, DEFLECTION)
    ]
    return np.array([*points, *touching], dtype=int)


def _distance(
    contact: PointContact, settings: FullBeamSettings, axial: np.ndarray, deflection: np.ndarray
) -> np.ndarray:
    """Distance [m] of the contact's node from its stop; for a round one, from the node to the circle."""
    above = deflection if contact.above else -deflection  # travel towards the stop
    if settings.contact == "coordinate":
        return contact.distance - above
    centre = contact.distance + settings.circle_radius
    return np.hypot(axial, centre - above) - settings.circle_radius
