"""A linearisation beside its Exudyn system: how far the two disagree at one state of a motion.

    d_i = m_i.(a_full - a) / max(omega_i^2, rate^2),   error = sqrt((|c| + |d|)^2 + |shift|_M^2) / size

q_0 + S z + c, S z' is put into the system (full_system.py). a_full [m/s2] is what the system then does, a what the
linear structure does at z, both under the same contact forces and loads. m_i, omega_i [rad/s] are momenta and circular
frequencies of the structure's modes, rate [rad/s] and size are |z'|_M / |z|_M and |z|_M = sqrt(z.M z) of the motion, at
their largest. d is how far the difference moves the modes: the static response of those that are stiff, an oscillation
at the motion's rate else. shift is what the state has to be moved by to meet the constraints.

A beam that bends gets a little shorter: by straight motions alone it would be stretched, with forces beyond measure.
Modes that are fast beside the motion are therefore relaxed to their own balance first, the stiffest before the others:
c grows by their d, stage after stage. The error is the least of all stages, and 0 for a linear system.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import scipy.linalg

from multiphi_exudyn.exudyn_plugin.convert.full_system import FullSystem
from multiphi_exudyn.exudyn_plugin.convert.timed_loads import TimedLoad

__all__ = ["Compared", "Extent", "Idle", "Linearisation", "Sphere"]

FAST = 10.0  # times the rate of the motion: a mode that is faster follows it in balance, to a hundredth
TOUCHING = 1e-9  # of the reach: a gap that is closed
ASIDE = 1e-3  # of the reach, by which directions that are left out are tried
STAGES = 7  # of relaxation: what couples stiff modes to soft ones spans many decades of stiffness


@dataclass(frozen=True)
class Extent:
    """Largest values of a motion: reach, |q - q_0| of one coordinate [m, rad]; size, |z|_M; rate, |z'|_M / |z|_M."""

    reach: float
    size: float
    rate: float


@dataclass(frozen=True, eq=False)
class Sphere:
    """A contact of a sphere at q_0: index of its object, gap [m], unit normal (3,)."""

    index: int
    gap: float
    normal: np.ndarray


@dataclass(frozen=True, eq=False)
class Idle:
    """Directions that a linearisation is without, because nothing moves the system there.

    shapes U (n_full, k) of unit mass, momenta M U (n_full, k), of: what is wrong with them.
    """

    shapes: np.ndarray
    momenta: np.ndarray
    of: str


@dataclass(frozen=True, eq=False)
class Linearisation:
    """M z'' + C z' + K z = static + (contacts and loads by functions of time), q = displacement + basis z.

    mass, damping, stiffness (n, n), static (n,): the system's own, without contacts. basis S (n_full, n).
    displacement, velocity (n_full,): q_0 and v_0 at the time [s]. largest: of the system's coordinates [m, rad].
    symmetrised: of which matrices the other part is left out, a sentence each. idle: directions that are left out,
    if there are any. contacts: rows (n_full,) by name.
    spheres: by name, the contacts whose direction is that of q_0.
    loads, forces: of the system and of its objects, by index.
    """

    mass: np.ndarray
    damping: np.ndarray
    stiffness: np.ndarray
    static: np.ndarray
    basis: np.ndarray
    displacement: np.ndarray
    velocity: np.ndarray
    time: float
    largest: float
    symmetrised: tuple[str, ...] = ()
    idle: Idle | None = None
    contacts: Mapping[str, np.ndarray] = field(default_factory=dict)
    spheres: Mapping[str, Sphere] = field(default_factory=dict)
    loads: Mapping[int, TimedLoad] = field(default_factory=dict)
    forces: Mapping[int, TimedLoad] = field(default_factory=dict)

    @functools.cached_property
    def modes(self) -> tuple[np.ndarray, np.ndarray]:
        """omega^2 (n,) >= 0 and shapes (n, n) of unit modal mass."""
        squares, shapes = scipy.linalg.eigh(self.stiffness, self.mass)
        return np.maximum(squares, 0.0), shapes

    def size(self, z: np.ndarray) -> np.ndarray:
        """|z|_M of (n,) or of every column of (n, k)."""
        return np.asarray(np.sqrt(np.maximum(np.sum(z * (self.mass @ z), axis=0), 0.0)))

    @contextmanager
    def beside(self, mbs: Any) -> Iterator[Compared]:
        """This linearisation beside its system, which is left as it was."""
        with FullSystem.opened(mbs, self.displacement, self.velocity, self.time) as full:
            yield Compared(self, full)


