"""Steady states and frequency responses: exact where linear, an integrator's where not, named where there is none."""

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from small_structures import chain, oscillator, random_structure

import multiphi_exudyn as mp
from multiphi_exudyn.steady.shooting import ATTRACTS
from multiphi_exudyn.time import motion as chatter

EXACT = 1e-8  # the round-off of finite differences, magnified by modes that hardly decay
OWN = 1e-6  # of the integrator at its tolerances
SETTLED = 215.0  # s, in which a motion of the bilinear oscillator decays to 3e-6


def bilinear(gap=0.5, ratio=0.03):
    """m = 2 kg, k = 8 N/m, a stop of 200 N/m."""
    return oscillator(gap=gap, contact=200.0, damping=mp.ModalDamping([ratio]))


def integrated(model, load, x, v, periods):
    """Samples of the last of some periods, by an integrator that knows nothing of events or modes."""
    (contact,) = model.contacts
    damping = 2 * 0.03 * 2.0 * 2.0  # 2 zeta omega m
    omega = 2 * math.pi * load.frequency_hz

    def rates(t, y):
        x, v = y.tolist()
        pushed = contact.stiffness * max(0.0, -(contact.gap + x))
        return [v, (load.amplitude * math.cos(omega * t) - damping * v - 8.0 * x + pushed) / 2.0]

    end = periods / load.frequency_hz
    times = np.linspace(end - 1 / load.frequency_hz, end, 2001)
    limits = {"rtol": 1e-10, "atol": 1e-12, "max_step": 0.05 / load.frequency_hz}
    return solve_ivp(rates, (0, end), [x, v], method="DOP853", t_eval=times, **limits).y[0]


@settings(max_examples=6)
@given(seed=st.integers(0, 10**6))
@example(seed=290)  # a largest displacement just before the end of the period
def test_without_contact_the_frequency_response_is_that_of_the_matrices(seed):
    n, mass, stiffness, _, random = random_structure(seed)
    root = random.normal(size=(n, n)) * 0.3
    damping = root @ root.T + 0.02 * mass
    structure = mp.LinearStructure(mass, stiffness, damping=damping, points={f"m{i}": i for i in range(n)})
    frequencies = random.uniform(0.05, 4.0, 3)
    response = mp.frequency_response(
        mp.MultiPhiModel(structure, modes="all"),
        mp.HarmonicLoad("m1", 0.7, 1.0, phase=random.uniform(0, 6)),
        frequencies,
        tolerance=1e-10,
    )
    systems = [stiffness - w**2 * mass + 1j * w * damping for w in 2 * np.pi * frequencies]
    exact = np.array([0.7 * abs(np.linalg.solve(system, np.eye(n)[1])) for system in systems])
    assert [state.status for state in response.states] == ["periodic"] * 3
    assert max(state.periods for state in response.states) <= 64
    for i in range(n):
        assert response.amplitude(f"m{i}") == pytest.approx(exact[:, i], rel=EXACT, abs=EXACT * np.max(exact))


def test_a_base_that_moves_gives_the_relative_response_of_its_inertia():
    model, hz = oscillator(gap=10.0, contact=200.0, damping=mp.ModalDamping([0.03])), 0.4
    state = mp.steady_state(model, mp.BaseMotion("m0", mp.Harmonic(0.1, hz)), tolerance=1e-10)
    w = 2 * math.pi * hz
    assert state.amplitude("m0") == pytest.approx(0.1 * w**2 / abs(4 - w**2 + 2j * 0.03 * 2 * w), rel=EXACT)


def test_a_mode_that_rings_for_thousands_of_periods_is_not_waited_for():
    structure = chain(3, damping=mp.ModalDamping([1e-5, 0.02, 0.02]))
    state = mp.steady_state(mp.MultiPhiModel(structure, modes="all"), mp.HarmonicLoad("m0", 1.0, 0.2), tolerance=1e-9)
    decay = 1e-5 * math.sqrt(2 - 2 * math.cos(math.pi / 7))
    assert state.status == "periodic"
    assert state.periods <= 64
    assert state.multiplier == pytest.approx(math.exp(-decay / 0.2), abs=1e-7)


@pytest.mark.parametrize(("hz", "size"), [(0.42, 1.2), (0.42, 0.0), (0.7, 0.0)])
def test_a_bilinear_oscillator_settles_where_an_integrator_does(hz, size):
    model, load = bilinear(), mp.HarmonicLoad("m0", 1.0, hz)
    state = mp.steady_state(model, load, displacement=np.array([size]), tolerance=1e-9)
    x = integrated(model, load, size, 0.0, math.ceil(SETTLED * hz))
    times = np.linspace(0, state.trajectory.t_end, 2001)
    assert (state.status, state.order) == ("periodic", 1)
    assert np.max(np.abs(state.trajectory.at("m0", times) - x)) < 1e2 * OWN  # what has not decayed
    assert state.duty("stop") == pytest.approx(float(np.mean(x < -0.5)), abs=1e-3)


