"""Kinds of scenes with dry friction: blocks, springs in series, belts, beside contacts, under loads, from any start."""

from dataclasses import replace

import brute_force as bf
import numpy as np

import multiphi_exudyn as mp
from campaign_scenes.loads import (
    add_constant_load,
    add_function_load,
    add_gravity,
    add_harmonic_load,
    add_sampled_load,
    add_sweep_load,
    random_wave,
)
from campaign_scenes.parts import add_contacts, random_parts, random_rows, random_velocity

UNITS = 40  # most powers of two by which time, length and mass are scaled
ADDERS = (add_harmonic_load, add_harmonic_load, add_sampled_load, add_sweep_load, add_function_load, add_gravity)


def add_sliders(parts, law, count=None):
    """One to four sliders, springs now and then at a point of others; blocks have rows independent of each other."""
    random, blocks = parts.random, []
    count = count or int(random.integers(1, 5))
    rows = random_rows(parts, min(count, parts.n))[:count]
    if len(rows) < count:
        rows += [rows[int(random.integers(len(rows)))] * float(random.choice([1.0, -1.0, 0.5]))]
    for row in rows:
        free = np.linalg.matrix_rank([*blocks, row], tol=0.01) > len(blocks)
        rigid = free and (law == "rigid" or (law == "mixed" and random.random() < 0.5))
        if law == "rigid" and not rigid:
            continue
        blocks += [row] if rigid else []
        stiffness = np.inf if rigid else float(10.0 ** random.uniform(1, 3.5))
        limit = float(10.0 ** random.uniform(-1, 1))
        most = limit * float(random.uniform(1.05, 2)) if random.random() < 0.3 else limit
        velocity = float(random.normal()) if random.random() < 0.3 else 0.0
        parts.slider(row, limit, most, stiffness, velocity)


def _start(parts):
    """At rest, moving, or pulled aside and let go."""
    kind = str(parts.random.choice(["rest", "moving", "moving", "pulled"]))
    zero = np.zeros(parts.n)
    if kind == "pulled" and not parts.contacts:
        return {"displacement": parts.random.normal(size=parts.n), "velocity": zero}
    return {"velocity": zero if kind == "rest" else random_velocity(parts)}


def _sizes(random):
    return int(random.integers(1, 7))


def _one(random):
    """A single slider of any law, under any load."""
    parts = random_parts(random, _sizes(random))
    add_sliders(parts, "mixed", 1)
    random.choice(ADDERS)(parts)
    return parts.scene(**_start(parts))


def _blocks(random):
    parts = random_parts(random, _sizes(random))
    add_sliders(parts, "rigid")
    add_harmonic_load(parts)
    return parts.scene(**_start(parts))


def _jenkins(random):
    parts = random_parts(random, _sizes(random))
    add_sliders(parts, "sprung")
    random.choice([add_harmonic_load, add_constant_load, add_sampled_load])(parts)
    return parts.scene(**_start(parts))


def _loads(random):
    parts = random_parts(random, _sizes(random))
    add_sliders(parts, "mixed")
    for k in random.choice(len(ADDERS), int(random.integers(1, 4))):
        ADDERS[k](parts)
    return parts.scene(**_start(parts))


def _contacts(random):
    """Contacts that give way with sliders of any law, rigid ones with springs in series."""
    parts = random_parts(random, _sizes(random))
    law = str(random.choice(["compliant", "compliant", "viscous", "mixed", "rigid"]))
    add_sliders(parts, "sprung" if law in ("mixed", "rigid") else "mixed", int(random.integers(1, 4)))
    return _struck(parts, law)


def _impacts(random):
    """Blocks that rigid contacts move by impulses."""
    parts = random_parts(random, _sizes(random))
    add_sliders(parts, "rigid", int(random.integers(1, 3)))
    return _struck(parts, str(random.choice(["mixed", "rigid"])))


def _pressed(random):
    """Contacts that give way and rub in proportion to their forces, blocks and springs in series."""
    parts = random_parts(random, int(random.integers(2, 7)))
    return _rubbing(parts, str(random.choice(["compliant", "compliant", "viscous"])), (-0.1, 0.2))


def _rough(random):
    """Rigid contacts that rub, alone, beside some that give way, or with restitution; some press from the start."""
    parts = random_parts(random, int(random.integers(2, 7)))
    kind, restitution = str(random.choice(["rigid", "rigid", "mixed"])), float(random.uniform(0.1, 0.9))
    return _rubbing(parts, kind, (0.0, 0.2) if random.random() < 0.3 else (0.02, 0.3), restitution)


