"""A run as its judge sees it (law_check.py): what it tells, what it was given, and what of that is round-off.

Sizes are those of the motion times the roots of the masses, so that a unit of length, time or mass changes no decision.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse

from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.damping import ModalDamping
from multiphi_exudyn.mechanics.element import Element
from multiphi_exudyn.mechanics.force_law import ForceLaw
from multiphi_exudyn.mechanics.friction import Friction
from multiphi_exudyn.mechanics.loads import ConstantLoad, Gravity, Load
from multiphi_exudyn.mechanics.structure import damping_matrix
from multiphi_exudyn.mechanics.time_functions import Harmonic
from multiphi_exudyn.study.given_motions import approximated, forces_at, stop_motion
from multiphi_exudyn.time.state import event_table
from multiphi_exudyn.time.trajectory import Trajectory

__all__ = ["NODES", "SHORTEST", "Inside", "JudgedRun"]

NODES = 6  # of Gauss quadrature, which integrates over an interval of at most one radian exactly
EVENTS = 20  # instants of events, and as many ends of segments
EVEN = 10  # further instants, for the size of the motion
INTERPOLATED = 1e-4  # of a sum's terms where a load is interpolated: to a tolerance of the motion, not of its force
REST = 1e-3  # of the farthest rest position of a level: displacements are sums with it, and have its round-off
FAR = 1e-2  # of the largest displacement: its round-off is that of what other masses do not move; of a load's largest
# force the same, where it is about zero
NO_MOTION = 1e-6  # of what the forces could move a free mass during the run: less is no motion
BRIEF = 1e-11  # of the run: an instant is no better resolved, nor a shorter bounce
BOUNCE = 1e-11  # of the largest displacement: a lower bounce may be no more resolved
SHORTEST = 1e-10  # of the run: a shorter segment is not looked into
SEGMENTS = 60  # segments that the grid all over a run covers: the first and the last ones
PER_PERIOD = 24  # of its instants in the shortest period, if there are as many
NEAR_END = 1e-9  # of a segment: how near to its ends the grid comes


@dataclass(frozen=True)
class Inside:
    """Intervals (k, 2) [s] within segments, their Gauss nodes times (k * NODES,) and weights, and there x, x', x''.

    contact, friction: N or -F, and T (k * NODES,) by names.
    """

    run: JudgedRun
    ends: np.ndarray
    times: np.ndarray
    weights: np.ndarray
    x: np.ndarray
    v: np.ndarray
    a: np.ndarray
    x_ends: np.ndarray
    v_ends: np.ndarray
    contact: dict[str, np.ndarray]
    friction: dict[str, np.ndarray]

    @cached_property
    def terms(self) -> np.ndarray:
        """Absolute terms (n, k * NODES) of the equation of motion over the roots of the masses (``_force_terms``)."""
        return _force_terms(self.run, self)

    def worst(self, values: np.ndarray) -> np.ndarray:
        """Largest absolute value (..., k * NODES) on the interval of every node, its ends not included."""
        shaped = np.abs(values).reshape(*values.shape[:-1], -1, NODES)
        return np.repeat(np.max(shaped, axis=-1), NODES, axis=-1)

    def per_interval(self, values: np.ndarray) -> np.ndarray:
        """Integral (..., k) over each interval of values (..., k * NODES) at the nodes."""
        return (values * self.weights).reshape(*values.shape[:-1], -1, NODES).sum(axis=-1)


class JudgedRun:
    """A trajectory with what it was given: matrices, rows and forces."""

    def __init__(
        self,
        trajectory: Trajectory,
        loads: tuple[Load, ...],
        start: tuple[np.ndarray, np.ndarray] | None,
        exact: float,
    ) -> None:
        self.trajectory, self.loads, self.start = trajectory, loads, start
        self.structure, self.elements = trajectory.model.structure, trajectory.model.contacts
        self.mass, self.stiffness = self.structure.mass, self.structure.stiffness
        self._kept: dict[tuple[int, ...], np.ndarray] = {}
        self.root = np.sqrt(np.asarray(self.mass.diagonal(), float))[:, None]
        self.asked = exact
        self.exact = max(exact, INTERPOLATED) if approximated(loads) else exact
        self.complete = trajectory.model.level(()).modes >= self.structure.n
        self.contacts = [element for element in self.elements if isinstance(element, UnilateralContact)]
        self.frictions = [element for element in self.elements if isinstance(element, Friction)]
        self.laws = [element for element in self.elements if isinstance(element, ForceLaw)]
        self.rough = [c for c in self.contacts if c.tangential is not None and c.most]
        self.pressing: list[UnilateralContact | ForceLaw] = [*self.contacts, *self.laws]
        self.rubbing: list[UnilateralContact | Friction] = [*self.rough, *self.frictions]
        self.springs: list[UnilateralContact | Friction] = [*self.contacts, *self.frictions]
        self.rows = {element.name: self.structure.row(element.direction) for element in self.elements}
        self.along = {c.name: self.structure.row(c.tangential) for c in self.rough if c.tangential is not None}
        self.along |= {friction.name: self.rows[friction.name] for friction in self.frictions}

    @cached_property
    def damping(self) -> np.ndarray | scipy.sparse.sparray | None:
        """C (n, n), None for none."""
        return damping_matrix(self.structure)

    @property
    def varies(self) -> bool:
        """Whether loads, stops or counter-surfaces move or change in time."""
        moves = any(getattr(e, "velocity", 0.0) or getattr(e, "tangential_velocity", 0.0) for e in self.elements)
        return moves or not all(isinstance(load, (ConstantLoad, Gravity)) for load in self.loads)

    @property
    def has_equation(self) -> bool:
        """Whether M, C and K are those of the motion: no measured levels, no damping that is known by modes alone."""
        modal = isinstance(self.structure.damping, ModalDamping) and scipy.sparse.issparse(self.stiffness)
        return not modal and not self.trajectory.model.overrides

    @cached_property
    def bounds(self) -> np.ndarray:
        """Starts and ends (s + 1,) of the segments [s]."""
        return np.append(self.trajectory.segments.starts, self.trajectory.t_end)

    @cached_property
    def instants(self) -> np.ndarray:
        """Times (k,) [s] of some events and of some ends of segments, at most EVENTS of each, and EVEN even ones.

        Without the end of the run, after which a trajectory tells no motion.
        """
        run = self.trajectory
        happened = event_table(run.events, run.model.index)[:, 0]
        chosen = [np.unique(times) for times in (happened, self.bounds)]
        chosen = [t[np.linspace(0, len(t) - 1, min(EVENTS, len(t))).astype(int)] for t in chosen]
        even = np.linspace(run.t_start, run.t_end, EVEN)
        near = np.abs(even[:, None] - np.concatenate(chosen)) < SHORTEST * run.t_end  # an event by round-off after it
        times = np.unique(np.concatenate([even[~np.any(near, axis=1)], *chosen]))
        return times[times < run.t_end]

    @property
    def has_both_sides(self) -> np.ndarray:
        """Whether (k,) both sides of the instants are known: not of the first one where the start is not given."""
        return (self.instants > self.trajectory.t_start) | (self.start is not None)

    @cached_property
    def x_sides(self) -> tuple[np.ndarray, np.ndarray]:
        """x (n, k) at the instants from the left and the right."""
        return self._sides(self.trajectory.displacement, 0)

    @cached_property
    def v_sides(self) -> tuple[np.ndarray, np.ndarray]:
        """x' (n, k) at the instants from the left and the right."""
        return self._sides(self.trajectory.velocity, 1)

    def _sides(self, values: Callable[..., Any], given: int) -> tuple[np.ndarray, np.ndarray]:
        left, right = (np.asarray(values(self.instants, side)) for side in ("left", "right"))
        first = self.instants <= self.trajectory.t_start
        left[:, first] = right[:, first] if self.start is None else np.asarray(self.start[given], float)[:, None]
        return left, right

    @cached_property
    def length(self) -> float:
        """Largest sqrt(M_ii) |x_i| at the instants and way of a counter-surface, and what no motion is [m sqrt(kg)]."""
        largest = float(np.max(np.abs(self.root * self.x_sides[1]), initial=0.0))
        belts = [friction.velocity for friction in self.frictions] + [c.tangential_velocity for c in self.rough]
        carried = float(np.max(np.abs(belts), initial=0.0)) * float(np.max(self.root))
        velocity = NO_MOTION * float(np.max(np.abs(self.root * self.v_sides[1]), initial=0.0)) + self.idle
        rests = [self.trajectory._asymptotic(level) for level in self.trajectory.segments.levels]
        far = max(float(np.max(np.abs(self.root.ravel() * rest), initial=0.0)) for rest in rests)
        return largest + REST * far + (carried + velocity) * self.trajectory.t_end

    @cached_property
    def speed(self) -> float:
        """Largest sqrt(M_ii) |x'_i| at the instants, and what no motion is [m/s sqrt(kg)]."""
        return float(np.max(np.abs(self.root * np.hstack(self.v_sides)), initial=0.0)) + self.idle

    @cached_property
    def acceleration(self) -> float:
        """What the forces do at most to free masses [m/s2 sqrt(kg)]."""
        x, v = np.abs(self.x_sides[1]), np.maximum(*np.abs(self.v_sides))
        forces = sum((np.abs(f) for f in self.forces(self.instants)), abs(self.stiffness) @ x)
        if self.has_equation and self.damping is not None:
            forces = forces + abs(self.damping) @ v
        pushing = [(friction.name, friction.most) for friction in self.frictions]
        pushing += [(law.name, float(np.max(np.abs(law.force(self.rows[law.name] @ x))))) for law in self.laws]
        pushing += [(c.name, c.stiffness * self._deepest(c)) for c in self.contacts if math.isfinite(c.stiffness)]
        for name, force in pushing:
            forces = forces + force * np.abs(self.rows[name])[:, None]
        return float(np.max(forces / self.root, initial=0.0))

    def _deepest(self, contact: UnilateralContact) -> float:
        """How far [m] an instant is inside a stop, at most."""
        return float(np.max(-np.asarray(self.trajectory.gap(contact.name, self.instants)), initial=0.0))

    @property
    def idle(self) -> float:
        """The part of what the forces could do to free masses during the run that is no motion [m/s sqrt(kg)]."""
        return NO_MOTION * self.acceleration * self.trajectory.t_end

    @cached_property
    def smallest_bounce(self) -> float:
        """Velocity [m/s sqrt(kg)] of bounces that are no longer resolved, as their height is round-off.

        Of displacements from equilibria too, to which the forces could move the structure.
        """
        slowest = 0.0 if self.laws else 2 * np.pi * float(np.min(self.trajectory.model.level(()).frequencies))
        reach = self.length + self.acceleration * min(self.trajectory.t_end, 1 / max(slowest, 1e-300)) ** 2
        return float(np.sqrt(BOUNCE * reach * self.acceleration)) + BRIEF * self.acceleration * self.trajectory.t_end

    def grid(self, samples: int) -> tuple[np.ndarray, np.ndarray]:
        """Times (k,) [s] inside the first and the last segments, and the segment (k,) of each."""
        wide = np.flatnonzero(np.diff(self.bounds) > SHORTEST * self.trajectory.t_end)
        half = SEGMENTS // 2
        chosen = np.concatenate([wide[:half], wide[max(half, len(wide) - half) :]])
        lengths = np.diff(self.bounds)[chosen]
        needed = 8 + PER_PERIOD * lengths * self.fastest / (2 * np.pi)
        counts = np.maximum(8, needed * min(1.0, samples / np.sum(needed))).astype(int)
        owner = np.repeat(chosen, counts)
        inside = np.concatenate([np.clip(np.linspace(0, 1, count), NEAR_END, 1 - NEAR_END) for count in counts])
        return self.bounds[owner] + inside * np.diff(self.bounds)[owner], owner

    def forces(self, times: np.ndarray) -> list[np.ndarray]:
        """Forces (n, k) of every load."""
        return forces_at(self.structure, self.loads, times, self.trajectory.t_end)

    def stop(self, contact: UnilateralContact, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """z, z' (k,) of its stop."""
        return stop_motion(self.structure, contact, self.loads, times, self.trajectory.t_end)

    @cached_property
    def fastest(self) -> float:
        """A bound of the rates of the motion [rad/s]."""
        rates = [2 * np.pi * self.trajectory.model.highest_frequency, 1e-300]
        if self.has_equation and self.damping is not None:
            rates.append(float(np.max(abs(self.damping).sum(axis=1) / self.root.ravel() ** 2)))
        rates += [element.damping * self._mobility(element.name) for element in self.elements if element.damping]
        courses = [getattr(load, "course", None) for load in self.loads]
        rates += [2 * np.pi * course.frequency_hz for course in courses if isinstance(course, Harmonic)]
        return max(rates)

    def _mobility(self, name: str) -> float:
        return float(np.sum((self.rows[name] / self.root.ravel()) ** 2))

    def inside(self, intervals: int, random: np.random.Generator) -> Inside | None:
        """Intervals of at most one radian within segments: half of them anywhere, half in segments taken at random."""
        run, bounds = self.trajectory, self.bounds
        lengths = np.diff(bounds)
        wide = np.flatnonzero(lengths > SHORTEST * run.t_end)
        if not len(wide):
            return None
        anywhere = random.uniform(bounds[0], bounds[-1], intervals // 2)
        owners = np.searchsorted(bounds, anywhere, side="right") - 1
        chosen = np.concatenate([owners, random.choice(wide, intervals - len(owners))])
        chosen = chosen[np.isin(chosen, wide)]
        width = np.minimum(0.9 * lengths[chosen], 1.0 / self.fastest)
        first = bounds[chosen] + 0.05 * lengths[chosen]
        first = first + random.uniform(0, 1, len(chosen)) * (0.9 * lengths[chosen] - width)
        order = np.argsort(first, kind="stable")
        ends = np.column_stack([first, first + width])[order]
        nodes, weights = np.polynomial.legendre.leggauss(NODES)
        half = np.diff(ends, axis=1) / 2
        times = (ends.mean(axis=1)[:, None] + half * nodes).ravel()
        contacts = [element.name for element in self.pressing]
        return Inside(
            run=self,
            ends=ends,
            times=times,
            weights=(half * weights).ravel(),
            x=run.displacement(times),
            v=run.velocity(times),
            a=np.asarray(run.acceleration(times)),
            x_ends=run.displacement(ends.ravel()).reshape(self.structure.n, -1, 2),
            v_ends=run.velocity(ends.ravel()).reshape(self.structure.n, -1, 2),
            contact={name: np.asarray(run.contact_force(name, times)) for name in contacts},
            friction={name: np.asarray(run.friction_force(name, times)) for name in self.along},
        )

    def length_of(self, contact: UnilateralContact, x: np.ndarray, z: np.ndarray) -> np.ndarray:
        """What of a contact's gaps (k,) [m] at x (n, k) is round-off."""
        largest = self.length * float(np.max(np.abs(self.rows[contact.name]) / self.root.ravel()))
        return self.exact * (np.max(self.contact_terms(contact, x) + np.abs(z)) + FAR * largest)

    def contact_terms(self, element: Element, x: np.ndarray) -> np.ndarray:
        """Absolute terms (k,) of h.x + gap."""
        return np.abs(self.rows[element.name]) @ np.abs(x) + abs(element.gap)

    def kept_modes(self, t: float) -> np.ndarray:
        """Modes (n, r) of the level at an instant."""
        level = self.trajectory.segments[int(np.searchsorted(self.bounds, t, side="right")) - 1].level.modal
        if level.indices not in self._kept:
            self._kept[level.indices] = level.base.modes.shapes @ level.inertial
        return self._kept[level.indices]


def _force_terms(run: JudgedRun, inside: Inside) -> np.ndarray:
    """Absolute terms (n, k) of the equation of motion over the roots of the masses: also those that springs make.

    A load that passes through zero has there the round-off of its course, and balances forces that have it too.
    """
    x, v, a = (inside.worst(values) for values in (inside.x, inside.v, inside.a))
    terms = abs(run.mass) @ a + abs(run.stiffness) @ x
    for here, anywhere in zip(run.forces(inside.times), run.forces(run.instants), strict=True):
        terms = terms + np.maximum(np.abs(here), FAR * np.max(np.abs(anywhere), axis=1, initial=0.0)[:, None])
    if run.has_equation and run.damping is not None:
        terms = terms + abs(run.damping) @ v
    for law in run.laws:
        reach = run.contact_terms(law, x) + np.max(np.abs(law.knots))
        terms = terms + np.abs(run.rows[law.name])[:, None] * (np.max(np.abs(law.slopes)) * reach)
    for element in run.springs:
        row = np.abs(run.rows[element.name])
        if np.isfinite(element.stiffness):
            terms = terms + row[:, None] * (element.stiffness * run.contact_terms(element, x))
        terms = terms + row[:, None] * (element.damping * (row @ v))
    for contact in run.rough:
        if np.isfinite(contact.tangential_stiffness):
            row = np.abs(run.along[contact.name])
            terms = terms + row[:, None] * (contact.tangential_stiffness * (row @ x))
    for rows, told in ((run.rows, inside.contact), (run.along, inside.friction)):
        for name, force in told.items():
            terms = terms + np.abs(rows[name])[:, None] * inside.worst(force)
    return terms / run.root
