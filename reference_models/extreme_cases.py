"""The catalogue of extreme cases that ``multiphi-exudyn stability`` runs every model through.

A case is data (extreme_case.py): a structure, its contacts, its start and loads, and where there is a closed form what
it is checked against. ``quick`` cases, and short forms of them, are those of the quick catalogue.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import scipy.sparse
import scipy.sparse.linalg

from multiphi_exudyn.mechanics.assembly import assemble
from multiphi_exudyn.mechanics.beam import Beam, PointMass, Section, planar_beam
from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.damping import ModalDamping, RayleighDamping
from multiphi_exudyn.mechanics.force_law import ForceLaw
from multiphi_exudyn.mechanics.friction import Friction
from multiphi_exudyn.mechanics.loads import BaseMotion, ConstantLoad, HarmonicLoad, Load, SampledLoad, StopMotion
from multiphi_exudyn.mechanics.structure import LinearStructure
from multiphi_exudyn.mechanics.time_functions import Harmonic
from multiphi_exudyn.time.simulate import simulate
from multiphi_exudyn.time.trajectory import Trajectory
from reference_models.bars import clamped_bar, free_bar, nodes
from reference_models.exact import BilinearOscillator, BouncingBar, PlasticImpact
from reference_models.extreme_case import (
    STOP,
    Case,
    Problem,
    chain,
    differs,
    in_a_row,
    pulled,
    rig_problem,
    stop,
    two_masses,
)
from reference_models.rig import rig_beam, rig_contact, rig_damping

__all__ = ["CATALOGUE"]

# Cases of gaps and starts: zero and negative gaps, contacts never reached or just touched, starts on the stop.

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


STARTS = (
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


# Cases of beams beside the full nonlinear beam: where the contact is, how stiff, how many modes, how far pulled.

HIT = 0.09  # s: the rig's tip, pulled up 20 mm, strikes its support at 0.065 s
DENSE = 250  # elements up to which matrices are given dense
PULLED = 0.02  # m: the rig's own displacement
SCALED = 1e-9  # relative: what a linear structure's answer may differ by from another amplitude's
SECOND_NODE = 0.7834  # of the length: where a uniform cantilever's second mode does not move


def _cantilever(points: dict[str, float], masses: tuple[PointMass, ...] = ()) -> Beam:
    """A uniform steel strip 0.5 m long."""
    section = Section.rectangle(
        0.0, 0.5, width=0.02, height=3e-3, youngs_modulus=2.1e11, density=7850.0, poisson_ratio=0.3
    )
    return Beam([section], {"tip": 0.5, **points}, masses)


def _strip(
    x: float, stiffness: float, t_end: float = 0.1, masses: tuple[PointMass, ...] = (), gap: float = 1e-4
) -> Problem:
    """The strip pulled up 10 mm over a stop below x [m]."""
    contact = stop("touching", gap, stiffness)
    beam = _cantilever({"touching": x}, masses)
    return pulled(beam, [contact], t_end, tip="tip", displacement=0.01)


def _rig_on(stiffness: float, quick: bool) -> Problem:
    return rig_problem(stiffness, HIT)


def _rig_with(modes: int, stiffness: float, quick: bool) -> Problem:
    return rig_problem(stiffness, 0.2 if quick else 0.5, modes=modes, penalty=1e6)


def _rig_scaled(displacement: float, quick: bool) -> Problem:
    return rig_problem(1e6, HIT, displacement, gap=rig_contact().gap * displacement / PULLED, modes=12)


def _scales(problem: Problem, trajectory: Trajectory) -> str:
    """The same events as of the rig's own displacement, and the displacement in proportion."""
    own = _rig_scaled(PULLED, True)
    assert problem.pull is not None, "beams are pulled"
    other = simulate(own.model(), own.t_end, own.displacement)
    return differs(trajectory, other, "node3", problem.pull.displacement / PULLED, SCALED)


