"""Held places of friction springs where a mode of zero frequency feels their force: it has no static response to them.

A block slides freely on a rough elastic floor, and a friction spring guides its height: the spring's force is part of
the pressure, and so of the friction. Or a force law's falling branch cancels a friction spring, so that its body floats
in the difference of two constant forces.
"""

import numpy as np
import pytest
from lawful import assert_lawful
from numpy.testing import assert_allclose

import multiphi_exudyn as mp

WEIGHT = 9.81
LAW = np.array([-0.5, -0.1, 0.0, 0.1, 0.5]), np.array([-4.0, 1.0, 0.0, -1.0, 4.0])  # -10 N/m in the middle


def sliding_block(damping=None, mu=0.3, guided="y", static=1.0, bodies=1, stiffness=1e3, damper=0.0, surface=0.0):
    """A free block, or two joined ones, on a rough floor, guided by a friction spring."""
    n = 2 * bodies
    springs = np.zeros((n, n))
    if bodies == 2:
        springs[::2, ::2] = springs[1::2, 1::2] = 50.0 * np.array([[1.0, -1.0], [-1.0, 1.0]])
    names = ["x", "y", "x2", "y2"][:n]
    structure = mp.LinearStructure(np.eye(n), springs, damping, {name: i for i, name in enumerate(names)})
    floor = mp.UnilateralContact(
        "floor", "y", 0.0, stiffness, damper, mu, "x", static_friction=static * mu, tangential_velocity=surface
    )
    return mp.MultiPhiModel(structure, [floor, mp.Friction("guide", guided, 20.0, stiffness=100.0)])


def slide(model, t_end=1.0, loads=(), **start):
    n = model.structure.n
    loads = [mp.ConstantLoad(at, -WEIGHT) for at in ["y", "y2"][: n // 2]] + list(loads)
    x, v = np.zeros(n), np.zeros(n)
    x[1::2], v[0::2] = 0.05, 2.0
    start = start or {"displacement": x, "velocity": v}
    return mp.simulate(model, t_end, loads=loads, **start), loads


def test_the_friction_of_a_guided_block_is_that_of_its_pressure():
    """From the first to the last contact m x'' = -mu N, N with the guide's force; x by the impulses of N."""
    run, loads = slide(sliding_block())
    first, last = run.contact_intervals("floor")[0]
    speed = run.velocity(np.array([first, last]))[0]
    assert speed[1] - speed[0] == pytest.approx(-0.3 * run.contact_impulse("floor", first, last), rel=1e-12)
    assert_lawful(run, loads, 1e-11)


@pytest.mark.parametrize(
    "model",
    [
        sliding_block(mu=0.1),
        sliding_block(static=1.5),
        sliding_block(guided={"y": 1.0, "x": 0.25}),
        sliding_block(np.diag([0.5, 0.0])),  # damped sliding
        sliding_block(np.diag([1e-3, 0.0])),  # so slowly that it is given by powers of time
        sliding_block(np.array([[0.3, 0.1], [0.1, 0.3]])),
        sliding_block(damper=5.0),
        sliding_block(surface=-1.0),
        sliding_block(bodies=2),
        sliding_block(0.1 * np.eye(4), bodies=2),
        sliding_block(stiffness=np.inf),
    ],
    ids=str,
)
@pytest.mark.parametrize(
    "loads", [(), (mp.ConstantLoad("x", 1.0), mp.SampledLoad("y", [0, 0.3, 0.6, 9], [0, 5, 0, 0]))]
)
def test_sliding_beside_a_friction_spring_keeps_the_equation_of_motion(model, loads):
    run, loads = slide(model, loads=loads)
    assert_lawful(run, loads, 1e-11)


def floating(spring=10.0, velocity=0.0, damping=None, base=0.0, bodies=1):
    """A mass in the middle of the law, with a friction spring whose stiffness cancels its slope."""
    springs = 50.0 * np.array([[1.0, -1.0], [-1.0, 1.0]])[:bodies, :bodies] * (bodies > 1)
    springs[0, 0] += base
    structure = mp.LinearStructure(np.eye(bodies), springs, damping, {"x": 0, "z": bodies - 1})
    belt = mp.Friction("belt", "x", 2.0, stiffness=spring, velocity=velocity)
    return mp.MultiPhiModel(structure, [mp.ForceLaw("x", LAW, name="law"), belt])


@pytest.mark.parametrize("velocity", [0.0, -1.0, 0.5])
@pytest.mark.parametrize(
    "given",
    [
        {},
        {"damping": np.array([[0.5]])},
        {"spring": 4.0, "base": 6.0},  # both together cancel the slope
        {"spring": 5.0, "base": 10.0},  # while it slips, the slope cancels the structure's own stiffness
        {"bodies": 2},
        {"bodies": 2, "damping": 0.2 * np.eye(2)},
    ],
    ids=str,
)
def test_a_slope_that_cancels_a_friction_spring(given, velocity):
    loads = [mp.SampledLoad("x", [0.0, 1.0, 2.0, 9.0], [0.0, -10.0, 0.0, 0.0]), mp.ConstantLoad("z", 0.2)]
    run = mp.simulate(floating(velocity=velocity, **given), 4.0, loads=loads)
    assert_lawful(run, loads, 1e-11)


@pytest.mark.parametrize(
    "rest", [1e-14, 1e-13, 1e-12, -1e-12, 1e-11, 1e-10, -1e-9, 1e-8, 9e-8, 2e-7, -2e-7, 1e-6, 1e-4]
)
@pytest.mark.parametrize("velocity", [0.0, -1.0, 0.5])
@pytest.mark.parametrize("bodies", [1, 2])
def test_a_slope_that_nearly_cancels_a_friction_spring(rest, velocity, bodies):
    """The motion depends on the rest of the stiffness as smoothly as the forces do."""
    loads = [mp.SampledLoad("x", [0.0, 1.0, 2.0, 9.0], [0.0, -10.0, 0.0, 0.0])]
    zero, run = (
        mp.simulate(floating(10.0 * (1 + part), velocity, bodies=bodies), 4.0, loads=loads) for part in (0.0, rest)
    )
    assert run.status == "ok", run.message
    times = np.linspace(0.0, 4.0, 41)
    expected = zero.at("x", times)
    assert_allclose(run.at("x", times), expected, rtol=0, atol=(4 * abs(rest) + 1e-7) * np.abs(expected).max())
    if abs(rest) < 1e-7:
        assert abs(run.ledger.residual) < 1e-9


@pytest.mark.parametrize("with_law", [False, True])
def test_constant_forces_beside_damped_free_motions_close_the_ledger(with_law):
    """Friction at its limit, and a force law, act on blocks that slide freely and are damped."""
    guided = {"y": 1.0, "x": 0.5} if with_law else "y"
    parts = [
        mp.UnilateralContact("floor", "y", 0.0, 1e4, friction=0.3, tangential="x"),
        mp.Friction("guide", guided, 2.0, stiffness=1e3, velocity=0.3 * with_law),
    ]
    parts += [mp.ForceLaw("y", LAW, name="law")] if with_law else []
    structure = mp.LinearStructure(np.eye(2), np.zeros((2, 2)), 0.3 * np.eye(2), {"x": 0, "y": 1})
    loads = [mp.ConstantLoad("y", -WEIGHT), mp.ConstantLoad("x", -3.0)]
    start = np.array([0.0, 0.05]), np.array([2.0, 0.0])
    run = mp.simulate(mp.MultiPhiModel(structure, parts), 1.0, *start, loads=loads)
    assert {event.contact for event in run.events} >= {"floor", "guide"}
    assert_lawful(run, loads)
