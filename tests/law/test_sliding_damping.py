"""A body slides on a rough rigid floor, and a dashpot couples its motion along the floor with the force across it.

Where one mode is left it has no coupling with another, but its damping is not that of the dashpot alone: friction
mu c x' adds to it.
"""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from rough_floor import RoughFloor
from scipy.linalg import expm

import multiphi_exudyn as mp

STEPS = 100


def block(coupling=0.5, spring=0.0, turn=0.0, mass=1.0, mu=0.3):
    """A block with C = [[1, c], [c, 1]] in directions along and across a floor that is turned by an angle."""
    along, across = np.array([math.cos(turn), math.sin(turn)]), np.array([-math.sin(turn), math.cos(turn)])
    turned = np.column_stack([along, across])
    damping = turned @ np.array([[1.0, coupling], [coupling, 1.0]]) @ turned.T
    structure = mp.LinearStructure(
        mass * np.eye(2), spring * np.outer(along, along), (damping + damping.T) / 2, {"x": along, "y": across}
    )
    floor = mp.UnilateralContact("floor", "y", 0.0, friction=mu, tangential="x")
    return mp.MultiPhiModel(structure, [floor]), along


@pytest.mark.parametrize("turn", [0.0, math.atan2(3, 4), 2.0])
@pytest.mark.parametrize("coupling", [0.5, -0.5, 0.99, 0.0])
def test_pushed_along_it_nears_its_closed_form_speed(coupling, turn):
    model, along = block(coupling, turn=turn)
    mu, weight, push = 0.3, 9.81, 10.0
    loads = [mp.ConstantLoad("x", push), mp.ConstantLoad("y", -weight)]
    decay, begin = 1.0 + mu * coupling, push - mu * weight
    t = np.linspace(0, 2, 21)
    exact = begin / decay * (t - (1 - np.exp(-decay * t)) / decay)
    run = mp.simulate(model, 2.0, loads=loads)
    assert_allclose(run.at("x", t), exact, rtol=0, atol=1e-12)
    assert_allclose(run.contact_force("floor", t), weight + coupling * along @ run.velocity(t), rtol=1e-12)
    assert abs(run.ledger.residual) < 1e-12 * run.ledger.work_of_loads
    first = mp.simulate(model, 0.7, loads=loads)
    assert_allclose(mp.simulate(model, 2.0, start=first, loads=loads).at("x", 2.0), exact[-1], rtol=1e-12)
    many = mp.simulate_many(model, 2.0, velocities=np.array([0 * along, along, -along]), loads=loads, points=["x"])
    alone = [mp.simulate(model, 2.0, velocity=v * along, loads=loads).at("x", 2.0) for v in (0, 1, -1)]
    assert_allclose(many.samples[:, 0, 0], alone, rtol=0, atol=0)
    assert alone[0] == pytest.approx(exact[-1], rel=1e-12)


def drawn(seed):
    """Two or three coordinates, whole numbers among their masses, springs and dashpots; loads and units."""
    random = np.random.default_rng([seed, 6])
    n = int(random.integers(2, 4))
    time, length, mass = (2.0 ** random.integers(-9, 10) if random.random() < 0.5 else 1.0 for _ in range(3))
    masses, stiffness, root = np.diag(random.integers(1, 4, n)), np.zeros((n, n)), random.integers(-1, 2, (n, n))
    stiffness[0, 0] = random.choice([0.0, 0.0, 1.0])
    if n == 3:
        stiffness += random.choice([0.0, 4.0]) * np.outer([1, 0, -1], [1, 0, -1])
    damping = random.choice([0.3, 1.0]) * (root @ root.T + np.eye(n))
    damping[0, 1] = damping[1, 0] = damping[0, 1] + random.choice([0.2, -0.2])
    floor = mp.UnilateralContact("floor", "u1", 0.0, friction=random.choice([0.1, 0.3]), tangential="u0",
                                 tangential_velocity=random.choice([0.0, 1.0]) * length / time)  # fmt: skip
    force, points = mass * length / time**2, {f"u{i}": i for i in range(n)}
    structure = mp.LinearStructure(masses * mass, stiffness * mass / time**2, damping * mass / time, points)
    loads = [mp.ConstantLoad("u1", -20.0 * force), mp.ConstantLoad("u0", random.choice([0.0, 3.0, 10.0]) * force)]
    if random.random() < 0.5:
        loads.append(mp.HarmonicLoad("u0", 10.0 * force, random.choice([0.5, 1.0]) / time))
    velocity = np.array([random.choice([0.0, 2.0, -1.0]), 0.0, 1.0])[:n] * length / time
    return structure, floor, loads, velocity, 2.0 * time


