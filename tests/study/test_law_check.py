"""The law check: silent where every law holds, whatever the elements; it names the law that a trajectory breaks."""

import dataclasses
import math

import numpy as np
import pytest

import multiphi_exudyn as mp
from multiphi_exudyn.study.law_check import broken_laws

STIFFNESS = np.array([[20.0, -8.0, 0.0], [-8.0, 14.0, -5.0], [0.0, -5.0, 6.0]])
POINTS = {"x": 0, "y": 1, "z": 2}
START = np.array([0.3, 0.5, -0.2]), np.array([1.0, -2.0, 0.7])
WEIGHT = mp.ConstantLoad("y", -9.0)
SHAKER = mp.HarmonicLoad("x", 6.0, 0.7, 0.3)
PULSE = mp.SampledLoad("z", [0.0, 1.0, 1.5, 3.0], [0.0, 5.0, -4.0, 1.0])
FLOOR = mp.UnilateralContact("floor", "y", 0.0)
ROUGH = mp.UnilateralContact("floor", "y", 0.0, friction=0.4, tangential="x")
BOUNCING = mp.UnilateralContact("floor", "y", 0.0, restitution=0.7)
SOFT = mp.UnilateralContact("floor", "y", 0.1, 400.0)
SOFT_ROUGH = mp.UnilateralContact("floor", "y", 0.1, 400.0, friction=0.4, tangential="x", tangential_stiffness=90.0)
DAMPED = mp.UnilateralContact("floor", "y", 0.1, 400.0, damping=9.0)
BLOCK = mp.Friction("guide", "x", 1.5, 2.0)
SPRUNG = mp.Friction("guide", "x", 1.5, stiffness=30.0, velocity=0.4)
LAW = mp.ForceLaw("z", ([-2.0, -0.3, 0.3, 2.0], [-30.0, -1.0, 1.0, 50.0]))
LIFT = mp.StopMotion("floor", mp.Harmonic(0.1, 0.9))
QUAKE = mp.BaseMotion(np.array([0.0, 1.0, 0.0]), mp.Harmonic(0.05, 1.3), fixed_stops=("floor",))
RECORD = mp.Accelerogram([0.0, 1.0, 1.5, 3.0], [0.0, 0.2, -0.3, 0.1], factor=0.5)
LIFT_BY_RECORD = mp.StopMotion("floor", RECORD)
QUAKE_BY_RECORD = mp.BaseMotion(np.array([0.0, 1.0, 0.0]), RECORD, fixed_stops=("floor",))


def run(contacts, loads, damping=None, modes="all", start=START, end=6.0):
    structure = mp.LinearStructure(np.diag([1.0, 2.0, 0.5]), STIFFNESS, damping, POINTS)
    return mp.simulate(mp.MultiPhiModel(structure, contacts, modes=modes), end, *start, loads=loads)


@pytest.mark.parametrize("modes", ["all", 2])
@pytest.mark.parametrize(
    "damping", [None, mp.RayleighDamping(0.1, 0.01), np.array([[0.5, 0.2, 0], [0.2, 0.3, 0], [0, 0, 0.1]])]
)
@pytest.mark.parametrize(
    ("contacts", "loads"),
    [
        ([FLOOR], [WEIGHT]),
        ([ROUGH, SPRUNG], [WEIGHT, SHAKER]),
        ([BOUNCING, BLOCK], [WEIGHT, PULSE]),
        ([SOFT, LAW], [WEIGHT, LIFT]),
        ([SOFT_ROUGH], [WEIGHT, QUAKE]),
        ([DAMPED, SPRUNG, LAW], [WEIGHT, SHAKER, LIFT]),
        ([ROUGH, LAW], [WEIGHT, QUAKE]),
        ([FLOOR, SPRUNG], [WEIGHT, LIFT_BY_RECORD]),
        ([SOFT_ROUGH], [WEIGHT, QUAKE_BY_RECORD]),
    ],
)
def test_it_is_silent_where_all_laws_hold(contacts, loads, damping, modes):
    trajectory = run(contacts, loads, damping, modes)
    assert trajectory.events
    assert broken_laws(trajectory, loads, START) == []


@pytest.mark.parametrize("power", [-30, 40])
def test_it_hangs_on_no_unit_of_force(power):
    """Masses, stiffnesses and forces times a power of two: the same bounds."""
    factor = 2.0**power
    structure = mp.LinearStructure(factor * np.diag([1.0, 2.0, 0.5]), factor * STIFFNESS, None, POINTS)
    loads = [mp.ConstantLoad("y", -9.0 * factor)]
    parts = [ROUGH, mp.Friction("guide", "x", 1.5 * factor, stiffness=30.0 * factor)]
    trajectory = mp.simulate(mp.MultiPhiModel(structure, parts), 6.0, *START, loads=loads)
    assert broken_laws(trajectory, loads, START) == []
    assert _laws(broken_laws(trajectory, [mp.ConstantLoad("y", -9.001 * factor)], START)) == {"equation of motion"}


