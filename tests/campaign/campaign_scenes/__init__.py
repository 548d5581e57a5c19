"""Random scenes of what users bring, one kind each: loads, moving stops and bases, dampers, force laws,
free bodies, dry friction.

``scene_of(kind, number)`` draws a scene from its kind and number alone; a new kind does not change what others draw.
A scene holds the arguments of ``simulate`` and the same system in plain numbers for brute force (brute_force). Each
has an answer: no start lies inside a rigid stop, and rigid stops do not contradict each other.

Order: parts, plain, loads, kinds, sliders, lattice, coincidences, units, borders, bodies, crowds.
"""

import itertools
from dataclasses import replace

import numpy as np

from campaign_scenes import bodies, borders, coincidences, crowds, kinds, lattice, sliders
from campaign_scenes.plain import plain_scene
from campaign_scenes.units import later, scaled

__all__ = ["KINDS", "later", "numbers", "scaled", "scene_of"]

DRAWN = kinds.DRAWN | sliders.DRAWN | lattice.DRAWN | borders.DRAWN | coincidences.DRAWN | bodies.DRAWN | crowds.DRAWN
KINDS = ("plain", *DRAWN)


def scene_of(kind, number):
    """The scene of this kind with this number."""
    if kind == "plain":
        return plain_scene(number)
    seeds = [number, *kind.encode(), 14]
    return replace(DRAWN[kind](np.random.default_rng(seeds)), kind=kind, number=number)


def numbers(kinds, first, count):
    """(kind, number) of ``count`` cases spread evenly over kinds, numbers from ``first`` on."""
    return list(itertools.islice(((kind, k) for k in itertools.count(first) for kind in kinds), count))
