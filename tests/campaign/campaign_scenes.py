"""Random scenes of what users bring, one kind each: loads, moving stops and bases, dampers, force laws, free bodies.

``scene_of(kind, number)`` draws a scene from its kind and number alone; a new kind does not change what others draw.
A scene holds the arguments of ``simulate`` and the same system in plain numbers for brute force (brute_force.py). Each
has an answer: no start lies inside a rigid stop, and rigid stops do not contradict each other.
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

import brute_force as bf
import numpy as np
import scipy.linalg

import multiphi_exudyn as mp

KINDS = (
    "harmonic",
    "sampled",
    "functions",
    "sweeps",
    "several",
    "rigid",
    "moving stops",
    "moving bases",
    "viscous",
    "tables",
    "laws",
    "truncated",
    "redundant",
    "moving redundant",
    "free",
    "assembled",
    "clamps",
    "units",
    "restarts",
)
UNITS = 40  # most powers of two by which time, length and mass are scaled
SHORTEST = 60.0  # periods of the fastest level that a scene lasts, at most
NARROWEST = 1e-5  # of the run: a load of one peak


@dataclass(frozen=True)
class Scene:
    """Arguments of one run, the system for brute force, and what is asked of both.

    shown, frame: x of the run and of brute force are compared as shown x_run and frame x_brute_force.
    split: instants at which a run is ended and begun again. units: powers of two of time, length and mass.
    """

    kind: str
    number: int
    model: mp.MultiPhiModel
    t_end: float
    displacement: np.ndarray
    velocity: np.ndarray
    loads: tuple
    system: bf.System | None
    start: tuple[np.ndarray, np.ndarray] | None = None
    shown: Any = None
    frame: np.ndarray | None = None
    split: Sequence[float] = ()
    units: tuple[int, int, int] = (0, 0, 0)


def scene_of(kind, number):
    """The scene of this kind with this number."""
    seeds = [number, *kind.encode(), 14]
    return replace(_DRAWN[kind](np.random.default_rng(seeds)), kind=kind, number=number)


def scaled(scene):
    """(model, t_end, displacement, velocity, loads) in the scene's units."""
    if scene.units == (0, 0, 0):
        return scene.model, scene.t_end, scene.displacement, scene.velocity, scene.loads
    time, length, mass = (2.0**power for power in scene.units)
    return _in_units(scene, time, length, mass)


# ---------------------------------------------------------------------- parts of scenes


@dataclass
class _Parts:
    """What a scene is put together of."""

    random: np.random.Generator
    mass: np.ndarray
    stiffness: np.ndarray
    damping: Any = None
    matrix: np.ndarray | None = None
    contacts: list = field(default_factory=list)
    stops: list = field(default_factory=list)
    laws: list = field(default_factory=list)
    loads: list = field(default_factory=list)
    forces: list = field(default_factory=list)
    constant: np.ndarray | float = 0.0

    @property
    def n(self):
        return len(self.mass)

    @property
    def end(self):
        """Some periods of the slowest motion, not too many of the fastest."""
        if not hasattr(self, "_end"):
            stiff = self.stiffness.copy()
            for stop in self.stops:
                if np.isfinite(stop.stiffness):
                    stiff += stop.stiffness * np.outer(stop.row, stop.row)
            for _, law in self.laws:
                stiff += 0.3 * np.max(np.abs(np.diff(law.forces) / np.diff(law.knots))) * np.outer(law.row, law.row)
            omega = np.sqrt(np.maximum(scipy.linalg.eigh(stiff, self.mass, eigvals_only=True), 0))
            own = np.sqrt(np.maximum(scipy.linalg.eigh(self.stiffness, self.mass, eigvals_only=True), 0))
            slow = np.min(own[own > 1e-3], initial=2.0)
            self._end = 2 * math.pi * min(float(self.random.uniform(2, 5)) / slow, SHORTEST / max(omega[-1], slow))
        return self._end

    def contact(self, row, gap, stiffness=math.inf, damping=0.0):
        row, name = np.asarray(row, float), f"c{len(self.contacts)}"
        self.contacts.append(mp.UnilateralContact(name, row, gap, stiffness, damping))
        self.stops.append(bf.Stop(row, gap, stiffness, damping))

    def load(self, row, made, course):
        self.loads.append(made)
        self.forces.append((np.asarray(row, float), course))

    def move(self, i, course, made):
        self.loads.append(mp.StopMotion(f"c{i}", made))
        self.stops[i] = replace(self.stops[i], course=course)

    def scene(self, displacement=None, velocity=None, modes="all", structure=None, **more):
        zero = np.zeros(self.n)
        end = self.end
        structure = structure or mp.LinearStructure(
            self.mass, self.stiffness, self.damping, {f"m{i}": i for i in range(self.n)}
        )
        law_items = [law for law, _ in self.laws]
        model = mp.MultiPhiModel(structure, [*self.contacts, *law_items], modes=modes)
        matrix = np.zeros_like(self.mass) if self.matrix is None else self.matrix
        system = bf.System(
            self.mass, matrix, self.stiffness, self.stops, [law for _, law in self.laws], self.forces, self.constant
        )
        displacement = zero if displacement is None else displacement
        velocity = zero if velocity is None else velocity
        return Scene("", 0, model, end, displacement, velocity, tuple(self.loads), system, **more)