class Compared:
    """A linearisation and its system, as ``Linearisation.beside`` gives them."""

    def __init__(self, linear: Linearisation, full: FullSystem) -> None:
        self._linear, self._full = linear, full

    def error(
        self,
        z: np.ndarray,
        z_t: np.ndarray,
        extent: Extent,
        enough: float,
        time: float = 0.0,
        contacts: Mapping[str, float] | None = None,
    ) -> tuple[float, np.ndarray]:
        """The error at displacement and velocity (n,), at a time [s] of the run, and c + d (n,) by modes.

        contacts: forces [N] of contacts and frictions by name. enough: an error that is small; stiff modes relax only
        as long as it is larger.
        """
        linear = self._linear
        nothing = np.zeros(len(linear.displacement))
        pushed = sum((f * linear.contacts[name] for name, f in (contacts or {}).items()), nothing)
        force = linear.static + linear.basis.T @ (pushed + self._driven(time))
        force = force - linear.stiffness @ z - linear.damping @ z_t
        squares, shapes = linear.modes
        relaxed, least, away = np.zeros(len(z)), math.inf, np.zeros(len(z))
        for softest in _stages(squares, extent.rate):
            displacement = linear.displacement + linear.basis @ (z + shapes @ relaxed)
            moved = self._full.moved(displacement, linear.basis @ z_t, pushed, extent.reach)
            more = shapes.T @ (linear.mass @ (linear.basis.T @ moved.accelerations) - force)
            drift = more / np.maximum(squares, extent.rate**2)
            aside = 0.0 if linear.idle is None else linear.idle.momenta.T @ moved.accelerations / extent.rate**2
            found = math.hypot(np.linalg.norm(relaxed) + np.linalg.norm(drift), moved.shift, np.linalg.norm(aside))
            if found < least:
                least, away = float(found), relaxed + drift
            if least <= enough * extent.size:
                break
            relaxed = relaxed + np.where(squares >= softest, drift, 0.0)
        return least / extent.size, away

    def stiffening(self, z: np.ndarray, reach: float) -> np.ndarray:
        """Symmetric part of the stiffness (k, k) [1/s2] in the directions that are left out, at z; none: k = 0."""
        linear = self._linear
        if linear.idle is None:
            return np.zeros((0, 0))
        place, still = linear.displacement + linear.basis @ z, np.zeros(len(linear.displacement))
        pulled = []
        for shape in linear.idle.shapes.T:
            step = ASIDE * reach / float(np.max(np.abs(shape)))
            ends = [self._full.moved(place + sign * step * shape, still, still, reach) for sign in (-1, 1)]
            pulled.append(linear.idle.momenta.T @ (ends[0].accelerations - ends[1].accelerations) / (2 * step))
        found = np.array(pulled)
        return (found + found.T) / 2

    def turned(self, z: np.ndarray, reach: float) -> float:
        """Twice the angle [rad] by which contacts of spheres that touch have turned since q_0.

        A sphere that moves sideways by s, at a distance L of the centres, turns by s / L, and so does its impulse. With
        the speeds along and across it of one size, an impact is off by twice that.
        """
        linear = self._linear
        if not linear.spheres:
            return 0.0
        moved, still = linear.basis @ z, np.zeros(len(linear.displacement))
        self._full.moved(linear.displacement + moved, still, still, reach)
        angles = [0.0]
        for name, sphere in linear.spheres.items():
            gap, normal = self._full.touch(sphere.index)
            if min(gap, sphere.gap + linear.contacts[name] @ moved) <= TOUCHING * reach:
                angles.append(float(np.linalg.norm(normal - sphere.normal)))
        return 2 * max(angles)

    def _driven(self, time: float) -> np.ndarray:
        """Give the system its time and its loads by functions of it; what of it acts in the linearisation (n_full,)."""
        self._full.set_time(self._linear.time + time)
        for index, load in self._linear.loads.items():
            self._full.load(index, load.value(time))
        acting = (*self._linear.loads.values(), *self._linear.forces.values())
        return sum((each.value(time) @ each.rows for each in acting), np.zeros(len(self._linear.displacement)))


def _stages(squares: np.ndarray, rate: float) -> np.ndarray:
    """The softest omega^2 (n,) that relaxes in each stage, stiffest first; the last one only looks."""
    highest, softest = float(squares[-1]), (FAST * rate) ** 2
    if highest <= softest:
        return np.array([math.inf])
    return np.append(np.geomspace(highest, softest, STAGES), math.inf)
