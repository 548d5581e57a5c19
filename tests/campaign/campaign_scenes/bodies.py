"""Scenes for a body in Exudyn: a static solution, and steps that its modes are not matched to."""

from dataclasses import replace

import numpy as np

import multiphi_exudyn as mp
from campaign_scenes.parts import add_contacts, random_parts, random_velocity

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


DRAWN = {"body statics": _statics, "body unmatched": _unmatched}