def _parts(random, n=None, *, free=False, damping=None, structure=None):
    """A chain, or a dense structure, of frequencies not far apart, with some damping."""
    n = n or int(random.integers(1, 5))
    if (structure or random.choice(["chain", "dense"])) == "chain":
        springs = 10.0 ** random.uniform(0.5, 1.8, n)
        springs[0] *= not free
        following = np.r_[springs[1:], 0.0]
        stiffness = np.diag(springs + following) - np.diag(springs[1:], 1) - np.diag(springs[1:], -1)
        parts = _Parts(random, np.diag(random.uniform(0.5, 2, n)), stiffness)
    else:
        root = 0.5 * random.normal(size=(n, n))
        mass = root @ root.T + np.eye(n)
        omega = 10.0 ** random.uniform(0.2, 1.0, n)
        omega[: int(free)] = 0.0
        factor = np.linalg.cholesky(mass) @ scipy.linalg.qr(random.normal(size=(n, n)))[0]
        stiffness = (factor * omega**2) @ factor.T
        parts = _Parts(random, mass, (stiffness + stiffness.T) / 2)
    return _damped(parts, damping or str(random.choice(["none", "rayleigh", "modal", "given", "dashpot"])))


def _damped(parts, kind):
    random, n = parts.random, parts.n
    if kind == "rayleigh":
        alpha, beta = float(random.uniform(0, 0.3)), float(random.uniform(0, 5e-3))
        parts.damping, parts.matrix = mp.RayleighDamping(alpha, beta), alpha * parts.mass + beta * parts.stiffness
    elif kind == "modal":
        ratios = random.uniform(0, 0.1, n)
        square, shapes = scipy.linalg.eigh(parts.stiffness, parts.mass)
        factor = parts.mass @ shapes
        parts.damping = mp.ModalDamping(ratios)
        parts.matrix = (factor * (2 * ratios * np.sqrt(np.maximum(square, 0)))) @ factor.T
    elif kind in ("given", "dashpot"):
        root = 0.3 * random.normal(size=(n, n if kind == "given" else 1))
        parts.damping = parts.matrix = root @ root.T
    return parts


def _rows(parts, count, kinds=("one", "one", "between", "any")):
    """Rows of contacts, no two of them alike or opposite."""
    rows = []
    while len(rows) < count:
        kind = str(parts.random.choice(kinds)) if parts.n > 1 else "one"
        row = np.zeros(parts.n)
        if kind == "any":
            row = parts.random.normal(size=parts.n)
        else:
            at = parts.random.choice(parts.n, min(2, parts.n), replace=False)
            row[at[0]] = float(parts.random.choice([-1, 1]))
            if kind == "between":
                row[at[1]] = -row[at[0]]
        if parts.n == 1 or all(abs(row @ r) < 0.99 * np.linalg.norm(row) * np.linalg.norm(r) for r in rows):
            rows.append(row)
        elif len(rows) >= parts.n:
            break
    return rows