def _stiffnesses() -> Iterator[Case]:
    for exponent in range(3, 13):
        yield Case(
            f"stiffness-1e{exponent}",
            f"The rig on a support of 1e{exponent} N/m, all modes: one more decade of stiffness.",
            partial(_rig_on, 10.0**exponent),
            quick=exponent in (3, 6, 12),
        )
    yield Case(
        "stiffness-infinite",
        "The rig on a rigid support, all modes: plastic impacts, releases, micro-bounces.",
        lambda quick: rig_problem(math.inf, HIT, penalty=1e7),
    )


def _mode_numbers() -> Iterator[Case]:
    for modes in (1, 2, 4, 8, 16):
        for law, stiffness in (("compliant", 1e6), ("rigid", math.inf)):
            yield Case(
                f"modes-{modes}-{law}",
                f"{modes} of the rig's modes, {law} support: what truncation leaves must be told.",
                partial(_rig_with, modes, stiffness),
                quick=modes in (1, 4),
            )


def _amplitudes() -> Iterator[Case]:
    for metres, text in ((1e-6, "1um"), (1e-3, "1mm"), (0.05, "50mm"), (0.2, "200mm")):
        yield Case(
            f"tip-{text}",
            f"The rig's tip pulled {1e3 * metres:g} mm, the gap in proportion: the reduced answer scales, "
            + ("down to where round-off begins." if metres < 0.01 else "the full beam is no longer linear."),
            partial(_rig_scaled, metres),
            _scales,
            quick=text in ("1um", "200mm"),
        )


def _meshed(elements: int, modes: int | str, quick: bool) -> Problem:
    """The rig as Timoshenko elements, sparse where there are many."""
    given = planar_beam(rig_beam(), elements)
    if elements > DENSE:
        sparse = scipy.sparse.csr_array(given.mass), scipy.sparse.csr_array(given.stiffness)
        given = LinearStructure(*sparse, None, given.points)
    shape = _static(given, "node3")
    start = shape * (0.02 / float(given.row("node3") @ shape))
    return Problem(given, [rig_contact(1e6)], HIT, modes, displacement=start)


def _static(structure: LinearStructure, point: str) -> np.ndarray:
    """x (n,) under 1 N, by the stiffness itself."""
    row = structure.row(point)
    if scipy.sparse.issparse(structure.stiffness):
        return np.asarray(scipy.sparse.linalg.spsolve(scipy.sparse.csc_array(structure.stiffness), row))
    return np.asarray(np.linalg.solve(structure.stiffness, row))


def _meshes() -> Iterator[Case]:
    for elements, modes in ((10, "all"), (50, "all"), (250, 24), (1000, 24), (2000, 24)):
        yield Case(
            f"elements-{elements}",
            f"The rig in {elements} elements, {modes} modes: "
            + ("the highest frequency grows as their square." if modes == "all" else "a sparse eigenproblem."),
            partial(_meshed, elements, modes),
            quick=elements in (10, 1000),
        )


BEAMS = (
    Case("contact-at-clamp-side-node",
         "The stop stands beside the clamp, where the beam hardly moves: forces are large, travel is microns.",
         lambda quick: _strip(0.0625, 1e8, gap=1e-6)),
    Case("contact-at-tip-mass", "The stop is below a heavy tip mass: the impulse goes into one node.",
         lambda quick: _strip(0.5, 1e6, 0.4, (PointMass(0.5, 1.0, 1e-4),))),
    Case("contact-at-node-of-a-mode",
         "The stop stands where the second mode does not move: closed and open levels share that mode.",
         lambda quick: _strip(0.5 * SECOND_NODE, 1e7)),
    *_stiffnesses(),
    *_meshes(),
    *_mode_numbers(),
    *_amplitudes(),
)  # fmt: skip


# Cases of matrices: mass ratios, damping, frequencies that coincide, rigid-body motion, long runs, units.

