"""Comparison of a linearisation with its Exudyn system, at one state of a motion.

    d_i = m_i.(a_full - a) / max(omega_i^2, rate^2),   error = sqrt((|c| + |d|)^2 + |shift|_M^2) / size

The state q_0 + S z + s + c, S z' + s' is set in the system (full_system.py), s the motion that constraints prescribe
(prescribed_motion.py). a_full [m/s2] are accelerations of the system without s'', a those of the linear structure at z,
under the same contact forces and loads. m_i, omega_i [rad/s] are momenta and
circular frequencies of the structure's modes; rate [rad/s] and size are the largest |z'|_M / |z|_M and
|z|_M = sqrt(z.M z) of the motion. d is the modal displacement by the difference: the static response of stiff modes,
and an oscillation at the motion's rate of the others. shift is the correction by which the state meets the constraints.

A bending beam gets a little shorter. With linear motions alone it would be stretched, by very large forces. Therefore
modes that are fast compared with the motion first relax to equilibrium, the stiffest before the others: c grows by
their d in every stage. The error is the smallest of all stages, and 0 for a linear system.
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

from multiphi_exudyn.exudyn_plugin.convert.linearisation.full_system import FullSystem
from multiphi_exudyn.exudyn_plugin.convert.linearisation.prescribed_motion import PrescribedMotion
from multiphi_exudyn.exudyn_plugin.convert.linearisation.timed_loads import TimedLoad

__all__ = ["Comparison", "Linearisation", "MotionScales", "MovedBy", "Sphere", "UnmovedDirections"]

FAST = 10.0  # times the rate of the motion: a faster mode follows it in equilibrium, with an error of 1 %
TOUCHING = 1e-9  # of the largest displacement: a smaller gap counts as closed
ASIDE = 1e-3  # of the largest displacement: step in directions that are left out
STAGES = 7  # of relaxation, as stiffnesses span many decades


@dataclass(frozen=True)
class MotionScales:
    """Largest values of a motion: displacement |q - q_0| of a coordinate [m, rad]; size |z|_M; rate |z'|_M / |z|_M."""

    displacement: float
    size: float
    rate: float


@dataclass(frozen=True, eq=False)
class Sphere:
    """A contact of a sphere at q_0: index of its object, gap [m], unit normal (3,)."""

    index: int
    gap: float
    normal: np.ndarray


@dataclass(frozen=True, eq=False)
class MovedBy:
    """A prescribed motion in a linearisation: M e^T (n_full, k), S^T K e^T and S^T C e^T (n, k)."""

    motion: PrescribedMotion
    momenta: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray

    def force(self, t: float) -> np.ndarray:
        """p (n,) = -S^T (K e^T u + C e^T u')."""
        force = -self.stiffness @ self.motion.derivative(t, 0)
        return np.asarray(force - self.damping @ self.motion.derivative(t, 1) if np.any(self.damping) else force)


@dataclass(frozen=True, eq=False)
class UnmovedDirections:
    """Directions that a linearisation leaves out, because no force or motion of the system has a part in them.

    shapes U (n_full, k) of unit mass, momenta M U (n_full, k), reason: why the structure cannot contain them.
    """

    shapes: np.ndarray
    momenta: np.ndarray
    reason: str


