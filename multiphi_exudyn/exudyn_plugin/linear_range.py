"""Linear range: whether a reduced motion stays where the linearisation of its Exudyn system holds.

    d_i = m_i.(a_full - a) / max(omega_i^2, rate^2),   error = sqrt((|c| + |d|)^2 + |shift|_M^2) / size

At a few times of a run the state q_0 + S z + s + c, S z' + s' is set in the system, s the motion that constraints
prescribe (timed.py). a_full [m/s2] are accelerations of the system without s'', a those of the linear structure at z,
under the same contact forces and loads. m_i, omega_i [rad/s] are momenta and circular frequencies of the structure's
modes; rate [rad/s] and size are the largest |z'|_M / |z|_M and |z|_M = sqrt(z.M z) of the motion. d is the modal
displacement by the difference: the static response of stiff modes, and an oscillation at the motion's rate of the
others. shift is the correction by which the state meets the constraints. The system, without its contacts, obeys

    M(q) a = f(q, v) + force - C(q)^T mu,   C(q) a = -(d C(q)/dt) v + C(q_0) s''
    g(q, t) = g(q_0, t_0),   C(q) v = C(q_0) (v_0 + s' - s'_0)

A bending beam gets a little shorter. With linear motions alone it would be stretched, by very large forces. Therefore
modes that are fast compared with the motion first relax to equilibrium, the stiffest before the others: c grows by
their d in every stage. The error is the smallest of all stages, and 0 for a linear system.

A system cannot be pickled. A pickled check has limits instead: for each of the lowest modes, the amplitude up to which
it alone, with the velocity that belongs to it, stays within ``TOLERANCE``.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from typing import Any

import exudyn as exu
import numpy as np
import scipy.linalg

from multiphi_exudyn.display import per_cent
from multiphi_exudyn.exudyn_plugin.contacts import Sphere
from multiphi_exudyn.exudyn_plugin.items import value_key
from multiphi_exudyn.exudyn_plugin.matrices import (
    DIFFERENTIATED,
    UnmovedDirections,
    forces,
    geometric_stiffness,
    largest_coordinate,
    matrices_of_moved_directions,
    rounded_product,
    spring_row,
    springs_with_factors,
    without_stiffness,
)
from multiphi_exudyn.exudyn_plugin.system import (
    Directions,
    changed,
    constraint_jacobian,
    generalised_forces,
    initial_is_current,
    items_of,
    mass_matrix,
    on_velocities,
    residuals,
    sphere_gap,
    static_solver,
    without_contacts,
)
from multiphi_exudyn.exudyn_plugin.timed import PrescribedMotion, TimedLoad
from multiphi_exudyn.mechanics.element import Element
from multiphi_exudyn.mechanics.friction import Friction
from multiphi_exudyn.time.trajectory import Trajectory

__all__ = ["LinearLimits", "LinearRange", "MovedBy", "RangeCheck", "linearised"]

FAST = 10.0  # times the rate of the motion: a faster mode follows it in equilibrium, with an error of 1 %
TOUCHING = 1e-9  # of the largest displacement: a smaller gap counts as closed
ASIDE = 1e-3  # of the largest displacement: step in directions that are left out
STAGES = 7  # of relaxation, as stiffnesses span many decades
STEP = 1e-4  # of the largest displacement: step of the derivative of C, with an error of 1e-8 and round-off of 1e-12
TOLERANCE = 0.01  # limit of the error: that of a pendulum with an amplitude of 1.1 degrees
LAG = 0.017  # rad: limit of the phase shift of oscillations at the end of a run, with an error of 1 % over the run
SAME = 1e-3  # error up to which user functions agree with the model: a hundred times that of numerical differentiation
NEUTRAL = 1e-6  # of the largest stiffness: a smaller one is an error of numerical differentiation
SPREAD = 10  # times over the run, besides those of the largest displacement and velocity
DENSE = 30  # the same with user functions, which may act in a part of the run only
ROUND_OFF = 1e-12  # of the largest coordinate: a smaller motion is due to round-off of the forces
SAMPLES = 256  # times among which the largest displacement and velocity are determined
LIMITED_MODES = 12  # number of lowest modes that have limits, as they have the largest amplitudes
LARGEST, SMALLEST = 12, -24  # powers of two: range of a limit, relative to the largest coordinate


@dataclass(frozen=True)
class MotionScales:
    """Largest values of a motion: displacement |q - q_0| of a coordinate [m, rad]; size |z|_M; rate |z'|_M / |z|_M."""

    displacement: float
    size: float
    rate: float


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


