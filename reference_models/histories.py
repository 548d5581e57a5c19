"""Histories of points and gaps of a full beam, from what was recorded at its steps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from reference_models.actions import Way
from reference_models.beam_system import BeamSystem
from reference_models.full_beam_settings import FullBeamSettings
from reference_models.laid_beam import AXIAL
from reference_models.point_contact import PointContact
from reference_models.point_friction import PointFriction
from reference_models.recorder import Recorder, Watched

__all__ = ["Histories", "watched"]


@dataclass(frozen=True)
class Histories:
    """Deflections [m] of points and gaps [m] of contacts by name, (s,) each, at times (s,) [s].

    rates: g' [m/s] of viscous contacts. tensions: T [N] of frictions and of contacts with friction, slips: way [m] of
    their patches, bristles: their stiffness [N/m].
    """

    time: np.ndarray
    points: dict[str, np.ndarray]
    gaps: dict[str, np.ndarray]
    rates: dict[str, np.ndarray]
    contacts: tuple[PointContact, ...]
    tensions: dict[str, np.ndarray]
    slips: dict[str, np.ndarray]
    bristles: dict[str, float]

    @property
    def forces(self) -> dict[str, np.ndarray]:
        """lambda [N] of every contact, (s,) each."""
        return {c.name: c.force(self.gaps[c.name], self.rates.get(c.name, 0.0)) for c in self.contacts}

    @classmethod
    def recorded(
        cls,
        recorder: Recorder,
        names: Sequence[str],
        contacts: tuple[PointContact, ...],
        settings: FullBeamSettings,
        ways: Mapping[str, Way],
        frictions: Sequence[PointFriction],
    ) -> Histories:
        """The recorded steps, up to the last one at which everything is finite; names: of all points."""
        time, watched = np.array(recorder.times), np.array(recorder.watched)
        count = int(np.argmin(np.append(np.all(np.isfinite(watched), axis=1), False)))
        columns = watched[:count].T
        points = dict(zip(names, columns, strict=False))
        gaps = {
            contact.name: contact.of_distance(_distance(contact, settings, axial, contact.between(points)))
            for contact, axial in zip(contacts, columns[len(points) :], strict=True)
        }
        moving = viscous_points(contacts)
        speeds = np.array(recorder.speeds).reshape(len(time), len(moving))[:count].T
        speed = dict(zip(moving, speeds, strict=True))
        rates = {c.name: c.coefficient * c.between(speed) for c in contacts if c.damping}
        for name, way in ways.items():
            gaps[name] = gaps[name] - way.at(time[:count])
            if name in rates:
                rates[name] = rates[name] - way.rate(time[:count])
        rubbed = _rubbed(recorder, count, points, contacts, frictions)
        tensions = {name: force for name, (force, _, _) in rubbed.items()}
        slips = {name: _patch(way, force, stiffness) for name, (force, way, stiffness) in rubbed.items()}
        bristles = {name: stiffness for name, (_, _, stiffness) in rubbed.items()}
        return cls(time[:count], points, gaps, rates, contacts, tensions, slips, bristles)

    def at(self, time: np.ndarray) -> Histories:
        """The same at other times (k,), by cubic splines through the steps, straight lines for friction."""
        if len(self.time) < 2:
            return self
        points, gaps, rates = (self._splined(given, time) for given in (self.points, self.gaps, self.rates))
        tensions, slips = (self._interpolated(given, time) for given in (self.tensions, self.slips))
        return Histories(time, points, gaps, rates, self.contacts, tensions, slips, self.bristles)

    def _interpolated(self, given: dict[str, np.ndarray], time: np.ndarray) -> dict[str, np.ndarray]:
        return {name: np.interp(time, self.time, values) for name, values in given.items()}

    def _splined(self, given: dict[str, np.ndarray], time: np.ndarray) -> dict[str, np.ndarray]:
        return {name: CubicSpline(self.time, values)(time) for name, values in given.items()}


def watched(system: BeamSystem, contacts: Sequence[PointContact], forces: np.ndarray) -> Watched:
    """What a Histories needs: deflections of all points, axial motion of contacts; speeds of points of viscous ones;
    the states of frictions.
    """
    points = [system.coordinate(name) for name in system.points]
    touching = [system.coordinate(contact.point, AXIAL) for contact in contacts]
    viscous = [system.coordinate(name) for name in viscous_points(contacts)]
    data = [index for connector in system.frictions for index in connector.data]
    return Watched(_indices([*points, *touching]), _indices(viscous), forces, _indices(data), system.rubs)


def _rubbed(
    recorder: Recorder,
    count: int,
    points: Mapping[str, np.ndarray],
    contacts: Sequence[PointContact],
    frictions: Sequence[PointFriction],
) -> dict[str, tuple[np.ndarray, np.ndarray, float]]:
    """T (s,) [N], tangential way (s,) [m] and bristle [N/m] of frictions and of contacts with friction, by name."""
    time, found = np.array(recorder.times)[:count], {}
    data = np.array(recorder.data[:count]).reshape(count, len(frictions), 2)
    for i, friction in enumerate(frictions):
        way = friction.travel(points, time)
        found[friction.name] = friction.force(way, data[:, i]), way, friction.stiffness
    tangents = {contact.name: contact.tangent for contact in contacts if contact.tangent is not None}
    forces = np.array(recorder.rubbed[:count]).reshape(count, len(tangents))
    for (name, tangent), force in zip(tangents.items(), forces.T, strict=True):
        found[name] = force, tangent.travel(points, time), tangent.stiffness
    return found


def _patch(way: np.ndarray, force: np.ndarray, stiffness: float) -> np.ndarray:
    """How far (s,) [m] a bristle's foot has moved on its counter-surface since the start."""
    place = way - force / stiffness
    return place - place[:1]


def _indices(given: Sequence[int]) -> np.ndarray:
    return np.array(given, dtype=int)


def viscous_points(contacts: Sequence[PointContact]) -> list[str]:
    """Points that viscous contacts act on, each once."""
    return list(dict.fromkeys(name for contact in contacts if contact.damping for name in contact.direction))


def _distance(
    contact: PointContact, settings: FullBeamSettings, axial: np.ndarray, deflection: np.ndarray
) -> np.ndarray:
    """Distance [m] of the contact's node from its stop; for a round one, from the node to the circle."""
    above = deflection if contact.above else -deflection  # travel towards the stop
    if settings.contact == "coordinate":
        return contact.distance - above
    centre = contact.distance + settings.circle_radius
    return np.hypot(axial, centre - above) - settings.circle_radius
