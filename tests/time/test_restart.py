"""A run goes on from any instant of another one: what round-off left of a gap is no start inside a stop."""

import math
import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from small_structures import chain, random_model
from strategies import cases

from multiphi_exudyn import (
    ConstantLoad,
    Friction,
    HarmonicLoad,
    LinearStructure,
    MultiPhiModel,
    MultiPhiTypeError,
    MultiPhiValueError,
    MultiPhiWarning,
    StopMotion,
    SweepLoad,
    UnilateralContact,
    simulate,
)
from multiphi_exudyn.mechanics.time_functions import Harmonic, Smooth


@settings(derandomize=True, max_examples=15, deadline=None)
@given(cases(law=("rigid", "mixed"), modes="all", damping=("none", "modal", "rayleigh")), st.floats(0, 1))
def test_is_never_refused_in_contact_or_at_an_event(case, share):
    run = simulate(case.model, case.t_end, case.displacement, case.velocity, case.loads)
    events = [event.time for event in (*run.events[:1], *run.events[-2:])]
    for t in {run.t_end, *events, share * run.t_end}:
        again = simulate(case.model, 0.02 * case.t_end, run.displacement(t), run.velocity(t), case.loads)
        assert again.status == "ok", again.message


@pytest.mark.parametrize("power", [-40, 0, 40])
@pytest.mark.parametrize("inside", [1e-9, 1e-6])
def test_a_start_inside_a_stop_is_still_refused(inside, power):
    length = 2.0**power
    structure = LinearStructure(np.eye(2), np.diag([1.0, 100.0]))
    model = MultiPhiModel(structure, [UnilateralContact("stop", [0.0, 1.0], 0.0)], modes="all")
    with pytest.raises(MultiPhiValueError, match="inside the rigid contact 'stop'"):
        simulate(model, 1.0, displacement=length * np.array([1.0, -inside]), velocity=length * np.ones(2))


def test_round_off_of_what_the_load_or_the_velocity_or_another_gap_makes_is_in_touch():
    structure = LinearStructure([[1.0]], [[4.0]], points={"m": 0})
    alone = [UnilateralContact("stop", "m", 0.0)]
    other = [*alone, UnilateralContact("far", {"m": -1.0}, 1.0)]
    for stops, velocity, loads in (
        (alone, [1.0], ()),
        (alone, None, [ConstantLoad("m", 4.0)]),
        (other, None, ()),
    ):
        run = simulate(MultiPhiModel(structure, stops, modes="all"), 1.0, [-1e-17], velocity, loads)
        assert run.status == "ok"
    assert_allclose(run.at("m", math.pi / 4), 0, atol=1e-16)


@pytest.mark.parametrize("far", [0.5, 1e3])
def test_a_compliant_contact_that_lies_inside_by_little_is_closed_whatever_gap_another_one_has(far):
    """x = -d cos(w t), w^2 = 4 + k, until it opens; a rigid one may be inside by more, for the gap of the other one."""
    structure, stiffness, depth = LinearStructure([[1.0]], [[4.0]], points={"m": 0}), 1e8, 1e-13
    stops = [UnilateralContact("near", "m", 0.0, stiffness), UnilateralContact("far", {"m": -1.0}, far, 1e6)]
    with pytest.warns(MultiPhiWarning, match="slow model"):
        run = simulate(MultiPhiModel(structure, stops, modes="all"), 1e-3, [-depth])
    omega, t = math.sqrt(4.0 + stiffness), np.linspace(0, 1e-4, 11)
    assert_allclose(run.at("m", t), -depth * np.cos(omega * t), rtol=1e-9, atol=1e-12 * depth)
    assert [(event.contact, event.kind) for event in run.events] == [("near", "open")]
    assert_allclose(run.events[0].time, math.pi / (2 * omega), rtol=1e-9)