@dataclass(frozen=True)
class ConstrainedState:
    """A state that meets the constraints: norm |shift|_M of its correction, and the accelerations (n_full,)."""

    shift: float
    accelerations: np.ndarray


def _without_contacts(mbs: Any) -> AbstractContextManager[None]:
    objects, loads = items_of(mbs)
    return without_contacts(mbs, dict(enumerate(objects)), loads)


class FullSystem:
    """A system inside the context of ``opened``, without contacts, whose state may be changed."""

    def __init__(self, mbs: Any, solver: Any, displacement: np.ndarray, velocity: np.ndarray) -> None:
        self._mbs, self._solver = mbs, solver
        self._set(displacement, velocity)
        self._start = displacement, velocity
        self._start_jacobian = constraint_jacobian(mbs, solver)
        self._of_velocity = on_velocities(mbs, solver, self._start_jacobian)
        self._constraints = residuals(mbs, solver)

    @classmethod
    @contextmanager
    def opened(cls, mbs: Any, displacement: np.ndarray, velocity: np.ndarray, time: float) -> Iterator[FullSystem]:
        """The system with q_0, v_0, (n_full,), at a time [s]; it is restored in any case."""
        with initial_is_current(mbs), _without_contacts(mbs), static_solver(mbs) as solver:
            mbs.systemData.SetTime(time)
            yield cls(mbs, solver, displacement, velocity)

    def set_time(self, time: float) -> None:
        """Set the time [s] of user functions."""
        self._mbs.systemData.SetTime(time)

    def load(self, index: int, value: np.ndarray) -> None:
        """Set the present value (k,) of a load by a user function."""
        load = exu.LoadIndex(index)
        key = value_key(self._mbs.GetLoad(load))
        self._mbs.SetLoadParameter(load, key, float(value[0]) if key == "load" else value)

    def gap_and_normal(self, index: int) -> tuple[float, np.ndarray]:
        """Gap [m] and unit normal (3,) of a contact of spheres, in the present state."""
        return sphere_gap(self._mbs, index)

    def accelerations_at(
        self,
        displacement: np.ndarray,
        velocity: np.ndarray,
        force: np.ndarray,
        scale: float,
        prescribed: tuple[np.ndarray, np.ndarray] | None = None,
    ) -> ConstrainedState:
        """The system at q, v, (n_full,), under an additional force; scale: largest |q - q_0| of the motion.

        prescribed: s' - s'_0 and s'' (n_full,), None for zero.
        """
        zero = np.zeros(len(displacement))
        speed_change, driven = (zero, zero) if prescribed is None else prescribed
        self._set(displacement, self._start[1])
        directions = Directions(self._jacobian(), self._mass())
        left = np.where(self._of_velocity, 0.0, self._constraints - residuals(self._mbs, self._solver))
        shift = directions.solve(zero, left)
        self._set(displacement + shift, velocity)
        jacobian = self._jacobian()
        directions = Directions(jacobian, self._mass())
        needed = self._start_jacobian @ (self._start[1] + speed_change)
        velocity = velocity + directions.solve(zero, needed - jacobian @ velocity)
        rate = self._jacobian_rate(displacement + shift, velocity, scale)
        self._set(displacement + shift, velocity)
        forces = generalised_forces(self._mbs, self._solver) + force
        accelerations = directions.solve(forces, self._start_jacobian @ driven - rate)
        return ConstrainedState(directions.size(shift), accelerations)

    def _jacobian_rate(self, displacement: np.ndarray, velocity: np.ndarray, scale: float) -> np.ndarray:
        """(d C/dt) v by central differences."""
        fastest = np.max(np.abs(velocity))
        count = len(self._start_jacobian)
        if not fastest * scale > 0 or not count:
            return np.zeros(count)
        step = STEP * scale / fastest
        products = []
        for sign in (1, -1):
            self._set(displacement + sign * step * velocity, velocity)
            products.append(self._jacobian() @ velocity)
        return (products[0] - products[1]) / (2 * step)

    def _set(self, displacement: np.ndarray, velocity: np.ndarray) -> None:
        self._mbs.systemData.SetODE2Coordinates(displacement)
        self._mbs.systemData.SetODE2Coordinates_t(velocity)

    def _jacobian(self) -> np.ndarray:
        return constraint_jacobian(self._mbs, self._solver)

    def _mass(self) -> np.ndarray:
        return mass_matrix(self._mbs, self._solver)


