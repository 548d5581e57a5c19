"""Five rigid stops under a rigid bar of two degrees of freedom: many sets of forces hold it, its motion is one."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from lawful import complaints
from numpy.testing import assert_allclose

from multiphi_exudyn import ConstantLoad, LinearStructure, MultiPhiModel, UnilateralContact, simulate

MASS, GAP, LOAD = 3.0, 0.1, 10.0  # kg, m, N downwards
PLACES = np.linspace(0.0, 1.0, 5)  # of the stops along the bar
ROUND_OFF = 1e-13  # of lengths and speeds about 1
MOST_EVENTS = 30  # until it is at rest: each impact but the last leaves a part of the rotation
AMPLIFIED = 1e-9  # the same after some impacts, whose instants carry it on


def bar(gap=GAP, order=None, places=PLACES):
    """A free rigid bar, its degrees of freedom the displacements of its ends, over its stops."""
    mass = MASS * np.array([[1 / 3, 1 / 6], [1 / 6, 1 / 3]])
    points = {f"s{i}": [1 - s, s] for i, s in enumerate(places)}
    structure = LinearStructure(mass, np.zeros((2, 2)), points=points)
    contacts = [UnilateralContact(f"c{i}", f"s{i}", gap) for i in order or range(len(places))]
    return MultiPhiModel(structure, contacts, modes="all")


def loaded(at, model, velocity, t_end):
    """A run under the load at a place along the bar."""
    row = np.array([1 - at, at])
    return simulate(model, t_end, velocity=velocity, loads=[ConstantLoad(row, -LOAD)])


def forces(run, t):
    """Contact forces (c,) [N] by place."""
    return np.array([float(run.contact_force(f"c{i}", t)) for i in range(len(run.model.contacts))])


@pytest.mark.parametrize("at", [0.0, 0.1, 0.25, 0.4, 0.5, 0.77, 1.0])
def test_at_rest_the_forces_push_and_balance_the_load_and_its_moment(at):
    run = loaded(at, bar(gap=0.0), [0.0, 0.0], 1.0)
    assert run.status == "ok", run.message
    found = forces(run, 0.5)
    assert np.all(found >= 0)
    assert_allclose([found.sum(), found @ PLACES], [LOAD, LOAD * at], rtol=1e-13, atol=1e-13)
    assert np.abs(run.displacement(1.0)).max() < ROUND_OFF
    assert abs(run.ledger.residual) < ROUND_OFF


@pytest.mark.parametrize("count", [2, 3, 4, 5, 6])
def test_a_symmetric_fall_is_symmetric_though_one_set_of_forces_of_many_need_not_be(count):
    """Of more than two stops an independent set carries the bar: its forces have the sum and the moment of all."""
    places = np.linspace(0.0, 1.0, count)
    run = loaded(0.5, bar(places=places), [-1.0, -1.0], 1.0)
    t = np.linspace(0, 1, 101)
    assert_allclose(*run.displacement(t), rtol=0, atol=ROUND_OFF)
    found = forces(run, 1.0)
    assert np.all(found >= 0)
    assert_allclose([found.sum(), found @ places], [LOAD, LOAD / 2], rtol=1e-12)
    assert all(event.impulse >= 0 for event in run.events)


@pytest.mark.parametrize("order", [(0, 1, 2, 3, 4), (2, 4, 0, 3, 1)])
@pytest.mark.parametrize("at", [0.3, 0.5])
def test_struck_flat_it_stops_with_all_its_energy_lost_whatever_the_order_of_the_stops(at, order):
    """It falls without rotation under a load in the middle only; elsewhere it arrives tilted, and comes to rest too."""
    run = loaded(at, bar(order=order), [-1.0, -1.0], 3.0)
    assert run.status == "ok", run.message
    assert not complaints(run, [ConstantLoad(np.array([1 - at, at]), -LOAD)], (np.zeros(2), np.array([-1.0, -1.0])))
    assert_allclose(run.displacement(3.0), -GAP, atol=ROUND_OFF)
    assert np.abs(run.velocity(3.0)).max() < ROUND_OFF
    assert_allclose(run.ledger.impact, 0.5 * MASS + LOAD * GAP, rtol=1e-12)
    assert_allclose([forces(run, 3.0).sum(), forces(run, 3.0) @ PLACES], [LOAD, LOAD * at], rtol=1e-12)
    if at == 0.5:
        impulses = sum(event.impulse for event in run.events)
        assert_allclose(impulses, MASS * np.sqrt(1 + 2 * LOAD / MASS * GAP), rtol=1e-12)


@example(1.0, 1.3, 0.5)
@settings(derandomize=True, max_examples=25, deadline=None)
@given(st.floats(0.05, 2.0), st.floats(0.05, 2.0), st.floats(0.0, 1.0))
def test_the_stops_between_the_ends_change_no_motion(left, right, at):
    """A rigid bar above five stops in a line is above the outer two."""
    five, two = (loaded(at, bar(places=places), [-left, -right], 3.0) for places in (PLACES, PLACES[[0, -1]]))
    assert five.status == two.status == "ok"
    assert len(five.events) <= MOST_EVENTS
    t = np.linspace(0, 3, 301)
    assert_allclose(five.displacement(t), two.displacement(t), rtol=0, atol=AMPLIFIED)
    assert_allclose(five.ledger.impact, two.ledger.impact, rtol=1e-9)
    assert np.min([five.gap(f"c{i}", t) for i in range(5)]) > -ROUND_OFF
    assert_allclose([forces(five, 3.0).sum(), forces(five, 3.0) @ PLACES], [LOAD, LOAD * at], rtol=1e-9, atol=1e-9)
    assert np.all(forces(five, 3.0) >= 0)


@pytest.mark.parametrize("speed", [2.0, -2.0])
def test_stops_at_one_place_pull_no_more_than_one_does_where_truncation_brings_them_back_at_once(speed):
    """A damper to a fast mass takes the pressure off the stop; open, one mode does not hold the fast mass any more.

    It presses again at once, so an instant after which the same stop is closed has happened nevertheless.
    """
    structure = LinearStructure(np.eye(2), np.diag([1.0, 1e4]), 3.0 * np.ones((2, 2)), {"slow": 0, "fast": 1})
    load, t = ConstantLoad("slow", 3.0), np.linspace(0, 0.2, 401)
    runs = []
    for count in (1, 2, 3):
        stops = [UnilateralContact(f"c{i}", {"slow": -1.0}, 0.0) for i in range(count)]
        runs.append(simulate(MultiPhiModel(structure, stops, modes=1), 0.2, velocity=[0.0, speed], loads=[load]))
    for run in runs:
        assert run.status == "ok"
        assert np.min(run.contact_force("c0", t)) > -ROUND_OFF
        assert not complaints(run, [load])
        assert [event.kind for event in run.events] == ["close", "open", "close"]
        assert_allclose(run.displacement(t), runs[0].displacement(t), rtol=0, atol=ROUND_OFF)
