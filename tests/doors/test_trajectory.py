"""A trajectory answers at any time, on either side of an event, with what the full matrices would give."""

from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import quad
from small_structures import chain, random_model, stop

from multiphi_exudyn import ConstantLoad, MultiPhiModel, RayleighDamping, simulate

SOFT = 40.0
LOAD = -0.7


@pytest.fixture(scope="module", name="run")
def bouncing_chain():
    """Five masses over a rigid and a compliant stop, damped, under a constant load: both kinds close and open."""
    structure = chain(5, damping=RayleighDamping(0.02, 1e-3))
    contacts = [stop("m2", 0.2), stop("m4", 0.4, SOFT, "soft")]
    run = simulate(
        MultiPhiModel(structure, contacts, modes="all"),
        20.0,
        displacement=np.linspace(0, 2, 5),
        loads=[ConstantLoad("m3", LOAD)],
    )
    assert run.status == "ok"
    assert {event.contact for event in run.events if event.kind == "open"} == {"stop", "soft"}
    return run


def first(run, contact, kind):
    return next(event for event in run.events if (event.contact, event.kind) == (contact, kind))


class TestEvaluation:
    def test_points_gaps_forces_and_energies_are_floats_or_arrays(self, run):
        times = np.linspace(0, 20, 7)
        for one in (
            lambda t: run.at("m4", t),
            lambda t: run.gap("soft", t),
            lambda t: run.contact_force("stop", t),
            run.energy,
        ):
            assert isinstance(one(2.0), float)
            assert_allclose(one(times), [one(t) for t in times], rtol=1e-10, atol=1e-12)
        assert_allclose(run.at("m4", times), run.displacement(times)[4], atol=1e-13)
        assert_allclose(run.at({"m4": 2.0, "m0": -1.0}, 5.0), 2 * run.at("m4", 5.0) - run.at("m0", 5.0), rtol=1e-12)
        assert_allclose(run.gap("soft", times), run.displacement(times)[4] + 0.4, atol=1e-12)

    def test_derivatives_are_those_of_the_displacement(self, run):
        h = 1e-4
        for t in np.linspace(0.7, 19.3, 40):
            if any(abs(event.time - t) < 3 * h for event in run.events):
                continue
            around = [run.displacement(t + k * h) for k in (-1, 0, 1)]
            assert_allclose(run.velocity(t), (around[2] - around[0]) / (2 * h), atol=1e-5)
            assert_allclose(run.acceleration(t), (around[2] - 2 * around[1] + around[0]) / h**2, atol=2e-4)

    def test_equations_of_motion_hold_with_the_contact_forces(self, run):
        s, t = run.model.structure, np.linspace(0.01, 19.99, 400)
        damping = 0.02 * np.array(s.mass) + 1e-3 * np.array(s.stiffness)
        forces = LOAD * np.eye(5)[:, [3]] + np.outer(np.eye(5)[2], run.contact_force("stop", t))
        forces = forces + np.outer(np.eye(5)[4], run.contact_force("soft", t))
        left = s.mass @ run.acceleration(t) + damping @ run.velocity(t) + s.stiffness @ run.displacement(t)
        assert_allclose(left, forces, atol=1e-10)


class TestLimitsAtEvents:
    def test_a_rigid_contact_that_closes_has_two_velocities_and_one_place(self, run):
        closing = first(run, "stop", "close").time
        before, after = (run.velocity(closing, side) for side in ("left", "right"))
        assert before[2] < -1e-2
        assert_allclose(after[2], 0, atol=1e-13)
        assert_allclose(np.delete(after, 2), np.delete(before, 2), atol=1e-12)  # diagonal mass: only m2 is struck
        assert_allclose(run.displacement(closing, "left"), run.displacement(closing), atol=1e-12)
        assert_allclose(first(run, "stop", "close").energy_loss, before[2] ** 2 / 2, rtol=1e-9)
        assert_allclose(first(run, "stop", "close").impulse, -before[2], rtol=1e-9)
        assert run.contact_force("stop", closing, "left") == 0
        assert run.contact_force("stop", closing) > 0

    def test_a_rigid_contact_opens_at_zero_reaction(self, run):
        t = first(run, "stop", "open").time
        assert_allclose(run.contact_force("stop", t, "left"), 0, atol=1e-10)
        assert_allclose(run.velocity(t, "left"), run.velocity(t), atol=1e-11)
        assert run.contact_force("stop", t) == 0


