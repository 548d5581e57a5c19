"""Plain scenes, the same for property tests and for long campaigns: a recipe of plain words, and what it builds.

A recipe is drawn either by hypothesis (``recipes``) or from one integer (``recipe_of``), from one table of choices.
The cases are hard on purpose: rigid-body modes, repeated and widely spread frequencies, contacts in preload, at zero
distance or facing each other at one place, starts exactly on a stop, soft contacts beside hard and rigid ones.
"""

import math
from dataclasses import dataclass, fields, replace

import numpy as np
import scipy.linalg
from hypothesis import strategies as st

from campaign_scenes.parts import Scene
from multiphi_exudyn import (
    ConstantLoad,
    LinearStructure,
    ModalDamping,
    MultiPhiError,
    MultiPhiModel,
    RayleighDamping,
    UnilateralContact,
)

LONGEST = 2.0  # periods of the lowest elastic mode that a run lasts,
SHORTEST = 50.0  # at most, and of the highest one,
BOUNCES = 200.0  # and of the stiffest contact on the lightest part

CLAMPED = 1e-3  # m: gap of rigid contacts that face each other, which at zero gap would be a clamp and no contacts

CHOICES = {
    "structure": ("chain", "free chain", "dense", "free dense", "repeated", "wide", "unconnected"),
    "size": (1, 2, 3, 4, 5, 6, 7),
    "damping": ("none", "modal", "rayleigh", "given", "dashpot", "heavy"),
    "contacts": (1, 2, 3, 4),
    "law": ("rigid", "compliant", "mixed"),
    "gaps": ("zero", "small", "mixed", "preload"),
    "sides": ("below", "above", "between", "facing", "rows", "mixed"),
    "modes": ("all", "all", "half", "few", "one"),
    "start": ("rest", "random", "moving", "striking", "leaving", "touching", "static"),
    "load": ("none", "none", "point", "gravity"),
}


@dataclass(frozen=True)
class Recipe:
    """What a case is made of, in words of CHOICES; ``seed`` gives every number."""

    seed: int
    structure: str = "chain"
    size: int = 3
    damping: str = "none"
    contacts: int = 1
    law: str = "rigid"
    gaps: str = "small"
    sides: str = "below"
    modes: str = "all"
    start: str = "moving"
    load: str = "none"


def recipes(**fixed):
    """A hypothesis strategy; ``fixed`` narrows choices, each to one word or to a tuple of words."""
    drawn = {name: st.sampled_from(options) for name, options in _options(fixed).items()}
    return st.builds(Recipe, seed=st.integers(0, 2**31), **drawn)


def recipe_of(number, **fixed):
    """The recipe with this number."""
    random = np.random.default_rng([number, 0])
    drawn = {name: options[int(random.integers(len(options)))] for name, options in _options(fixed).items()}
    return Recipe(seed=number, **drawn)


def plain_scene(number):
    """The scene with this number."""
    return replace(built(recipe_of(number)), number=number)


def built(recipe):
    """The scene of a recipe."""
    random = np.random.default_rng([recipe.seed, 1])
    mass, stiffness = _matrices(recipe.structure, recipe.size, random)
    n = len(mass)
    damping = _damping(recipe.damping, mass, stiffness, random)
    structure = LinearStructure(mass, stiffness, damping, {f"m{i}": i for i in range(n)})
    contacts = _no_clamps(structure, [_contact(recipe, i, n, random) for i in range(recipe.contacts)])
    model = MultiPhiModel(structure, contacts, modes=_modes(recipe.modes, n - len(contacts), random))
    loads = _loads(recipe.load, mass, random)
    displacement, velocity = _start(recipe.start, model, random)
    t_end = _duration(mass, stiffness, contacts)
    return Scene("plain", recipe.seed, model, t_end, displacement, velocity, loads, None, by_laws=True)


def cases(**fixed):
    """A hypothesis strategy of scenes."""
    return recipes(**fixed).map(built)


def _options(fixed):
    assert set(fixed) <= {f.name for f in fields(Recipe)}
    given = {name: value if isinstance(value, tuple) else (value,) for name, value in fixed.items()}
    return CHOICES | given


