"""Scenes on a lattice: small integers and zeros, equal places, opposite directions, events that coincide by structure.

What continuous random numbers never draw: nothing that holds a body, gaps that are zero, two contacts of one direction,
a spring that cancels another one, a start at an event. Masses, stiffnesses, gaps, starts, velocities, loads and limits
are from {0, 1, 2, ...}, and all elements stand together. The answers may be unique or not: the law check judges them.
"""

import math
from dataclasses import replace

import numpy as np

import multiphi_exudyn as mp
from campaign_scenes.parts import Scene

MASSES = (1.0, 1.0, 1.0, 2.0, 4.0)
STIFFNESSES = (1.0, 2.0, 4.0, 10.0, 100.0)
CONTACTS = (math.inf, math.inf, math.inf, 1.0, 10.0, 100.0, 1000.0)
DASHPOTS = (0.5, 1.0, 2.0)
STARTS = (0.0, 0.0, 0.0, 1.0, -1.0, 0.5)
SPEEDS = (0.0, 0.0, 1.0, -1.0, 2.0, -2.0)
FORCES = (1.0, -1.0, 2.0, -2.0, 10.0, -10.0)
LIMITS = (1.0, 2.0, 10.0)
HERTZ = (0.5 / math.pi, 1 / math.pi, 0.5, 1.0)
LAWS = (
    ((-2.0, -1.0, 0.0, 1.0, 2.0), (-4.0, -1.0, 0.0, 1.0, 4.0)),
    ((-2.0, -1.0, 1.0, 2.0), (-10.0, 0.0, 0.0, 10.0)),
    ((-2.0, -1.0, 0.0, 1.0, 2.0), (-4.0, 1.0, 0.0, -1.0, 4.0)),
    ((-1.0, 0.0, 1.0), (-1.0, 0.0, 2.0)),
    ((-2.0, -1.0, 1.0, 2.0), (-1.0, 1.0, -1.0, 1.0)),
)


def _row(random, n, kinds=(1, 1, 1, 2, 3, 4)):
    """One coordinate, the difference or the sum of two, or the double of one."""
    kind, (i, *others) = int(random.choice(kinds)), random.permutation(n).tolist()
    row = np.zeros(n)
    row[i] = float(random.choice([1.0, 1.0, -1.0])) * (2.0 if kind == 4 else 1.0)
    if kind in (2, 3) and others:
        row[others[0]] = row[i] * (-1.0 if kind == 2 else 1.0)
    return row


def _matrix(random, n, values, most):
    """A sum of a few springs or dashpots, often of none."""
    matrix = np.zeros((n, n))
    for _ in range(int(random.integers(0, most + 1))):
        row = _row(random, n)
        matrix += float(random.choice(values)) * np.outer(row, row)
    return matrix


def _contact(random, n, name, rows):
    """A contact of any law, now and then along the row of another one or against it."""
    row = (
        rows[int(random.integers(len(rows)))] * float(random.choice([1, -1]))
        if rows and random.random() < 0.3
        else None
    )
    row = _row(random, n) if row is None else row
    stiffness = float(random.choice(CONTACTS))
    given = {"stiffness": stiffness}
    if math.isinf(stiffness):
        given["restitution"] = float(random.choice([0.0, 0.0, 0.5, 1.0]))
    else:
        given["damping"] = float(random.choice([0.0, 0.0, 1.0, 10.0, 100.0]))
    if n > 1 and random.random() < 0.45:
        along = next((r for r in (_row(random, n) for _ in range(20)) if np.linalg.matrix_rank([row, r]) == 2), None)
        if along is not None:
            friction = float(random.choice([0.25, 0.5, 1.0]))
            given |= {"tangential": along, "friction": friction}
            given["static_friction"] = friction * float(random.choice([1.0, 1.0, 2.0]))
            given["tangential_velocity"] = float(random.choice([0.0, 0.0, 0.0, 1.0, -1.0]))
            if not math.isinf(stiffness) and not given["damping"] and random.random() < 0.5:
                given["tangential_stiffness"] = float(random.choice([1.0, 10.0, 100.0]))
    return mp.UnilateralContact(name, row, float(random.choice([0.0, 0.0, 0.0, 1.0, 0.5])), **given)


