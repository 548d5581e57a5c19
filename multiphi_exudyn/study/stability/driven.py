"""Cases of what varies in time: resonance, loads that jump, stops and bases that move."""

from __future__ import annotations

import math

import numpy as np

from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.loads import HarmonicLoad, SampledLoad
from multiphi_exudyn.mechanics.moving_supports import BaseMotion, StopMotion
from multiphi_exudyn.mechanics.time_functions import Harmonic
from multiphi_exudyn.study.stability.case import Case, Problem
from multiphi_exudyn.study.stability.starts import BILINEAR
from multiphi_exudyn.study.stability.structures import STOP, chain, oscillator, stop

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


def _jumping(stiffness: float) -> Problem:
    """Two masses under a force that comes and goes at once."""
    load = SampledLoad("m1", np.array([0.1, 0.25, 0.6]), np.array([-40.0, -60.0, -80.0]))
    return Problem(chain([1.0, 1.0], [1e4, 1e4]), [stop("m1", 2e-3, stiffness)], 1.0, loads=[load])


def _moving_stop(stiffness: float, damping: float = 0.0) -> Problem:
    """Two masses let go above a stop that goes up and down."""
    moving = StopMotion(STOP, Harmonic(2e-3, 7.0))
    structure, start = chain([1.0, 1.0], [1e4, 1e4]), np.array([2e-3, 5e-3])
    contact = UnilateralContact(STOP, "m1", 3e-3, stiffness, damping)
    return Problem(structure, [contact], 1.0, displacement=start, loads=[moving])


def _moving_base(stiffness: float, fixed: tuple[str, ...] = ()) -> Problem:
    """Two masses whose base shakes."""
    shaken = BaseMotion(np.ones(2), Harmonic(2e-3, 7.0), fixed)
    return Problem(chain([1.0, 1.0], [1e4, 1e4]), [stop("m1", 2e-3, stiffness)], 1.0, loads=[shaken])


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
    Case(
        "load-jumps-compliant",
        "A sampled load comes and goes at once: the motion goes on with a force that is not continuous.",
        lambda quick: _jumping(1e5),
    ),
    Case(
        "load-jumps-rigid",
        "A sampled load that presses onto a rigid stop jumps: so does the reaction.",
        lambda quick: _jumping(math.inf),
        quick=False,
    ),
    Case(
        "moving-stop-compliant",
        "The stop goes up and down: it does work on what it touches.",
        lambda quick: _moving_stop(1e5),
    ),
    Case(
        "moving-stop-viscous",
        "A soft stop with a strong damper goes up and down: its damper presses by its own speed too.",
        lambda quick: _moving_stop(1e4, 100.0),
    ),
    Case(
        "moving-stop-rigid",
        "A rigid stop carries what lies on it and lets it go where it falls faster.",
        lambda quick: _moving_stop(math.inf),
    ),
    Case(
        "moving-base-compliant",
        "The base shakes, its stop with it.",
        lambda quick: _moving_base(1e5),
        quick=False,
    ),
    Case(
        "moving-base-fixed-rigid-stop",
        "The base shakes, the rigid stop stays where it is: it moves as seen from the base.",
        lambda quick: _moving_base(math.inf, (STOP,)),
    ),
)