def _contacts(parts, law="compliant", count=None, gap=(0.02, 0.3)):
    """One to three contacts at places of their own."""
    random = parts.random
    for row in _rows(parts, count or int(random.integers(1, min(3, parts.n) + 1))):
        rigid = law == "rigid" or (law == "mixed" and random.random() < 0.5)
        stiffness = math.inf if rigid else float(10.0 ** random.uniform(1, 3.5))
        damping = 0.0
        if law == "viscous":
            damping = float(stiffness**0.5 * 10.0 ** random.uniform(-2, 0.5))
        parts.contact(row, float(random.uniform(*gap)), stiffness, damping)


def _random_row(parts):
    row = parts.random.normal(size=parts.n)
    return row if parts.random.random() < 0.3 else np.eye(parts.n)[int(parts.random.integers(parts.n))]


def _moving(parts, share=1.0):
    return share * parts.random.normal(size=parts.n)


def _frequencies(parts):
    """[Hz] of the open structure and of it with one contact closed."""
    found = []
    for extra in (None, *parts.stops):
        stiff = parts.stiffness
        if extra is not None and np.isfinite(extra.stiffness):
            stiff = stiff + extra.stiffness * np.outer(extra.row, extra.row)
        square = scipy.linalg.eigh(stiff, parts.mass, eigvals_only=True)
        found += [math.sqrt(s) / (2 * math.pi) for s in square if s > 1e-6]
    return found or [0.5]


def _wave(parts, amplitude, frequency=None):
    """A harmonic course, the same in both worlds; resonant ones among them."""
    random = parts.random
    if frequency is None:
        resonant = random.random() < 0.4
        frequency = float(random.choice(_frequencies(parts))) if resonant else float(10.0 ** random.uniform(-1, 0.7))
    phase = float(random.choice([0.0, -math.pi / 2, random.uniform(0, 6)]))
    omega = 2 * math.pi * frequency
    course = bf.Course(
        lambda t: amplitude * np.cos(omega * t + phase),
        lambda t: -amplitude * omega * np.sin(omega * t + phase),
        lambda t: -amplitude * omega**2 * np.cos(omega * t + phase),
        step=bf.STEP / omega,
    )
    return (amplitude, frequency, phase), course


def _strength(parts):
    """[N] of a load that moves the structure by a few of its gaps."""
    return float(10.0 ** parts.random.uniform(0, 1.2))


def _harmonic_load(parts):
    row, (numbers, course) = _random_row(parts), _wave(parts, _strength(parts))
    parts.load(row, mp.HarmonicLoad(row, *numbers), course)


def _constant_load(parts, strength=None):
    row = _random_row(parts)
    force = float((strength or 5.0) * parts.random.normal())
    parts.loads.append(mp.ConstantLoad(row, force))
    parts.constant = parts.constant + force * row


def _gravity(parts):
    row, g = np.sign(parts.random.normal(size=parts.n)), 9.81 * float(parts.random.choice([-1, 1, 0.1]))
    parts.loads.append(mp.Gravity(row, g))
    parts.constant = parts.constant + g * (parts.mass @ row)


