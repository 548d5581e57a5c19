"""Contacts that rub: with friction that tends to none they move as contacts without."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import multiphi_exudyn as mp
from multiphi_exudyn.study.law_check import broken_laws


@pytest.mark.parametrize("speed", [2.0, -2.0, 0.3])
def test_a_viscous_contact_that_slides_opens_as_one_without_friction(speed):
    """Its damper leaves it inside its stop, however fast it slides: to stick first would take that speed away."""
    structure = mp.LinearStructure([[1.0, 0.4], [0.4, 1.0]], np.diag([4.0, 1.0]), points={"z": 0, "x": 1})
    runs = []
    for rubs in ({}, {"tangential": "x", "friction": 1e-10}):
        contact = mp.UnilateralContact("floor", "z", 0.05, 200.0, damping=8.0, **rubs)
        runs.append(mp.simulate(mp.MultiPhiModel(structure, [contact], modes="all"), 12.0, velocity=[-1.0, speed]))
    smooth, rubbing = runs
    assert len(smooth.contact_intervals("floor")) > 3
    assert_allclose(rubbing.contact_intervals("floor"), smooth.contact_intervals("floor"), rtol=0, atol=1e-7)
    assert_allclose(rubbing.at("z", 12.0), smooth.at("z", 12.0), rtol=0, atol=1e-7)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_spring_sticks_at_once_where_an_impact_has_turned_its_slip(side):
    """A mass that drags a ring is struck by a heavier one and thrown back, while a force turns it round again."""
    structure = mp.LinearStructure(np.diag([1.0, 3.0]), np.zeros((2, 2)), points={"a": 0, "b": 1})
    stop = mp.UnilateralContact("stop", {"a": -side, "b": side}, 0.6)
    ring = mp.Friction("ring", "a", 0.1, stiffness=10.0)
    model = mp.MultiPhiModel(structure, [stop, ring], modes="all")
    run = mp.simulate(
        model, 0.3, velocity=[side, -2.0 * side], loads=[mp.ConstantLoad("a", 2 * side), mp.ConstantLoad("b", 9 * side)]
    )
    struck = next(event.time for event in run.events if event.contact == "stop")
    sticks = run.stick_intervals("ring")
    assert sticks[0][1] < struck == sticks[1][0]
    assert run.friction_force("ring", struck + 1e-9) == pytest.approx(side * 0.1, abs=1e-6)
    assert side * run.friction_force("ring", 0.3) < 0.1
    assert abs(run.ledger.residual) < 1e-12


@pytest.mark.parametrize("gap", [0.07, 0.1])
@pytest.mark.parametrize("stiffness", [0.0, 1.0, 3.7])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_block_that_rests_at_a_stop_slips_into_it_and_away_from_it(side, stiffness, gap):
    """Beside the closed stop the block cannot move, and what its friction bears is its limit; then it sticks again."""
    structure = mp.LinearStructure([[1.0]], [[stiffness]], points={"m": 0})
    elements = [mp.UnilateralContact("stop", "m", gap), mp.Friction("block", "m", 1.0, 1.3)]
    load = mp.HarmonicLoad("m", side * 2.0, 1 / (2 * np.pi), -np.pi / 2)  # 2 sin t
    run = mp.simulate(mp.MultiPhiModel(structure, elements, modes="all"), 4.5, velocity=[-1.0], loads=[load])
    assert run.status == "ok"
    first, last = run.stick_intervals("block")[0]
    assert first < 0.2
    assert 2 * np.sin(last) == pytest.approx(1.3 + side * -stiffness * gap, abs=1e-9)
    if side < 0:
        closed = run.contact_intervals("stop")[-1]
        assert closed == pytest.approx((last, np.pi - np.arcsin((1.0 + stiffness * gap) / 2)), abs=1e-8)
        t = np.linspace(*closed, 7)[1:-1]
        assert_allclose(run.contact_force("stop", t), 2 * np.sin(t) - 1.0 - stiffness * gap, rtol=0, atol=1e-9)
        again = run.stick_intervals("block")[1]
        assert again == pytest.approx((closed[1], np.pi + np.arcsin((1.3 - stiffness * gap) / 2)), abs=1e-7)


@pytest.mark.parametrize("stiffness", [1.0, 3.0])
def test_a_force_law_that_cancels_its_stiffness_is_refused_while_it_slides(stiffness):
    """Its force then drives the slip of a mass that nothing else holds, with the fourth power of time."""
    structure = mp.LinearStructure(np.eye(2), np.zeros((2, 2)), points={"z": 0, "x": 1})
    law = mp.ForceLaw("z", ([-2, -1, 0, 1, 2], [-stiffness, stiffness, 0, -stiffness, stiffness]), name="law")
    messages = []
    for rubs in ({}, {"tangential": "x", "friction": 0.5}):
        floor = mp.UnilateralContact("floor", {"z": -1.0}, 0.5, stiffness, **rubs)
        model = mp.MultiPhiModel(structure, [floor, law], modes="all")
        run = mp.simulate(model, 2.0, velocity=[1.0, -1.0])
        messages.append(run.message)
        if not rubs:
            assert not broken_laws(run, [], (np.zeros(2), np.array([1.0, -1.0])))
    assert not messages[0]
    assert "negative stiffness cancels that of a mode beside contacts that slide" in messages[1]


@pytest.mark.parametrize("start", [(0.0, 0.0, 1.0), (0.2, 0.1, 1.0), (-0.3, 0.0, 2.0)])
def test_forces_that_cancel_elsewhere_are_right_while_it_slides(start):
    """A falling law and the spring of a friction element cancel on a mass that the contact drags along."""
    structure = mp.LinearStructure(np.eye(3), np.zeros((3, 3)), points={"x": 0, "y": 1, "z": 2})
    both = {"x": 1.0, "y": 1.0}
    law = mp.ForceLaw(both, ([-2, -1, 0, 1, 2], [-4, 1, 0, -1, 4]), name="law")
    spring = mp.Friction("spring", both, 2.0, stiffness=1.0)
    floor = mp.UnilateralContact("floor", {"z": -1.0}, 0.0, 10.0, friction=0.25, tangential={"y": 1.0, "z": 1.0})
    velocity = np.array(start)
    run = mp.simulate(mp.MultiPhiModel(structure, [floor, law, spring], modes="all"), 2.0, velocity=velocity)
    assert run.status == "ok"
    assert not broken_laws(run, [], (np.zeros(3), velocity))


def belts(factor):
    """Dry friction holds x and, on a belt, x + y; a damped stop rubs on z."""
    stop = mp.UnilateralContact(
        "c", {"x": 1.0, "y": 1.0}, 0.5, 1.0, 100.0, 0.25, {"z": -1.0}, 0.5, tangential_velocity=1.0
    )
    belt = mp.Friction("belt", {"x": 1.0, "y": 1.0}, 10.0, velocity=-factor)
    return 2.5, [stop, mp.Friction("block", {"x": 2.0}, 10.0), belt], [], ([0.0, 0.5, -1.0], [1.0, 1.0, 2.0])


def facing(factor):
    """A rigid stop of z and a soft one that faces it and moves, whose friction holds y - z."""
    soft = mp.UnilateralContact("soft", {"z": -1.0}, 0.0, 10.0, 0.0, 0.25, {"y": 1.0, "z": -1.0}, 0.5)
    moving = mp.StopMotion("soft", mp.Harmonic(factor, 0.5 / np.pi, -np.pi / 2))
    return 2.0, [mp.UnilateralContact("rigid", "z", 0.5), soft], [moving], (np.zeros(3), [-2.0, 0.0, 0.0])


def rough_floor(factor):
    """A rough rigid stop of z holds y + z, beside a force law of y and a soft stop of x on a belt along y."""
    rigid = mp.UnilateralContact("rigid", {"z": 2.0}, 1.0, friction=1.0, tangential={"y": -1.0, "z": -1.0})
    soft = mp.UnilateralContact("soft", "x", 1.0, 1.0, 0.0, 0.5, {"y": 2.0}, tangential_velocity=1.0)
    law = mp.ForceLaw({"y": -1.0}, (np.array([-2.0, -1.0, 0.0, 1.0, 2.0]), np.array([-40.0, 10.0, 0.0, -10.0, 40.0])))
    return 2.0, [rigid, soft, law], [mp.ConstantLoad("z", -24.0 * factor)], ([-1.0, 0.0, 0.0], [-2.0, 1.0, 0.0])


def between_walls(factor):
    """Two rigid walls of x, one of them rough along x + y, and a damped floor of y."""
    rough = mp.UnilateralContact("rough", {"x": -2.0}, 1.0, friction=0.5, tangential={"x": 1.0, "y": 1.0})
    floor = mp.UnilateralContact("floor", "y", 0.0, 10.0, 10.0)
    load = mp.ConstantLoad("y", -factor)
    walls = [rough, mp.UnilateralContact("other", {"x": 2.0}, 0.0)]
    return 1.0, [*walls, floor], [load], ([0.5, 1.0, 1.0], [-2.0, 1.0, -1.0])


@pytest.mark.parametrize("factor", [1.0, 0.93, 1.12])
@pytest.mark.parametrize("scene", [belts, facing, rough_floor, between_walls])
def test_where_nothing_else_holds_a_coordinate_friction_bears_what_equilibrium_asks(scene, factor):
    """x + z = 0 holds two masses together, and y none: to hold y does not bend the structure."""
    k, elements, loads, start = scene(factor)
    stiffness = k * factor * np.array([[1.0, 0.0, 1.0], [0.0, 0.0, 0.0], [1.0, 0.0, 1.0]])
    structure = mp.LinearStructure(np.eye(3), stiffness, points={"x": 0, "y": 1, "z": 2})
    start = tuple(np.array(part) for part in start)
    run = mp.simulate(mp.MultiPhiModel(structure, elements, modes="all"), 5.0, *start, loads)
    assert run.status == "ok"
    assert not broken_laws(run, loads, start)
    assert any(event.kind in ("stick", "slip") for event in run.events)
