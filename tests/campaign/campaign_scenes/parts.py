"""What a scene is put together of: structures, rows, contacts, in the words of the package and of brute force."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import brute_force as bf
import numpy as np
import scipy.linalg

import multiphi_exudyn as mp

NEAR = 1e-6  # of the largest value: two motions are the same
SHORTEST = 60.0  # periods of the fastest level that a scene lasts, at most


@dataclass(frozen=True)
class Joint:
    """Masses of one coordinate in Exudyn, x_other = ratio x_one; velocity: x' that they are given; x = tied q.

    stop: number of a mass, gap [m] and stiffness [N/m].
    """

    mass: np.ndarray
    stiffness: np.ndarray
    velocity: np.ndarray
    tied: np.ndarray
    one: int
    other: int
    ratio: float
    stop: tuple[int, float, float]


@dataclass(frozen=True)
class Scene:
    """Arguments of one run, the system for brute force, and what is asked of both.

    shown, frame: x of the run and of brute force are compared as shown x_run and frame x_brute_force.
    split: instants at which a run is ended and begun again. units: powers of two of time, length and mass. by_laws:
    whether the answer need not be unique, and is judged by the law check alone. near: how far the run and brute force
    may be apart, of the largest value. in_exudyn: how a body is judged (campaign_bodies.py); steps: of it; joint: of a
    system to be reduced.
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
    by_laws: bool = False
    near: float = NEAR
    in_exudyn: str = ""
    steps: int = 0
    joint: Joint | None = None


@dataclass
class Parts:
    """What a scene is put together of."""

    random: np.random.Generator
    mass: np.ndarray
    stiffness: np.ndarray
    damping: Any = None
    matrix: np.ndarray | None = None
    contacts: list = field(default_factory=list)
    stops: list = field(default_factory=list)
    laws: list = field(default_factory=list)
    frictions: list = field(default_factory=list)
    sliders: list = field(default_factory=list)
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
            for slider in self.sliders:
                if np.isfinite(slider.stiffness):
                    stiff += slider.stiffness * np.outer(slider.row, slider.row)
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

    def slider(self, row, limit, static_limit, stiffness=math.inf, velocity=0.0):
        row, name = np.asarray(row, float), f"f{len(self.frictions)}"
        self.frictions.append(mp.Friction(name, row, limit, static_limit, stiffness, velocity))
        self.sliders.append(bf.Slider(row, limit, static_limit, stiffness, velocity))

    def rub(self, i, row, friction, static_friction, stiffness=math.inf, velocity=0.0):
        """Friction of the contact number i along a row."""
        row, spring = np.asarray(row, float), {"tangential_stiffness": stiffness, "tangential_velocity": velocity}
        coefficients = {"friction": friction, "static_friction": static_friction}
        self.contacts[i] = replace(self.contacts[i], tangential=row, **coefficients, **spring)
        self.sliders.append(bf.Slider(row, friction, static_friction, stiffness, velocity, contact=i))

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
        model = mp.MultiPhiModel(structure, [*self.contacts, *law_items, *self.frictions], modes=modes)
        matrix = np.zeros_like(self.mass) if self.matrix is None else self.matrix
        system = bf.System(
            self.mass,
            matrix,
            self.stiffness,
            self.stops,
            [law for _, law in self.laws],
            self.sliders,
            self.forces,
            self.constant,
        )
        displacement = zero if displacement is None else displacement
        velocity = zero if velocity is None else velocity
        return Scene("", 0, model, end, displacement, velocity, tuple(self.loads), system, **more)


def random_parts(random, n=None, *, free=False, damping=None, structure=None):
    """A chain, or a dense structure, of frequencies not far apart, with some damping."""
    n = n or int(random.integers(1, 5))
    if (structure or random.choice(["chain", "dense"])) == "chain":
        springs = 10.0 ** random.uniform(0.5, 1.8, n)
        springs[0] *= not free
        following = np.r_[springs[1:], 0.0]
        stiffness = np.diag(springs + following) - np.diag(springs[1:], 1) - np.diag(springs[1:], -1)
        parts = Parts(random, np.diag(random.uniform(0.5, 2, n)), stiffness)
    else:
        root = 0.5 * random.normal(size=(n, n))
        mass = root @ root.T + np.eye(n)
        omega = 10.0 ** random.uniform(0.2, 1.0, n)
        omega[: int(free)] = 0.0
        factor = np.linalg.cholesky(mass) @ scipy.linalg.qr(random.normal(size=(n, n)))[0]
        stiffness = (factor * omega**2) @ factor.T
        parts = Parts(random, mass, (stiffness + stiffness.T) / 2)
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


def random_rows(parts, count, kinds=("one", "one", "between", "any")):
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


def add_contacts(parts, law="compliant", count=None, gap=(0.02, 0.3)):
    """One to three contacts at places of their own."""
    random = parts.random
    for row in random_rows(parts, count or int(random.integers(1, min(3, parts.n) + 1))):
        rigid = law == "rigid" or (law == "mixed" and random.random() < 0.5)
        stiffness = math.inf if rigid else float(10.0 ** random.uniform(1, 3.5))
        damping = 0.0
        if law == "viscous":
            damping = float(stiffness**0.5 * 10.0 ** random.uniform(-2, 0.5))
        parts.contact(row, float(random.uniform(*gap)), stiffness, damping)


def random_row(parts):
    row = parts.random.normal(size=parts.n)
    return row if parts.random.random() < 0.3 else np.eye(parts.n)[int(parts.random.integers(parts.n))]


def random_velocity(parts, share=1.0):
    return share * parts.random.normal(size=parts.n)


def damping_of(parts):
    return np.zeros_like(parts.mass) if parts.matrix is None else parts.matrix


def widen_gaps(parts, displacement):
    """The start moved to where no rigid stop is entered: gaps are widened by what is missing."""
    for i, (contact, stop) in enumerate(zip(parts.contacts, parts.stops, strict=True)):
        gap = float(stop.row @ displacement) + stop.gap
        if stop.course is not None:
            gap -= float(stop.course.value(np.zeros(1))[0])
        if gap < 0.01 and (contact.rigid or stop.course is not None):
            parts.contacts[i] = replace(contact, gap=contact.gap - gap + 0.01)
            parts.stops[i] = replace(stop, gap=stop.gap - gap + 0.01)