def _samples(parts, end):
    """Times and values: few or thousands, steps, a start or an end inside the run."""
    random, kind = parts.random, str(parts.random.choice(["few", "many", "thousands", "steps", "window"]))
    if kind == "few":
        time = np.r_[0.0, np.sort(random.uniform(0, end, int(random.integers(1, 12)))), 1.1 * end]
        return time, random.normal(size=len(time))
    if kind == "steps":
        jumps, width = np.sort(random.uniform(0.05, 0.9, int(random.integers(1, 5)))) * end, 1e-6 * end
        jumps = jumps[np.r_[True, np.diff(jumps) > 2 * width]]
        values = random.normal(size=len(jumps) + 1)
        return np.r_[0.0, np.c_[jumps, jumps + width].ravel(), 2 * end], np.repeat(values, 2)
    first, last = (0.2 * end, 0.7 * end) if kind == "window" else (0.0, end)
    count = {"many": 200, "thousands": 3000, "window": 50}[kind]
    time = np.linspace(first, last, count)
    omega = 2 * math.pi * float(random.uniform(0.2, 1.5))
    return time, np.sin(omega * time + random.uniform(0, 6)) + 0.05 * random.normal(size=count)


def _sampled_load(parts):
    row, size = _random_row(parts), _strength(parts)
    time, values = _samples(parts, parts.end)
    values = size * values
    course = bf.Course(lambda t: np.interp(t, time, values, left=0.0, right=0.0), breaks=tuple(time))
    parts.load(row, mp.SampledLoad(row, time, values), course)


def _function_load(parts):
    row, size, end = _random_row(parts), _strength(parts), parts.end
    random = parts.random
    kind = str(random.choice(["narrow", "peaks", "stepped", "smooth", "smooth"]))
    if kind == "stepped":
        at = float(random.uniform(0.1, 0.9)) * end
        more = {"breaks": (at,)} if "breaks" in {f.name for f in fields(mp.FunctionLoad)} else {}
        load = mp.FunctionLoad(row, lambda t: size if t < at else 0.0, **more)
        parts.load(row, load, bf.Course(lambda t: np.where(t < at, size, 0.0), breaks=(at,)))
        return
    if kind == "smooth":
        a, b, c = random.uniform(0.5, 8), random.uniform(0, 6), random.uniform(0, 1.0)
        parts.load(
            row,
            mp.FunctionLoad(row, lambda t: size * np.sin(a * t + b) * np.exp(-c * t)),
            bf.Course(lambda t: size * np.sin(a * t + b) * np.exp(-c * t), step=bf.STEP / (a + c)),
        )
        return
    places = random.uniform(0.05, 0.8, 1 if kind == "narrow" else 3) * end
    width = end * 10.0 ** random.uniform(math.log10(NARROWEST), -1.5)
    size *= min(0.3 / width, 1e3) * 0.3

    def pulses(t):
        return sum(size * np.exp(-0.5 * ((t - place) / width) ** 2) for place in places)

    fine = tuple((place - 9 * width, place + 9 * width, width) for place in places)
    parts.load(row, mp.FunctionLoad(row, pulses), bf.Course(pulses, fine=fine))


def _swept(parts, amplitude, end):
    random = parts.random
    first, last = 10.0 ** random.uniform(-0.7, 0.8, 2)
    duration = end * float(random.choice([0.6, 1.0, 1.3]))
    law = str(random.choice(["linear", "logarithmic"]))
    octaves = math.log(last / first)
    slope = (last - first) / duration

    def hertz(t):
        return first + slope * t if law == "linear" else first * np.exp(octaves * t / duration)

    def phase(t):
        if law == "linear":
            return 2 * math.pi * (first * t + slope * t**2 / 2)
        return 2 * math.pi * first * duration / octaves * (np.exp(octaves * t / duration) - 1)

    def rising(t):
        return slope if law == "linear" else hertz(t) * octaves / duration

    def on(t):
        return t <= duration

    def value(t):
        return np.where(on(t), amplitude * np.cos(phase(t)), 0.0)

    def rate(t):
        return np.where(on(t), -amplitude * 2 * math.pi * hertz(t) * np.sin(phase(t)), 0.0)

    def acceleration(t):
        omega, change = 2 * math.pi * hertz(t), 2 * math.pi * rising(t)
        return np.where(on(t), -amplitude * (omega**2 * np.cos(phase(t)) + change * np.sin(phase(t))), 0.0)

    course = bf.Course(value, rate, acceleration, breaks=(duration,), step=bf.STEP / (2 * math.pi * max(first, last)))
    return (amplitude, float(first), float(last), duration, law), course


