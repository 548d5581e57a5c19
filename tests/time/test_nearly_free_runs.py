"""Runs of bodies that a far softer spring holds than bend them: their equilibrium is far away, and not moved about."""

import math
import warnings

import numpy as np
import pytest
from numpy.testing import assert_allclose

import multiphi_exudyn as mp
from multiphi_exudyn.study.stability.law_check import broken_laws
from multiphi_exudyn.study.stability.run_laws import complaints

SOFT = [1e-32, 1e-14, 1e-11, 1e-9, 1e-6]  # N/m
END = 12.0  # s
TIMES = np.linspace(0.013, END, 60)
DAMPINGS = {"none": None, "coupled": np.outer([0.3, -0.5, 0.2], [0.3, -0.5, 0.2])}
STOPS = {
    "rigid": mp.UnilateralContact("stop", {"left": 1.0}, 0.1),
    "compliant": mp.UnilateralContact("stop", {"left": 1.0}, 0.1, 400.0),
    "viscous": mp.UnilateralContact("stop", {"left": 1.0}, 0.1, 400.0, damping=3.0),
}
START = {"displacement": [0.02, 0.0, -0.01], "velocity": [0.3, -0.2, 0.1]}
pytestmark = pytest.mark.filterwarnings("ignore:slow model:multiphi_exudyn.MultiPhiWarning")


