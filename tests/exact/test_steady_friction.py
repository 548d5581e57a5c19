"""Steady states with friction: Den Hartog's amplitudes, an integrator's, and places that are kept for ever.

J. P. Den Hartog, Forced vibrations with combined Coulomb and viscous friction, Trans. ASME 53 (1931).
"""

import math

import numpy as np
import pytest
from small_structures import chain

import multiphi_exudyn as mp

RATIOS = mp.ModalDamping([0.02, 0.02, 0.02])


def block(*elements, stiffness=1.0):
    structure = mp.LinearStructure([[1.0]], [[stiffness]], points={"m": 0})
    return mp.MultiPhiModel(structure, elements, modes="all")


@pytest.mark.parametrize(("beta", "share", "expected"), [(0.7, 0.5, 1.744253936249), (1.5, 0.4, 0.653197264742)])
def test_den_hartogs_amplitude_is_settled_to_from_rest(beta, share, expected):
    load = mp.HarmonicLoad("m", 1.0, beta / (2 * math.pi))
    state = mp.steady_state(block(mp.Friction("floor", "m", share)), load, tolerance=1e-9)
    assert (state.status, state.order) == ("periodic", 1)
    assert state.amplitude("m") == pytest.approx(expected, abs=2e-12)
    assert 0.0 < state.multiplier < 1.0  # without damping: only friction makes it attract
    ledger = state.trajectory.ledger
    assert ledger.work_of_loads == pytest.approx(ledger.friction, rel=1e-9)
    assert ledger.friction == pytest.approx(4 * share * expected, rel=1e-9)


@pytest.mark.parametrize("stiffness", [30.0, math.inf])
def test_stick_and_slip_repeat_where_a_long_run_does(stiffness):
    model = mp.MultiPhiModel(
        chain(3, damping=RATIOS, stiffness=9.0), [mp.Friction("ring", "m1", 0.4, stiffness=stiffness)], modes="all"
    )
    load = mp.HarmonicLoad("m2", 1.3, 0.31)
    state = mp.steady_state(model, load, tolerance=1e-10)
    assert (state.status, state.order) == ("periodic", 1)
    assert {"stick", "slip"} == {event.kind for event in state.trajectory.events}
    period = 1 / load.frequency_hz
    long = mp.simulate(model, 200 * period, loads=[load])
    t = np.linspace(0, period, 101)
    size = state.amplitude("m2")
    assert np.max(np.abs(state.trajectory.at("m2", t) - long.at("m2", 199 * period + t))) < 1e-8 * size
    force = state.trajectory.friction_force("ring", t)
    assert np.max(np.abs(force - long.friction_force("ring", 199 * period + t))) < 1e-7


class TestWhatNeverSlips:
    """Every held place has a response of its own; which one, the start decides, and it is neutral to that place."""

    def model(self, limit=5.0):
        return mp.MultiPhiModel(chain(3, damping=RATIOS), [mp.Friction("ring", "m1", limit)], modes="all")

    @pytest.mark.parametrize("place", [0.0, 0.1, -0.3])
    def test_stays_where_the_path_has_left_it(self, place):
        load = mp.HarmonicLoad("m2", 1.0, 0.2)
        state = mp.steady_state(self.model(), load, displacement=[place] * 3, tolerance=1e-9)
        assert state.status == "periodic"
        assert not state.trajectory.events
        assert state.trajectory.at("m1", 0.0) == pytest.approx(place, abs=1e-14)
        stuck = self.model().level(("ring",))
        motion = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.diag(stuck.squares), -stuck.damping]])
        slowest = np.max(np.linalg.eigvals(motion).real)
        assert state.multiplier == pytest.approx(math.exp(slowest / 0.2), rel=1e-7)

    def test_is_handed_on_to_the_next_frequency(self):
        """Pulled away first: from each frequency to the next the ring stays where it was dragged to."""
        model = self.model(0.3)
        dragged = mp.steady_state(model, mp.HarmonicLoad("m2", 1.0, 0.2), other_loads=[mp.ConstantLoad("m1", 2.0)])
        weak = mp.HarmonicLoad("m2", 0.05, 0.2)
        response = mp.frequency_response(model, weak, [0.3, 0.35], start=dragged.trajectory)
        places = [float(np.mean(state.trajectory.at("m1", np.array([0.0, 1.0])))) for state in response.states]
        assert [state.status for state in response.states] == ["periodic"] * 2
        assert places[0] == pytest.approx(places[1], abs=1e-9)
        assert abs(places[0]) > 0.03
        alone = mp.steady_state(model, weak)
        assert abs(alone.trajectory.at("m1", 0.0)) < 1e-12


class TestContacts:
    @pytest.mark.parametrize(("stiffness", "spring"), [(80.0, math.inf), (80.0, 40.0), (math.inf, math.inf)])
    @pytest.mark.parametrize("static", [None, 0.6])
    def test_that_lift_off_repeat_where_a_long_run_does(self, stiffness, spring, static):
        structure = mp.LinearStructure(
            np.diag([1.0, 0.5]), [[4.0, 0.6], [0.6, 6.0]], damping=[[0.2, 0.0], [0.0, 0.3]], points={"x": 0, "y": 1}
        )
        floor = mp.UnilateralContact(
            "floor", "y", 0.0, stiffness, friction=0.4, static_friction=static, tangential="x",
            tangential_stiffness=spring,
        )  # fmt: skip
        model, press = mp.MultiPhiModel(structure, [floor], modes="all"), mp.ConstantLoad("y", -1.0)
        load = mp.HarmonicLoad({"x": 1.0, "y": 0.8}, 3.0, 0.45)
        state = mp.steady_state(model, load, other_loads=[press], tolerance=1e-10)
        assert state.status == "periodic"
        kinds = {event.kind for event in state.trajectory.events}
        assert kinds >= {"close", "open", "slip"}
        assert 0 < state.duty("floor") < 1
        period = 1 / load.frequency_hz
        long = mp.simulate(model, 240 * period, loads=[load, press])
        t = np.linspace(0, period, 101)
        last = (240 - state.order) * period
        size = state.amplitude("x")
        assert np.max(np.abs(state.trajectory.at("x", t) - long.at("x", last + t))) < 1e-7 * size
        work = state.trajectory.ledger
        assert work.work_of_loads == pytest.approx(work.friction + work.damping + work.impact, rel=1e-7)


def test_den_hartogs_neutral_orbit_is_found():
    """Half the natural frequency: in half a period a disturbance swings once, and shrinks with its own square."""
    load = mp.HarmonicLoad("m", 1.0, 0.5 / (2 * math.pi))
    state = mp.steady_state(block(mp.Friction("floor", "m", 0.3)), load, tolerance=1e-9)
    assert (state.status, state.order) == ("periodic", 1)
    assert state.amplitude("m") == pytest.approx(4 / 3, abs=1e-11)
    assert 0.999 < state.multiplier < 1
