"""Cases of laws: force laws that harden, soften, attract or leave a clearance, and viscous contacts."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import numpy as np

from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.force_law import ForceLaw
from multiphi_exudyn.study.stability.case import Case, Problem
from multiphi_exudyn.study.stability.structures import STOP, stop, two_masses
from multiphi_exudyn.time.trajectory import Trajectory

__all__ = ["CASES"]

FOLLOWED = 1e-3  # of the largest force of a law: its segments
BEHIND = 0.01  # m from the rest to the magnet
INSIDE = 1e-6  # m: a contact that closes deeper than this has never left its stop
ABOVE = stop({"m1": -1.0}, 7e-3)  # on the magnet's side


def _hardening(q: Any) -> Any:
    return 1e4 * q + 1e9 * q**3


def _hertz(q: Any) -> Any:
    return -1e7 * np.maximum(0.0, -q - 1e-3) ** 1.5


def _two_wells(q: Any) -> Any:
    return -2e4 * q + 5e8 * q**3


def _magnet(strength: float, q: Any) -> Any:
    return -strength / (BEHIND - q) ** 2


def _law(function: Any, low: float = -0.02, high: float = 0.02) -> ForceLaw:
    return ForceLaw("m1", function, FOLLOWED, span=(low, high))


def _clearance() -> ForceLaw:
    """Nothing within 1 mm, 1e6 N/m beyond it on either side."""
    return ForceLaw("m1", (np.array([-2e-3, -1e-3, 1e-3, 2e-3]), np.array([-1e3, 0.0, 0.0, 1e3])))


def _viscous(gap: float, stiffness: float, damping: float) -> Problem:
    return two_masses(UnilateralContact(STOP, "m1", gap, stiffness, damping), start=5e-3)


def _closes_inside(problem: Problem, trajectory: Trajectory) -> str:
    closings = [event.time for event in trajectory.events if event.kind == "close"]
    deep = [time for time in closings if trajectory.gap(STOP, time) < -INSIDE]
    return "" if deep else f"none of {len(closings)} closings is inside the stop"


CASES = (
    Case("law-hardening-cubic", "A cubic spring: tens of levels, each passed twice a swing.",
         lambda quick: two_masses(_law(_hardening), start=6e-3)),
    Case("law-hertz", "A Hertz contact: its stiffness begins at zero.",
         lambda quick: two_masses(_law(_hertz), start=6e-3), quick=False),
    Case("law-softening-indefinite", "Two wells: between them the stiffness is indefinite and a mode grows.",
         lambda quick: two_masses(_law(_two_wells), start=9e-3)),
    Case("law-leaves-unstable-rest",
         "Let go 1e-9 m beside the unstable rest between two wells: only the growing mode takes it away.",
         lambda quick: two_masses(_law(_two_wells), start=1e-9)),
    Case("law-magnet",
         "A magnet that attracts as one over the square of the distance: negative stiffness, a force at rest.",
         lambda quick: two_masses(_law(partial(_magnet, 2e-4), high=8e-3), start=-3e-3)),
    Case("law-magnet-behind-rigid-stop",
         "A magnet draws the mass onto a rigid stop and keeps it there: a growing level, impacts, a reaction.",
         lambda quick: two_masses(_law(partial(_magnet, 5e-4), high=8e-3), ABOVE, start=-8e-3), quick=False),
    Case("law-clearance-both-sides",
         "Free play between two stiff springs: a level without a force of its own between two with one.",
         lambda quick: two_masses(_clearance(), start=6e-3)),
    Case("law-beside-compliant-contact",
         "A cubic spring and a contact on one point, the contact across knots of the law.",
         lambda quick: two_masses(_law(_hardening), stop("m1", 1e-3, 1e5), start=6e-3), quick=False),
    Case("law-beside-rigid-contact",
         "A cubic spring and a rigid contact on neighbours: impacts among the knots of the law.",
         lambda quick: two_masses(_law(_hardening), stop("m0", 1e-3, math.inf), start=6e-3), quick=False),
    Case("viscous-light", "A stop of 1e5 N/m with a thousandth of critical damping: it opens just before its gap does.",
         lambda quick: _viscous(1e-3, 1e5, 0.6)),
    Case("viscous-overdamped",
         "A stop with ten times critical damping: its force jumps as it closes, it opens deep inside.",
         lambda quick: _viscous(1e-3, 1e5, 6e3)),
    Case("viscous-closes-again-inside",
         "A preloaded soft stop with a strong damper is left and met again without ever being out of it.",
         lambda quick: _viscous(-5e-3, 1e3, 50.0), _closes_inside),
)  # fmt: skip