@pytest.mark.parametrize("seed", range(40))
def test_any_of_them_move_as_step_by_step(seed):
    structure, floor, loads, velocity, end = drawn(seed)
    model = mp.MultiPhiModel(structure, [floor], modes="all")
    run = mp.simulate(model, end, velocity=velocity, loads=loads)
    stepped, _ = RoughFloor(structure, floor, loads, end / STEPS).run(STEPS, np.zeros(structure.n), velocity)
    assert stepped.shape[1] == STEPS + 1
    t, size = np.linspace(0, end, STEPS + 1), np.max(np.abs(stepped[: structure.n]))
    assert run.status == "ok"
    assert_allclose(run.displacement(t), stepped[: structure.n], rtol=0, atol=1e-9 * size)
    x, v = run.displacement(t), run.velocity(t)
    energy = 0.5 * np.sum(v * (structure.mass @ v) + x * (structure.stiffness @ x), axis=0)
    assert_allclose(run.energy(t), energy, rtol=0, atol=1e-10 * np.max(energy))
    turned_over = run.ledger.initial + abs(run.ledger.work_of_loads) + run.ledger.damping + run.ledger.friction
    assert abs(run.ledger.residual) <= 1e-11 * turned_over
    assert run.ledger.friction >= -1e-12 * turned_over


MU, GRAVITY, GUIDE, SPEED = 0.3, 10.0, 10.0, 2.0


def pushed_on_by_its_dashpot(mu, dashpot, masses, stiffness=1000.0):
    """A body on a bar that nothing holds, and the bar: a stop presses them by a dashpot that slides with the body.

    Coordinates: along the stop, of the body and of the bar, and across it. At mu = 1 friction pushes the body on as
    strongly as the dashpot slows it down: a part of the motion has no damping, and drives the bar.
    """
    structure = mp.LinearStructure(
        np.diag(masses),
        np.zeros((3, 3)),
        dashpot * np.outer([1.0, 0.0, 1.0], [1.0, 0.0, 1.0]),
        {"body": 0, "bar": 1, "across": 2},
    )
    contact = mp.UnilateralContact(
        "stop", "across", 0.0, stiffness=stiffness, friction=mu, tangential=np.array([-1.0, -1.0, 0.0])
    )
    return mp.MultiPhiModel(structure, [contact], modes="all")


@pytest.mark.parametrize("load", ["constant", "harmonic"])
@pytest.mark.parametrize(
    ("dashpot", "masses"), [(1.0, (4.0, 2.0, 1.0)), (0.3, (1.0, 1.0, 1.0)), (2.0, (3.0, 0.7, 0.9))]
)
@pytest.mark.parametrize("mu", [1.0, 1 + 1e-15, 1 - 1e-13, 1 + 1e-9, 1 - 1e-5, 1.01, 0.6])
def test_friction_that_cancels_the_dashpot(mu, dashpot, masses, load):
    model, weight, turning = pushed_on_by_its_dashpot(mu, dashpot, masses), 4.0 + 5.0 * dashpot, 7.0
    loads, x, v = [mp.ConstantLoad("across", -weight)], np.array([0.1, 1.0, -0.004]), np.array([-5.0, 0.0, 0.0])
    if load == "harmonic":
        loads.append(mp.HarmonicLoad("body", 1.0, turning / (2 * math.pi)))
    run = mp.simulate(model, 0.3, x, v, loads)
    assert run.status == "ok"
    assert not run.warnings
    assert all(event.time == 0.0 for event in run.events)  # it slides to the end
    system, k = np.zeros((9, 9)), 1000.0
    system[:3, 3:6] = np.eye(3)
    system[3:6, 2] = np.array([-mu * k, -mu * k, -k]) / masses
    system[3:6, 3:6] = -dashpot * np.outer([1.0, 0.0, 1.0], [1.0, 0.0, 1.0]) / np.array(masses)[:, None]
    system[5, 6] = -weight / masses[2]
    system[3, 7], system[7, 8], system[8, 7] = (load == "harmonic") / masses[0], -turning, turning
    for t in (0.05, 0.3):
        exact = expm(system * t) @ np.concatenate([x, v, [1.0, 1.0, 0.0]])
        assert_allclose(run.displacement(t), exact[:3], rtol=0, atol=1e-11)
        assert_allclose(run.velocity(t), exact[3:6], rtol=0, atol=1e-10)
    assert abs(run.ledger.residual) < 1e-10 * run.ledger.friction
