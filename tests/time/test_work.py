"""Work of damping and of what varies, in closed form: that of each segment, which under loads is a quadrature."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from quadrature import works_by_quadrature
from small_structures import chain, oscillator

import multiphi_exudyn as mp
from multiphi_exudyn.time.simulate import Run

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


def test_samples_take_no_more_terms_than_a_straight_line_has():
    """Two, and those of the free response: no series in powers of time."""
    run = run_of(DAMPINGS["coupled"], COMPLIANT, LOADS["samples"], t_end=3.97)
    assert len(run.segments[-1].basis.rates) == 3 + 2
    assert_works_of_segments(run)


@pytest.mark.parametrize("step", [0.1, 1e-2, 1e-3])
def test_works_of_noise_are_those_of_each_segment(step):
    """Of samples that follow each other faster than modes can, the few terms would be large."""
    force = np.random.default_rng(1).normal(size=201)
    noise = mp.SampledLoad("m1", step * np.arange(201), force)
    assert_works_of_segments(run_of(DAMPINGS["coupled"], COMPLIANT, [noise], t_end=200 * step))


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


@pytest.mark.parametrize("damping", [1e-4, 1e-6, 1e-7, 1e-8])
def test_one_damper_on_two_modes_of_one_frequency_takes_what_they_lose(damping):
    """There is a motion that it does not damp at all, but for round-off; nine dampers, each on its own."""
    mass = np.array([[2.2, -0.13], [-0.13, 2.3]])
    for angle in np.linspace(0.1, 3.0, 9):
        row = np.array([math.cos(angle), math.sin(angle)])
        structure = mp.LinearStructure(mass, 12.2 * mass, damping * np.outer(row, row), {"m": 0})
        run = mp.simulate(mp.MultiPhiModel(structure, [], modes="all"), 2.0, velocity=[1.0, -0.7])
        assert abs(run.ledger.residual) < 1e-12 * run.ledger.initial


def test_a_run_without_modes_does_no_work():
    run = mp.simulate(oscillator(), 1.0)
    assert run.segments.works == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("elements", ELEMENTS.values(), ids=ELEMENTS)
@pytest.mark.parametrize("loads", [name for name in LOADS if name != "function"])
def test_the_loop_sums_the_works_of_all_segments_under_the_usual_loads(loads, elements):
    run = run_of(DAMPINGS["coupled"], elements, LOADS[loads])
    assert len(run.segments.left_out) == 0


def test_segments_at_resonance_are_left_out_and_integrated_when_asked_for():
    omega = float(mp.MultiPhiModel(chain(3, stiffness=10.0), [], modes="all").level(()).omega[1])
    run = run_of(DAMPINGS["none"], COMPLIANT, [mp.HarmonicLoad("m1", 2.0, omega / (2 * math.pi))])
    assert len(run.segments.left_out) > 0
    assert_works_of_segments(run)


def test_a_run_asked_on_the_way_keeps_its_ledger_when_it_goes_on():
    model = mp.MultiPhiModel(chain(3, damping=DAMPINGS["coupled"], stiffness=10.0), RIGID, modes="all")
    for loads in (LOADS["samples"], LOADS["function"]):
        motion = Run(model, 3.0, np.array([0.03, 0.06, -0.09]), loads=[*loads, mp.ConstantLoad("m2", -2.0)]).begun()
        motion.advance(1.0)
        early = motion.trajectory(1.0)
        motion.advance(3.0)
        late = motion.trajectory(3.0)
        for run in (late, early):
            assert_allclose(run.segments.works, works_by_quadrature(run), rtol=0, atol=1e-12)
            assert abs(run.ledger.residual) < 1e-12


def test_works_are_those_of_one_run_where_another_goes_on_meanwhile():
    model = mp.MultiPhiModel(chain(3, damping=DAMPINGS["coupled"], stiffness=10.0), COMPLIANT, modes="all")
    one, other = (Run(model, 3.0, factor * np.array([0.3, 0.6, -0.9]), loads=[]).begun() for factor in (1.0, 0.5))
    for end in (1.0, 2.0, 3.0):
        one.advance(end)
        other.advance(end)
    for motion in (one, other):
        assert abs(motion.trajectory(3.0).ledger.residual) < 1e-13


def test_works_of_many_segments_lose_no_digits_in_their_sum():
    run = run_of(DAMPINGS["coupled"], COMPLIANT, LOADS["harmonic"], t_end=400.0)
    assert abs(run.ledger.residual) < 1e-13 * run.ledger.work_of_loads


def test_works_of_short_segments_are_no_differences_of_large_energies():
    """A spring rides 20 m away on its belt: there a free response alone has 1e4 times the energy of the motion."""
    belt = mp.Friction("belt", "m0", 0.24, stiffness=2e3, velocity=5.0)
    model = mp.MultiPhiModel(chain(2, damping=np.diag([0.02, 0.05]), stiffness=1e-3), [belt], modes="all")
    ridden = mp.simulate(model, 4.0, velocity=[5.0, 5.0])
    pulse = mp.FunctionLoad("m0", lambda t: math.exp(-(((t - 4.001) / 2e-5) ** 2)), breaks=(4.0008, 4.0012))
    run = mp.simulate(model, 4.002, loads=[pulse], start=ridden)
    assert len(run.segments) > 1000
    assert abs(run.ledger.residual) < 2e-12 * run.ledger.initial


@pytest.mark.parametrize("elements", ELEMENTS.values(), ids=ELEMENTS)
@pytest.mark.parametrize("loads", [LOADS[name] for name in KEPT], ids=KEPT)
def test_the_loop_tells_the_final_energy(loads, elements):
    """As the level itself tells it."""
    run = run_of(DAMPINGS["coupled"], elements, loads)
    state = run.final
    told = state.level.energy(state.displacement, state.velocity)
    assert run.ending.ledger.end_energy == run.ledger.final == pytest.approx(told, rel=1e-13)


def test_the_final_energy_of_the_loop_is_no_difference_of_large_energies():
    """20 m from the belt's first place its spring alone holds 4e5 J at the level's rest, and hardly any in motion."""
    belt = mp.Friction("belt", "m0", 0.24, stiffness=2e3, velocity=5.0)
    model = mp.MultiPhiModel(chain(2, damping=np.diag([0.02, 0.05]), stiffness=1e-3), [belt], modes="all")
    run = mp.simulate(model, 4.0, velocity=[5.0, 5.0])
    state = run.final
    told = state.level.energy(state.displacement, state.velocity)
    assert run.ending.ledger.end_energy == pytest.approx(told, rel=2e-15)
