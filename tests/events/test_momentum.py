"""What contacts give in all is what the momentum of the structure lacks, also those that stay closed in an impact.

M (v(T) - v(0)) + integral (C x' + K x - f) dt = sum of h_i p_i
"""

import math

import numpy as np
import pytest

import multiphi_exudyn as mp

NODES, WEIGHTS = np.polynomial.legendre.leggauss(16)
UNSEEN = 1e-6  # of the momentum: contacts close at speeds whose gaps are round-off, which is of its root
PANELS = 200  # of a run, beside its events


def balance(run, velocity, load):
    """What the contacts have to give (n,) [N s]."""
    structure, ends = run.model.structure, {0.0, run.t_end, *np.linspace(0, run.t_end, PANELS)}
    ends = np.array(sorted(ends | {event.time for event in run.events}))
    times = (ends[:-1, None] + np.diff(ends)[:, None] * (NODES + 1) / 2).ravel()
    weights = (np.diff(ends)[:, None] * WEIGHTS / 2).ravel()
    damped = structure.damping @ run.velocity(times) if structure.damping is not None else 0.0
    inner = structure.stiffness @ run.displacement(times) + damped - load[:, None]
    return structure.mass @ (run.velocity(run.t_end) - velocity) + inner @ weights


@pytest.mark.parametrize("seed", [0, 3, 5])
def test_the_impulses_of_contacts_are_what_the_momentum_lacks(seed):
    random = np.random.default_rng(seed)
    n = int(random.integers(2, 5))
    root, row = random.normal(size=(2, n, n))
    mass, stiffness, damping = np.eye(n) + root @ root.T, 30 * np.eye(n) + row @ row.T, 0.05 * np.eye(n)
    structure = mp.LinearStructure(mass, stiffness, damping, {f"m{i}": i for i in range(n)})
    stops = [mp.UnilateralContact(f"c{i}", f"m{i}", 0.02 * i) for i in range(n - 1)]
    stops.append(mp.UnilateralContact("soft", f"m{n - 1}", 0.01, 400.0))
    load, velocity = -5 * np.ones(n), random.normal(size=n)
    model = mp.MultiPhiModel(structure, stops, modes="all")
    run = mp.simulate(model, 3.0, velocity=velocity, loads=[mp.ConstantLoad(load, 1.0)])
    assert run.status == "ok"
    assert len(run.events) > 5
    given = sum(structure.row(stop.direction) * run.contact_impulse(stop.name, 0.0, run.t_end) for stop in stops)
    needed = balance(run, velocity, load)
    assert np.max(np.abs(given - needed)) < UNSEEN * np.max(np.abs(needed))


def test_a_contact_that_stays_closed_in_the_impact_of_another_takes_its_share():
    """Two masses, coupled by the mass matrix: the first rests on its stop when the second strikes."""
    structure = mp.LinearStructure([[2.0, 1.0], [1.0, 2.0]], np.eye(2), points={"a": 0, "b": 1})
    stops = [mp.UnilateralContact("held", "a", 0.0), mp.UnilateralContact("struck", "b", 0.1)]
    loads = [mp.ConstantLoad("a", -50.0)]
    run = mp.simulate(mp.MultiPhiModel(structure, stops, modes="all"), 0.3, velocity=[0.0, -1.0], loads=loads)
    (strike,) = (event for event in run.events if event.contact == "struck" and event.kind == "close")
    speed = run.velocity(strike.time, "left")
    expected = structure.mass @ -speed  # both velocities become zero
    assert strike.impulse == pytest.approx(expected[1], rel=1e-12)
    assert dict(strike.shared) == pytest.approx({"held": expected[0]}, rel=1e-12)
    assert len(run.events) == len(tuple(run.events))  # a share is no event of its own
    just = math.nextafter(strike.time, 0.0), math.nextafter(strike.time, 1.0)
    assert run.contact_impulse("held", *just) == pytest.approx(expected[0], rel=1e-9)
