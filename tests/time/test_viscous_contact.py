"""Viscous contacts: they never pull, close again inside, and their damper's work is damping."""

import numpy as np
import pytest
from lawful import assert_lawful
from numpy.testing import assert_allclose
from small_structures import chain
from true_law import against_viscous

import multiphi_exudyn as mp
from multiphi_exudyn.study.stability.law_check import broken_laws

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

    def test_the_scenes_open_inside_and_close_again_inside(self):
        found = [kind for seed in SEEDS for _, kind, gap in runs(seed)[2] if gap < -1e-6]
        assert found.count("open") > 20
        assert found.count("close") >= 2


class TestLaw:
    @pytest.mark.parametrize("seed", SEEDS)
    def test_never_pulls_and_never_pushes_while_open(self, seed):
        structure, contact, velocity = scene(seed)
        run = mp.simulate(mp.MultiPhiModel(structure, [contact], modes="all"), 12.0, velocity=velocity)
        force, gap = run.contact_force("stop", T), run.gap("stop", T)
        rate = structure.row(contact.direction) @ run.velocity(T)
        expected = np.where(gap < 0, np.maximum(0, -contact.stiffness * gap - contact.damping * rate), 0)
        assert_allclose(force, expected, rtol=0, atol=1e-10 * np.max(force))

    @pytest.mark.parametrize("seed", SEEDS)
    def test_what_its_damper_takes_is_damping(self, seed):
        structure, contact, velocity = scene(seed)
        run = mp.simulate(mp.MultiPhiModel(structure, [contact], modes="all"), 12.0, velocity=velocity)
        ledger = run.ledger
        assert abs(ledger.residual) < 1e-12 * ledger.initial
        assert abs(ledger.truncation_kinetic) + abs(ledger.truncation_strain) < 1e-12 * ledger.initial
        assert ledger.impact == 0
        assert 0 < ledger.damping < ledger.initial

    def test_of_truncated_levels_closes_the_ledger_too(self):
        contact = mp.UnilateralContact("stop", "m3", 0.2, 40.0, 4.0)
        run = mp.simulate(mp.MultiPhiModel(chain(6), [contact], modes=4), 60.0, velocity=np.arange(6.0) / 3)
        assert run.status == "ok"
        assert len(run.events) > 5
        assert abs(run.ledger.residual) < 1e-12 * run.ledger.initial

    def test_without_damping_is_a_compliant_contact(self):
        small = [mp.UnilateralContact("stop", "m0", 0.2, 40.0, c) for c in (0.0, 1e-9)]
        first, second = (
            mp.simulate(mp.MultiPhiModel(chain(3), [c], modes="all"), 12.0, velocity=np.ones(3)) for c in small
        )
        assert_allclose(second.displacement(T), first.displacement(T), rtol=0, atol=1e-7)

    def test_beside_others_under_a_harmonic_load(self):
        contacts = [
            mp.UnilateralContact("viscous", "m0", 0.1, 20.0, 3.0),
            mp.UnilateralContact("rigid", {"m3": -1.0}, 0.8),
            mp.ForceLaw("m2", ([-1, 0, 1], [-2, 0, 1])),
        ]
        m = mp.MultiPhiModel(chain(4), contacts, modes="all")
        run = mp.simulate(m, 20.0, velocity=np.ones(4), loads=[mp.HarmonicLoad("m1", 0.5, 0.3)])
        assert run.status == "ok"
        assert {e.contact for e in run.events} >= {"viscous", "rigid", "law"}
        assert abs(run.ledger.residual) < 1e-9
        assert run.ledger.damping > 0
        assert run.ledger.impact > 0

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


def truncated_beam(seed):
    """A cantilever on one or two damped stops, thrown, bent, pressed or shaken, in 8 to 14 modes."""
    random = np.random.default_rng([seed, 77])
    section = mp.Section.rectangle(0.0, 1.0, width=0.03, height=0.01, youngs_modulus=4e9, density=3333.0)
    beam = mp.planar_beam(mp.Beam([section], {"mid": 0.5, "tip": 1.0}), 20, mp.ModalDamping(0.01))
    stops = [
        mp.UnilateralContact(
            at, at, random.choice([0.0, 0.01]), 10 ** random.uniform(2, 5), damping=10 ** random.uniform(-1, 2.5)
        )
        for at in (["mid"], ["tip"], ["mid", "tip"])[seed % 3]
    ]
    loads = ([], [mp.ConstantLoad("tip", -1.0)], [mp.HarmonicLoad("tip", 1.0, random.uniform(0.5, 8))])[seed // 3 % 3]
    model = mp.MultiPhiModel(beam, stops, modes=int(random.integers(8, 15)))
    x, v = model.static_equilibrium({"tip": random.uniform(1, 5)}), np.zeros(beam.n)
    if seed % 2:
        x, v = 0 * x, -random.uniform(0.3, 2) * (np.array(beam.row("tip")) + np.array(beam.row("mid")))
    return model, (x, v), loads


@pytest.mark.parametrize("seed", range(18))
def test_of_a_truncated_model_it_lets_go_where_its_force_ends(seed):
    """The modes with the stop and those without it tell its force apart, by what both leave out."""
    model, start, loads = truncated_beam(seed)
    run = mp.simulate(model, 1.0, *start, loads)
    assert run.status == "ok"
    assert {"close", "open"} <= {event.kind for event in run.events}
    for stop in model.contacts:
        force = run.contact_force(stop.name, np.linspace(0, 1, 4001))
        assert np.min(force) >= -1e-9 * np.max(force)
    assert not broken_laws(run, loads, start)


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


@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("k", [1.0, 1000.0])
def test_reached_at_the_instant_of_an_impact_that_turns_it_back_it_never_pushes_nor_pulls(restitution, k):
    """A rigid wall is struck at the same instant: the velocity after the impact leads away from the damped stop."""
    structure = mp.LinearStructure(np.eye(2), np.zeros((2, 2)), None, {"x": 0, "y": 1})
    soft = mp.UnilateralContact("soft", "y", 0.0, k, damping=50.0)
    wall = mp.UnilateralContact("wall", {"x": 1.0, "y": 1.0}, 0.0, restitution=restitution)
    start = np.array([1.0, 0.5]), np.array([-2.0, -1.0])
    for contacts in ([soft, wall], [wall, soft]):
        run = mp.simulate(mp.MultiPhiModel(structure, contacts, modes="all"), 1.0, *start)
        assert_lawful(run, (), start=start)
        assert run.ledger.damping == 0.0
        turned = 1.5 * (1 + restitution)
        assert_allclose(run.velocity(1.0), [turned - 2.0, turned - 1.0], atol=1e-14)


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
