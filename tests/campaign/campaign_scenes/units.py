"""A scene in other units of time, length and mass, and its loads as they go on after an instant."""

import math
from dataclasses import replace

import numpy as np

import multiphi_exudyn as mp


def scaled(scene):
    """(model, t_end, displacement, velocity, loads) in the scene's units."""
    if scene.units == (0, 0, 0):
        return scene.model, scene.t_end, scene.displacement, scene.velocity, scene.loads
    time, length, mass = (2.0**power for power in scene.units)
    return in_units(scene, time, length, mass)


def in_units(scene, time, length, mass):
    """The scene's arguments, times in units of 1/time s and so on: numbers are multiplied by powers of two."""
    model, stiff = scene.model, mass / time**2
    force = stiff * length
    old = model.structure
    damping = old.damping
    if isinstance(damping, mp.RayleighDamping):
        damping = mp.RayleighDamping(damping.alpha / time, damping.beta * time)
    elif isinstance(damping, np.ndarray):
        damping = damping * (mass / time)
    points = dict(old.points)
    structure = mp.LinearStructure(old.mass * mass, old.stiffness * stiff, damping, points)
    contacts = []
    for item in model.contacts:
        if isinstance(item, mp.ForceLaw):
            contacts.append(mp.ForceLaw(item.at, (item.knots * length, item.forces * force), name=item.name))
        elif isinstance(item, mp.Friction):
            limits = {"limit": item.limit * force, "static_limit": item.static_limit * force}
            changed = {"stiffness": item.stiffness * stiff, "velocity": item.velocity * length / time}
            contacts.append(replace(item, **limits, **changed))
        else:
            changed = {"stiffness": item.stiffness * stiff, "damping": item.damping * mass / time}
            changed["tangential_stiffness"] = item.tangential_stiffness * stiff
            changed["tangential_velocity"] = item.tangential_velocity * length / time
            contacts.append(replace(item, gap=item.gap * length, **changed))
    loads = tuple(_load_in_units(load, time, length, mass, force) for load in scene.loads)
    return (
        mp.MultiPhiModel(structure, contacts, modes=model.modes),
        scene.t_end * time,
        scene.displacement * length,
        scene.velocity * (length / time),
        loads,
    )


def _load_in_units(load, time, length, mass, force):
    if isinstance(load, mp.ConstantLoad):
        return replace(load, force=load.force * force)
    if isinstance(load, mp.Gravity):
        return replace(load, acceleration=load.acceleration * length / time**2)
    if isinstance(load, mp.HarmonicLoad):
        return replace(load, amplitude=load.amplitude * force, frequency_hz=load.frequency_hz / time)
    if isinstance(load, mp.SampledLoad):
        return mp.SampledLoad(load.at, load.time * time, load.force * force)
    if isinstance(load, mp.SweepLoad):
        hertz = load.start_hz / time, load.end_hz / time
        return mp.SweepLoad(load.at, load.amplitude * force, *hertz, load.duration * time, load.law, load.tolerance)
    if isinstance(load, mp.FunctionLoad):
        breaks = tuple(t * time for t in load.breaks)
        return mp.FunctionLoad(load.at, lambda t: force * load.function(t / time), load.tolerance, breaks)
    return replace(load, course=_course_in_units(load.course, time, length))


def _course_in_units(course, time, length):
    if isinstance(course, mp.Harmonic):
        return mp.Harmonic(course.amplitude * length, course.frequency_hz / time, course.phase)
    if isinstance(course, mp.Smooth):
        return mp.Smooth(lambda t: length * course.function(t / time), course.tolerance)
    hertz = course.start_hz / time, course.end_hz / time
    return mp.Sweep(course.amplitude * length, *hertz, course.duration * time, course.law, course.tolerance)


def later(load, t):
    """The load as it goes on after t, for a run that begins there."""
    if isinstance(load, mp.HarmonicLoad):
        return replace(load, phase=load.phase + 2 * math.pi * load.frequency_hz * t)
    return load