def _by_motions(mbs: Any, motions: Mapping[int, PrescribedMotion]) -> dict[int, tuple[np.ndarray, ...]]:
    """M e^T, K e^T and C e^T (n_full, k) of prescribed motions, by index; round-off is set to zero."""
    if not motions:
        return {}
    springs, geometric = springs_with_factors(mbs), geometric_stiffness(mbs)
    with changed(mbs, without_stiffness(springs)):
        mass, stiffness, damping = map(np.array, mbs.ComputeLinearizedSystem()[:3])
    stiffness += geometric
    for item in springs.values():
        row = spring_row(mbs, item)
        stiffness += item["stiffness"] * np.outer(row, row)
        damping += item["damping"] * np.outer(row, row)
    return {
        i: tuple(rounded_product(a, m.directions.T) for a in (mass, stiffness, damping)) for i, m in motions.items()
    }


def _moved_by(
    motion: PrescribedMotion, basis: np.ndarray, momenta: np.ndarray, stiffness: np.ndarray, damping: np.ndarray
) -> MovedBy:
    """Its forces S^T K e^T and S^T C e^T; damping that is an error of differentiation beside the stiffness is zero."""
    stiffness, damping = rounded_product(basis.T, stiffness), rounded_product(basis.T, damping)
    negligible = DIFFERENTIATED * motion.scale * np.max(np.abs(stiffness), axis=0)
    return MovedBy(motion, momenta, stiffness, np.where(np.abs(damping) <= negligible, 0.0, damping))


def linearised(
    mbs: Any, time: float, rows: Sequence[np.ndarray], motions: Mapping[int, PrescribedMotion]
) -> Linearisation:
    """Linearisation about the initial state, at a time [s], without contacts and loads by functions of time.

    rows: rows (n_full,) of these contacts and loads. motions: by constraints.
    """
    data, initial = mbs.systemData, exu.ConfigurationType.Initial
    displacement, velocity = data.GetODE2Coordinates(initial), data.GetODE2Coordinates_t(initial)
    by_motions = _by_motions(mbs, motions)
    pulls = [column for _, *pair in by_motions.values() for pull in pair for column in pull.T]
    moved_velocity = sum((m.derivative(0.0, 1) @ m.directions for m in motions.values()), np.zeros(len(velocity)))
    present = forces(mbs, time)
    checked, basis, unmoved = matrices_of_moved_directions(
        mbs, velocity - moved_velocity, np.vstack([present, *rows, *pulls])
    )
    mass, stiffness, damping = checked.mass, checked.stiffness, checked.damping
    moved = {i: _moved_by(motions[i], basis, *matrices) for i, matrices in by_motions.items()}
    static = basis.T @ present + damping @ (basis.T @ (velocity - moved_velocity))
    static += sum((each.damping @ each.motion.derivative(0.0, 1) for each in moved.values()), np.zeros(len(static)))
    largest = largest_coordinate(mbs)
    return Linearisation(
        mass,
        damping,
        stiffness,
        static,
        basis,
        displacement,
        velocity,
        time,
        largest,
        checked.asymmetries,
        unmoved,
        moved=moved,
    )


