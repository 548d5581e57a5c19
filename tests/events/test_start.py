"""A run starts in all modes: what strikes there loses its whole share, what the level cannot hold is truncation."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from small_structures import chain, oscillator, random_model, stop

import multiphi_exudyn as mp


def started(model, velocity, displacement=None, loads=()):
    """A run so short that nothing happens in it but its start."""
    return mp.simulate(model, 1e-9, displacement, velocity, loads)


def test_a_velocity_into_a_stop_is_struck_before_any_mode_is_left_out():
    """One mode of a chain of five: the impact at its first mass is that of the whole chain, m v, and so is its loss."""
    model = mp.MultiPhiModel(chain(5), [stop("m0", 0.0)], modes=1)
    velocity = np.array([-2.0, 1.0, 0.5, -1.0, 0.3])
    run = started(model, velocity)
    first = run.events[0]
    assert (first.contact, first.kind, first.time) == ("stop", "close", 0.0)
    assert_allclose([first.impulse, first.loss.impact], [2.0, 2.0], rtol=1e-13)
    slowed = np.r_[0.0, velocity[1:]]
    kept = 0.5 * run.velocity(0.0) @ run.velocity(0.0)
    assert_allclose(run.ledger.truncation_kinetic, 0.5 * slowed @ slowed - kept, rtol=1e-12)
    assert_allclose(run.ledger.initial, 0.5 * velocity @ velocity, rtol=1e-14)


@pytest.mark.parametrize("pressed", [True, False])
def test_a_contact_that_touches_at_rest_is_closed_where_it_is_pressed(pressed):
    """x = -gap on a soft spring, with and without the force that is needed to stay there."""
    model = oscillator(gap=1.0)
    run = started(model, None, [-1.0], [mp.ConstantLoad("m0", -20.0)] if pressed else ())
    assert [event.kind for event in run.events] == (["close"] if pressed else [])
    assert_allclose(run.contact_force("stop", 0.0), 12.0 if pressed else 0.0, rtol=1e-13)


def test_a_spring_that_penetrates_begins_closed_without_an_event():
    model = oscillator(gap=1.0, contact=200.0)
    run = started(model, None, [-1.5])
    assert run.events == ()
    assert_allclose(run.contact_force("stop", 0.0), 100.0, rtol=1e-13)
    assert_allclose(run.ledger.initial, 0.5 * 8 * 1.5**2 + 0.5 * 200 * 0.5**2, rtol=1e-14)
    assert abs(run.start_loss.truncation_strain) < 1e-12


def test_a_level_at_its_own_rest_has_no_round_off_of_its_place():
    model = mp.MultiPhiModel(chain(6), [stop("m5", 0.1, 40.0), stop("m2", 0.5, name="far")], modes="all")
    rest = model.static_equilibrium({"m5": -3.0})
    run = started(model, None, rest, [mp.ConstantLoad("m5", -3.0)])
    assert not np.any(run.segments[0].rows)


def test_stops_that_move_strike_with_their_own_speed():
    """A stop that rises at 3 m/s under a mass at rest: an impulse 3 m; what it does is work, of which half is lost."""
    model = mp.MultiPhiModel(mp.LinearStructure([[2.0]], [[8.0]], points={"m0": 0}), [stop(gap=0.0)], modes="all")
    rising = mp.StopMotion("stop", mp.Harmonic(3.0 / (2 * math.pi), 1.0, -math.pi / 2))
    (event, *_) = started(model, [0.0], loads=[rising]).events
    assert_allclose([event.impulse, event.loss.impact, event.loss.stop_work], [6.0, 9.0, 18.0], rtol=1e-13)


@pytest.mark.parametrize("damping", ["none", "given"])
def test_whatever_the_start_its_losses_are_accounted_for(damping):
    """Given velocity, what is lost, what remains: the energies of random starts on contacts without clearance."""
    struck = 0
    for seed in range(40):
        model, random = random_model(seed, damping=damping, kind=("rigid", "mixed")[seed % 2])
        velocity = random.normal(size=model.structure.n)
        run = started(model, velocity)
        struck += any(event.impulse > 0 for event in run.events)
        size = 0.5 * velocity @ model.structure.mass @ velocity
        losses = sum((event.loss for event in run.events), run.start_loss)
        assert losses.impact >= 0
        assert losses.truncation_kinetic >= -1e-14 * size
        assert_allclose(losses.total + run.energy(0.0), size, rtol=1e-12)
    assert struck > 5


def test_a_start_without_a_way_out_is_a_failed_run_without_a_motion():
    """Two stops that close on a mass between them at the start."""
    contacts = [stop("m0", 0.0, name="floor"), stop({"m0": -1.0}, 0.0, name="ceiling")]
    model = mp.MultiPhiModel(chain(1), contacts, modes="all")
    rising = mp.Harmonic(0.1, 1.0, -math.pi / 2)
    closing = [mp.StopMotion(name, rising) for name in ("floor", "ceiling")]
    run = mp.simulate(model, 1.0, loads=closing)
    assert (run.status, run.t_end, run.final) == ("failed", 0.0, None)
    assert run.message == (
        "at t = 0 s: rigid contacts floor, ceiling: their stops move against each other and leave no way out"
    )
    assert math.isfinite(run.start_loss.total)


def test_a_stiff_mass_starts_where_it_is_put_however_far_from_its_rest_another_one_is():
    """x = f / k (1 - cos w t), f / k = 1e-12 m, beside one whose rest is 100 m away and that shares no mode with it."""
    stiffness, force = 1e14, 100.0
    structure = mp.LinearStructure(np.eye(2), np.diag([1.0, stiffness]), points={"soft": 0, "stiff": 1})
    model = mp.MultiPhiModel(structure, [stop("stiff", 1.0)], modes="all")
    t = np.linspace(0, 1e-6, 11)
    run = mp.simulate(model, 1e-6, loads=[mp.ConstantLoad(np.ones(2), force)])
    assert_allclose(run.at("stiff", t), force / stiffness * (1 - np.cos(1e7 * t)), rtol=1e-6, atol=1e-18)
