"""A friction spring beside a rigid stop with restitution: from the second bounce on it is at its limit at every impact.

The spring has slipped on the way to the first bounce, and sticks after it with the force F: its body comes back to the
stop with the same force. Whether it slips then is decided with the velocity after the impact, which unloads it.
"""

import numpy as np
import pytest
from lawful import EXACT, assert_lawful
from numpy.testing import assert_allclose

import multiphi_exudyn as mp


def springs(*limits, stiffness=10.0, at="y"):
    return [mp.Friction(f"spring{i}", at, limit, stiffness=stiffness) for i, limit in enumerate(limits)]


def falling(restitution=0.5, friction=None, mass=1.0, up=1.0, gap=0.0, kind=np.inf, more=()):
    """A mass above (up = 1) or below (-1) a stop, with friction springs in its way."""
    structure = mp.LinearStructure(np.eye(1) * mass, np.zeros((1, 1)), points={"y": 0})
    stop = mp.UnilateralContact("stop", {"y": up}, gap, kind, restitution=restitution if np.isinf(kind) else 0.0)
    return mp.MultiPhiModel(structure, [stop, *(friction or springs(1.0)), *more])


def bounces(run, contact="stop"):
    """Instants of the impacts on a contact."""
    return [event.time for event in run.events if event.contact == contact and event.kind == "close"]


@pytest.mark.parametrize("up", [1.0, -1.0])
@pytest.mark.parametrize(
    ("m", "k", "limit", "e", "g"), [(1, 10, 1, 0.5, 3), (0.5, 200, 2, 0.9, 10), (4, 3, 0.25, 1, 1)]
)
def test_after_its_second_bounce_the_spring_unloads(m, k, limit, e, g, up):
    load = mp.ConstantLoad("y", -m * g * up)
    run = mp.simulate(falling(e, springs(limit, stiffness=k), m, up), 8.0, displacement=np.array([up]), loads=[load])
    _, second, *rest = bounces(run)
    after = np.linspace(0.0, 0.9 * min([1.0, *(third - second for third in rest[:1])]), 12)
    omega, centre = np.sqrt(k / m), (limit - m * g) / k  # m x'' = -m g - (k x - F) from the stop
    speed = up * run.velocity(second, "right")[0]
    assert speed > 0
    x = centre * (1 - np.cos(omega * after)) + speed / omega * np.sin(omega * after)
    sticks = np.cumprod(k * x - limit < limit).astype(bool)
    found = up * run.at("y", second + after), up * run.friction_force("spring0", second + after)
    assert_allclose(found[0][sticks], x[sticks], rtol=0, atol=EXACT)
    assert_allclose(found[1][sticks], (k * x - limit)[sticks], rtol=0, atol=EXACT * max(1, limit))
    assert_lawful(run, [load])


@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("limits", [(1.0, 1.0), (0.5, 2.0, 1.0)])
@pytest.mark.parametrize("gravity", [0.0, 3.0])
def test_several_springs_at_one_stop(limits, restitution, gravity):
    """Each of them is at its own limit where the stop is."""
    loads = [mp.ConstantLoad("y", -gravity)]
    model = falling(restitution, springs(*limits), gap=0.2, more=[mp.UnilateralContact("above", {"y": -1.0}, 0.7)])
    assert_lawful(mp.simulate(model, 3.0, displacement=[0.5], velocity=[-4.0], loads=loads), loads)


def test_a_spring_that_the_impact_does_not_unload_slips():
    """The impact is on another body: the spring reaches its limit at that instant and slips on."""
    structure = mp.LinearStructure(np.eye(2), np.zeros((2, 2)), points={"y": 0, "z": 1})
    stop, spring = (
        mp.UnilateralContact("stop", "y", 0.0, restitution=0.5),
        mp.Friction("spring", "z", 1.0, stiffness=2.0),
    )
    quarter = np.pi / 2 / np.sqrt(2.0)  # z = a sin(omega t), at its limit k z = -F at an eighth of its period
    start, velocity = [0.5 * quarter, 0.0], [-1.0, -1.0]
    run = mp.simulate(mp.MultiPhiModel(structure, [stop, spring]), 1.0, displacement=start, velocity=velocity)
    assert run.status == "ok", run.message
    (impact,) = bounces(run)
    slips = next(event.time for event in run.events if event.contact == "spring")
    assert slips == pytest.approx(impact, rel=1e-12)
    assert run.friction_force("spring", impact + 0.1) == pytest.approx(-1.0, rel=1e-13)
    assert_lawful(run)


def test_a_slip_that_comes_first_at_the_instant_of_the_impact_ends_with_it():
    """Three springs reach their limits at the stop, in whatever order round-off gives their instants."""
    structure = mp.LinearStructure([[1.0]], [[10.0]], points={"y": 0})
    stops = [mp.UnilateralContact("stop", "y", 0.2, restitution=0.3)]
    friction = [
        mp.Friction(f"spring{i}", "y", 1.0, stiffness=k, velocity=v)
        for i, (k, v) in enumerate([(200.0, -1.0), (200.0, 0.0), (10.0, 0.0)])
    ]
    loads = [mp.ConstantLoad("y", -3.0)]
    assert_lawful(
        mp.simulate(mp.MultiPhiModel(structure, [*stops, *friction]), 3.0, displacement=[2.0], loads=loads), loads
    )


def chain_at_two_stops():
    joints = 100.0 * np.array([[1.01, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
    structure = mp.LinearStructure(np.diag([1.0, 1.0, 2.0]), joints, points={"y0": 0, "y1": 1, "y2": 2})
    stops = [mp.UnilateralContact(f"stop {at}", at, 0.5, restitution=0.5) for at in ("y0", "y1")]
    loads = [mp.ConstantLoad(f"y{i}", -10.0 * mass) for i, mass in enumerate((1, 1, 2))]
    start = {"displacement": -0.5 * np.ones(3), "velocity": np.array([0.5, 0.5, -1.0])}  # right after an impact
    return mp.MultiPhiModel(structure, [*stops, *springs(1.0, stiffness=200.0, at="y0")]), loads, start


def damped_chain_between_stops():
    joints = np.array([[10.0, -10.0, 0.0], [-10.0, 60.0, -50.0], [0.0, -50.0, 50.0]])
    masses = np.diag([2.0, 2.0, 1.0])
    structure = mp.LinearStructure(masses, joints, 0.02 * joints + 0.1 * masses, {"y0": 0, "y1": 1, "y2": 2})
    stops = [mp.UnilateralContact(f"stop {at}", at, 0.2, restitution=0.5) for at in ("y2", "y0")]
    friction = [
        mp.Friction(f"spring{i}", "y2", limit, static_limit=static, stiffness=k)
        for i, (limit, static, k) in enumerate([(5.0, 5.0, 20.0), (2.0, 3.0, 200.0), (1.0, 1.5, 20.0)])
    ]
    loads = [mp.ConstantLoad(f"y{i}", -3.0 * mass) for i, mass in enumerate((2, 2, 1))]
    return mp.MultiPhiModel(structure, [*stops, *friction]), loads, {"displacement": 2.0 * np.ones(3)}


@pytest.mark.parametrize("scene", [chain_at_two_stops, damped_chain_between_stops])
def test_the_last_bounce_ends_though_a_spring_slips_first_at_its_instant(scene):
    """A contact that comes back from its last bounce closes, whatever else changes at that instant."""
    model, loads, start = scene()
    run = mp.simulate(model, 3.0, loads=loads, **start)
    assert_lawful(run, loads)
    assert len(run.events) < 200
