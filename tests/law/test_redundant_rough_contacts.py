"""Redundant rigid contacts that rub differently: how they share the load is not unique, and the run says so.

Of those that close together the roughest carry the load, in whatever order they are listed.
"""

import itertools

import numpy as np
import pytest
from numpy.testing import assert_allclose

import multiphi_exudyn as mp

EXACT = 1e-12  # m
WEIGHT = 9.81


def contact(name, row, friction, **further):
    return mp.UnilateralContact(name, row, 0.0, friction=friction, tangential="x" if friction else None, **further)


def slide(contacts, structure=None, pull=8.0, **start):
    """A block of 1 kg, or a structure, pulled along x on contacts."""
    structure = structure or mp.LinearStructure(np.eye(2), np.zeros((2, 2)), points={"x": 0, "y": 1})
    down = np.zeros(structure.n)
    down[1:] = -WEIGHT / (structure.n - 1)
    loads = [mp.ConstantLoad("x", pull), mp.ConstantLoad(down, 1.0)]
    start = start or {"velocity": np.zeros(structure.n)}
    return mp.simulate(mp.MultiPhiModel(structure, contacts), 1.0, loads=loads, **start)


@pytest.mark.parametrize("names", list(itertools.permutations(["smooth", "rough", "rougher"])))
@pytest.mark.parametrize("start", [{}, {"displacement": [0.0, 0.1], "velocity": [1.0, 0.0]}])
def test_the_roughest_of_parallel_contacts_carries_the_load_in_every_order(names, start):
    mu = {"smooth": 0.0, "rough": 0.3, "rougher": 0.5}
    with pytest.warns(mp.MultiPhiWarning, match="redundant contacts: .* touches, but 'rougher' carries"):
        run = slide([contact(name, "y", mu[name]) for name in names], **start)
    alone = slide([contact("rougher", "y", 0.5)], **start)
    times = np.linspace(0.0, 1.0, 11)
    assert_allclose(run.at("x", times), alone.at("x", times), rtol=0, atol=EXACT)


@pytest.mark.parametrize("names", [["one", "other"], ["other", "one"]])
def test_the_larger_static_limit_counts_before_the_coefficient_of_slip(names):
    parts = {"one": contact("one", "y", 0.5), "other": contact("other", "y", 0.3, static_friction=0.9)}
    with pytest.warns(mp.MultiPhiWarning, match="redundant contacts: 'one' touches, but 'other' carries the load"):
        run = slide([parts[name] for name in names])
    assert run.at("x", 1.0) == 0.0


def bar():
    """A rigid bar that slides along x, its other degrees of freedom the heights of its ends."""
    mass = np.array([[3.0, 0.0, 0.0], [0.0, 1.0, 0.5], [0.0, 0.5, 1.0]])
    return mp.LinearStructure(mass, np.zeros((3, 3)), points={"x": 0, "a": 1, "b": 2})


def feet(coefficients, static=1.0):
    rows = ["a", {"a": 0.5, "b": 0.5}, "b"]
    return [contact(f"c{i}", row, mu, **({"static_friction": static * mu} if mu else {}))
            for i, (row, mu) in enumerate(zip(rows, coefficients, strict=True))]  # fmt: skip


def test_feet_that_are_redundant_only_together_are_told():
    """Two of three feet carry a bar, and the third one depends on both."""
    with pytest.warns(mp.MultiPhiWarning, match="redundant contacts"):
        slide(feet([0.1, 0.3, 0.1]), bar(), pull=20.0)


@pytest.mark.parametrize("coefficients", [[0.0, 0.0, 0.0], [0.3, 0.3, 0.3]])
def test_feet_that_rub_alike_move_in_one_way_and_nothing_is_told(coefficients):
    run = slide(feet(coefficients), bar(), pull=20.0)
    acceleration = (20.0 - coefficients[0] * WEIGHT) / 3.0
    assert_allclose(run.at("x", 1.0), 0.5 * acceleration, rtol=1e-12)
    assert run.warnings == ()


@pytest.mark.parametrize("tangential", [{"z": 1.0}, {"x": 1.0}, {"x": -1.0}])
def test_two_contacts_that_rub_in_different_directions_are_told(tangential):
    """They are not one contact with two tangential directions."""
    structure = mp.LinearStructure(np.eye(3), np.zeros((3, 3)), points={"x": 0, "y": 1, "z": 2})
    one = mp.UnilateralContact("one", "y", 0.0, friction=0.3, tangential="x")
    other = mp.UnilateralContact("other", "y", 0.0, friction=0.3, tangential=tangential)
    model = mp.MultiPhiModel(structure, [one, other])
    loads = [mp.ConstantLoad("y", -WEIGHT), mp.ConstantLoad("x", 8.0), mp.ConstantLoad("z", 8.0)]
    if "x" in tangential:
        assert mp.simulate(model, 1.0, velocity=np.zeros(3), loads=loads).warnings == ()
        return
    with pytest.warns(mp.MultiPhiWarning, match="redundant contacts: 'other' touches, but 'one' carries"):
        mp.simulate(model, 1.0, velocity=np.zeros(3), loads=loads)