def _matrices(kind, n, random):
    """M, K (n, n)."""
    if "chain" in kind:
        springs = 10.0 ** random.uniform(0, 3, n)
        springs[0] *= kind != "free chain"
        following = np.r_[springs[1:], 0.0]
        stiffness = np.diag(springs + following) - np.diag(springs[1:], 1) - np.diag(springs[1:], -1)
        return np.diag(random.uniform(0.5, 2, n)), stiffness
    if kind == "unconnected":
        return np.diag(10.0 ** random.uniform(-2, 2, n)), np.diag(10.0 ** random.uniform(0, 10, n))
    root = random.normal(size=(n, n))
    mass = root @ root.T + np.eye(n)
    omega = 10.0 ** random.uniform(0, 3 if kind == "wide" else 1.5, n)
    if kind == "repeated":
        omega = omega[np.arange(n) // 2]
    if kind == "free dense":
        omega[: int(random.integers(1, min(n, 2) + 1))] = 0.0
    factor = scipy.linalg.cholesky(mass, lower=True) @ scipy.linalg.qr(random.normal(size=(n, n)))[0]
    stiffness = (factor * omega**2) @ factor.T
    return mass, (stiffness + stiffness.T) / 2


def _damping(kind, mass, stiffness, random):
    n = len(mass)
    if kind in ("modal", "heavy"):
        return ModalDamping(random.uniform(0, 0.2, n) if kind == "modal" else random.uniform(0.5, 3, n))
    if kind == "rayleigh":
        return RayleighDamping(0.3, 1e-3)
    if kind == "given":
        root = 0.3 * random.normal(size=(n, n))
        return root @ root.T + 0.1 * np.eye(n)
    if kind == "dashpot":
        row = random.normal(size=n)
        return np.outer(row, row)
    return None


def _contact(recipe, i, n, random):
    side, law = recipe.sides, recipe.law
    if side == "mixed":
        side = str(random.choice(["below", "above", "between", "rows"]))
    rigid = law == "rigid" or (law == "mixed" and random.random() < 0.5)
    stiffness = math.inf if rigid else 10.0 ** random.uniform(1, 9)
    gap = {"zero": 0.0, "small": float(random.uniform(0.01, 0.1)), "preload": float(random.uniform(-0.1, 0.1))}
    chosen = gap.get(recipe.gaps, float(random.choice([0.0, 0.02, 0.5])))
    return UnilateralContact(f"c{i}", _direction(side, i, n, random), abs(chosen) if rigid else chosen, stiffness)


def _no_clamps(structure, contacts):
    """Rigid contacts that face each other at one place stand apart."""
    rows = [structure.row(contact.direction) for contact in contacts]
    for i, contact in enumerate(contacts):
        facing = [k for k, other in enumerate(contacts) if other.rigid and np.array_equal(rows[k], -rows[i])]
        if contact.rigid and facing:
            contacts[i] = replace(contact, gap=max(contact.gap, CLAMPED))
    return contacts


def _direction(side, i, n, random):
    at, other = (int(k) for k in random.choice(n, 2, replace=n < 2))
    if side == "facing":
        return {f"m{i // 2 % n}": -1.0 if i % 2 else 1.0}
    if side == "rows":
        return random.normal(size=n)
    if side == "between" and at != other:
        return {f"m{at}": 1.0, f"m{other}": -1.0}
    return {f"m{at}": -1.0 if side == "above" else 1.0}


def _modes(kind, most, random):
    if kind == "all" or most < 1:
        return "all"
    return {"one": 1, "half": (most + 1) // 2, "few": int(random.integers(1, most + 1))}[kind]


def _loads(kind, mass, random):
    n = len(mass)
    if kind == "point":
        return (ConstantLoad(f"m{random.integers(n)}", float(10 * random.normal())),)
    return (ConstantLoad(mass @ np.ones(n), -9.81),) if kind == "gravity" else ()


def _start(kind, model, random):
    """x, x' (n,) that no rigid contact forbids; "striking", "leaving" and "touching": with one contact at zero gap."""
    n = model.structure.n
    displacement, velocity = np.zeros(n), 2 * random.normal(size=n)
    if kind == "rest":
        return displacement, np.zeros(n)
    if kind == "static":
        return _static(model, random), np.zeros(n)
    if kind == "moving":
        return displacement, velocity
    aim = 0.3 * random.normal(size=n)
    share, struck = _reach(model, aim)
    if kind == "random":
        return min(share, 1.0) * float(random.choice([0.999, 1.0])) * aim, velocity
    if struck is None:
        return displacement, velocity
    speed = float(struck @ velocity) / float(struck @ struck)
    wanted = {"striking": -abs(speed), "leaving": abs(speed), "touching": 0.0}[kind]
    return share * aim, velocity + (wanted - speed) * struck


def _reach(model, aim):
    """How far along ``aim`` the first rigid contact touches, as a share of it, and that contact's row."""
    share, struck = math.inf, None
    for contact in model.contacts:
        row = model.structure.row(contact.direction)
        way = -float(row @ aim)
        if contact.rigid and way > 0 and contact.gap / way < share:
            share, struck = contact.gap / way, row
    return (share, struck) if struck is not None else (0.0, None)


def _static(model, random):
    force = {f"m{random.integers(model.structure.n)}": float(10 * random.normal())}
    try:
        return model.static_equilibrium(force)
    except MultiPhiError:  # a rigid-body mode has no equilibrium
        return np.zeros(model.structure.n)


def _duration(mass, stiffness, contacts):
    omega = np.sqrt(np.maximum(scipy.linalg.eigh(stiffness, mass, eigvals_only=True), 0.0))
    elastic = omega[omega > 1e-6 * np.max(omega)]
    springs = [contact.stiffness for contact in contacts if not contact.rigid]
    bounce = math.sqrt(max(springs, default=0.0) / float(np.min(np.diagonal(mass))))
    longest = LONGEST / elastic[0] if len(elastic) else LONGEST / (2 * math.pi)
    shortest = SHORTEST / elastic[-1] if len(elastic) else math.inf
    return 2 * math.pi * float(min(longest, shortest, BOUNCES / bounce if bounce else math.inf))
