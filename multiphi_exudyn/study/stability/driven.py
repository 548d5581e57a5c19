"""Cases of what varies in time: resonance, loads that jump, stops and bases that move."""

from __future__ import annotations

import math

import numpy as np

from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.loads import BaseMotion, HarmonicLoad, SampledLoad, StopMotion
from multiphi_exudyn.mechanics.time_functions import Harmonic
from multiphi_exudyn.study.stability.case import Case, Problem
from multiphi_exudyn.study.stability.starts import BILINEAR
from multiphi_exudyn.study.stability.structures import STOP, in_a_row, stop, two_masses

__all__ = ["CASES"]

FIRST = math.sqrt(1e4 * (3 - math.sqrt(5)) / 2) / (2 * math.pi)  # Hz, of the two masses
RESONANT = HarmonicLoad("m0", 5.0, FIRST)
JUMPING = SampledLoad("m1", np.array([0.1, 0.25, 0.6]), np.array([-40.0, -60.0, -80.0]))
SHAKEN = Harmonic(2e-3, 7.0)


def _loaded(stiffness: float, load: HarmonicLoad | SampledLoad | BaseMotion, t_end: float = 1.0) -> Problem:
    """Two masses at rest above a stop."""
    return two_masses(stop("m1", 2e-3, stiffness), t_end=t_end, loads=[load])


def _moving_stop(stiffness: float, damping: float = 0.0) -> Problem:
    """Two masses let go above a stop that goes up and down."""
    contact = UnilateralContact(STOP, "m1", 3e-3, stiffness, damping)
    moving = StopMotion(STOP, SHAKEN)
    return in_a_row([1.0, 1.0], [1e4, 1e4], [contact], 1.0, [2e-3, 5e-3], loads=[moving])


def _switched() -> Problem:
    """The bilinear oscillator under a force that ends when the mass comes to its stop."""
    contact, start = stop("m0", 0.0, BILINEAR.contact_stiffness), 1.5 * BILINEAR.amplitude
    offset = BILINEAR.stiffness * BILINEAR.amplitude * np.array([0.5, 0.5])
    load = SampledLoad("m0", np.array([0.0, 1.5 * BILINEAR.closed_interval[0]]), offset)
    return in_a_row([BILINEAR.mass], [BILINEAR.stiffness], [contact], 3.0, [start], loads=[load])


CASES = (
    Case("resonance-compliant",
         "Driven at a natural frequency without damping: amplitude grows until the stop changes the frequency.",
         lambda quick: _loaded(1e5, RESONANT, 2.0)),
    Case("resonance-rigid", "Driven at a natural frequency against a rigid stop.",
         lambda quick: _loaded(math.inf, RESONANT, 2.0)),
    Case("load-changes-at-event",
         "The load ends at the instant at which the contact closes: two reasons for one new piece of motion.",
         lambda quick: _switched()),
    Case("load-jumps-compliant",
         "A sampled load comes and goes at once: the motion goes on with a force that is not continuous.",
         lambda quick: _loaded(1e5, JUMPING)),
    Case("load-jumps-rigid", "A sampled load that presses onto a rigid stop jumps: so does the reaction.",
         lambda quick: _loaded(math.inf, JUMPING), quick=False),
    Case("moving-stop-compliant", "The stop goes up and down: it does work on what it touches.",
         lambda quick: _moving_stop(1e5)),
    Case("moving-stop-viscous",
         "A soft stop with a strong damper goes up and down: its damper presses by its own speed too.",
         lambda quick: _moving_stop(1e4, 100.0)),
    Case("moving-stop-rigid", "A rigid stop carries what lies on it and lets it go where it falls faster.",
         lambda quick: _moving_stop(math.inf)),
    Case("moving-base-compliant", "The base shakes, its stop with it.",
         lambda quick: _loaded(1e5, BaseMotion(np.ones(2), SHAKEN)), quick=False),
    Case("moving-base-fixed-rigid-stop",
         "The base shakes, the rigid stop stays where it is: it moves as seen from the base.",
         lambda quick: _loaded(math.inf, BaseMotion(np.ones(2), SHAKEN, (STOP,)))),
)  # fmt: skip