BAR = BouncingBar()
MILLIMETRE = 1e3  # in one metre
SAME = 1e-9  # relative: two unit systems, one motion
CRITICAL = 20.0  # N s/m for 1 kg on 100 N/m
TURNED = np.array([[math.cos(0.5), -math.sin(0.5)], [math.sin(0.5), math.cos(0.5)]])
DEFECTIVE = TURNED @ np.diag([CRITICAL, CRITICAL / 4]) @ TURNED.T  # one direction of two equal modes is critical
LIGHT = [1.0, 1.0, 1e-9]  # kg: what touches, beside its neighbours
PHASE_ERROR = 1e-15  # of a time, per event: what a closed form may be off after many of them


def _damped(
    damping: np.ndarray | ModalDamping | RayleighDamping, stiffness: float = 1e5, t_end: float = 0.5
) -> Problem:
    """Three masses with a stop below the last, let go 5 mm above and pressed down by 20 N."""
    contact, load = stop("m2", 1e-3, stiffness), ConstantLoad("m2", -20.0)
    return in_a_row([1.0, 2.0, 0.5], [1e4, 2e4, 3e4], [contact], t_end, [2e-3, 4e-3, 5e-3], damping, loads=[load])


def _pressed(damping: float, t_end: float) -> Problem:
    """One damped mass that a load presses onto its stop."""
    contact, load = stop("m0", 2e-3, 1e4), ConstantLoad("m0", -1.0)
    return in_a_row([1.0], [100.0], [contact], t_end, [0.01], np.array([[damping]]), loads=[load])


def _twins(apart: float, stiffness: float, quick: bool) -> Problem:
    """Two oscillators whose frequencies differ by a share ``apart``; they meet each other across a gap."""
    structure = LinearStructure(np.eye(2), np.diag([100.0, 100.0 * (1 + apart) ** 2]), None, {"m0": 0, "m1": 1})
    contact = stop({"m0": 1.0, "m1": -1.0}, 1e-3, stiffness)
    return Problem(structure, [contact], 3.0, displacement=np.array([0.01, 0.0]))


def _equal_frequencies() -> Iterator[Case]:
    for apart, text in ((0.0, "equal"), (1e-12, "1e-12-apart"), (1e-8, "1e-8-apart")):
        for law, stiffness in (("compliant", 1e4), ("rigid", math.inf)):
            yield Case(
                f"frequencies-{text}-{law}",
                f"Two frequencies {text.replace('-', ' ', 2) if apart else 'equal'}: their modes are anybody's choice; "
                f"{law} contact between them.",
                partial(_twins, apart, stiffness),
                quick=law == "compliant",
            )


def _bouncing(elements: int, stiffness: float, periods: float) -> Problem:
    """Benchmark B: a free bar falls on a floor under gravity."""
    weight = BAR.density * BAR.length * BAR.gravity
    return Problem(
        free_bar(elements),
        [stop("bottom", BAR.height, stiffness)],
        periods * BAR.period,
        loads=[ConstantLoad("centre", -weight)],
        penalty=1e5,
    )


def _clamped(elements: int) -> Problem:
    """Benchmark A: a clamped bar meets a rigid stop, zero gap."""
    start = (1 - nodes(elements, 1.0)[:-1]) / 2
    return Problem(clamped_bar(elements), [stop("contact", 0.0)], 9.0, displacement=start, penalty=1e4)


def _many(events: int) -> Problem:
    """The bilinear oscillator, two events a period."""
    contact = stop("m0", 0.0, BILINEAR.contact_stiffness)
    return in_a_row([1.0], [100.0], [contact], events / 2 * BILINEAR.period, [BILINEAR.amplitude])


