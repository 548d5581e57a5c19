"""Kinds of scenes at borders: bodies that almost nothing holds, gaps of zero, starts at events, dampers across axes,
stiffnesses printed with few digits.
"""

from dataclasses import replace

import numpy as np

import multiphi_exudyn as mp
from campaign_scenes.loads import add_constant_load, add_gravity, add_harmonic_load, add_sampled_load
from campaign_scenes.parts import Parts, add_contacts, random_parts, random_rows, random_velocity
from campaign_scenes.sliders import add_sliders
from campaign_scenes.units import scaled

ADDERS = (add_constant_load, add_gravity, add_harmonic_load, add_sampled_load)
LAWS = ("rigid", "compliant", "viscous", "viscous", "mixed")
FEWEST, MOST_DIGITS = 6, 16  # of a printed stiffness
ROUNDED = 1e3  # of the last digit: how far motions may be apart by it


def _loaded(parts, share=0.7):
    if parts.random.random() < share:
        parts.random.choice(ADDERS)(parts)


def _nearly_free(random):
    """Bodies that nothing holds, or a spring of 1e-3 to 1e-12 of the others; now and then beside friction."""
    n = int(random.integers(1, 5))
    parts = random_parts(
        random, n, free=True, structure="chain", damping=str(random.choice(["none", "none", "dashpot"]))
    )
    if random.random() < 0.3:  # several bodies
        parts.stiffness = np.zeros((n, n))
    if random.random() < 0.5:
        parts.stiffness = parts.stiffness.copy()
        parts.stiffness[0, 0] += 10.0 ** random.uniform(-12, -3)
    add_contacts(parts, str(random.choice(LAWS)), gap=(0.0, 0.0) if random.random() < 0.4 else (0.02, 0.3))
    if random.random() < 0.3:
        add_sliders(parts, "sprung", 1)
    _loaded(parts)
    return parts.scene(velocity=random_velocity(parts))


def _zero_gaps(random):
    """Contacts that touch at the start, at rest or not."""
    parts = random_parts(random)
    add_contacts(parts, str(random.choice(LAWS)), gap=(0.0, 0.0))
    _loaded(parts)
    return parts.scene(velocity=random_velocity(parts) if random.random() < 0.7 else np.zeros(parts.n))


def _at_events(random):
    """Runs that end at events, and begin again there."""
    parts = random_parts(random)
    add_contacts(parts, str(random.choice(LAWS)))
    _loaded(parts)
    scene = parts.scene(velocity=random_velocity(parts))
    model, end, x, v, loads = scaled(scene)
    happened = np.unique([event.time for event in mp.simulate(model, end, x, v, loads).events])
    happened = happened[(happened > 0.01 * end) & (happened < 0.99 * end)]
    if any(isinstance(load, mp.SampledLoad) for load in loads) or not len(happened):
        return scene
    chosen = random.choice(happened, min(len(happened), int(random.integers(1, 4))), replace=False)
    return replace(scene, split=tuple(np.sort(chosen).tolist()))


def _dampers(random):
    """A damping matrix with coupling beside contacts that rub, on bodies that are held or free where they slide."""
    n = int(random.integers(2, 5))
    parts = random_parts(random, n, free=True, damping="none")
    if random.random() < 0.5:
        parts.stiffness = np.zeros((n, n))
    root = random.normal(size=(n, int(random.integers(1, n + 1)))) * 10.0 ** random.uniform(-1, 0.2)
    parts.damping = parts.matrix = root @ root.T
    add_contacts(parts, str(random.choice(["rigid", "rigid", "compliant"])), 1, gap=(0.0, 0.1))
    row = next(r for r in random_rows(parts, n) if np.linalg.matrix_rank([parts.stops[0].row, r], tol=0.01) == 2)
    friction = float(10.0 ** random.uniform(-1.3, 0.0))
    parts.rub(0, row, friction, friction)
    parts.loads.append(mp.ConstantLoad(parts.stops[0].row, -5.0))
    parts.constant = parts.constant - 5.0 * parts.stops[0].row
    _loaded(parts, 0.5)
    return parts.scene(velocity=random_velocity(parts))


def _digits(random):
    """A free chain whose stiffness is printed with 6 to 16 digits: that of all digits is right."""
    n, digits = int(random.integers(2, 6)), int(random.integers(FEWEST, MOST_DIGITS + 1))
    springs = 10.0 ** random.uniform(0.5, 1.8, n - 1)
    stiffness = np.zeros((n, n))
    for i, spring in enumerate(springs):
        stiffness[i : i + 2, i : i + 2] += spring * np.array([[1.0, -1.0], [-1.0, 1.0]])
    parts = Parts(random, np.diag(random.uniform(0.5, 2, n)), stiffness)
    add_contacts(parts, str(random.choice(["compliant", "compliant", "rigid"])), 1)
    if random.random() < 0.5:
        add_harmonic_load(parts)
    printed = np.array([[float(f"{value:.{digits - 1}e}") for value in row] for row in stiffness])
    structure = mp.LinearStructure(parts.mass, printed, None, {f"m{i}": i for i in range(n)})
    scene = parts.scene(velocity=random_velocity(parts), structure=structure)
    unit = 10.0 ** (np.floor(np.log10(np.max(stiffness))) - (digits - 1))
    held = 0.25 * n * unit * scene.t_end**2 / np.trace(parts.mass)  # by half a unit in every row, of the way
    return replace(scene, near=max(scene.near, ROUNDED * 10.0**-digits, float(held)))


DRAWN = {
    "nearly free": _nearly_free,
    "zero gaps": _zero_gaps,
    "at events": _at_events,
    "dampers": _dampers,
    "digits": _digits,
}
