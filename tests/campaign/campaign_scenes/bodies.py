"""Scenes for Exudyn: static solutions of a body, steps that its modes are not matched to, joints to be reduced."""

from dataclasses import replace

import numpy as np

import multiphi_exudyn as mp
from campaign_scenes.parts import Joint, Parts, add_contacts, random_parts, random_velocity

SLOWEST_STEPS, FASTEST_STEPS = 0.5, 3.0  # powers of ten: steps in the shortest period of the open level


def _statics(random):
    """A chain with contacts that give way, a constant force at a point of its interface."""
    parts = random_parts(random, int(random.integers(2, 6)), structure="chain", damping="none")
    add_contacts(parts, "compliant", gap=(0.0, 0.1))
    at = int(random.integers(parts.n))
    parts.loads.append(mp.ConstantLoad(f"m{at}", float(random.choice([-1.0, 1.0]) * 10.0 ** random.uniform(-1, 1.5))))
    return replace(parts.scene(), in_exudyn="static")


def _unmatched(random):
    """A chain that meets a stop, in steps of a third to a thousandth of its shortest period."""
    parts = random_parts(random, int(random.integers(2, 6)), structure="chain", damping="rayleigh")
    add_contacts(parts, "compliant", 1)
    scene = parts.scene(velocity=random_velocity(parts))
    periods = scene.t_end * scene.model.level(()).highest_frequency
    steps = int(np.ceil(periods * 10.0 ** random.uniform(SLOWEST_STEPS, FASTEST_STEPS)))
    return replace(scene, in_exudyn="unmatched", steps=steps)


def _jointed(random):
    """Masses in a row, the motions of two of them tied, velocities that violate the joint, a stop at one of them.

    x = T q in the motions that the joint leaves; the system for brute force is that of q. The start has the momentum
    along T of the velocities that were given.
    """
    parts = random_parts(random, int(random.integers(2, 5)), structure="chain", damping="none")
    n, velocity = parts.n, random_velocity(parts)
    one, other = (int(k) for k in random.choice(n, 2, replace=False))
    ratio = float(random.choice([1.0, -1.0, 0.5, 2.0]))
    tied = np.delete(np.eye(n), other, axis=1)
    tied[other] = ratio * tied[one]
    at = int(random.integers(n))
    stop = (at, float(random.uniform(0.02, 0.2)), float(10.0 ** random.uniform(2, 3)))
    mass, stiffness = (tied.T @ matrix @ tied for matrix in (parts.mass, parts.stiffness))
    own = Parts(random, mass, stiffness)
    own.contact(tied[at], *stop[1:])
    start = np.linalg.solve(mass, tied.T @ parts.mass @ velocity)
    scene = own.scene(velocity=start)
    return replace(
        scene, in_exudyn="jointed", joint=Joint(parts.mass, parts.stiffness, velocity, tied, one, other, ratio, stop)
    )


DRAWN = {"body statics": _statics, "body unmatched": _unmatched, "joints": _jointed}