def _all_told(problem: Problem, trajectory: Trajectory) -> str:
    """Number of events, and the closed form in the last period."""
    expected = round(2 * problem.t_end / BILINEAR.period)
    times = trajectory.t_end - BILINEAR.period * np.linspace(0.99, 0.01, 1001)
    away = float(np.max(np.abs(trajectory.at("m0", times) - BILINEAR.displacement(times)))) / BILINEAR.amplitude
    allowed = PHASE_ERROR * expected * trajectory.t_end * BILINEAR.omega2 + SAME
    if abs(len(trajectory.events) - expected) > 1 or away > allowed:
        return f"{len(trajectory.events)} events of {expected}, {away:.1e} of the amplitude off in the last period"
    return ""


def _fast(stiffness: float) -> Problem:
    """A chain flies into its stop at 1000 m/s."""
    return in_a_row([1.0] * 3, [1e6] * 3, [stop("m2", 1e-3, stiffness)], 0.05, velocity=np.full(3, -1e3))


def _in_units(metre: float) -> Problem:
    """Two damped masses over a stop; with metre = 1e3 in mm, N and t."""
    mass, per_length = 1 / metre, 1 / metre  # N s2 and N, per length unit
    c = np.array([[3.0, -1.0], [-1.0, 2.0]])
    points = {"m0": 0, "m1": 1}
    k = np.array([[3e4, -2e4], [-2e4, 2e4]])
    structure = LinearStructure(mass * np.diag([1.0, 0.5]), per_length * k, per_length * c, points)
    contact = stop("m1", 1e-3 * metre, 1e5 * per_length)
    start = metre * np.array([2e-3, 5e-3])
    return Problem(structure, [contact], 1.0, displacement=start, loads=[ConstantLoad("m1", -3.0)], metre=metre)


def _same_in_metres(problem: Problem, trajectory: Trajectory) -> str:
    """The same case in SI units has the same events and displacements."""
    si = _in_units(1.0)
    other = simulate(si.model(), si.t_end, si.displacement, si.velocity, si.loads)
    return differs(trajectory, other, None, problem.metre, SAME)


def _settles(problem: Problem, trajectory: Trajectory) -> str:
    rest = problem.model().static_equilibrium({"m0": -1.0})
    away = float(np.max(np.abs(trajectory.displacement(trajectory.t_end) - rest)) / np.max(np.abs(rest)))
    return f"{away:.1e} from the static equilibrium at the end" if away > 1e-3 else ""


def _defective() -> Problem:
    """Two equal oscillators, critically damped in a direction that is nobody's own."""
    structure = LinearStructure(np.eye(2), np.diag([100.0, 100.0]), DEFECTIVE, {"m0": 0, "m1": 1})
    return Problem(structure, [stop("m0", 1e-3, 100.0)], 1.0, displacement=np.array([0.01, 0.0]))