@dataclass(frozen=True)
class RangeCheck:
    """Error of the linearisation of an Exudyn system in a reduced motion.

    Returned by ``Reduction.check``, which evaluates the system's accelerations in the model's motion at a few times.

    Attributes
    ----------
    times : array (k,)
        Times of the evaluations [s].
    errors : array (k,)
        Displacement by what the model leaves out, relative to the motion's largest displacement.
    reason : str
        Why nothing could be checked; empty if it could.
    lag : float
        Estimated phase shift [rad] at the end of the run, by errors that repeat in every oscillation.
    softest : float
        Lowest stiffness per mass [1/s2] in the mean of the motion, in directions that the model leaves out because
        nothing moves the system there, if it is negative; else 0.
    """

    times: np.ndarray
    errors: np.ndarray
    reason: str = ""
    lag: float = 0.0
    softest: float = 0.0

    @property
    def error(self) -> float:
        """Largest error, nan if nothing could be checked."""
        return math.nan if self.reason else float(np.max(self.errors, initial=0.0))

    @property
    def holds(self) -> bool:
        """Whether the motion stayed within the linear range; False if nothing could be checked."""
        return self.error <= TOLERANCE and self.lag <= LAG

    @property
    def sentences(self) -> tuple[str, ...]:
        """Warnings, a sentence each; empty if the motion stayed within the linear range."""
        if self.reason:
            return (f"linear range: not checked, {self.reason}",)
        if self.holds:
            return ()
        if self.error <= TOLERANCE:
            return (
                f"linear range: what the model leaves out of its Exudyn system is small ({per_cent(self.error)}), but "
                f"shifts frequencies: at the end of the run the phase is off by some {self.lag:.1g} rad",
            )
        time = self.times[np.argmax(self.errors > TOLERANCE)]
        error = per_cent(self.error) if self.error < 1 else "more than 100 %"
        return (
            f"linear range: left by t = {time:.3g} s; what the model leaves out of its Exudyn system moves it by "
            f"{error} of the largest displacement; make the motion smaller, or solve the Exudyn system itself",
        )


def _lag(deviations: np.ndarray, amplitudes: np.ndarray, phase: float) -> float:
    """Phase error [rad] at the end of the run: half the relative error of omega^2 times the phase [rad].

    deviations, amplitudes: (k, n), error and displacement of every mode at the times of the check.
    """
    moving = amplitudes - np.mean(amplitudes, axis=0)
    powers = np.sum(moving**2, axis=1)
    if np.max(powers) <= TOLERANCE**2 * np.max(np.sum(amplitudes**2, axis=1)):
        return 0.0  # hardly any oscillation
    duration = min(1.0, 2 * float(np.mean(powers) / np.max(powers)))  # share of the run with motion, 1 for a sine
    return float(0.5 * phase * duration * abs(np.sum(deviations * moving)) / np.sum(powers))


def _lowest_eigenvalue(stiffness: np.ndarray) -> float:
    """Lowest eigenvalue [1/s2] of a matrix (k, k) if it is negative beyond round-off, else 0."""
    values = np.linalg.eigvalsh(stiffness)
    lowest = float(np.min(values, initial=0.0))
    return lowest if lowest < -NEUTRAL * float(np.max(np.abs(values), initial=0.0)) else 0.0


def _left_out_warnings(left_out: Sequence[str]) -> Iterator[str]:
    for part in left_out:
        yield f"left out: {part}; this motion is without it"


def _damper_warnings(trajectory: Trajectory) -> Iterator[str]:
    """Warning of contacts with dampers that opened: Exudyn's dampers pull at that instant."""
    damped = {contact.name for contact in trajectory.model.contacts if getattr(contact, "damping", 0.0)}
    opened = [event.contact for event in trajectory.events if event.kind == "open" and event.contact in damped]
    if opened:
        also = f" (and {len(set(opened)) - 1} more)" if len(set(opened)) > 1 else ""
        yield (
            f"contact damper: that of {opened[0]!r}{also} never pulls; Exudyn's pulls where the contact opens, so "
            "rebounds differ from Exudyn's"
        )


