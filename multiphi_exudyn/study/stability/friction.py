"""Cases of dry friction: limits and springs of every size, belts, starts and loads exactly at the limit, resonance."""

from __future__ import annotations

import math

import numpy as np

from multiphi_exudyn.mechanics.assembly import assemble
from multiphi_exudyn.mechanics.beam import planar_beam
from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.friction import Friction
from multiphi_exudyn.mechanics.loads import ConstantLoad, HarmonicLoad, Load, SampledLoad
from multiphi_exudyn.study.stability.case import Case, Problem
from multiphi_exudyn.study.stability.structures import chain, in_a_row, stop, two_masses
from multiphi_exudyn.time.trajectory import Trajectory
from reference_models.rig import rig_beam, rig_damping

__all__ = ["CASES"]

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


def _many(count: int, stiffness: float) -> Problem:
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


CASES = (
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
         lambda quick: _many(20, 1e5), quick=False),
    Case("friction-several-rigid", "Four points that rub without springs: which of them slip together.",
         lambda quick: _many(4, math.inf)),
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
