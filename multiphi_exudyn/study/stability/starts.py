"""Cases of gaps and starts: zero and negative gaps, contacts never reached or just touched, starts on the stop."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from multiphi_exudyn.study.stability.case import Case, Problem
from multiphi_exudyn.study.stability.structures import STOP, in_a_row, rig_problem, stop
from multiphi_exudyn.time.trajectory import Trajectory
from reference_models.exact import BilinearOscillator, PlasticImpact

__all__ = ["CASES"]

EXACT = 1e-9  # of the amplitude: beyond it an answer is not the closed form
NEAR = 1e-12  # m above and below the stop
AMPLITUDE = 0.01  # m
BILINEAR = BilinearOscillator(mass=1.0, stiffness=100.0, contact_stiffness=900.0, amplitude=AMPLITUDE)
PRESSED = PlasticImpact(mass=1.0, stiffness=100.0, gap=-2e-3, start=AMPLITUDE)
LIFTED = PlasticImpact(mass=1.0, stiffness=100.0, gap=2e-3, start=AMPLITUDE)


def _closed_form(exact: BilinearOscillator | PlasticImpact, problem: Problem, trajectory: Trajectory) -> str:
    """Compared with a closed form of one mass."""
    times = np.linspace(0.0, trajectory.t_end, 20_001)
    away = float(np.max(np.abs(trajectory.at("m0", times) - exact.displacement(times))))
    return f"{away:.1e} m from the closed form" if away > EXACT * AMPLITUDE else ""


def _swinging(gap: float, stiffness: float) -> Problem:
    """The mass of the closed forms, let go at AMPLITUDE above its rest."""
    return in_a_row([1.0], [100.0], [stop("m0", gap, stiffness)], 5.0, [AMPLITUDE])


def _masses(gap: float, stiffness: float, displacement: float, velocity: float) -> Problem:
    """Three masses, a stop below the last one, which starts displaced and with a velocity."""
    contact, last = stop("m2", gap, stiffness), np.array([0.0, 0.0, 1.0])
    return in_a_row([1.0] * 3, [1e4, 2e4, 3e4], [contact], 0.5, displacement * last, velocity=velocity * last)


def _at_rest(stiffness: float) -> Problem:
    """Three masses pressed upwards by a stop, in their equilibrium."""
    problem = _masses(-1e-3, stiffness, 0.0, 0.0)
    return replace(problem, displacement=problem.model().static_equilibrium({}), velocity=None)


def _stays(problem: Problem, trajectory: Trajectory) -> str:
    times = np.linspace(0.0, trajectory.t_end, 2001)
    moved = float(np.max(np.abs(trajectory.displacement(times) - np.asarray(problem.displacement)[:, None])))
    happened = [event for event in trajectory.events if event.time > 0]  # a rigid contact is found closed at 0
    if happened or moved > EXACT * 1e-3:
        return f"moves by {moved:.1e} m, {len(happened)} events, from a state of rest"
    return "" if trajectory.contact_intervals(STOP) == [(0.0, trajectory.t_end)] else "not closed all the time"


def _costs_nothing(problem: Problem, trajectory: Trajectory) -> str:
    work = trajectory.stats
    if work.levels_built != 1 or work.function_evaluations or work.events:
        return f"{work.levels_built} levels, {work.function_evaluations} samples, {work.events} events for no contact"
    return ""


def _touches(problem: Problem, trajectory: Trajectory) -> str:
    return "" if any(event.kind == "close" for event in trajectory.events) else "the touch is not found"


def _does_not_touch(problem: Problem, trajectory: Trajectory) -> str:
    return f"{len(trajectory.events)} events without a touch" if trajectory.events else ""


def _symmetric(stiffness: float) -> Problem:
    """Two masses beside a middle one, each over a stop of its own, moving as mirror images."""
    contacts = [stop("m0", 1e-3, stiffness, "left"), stop("m2", 1e-3, stiffness, "right")]
    return in_a_row([1.0, 2.0, 1.0], [1e4, 2e4, 2e4, 1e4], contacts, 1.0, [4e-3, 2e-3, 4e-3])


def _stays_symmetric(problem: Problem, trajectory: Trajectory) -> str:
    times = np.linspace(0.0, trajectory.t_end, 20_001)
    away = float(np.max(np.abs(trajectory.gap("left", times) - trajectory.gap("right", times))))
    at = {name: [e.time for e in trajectory.events if e.contact == name] for name in ("left", "right")}
    if at["left"] != at["right"] or away > EXACT:
        return f"the two sides differ by {away:.1e} m, {len(at['left'])} and {len(at['right'])} events"
    return ""


def _started(stiffness: float, velocity: float, quick: bool) -> Problem:
    """Exactly on the stop."""
    return _masses(1e-3, stiffness, -1e-3, velocity)


def _on_the_stop() -> Iterator[Case]:
    for law, stiffness in (("rigid", math.inf), ("compliant", 1e6)):
        for way, velocity in (("in", -1.0), ("out", 1.0), ("zero", 0.0)):
            yield Case(
                f"start-on-stop-{way}-{law}",
                f"Starts exactly on a {law} stop, velocity {way if velocity else 'zero'}: the first state is an event.",
                partial(_started, stiffness, velocity),
                quick=law == "rigid" or way == "in",
            )


CASES = (
    Case("zero-gap-compliant", "The stop is where the mass rests: every passage through zero is an event; closed form.",
         lambda quick: _swinging(0.0, BILINEAR.contact_stiffness), partial(_closed_form, BILINEAR)),
    Case("zero-gap-rigid",
         "The mass strikes where it rests: after the impact reaction, gap and acceleration are all zero.",
         lambda quick: _swinging(0.0, math.inf)),
    Case("preload-at-rest-compliant", "A negative gap in equilibrium: nothing may move, the contact stays closed.",
         lambda quick: _at_rest(1e5), _stays),
    Case("preload-at-rest-rigid",
         "A negative gap in equilibrium against a rigid stop: nothing may move, the contact stays closed.",
         lambda quick: _at_rest(math.inf), _stays),
    Case("preload-released-compliant",
         "A negative gap, started undeformed: 1 mm inside the stop, which throws the masses off.",
         lambda quick: _masses(-1e-3, 1e5, 0.0, 0.0)),
    Case("preload-released-rigid",
         "A negative gap, started above: the spring presses the mass on the rigid stop and holds it; closed form.",
         lambda quick: _swinging(PRESSED.gap, math.inf), partial(_closed_form, PRESSED)),
    Case("impact-then-graze-for-ever",
         "After the impact the free motion touches the rigid stop without speed once a period; closed form.",
         lambda quick: _swinging(LIFTED.gap, math.inf), partial(_closed_form, LIFTED)),
    Case("gap-never-reached", "The stop is out of reach: one level, not one sample of an event function.",
         lambda quick: rig_problem(1e6, 0.05, 0.02, gap=0.1), _costs_nothing),
    Case("grazing-1e-12-above-compliant", "Passes 1e-12 m above the stop: no event.",
         lambda quick: _swinging(AMPLITUDE + NEAR, 1e6), _does_not_touch),
    Case("grazing-1e-12-below-compliant",
         "Dips 1e-12 m into the stop: a contact of microseconds that must not be missed.",
         lambda quick: _swinging(AMPLITUDE - NEAR, 1e6), _touches),
    Case("grazing-1e-12-above-rigid", "Passes 1e-12 m above a rigid stop: no event.",
         lambda quick: _swinging(AMPLITUDE + NEAR, math.inf), _does_not_touch),
    Case("grazing-1e-12-below-rigid",
         "Would dip 1e-12 m into a rigid stop: an impact at a millionth of the largest speed.",
         lambda quick: _swinging(AMPLITUDE - NEAR, math.inf), _touches),
    Case("grazing-exactly", "The turning point is the stop itself: touch without speed, to round-off.",
         lambda quick: _swinging(AMPLITUDE, 1e6)),
    Case("symmetric-stops-compliant",
         "Two mirror-image contacts at one instant: they must close and open together, for ever.",
         lambda quick: _symmetric(1e5), _stays_symmetric),
    Case("symmetric-stops-rigid", "Two mirror-image impacts at one instant: one decision for both.",
         lambda quick: _symmetric(math.inf), _stays_symmetric),
    *_on_the_stop(),
)  # fmt: skip