SYSTEMS = (
    Case("mass-ratio-1e-9-compliant", "What touches weighs 1e-9 of its neighbours: its frequency is 3e4 times theirs.",
         lambda quick: in_a_row(LIGHT, [1e4] * 3, [stop("m2", 1e-3, 1e5)], 0.2, [2e-3, 4e-3, 4e-3])),
    Case("mass-ratio-1e-9-rigid",
         "What strikes weighs 1e-9 of its neighbours: impacts of no energy, reactions that ring.",
         lambda quick: in_a_row(LIGHT, [1e4] * 3, [stop("m2", 1e-3)], 0.2, [2e-3, 4e-3, 4e-3])),
    Case("damping-critical", "One mass, critically damped, pressed onto its stop: no exponential, t exp(-omega t).",
         lambda quick: _pressed(CRITICAL, 3.0), _settles),
    Case("damping-overdamped", "One mass, a hundred times critical: two real rates 4e4 apart.",
         lambda quick: _pressed(100 * CRITICAL, 100.0), _settles),
    Case("damping-critical-all-modes",
         "All three open modes critically damped; the closed level's are not, and are coupled.",
         lambda quick: _damped(ModalDamping([1.0, 1.0, 1.0]))),
    Case("damping-overdamped-all-modes", "Every mode at ten times the critical ratio.",
         lambda quick: _damped(ModalDamping([10.0, 10.0, 10.0]), t_end=3.0)),
    Case("damping-non-proportional-compliant", "A dashpot on one mass alone: complex modes in every level.",
         lambda quick: _damped(np.diag([0.0, 0.0, 30.0]))),
    Case("damping-non-proportional-rigid", "A dashpot on the mass that strikes: its reaction holds the damping force.",
         lambda quick: _damped(np.diag([0.0, 5.0, 30.0]), math.inf)),
    Case("damping-stiffness-proportional",
         "Rayleigh damping that makes high modes overdamped and leaves the first one alone.",
         lambda quick: _damped(RayleighDamping(0.0, 0.02))),
    Case("damping-coupled-and-critical-alike",
         "Two coupled modes critically damped alike: a double rate with one mode, t exp(-omega t) that is nobody's "
         "own.", lambda quick: _defective()),
    *_equal_frequencies(),
    Case("rigid-body-gravity-rigid",
         "A free bar falls on a rigid floor: a zero frequency under a load, waves, a release without a force.",
         lambda quick: _bouncing(10 if quick else 40, math.inf, 0.7 if quick else 2.0)),
    Case("rigid-body-gravity-compliant", "The same bar on a floor of 1e5 N/m.",
         lambda quick: _bouncing(10 if quick else 40, 1e5, 0.7 if quick else 2.0)),
    Case("clamped-bar-zero-gap",
         "A clamped bar in waves against a rigid stop without a gap, three periods of the closed form.",
         lambda quick: _clamped(10 if quick else 40)),
    Case("many-events", "1e5 events (quick: 1e4) of a closed form: errors of time must not add up.",
         lambda quick: _many(10_000 if quick else 100_000), _all_told),
    Case("1000-seconds",
         "1000 s (quick: 100 s) of the damped rig: hundreds of contacts, then none for the rest of the run.",
         lambda quick: rig_problem(1e6, 100.0 if quick else 1000.0, modes=6, damping=ModalDamping([5e-3] * 6))),
    Case("1000-m-per-s-compliant", "A chain flies into a stop of 1e9 N/m at 1000 m/s.",
         lambda quick: _fast(1e9)),
    Case("1000-m-per-s-rigid", "A chain flies into a rigid stop at 1000 m/s: most of its energy goes in one impact.",
         lambda quick: _fast(math.inf)),
    Case("units-mm-N-t",
         "The same loaded, damped case in mm, N and t instead of SI: the same events, the displacement times 1000.",
         lambda quick: _in_units(MILLIMETRE), _same_in_metres),
)  # fmt: skip


# Cases of laws: force laws that harden, soften, attract or leave a clearance, and viscous contacts.

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


