"""Stops that have moved already when the run begins: what their springs hold then is in the ledger."""

import math

import numpy as np
import pytest
from small_structures import random_structure

import multiphi_exudyn as mp

WHOLE = [(kind, False) for kind in ("compliant", "viscous", "rigid", "mixed", "law")]
CASES = WHOLE + [(kind, True) for kind in ("compliant", "viscous", "law")]


def started_moved(seed, kind, moved, truncated):
    """The run of a random structure, the first of whose stops has moved by up to 0.3 m at t = 0; rigid ones touch."""
    n, mass, stiffness, dampings, random = random_structure(seed)
    damping = dampings[str(random.choice(list(dampings)))]
    structure = mp.LinearStructure(mass, stiffness, damping=damping, points={f"m{i}": i for i in range(n)})
    course = mp.Harmonic(0.3, float(random.uniform(0.1, 2)), float(random.uniform(0, 7)))
    motion = mp.StopMotion("c0", course) if moved == "stop" else mp.BaseMotion(np.ones(n), course, ("c0",))
    x, contacts = 0.1 * random.normal(size=n), []
    for i, place in enumerate(random.permutation(n)[:2]):
        rigid, sign = kind == "rigid" or (kind == "mixed" and i == 0), float(random.choice([-1, 1]))
        way = 0.3 * math.cos(course.phase) * (1.0 if moved == "stop" else -sign) if i == 0 else 0.0
        gap = way - sign * x[place] if rigid else float(random.choice([0.0, 0.1]))
        stiffness, viscous = 10.0 ** random.uniform(0, 3), 10.0 ** random.uniform(-1, 1)
        given = (math.inf, 0.0) if rigid else (stiffness, viscous if kind == "viscous" else 0.0)
        contacts.append(mp.UnilateralContact(f"c{i}", {f"m{place}": sign}, gap, *given))
    if kind == "law":
        contacts[1] = mp.ForceLaw("m0", ([0.05, 0.1, 0.3], [0.5, 2.0, 3.0]))
    loads = [motion, mp.ConstantLoad("m0", float(random.choice([0.0, 1.0])))]
    model = mp.MultiPhiModel(structure, contacts, modes=1 if truncated else "all")
    return mp.simulate(model, 0.5, displacement=x, velocity=random.normal(size=n), loads=loads)


@pytest.mark.parametrize("moved", ["stop", "base"])
@pytest.mark.parametrize(("kind", "truncated"), CASES)
def test_the_ledger_closes_whatever_stop_has_moved_at_the_start(kind, moved, truncated):
    begun_closed = 0
    for seed in range(3):
        run = started_moved(seed, kind, moved, truncated)
        ledger = run.ledger
        assert run.status == "ok", run.message
        assert abs(ledger.residual) < 1e-10 * max(ledger.initial, abs(ledger.work_of_loads), ledger.final)
        begun_closed += bool(run.start.penetrating or run.start.touching)
    assert begun_closed >= 1


@pytest.mark.parametrize("moved", ["stop", "base"])
@pytest.mark.parametrize("kind", ["rigid", "mixed"])
def test_rigid_stops_that_one_mode_cannot_meet_end_in_no_endless_exchange(kind, moved):
    """In one mode two contacts follow from each other; what a stop's motion leaves between them is said by name."""
    ended = 0
    for seed in range(12):
        run = started_moved(seed, kind, moved, True)
        if run.status == "ok":
            ended += 1
            ledger = run.ledger
            assert abs(ledger.residual) < 1e-10 * max(ledger.initial, abs(ledger.work_of_loads), ledger.final)
        else:
            assert run.message.endswith("leave no way out in the kept modes, need more of them"), run.message
    assert ended >= 6


def test_a_spring_pressed_by_its_moved_stop_holds_energy_at_the_start():
    structure = mp.LinearStructure([[1.0]], [[4.0]], points={"m0": 0})
    model = mp.MultiPhiModel(structure, [mp.UnilateralContact("stop", "m0", 0.0, 10.0)], modes="all")
    run = mp.simulate(model, 3.0, loads=[mp.StopMotion("stop", mp.Harmonic(0.15, 0.5))])
    assert run.ledger.initial == pytest.approx(0.5 * 10.0 * 0.15**2, rel=1e-14)
    assert run.energy(0.0) == pytest.approx(run.ledger.initial, rel=1e-13)
    assert abs(run.ledger.residual) < 1e-12 * abs(run.ledger.work_of_loads)
