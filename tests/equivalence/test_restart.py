"""A run goes on from any instant of another one: what round-off left of a gap is no start inside a stop."""

import math
import warnings

import numpy as np
import pytest
from campaign_scenes.plain import cases
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from small_structures import chain, random_model

from multiphi_exudyn import (
    ConstantLoad,
    Friction,
    HarmonicLoad,
    LinearStructure,
    MultiPhiModel,
    MultiPhiTypeError,
    MultiPhiValueError,
    StopMotion,
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
