"""One case in other units of time, length and mass: every number changes, nothing that happens does."""

from dataclasses import dataclass, replace

import numpy as np

import multiphi_exudyn as mp


@dataclass(frozen=True)
class Units:
    """How many new units the old ones of time, length and mass are."""

    time: float = 1.0
    length: float = 1.0
    mass: float = 1.0

    @property
    def force(self):
        return self.mass * self.length / self.time**2

    @property
    def stiffness(self):
        return self.mass / self.time**2

    @property
    def damping(self):
        return self.mass / self.time

    @property
    def energy(self):
        return self.force * self.length

    @property
    def speed(self):
        return self.length / self.time


def in_units(case, units):
    """Arguments of ``simulate`` for a case (model, t_end, displacement, velocity, loads), in other units."""
    return {
        "model": replace(
            case.model,
            structure=_structure(case.model.structure, units),
            contacts=[_contact(given, units) for given in case.contacts],
        ),
        "t_end": case.t_end * units.time,
        "displacement": case.displacement * units.length,
        "velocity": case.velocity * units.speed,
        "loads": [_load(load, units) for load in case.loads],
    }


def _structure(given, units):
    damping = given.damping
    if isinstance(damping, mp.RayleighDamping):
        damping = mp.RayleighDamping(damping.alpha / units.time, damping.beta * units.time)
    elif damping is not None and not isinstance(damping, mp.ModalDamping):
        damping = damping * units.damping
    return mp.LinearStructure(given.mass * units.mass, given.stiffness * units.stiffness, damping, dict(given.points))


def _contact(given, units):
    if isinstance(given, mp.ForceLaw):
        q, force = given.law
        return replace(given, law=(np.asarray(q) * units.length, np.asarray(force) * units.force))
    return replace(
        given,
        gap=given.gap * units.length,
        stiffness=given.stiffness * units.stiffness,
        damping=given.damping * units.damping,
    )


def _load(given, units):
    if isinstance(given, mp.ConstantLoad):
        return replace(given, force=given.force * units.force)
    if isinstance(given, mp.Gravity):
        return replace(given, acceleration=given.acceleration * units.speed / units.time)
    if isinstance(given, mp.HarmonicLoad):
        return mp.HarmonicLoad(given.at, given.amplitude * units.force, given.frequency_hz / units.time, given.phase)
    assert isinstance(given, mp.StopMotion)
    course = replace(
        given.course,
        amplitude=given.course.amplitude * units.length,
        frequency_hz=given.course.frequency_hz / units.time,
    )
    return mp.StopMotion(given.contact, course)