class Altered:
    """A trajectory of which some answers are others."""

    def __init__(self, trajectory, **others):
        self._trajectory, self._others = trajectory, others

    def __getattr__(self, name):
        if name in self._others:
            other = self._others[name]
            return (lambda *given: other(getattr(self._trajectory, name), *given)) if callable(other) else other
        return getattr(self._trajectory, name)


def _laws(told):
    return {sentence.split(": off")[0] for sentence in told}


def _of(name, change):
    """Another answer for one contact or friction."""
    return lambda answer, asked, *given: (
        change(answer(asked, *given), *given) if asked == name else answer(asked, *given)
    )


@pytest.fixture(scope="module")
def trajectory():
    """A mass that bounces with restitution, rubs, and hangs on a law."""
    return run([BOUNCING, SPRUNG, LAW], [WEIGHT])


def _jump(values, t, *_):
    return values + 1e-6 * (np.asarray(t) > 2.0)


SAID = {
    "a displacement that jumps": ({"displacement": lambda f, *a: _jump(f(*a), *a)}, "equation of motion"),
    "a velocity that is no derivative": (
        {"velocity": lambda f, *a: f(*a) * (1 + 1e-5)},
        "velocity as a derivative",
    ),
    "an acceleration that is no derivative": (
        {"acceleration": lambda f, *a: f(*a) * (1 + 1e-5)},
        "acceleration as a derivative",
    ),
    "a contact that pulls": ({"contact_force": _of("floor", lambda N, *_: -N)}, "force of floor pulls"),
    "a force off its law": ({"contact_force": _of("law", lambda N, *_: 1.00001 * N)}, "law of law"),
    "friction along the slip": (
        {"friction_force": _of("guide", lambda T, *_: -T)},
        "friction of guide along its slip",
    ),
    "friction beyond its limit": (
        {"friction_force": _of("guide", lambda T, *_: 1.00001 * T)},
        "friction of guide beyond its limit",
    ),
    "friction off its limit": (
        {"friction_force": _of("guide", lambda T, *_: 0.9999 * T)},
        "friction of guide that slips off its limit",
    ),
}


@pytest.mark.parametrize("broken", SAID)
def test_it_names_what_a_trajectory_tells_wrong(trajectory, broken):
    others, law = SAID[broken]
    assert law in _laws(broken_laws(Altered(trajectory, **others), [WEIGHT], START))


@pytest.mark.parametrize("row", ["damping", "friction", "impact"])
def test_it_names_an_open_ledger_and_what_is_lost_below_zero(trajectory, row):
    ledger = trajectory.ledger
    more = dataclasses.replace(ledger, **{row: getattr(ledger, row) + 1e-5})
    assert "ledger is open" in _laws(broken_laws(Altered(trajectory, ledger=more), [WEIGHT], START))
    lost = {row: -1e-3, "work_of_loads": ledger.work_of_loads - getattr(ledger, row) - 1e-3}
    told = broken_laws(Altered(trajectory, ledger=dataclasses.replace(ledger, **lost)), [WEIGHT], START)
    assert f"ledger row {row} is negative" in _laws(told)
    free = dataclasses.replace(ledger, final=ledger.final + 1e-4, work_of_loads=ledger.work_of_loads + 1e-4)
    assert _laws(broken_laws(Altered(trajectory, ledger=free), [WEIGHT], START)) == {"energy at the end"}


@pytest.mark.parametrize("impulse", [-1.0, 0.0, 1e-3])
def test_it_names_an_impulse_that_is_not_that_of_the_impact(impulse):
    trajectory = run([BOUNCING], [WEIGHT])
    events = [dataclasses.replace(e, impulse=impulse) if e.impulse > 0.1 else e for e in trajectory.events]
    told = _laws(broken_laws(Altered(trajectory, events=events), [WEIGHT], START))
    assert "balance of momentum" in told
    assert ("impulse of floor pulls" in told) == (impulse < 0)


@pytest.mark.parametrize(
    ("contact", "given", "law"),
    [
        (BOUNCING, {"restitution": 0.69}, "rebound of floor"),
        (FLOOR, {"gap": 1e-5}, "force of floor across its gap"),
        (FLOOR, {"gap": -1e-5}, "penetration of floor"),
        (ROUGH, {"friction": 0.39, "static_friction": 0.4}, "friction of floor that slips off its limit"),
        (ROUGH, {"tangential_velocity": 2.0}, "friction of floor along its slip"),
        (SOFT, {"stiffness": 400.1}, "law of floor"),
        (DAMPED, {"damping": 9.001}, "law of floor"),
    ],
)
def test_it_names_what_is_not_the_contact_s_law(contact, given, law):
    trajectory = run([contact], [WEIGHT, SHAKER])
    other = dataclasses.replace(trajectory.model, contacts=[dataclasses.replace(contact, **given)])
    assert law in _laws(broken_laws(Altered(trajectory, model=other), [WEIGHT, SHAKER], START))