@dataclass(frozen=True, eq=False)
class Linearisation:
    """M z'' + C z' + K z = static + (contacts and loads by functions of time), q = displacement + basis z + s(t).

    mass, damping, stiffness (n, n), static (n,): of the system without contacts. basis: S (n_full, n).
    displacement, velocity (n_full,): q_0 and v_0 at the time [s], which meet the constraints. largest: of the system's
    coordinates [m, rad].
    symmetrised: a sentence for each matrix whose skew part is left out. unmoved: directions that are left out, if any.
    contacts: rows (n_full,) by name. spheres: contacts of spheres by name, which keep their direction at q_0. loads,
    forces: of the system and of its objects, by index. moved: by constraints that prescribe a motion s(t), by index.
    shift: largest distance [m, rad] of q_0 from the system's own state, which violated these constraints.
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
    unmoved: UnmovedDirections | None = None
    contacts: Mapping[str, np.ndarray] = field(default_factory=dict)
    spheres: Mapping[str, Sphere] = field(default_factory=dict)
    loads: Mapping[int, TimedLoad] = field(default_factory=dict)
    forces: Mapping[int, TimedLoad] = field(default_factory=dict)
    moved: Mapping[int, MovedBy] = field(default_factory=dict)
    shift: float = 0.0
    violated: tuple[str, ...] = ()

    @functools.cached_property
    def modes(self) -> tuple[np.ndarray, np.ndarray]:
        """omega^2 (n,) >= 0 and shapes (n, n) of unit modal mass."""
        squares, shapes = scipy.linalg.eigh(self.stiffness, self.mass)
        return np.maximum(squares, 0.0), shapes

    def size(self, z: np.ndarray) -> np.ndarray:
        """Norm |z|_M of z (n,) or of every column of (n, k)."""
        return np.asarray(np.sqrt(np.maximum(np.sum(z * (self.mass @ z), axis=0), 0.0)))

    def prescribed(self, t: float, order: int = 0) -> np.ndarray:
        """s, s' or s'' (n_full,) at t [s] of a run, by the order of the derivative."""
        parts = (moved.motion.derivative(t, order) @ moved.motion.directions for moved in self.moved.values())
        return sum(parts, np.zeros(len(self.displacement)))

    def prescribed_size(self, t: float, order: int = 0) -> float:
        """|s|_M, |s'|_M or |s''|_M at t [s] of a run."""
        parts = (moved.momenta @ moved.motion.derivative(t, order) for moved in self.moved.values())
        return math.sqrt(max(self.prescribed(t, order) @ sum(parts, np.zeros(len(self.displacement))), 0.0))

    @contextmanager
    def compared_with(self, mbs: Any) -> Iterator[Comparison]:
        """Comparison of this linearisation with its system, which is restored afterwards."""
        with FullSystem.opened(mbs, self.displacement, self.velocity, self.time) as full:
            yield Comparison(self, full)


