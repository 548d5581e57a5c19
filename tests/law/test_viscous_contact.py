"""Viscous contacts: they never pull, close again inside, and their damper's work is damping."""

import numpy as np
import pytest
from lawful import assert_lawful
from numpy.testing import assert_allclose
from small_structures import chain
from true_law import against_viscous

import multiphi_exudyn as mp
from multiphi_exudyn.study.law_check import broken_laws

T = np.linspace(0, 12, 121)


def scene(seed):
    random = np.random.default_rng(seed)
    n = int(random.integers(2, 5))
    at, stiffness = f"m{random.integers(n)}", 10 ** random.uniform(0, 2)
    damping, gap = 10 ** random.uniform(-1.5, 1), random.uniform(-0.2, 0.5)
    contact = mp.UnilateralContact("stop", at, gap, stiffness, damping)
    return chain(n), contact, 1.5 * random.normal(size=n)


def runs(seed):
    structure, contact, velocity = scene(seed)
    run = mp.simulate(mp.MultiPhiModel(structure, [contact], modes="all"), 12.0, velocity=velocity)
    return run, *against_viscous(structure, contact, T, velocity, longest=0.1)


SEEDS = range(12)


class TestAgainstTheIntegrator:
    @pytest.mark.parametrize("seed", SEEDS)
    def test_motion_and_events_agree(self, seed):
        run, true, events = runs(seed)
        assert run.status == "ok"
        assert_allclose(run.displacement(T), true, rtol=0, atol=1e-10)
        assert [e.kind for e in run.events] == [kind for _, kind, _ in events]
        assert_allclose([e.time for e in run.events], [time for time, _, _ in events], rtol=0, atol=1e-10)


class TestLaw:
    @pytest.mark.parametrize("seed", SEEDS)
    def test_what_its_damper_takes_is_damping(self, seed):
        structure, contact, velocity = scene(seed)
        run = mp.simulate(mp.MultiPhiModel(structure, [contact], modes="all"), 12.0, velocity=velocity)
        ledger = run.ledger
        assert abs(ledger.residual) < 1e-12 * ledger.initial
        assert abs(ledger.truncation_kinetic) + abs(ledger.truncation_strain) < 1e-12 * ledger.initial
        assert ledger.impact == 0
        assert 0 < ledger.damping < ledger.initial

    @pytest.mark.parametrize("damping", [0.3, 3.0, 30.0])
    def test_a_moving_stop_presses_by_its_speed_too(self, damping):
        contact, velocity = mp.UnilateralContact("stop", "m0", 0.1, 20.0, damping), np.array([-1.0, 0.5])
        m = mp.MultiPhiModel(chain(2), [contact], modes="all")
        moving = mp.StopMotion("stop", mp.Harmonic(0.3, 0.4, -np.pi / 2))
        run, rate = mp.simulate(m, 12.0, velocity=velocity, loads=[moving]), 0.8 * np.pi

        def stop(t):
            return 0.3 * np.sin(rate * t), 0.3 * rate * np.cos(rate * t)

        expected, events = against_viscous(chain(2), contact, T, velocity, longest=0.05, stop=stop)
        assert_allclose(run.displacement(T), expected, rtol=0, atol=1e-9)
        assert_allclose([e.time for e in run.events], [time for time, _, _ in events], atol=1e-9)
        assert len(events) >= 4
        assert np.min(run.contact_force("stop", T)) >= -1e-12
        assert abs(run.ledger.residual) < 1e-11
        assert run.ledger.damping > 0


@pytest.mark.parametrize("restitution", [0.3, 1.0])
@pytest.mark.parametrize("friction", [0.0, 0.4])
def test_struck_off_its_stop_it_lets_go_at_once(friction, restitution):
    """A rigid wall ends its approach, and its slip, while it pushes."""
    structure = mp.LinearStructure(np.eye(2), np.zeros((2, 2)), None, {"x": 0, "y": 1})
    rubs = {"friction": friction, "tangential": "x"} if friction else {}
    soft = mp.UnilateralContact("soft", "y", 0.0, 1000.0, damping=50.0, **rubs)
    wall = mp.UnilateralContact("wall", {"x": 1.0, "y": 3.0}, 0.02, restitution=restitution)
    start = np.array([0.0, 0.01]), np.array([-0.5, -2.0])
    run = mp.simulate(mp.MultiPhiModel(structure, [soft, wall], modes="all"), 1.0, *start)
    struck = next(event.time for event in run.events if event.contact == "wall")
    assert run.contact_force("soft", struck - 1e-9) > 50.0
    assert [event.time for event in run.events if event.contact == "soft" and event.kind == "open"] == [struck]
    assert not broken_laws(run, [], start)


@pytest.mark.parametrize("damping", [10.0, 30.0, 100.0, 300.0])
@pytest.mark.parametrize("masses", [(2.0, 1.0), (1.0, 1.0), (1.0, 3.0)])
@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_open_inside_it_stays_open_where_one_guide_takes_over_from_the_other(damping, masses, share):
    """Two rigid guides that face each other hold x + y; the load across them turns while the damped stop is left."""
    structure = mp.LinearStructure(np.diag(masses), [[5.0, -5.0], [-5.0, 5.0]], None, {"x": 0, "y": 1})
    across = {"x": 1.0, "y": 1.0}
    guides = [mp.UnilateralContact(name, dict.fromkeys(across, s), 0.0) for name, s in (("low", 1.0), ("high", -1.0))]
    model = mp.MultiPhiModel(structure, [*guides, mp.UnilateralContact("soft", "y", 0.0, 1.0, damping)], modes="all")
    start = np.array([-1.0, 1.0]), np.array([-1.0, 1.0])
    alone = mp.simulate(model, 4.0, *start)
    let_go = next(e.time for e in alone.events if e.contact == "soft" and e.kind == "open")
    left = next(t for t in np.linspace(let_go, 4.0, 2000) if alone.gap("soft", t) > 0)
    turn = let_go + share * (left - let_go)
    width = 0.5 * min(turn - let_go, left - turn)
    loads = [mp.SampledLoad(across, [0.0, turn - width, turn + width, 4.0], [-20.0, -20.0, 20.0, 20.0])]
    run = mp.simulate(model, 4.0, *start, loads)
    assert_lawful(run, loads, 1e-10, start)
    taken = [e.time for e in run.events if e.contact == "high" and e.kind == "close" and let_go < e.time < left]
    assert taken
    assert float(run.gap("soft", taken[0])) < 0
    assert_allclose(run.displacement(T / 3), alone.displacement(T / 3), atol=1e-11)