def _rubbing(parts, law, gap, restitution=0.0):
    """Contacts of a law, most of which rub; under a load."""
    random = parts.random
    add_contacts(parts, law, int(random.integers(1, min(3, parts.n) + 1)), gap=gap)
    if restitution and random.random() < 0.3:
        for i, contact in enumerate(parts.contacts):
            if contact.rigid:
                parts.contacts[i] = replace(contact, restitution=restitution)
                parts.stops[i] = replace(parts.stops[i], restitution=restitution)
    rows = [stop.row for stop in parts.stops]
    for i in range(len(parts.contacts)):
        beside = [slider for slider in parts.sliders if np.isinf(slider.stiffness)]
        if not any(contact.rigid for contact in parts.contacts) and beside and random.random() < 0.4:  # one motion
            lever, friction = float(random.choice([1.0, -1.0, 0.5])), float(10.0 ** random.uniform(-1.3, 0.3))
            parts.rub(i, lever * beside[-1].row, friction, friction, np.inf, lever * beside[-1].velocity)
            continue
        row = next(
            (r for r in random_rows(parts, parts.n) if np.linalg.matrix_rank([*rows, r], tol=0.01) > len(rows)), None
        )
        if row is None or (i > 0 and random.random() < 0.4):
            continue
        rows.append(row)
        friction = float(10.0 ** random.uniform(-1.3, 0.3))
        static = friction * float(random.uniform(1.05, 2)) if random.random() < 0.3 else friction
        sprung = law == "compliant" and random.random() < 0.5
        stiffness = float(10.0 ** random.uniform(1, 3.5)) if sprung else np.inf
        parts.rub(i, row, friction, static, stiffness, float(random.normal()) if random.random() < 0.3 else 0.0)
    if random.random() < 0.8:
        random.choice(ADDERS)(parts)
    return parts.scene(**_start(parts))


def _struck(parts, law):
    add_contacts(parts, law)
    if parts.random.random() < 0.7:
        parts.random.choice(ADDERS)(parts)
    return parts.scene(**_start(parts))


def _limits(random):
    """At rest under a load that is exactly a slider's limit, and then rises, falls or stays."""
    parts = random_parts(random, _sizes(random))
    add_sliders(parts, "rigid", 1)
    row, limit = parts.sliders[0].row, parts.sliders[0].static_limit
    row, sign = row / (row @ row), float(random.choice([-1.0, 1.0]))
    parts.loads.append(mp.ConstantLoad(parts.sliders[0].row, sign * limit))
    parts.constant = parts.constant + sign * limit * parts.sliders[0].row
    if random.random() < 0.8:
        strength = float(10.0 ** random.uniform(-1, 1))
        frequency = float(10.0 ** random.uniform(-1, 0.5))
        (_, frequency, _), course = random_wave(parts, strength, frequency)
        omega, phase = 2 * np.pi * frequency, float(random.choice([-1.0, 1.0])) * np.pi / 2
        course = bf.Course(lambda t: strength * np.cos(omega * t + phase), step=course.step)
        parts.load(parts.sliders[0].row, mp.HarmonicLoad(parts.sliders[0].row, strength, frequency, phase), course)
    return parts.scene()


def _free(random):
    """Bodies that nothing but friction holds, dashpots between them or to the ground."""
    parts = random_parts(random, _sizes(random), free=True, damping="none")
    c = np.zeros((parts.n, parts.n))
    for row in random_rows(parts, int(random.integers(0, 3)), ("one", "between")):
        c += float(10.0 ** random.uniform(-1, 0.7)) * np.outer(row, row)
    parts.damping = parts.matrix = c
    add_sliders(parts, "mixed")
    if random.random() < 0.7:
        random.choice([add_gravity, add_constant_load, add_harmonic_load])(parts)
    return parts.scene(**_start(parts))


def _redundant(random):
    """Scenes of other kinds, blocks split in two or three of one direction: the motion is the same.

    Of a higher static limit one part has all that it is higher: with several it has no one answer which lets go first.
    """
    scene = (_blocks, _loads, _impacts)[int(random.integers(3))](random)
    given = [contact for contact in scene.model.contacts if isinstance(contact, mp.Friction)]
    contacts, blocks = [], [block for block in given if block.rigid]
    for contact in scene.model.contacts:
        if contact not in blocks or (contact is not blocks[0] and random.random() < 0.3):
            contacts.append(contact)
            continue
        shares = random.dirichlet(np.full(int(random.integers(2, 4)), 2.0))
        last = int(random.integers(len(shares)))
        for k, share in enumerate(shares.tolist()):
            lever, more = float(random.choice([1.0, -1.0, 0.5, 3.0])), contact.most - contact.limit
            most = share * contact.limit + (more if k == last else 0.0)
            contacts.append(_part(contact, f"{contact.name}.{k}", share * contact.limit, most, lever))
    return replace(scene, model=mp.MultiPhiModel(scene.model.structure, contacts, modes="all"))


def _part(block, name, limit, most, lever):
    """A part of a block, with these limits along its direction, as friction along that times a number."""
    direction, size = lever * np.asarray(block.direction), abs(lever)
    return mp.Friction(name, direction, limit / size, most / size, velocity=lever * block.velocity)


def _units(random):
    """A scene of another of these kinds, in units that are powers of two."""
    kinds = [kind for kind in DRAWN if kind not in ("friction units", "friction redundant")]
    scene = DRAWN[str(random.choice(kinds))](random)
    return replace(scene, units=tuple(int(k) for k in random.integers(-UNITS, UNITS + 1, 3)))


DRAWN = {
    "friction": _one,
    "friction blocks": _blocks,
    "jenkins": _jenkins,
    "friction loads": _loads,
    "friction contacts": _contacts,
    "friction impacts": _impacts,
    "contact friction": _pressed,
    "rigid friction": _rough,
    "friction limits": _limits,
    "friction free": _free,
    "friction units": _units,
    "friction redundant": _redundant,
}