def _friction(random, n, name, rows):
    row = rows[int(random.integers(len(rows)))].copy() if rows and random.random() < 0.4 else _row(random, n)
    limit = float(random.choice(LIMITS))
    most = limit * float(random.choice([1.0, 1.0, 2.0]))
    stiffness = float(random.choice([math.inf, math.inf, 1.0, 10.0, 100.0]))
    return mp.Friction(name, row, limit, most, stiffness, float(random.choice([0.0, 0.0, 0.0, 1.0, -1.0])))


def _law(random, n, name, rows):
    row = rows[int(random.integers(len(rows)))].copy() if rows and random.random() < 0.5 else _row(random, n)
    knots, forces = LAWS[int(random.integers(len(LAWS)))]
    factor = float(random.choice([1.0, 1.0, 10.0]))
    return mp.ForceLaw(row, (np.array(knots), factor * np.array(forces)), name=name)


def _loads(random, n, rows, contacts):
    loads = []
    for _ in range(int(random.integers(0, 3))):
        row = rows[int(random.integers(len(rows)))].copy() if random.random() < 0.5 else _row(random, n)
        kind, force = str(random.choice(["constant", "constant", "harmonic", "sampled"])), float(random.choice(FORCES))
        if kind == "constant":
            loads.append(mp.ConstantLoad(row, force))
        elif kind == "harmonic":
            phase = float(random.choice([0.0, 0.5, 1.0, -0.5])) * math.pi
            loads.append(mp.HarmonicLoad(row, force, float(random.choice(HERTZ)), phase))
        else:
            loads.append(mp.SampledLoad(row, [0.0, 1.0, 2.0, 4.0], force * random.choice([0.0, 1.0, -1.0], 4)))
    if contacts and random.random() < 0.12:
        course = mp.Harmonic(
            float(random.choice([1.0, 0.5])),
            float(random.choice(HERTZ)),
            float(random.choice([0.0, -0.5, 0.5])) * math.pi,
        )
        loads.append(mp.StopMotion(contacts[int(random.integers(len(contacts)))].name, course))
    return loads


def _moved_out(contacts, x, loads):
    """Rigid stops that the start lies inside moved to where they just touch."""
    out = []
    for contact in contacts:
        z = sum(
            load.course.amplitude * math.cos(load.course.phase)
            for load in loads
            if isinstance(load, mp.StopMotion) and load.contact == contact.name
        )
        gap = float(contact.direction @ x) - z
        inside = contact.rigid and gap + contact.gap < 0
        out.append(replace(contact, gap=-gap) if inside else contact)
    return out


def _lattice(random):
    n = int(random.choice([1, 1, 2, 2, 2, 3]))
    mass = np.diag(random.choice(MASSES, n)) if random.random() < 0.7 else float(random.choice(MASSES)) * np.eye(n)
    stiffness = _matrix(random, n, STIFFNESSES, 2)
    damping = _matrix(random, n, DASHPOTS, 2) if random.random() < 0.4 else None
    rows, contacts, others = [], [], []
    for k in range(int(random.choice([1, 1, 2, 2, 3, 4]))):
        kind = str(random.choice(["contact", "contact", "contact", "friction", "friction", "law"]))
        made = {"contact": _contact, "friction": _friction, "law": _law}[kind](random, n, f"{kind[0]}{k}", rows)
        rows.append(np.asarray(made.direction))
        (contacts if kind == "contact" else others).append(made)
    loads = _loads(random, n, rows, contacts)
    x, v = random.choice(STARTS, n), random.choice(SPEEDS, n)
    if random.random() < 0.3:
        v = np.full(n, v[0])
    contacts = _moved_out(contacts, x, loads)
    structure = mp.LinearStructure(mass, stiffness, damping, {f"m{i}": i for i in range(n)})
    model = mp.MultiPhiModel(structure, [*contacts, *others], modes="all")
    return Scene("", 0, model, float(random.choice([2.0, 3.0, 5.0])), x, v, tuple(loads), None, by_laws=True)


DRAWN = {"lattice": _lattice}
