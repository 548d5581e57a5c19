"""Cases of loads that vary in time: resonance, and a load that changes at the very instant of an event."""

from __future__ import annotations

import math

import numpy as np

from multiphi_exudyn.loads import HarmonicLoad, SampledLoad
from multiphi_exudyn.study.stability.case import Case, Problem
from multiphi_exudyn.study.stability.starts import BILINEAR
from multiphi_exudyn.study.stability.structures import chain, oscillator, stop

__all__ = ["CASES"]


def _resonant(stiffness: float) -> Problem:
    """Two masses driven at their first natural frequency until they beat against the stop."""
    structure = chain([1.0, 1.0], [1e4, 1e4])
    first = math.sqrt(1e4 * (3 - math.sqrt(5)) / 2) / (2 * math.pi)
    return Problem(structure, [stop("m1", 2e-3, stiffness)], 2.0, loads=[HarmonicLoad("m0", 5.0, first)])


def _switched() -> Problem:
    """The bilinear oscillator under a force that ends when the mass comes to its stop."""
    structure = oscillator(BILINEAR.mass, BILINEAR.stiffness)
    contact = stop("m0", 0.0, BILINEAR.contact_stiffness)
    closing = BILINEAR.closed_interval[0]
    offset = BILINEAR.stiffness * BILINEAR.amplitude * np.array([0.5, 0.5])
    load = SampledLoad("m0", np.array([0.0, 1.5 * closing]), offset)
    return Problem(structure, [contact], 3.0, displacement=np.array([1.5 * BILINEAR.amplitude]), loads=[load])


CASES = (
    Case(
        "resonance-compliant",
        "Driven at a natural frequency without damping: amplitude grows until the stop changes the frequency.",
        lambda quick: _resonant(1e5),
    ),
    Case(
        "resonance-rigid",
        "Driven at a natural frequency against a rigid stop.",
        lambda quick: _resonant(math.inf),
    ),
    Case(
        "load-changes-at-event",
        "The load ends at the instant at which the contact closes: two reasons for one new piece of motion.",
        lambda quick: _switched(),
    ),
)