class LinearRange:
    """Validity of a model from ``reduce``: compares it with its system, and warns of parts that were left out.

    left_out: all these parts, as grouped sentences. evaluated: those that the system can be evaluated with at any
    state; the warning names them if the two disagree. unmoved: directions that nothing moves; the warning names them
    if the system is unstable there in the mean of the motion, so that the smallest force would move it. A pickled check
    becomes ``LinearLimits``; a copy uses the same system.
    """

    def __init__(
        self,
        mbs: Any,
        linear: Linearisation,
        left_out: Sequence[str],
        evaluated: Sequence[str] = (),
        unmoved: Sequence[str] = (),
    ) -> None:
        self._mbs, self._linear = mbs, linear
        self._left_out = tuple(part for part in left_out if part not in (*evaluated, *unmoved))
        self._evaluated, self._unmoved = tuple(evaluated), tuple(unmoved)

    def __call__(self, trajectory: Trajectory) -> tuple[str, ...]:
        """Sentences for ``Trajectory.warnings``."""
        check = self.check(trajectory)
        evaluated = self._evaluated if check.error > SAME or check.reason else ()
        unmoved = self._unmoved if check.softest < 0 or check.reason else ()
        start = self._start if self._linear.shift > SAME * self._largest(trajectory) else ()
        left_out = _left_out_warnings((*self._left_out, *start, *evaluated, *unmoved))
        return (*left_out, *_damper_warnings(trajectory), *check.sentences)

    def __copy__(self) -> LinearRange:
        return self

    def __deepcopy__(self, memo: Any) -> LinearRange:
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        return LinearLimits, ((*self._left_out, *self._start, *self._evaluated, *self._unmoved), *self._limits)

    @property
    def _start(self) -> tuple[str, ...]:
        """The part that a start moved onto the constraints leaves out, if it is moved beyond round-off."""
        linear = self._linear
        if not linear.shift > ROUND_OFF * linear.largest:
            return ()
        return (
            f"the violation of {', '.join(linear.violated)} at the start: the model starts where constraints are met, "
            f"up to {linear.shift:.3g} m or rad away, as Exudyn's generalized-alpha solver does in its first step, and "
            "TrapezoidalIndex2 does not",
        )

    def _largest(self, trajectory: Trajectory) -> float:
        """Largest displacement [m, rad] of a coordinate from the start."""
        samples, z, _ = _sampled(trajectory)
        moved = np.transpose([self._linear.prescribed(t) for t in samples])
        return float(np.max(np.abs(self._linear.basis @ z + moved)))

    def check(self, trajectory: Trajectory) -> RangeCheck:
        """Error of a trajectory of this model at a few times."""
        samples, z, z_t = _sampled(trajectory)
        linear = self._linear
        sizes = np.hypot(linear.size(z), [linear.prescribed_size(t) for t in samples])
        speeds = np.hypot(linear.size(z_t), [linear.prescribed_size(t, 1) for t in samples])
        spread = np.linspace(trajectory.t_start, trajectory.t_end, (DENSE if self._evaluated else SPREAD) + 1)[1:]
        extremes = samples[np.argmax(sizes)], samples[np.argmax(speeds)]
        times = np.unique([*spread, *extremes, *_closings(trajectory, linear.spheres)])
        largest = self._largest(trajectory)
        if not largest > ROUND_OFF * linear.largest or not np.max(sizes) > 0:
            return RangeCheck(times, np.zeros(len(times)))
        if reason := self._changed():
            return RangeCheck(times, np.zeros(len(times)), reason)
        duration = trajectory.t_end - trajectory.t_start
        rate = max(float(np.max(speeds) / np.max(sizes)), 1.0 / duration)  # at least 1 rad in the run
        scales = MotionScales(largest, float(np.max(sizes)), rate)
        elements = [contact for contact in trajectory.model.contacts if contact.name in linear.contacts]
        with linear.compared_with(self._mbs) as compared:
            comparisons = [
                compared.error(
                    trajectory.displacement(t),
                    trajectory.velocity(t),
                    scales,
                    TOLERANCE,
                    t,
                    {contact.name: _element_force(trajectory, contact, t) for contact in elements},
                )
                for t in times
            ]
            impact_errors = [compared.impact_error(trajectory.displacement(t), largest, t) for t in times]
            stiffness = np.mean(
                [compared.unmoved_stiffness(trajectory.displacement(t), largest, t) for t in spread], axis=0
            )
        errors, deviations = (np.array(parts) for parts in zip(*comparisons, strict=True))
        errors = np.maximum(errors, impact_errors)
        amplitudes = (linear.modes[1].T @ (linear.mass @ trajectory.displacement(times))).T
        return RangeCheck(
            times, errors, "", _lag(deviations, amplitudes, rate * duration), _lowest_eigenvalue(stiffness)
        )

    def _changed(self) -> str:
        """Why the system is not the one that was reduced, by its state of assembly and its size; else empty."""
        if not self._mbs.systemIsConsistent:
            return "the Exudyn system has been changed and not assembled since it was reduced"
        now, before = self._mbs.systemData.ODE2Size(), len(self._linear.displacement)
        if now != before:
            return f"the Exudyn system has {now} coordinates, and had {before} when it was reduced"
        return ""

    @functools.cached_property
    def _limits(self) -> tuple[np.ndarray, np.ndarray, str]:
        """Rows and limits of LinearLimits, and the reason if there are none."""
        linear, reason = self._linear, self._changed()
        if linear.moved and not reason:
            reason = "constraints of its Exudyn system prescribe a motion, which a pickled model cannot evaluate"
        squares, shapes = linear.modes
        rows = (linear.mass @ shapes[:, :LIMITED_MODES]).T
        limits = [] if reason else [self._limit(squares[i], shapes[:, i]) for i in range(len(rows))]
        return rows, np.array(limits), reason

    def _limit(self, square: float, shape: np.ndarray) -> float:
        """Largest linear amplitude of a mode with omega^2 = square, by bisection; infinite beyond the range."""
        unit = (self._linear.largest or 1.0) / float(np.max(np.abs(self._linear.basis @ shape)))
        if self._is_linear(square, shape, 2.0**LARGEST * unit):
            return math.inf
        linear, nonlinear = SMALLEST, LARGEST
        while nonlinear - linear > 1:
            exponent = (linear + nonlinear) // 2
            if self._is_linear(square, shape, 2.0**exponent * unit):
                linear = exponent
            else:
                nonlinear = exponent
        return 2.0**linear * unit

    def _is_linear(self, square: float, shape: np.ndarray, size: float) -> bool:
        """Whether a mode with omega^2 = square is linear at a modal amplitude and the velocity that belongs to it."""
        loaded = float(np.linalg.norm(self._linear.modes[1].T @ self._linear.static))
        rate = math.sqrt(max(square, loaded / size))
        if rate == 0.0:
            return True  # without any force
        scales = MotionScales(size * float(np.max(np.abs(self._linear.basis @ shape))), size, rate)
        with self._linear.compared_with(self._mbs) as compared:
            error = compared.error(size * shape, size * rate * shape, scales, TOLERANCE)[0]
            return max(error, compared.impact_error(size * shape, scales.displacement)) <= TOLERANCE