class Comparison:
    """A linearisation and its system, inside the context of ``Linearisation.compared_with``."""

    def __init__(self, linear: Linearisation, full: FullSystem) -> None:
        self._linear, self._full = linear, full

    def error(
        self,
        z: np.ndarray,
        z_t: np.ndarray,
        scales: MotionScales,
        tolerance: float,
        time: float = 0.0,
        contacts: Mapping[str, float] | None = None,
    ) -> tuple[float, np.ndarray]:
        """The error at displacement and velocity (n,), at a time [s] of the run, and c + d (n,) by modes.

        contacts: forces [N] of contacts and frictions by name. tolerance: stiff modes relax only while the error is
        larger. The error is infinite where the system has no accelerations, as its mass is singular, or no finite ones.
        """
        linear = self._linear
        zero = np.zeros(len(linear.displacement))
        contact_forces = sum((f * linear.contacts[name] for name, f in (contacts or {}).items()), zero)
        force = linear.static + linear.basis.T @ (contact_forces + self._set_time_loads(time))
        force = force - linear.stiffness @ z - linear.damping @ z_t
        force = force + sum((moved.force(time) for moved in linear.moved.values()), np.zeros(len(z)))
        position = linear.displacement + linear.prescribed(time)
        velocity = linear.basis @ z_t + linear.prescribed(time, 1)
        driven = linear.prescribed(time, 2)
        prescribed = linear.prescribed(time, 1) - linear.prescribed(0.0, 1), driven
        squares, shapes = linear.modes
        relaxed, least, deviation = np.zeros(len(z)), math.inf, np.zeros(len(z))
        for softest in _stages(squares, scales.rate):
            displacement = position + linear.basis @ (z + shapes @ relaxed)
            try:
                state = self._full.accelerations_at(
                    displacement, velocity, contact_forces, scales.displacement, prescribed
                )
            except np.linalg.LinAlgError:
                break
            free = state.accelerations - driven
            difference = shapes.T @ (linear.mass @ (linear.basis.T @ free) - force)
            drift = difference / np.maximum(squares, scales.rate**2)
            aside = 0.0 if linear.unmoved is None else linear.unmoved.momenta.T @ free / scales.rate**2
            error = math.hypot(np.linalg.norm(relaxed) + np.linalg.norm(drift), state.shift, np.linalg.norm(aside))
            if error < least:
                least, deviation = float(error), relaxed + drift
            if least <= tolerance * scales.size:
                break
            relaxed = relaxed + np.where(squares >= softest, drift, 0.0)
        return least / scales.size, deviation

    def unmoved_stiffness(self, z: np.ndarray, scale: float, time: float = 0.0) -> np.ndarray:
        """Symmetric part of the stiffness (k, k) [1/s2] in directions that are left out, at z; k = 0 without any."""
        linear = self._linear
        if linear.unmoved is None:
            return np.zeros((0, 0))
        self._full.set_time(linear.time + time)
        position = linear.displacement + linear.prescribed(time) + linear.basis @ z
        zero = np.zeros(len(position))
        columns = []
        for shape in linear.unmoved.shapes.T:
            step = ASIDE * scale / float(np.max(np.abs(shape)))
            try:
                ends = [
                    self._full.accelerations_at(position + sign * step * shape, zero, zero, scale) for sign in (-1, 1)
                ]
            except np.linalg.LinAlgError:  # the error of this state is infinite already
                return np.zeros((linear.unmoved.shapes.shape[1],) * 2)
            columns.append(linear.unmoved.momenta.T @ (ends[0].accelerations - ends[1].accelerations) / (2 * step))
        stiffness = np.array(columns)
        return (stiffness + stiffness.T) / 2

    def impact_error(self, z: np.ndarray, scale: float, time: float = 0.0) -> float:
        """Relative error of impacts of spheres: twice the largest rotation [rad] of a closed contact's normal.

        If a sphere moves sideways by s, at a distance L of the centres, its normal turns by s / L, and so does its
        impulse. With equal speeds along and across the normal, the error of an impact is twice that.
        """
        linear = self._linear
        if not linear.spheres:
            return 0.0
        self._full.set_time(linear.time + time)
        change, zero = linear.basis @ z + linear.prescribed(time), np.zeros(len(linear.displacement))
        try:
            self._full.accelerations_at(linear.displacement + change, zero, zero, scale)
        except np.linalg.LinAlgError:
            return math.inf
        angles = [0.0]
        for name, sphere in linear.spheres.items():
            gap, normal = self._full.gap_and_normal(sphere.index)
            if min(gap, sphere.gap + linear.contacts[name] @ change) <= TOUCHING * scale:
                angles.append(float(np.linalg.norm(normal - sphere.normal)))
        return 2 * max(angles)

    def _set_time_loads(self, time: float) -> np.ndarray:
        """Set time and timed loads of the system; return the generalised force (n_full,) that the linearisation has."""
        self._full.set_time(self._linear.time + time)
        for index, load in self._linear.loads.items():
            self._full.load(index, load.value(time))
        timed = (*self._linear.loads.values(), *self._linear.forces.values())
        return sum((each.value(time) @ each.rows for each in timed), np.zeros(len(self._linear.displacement)))


def _stages(squares: np.ndarray, rate: float) -> np.ndarray:
    """Lowest omega^2 (n,) that relaxes in each stage, stiffest first; in the last one none relaxes."""
    highest, softest = float(squares[-1]), (FAST * rate) ** 2
    if highest <= softest:
        return np.array([math.inf])
    return np.append(np.geomspace(highest, softest, STAGES), math.inf)