def _sweep_load(parts):
    row = _random_row(parts)
    numbers, course = _swept(parts, _strength(parts), parts.end)
    parts.load(row, mp.SweepLoad(row, *numbers), course)


def _way(parts, amplitude, *, whole=True):
    """(course of the package, course) of a stop or a base; whole: it lasts, so that its speed never jumps."""
    kind = str(parts.random.choice(["harmonic", "harmonic", "smooth", "sweep"]))
    if kind == "harmonic":
        numbers, course = _wave(parts, amplitude, float(10.0 ** parts.random.uniform(-1, 0.4)))
        return mp.Harmonic(*numbers), course
    if kind == "sweep":
        numbers, course = _swept(parts, amplitude, 2.2 * parts.end if whole else parts.end)
        return mp.Sweep(*numbers), course
    a, b = parts.random.uniform(0.5, 5, 2)
    made = mp.Smooth(lambda t: amplitude * np.sin(a * t) * np.cos(b * t))
    course = bf.Course(
        lambda t: amplitude * np.sin(a * t) * np.cos(b * t),
        lambda t: amplitude * (a * np.cos(a * t) * np.cos(b * t) - b * np.sin(a * t) * np.sin(b * t)),
        lambda t: (
            -amplitude * ((a**2 + b**2) * np.sin(a * t) * np.cos(b * t) + 2 * a * b * np.cos(a * t) * np.sin(b * t))
        ),
        step=bf.STEP / (a + b),
    )
    return made, course


def _off_stops(parts, displacement):
    """The start moved to where no rigid stop is entered: gaps are widened by what is missing."""
    for i, (contact, stop) in enumerate(zip(parts.contacts, parts.stops, strict=True)):
        gap = float(stop.row @ displacement) + stop.gap
        if stop.course is not None:
            gap -= float(stop.course.value(np.zeros(1))[0])
        if gap < 0.01 and (contact.rigid or stop.course is not None):
            parts.contacts[i] = replace(contact, gap=contact.gap - gap + 0.01)
            parts.stops[i] = replace(stop, gap=stop.gap - gap + 0.01)


# ---------------------------------------------------------------------- kinds


def _loaded(add, law=("compliant", "compliant", "mixed")):
    def drawn(random):
        parts = _parts(random)
        _contacts(parts, str(random.choice(law)))
        add(parts)
        start = _moving(parts) if random.random() < 0.6 else np.zeros(parts.n)
        return parts.scene(velocity=start)

    return drawn


def _several(random):
    parts = _parts(random)
    _contacts(parts, str(random.choice(["compliant", "mixed", "rigid"])))
    adders = [_harmonic_load, _constant_load, _gravity, _sampled_load, _sweep_load]
    for k in random.choice(len(adders), int(random.integers(2, 5))):
        adders[k](parts)
    return parts.scene(velocity=_moving(parts))


def _rigid(random):
    parts = _parts(random)
    _contacts(parts, "rigid")
    (_gravity if random.random() < 0.3 else _harmonic_load)(parts)
    return parts.scene(velocity=_moving(parts))


def _moving_stops(random):
    parts = _parts(random)
    law = str(random.choice(["rigid", "compliant", "viscous", "mixed"]))
    _contacts(parts, law)
    for i in range(len(parts.contacts)):
        if i == 0 or random.random() < 0.5:
            made, course = _way(parts, float(random.uniform(0.02, 0.3)))
            parts.move(i, course, made)
    if random.random() < 0.3:
        _constant_load(parts)
    _off_stops(parts, np.zeros(parts.n))
    return parts.scene(velocity=_moving(parts))