class LinearLimits:
    """Pickled check: rows (k, n) of the lowest modes' coordinates and limits (k,) of them, or the reason for none."""

    def __init__(self, left_out: Sequence[str], rows: np.ndarray, limits: np.ndarray, reason: str) -> None:
        self._left_out, self._rows, self._limits, self._reason = tuple(left_out), rows, limits, reason

    def __call__(self, trajectory: Trajectory) -> tuple[str, ...]:
        """Sentences for ``Trajectory.warnings``."""
        return (*_left_out_warnings(self._left_out), *_damper_warnings(trajectory), *self.check(trajectory).sentences)

    def check(self, trajectory: Trajectory) -> RangeCheck:
        """Error at many times, for every mode alone: proportional to its amplitude, and TOLERANCE at its limit."""
        samples, z, _ = _sampled(trajectory)
        if self._reason:
            return RangeCheck(samples, np.zeros(SAMPLES), self._reason)
        return RangeCheck(samples, TOLERANCE * np.max(np.abs(self._rows @ z) / self._limits[:, None], axis=0))


def _element_force(trajectory: Trajectory, contact: Element, t: float) -> float:
    """Force [N] along its direction that a contact, or a friction, exerts on the structure at t [s]."""
    if isinstance(contact, Friction):
        return -float(trajectory.friction_force(contact.name, t))
    return float(trajectory.contact_force(contact.name, t))


def _closings(trajectory: Trajectory, names: Collection[str]) -> np.ndarray:
    """Times [s] at which contacts of these names close, at most SPREAD of them, spread over the run."""
    times = [event.time for event in trajectory.events if event.kind == "close" and event.contact in names]
    return np.array(times)[np.unique(np.linspace(0, len(times) - 1, SPREAD).astype(int))] if times else np.array(times)


def _sampled(trajectory: Trajectory) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times (SAMPLES,) over the run, displacements and velocities (n, SAMPLES)."""
    samples = np.linspace(trajectory.t_start, trajectory.t_end, SAMPLES)
    return samples, trajectory.displacement(samples), trajectory.velocity(samples)
