"""Spring-dashpot stops that push and never pull: free masses, zero gaps, loads, restarts, any units.

At the instant at which such a stop lets go its spring and its damper cancel, and without a stiffness of its own the
mass has no other scale: a decision by the size of what is left would be one by round-off.
"""

import math

import numpy as np
import pytest
from dashpot_stops import DashpotStops
from numpy.testing import assert_allclose

import multiphi_exudyn as mp

M, K = 2.0, 5e3
OMEGA = math.sqrt(K / M)
STEPS = 200


def rebound(zeta):
    """Speed after over speed before, let go where k d + c d' = 0."""
    return math.exp(-zeta / math.sqrt(1 - zeta * zeta) * (math.pi - 2 * math.asin(zeta)))


def wall(zeta, gap, units):
    """A free mass and the stop that it strikes."""
    time, mass = units
    structure = mp.LinearStructure([[M * mass]], [[0.0]], points={"x": 0})
    return structure, mp.UnilateralContact(
        "stop", "x", gap, K * mass / time**2, damping=2 * zeta * OMEGA * M * mass / time
    )


def two_bodies(zeta, gap, units):
    """Two free masses that strike each other with the same mass in relative motion."""
    time, mass = units
    structure = mp.LinearStructure(2 * M * mass * np.eye(2), np.zeros((2, 2)), points={"a": 0, "b": 1})
    stop = mp.UnilateralContact(
        "stop", {"b": 1.0, "a": -1.0}, gap, K * mass / time**2, damping=2 * zeta * OMEGA * M * mass / time
    )
    return structure, stop


@pytest.mark.parametrize("bodies", [wall, two_bodies])
@pytest.mark.parametrize("units", [(1.0, 1.0), (2.0**-9, 2.0**21), (0.7e3, 1.3e-4)])
@pytest.mark.parametrize("gap", [0.0, 0.1])
def test_a_free_mass_is_let_go_where_spring_and_damper_cancel(bodies, units, gap):
    for zeta in (*10 ** np.linspace(-8, -0.7, 40), 0.3, 0.5, 0.7, 0.9, 0.95):
        structure, stop = bodies(zeta, gap, units)
        model = mp.MultiPhiModel(structure, [stop])
        for speed in (0.1, 3.0):
            end = (4 / OMEGA + gap / speed) * units[0]
            v = np.array([-speed / units[0], 0.0][: structure.n]) * structure.row(stop.direction)[-1]
            v = v if structure.n == 1 else -v
            run = mp.simulate(model, end, velocity=v)
            after = structure.row(stop.direction) @ run.velocity(end) * units[0] / speed
            assert after == pytest.approx(rebound(zeta), abs=1e-9)
            assert [e.kind for e in run.events] == ["close", "open"]


def drawn(seed):
    """One to three bodies, free or nearly so, with one to three stops, most without a gap, and whole numbers."""
    random = np.random.default_rng([seed, 5])
    n = int(random.integers(1, 4))
    time, length, mass = (2.0 ** random.integers(-9, 10) if random.random() < 0.5 else 1.0 for _ in range(3))
    masses, stiffness = np.diag(random.integers(1, 4, n).astype(float)), np.zeros((n, n))
    for i in range(n - 1 if random.random() < 0.4 else 0):
        spring = np.eye(n)[i] - np.eye(n)[i + 1]
        stiffness += random.choice([1.0, 10.0]) * np.outer(spring, spring)
    contacts = []
    for k in range(int(random.integers(1, 4))):
        i, side = int(random.integers(n)), random.choice([1.0, -1.0])
        direction = {f"m{i}": side}
        if n > 1 and random.random() < 0.5:
            direction[f"m{(i + random.integers(1, n)) % n}"] = -side
        pressed = float(random.choice([1.0, 10.0, 100.0]))
        zeta = random.choice([0.1, 0.5, 1.0, 10 ** random.uniform(-6, 0)])
        gap = random.choice([0.0, 0.0, 0.25]) * length
        damping = 2 * zeta * math.sqrt(pressed) * mass / time
        contacts.append(mp.UnilateralContact(f"c{k}", direction, gap, pressed * mass / time**2, damping=damping))
    force, at = mass * length / time**2, [f"m{i}" for i in range(n)]
    loads = [mp.ConstantLoad(at[i], -2.0 * masses[i, i] * force) for i in range(n if random.random() < 0.5 else 0)]
    if random.random() < 0.4:
        loads.append(mp.HarmonicLoad(at[0], 5.0 * force, 0.5 / time, random.choice([0.0, -math.pi / 2])))
    velocity = random.integers(-2, 3, n) * length / time
    velocity[0] = velocity[0] or -length / time
    structure = mp.LinearStructure(masses * mass, stiffness * mass / time**2, points={at[i]: i for i in range(n)})
    return structure, contacts, loads, velocity, 3.0 * time


SEEDS = range(40)


@pytest.mark.parametrize("seed", SEEDS)
def test_any_of_them_move_as_step_by_step_and_never_pull(seed):
    structure, contacts, loads, velocity, end = drawn(seed)
    model = mp.MultiPhiModel(structure, contacts, modes="all")
    first = mp.simulate(model, 0.37 * end, velocity=velocity, loads=loads)
    runs = [first, mp.simulate(model, end, start=first, loads=loads)]
    assert [run.status for run in runs] == ["ok", "ok"]
    stepped, _ = DashpotStops(structure, contacts, loads, end / STEPS).run(STEPS, np.zeros(structure.n), velocity)
    t, size = np.linspace(0, end, STEPS + 1), np.max(np.abs(stepped[: structure.n]))
    for run in runs:
        here = (t >= run.start.time) & (t <= run.t_end)
        assert_allclose(run.displacement(t[here]), stepped[: structure.n, here], rtol=0, atol=1e-8 * size)
        ledger = run.ledger
        turned_over = ledger.initial + abs(ledger.work_of_loads) + ledger.damping
        assert abs(ledger.residual) < 1e-10 * turned_over
        for contact in contacts:
            force = run.contact_force(contact.name, t[here])
            assert np.min(force) >= -1e-9 * np.max(force)
