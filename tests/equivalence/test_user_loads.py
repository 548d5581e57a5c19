"""Loads as users bring them: steps, ramps, pulses, resonance, many samples; against an integrator, in bounded work."""

import math

import numpy as np
import pytest
from integrated import integrated
from small_structures import chain

import multiphi_exudyn as mp
from multiphi_exudyn.time import excitation, run_warnings

TIMES = np.linspace(0.0, 2.0, 81)
STOPS = (mp.UnilateralContact("below", "m2", 0.02, 500.0), mp.UnilateralContact("above", {"m0": -1.0}, 0.03, 300.0))


def structure():
    return chain(3, damping=np.diag([0.3, 0.1, 0.2]), stiffness=200.0)


FUNCTIONS = {
    "step down": (lambda t: 5 if t < 0.1 else 0, (0.1,)),
    "step up": (lambda t: 0 if t <= 0.7 else -5.0, (0.7,)),
    "ramp": (lambda t: 5 * min(t / 0.3, 1.0), (0.3,)),
    "half sine": (lambda t: 30 * math.sin(math.pi * t / 0.02) if t < 0.02 else 0.0, (0.02,)),
    "rectified": (lambda t: 4 * np.abs(np.sin(9 * t)), np.arange(1, 6) * math.pi / 9),
    "where": (lambda t: np.where(t < 0.4, 3 * np.sin(40 * t), np.where(t < 1.1, -2.0, 4.0)), (0.4, 1.1)),
    "pulse": (lambda t: 30 * np.exp(-(((t - 0.777) / 1e-2) ** 2)), ()),
    "constant": (lambda t: 3.0, ()),
    "resonant": (lambda t: 12 * np.cos(RESONANCE * t), ()),
    "nearly resonant": (lambda t: 12 * np.cos(RESONANCE * (1 + 1e-9) * t), ()),
}
RESONANCE = float(mp.MultiPhiModel(structure(), [], modes="all").level(()).omega[1])


@pytest.mark.parametrize(
    ("name", "contacts"), [*((name, STOPS) for name in FUNCTIONS), ("rectified", ()), ("nearly resonant", ())]
)
def test_a_function_of_time_gives_the_motion_of_an_integrator(name, contacts):
    function, breaks = FUNCTIONS[name]
    run = mp.simulate(
        mp.MultiPhiModel(structure(), contacts, modes="all"), 2.0, loads=[mp.FunctionLoad("m1", function)]
    )

    def force(t):
        return np.array([0.0, float(function(t)), 0.0])

    expected, events = integrated(structure(), TIMES, force, contacts=contacts, breaks=breaks, longest=0.02)
    assert run.status == "ok"
    assert np.max(np.abs(run.displacement(TIMES) - expected)) < 2e-9 * np.max(np.abs(expected))
    assert [event.time for event in run.events] == pytest.approx(events, abs=1e-9)
    assert len(events) >= 2 or not contacts
    assert abs(run.ledger.residual) < 1e-10 * max(run.ledger.work_of_loads, run.ledger.final)


class TestMotionsThatJump:
    KINK = mp.Smooth(lambda t: np.abs(t - 0.5))  # at an end of the first pieces
    JUMP = mp.Smooth(lambda t: 0.01 if t < 0.3 else 0.0)
    BENT = mp.Smooth(lambda t: np.where(t < 0.3, 0, 0.1 * (t - 0.3) ** 2))

    def run(self, load, stiffness=math.inf, damping=0.0):
        stop = mp.UnilateralContact("stop", "m2", 0.5, stiffness, damping)
        return mp.simulate(mp.MultiPhiModel(structure(), [stop], modes="all"), 2.0, loads=[load])

    @pytest.mark.parametrize(
        ("course", "given", "what"),
        [
            (KINK, {}, "speed jumps at t = 0.5 s"),
            (JUMP, {}, "position jumps at t = 0.3 s"),
            (JUMP, {"stiffness": 100.0, "damping": 3.0}, "position jumps at t = 0.3 s"),
        ],
    )
    def test_of_a_stop_that_cannot_follow_are_refused_by_name(self, course, given, what, refused):
        load = mp.StopMotion("stop", course)
        begins = f"loads[0] (StopMotion at 'stop'): got a motion of the stop of 'stop' whose {what}"
        refused(ValueError, begins, self.run, load, **given)

    @pytest.mark.parametrize(
        ("course", "given"),
        [
            (BENT, {}),
            (KINK, {"stiffness": 100.0}),
            (JUMP, {"stiffness": 100.0}),
            (KINK, {"stiffness": 9.0, "damping": 3.0}),
        ],
    )
    def test_that_a_stop_can_follow_run(self, course, given):
        run = self.run(mp.StopMotion("stop", course), **given)
        assert run.status == "ok"


