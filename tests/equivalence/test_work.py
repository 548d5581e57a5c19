"""Work of damping and of what varies, in closed form: that of each segment, which under loads is a quadrature."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from quadrature import works_by_quadrature
from small_structures import chain

import multiphi_exudyn as mp

COMPLIANT = (mp.UnilateralContact("below", "m2", 0.1, 50.0), mp.UnilateralContact("above", {"m0": -1.0}, 0.15, 30.0))
RIGID = (mp.UnilateralContact("below", "m2", 0.1), mp.UnilateralContact("above", {"m0": -1.0}, 0.15))
FRICTION = (
    mp.Friction("below", "m2", 0.1, stiffness=60.0, static_limit=0.15, velocity=0.02),
    mp.Friction("ring", {"m0": 1.0, "m1": -1.0}, 0.05, velocity=-0.01),
)
VISCOUS = (mp.UnilateralContact("below", "m2", 0.1, 50.0, damping=1.0),)
ELEMENTS = {"compliant": COMPLIANT, "rigid": RIGID, "viscous": VISCOUS, "friction": FRICTION}
DAMPINGS = {"none": None, "modal": mp.ModalDamping([0.02, 0.01, 0.03]), "coupled": np.diag([0.1, 0.05, 0.2])}
MOTION = mp.StopMotion("below", mp.Harmonic(0.05, 0.7))
LOADS = {
    "no load": [],
    "constant": [mp.ConstantLoad("m1", 0.5)],
    "harmonic": [mp.HarmonicLoad("m1", 2.0, 0.3, 0.4)],
    "samples": [mp.SampledLoad("m1", np.linspace(0.0, 4.0, 81), np.cos(np.linspace(0.0, 9.0, 81)))],
    "two carriers": [mp.HarmonicLoad("m1", 2.0, 0.3, 0.4), mp.HarmonicLoad("m0", 1.0, 3.0)],
    "function": [mp.FunctionLoad("m1", lambda t: math.exp(-((t - 2.0) ** 2)))],
    "moving base": [mp.BaseMotion({"m0": 1.0, "m1": 1.0, "m2": 1.0}, mp.Harmonic(0.05, 0.7))],
}

KEPT = (
    "no load",
    "constant",
    "harmonic",
    "samples",
)  # by the model, with the levels under them: nobody can change them


def run_of(damping, contacts, loads, t_end=5.0, start=(0.03, 0.06, -0.09)):
    model = mp.MultiPhiModel(chain(3, damping=damping, stiffness=10.0), contacts, modes="all")
    run = mp.simulate(model, t_end, displacement=start, loads=loads)
    assert run.status == "ok"
    return run


def assert_works_of_segments(run):
    """Of those that the run has summed, and all integrated afterwards."""
    found, expected = run.segments.works, works_by_quadrature(run)
    afterwards = run.segments._sampler.works(list(range(len(run.segments))))
    integrated = afterwards.damping, afterwards.varying, afterwards.friction
    size = np.max(np.abs(run.energy(np.linspace(0, run.t_end, 101)))) + abs(expected[1])
    assert_allclose(found, expected, rtol=0, atol=1e-12 * size)
    assert_allclose(integrated, expected, rtol=0, atol=1e-12 * size)
    assert abs(run.ledger.residual) <= 1e-12 * size


def every_pair():
    """Names (load, elements, damping): every two of different kinds meet."""
    dampings = list(DAMPINGS)
    for i, load in enumerate(LOADS):
        for j, elements in enumerate(ELEMENTS):
            yield load, elements, dampings[(i + j) % len(dampings)]


@pytest.mark.parametrize(("loads", "elements", "damping"), list(every_pair()))
def test_works_are_those_of_each_segment(loads, elements, damping):
    assert_works_of_segments(run_of(DAMPINGS[damping], ELEMENTS[elements], LOADS[loads]))


@pytest.mark.parametrize("damping", DAMPINGS.values(), ids=DAMPINGS)
@pytest.mark.parametrize("elements", ELEMENTS.values(), ids=ELEMENTS)
def test_works_of_moving_stops_are_those_of_each_segment(elements, damping):
    assert_works_of_segments(run_of(damping, elements, [MOTION, *LOADS["harmonic"]], start=None))


@pytest.mark.parametrize("t_end", [20.0, 400.0])
def test_works_at_resonance_are_those_of_each_segment(t_end):
    omega = float(mp.MultiPhiModel(chain(3, stiffness=10.0), [], modes="all").level(()).omega[1])
    load = mp.HarmonicLoad("m1", 2.0, omega / (2 * math.pi))
    assert_works_of_segments(run_of(mp.ModalDamping([0.0, 1e-7, 0.01]), (), [load], t_end))


@pytest.mark.parametrize("ratio", [0.99, 1 - 1e-6, 1.0, 1.00001, 3.0])
def test_works_of_a_critically_damped_mode_are_those_of_each_segment(ratio):
    structure = mp.LinearStructure([[2.0]], [[8.0]], damping=mp.ModalDamping([ratio]), points={"m": 0})
    model = mp.MultiPhiModel(structure, [mp.UnilateralContact("stop", "m", 0.0, 80.0)], modes="all")
    for loads in ([], [mp.HarmonicLoad("m", 3.0, 0.4)]):
        assert_works_of_segments(mp.simulate(model, 5.0, displacement=[0.3], velocity=[-2.0], loads=loads))


def test_work_of_a_damped_mode_is_the_energy_it_loses():
    """From 0.5 m v^2 to nothing, the ledger's other side left alone."""
    structure = mp.LinearStructure([[2.0]], [[8.0]], damping=[[4.0]], points={"m": 0})
    run = mp.simulate(mp.MultiPhiModel(structure, [], modes="all"), 60.0, velocity=[3.0])
    assert run.ledger.damping == pytest.approx(9.0, rel=1e-14)


def test_segments_at_resonance_are_left_out_and_integrated_when_asked_for():
    omega = float(mp.MultiPhiModel(chain(3, stiffness=10.0), [], modes="all").level(()).omega[1])
    run = run_of(DAMPINGS["none"], COMPLIANT, [mp.HarmonicLoad("m1", 2.0, omega / (2 * math.pi))])
    assert len(run.segments.left_out) > 0
    assert_works_of_segments(run)


@pytest.mark.parametrize("elements", ELEMENTS.values(), ids=ELEMENTS)
@pytest.mark.parametrize("loads", [LOADS[name] for name in KEPT], ids=KEPT)
def test_the_loop_tells_the_final_energy(loads, elements):
    """As the level itself tells it."""
    run = run_of(DAMPINGS["coupled"], elements, loads)
    state = run.final
    told = state.level.energy(state.displacement, state.velocity)
    assert run.ending.ledger.end_energy == run.ledger.final == pytest.approx(told, rel=1e-13)
