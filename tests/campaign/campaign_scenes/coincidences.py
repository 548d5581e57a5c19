"""Scenes in which two things coincide by structure, which random numbers never draw; judged by their laws."""

import math

import numpy as np

import multiphi_exudyn as mp
from campaign_scenes.parts import Scene

LONGEST = 3.0  # s


def _scene(structure, elements, loads, x, v):
    model = mp.MultiPhiModel(structure, elements, modes="all")
    return Scene("", 0, model, LONGEST, np.array(x, float), np.array(v, float), tuple(loads), None, by_laws=True)


def _structure(mass, stiffness=0.0, damping=None):
    """Masses on the axes; stiffness, damping: of each, or a matrix."""
    n = len(mass)
    matrices = [
        None if m is None else np.asarray(m) if np.ndim(m) == 2 else m * np.eye(n) for m in (stiffness, damping)
    ]
    return mp.LinearStructure(np.diag(mass), *matrices, {f"m{i}": i for i in range(n)})


def _free_on_damped_stops(random):
    """Masses that nothing holds, a stop with spring and damper between each and the one before, without a gap."""
    mass, tight = random.uniform(0.5, 2, int(random.integers(1, 4))), random.random() < 0.7
    contacts = []
    for i, m in enumerate(mass):
        stiffness, ratio = 10.0 ** random.uniform(1, 4), 10.0 ** random.uniform(-2, 0.3)
        row = np.eye(len(mass))[i] - (np.eye(len(mass))[i - 1] if i else 0.0)
        gap, damping = 0.0 if tight else float(random.uniform(0, 0.2)), 2 * ratio * math.sqrt(stiffness * m)
        contacts.append(mp.UnilateralContact(f"c{i}", row, gap, float(stiffness), damping=float(damping)))
    weight = [mp.Gravity(np.ones(len(mass)), -float(random.choice([1.0, 9.81])))] if random.random() < 0.5 else []
    return _scene(_structure(mass), contacts, weight, np.zeros(len(mass)), random.normal(size=len(mass)))


def _slip_at_the_stop(random):
    """A friction spring reaches its limit where a rigid stop throws its mass back."""
    m, k, limit = random.uniform(0.5, 2), 10.0 ** random.uniform(0.5, 2.5), 10.0 ** random.uniform(-1, 0.7)
    e, gap = float(random.choice([0.0, 0.3, 0.5, 0.9, 1.0])), float(random.choice([0.0, 0.2]))
    parts = [
        mp.UnilateralContact("stop", "m0", gap, restitution=e),
        mp.Friction("spring", "m0", float(limit), stiffness=float(k)),
    ]
    weight = [mp.ConstantLoad("m0", -float(m * random.choice([0.0, 3.0, 10.0])))]
    held = float(random.choice([0.0, 0.0, 10.0]))
    return _scene(_structure([m], held), parts, weight, [random.uniform(0.1, 1)], [-random.uniform(0, 4)])


def _spring_across_a_rough_floor(random):
    """A block slides on a floor that gives way, held by nothing along it; a friction spring acts on its height."""
    mu, weight = 10.0 ** random.uniform(-1.3, 0), 10.0 ** random.uniform(0, 1.2)
    stiffness = [math.inf, float(10.0 ** random.uniform(1, 3.5))][int(random.random() < 0.8)]
    damping = float(10.0 ** random.uniform(-1, 1)) if math.isfinite(stiffness) and random.random() < 0.3 else 0.0
    floor = mp.UnilateralContact("floor", "m1", 0.0, stiffness, damping=damping, friction=float(mu), tangential="m0")
    spring = float(10.0 ** random.uniform(0.5, 3))
    guide = mp.Friction("guide", "m1", float(10.0 ** random.uniform(0, 1.5)), stiffness=spring)
    loads = [mp.ConstantLoad("m1", -float(weight))]
    if random.random() < 0.4:
        loads.append(mp.HarmonicLoad("m0", float(random.normal()), float(10.0 ** random.uniform(-1, 0.5))))
    start = [0.0, float(random.choice([0.0, random.uniform(0, 0.3)]))]
    return _scene(_structure(random.uniform(0.5, 2, 2)), [floor, guide], loads, start, [random.normal(), 0.0])


def _cancelled_spring(random):
    """A force law whose slope takes away that of a friction spring, to some digits; a moving surface."""
    k, q = float(10.0 ** random.uniform(0, 2)), float(random.uniform(0.05, 0.3))
    off = float(random.choice([0.0, 0.0, 10.0 ** random.uniform(-12, -1)]))
    knots, slope = np.array([-5 * q, -q, 0.0, q, 5 * q]), k * (1 + off)
    law = mp.ForceLaw("m0", (knots, np.array([-3 * k * q, slope * q, 0.0, -slope * q, 3 * k * q])), name="law")
    belt = mp.Friction(
        "belt", "m0", float(10.0 ** random.uniform(-1, 1)), None, k, float(random.choice([-1.0, 0.0, 1.0]))
    )
    times = np.sort(random.uniform(0, LONGEST, 3))
    load = mp.SampledLoad("m0", np.r_[0.0, times, 2 * LONGEST], np.r_[0.0, 10 * random.normal(size=3), 0.0])
    structure = _structure([random.uniform(0.5, 2)], damping=float(random.choice([0.0, 0.3])))
    return _scene(structure, [law, belt], [load], [0.0], [random.normal()])


DRAWN = {
    "free on damped stops": _free_on_damped_stops,
    "slip at the stop": _slip_at_the_stop,
    "spring across a floor": _spring_across_a_rough_floor,
    "cancelled spring": _cancelled_spring,
}