class TestContacts:
    @pytest.mark.parametrize("contact", ["stop", "soft"])
    def test_force_is_zero_outside_the_intervals_and_never_pulls(self, run, contact):
        t = np.linspace(0, 20, 4001)
        force, closed = run.contact_force(contact, t), np.zeros(4001, bool)
        for start, end in run.contact_intervals(contact):
            assert end > start
            closed |= (t >= start) & ((t < end) | (end == run.t_end))
        assert np.all(force[~closed] == 0)
        assert np.min(force) >= -1e-11
        law = SOFT * np.maximum(0, -run.gap("soft", t))
        if contact == "soft":
            assert_allclose(force, law, atol=1e-10)
        else:
            assert_allclose(run.gap("stop", t)[closed], 0, atol=1e-12)

    @pytest.mark.parametrize("contact", ["stop", "soft"])
    def test_intervals_are_those_of_the_events(self, run, contact):
        starts, ends = zip(*run.contact_intervals(contact), strict=True)
        assert set(starts) <= {event.time for event in run.events if event.kind == "close"}
        assert set(ends) <= {event.time for event in run.events if event.kind == "open"} | {20.0}

    @pytest.mark.parametrize("contact", ["stop", "soft"])
    @pytest.mark.parametrize(("t0", "t1"), [(0.0, 20.0), (1.3, 4.4), (2.0, 2.0)])
    def test_impulse_equals_quadrature_plus_impacts(self, run, contact, t0, t1):
        knots = sorted({t0, t1} | {event.time for event in run.events if t0 < event.time < t1})
        pushed = sum(
            quad(lambda t: run.contact_force(contact, t), a + 1e-13, b - 1e-13, epsabs=1e-12)[0]
            for a, b in pairwise(knots)
        )
        struck = sum(e.impulse for e in run.events if e.contact == contact and t0 <= e.time <= t1)
        assert_allclose(run.contact_impulse(contact, t0, t1), pushed + struck, rtol=1e-9, atol=1e-10)

    def test_impulses_balance_the_momentum_of_a_free_chain(self):
        """d(sum m v) = contact impulses + weight t, whatever the impacts in between."""
        m = MultiPhiModel(chain(4, ends=0), [stop("m0", 0.5), stop("m3", 0.2, 30.0, "soft")], modes="all")
        weight = ConstantLoad(np.ones(4), -2.0)
        run = simulate(m, 6.0, velocity=[0.0, -1.0, 0.5, 0.0], loads=[weight])
        assert len(run.events) > 4
        impulses = run.contact_impulse("stop", 0.0, 6.0) + run.contact_impulse("soft", 0.0, 6.0)
        assert_allclose(run.velocity(6.0).sum() + 0.5, impulses - 8.0 * 6.0, rtol=1e-11)


@pytest.mark.parametrize(
    ("kind", "seed", "contact"), [("mixed", 169, "c1"), ("compliant", 0, "c1"), ("compliant", 18, "c0")]
)
def test_the_deepest_gap_is_that_of_a_dense_grid_though_the_contact_is_never_armed_again(kind, seed, contact):
    model, random = random_model(seed, kind=kind)
    run = simulate(model, 20.0, velocity=random.normal(size=model.structure.n) * 3)
    times = np.linspace(0, 20, 200_001)
    closed = np.any([(a <= times) & (times <= b) for a, b in run.contact_intervals(contact)], axis=0)
    deepest = np.min(run.gap(contact, times)[~closed])
    assert deepest < -0.1
    assert_allclose(run.deepest_gap(contact), deepest, rtol=1e-2)


class TestEnergy:
    def test_is_that_of_the_full_matrices(self, run):
        s, t = run.model.structure, np.linspace(0, 20, 301)
        x, v = run.displacement(t), run.velocity(t)
        strain = 0.5 * np.sum(x * (s.stiffness @ x), axis=0) + 0.5 * SOFT * np.minimum(0, x[4] + 0.4) ** 2
        assert_allclose(run.energy(t), 0.5 * np.sum(v * (s.mass @ v), axis=0) + strain, rtol=1e-11)

    def test_ledger_is_that_of_the_run(self, run):
        s = run.model.structure
        damping = 0.02 * np.array(s.mass) + 1e-3 * np.array(s.stiffness)
        ledger = run.ledger
        assert_allclose(ledger.initial, run.energy(0.0), rtol=1e-12)
        assert_allclose(ledger.final, run.energy(20.0), rtol=1e-12)
        assert_allclose(ledger.work_of_loads, LOAD * (run.at("m3", 20.0) - run.at("m3", 0.0)), rtol=1e-10)
        assert_allclose(ledger.impact, sum(event.loss.impact for event in run.events), rtol=1e-12)
        t = np.linspace(0, 20, 200_001)
        v = run.velocity(t)
        power = np.sum(v * (damping @ v), axis=0)
        assert_allclose(ledger.damping, np.trapezoid(power, t), rtol=1e-4)
        assert abs(ledger.residual) < 1e-12 * ledger.initial