def test_it_names_a_mass_that_goes_on_into_its_stop():
    trajectory = run([FLOOR], [WEIGHT])
    events = [dataclasses.replace(event, impulse=0.0) for event in trajectory.events]
    through = Altered(trajectory, events=events, velocity=lambda f, t, *_: f(t, "left"))
    assert "floor goes on into its stop" in _laws(broken_laws(through, [WEIGHT], START))


@pytest.mark.parametrize("restitution", [0.0, 0.5])
@pytest.mark.parametrize("round_offs", [-4, 0, 4, 16])
@pytest.mark.parametrize("knot", [0.9, 1.0])
@pytest.mark.parametrize("course", [mp.Harmonic(1.0, 0.25), mp.Harmonic(0.5, 0.5, 1.5 * math.pi)])
def test_it_says_nothing_of_a_mass_that_arrives_where_its_load_changes(course, knot, round_offs, restitution):
    """Round-off leaves a gap at that instant, and the impact is a few digits of the time after it."""
    structure = mp.LinearStructure([[1.0]], [[0.0]], points={"x": 0})
    loads = [mp.SampledLoad("x", [0.0, knot, 2.0, 4.0], [-2.0, -2.0, 0.0, 2.0]), mp.StopMotion("floor", course)]
    stop = course.amplitude * math.cos(2 * math.pi * course.frequency_hz * knot + course.phase)
    start = np.array([2.0 + round_offs * 2.0**-52]), np.array([(stop - 2.0) / knot + knot])
    floor = mp.UnilateralContact("floor", "x", 0.0, restitution=restitution)
    trajectory = mp.simulate(mp.MultiPhiModel(structure, [floor], modes="all"), 3.0, *start, loads)
    assert any(abs(event.time - knot) < 1e-13 for event in trajectory.events)
    assert broken_laws(trajectory, loads, start) == []


@pytest.mark.parametrize("damping", [1.0, 10.0])
@pytest.mark.parametrize("knot", [0.8, 1.0, 1.3])
@pytest.mark.parametrize("force", [1.0, 4.0, 300.0])
def test_it_knows_the_round_off_of_a_load_that_passes_through_zero(force, knot, damping):
    """Clamped by rigid and damped stops of both sides: where the load is about zero, so are all forces."""
    structure = mp.LinearStructure([[1.0]], [[0.0]], points={"x": 0})
    stops = [
        mp.UnilateralContact("far", "x", 1.0),
        mp.UnilateralContact("soft", "x", 0.0, 10.0, damping),
        mp.UnilateralContact("rigid", {"x": -1.0}, 0.0),
        mp.UnilateralContact("hard", {"x": -1.0}, 0.0, 100.0, 1.0),
    ]
    loads = [mp.SampledLoad("x", [0.0, knot, 2.0, 4.0], [force, 0.0, force, 0.0])]
    start = np.array([-1.0]), np.array([0.0])
    trajectory = mp.simulate(mp.MultiPhiModel(structure, stops, modes="all"), 5.0, *start, loads)
    assert broken_laws(trajectory, loads, start) == []
    pulled = Altered(trajectory, contact_force=_of("rigid", lambda told, t: told - 1e-7 * force))
    assert broken_laws(pulled, loads, start)


def test_it_names_a_start_that_is_not_the_one_that_was_given(trajectory):
    x, v = START
    assert _laws(broken_laws(trajectory, [WEIGHT], (x + 1e-5, v))) == {"displacement jumps"}
    assert _laws(broken_laws(trajectory, [WEIGHT], (x, v + 1e-5))) == {"balance of momentum"}


@pytest.mark.parametrize(
    "loads",
    [[WEIGHT], [WEIGHT, SHAKER, PULSE], [mp.ConstantLoad("y", -9.0), mp.HarmonicLoad("x", 6.0, 0.71, 0.3), PULSE]],
)
def test_it_names_loads_that_are_not_those_of_the_run(loads):
    trajectory = run([FLOOR], [WEIGHT, SHAKER, PULSE])
    told = _laws(broken_laws(trajectory, loads, START))
    assert "equation of motion" in told if loads[1:2] != [SHAKER] else told == set()


def test_nothing_is_said_of_a_run_that_has_not_started():
    structure = mp.LinearStructure(np.eye(1), np.zeros((1, 1)), None, {"x": 0})
    trajectory = mp.simulate(mp.MultiPhiModel(structure, [mp.UnilateralContact("s", "x", 0.0, math.inf)]), 1.0)
    assert broken_laws(trajectory) == []
    assert broken_laws(Altered(trajectory, segments=())) == []
