"""Systems for brute force: matrices, rows and functions of time come in, motion goes out."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np


class NoAnswer(Exception):
    """The integrator gives up: too many events, or no admissible set of contacts."""


@dataclass(frozen=True)
class Course:
    """u(t), u'(t), u''(t) of (k,) times; fine: (t0, t1, step) of shorter steps; breaks: where u is not smooth."""

    value: Callable
    rate: Callable | None = None
    acceleration: Callable | None = None
    breaks: tuple = ()
    fine: tuple = ()
    step: float = np.inf


@dataclass(frozen=True)
class Stop:
    """A contact: row h, gap [m], stiffness k and damping c; course of its stop.

    restitution: e of a rigid one, the same of all that are struck together.
    """

    row: np.ndarray
    gap: float
    stiffness: float = np.inf
    damping: float = 0.0
    course: Course | None = None
    restitution: float = 0.0


@dataclass(frozen=True)
class Law:
    """A force law along a row: F through (knots, forces)."""

    row: np.ndarray
    knots: np.ndarray
    forces: np.ndarray


@dataclass(frozen=True)
class Slider:
    """Dry friction |T| <= F along a row, which slides past a counter-surface of ``velocity`` [m/s] or on a course.

    F = limit [N], or limit times the force of the contact number ``contact``; static_limit: at which it begins to slip.
    stiffness: of a spring in series [N/m].
    """

    row: np.ndarray
    limit: float
    static_limit: float
    stiffness: float = np.inf
    velocity: float = 0.0
    course: Course | None = None
    contact: int | None = None


@dataclass(frozen=True)
class System:
    """M, C, K (n, n), contacts, laws, sliders, loads [(row, course)]."""

    mass: np.ndarray
    damping: np.ndarray
    stiffness: np.ndarray
    stops: Sequence[Stop] = ()
    laws: Sequence[Law] = ()
    sliders: Sequence[Slider] = ()
    loads: Sequence[tuple[np.ndarray, Course]] = ()
    constant: np.ndarray | float = 0.0


@dataclass
class Answer:
    """x, x' (n, k) at the times asked for, events [(time, item, state)], impulses (c,), energy lost by impacts.

    Items are contacts, laws and sliders, in this order. slipped: way that every slider has slid [m], (f,).
    rubbed: energy that those of constant limits have lost [J].
    length, speed: of the scene, what its gaps, start, stops and loads make [m, m/s].
    """

    displacement: np.ndarray
    velocity: np.ndarray
    events: list = field(default_factory=list)
    impulse: np.ndarray | None = None
    slipped: np.ndarray | None = None
    rubbed: float = 0.0
    impact: float = 0.0
    length: float = 0.0
    speed: float = 0.0