LAWS = (
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


# Cases of what varies in time: resonance, loads that jump, stops and bases that move.

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


DRIVEN = (
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


# Cases of dry friction: limits and springs of every size, belts, starts and loads exactly at the limit, resonance.

RING = "ring"
HALF = math.pi / 100.0  # s: half a swing of the block
REST = 1e-12  # of where a block starts: it comes to rest where it should, to this


def _ring(limit: float, stiffness: float = math.inf, static: float | None = None, velocity: float = 0.0) -> Friction:
    return Friction(RING, "m0", limit, static, stiffness, velocity)


def _block(friction: Friction, start: float, t_end: float = 0.5, *loads: Load, scale: float = 1.0) -> Problem:
    """1 kg on 1e4 N/m at 100 rad/s, let go ``start`` [m] away; scale: of the units of mass and of force."""
    return in_a_row([scale], [1e4 * scale], [friction], t_end, [start], loads=loads)


def _decays(scale: float) -> Problem:
    """Seven half swings lose 20 mm each, then the block rests at 2 mm."""
    return _block(_ring(100.0 * scale), 0.033 * 4.3333333333333333, 0.5, scale=scale)


def _comes_to_rest(problem: Problem, trajectory: Trajectory) -> str:
    """Every half swing loses 2 F / k; the block stays where its spring is weaker than the friction at a turn."""
    assert problem.displacement is not None
    ring = problem.frictions[0]
    held, place = ring.limit / float(problem.structure.stiffness[0, 0]), float(problem.displacement[0])
    turns = 0
    while abs(place) > held:
        place, turns = -math.copysign(abs(place) - 2 * held, place), turns + 1
    end, last = float(trajectory.at("m0", problem.t_end)), trajectory.events[-1].time
    off = abs(end - place) + abs(last / (turns * HALF) - 1)
    return "" if off <= REST else f"rests {end - place:.1e} m away, {last - turns * HALF:.1e} s late"


def _never_slips(problem: Problem, trajectory: Trajectory) -> str:
    return f"{len(trajectory.events)} events below the limit" if trajectory.events else ""


def _never_sticks(problem: Problem, trajectory: Trajectory) -> str:
    return "sticks to a belt that is faster than it" if len(trajectory.stick_intervals(RING)) else ""


def _friction_many(count: int, stiffness: float) -> Problem:
    """A chain that rubs at every mass, each with another limit."""
    rings = [Friction(f"{RING}{i}", f"m{i}", 2.0 + i % 5, stiffness=stiffness) for i in range(count)]
    load = HarmonicLoad(f"m{count - 1}", 40.0, 4.0)
    return in_a_row([1.0] * count, [1e4] * count, rings, 0.2, np.linspace(0, 0.02, count), loads=[load])


def _beam(stiffness: float, modes: int) -> Problem:
    """The rig's beam with a ring, few modes of every state."""
    structure = planar_beam(rig_beam(), elements=12, damping=rig_damping())
    ring = Friction(RING, "node2", 0.6, stiffness=stiffness)
    return Problem(structure, [ring], 0.3, modes=modes, loads=[HarmonicLoad("node3", 0.5, 10.0)])


def _between() -> Problem:
    """Two cantilever chains that rub on each other at their ends."""
    parts = {"a": chain([1.0, 1.0], [1e4, 1e4]), "b": chain([2.0, 0.5], [3e4, 1e4])}
    ring = Friction(RING, {"a.m1": 1.0, "b.m1": -1.0}, 10.0, stiffness=1e5)
    return Problem(assemble(parts), [ring], 0.5, displacement=np.array([5e-3, 1e-2, 0.0, 0.0]))


def _uneven() -> Problem:
    """A millionth of a million times the mass."""
    rings = [Friction("light", "m0", 1.0), Friction("heavy", "m1", 1e4, stiffness=1e7)]
    return in_a_row([1e-3, 1e6], [1e4, 1e8], rings, 1.0, [0.01, 0.01])


def _dropped(sideways: float, friction: float, restitution: float = 0.0) -> Problem:
    """1 kg falls 20 mm onto a rigid floor on which it rubs, and slides to rest."""
    floor = UnilateralContact("floor", "m1", 0.0, friction=friction, tangential="m0", restitution=restitution)
    velocity, weight = np.array([sideways, 0.0]), ConstantLoad("m1", -10.0)
    return in_a_row([1.0, 1.0], [0.0, 0.0], [floor], 0.5, [0.0, 0.02], velocity=velocity, loads=[weight])


def _slides_to_rest(problem: Problem, trajectory: Trajectory) -> str:
    """It slides as long as mu g takes to stop it, counted from the fall: v = mu g t, bounces or not."""
    assert problem.velocity is not None
    floor = problem.contacts[0]
    assert isinstance(floor, UnilateralContact)
    falls, stops = math.sqrt(2 * 0.02 / 10.0), float(problem.velocity[0]) / (10.0 * floor.friction)
    late = abs(trajectory.events[0].time / falls - 1) + abs(trajectory.events[-1].time / stops - 1)
    return "" if late <= 1e3 * REST else f"struck, or at rest, {late:.1e} of the time too late"


def _rough_stops(modes: int | str = "all") -> Problem:
    """A chain between two rigid stops, each of which rubs on what another mass does."""
    stops = [
        UnilateralContact("below", "m1", 1e-3, friction=0.5, tangential={"m0": 1.0, "m2": -1.0}),
        UnilateralContact("above", {"m3": -1.0}, 1e-3, friction=0.3, static_friction=0.6, tangential="m4"),
    ]
    loads = [HarmonicLoad("m2", 60.0, 9.0), HarmonicLoad("m4", 40.0, 13.0)]
    return in_a_row([1.0] * 8, [1e4] * 8, stops, 0.5, modes=modes, loads=loads)


def _inside_cones(problem: Problem, trajectory: Trajectory) -> str:
    """|T| <= mu_s N where it sticks, |T| = mu N where it slides."""
    times, worst = np.linspace(0.0, problem.t_end, 2001), 0.0
    for part in problem.parts:
        assert isinstance(part, UnilateralContact)
        pressure = np.asarray(trajectory.contact_force(part.name, times))
        tension = np.abs(np.asarray(trajectory.friction_force(part.name, times)))
        sticks = np.zeros(len(times), dtype=bool)
        for first, last in trajectory.stick_intervals(part.name):
            sticks |= (times >= first) & (times <= last)
        over, beside = tension - part.most * pressure, np.abs(tension - part.friction * pressure)
        worst = max(worst, float(np.max(np.where(sticks, over, beside)) / np.max(pressure)))
    return "" if worst <= 1e3 * REST else f"friction {worst:.1e} of the largest pressure off its law"


def _jumping(stiffness: float) -> Problem:
    load = SampledLoad("m0", np.array([0.05, 0.1, 0.3]), np.array([30.0, 30.0, -30.0]))
    return _block(_ring(20.0, stiffness), 0.0, 0.5, load)


FRICTION = (
    Case("friction-decays", "A block comes to rest at a turn, where force and speed change signs.",
         lambda quick: _decays(1.0), _comes_to_rest),
    Case("friction-units-large", "The same in units of mass and force 2^20 times as small.",
         lambda quick: _decays(2.0**20), _comes_to_rest),
    Case("friction-units-small", "The same in units of mass and force 2^20 times as large.",
         lambda quick: _decays(2.0**-20), _comes_to_rest),
    Case("friction-huge-limit", "A limit of 1e12 N: what holds for ever may not creep.",
         lambda quick: _block(_ring(1e12), 1e-3, 0.5, HarmonicLoad("m0", 50.0, 7.0)), _never_slips),
    Case("friction-huge-limit-sprung", "A limit of 1e12 N behind a spring: a second spring and nothing else.",
         lambda quick: _block(_ring(1e12, 1e5), 1e-3), _never_slips),
    Case("friction-tiny-limit", "A limit of 1e-9 N beside forces of 100 N: every turn is one of stick and slip.",
         lambda quick: _block(_ring(1e-9), 0.01)),
    Case("friction-tiny-limit-sprung", "The same behind a spring: it gives way after 1e-15 m.",
         lambda quick: _block(_ring(1e-9, 1e6), 0.01)),
    Case("friction-stiff-spring", "A spring of 1e12 N/m in series, eight orders over the structure's.",
         lambda quick: _block(_ring(20.0, 1e12), 0.0105)),
    Case("friction-soft-spring", "A spring of 1e-3 N/m in series, which never comes to its limit.",
         lambda quick: _block(_ring(20.0, 1e-3), 0.01), _never_slips),
    Case("friction-lets-go", "A static limit of a hundred times the other one: the force drops as slip begins.",
         lambda quick: _block(_ring(1.0, 1e5, 100.0), 0.01)),
    Case("friction-lets-go-rigid", "The same without a spring, under a load that comes to the static limit.",
         lambda quick: _block(_ring(10.0, static=60.0), 0.0, 1.0, HarmonicLoad("m0", 80.0, 3.0))),
    Case("friction-belt", "Stick and slip on a belt with a static limit above the other one.",
         lambda quick: _block(_ring(20.0, static=35.0, velocity=0.1), 0.0, 1.0)),
    Case("friction-belt-slow", "A belt of 1e-6 m/s: a thousand times slower than what rubs on it.",
         lambda quick: _block(_ring(20.0, static=35.0, velocity=1e-6), 4e-3, 1.0)),
    Case("friction-belt-fast", "A belt of 1e3 m/s: friction is a constant force, and slips kilometres.",
         lambda quick: _block(_ring(20.0, velocity=1e3), 4e-3), _never_sticks),
    Case("friction-starts-at-limit", "Let go exactly where the spring is as strong as the friction: it stays.",
         lambda quick: _block(_ring(20.0), 20.0 / 1e4), _never_slips),
    Case("friction-starts-beyond-limit", "Let go 1e-9 of the way beyond that: it moves by 1e-9 of it.",
         lambda quick: _block(_ring(20.0), 20.0 / 1e4 * (1 + 1e-9))),
    Case("friction-load-at-limit", "A load whose peaks are the limit, again and again.",
         lambda quick: _block(_ring(50.0), 0.0, 1.0, HarmonicLoad("m0", 50.0, 7.0)), _never_slips),
    Case("friction-load-jumps", "A load jumps over the limit while it sticks, and back while it slips.",
         lambda quick: _jumping(math.inf)),
    Case("friction-load-jumps-sprung", "The same behind a spring.",
         lambda quick: _jumping(1e5), quick=False),
    Case("friction-resonance", "Driven at its natural frequency with less friction than stops it: it grows for ever.",
         lambda quick: _block(_ring(20.0), 0.0, 1.0, HarmonicLoad("m0", 40.0, 100 / (2 * math.pi)))),
    Case("friction-many", "Twenty springs in series with friction, which slip and stick in turn.",
         lambda quick: _friction_many(20, 1e5), quick=False),
    Case("friction-several-rigid", "Four points that rub without springs: which of them slip together.",
         lambda quick: _friction_many(4, math.inf)),
    Case("friction-light-and-heavy", "A gram and a thousand tons, each rubs.",
         lambda quick: _uneven()),
    Case("friction-beside-rigid-stop", "A ring and a rigid stop on neighbours: impacts while it slips and sticks.",
         lambda quick: two_masses(_ring(5.0, 1e5), stop("m1", 1e-3), start=5e-3)),
    Case("friction-beside-compliant-stop", "A block without a spring beside a soft stop.",
         lambda quick: two_masses(_ring(5.0), stop("m1", 1e-3, 1e5), start=5e-3), quick=False),
    Case("friction-between-bodies", "Two bodies rub on each other alone.",
         lambda quick: _between()),
    Case("friction-rigid-floor", "A block strikes a rigid floor aslant, on the edge of the cone, and slides.",
         lambda quick: _dropped(1.5, 0.5), _slides_to_rest),
    Case("friction-rigid-floor-bouncing", "The same with restitution: endless bounces rub as long as one.",
         lambda quick: _dropped(1.5, 0.5, 0.5), _slides_to_rest),
    Case("friction-rigid-stops", "Two rigid stops that rub: impacts move what they rub on, and each other.",
         lambda quick: _rough_stops(), _inside_cones),
    Case("friction-truncated-rigid-stops", "Five of eight modes of every state of the same.",
         lambda quick: _rough_stops(5)),
    Case("friction-truncated-sprung", "Six modes of every state: what stick and slip leave out differs.",
         lambda quick: _beam(1e5, 6)),
    Case("friction-truncated-rigid", "The same without a spring: a constraint comes and goes.",
         lambda quick: _beam(math.inf, 6)),
)  # fmt: skip


CATALOGUE = (*STARTS, *BEAMS, *SYSTEMS, *LAWS, *DRIVEN, *FRICTION)