class TestManyPieces:
    def test_more_than_a_run_can_take_are_refused_with_their_number_before_it_begins(self, refused, monkeypatch):
        monkeypatch.setattr(excitation, "MOST_EFFORT", 2**14)
        time = np.linspace(0.0, 1.0, 2**14 + 2)
        load = mp.SampledLoad("m0", time, np.random.default_rng(0).normal(size=len(time)))
        model = mp.MultiPhiModel(chain(1), modes="all")
        begins = f"loads: got {2**14 + 1} pieces in 1 s, need at most {2**14}"
        refused(ValueError, begins, mp.simulate, model, 1.0, loads=[load])

    def test_many_are_told(self, monkeypatch):
        monkeypatch.setattr(run_warnings, "MANY_PIECES", 100)
        load = mp.SampledLoad("m0", np.linspace(0.0, 1.0, 201), np.random.default_rng(0).normal(size=201))
        model = mp.MultiPhiModel(chain(1), modes="all")
        with pytest.warns(
            mp.MultiPhiWarning, match="load pieces: the loads have 200 pieces in 1 s, each of which takes"
        ):
            run = mp.simulate(model, 1.0, loads=[load])
        assert [sentence.split(":")[0] for sentence in run.warnings] == ["load pieces"]
        few = mp.SampledLoad("m0", load.time[:50], load.force[:50])
        assert mp.simulate(model, 1.0, loads=[few]).warnings == ()


@pytest.mark.parametrize("push", [5.0, -5.0, 100.0, 0.0])
@pytest.mark.parametrize("load", [
    mp.SweepLoad("x", 0.1, 0.5, 2.0, 5.0),
    mp.FunctionLoad("x", lambda t: 0.1 * np.sin(t) ** 3),
    mp.FunctionLoad("x", lambda t: 0.1 * np.sin(t) ** 3, tolerance=1e-6),
])  # fmt: skip
def test_a_force_law_that_pushes_at_rest_moves_as_a_spring_and_a_load(push, load):
    """Its energy is counted from the end of its table nearest to rest, and is below zero at equilibrium."""
    law = mp.ForceLaw("x", (np.array([-20.0, 20.0]), push + 10 * np.array([-20.0, 20.0])), name="preload")
    one_sided = mp.ForceLaw("x", (np.array([0.0, 1.0]), push + np.array([0.0, 10.0])), name="preload")
    sprung = mp.LinearStructure([[1.0]], [[20.0]], [[0.5]], {"x": 0})
    t, start = np.linspace(0, 5, 41), [-push / 20]
    expected = mp.simulate(mp.MultiPhiModel(sprung), 5.0, displacement=start, loads=[load, mp.ConstantLoad("x", -push)])
    for given in (law, one_sided):
        model = mp.MultiPhiModel(mp.LinearStructure([[1.0]], [[10.0]], [[0.5]], {"x": 0}), [given])
        run = mp.simulate(model, 5.0, displacement=start, loads=[load])
        assert (run.status, run.message) == ("ok", "")
        assert np.max(np.abs(run.at("x", t) - expected.at("x", t))) < 1e-6 * max(abs(push), 0.1)
        assert abs(run.ledger.residual) < 1e-9 * max(push**2, 1.0)