class TestFromATrajectory:
    @settings(derandomize=True, max_examples=40, deadline=None)
    @given(cases(law=("rigid", "mixed"), modes=("half", "few", "one")), st.floats(0.05, 0.9))
    def test_a_truncated_model_moves_as_without_the_break(self, case, share):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            first = simulate(case.model, share * case.t_end, case.displacement, case.velocity, case.loads)
            if first.status == "ok":
                rest = simulate(case.model, 1.05 * first.t_end, loads=case.loads, start=first)
                whole = simulate(case.model, 1.05 * first.t_end, case.displacement, case.velocity, case.loads)
                assert_goes_on(whole, first, rest, 1e-7)

    def test_random_models_do_too(self):
        phases = set()
        for seed in range(60):
            model, random = random_model(seed, truncated=True, kind=("rigid", "mixed")[seed % 2])
            velocity = 2 * random.normal(size=model.structure.n)
            load = [HarmonicLoad("m0", 1.0, 0.3)] if seed % 3 == 0 else [ConstantLoad("m0", 0.3)]
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                whole = simulate(model, 1.2, velocity=velocity, loads=load)
                first = simulate(model, 0.8, velocity=velocity, loads=load)
                rest = simulate(model, 1.2, loads=load, start=first)
            phases |= set(first.final.phases)
            assert_goes_on(whole, first, rest, 1e-6)
        assert len(phases) > 1

    def test_what_links_hold_goes_on(self):
        elements = Friction("ring", "m1", 0.3, stiffness=20.0), Friction("floor", "m3", 0.2)
        model = MultiPhiModel(chain(4), elements, modes="all")
        load = [HarmonicLoad("m3", 1.0, 0.1)]
        whole, first = (simulate(model, t, loads=load) for t in (40.0, 23.0))
        rest = simulate(model, 40.0, loads=load, start=first)
        assert_goes_on(whole, first, rest, 1e-9)
        assert len(rest.events) > 4

    def test_energy_balances_from_the_break_on(self):
        model = MultiPhiModel(chain(4), [UnilateralContact("stop", "m3", 0.2, 50.0)], modes=3)
        load = [HarmonicLoad("m3", 1.0, 0.1)]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            rest = simulate(model, 40.0, loads=load, start=simulate(model, 20.0, loads=load))
        assert abs(rest.ledger.residual) < 1e-12 * rest.ledger.initial
        assert rest.horizon() > 20.0

    def test_other_loads_begin_with_a_jump(self):
        model = MultiPhiModel(LinearStructure([[1.0]], [[4.0]], points={"m": 0}), [UnilateralContact("stop", "m", 0.0)])
        held = simulate(model, 1.0, loads=[ConstantLoad("m", -1.0)])
        assert held.final.states == (1,)
        freed = simulate(model, 2.0, loads=[ConstantLoad("m", 4.0)], start=held)
        assert [(e.kind, e.time) for e in freed.events] == [("open", 1.0)]
        assert_allclose(freed.at("m", 1.5), 1 - math.cos(1.0), rtol=1e-13)

    def test_what_cannot_go_on_is_refused(self):
        model = MultiPhiModel(chain(2), [UnilateralContact("stop", "m1", 1.0)])
        run = simulate(model, 1.0)
        for asked, message in (
            ({"t_end": 1.0}, "t_end: got 1 s, need a time after 1 s"),
            ({"model": MultiPhiModel(chain(2))}, "trajectory of another model"),
            ({"velocity": [0.0, 1.0]}, "a displacement or velocity as well"),
            ({"loads": [StopMotion("stop", Harmonic(0.1, 1.0))]}, "the stop of the rigid contact 'stop' jumps"),
        ):
            with pytest.raises(MultiPhiValueError, match=message):
                simulate(**{"model": model, "t_end": 2.0, "start": run} | asked)
        with pytest.raises(MultiPhiTypeError, match="start: got ndarray, need a Trajectory"):
            simulate(model, 2.0, start=np.zeros(2))
        with pytest.raises(MultiPhiValueError, match="need 1 <= t <= 2 s"):
            simulate(model, 2.0, start=run).displacement(0.5)


def assert_goes_on(whole, first, rest, tolerance):
    """Same status, events and motion; a run that fails does so after the break."""
    assert (rest.status, first.status) == (whole.status, "ok")
    events = [(e.contact, e.kind) for e in whole.events]
    assert [(e.contact, e.kind) for run in (first, rest) for e in run.events] == events
    times = [e.time for run in (first, rest) for e in run.events]
    assert_allclose(times, [e.time for e in whole.events], rtol=0, atol=tolerance * whole.t_end)
    t = np.linspace(first.t_end, rest.t_end, 21)
    size = np.max(np.abs(whole.displacement(np.linspace(0, rest.t_end, 101))))
    assert_allclose(rest.displacement(t), whole.displacement(t), rtol=0, atol=tolerance * size)