def test_going_up_stays_on_the_upper_branch_and_going_down_on_the_lower_one():
    frequencies = np.array([0.30, 0.34, 0.38, 0.42, 0.50])
    up = mp.frequency_response(bilinear(), mp.HarmonicLoad("m0", 1.0, 1.0), frequencies)
    back = {"displacement": up.last.displacement, "velocity": up.last.velocity}
    down = mp.frequency_response(bilinear(), mp.HarmonicLoad("m0", 1.0, 1.0), frequencies[::-1], **back)
    upper, lower = up.amplitude("m0"), down.amplitude("m0")[::-1]
    assert upper[[0, 4]] == pytest.approx(lower[[0, 4]], rel=1e-5)
    assert upper[3] > 4 * lower[3]
    assert down.duty("stop")[1] == 0.0
    assert up.duty("stop")[3] > 0.05
    assert list(up.orders) == list(down.orders) == [1] * 5


def test_a_sub_harmonic_response_repeats_after_its_order_and_not_before():
    model, load = bilinear(gap=0.0, ratio=0.01), mp.HarmonicLoad("m0", 1.0, 1.06)
    state = mp.steady_state(model, load, tolerance=1e-9)
    on = mp.simulate(model, 4 / load.frequency_hz, state.displacement, state.velocity, [load])
    x = on.at("m0", np.minimum(np.arange(5) / load.frequency_hz, on.t_end))
    assert (state.status, state.order) == ("periodic", 2)
    assert x[2:] == pytest.approx(x[:3], abs=1e-8)
    assert abs(x[1] - x[0]) > 0.1 * state.amplitude("m0")
    assert len(state.amplitudes("m0")) == 2
    assert state.multiplier == pytest.approx(math.exp(-0.02 / 1.06), rel=1e-6)  # areas shrink by exp(-c T / m)


def test_a_rigid_stop_gives_the_known_amplitude_of_one_impact_a_period():
    """Restitution 0, the mass leaves the stop again: the state at impact follows from the closed form."""
    model, load = oscillator(gap=0.2, damping=mp.ModalDamping([0.05])), mp.HarmonicLoad("m0", 2.0, 0.45)
    state = mp.steady_state(model, load, tolerance=1e-9)
    assert (state.status, state.order) == ("periodic", 1)
    closed = [event for event in state.trajectory.events if event.kind == "close"]
    assert len(closed) == 1
    lost = sum(event.energy_loss for event in closed)
    assert state.trajectory.ledger.work_of_loads == pytest.approx(
        lost + state.trajectory.ledger.damping, rel=1e-8
    )  # in a period nothing is stored


def test_a_response_that_does_not_attract_is_not_taken_for_one():
    """Beyond the end of a branch period 1 goes on existing, repelling; multipliers of what is found lie inside."""
    model = bilinear(gap=0.0, ratio=0.01)
    for hz in (0.9, 1.0, 1.06, 1.1, 1.2):
        state = mp.steady_state(model, mp.HarmonicLoad("m0", 1.0, hz))
        assert state.status == "periodic"
        assert math.isnan(state.multiplier) or state.multiplier < ATTRACTS


def test_a_run_that_fails_is_a_state_with_its_cause_and_the_next_frequency_goes_on(monkeypatch):
    """A stop as stiff as the spring, an impact a period of the load, where fewer are called chatter."""
    monkeypatch.setattr(chatter, "CHATTER_WINDOW", 12)
    monkeypatch.setattr(chatter, "EVENTS_PER_PERIOD", 0.5)
    model = oscillator(gap=0.4, contact=8.0, damping=mp.ModalDamping([0.3]))
    response = mp.frequency_response(model, mp.HarmonicLoad("m0", 4.0, 1.0), [0.3, 2.0])
    failed, settled = response.states
    assert failed.status == "failed"
    assert "chatter: 12 events in" in failed.message
    assert failed.message.startswith("after ")
    assert settled.status == "periodic"
    assert response.last is settled
    assert np.isnan(response.amplitude("m0")).tolist() == [True, False]
    assert np.isnan(response.duty("stop")).tolist() == [True, False]
    assert math.isnan(failed.amplitude("m0"))


@pytest.mark.parametrize(
    ("begins", "kind", "change"),
    [
        ("load frequency_hz: got 0", ValueError, {"load": mp.HarmonicLoad("m0", 1.0, 0.0)}),
        ("load: got SweepLoad", TypeError, {"load": mp.SweepLoad("m0", 1.0, 1.0, 2.0, 3.0)}),
        ("other_loads: got HarmonicLoad", TypeError, {"other_loads": [mp.HarmonicLoad("m0", 1.0, 2.0)]}),
        ("load course: got Sweep", TypeError, {"load": mp.BaseMotion("m0", mp.Sweep(1.0, 1.0, 2.0, 3.0))}),
        ("periods: got 0", ValueError, {"periods": 0}),
        ("tolerance: got 0", ValueError, {"tolerance": 0}),
        ("displacement: got", ValueError, {"displacement": np.zeros(3)}),
    ],
)
def test_what_a_steady_state_cannot_be_of_is_refused(refused, begins, kind, change):
    given = {"load": mp.HarmonicLoad("m0", 1.0, 0.3)} | change
    refused(kind, begins, lambda: mp.steady_state(bilinear(), **given))
