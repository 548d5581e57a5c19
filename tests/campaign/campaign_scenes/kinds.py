"""Kinds of scenes, each a function of a random generator; DRAWN has them by name."""

import math
from dataclasses import fields, replace

import brute_force as bf
import numpy as np
import scipy.linalg

import multiphi_exudyn as mp
from campaign_scenes.loads import (
    add_constant_load,
    add_function_load,
    add_gravity,
    add_harmonic_load,
    add_sampled_load,
    add_sweep_load,
    random_strength,
    random_wave,
    random_way,
    scaled_course,
)
from campaign_scenes.parts import (
    Parts,
    add_contacts,
    damping_of,
    random_parts,
    random_rows,
    random_velocity,
    widen_gaps,
)

UNITS = 40  # most powers of two by which time, length and mass are scaled


def _loaded(add, law=("compliant", "compliant", "mixed")):
    def drawn(random):
        parts = random_parts(random)
        add_contacts(parts, str(random.choice(law)))
        add(parts)
        start = random_velocity(parts) if random.random() < 0.6 else np.zeros(parts.n)
        return parts.scene(velocity=start)

    return drawn


def _several(random):
    parts = random_parts(random)
    add_contacts(parts, str(random.choice(["compliant", "mixed", "rigid"])))
    adders = [add_harmonic_load, add_constant_load, add_gravity, add_sampled_load, add_sweep_load]
    for k in random.choice(len(adders), int(random.integers(2, 5))):
        adders[k](parts)
    return parts.scene(velocity=random_velocity(parts))


def _rigid(random):
    parts = random_parts(random)
    add_contacts(parts, "rigid")
    (add_gravity if random.random() < 0.3 else add_harmonic_load)(parts)
    return parts.scene(velocity=random_velocity(parts))


def _moving_stops(random):
    parts = random_parts(random)
    law = str(random.choice(["rigid", "compliant", "viscous", "mixed"]))
    add_contacts(parts, law)
    for i in range(len(parts.contacts)):
        if i == 0 or random.random() < 0.5:
            made, course = random_way(parts, float(random.uniform(0.02, 0.3)))
            parts.move(i, course, made)
    if random.random() < 0.3:
        add_constant_load(parts)
    widen_gaps(parts, np.zeros(parts.n))
    return parts.scene(velocity=random_velocity(parts))


def _moving_bases(random):
    parts = random_parts(random)
    add_contacts(parts, str(random.choice(["rigid", "compliant", "mixed"])))
    row = np.ones(parts.n) if random.random() < 0.7 else random.normal(size=parts.n)
    made, course = random_way(parts, float(random.uniform(0.05, 0.4)))
    fixed = [i for i in range(len(parts.contacts)) if random.random() < 0.4]
    parts.loads.append(mp.BaseMotion(row, made, tuple(f"c{i}" for i in fixed)))
    parts.forces.append((-parts.mass @ row, replace(course, value=course.acceleration)))
    for i in fixed:
        parts.stops[i] = replace(parts.stops[i], course=scaled_course(course, -float(parts.stops[i].row @ row)))
    widen_gaps(parts, np.zeros(parts.n))
    return parts.scene(velocity=random_velocity(parts, float(random.choice([0.0, 1.0]))))


def _viscous(random):
    parts = random_parts(random)
    add_contacts(parts, "viscous", gap=(0.0, 0.2))
    if random.random() < 0.5:
        random.choice([add_harmonic_load, add_gravity, add_constant_load])(parts)
    return parts.scene(velocity=random_velocity(parts))


def _bounded(random):
    """Viscous contacts whose dampers are bounded; brute force has none, so the law is what judges."""
    parts = random_parts(random, damping=str(random.choice(["none", "rayleigh", "modal"])))
    add_contacts(parts, "viscous", gap=(0.0, 0.2))
    parts.contacts = [replace(contact, damper="bounded") for contact in parts.contacts]
    if random.random() < 0.5:
        random.choice([add_harmonic_load, add_constant_load])(parts)
    return replace(parts.scene(velocity=random_velocity(parts)), system=None)