def _moving_bases(random):
    parts = _parts(random)
    _contacts(parts, str(random.choice(["rigid", "compliant", "mixed"])))
    row = np.ones(parts.n) if random.random() < 0.7 else random.normal(size=parts.n)
    made, course = _way(parts, float(random.uniform(0.05, 0.4)))
    fixed = [i for i in range(len(parts.contacts)) if random.random() < 0.4]
    parts.loads.append(mp.BaseMotion(row, made, tuple(f"c{i}" for i in fixed)))
    parts.forces.append((-parts.mass @ row, replace(course, value=course.acceleration)))
    for i in fixed:
        parts.stops[i] = replace(parts.stops[i], course=_times(course, -float(parts.stops[i].row @ row)))
    _off_stops(parts, np.zeros(parts.n))
    return parts.scene(velocity=_moving(parts, float(random.choice([0.0, 1.0]))))


def _times(course, factor):
    return replace(
        course,
        value=lambda t: factor * course.value(t),
        rate=lambda t: factor * course.rate(t),
        acceleration=lambda t: factor * course.acceleration(t),
    )


def _viscous(random):
    parts = _parts(random)
    _contacts(parts, "viscous", gap=(0.0, 0.2))
    if random.random() < 0.5:
        random.choice([_harmonic_load, _gravity, _constant_load])(parts)
    return parts.scene(velocity=_moving(parts))


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
    parts = _parts(random)
    row = _rows(parts, 1)[0]
    soft = 1 / float(row @ np.linalg.solve(parts.stiffness, row))
    knots, forces = _table(random, min(soft, 100.0))
    parts.laws.append((mp.ForceLaw(row, (knots, forces), name="law"), bf.Law(row, knots, forces)))
    if random.random() < 0.3:
        _contacts(parts, "compliant", 1)
    if random.random() < 0.4:
        random.choice([_harmonic_load, _constant_load])(parts)
    return parts.scene(velocity=_moving(parts))


def _laws(random):
    """Functions; brute force follows the same straight segments, which the judge compares with the function."""
    parts = _parts(random)
    row, kind = _rows(parts, 1)[0], str(random.choice(["cubic", "softening", "tanh", "one-sided", "bistable"]))
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
        random.choice([_harmonic_load, _constant_load])(parts)
    return parts.scene(velocity=_moving(parts))


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
    parts = _Parts(random, mass, (stiffness + stiffness.T) / 2)
    if random.random() < 0.4:
        ratios = np.full(n, 0.03)
        parts.damping = mp.ModalDamping(ratios)
    _contacts(parts, str(random.choice(["compliant", "rigid", "mixed"])), int(random.integers(1, min(3, n - 1) + 1)))
    if random.random() < 0.3:
        _harmonic_load(parts)
    modes = int(random.integers(1, n - len(parts.contacts) + 1))
    return replace(parts.scene(velocity=_moving(parts), modes=modes), system=None)


def _alike(random):
    """One to three masses with two to four rigid contacts of dependent or nearly parallel rows."""
    parts = _parts(random, int(random.integers(1, 4)))
    row = _rows(parts, 1)[0]
    other = _rows(parts, 1)[0]
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
        (_gravity if random.random() < 0.5 else _harmonic_load)(parts)
    return parts.scene(velocity=_moving(parts))


def _moving_redundant(random):
    parts = _alike(random)
    for i in range(len(parts.contacts)):
        if i == 0 or random.random() < 0.4:
            made, course = _way(parts, float(random.uniform(0.02, 0.2)))
            parts.move(i, course, made)
    if random.random() < 0.4:
        _constant_load(parts)
    _off_stops(parts, np.zeros(parts.n))
    return parts.scene(velocity=_moving(parts))