def chain(ground, damping=None, contacts=()):
    """Three masses in a row, and a spring to the ground."""
    stiffness = 50.0 * np.array([[1.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
    stiffness[0, 0] += ground
    body = mp.LinearStructure(np.diag([1.0, 1.3, 0.7]), stiffness, damping, {"left": 0, "middle": 1, "right": 2})
    return mp.MultiPhiModel(body, contacts, modes="all")


def fall(ground, damping=None, contacts=(), loads=(), **start):
    """A run of the chain that its weight presses on a stop, judged by its laws."""
    loads = [mp.Gravity([1.0, 1.0, 1.0], -9.81), *loads]
    start = START | start
    run = mp.simulate(chain(ground, damping, contacts), END, loads=loads, **start)
    assert broken_laws(run, loads, (np.array(start["displacement"]), np.array(start["velocity"]))) == []
    assert complaints(run, varying=len(loads) > 1) == []
    return run


@pytest.mark.parametrize("stiffness", [*SOFT, 1e-4, 1e-2])
@pytest.mark.parametrize("load", ["constant", "sampled"])
def test_a_mass_moves_exactly(stiffness, load):
    """p (1 - cos omega t) / k, as the series p t^2 / 2 m (1 - (omega t)^2 / 12 + ...)."""
    mass, force, times = 2.0, 3.0, np.array([0.1, 0.7, 2.0])
    body = mp.LinearStructure([[mass]], [[stiffness]], points={"m": 0})
    loads = {"constant": mp.ConstantLoad("m", force), "sampled": mp.SampledLoad("m", [0.0, 2.0], [force, force])}
    run = mp.simulate(mp.MultiPhiModel(body, modes="all"), 2.0, loads=[loads[load]])
    squares = stiffness / mass * times**2
    way = force * times**2 / mass * sum((-squares) ** k / math.factorial(2 * k + 2) for k in range(6))
    assert_allclose(run.at("m", times), way, rtol=1e-11)
    assert not any(text.startswith("slow mode: ") for text in run.warnings)


@pytest.mark.parametrize("ground", SOFT[1:4])
@pytest.mark.parametrize("stop", STOPS)
@pytest.mark.parametrize("damping", DAMPINGS)
def test_a_body_that_falls_on_a_stop_moves_as_a_free_one(ground, stop, damping):
    """In 12 s a spring of 1e-9 N/m changes the motion by less than 1e-7."""
    run, free = (fall(k, DAMPINGS[damping], [STOPS[stop]]) for k in (ground, 0.0))
    early = TIMES[TIMES < 3.0]
    assert [event.kind for event in run.events][:5] == [event.kind for event in free.events][:5]
    assert_allclose(run.displacement(early), free.displacement(early), rtol=0, atol=1e-6)
    assert not any(text.startswith("slow mode: ") for text in run.warnings)


@pytest.mark.parametrize("ground", SOFT[1:4])
@pytest.mark.parametrize("spring", [math.inf, 30.0], ids=["rigid", "sprung"])
def test_friction_that_slips_moves_it_as_a_free_one(ground, spring):
    """Its constant force has a far equilibrium too."""
    friction = mp.Friction("rubs", {"right": 1.0}, 0.4, stiffness=spring)
    contacts = [STOPS["compliant"], friction]
    run, free = (fall(k, contacts=contacts, velocity=[0.3, -0.2, 2.0]) for k in (ground, 0.0))
    early = TIMES[TIMES < 3.0]
    assert sum(event.kind == "slip" for event in run.events) >= 1
    assert_allclose(run.displacement(early), free.displacement(early), rtol=0, atol=1e-6)


@pytest.mark.parametrize("load", ["weight", "friction"])
def test_both_sides_of_where_a_mode_is_slow_agree(load):
    """A run is as long as its modes are slow, or a little longer."""
    contacts = [STOPS["viscous"]]
    loads = [mp.Gravity([1.0, 1.0, 1.0], -9.81)]
    if load == "friction":
        contacts, loads = [*contacts, mp.Friction("rubs", {"right": 1.0}, 4.0, stiffness=30.0)], []
    model = chain(1e-3, None, contacts)
    slow = 0.1 / float(model.level(()).omega[0])
    runs = [mp.simulate(model, slow * (1 + change), loads=loads, **START) for change in (-1e-9, 1e-9)]
    times = np.linspace(0.0, 0.999 * slow, 200)
    assert (runs[0].segments[0].level.excitation.steady, runs[1].segments[0].level.excitation.steady) == (0, -1)
    assert_allclose(*(run.displacement(times) for run in runs), rtol=0, atol=1e-9)
    assert runs[0].ledger.final == pytest.approx(runs[1].ledger.final, rel=1e-6)  # they end 2e-9 apart
    assert runs[0].ledger.friction == pytest.approx(runs[1].ledger.friction, rel=1e-9)


def test_a_run_in_two_parts_goes_on():
    model, loads = chain(1e-11, None, [STOPS["compliant"]]), [mp.Gravity([1.0, 1.0, 1.0], -9.81)]
    whole = mp.simulate(model, 3.0, loads=loads, **START)
    first = mp.simulate(model, 1.3, loads=loads, **START)
    rest = mp.simulate(model, 3.0, loads=loads, start=first)
    times = np.linspace(1.31, 3.0, 40)
    assert_allclose(rest.displacement(times), whole.displacement(times), rtol=0, atol=1e-9)


@pytest.mark.parametrize(("time", "length", "mass"), [(2.0**9, 2.0**-7, 2.0**20), (2.0**-12, 2.0**3, 2.0**-15)])
def test_units_decide_nothing(time, length, mass):
    def run(time, length, mass):
        stiffness = np.array([[2.0 + 1e-11, -2.0], [-2.0, 2.0]]) * mass / time**2
        body = mp.LinearStructure(np.eye(2) * mass, stiffness, points={"a": 0, "b": 1})
        stop = mp.UnilateralContact("stop", {"a": 1.0}, 0.1 * length, 80.0 * mass / time**2)
        friction = mp.Friction("rubs", "b", 0.3 * mass * length / time**2, stiffness=9.0 * mass / time**2)
        model, loads = mp.MultiPhiModel(body, [stop, friction]), [mp.ConstantLoad("a", -mass * length / time**2)]
        return mp.simulate(model, 6.0 * time, loads=loads).displacement(TIMES[TIMES < 6] * time) / length

    assert_allclose(run(time, length, mass), run(1.0, 1.0, 1.0), rtol=0, atol=1e-12)


@pytest.mark.parametrize(("stiffness", "told"), [(1e-14, " 2.5 %"), (1e-10, " 0.00025 %"), (1e-6, ""), (1.0, "")])
def test_what_a_far_equilibrium_on_a_soft_contact_costs_is_told(stiffness, told):
    """A free mass that a load presses on a contact whose stiffness is next to nothing."""
    body = mp.LinearStructure(np.eye(1), np.zeros((1, 1)), points={"m": 0})
    model = mp.MultiPhiModel(body, [mp.UnilateralContact("pad", {"m": -1.0}, 0.5, stiffness)], modes="all")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mp.MultiPhiWarning)
        run = mp.simulate(model, 2.0, loads=[mp.ConstantLoad("m", 3.0)])
    sentences = [text for text in run.warnings if text.startswith("slow mode: ")]
    assert len(sentences) == bool(told)
    assert told in "".join(sentences)
    if not told and stiffness < 1e-3:
        assert run.at("m", 2.0) == pytest.approx(6.0, rel=1e-6)


@pytest.mark.parametrize("frequency", [0.01, 0.1, 0.5])
@pytest.mark.parametrize("end", [1e-3, 0.1, 1.0])
def test_suspensions_are_not_told(frequency, end):
    """A body on its suspension, struck: 2.5 km away for 0.01 Hz, and right."""
    body = mp.LinearStructure(np.eye(1), [[(2 * math.pi * frequency) ** 2]], points={"m": 0})
    stop = mp.UnilateralContact("stop", {"m": 1.0}, 1e-5, 1e8)
    model = mp.MultiPhiModel(body, [stop], modes="all")
    run = mp.simulate(model, end, velocity=[-0.1], loads=[mp.ConstantLoad("m", -9.81)])
    assert not any(text.startswith("slow mode: ") for text in run.warnings)