def test_the_ledger_of_a_truncated_run_that_goes_on_knows_nothing_of_what_was_lost_before():
    model = MultiPhiModel(chain(8), [UnilateralContact("stop", "m7", 0.01, 1e4)], modes=3)
    first = simulate(model, 2.0, velocity=-np.ones(8))
    assert any(event.loss.truncation_kinetic for event in first.events)
    again = simulate(model, 4.0, start=first)
    assert again.start_loss.total == 0
    assert_allclose(again.ledger.residual, 0, atol=1e-12 * again.ledger.initial)


def test_goes_on_in_the_middle_of_a_sweep_that_has_to_be_refined():
    """What interpolation leaves of the sweep is judged by the energy of the run's own time."""
    structure = LinearStructure([[1.0]], [[25.0]], points={"m": 0})
    model = MultiPhiModel(structure, [Friction("ring", "m", 0.3)], modes="all")
    loads = [SweepLoad("m", 2.0, 0.2, 3.0, 10.0)]
    whole, first = simulate(model, 10.0, loads=loads), simulate(model, 4.3, loads=loads)
    rest = simulate(model, 10.0, start=first, loads=loads)
    t = np.linspace(4.3, 10.0, 101)
    assert len(rest.events) > 5
    assert_allclose(rest.at("m", t), whole.at("m", t), rtol=0, atol=1e-7 * np.max(np.abs(whole.at("m", t))))


def moved_stop(course, size=1.0):
    """A light mass beside a rigid stop that moves by a course; its stiffness holds it where the stop strikes it."""
    structure = LinearStructure(np.eye(1), 40.0 * np.eye(1), np.eye(1), {"x": 0})
    model = MultiPhiModel(structure, [UnilateralContact("stop", "x", 0.3 * size)])
    return model, [StopMotion("stop", course)]


@pytest.mark.parametrize("size", [2.0**-30, 1.0, 3e5])
@pytest.mark.parametrize("kind", ["smooth", "rough", "harmonic"])
def test_beside_a_moving_rigid_stop_a_run_goes_on_from_any_instant(kind, size):
    """Also where the stop is at zero: its motion is as accurate as its travel, not as its place."""
    way = {
        "smooth": Smooth(lambda t: 0.1 * size * np.sin(3.3 * t) * np.cos(4.7 * t)),
        "rough": Smooth(lambda t: 0.1 * size * np.sin(3.3 * t) * np.cos(4.7 * t), tolerance=1e-4),
        "harmonic": Harmonic(0.1 * size, 3.3 / (2 * math.pi), -math.pi / 2),
    }[kind]
    model, loads = moved_stop(way, size)
    zeros, whole = [math.pi / 3.3 * i for i in (1, 2, 4, 5)], simulate(model, 6.5, velocity=[-size], loads=loads)
    for cut in [*np.random.default_rng(1).uniform(0.5, 6.0, 4), *zeros]:
        first = simulate(model, float(cut), velocity=[-size], loads=loads)
        both = simulate(model, 6.5, start=first, loads=loads)
        assert both.status == "ok"
        accurate = 1e-2 if kind == "rough" else 1e-5
        assert both.at("x", 6.5) == pytest.approx(whole.at("x", 6.5), abs=accurate * size)


@pytest.mark.parametrize("size", [2.0**-30, 1.0])
def test_a_stop_that_jumps_where_a_run_goes_on_is_refused(size):
    model, loads = moved_stop(Harmonic(0.1 * size, 0.5, -math.pi / 2), size)
    first = simulate(model, 2.0, velocity=np.array([-size]), loads=loads)
    for step in (1e-6, -1e-6, 0.02):
        _, others = moved_stop(Smooth(lambda t, way=step: size * (0.1 * np.sin(math.pi * t) + way)), size)
        with pytest.raises(MultiPhiValueError, match="stop of the rigid contact 'stop' jumps by"):
            simulate(model, 3.0, start=first, loads=others)