def _free(random):
    """Bodies that nothing holds, dashpots between them or to the ground."""
    parts = _parts(random, int(random.integers(1, 5)), free=True, damping="none")
    c = np.zeros((parts.n, parts.n))
    for row in _rows(parts, int(random.integers(1, 3)), ("one", "between")):
        c += float(10.0 ** random.uniform(-1, 0.7)) * np.outer(row, row)
    parts.damping = parts.matrix = c
    _contacts(parts, str(random.choice(["compliant", "rigid", "mixed"])))
    if random.random() < 0.6:
        random.choice([_gravity, _constant_load, _harmonic_load])(parts)
    units = (int(random.integers(-UNITS // 2, UNITS // 2 + 1)), 0, 0) if random.random() < 0.5 else (0, 0, 0)
    return parts.scene(velocity=_moving(parts), units=units)


def _assembled(random):
    """Two chains with contacts between them, tied or not; brute force has the ties' null space of its own."""
    kinds = [str(random.choice(["none", "rayleigh", "given"])) for _ in range(2)]
    pair = [_parts(random, int(random.integers(1, 4)), damping=kind) for kind in kinds]
    structures = [mp.LinearStructure(p.mass, p.stiffness, p.damping, {f"m{i}": i for i in range(p.n)}) for p in pair]
    total = pair[0].n + pair[1].n
    tie = total > 3 and random.random() < 0.5
    ties = [{"a.m0": 1.0, "b.m0": -1.0 if random.random() < 0.5 else -0.7}] if tie else []
    whole = mp.assemble(dict(zip("ab", structures, strict=True)), ties)
    full = [
        scipy.linalg.block_diag(*(m(p) for p in pair)) for m in (lambda p: p.mass, _matrix_of, lambda p: p.stiffness)
    ]
    frame = np.eye(total)
    if tie:
        held = np.zeros((1, total))
        held[0, 0], held[0, pair[0].n] = 1.0, ties[0]["b.m0"]
        frame = scipy.linalg.null_space(held)
    parts = _Parts(random, *(frame.T @ full[k] @ frame for k in (0, 2)))
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
    numbers, course = _wave(parts, _strength(parts))
    parts.load(frame.T @ np.eye(total)[-1], mp.HarmonicLoad(f"b.m{pair[1].n - 1}", *numbers), course)
    velocity = random.normal(size=parts.n)
    first = np.asarray(frame @ velocity)[whole.free] if tie else velocity
    shown = np.asarray(whole.transformation.toarray())
    scene = parts.scene(structure=whole)
    zero = np.zeros(whole.n)
    start = np.zeros(parts.n), velocity
    return replace(scene, displacement=zero, velocity=first, start=start, shown=shown, frame=frame)


def _matrix_of(parts):
    return np.zeros_like(parts.mass) if parts.matrix is None else parts.matrix


def _clamps(random):
    """Gaps and speeds that are zero by structure."""
    kind = str(random.choice(["clamp", "mirror", "resting", "touching", "preload"]))
    if kind == "mirror":
        return _mirror(random)
    parts = _parts(random, int(random.integers(1, 4)), structure="chain" if kind == "clamp" else None)
    row = np.eye(parts.n)[0]
    law = str(random.choice(["rigid", "rigid", "compliant"]))
    stiffness = math.inf if law == "rigid" else 100.0
    if kind == "clamp":
        parts.contact(row, 0.0, stiffness)
        parts.contact(-row, 0.0, stiffness)
        _harmonic_load(parts)
        return parts.scene(velocity=_moving(parts) * (parts.n > 1) * (np.arange(parts.n) > 0))
    parts.contact(row, 0.0, stiffness)
    if kind == "resting":
        _harmonic_load(parts)
        return parts.scene()
    if kind == "touching":
        return parts.scene(velocity=_moving(parts) * (np.arange(parts.n) > 0))
    _gravity(parts)
    return parts.scene(velocity=np.where(np.arange(parts.n) > 0, _moving(parts), 0.0))


def _mirror(random):
    """A structure that is its own mirror image: two stops are struck together."""
    mass, k, between = float(random.uniform(0.5, 2)), *(float(v) for v in random.uniform(5, 50, 2))
    parts = _Parts(
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
    scene = _DRAWN[str(random.choice(kinds))](random)
    powers = tuple(int(k) for k in random.integers(-UNITS, UNITS + 1, 3))
    return replace(scene, units=powers)


def _restarts(random):
    parts = _parts(random)
    _contacts(parts, str(random.choice(["rigid", "compliant", "viscous", "mixed"])))
    if random.random() < 0.7:
        random.choice([_harmonic_load, _gravity, _constant_load])(parts)
    scene = parts.scene(velocity=_moving(parts))
    split = np.sort(random.uniform(0.05, 0.95, int(random.integers(1, 4)))) * scene.t_end
    return replace(scene, split=tuple(float(t) for t in split))


_DRAWN = {
    "harmonic": _loaded(_harmonic_load),
    "sampled": _loaded(_sampled_load),
    "functions": _loaded(_function_load, ("compliant",)),
    "sweeps": _loaded(_sweep_load),
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
}
assert tuple(_DRAWN) == KINDS


# ---------------------------------------------------------------------- units


def _in_units(scene, time, length, mass):
    """The scene's arguments, times in units of 1/time s and so on: numbers are multiplied by powers of two."""
    model, stiff = scene.model, mass / time**2
    force = stiff * length
    old = model.structure
    damping = old.damping
    if isinstance(damping, mp.RayleighDamping):
        damping = mp.RayleighDamping(damping.alpha / time, damping.beta * time)
    elif isinstance(damping, np.ndarray):
        damping = damping * (mass / time)
    points = dict(old.points)
    structure = mp.LinearStructure(old.mass * mass, old.stiffness * stiff, damping, points)
    contacts = []
    for item in _items(model):
        if isinstance(item, mp.ForceLaw):
            contacts.append(mp.ForceLaw(item.at, (item.knots * length, item.forces * force), name=item.name))
        else:
            changed = {"stiffness": item.stiffness * stiff, "damping": item.damping * mass / time}
            contacts.append(replace(item, gap=item.gap * length, **changed))
    loads = tuple(_load_in_units(load, time, length, mass, force) for load in scene.loads)
    return (
        mp.MultiPhiModel(structure, contacts, modes=model.modes),
        scene.t_end * time,
        scene.displacement * length,
        scene.velocity * (length / time),
        loads,
    )


def _items(model):
    """Contacts and laws as they were given."""
    laws = dict.fromkeys(contact.law for contact in model.contacts if hasattr(contact, "law"))
    return [*(contact for contact in model.contacts if not hasattr(contact, "law")), *laws]


def _load_in_units(load, time, length, mass, force):
    if isinstance(load, mp.ConstantLoad):
        return replace(load, force=load.force * force)
    if isinstance(load, mp.Gravity):
        return replace(load, acceleration=load.acceleration * length / time**2)
    if isinstance(load, mp.HarmonicLoad):
        return replace(load, amplitude=load.amplitude * force, frequency_hz=load.frequency_hz / time)
    if isinstance(load, mp.SampledLoad):
        return mp.SampledLoad(load.at, load.time * time, load.force * force)
    return replace(load, course=_course_in_units(load.course, time, length))


def _course_in_units(course, time, length):
    if isinstance(course, mp.Harmonic):
        return mp.Harmonic(course.amplitude * length, course.frequency_hz / time, course.phase)
    if isinstance(course, mp.Smooth):
        return mp.Smooth(lambda t: length * course.function(t / time), course.tolerance)
    hertz = course.start_hz / time, course.end_hz / time
    return mp.Sweep(course.amplitude * length, *hertz, course.duration * time, course.law, course.tolerance)


def later(load, t):
    """The load as it goes on after t, for a run that begins there."""
    if isinstance(load, mp.HarmonicLoad):
        return replace(load, phase=load.phase + 2 * math.pi * load.frequency_hz * t)
    return load


def numbers(kinds, first, count):
    """(kind, number) of ``count`` cases spread evenly over kinds, numbers from ``first`` on."""
    return list(itertools.islice(((kind, k) for k in itertools.count(first) for kind in kinds), count))
