"""Cases of matrices: mass ratios, damping, frequencies that coincide, rigid-body motion, long runs, units."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial

import numpy as np

from multiphi_exudyn.mechanics.damping import ModalDamping, RayleighDamping
from multiphi_exudyn.mechanics.loads import ConstantLoad
from multiphi_exudyn.mechanics.structure import LinearStructure
from multiphi_exudyn.study.stability.case import Case, Problem
from multiphi_exudyn.study.stability.starts import BILINEAR
from multiphi_exudyn.study.stability.structures import differs, in_a_row, rig_problem, stop
from multiphi_exudyn.time.simulate import simulate
from multiphi_exudyn.time.trajectory import Trajectory
from reference_models.bars import clamped_bar, free_bar, nodes
from reference_models.exact import BouncingBar

__all__ = ["CASES"]

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


CASES = (
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