def _table(random, soft):
    """Knots and forces of a law: centre inside, at an end, or nowhere; one-sided; slopes of either sign."""
    kind = str(random.choice(["inner", "inner", "end", "no zero", "one-sided", "softening"]))
    count = int(random.integers(3, 7))
    knots = np.sort(random.uniform(-0.4, 0.4, count)) + 0.02 * np.arange(count)
    slopes = 10.0 ** random.uniform(0, 2, count - 1)
    if kind == "softening":
        slopes *= np.where(random.random(count - 1) < 0.4, -0.3 * soft / 100, 1.0)
    if kind == "end":
        knots = knots - knots[0] if random.random() < 0.5 else knots - knots[-1]
    if kind == "one-sided":
        slopes[0] = 0.0
    forces = np.r_[0.0, np.cumsum(slopes * np.diff(knots))]
    forces -= np.interp(0.0, knots, forces)
    if kind == "no zero":
        forces += 1.0 - forces[0]
    if kind == "one-sided":
        forces -= forces[0]
    return knots, forces


def _tables(random):
    parts = random_parts(random)
    row = random_rows(parts, 1)[0]
    soft = 1 / float(row @ np.linalg.solve(parts.stiffness, row))
    knots, forces = _table(random, min(soft, 100.0))
    parts.laws.append((mp.ForceLaw(row, (knots, forces), name="law"), bf.Law(row, knots, forces)))
    if random.random() < 0.3:
        add_contacts(parts, "compliant", 1)
    if random.random() < 0.4:
        random.choice([add_harmonic_load, add_constant_load])(parts)
    return parts.scene(velocity=random_velocity(parts))


def _laws(random):
    """Functions; brute force follows the same straight segments, which the judge compares with the function."""
    parts = random_parts(random)
    row, kind = random_rows(parts, 1)[0], str(random.choice(["cubic", "softening", "tanh", "one-sided", "bistable"]))
    k, q0 = 10.0 ** random.uniform(0.5, 1.5), float(random.uniform(0.3, 1.0))
    functions = {
        "cubic": lambda q: k * q + k * q**3 / q0**2,
        "softening": lambda q: k * q - 0.2 * k * q**3 / (q0**2 + q**2),
        "tanh": lambda q: k * q0 * np.tanh(q / q0),
        "one-sided": lambda q: k * np.maximum(q, 0.0) ** 1.5 / q0**0.5,
        "bistable": lambda q: -0.2 * k * q + k * q**3 / q0**2,
    }
    span = (0.0, 1.0) if kind == "one-sided" and random.random() < 0.5 else (-1.0, 1.0)
    law = mp.ForceLaw(row, functions[kind], segments=int(random.integers(4, 16)), span=span)
    parts.laws.append((law, bf.Law(row, np.array(law.knots), np.array(law.forces))))
    if random.random() < 0.4:
        random.choice([add_harmonic_load, add_constant_load])(parts)
    return parts.scene(velocity=random_velocity(parts))


