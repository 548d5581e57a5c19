"""Rigid stops of nearly one direction: down to an angle of 1e-10 two constraints, below it one, and never an error."""

import dataclasses

import numpy as np
import pytest
from lawful import complaints
from numpy.testing import assert_allclose

from multiphi_exudyn import ConstantLoad, LinearStructure, MultiPhiModel, UnilateralContact, simulate

PASSED = 1e-9  # of the largest displacement
ANGLES = [10.0**-k for k in (3, 5, 7, 8, 9, 10, 11, 12, 14)]


def scene(seed, angle):
    """(model, loads, velocity): a random structure whose two or three rigid stops differ by an angle."""
    random = np.random.default_rng(seed)
    n = int(random.integers(2, 5))
    root = random.normal(size=(n, n))
    mass, stiffness = np.diag(10 ** random.uniform(-0.5, 0.5, n)), 10 * root @ root.T
    structure = LinearStructure(mass, stiffness, 0.2 * np.eye(n))
    row, sides = random.normal(size=n), [1.0, *random.choice([1.0, 1.0, 1.0, -1.0], int(random.integers(1, 3)))]
    gap = float(random.choice([0.0, 0.1]))
    rows = [side * (row + (k > 0) * angle * random.normal(size=n)) for k, side in enumerate(sides)]
    contacts = [UnilateralContact(f"c{k}", given, gap) for k, given in enumerate(rows)]
    loads = [ConstantLoad(random.normal(size=n), float(5 * random.normal()))]
    return MultiPhiModel(structure, contacts, modes="all"), loads, random.normal(size=n)


@pytest.mark.parametrize("angle", ANGLES)
def test_none_is_passed_and_none_fails(angle):
    for seed in range(5):
        model, loads, velocity = scene(seed, angle)
        run = simulate(model, 3.0, velocity=velocity, loads=loads)
        assert run.status == "ok", run.message
        t = np.linspace(0, 3, 501)
        largest = np.max(np.abs(run.displacement(t)))
        assert min(np.min(run.gap(contact.name, t)) for contact in model.contacts) >= -PASSED * largest
        assert abs(run.ledger.residual) <= 1e-9 * max(run.ledger.initial, abs(run.ledger.work_of_loads))
        assert run.ledger.impact >= -1e-12 * run.ledger.initial


@pytest.mark.parametrize("angle", [1e-3, 1e-5, 1e-7, 1e-9])
def test_two_stops_of_nearly_one_direction_hold_both_directions_and_their_reactions_balance_the_load(angle):
    """x + gap = 0 and x + angle y = 0 hold x and y: the forces are those of the load along x and y / angle."""
    structure = LinearStructure(np.diag([1.0, 2.0, 1.0]), np.diag([3.0, 5.0, 7.0]))
    contacts = [UnilateralContact("one", [1.0, 0.0, 0.0], 0.0), UnilateralContact("two", [1.0, angle, 0.0], 0.0)]
    model = MultiPhiModel(structure, contacts, modes="all")
    level = model.level(("one", "two"))
    assert_allclose(level.shapes[:2], 0, atol=1e-15)
    load = model.base.modes.shapes.T @ np.array([-2.0, -0.5 * angle, 4.0])
    found = level.asymptotic(load)
    assert_allclose(found.forces, [1.5, 0.5], rtol=1e-15 / angle + 1e-14)
    assert_allclose(model.base.modes.shapes @ found.configuration, [0.0, 0.0, 4 / 7], atol=1e-15)


@pytest.mark.parametrize("angle", [1e-3, 1e-6, 1e-9])
def test_the_flexibility_that_two_stops_leave_a_third_is_known(angle):
    """They hold the first two of four masses; a spring of 2 N/m at the third is left with the third and fourth."""
    pair = np.array([[4.0, -1.0], [-1.0, 4.0]])
    stiffness = np.block([[np.diag([3.0, 5.0]), np.zeros((2, 2))], [np.zeros((2, 2)), pair]])
    contacts = [UnilateralContact("one", np.eye(4)[0], 0.0), UnilateralContact("two", [1.0, angle, 0.0, 0.0], 0.0)]
    soft = UnilateralContact("soft", [1.0, 0.0, 1.0, 0.0], 0.0, 2.0)
    model = MultiPhiModel(LinearStructure(np.eye(4), stiffness), [*contacts, soft], modes="all")
    level = model.level(("one", "two", "soft"))
    squares, shapes = np.linalg.eigh(pair + np.diag([2.0, 0.0]))
    left = shapes[0, 1] ** 2 / squares[1] / np.sum(shapes[0] ** 2 / squares)
    assert level.static_shares["soft"] == pytest.approx(0.0, abs=1e-12)
    first = dataclasses.replace(model, modes=1).level(("one", "two", "soft"))
    assert first.static_shares["soft"] == pytest.approx(left, rel=1e-9)


@pytest.mark.parametrize("angle", [1e-11, 1e-13])
def test_below_the_threshold_the_second_follows_from_the_first(angle):
    contacts = [UnilateralContact("one", [1.0, 0.0], 0.0), UnilateralContact("two", [1.0, angle], 0.0)]
    structure = LinearStructure(np.eye(2), np.diag([3.0, 5.0]))
    model = MultiPhiModel(structure, contacts, modes="all")
    assert np.all(model.level(("one",)).gap_rows == 0)
    loads = [ConstantLoad([1.0, 0.0], -1.0)]
    run = simulate(model, 5.0, velocity=[-1.0, 1.0], loads=loads)
    assert run.status == "ok"
    assert not complaints(run, loads, (np.zeros(2), np.array([-1.0, 1.0])))
    assert_allclose(run.displacement(5.0), [0.0, np.sin(5**1.5) / 5**0.5], atol=1e-14)