def _truncated(random):
    """Repeated frequencies and rigid-body modes, fewer modes than there are: no brute force."""
    n = int(random.integers(3, 7))
    root = 0.5 * random.normal(size=(n, n))
    mass = root @ root.T + np.eye(n)
    omega = np.sort(10.0 ** random.uniform(0.2, 1.3, n))
    kind = str(random.choice(["repeated", "rigid body", "both", "plain"]))
    if kind in ("repeated", "both"):
        omega = omega[np.arange(n) // 2 * 2]
    if kind in ("rigid body", "both"):
        omega[: int(random.integers(1, 3))] = 0.0
    factor = np.linalg.cholesky(mass) @ scipy.linalg.qr(random.normal(size=(n, n)))[0]
    stiffness = (factor * omega**2) @ factor.T
    parts = Parts(random, mass, (stiffness + stiffness.T) / 2)
    if random.random() < 0.4:
        ratios = np.full(n, 0.03)
        parts.damping = mp.ModalDamping(ratios)
    add_contacts(parts, str(random.choice(["compliant", "rigid", "mixed"])), int(random.integers(1, min(3, n - 1) + 1)))
    if random.random() < 0.3:
        add_harmonic_load(parts)
    modes = int(random.integers(1, n - len(parts.contacts) + 1))
    return replace(parts.scene(velocity=random_velocity(parts), modes=modes), system=None)


def _alike(random):
    """One to three masses with two to four rigid contacts of dependent or nearly parallel rows."""
    parts = random_parts(random, int(random.integers(1, 4)))
    row = random_rows(parts, 1)[0]
    other = random_rows(parts, 1)[0]
    rows = [row]
    for _ in range(int(random.integers(1, 4))):
        kind = str(random.choice(["same", "parallel", "sum", "other"]))
        if parts.n == 1 or kind == "same":
            rows.append(row * float(random.choice([1.0, 2.0])))
        elif kind == "parallel":
            rows.append(row + 10.0 ** random.uniform(-7, -1) * random.normal(size=parts.n))
        else:
            rows.append(row + other if kind == "sum" else other)
    rows = [r for r in rows if r @ row > 0.1 * np.linalg.norm(r) * np.linalg.norm(row)]  # no two of them a clamp
    gap = float(random.choice([0.0, 0.05]))
    for r in rows:
        parts.contact(r, gap if random.random() < 0.6 else float(random.uniform(0.0, 0.1)))
    return parts


def _redundant(random):
    parts = _alike(random)
    if random.random() < 0.6:
        (add_gravity if random.random() < 0.5 else add_harmonic_load)(parts)
    return parts.scene(velocity=random_velocity(parts))


def _moving_redundant(random):
    parts = _alike(random)
    for i in range(len(parts.contacts)):
        if i == 0 or random.random() < 0.4:
            made, course = random_way(parts, float(random.uniform(0.02, 0.2)))
            parts.move(i, course, made)
    if random.random() < 0.4:
        add_constant_load(parts)
    widen_gaps(parts, np.zeros(parts.n))
    return parts.scene(velocity=random_velocity(parts))


def _free(random):
    """Bodies that nothing holds, dashpots between them or to the ground."""
    parts = random_parts(random, int(random.integers(1, 5)), free=True, damping="none")
    c = np.zeros((parts.n, parts.n))
    for row in random_rows(parts, int(random.integers(1, 3)), ("one", "between")):
        c += float(10.0 ** random.uniform(-1, 0.7)) * np.outer(row, row)
    parts.damping = parts.matrix = c
    add_contacts(parts, str(random.choice(["compliant", "rigid", "mixed"])))
    if random.random() < 0.6:
        random.choice([add_gravity, add_constant_load, add_harmonic_load])(parts)
    units = (int(random.integers(-UNITS // 2, UNITS // 2 + 1)), 0, 0) if random.random() < 0.5 else (0, 0, 0)
    return parts.scene(velocity=random_velocity(parts), units=units)


def _assembled(random):
    """Two chains with contacts between them, tied or not; brute force has the ties' null space of its own."""
    kinds = [str(random.choice(["none", "rayleigh", "given"])) for _ in range(2)]
    pair = [random_parts(random, int(random.integers(1, 4)), damping=kind) for kind in kinds]
    structures = [mp.LinearStructure(p.mass, p.stiffness, p.damping, {f"m{i}": i for i in range(p.n)}) for p in pair]
    total = pair[0].n + pair[1].n
    tie = total > 3 and random.random() < 0.5
    ties = [{"a.m0": 1.0, "b.m0": -1.0 if random.random() < 0.5 else -0.7}] if tie else []
    whole = mp.assemble(dict(zip("ab", structures, strict=True)), ties)
    full = [
        scipy.linalg.block_diag(*(m(p) for p in pair)) for m in (lambda p: p.mass, damping_of, lambda p: p.stiffness)
    ]
    frame = np.eye(total)
    if tie:
        held = np.zeros((1, total))
        held[0, 0], held[0, pair[0].n] = 1.0, ties[0]["b.m0"]
        frame = scipy.linalg.null_space(held)
    parts = Parts(random, *(frame.T @ full[k] @ frame for k in (0, 2)))
    parts.matrix = frame.T @ full[1] @ frame
    for k in range(int(random.integers(1, 3))):
        a, b = (f"{name}.m{p.n - 1 - (k if p.n > 1 + k else 0)}" for name, p in zip("ab", pair, strict=True))
        direction, row = {a: 1.0, b: -1.0}, np.zeros(total)
        row[int(a[3:])], row[pair[0].n + int(b[3:])] = 1.0, -1.0
        if not np.linalg.norm(frame.T @ row) > 0.1 or any(np.allclose(s.row, frame.T @ row) for s in parts.stops):
            continue
        gap = float(random.uniform(0.02, 0.2))
        stiffness = math.inf if random.random() < 0.5 else float(10.0 ** random.uniform(1, 3.5))
        parts.contacts.append(mp.UnilateralContact(f"c{k}", direction, gap, stiffness))
        parts.stops.append(bf.Stop(frame.T @ row, gap, stiffness))
    numbers, course = random_wave(parts, random_strength(parts))
    parts.load(frame.T @ np.eye(total)[-1], mp.HarmonicLoad(f"b.m{pair[1].n - 1}", *numbers), course)
    velocity = random.normal(size=parts.n)
    first = np.asarray(frame @ velocity)[whole.free] if tie else velocity
    shown = np.asarray(whole.transformation.toarray())
    scene = parts.scene(structure=whole)
    zero = np.zeros(whole.n)
    start = np.zeros(parts.n), velocity
    return replace(scene, displacement=zero, velocity=first, start=start, shown=shown, frame=frame)


def _clamps(random):
    """Gaps and speeds that are zero by structure."""
    kind = str(random.choice(["clamp", "mirror", "resting", "touching", "preload"]))
    if kind == "mirror":
        return _mirror(random)
    parts = random_parts(random, int(random.integers(1, 4)), structure="chain" if kind == "clamp" else None)
    row = np.eye(parts.n)[0]
    law = str(random.choice(["rigid", "rigid", "compliant"]))
    stiffness = math.inf if law == "rigid" else 100.0
    if kind == "clamp":
        parts.contact(row, 0.0, stiffness)
        parts.contact(-row, 0.0, stiffness)
        add_harmonic_load(parts)
        return parts.scene(velocity=random_velocity(parts) * (parts.n > 1) * (np.arange(parts.n) > 0))
    parts.contact(row, 0.0, stiffness)
    if kind == "resting":
        add_harmonic_load(parts)
        return parts.scene()
    if kind == "touching":
        return parts.scene(velocity=random_velocity(parts) * (np.arange(parts.n) > 0))
    add_gravity(parts)
    return parts.scene(velocity=np.where(np.arange(parts.n) > 0, random_velocity(parts), 0.0))


def _mirror(random):
    """A structure that is its own mirror image: two stops are struck together."""
    mass, k, between = float(random.uniform(0.5, 2)), *(float(v) for v in random.uniform(5, 50, 2))
    parts = Parts(
        random,
        np.diag([mass, 1.0, mass]),
        np.array([[k + between, -between, 0.0], [-between, 2 * between, -between], [0.0, -between, k + between]]),
    )
    stiffness = math.inf if random.random() < 0.6 else 200.0
    gap, speed = float(random.choice([0.0, 0.05])), float(random.uniform(-2, 2))
    for at in (0, 2):
        parts.contact(np.eye(3)[at], gap, stiffness)
    if random.random() < 0.5:
        force = float(-5 * random.random())
        for at in (0, 2):
            parts.loads.append(mp.ConstantLoad(np.eye(3)[at], force))
            parts.constant = parts.constant + force * np.eye(3)[at]
    return parts.scene(velocity=np.array([speed, float(random.normal()), speed]))


def _units(random):
    """A scene of another kind, in units that are powers of two."""
    kinds = ["harmonic", "sampled", "rigid", "moving stops", "moving bases", "viscous", "tables", "redundant", "clamps"]
    scene = DRAWN[str(random.choice(kinds))](random)
    powers = tuple(int(k) for k in random.integers(-UNITS, UNITS + 1, 3))
    return replace(scene, units=powers)


def _restitution(random):
    """Rigid contacts that throw back, all with the same coefficient."""
    parts = random_parts(random)
    add_contacts(parts, "rigid")
    e = float(random.choice([1.0, random.uniform(0.1, 0.9)]))
    parts.contacts = [replace(contact, restitution=e) for contact in parts.contacts]
    parts.stops = [replace(stop, restitution=e) for stop in parts.stops]
    if random.random() < 0.6:
        random.choice([add_harmonic_load, add_gravity, add_constant_load])(parts)
    return parts.scene(velocity=random_velocity(parts))


def _restarts(random):
    parts = random_parts(random)
    add_contacts(parts, str(random.choice(["rigid", "compliant", "viscous", "mixed"])))
    if random.random() < 0.7:
        random.choice([add_harmonic_load, add_gravity, add_constant_load])(parts)
    scene = parts.scene(velocity=random_velocity(parts))
    split = np.sort(random.uniform(0.05, 0.95, int(random.integers(1, 4)))) * scene.t_end
    return replace(scene, split=tuple(float(t) for t in split))


DRAWN = {
    "harmonic": _loaded(add_harmonic_load),
    "sampled": _loaded(add_sampled_load),
    "functions": _loaded(add_function_load, ("compliant",)),
    "sweeps": _loaded(add_sweep_load),
    "several": _several,
    "rigid": _rigid,
    "moving stops": _moving_stops,
    "moving bases": _moving_bases,
    "viscous": _viscous,
    "tables": _tables,
    "laws": _laws,
    "truncated": _truncated,
    "redundant": _redundant,
    "moving redundant": _moving_redundant,
    "free": _free,
    "assembled": _assembled,
    "clamps": _clamps,
    "units": _units,
    "restarts": _restarts,
    "bounded": _bounded,
}
if "restitution" in {f.name for f in fields(mp.UnilateralContact)}:
    DRAWN["restitution"] = _restitution
