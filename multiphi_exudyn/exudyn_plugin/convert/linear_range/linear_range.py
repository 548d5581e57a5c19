"""Linear range: whether a reduced motion stays where the linearisation of its Exudyn system holds.

At a few times the accelerations of the system are evaluated in the model's motion (linearisation.py); the error is
relative to the motion's largest displacement. A system cannot be pickled. A pickled check has limits instead: for each
of the lowest modes, the amplitude up to which it alone, with the velocity that belongs to it, stays within
``TOLERANCE``.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Collection, Iterator, Sequence
from typing import Any

import numpy as np

from multiphi_exudyn.exudyn_plugin.convert.linear_range.range_check import TOLERANCE, RangeCheck
from multiphi_exudyn.exudyn_plugin.convert.linearisation.linearisation import Linearisation, MotionScales
from multiphi_exudyn.mechanics.elements.element import Element
from multiphi_exudyn.mechanics.elements.friction import Friction
from multiphi_exudyn.time.trajectory.trajectory import Trajectory

__all__ = ["LinearLimits", "LinearRange"]

SAME = 1e-3  # error up to which user functions agree with the model: a hundred times that of numerical differentiation
NEUTRAL = 1e-6  # of the largest stiffness: a smaller one is an error of numerical differentiation
SPREAD = 10  # times over the run, besides those of the largest displacement and velocity
DENSE = 30  # the same with user functions, which may act in a part of the run only
ROUND_OFF = 1e-12  # of the largest coordinate: a smaller motion is due to round-off of the forces
SAMPLES = 256  # times among which the largest displacement and velocity are determined
LIMITED_MODES = 12  # number of lowest modes that have limits, as they have the largest amplitudes
LARGEST, SMALLEST = 12, -24  # powers of two: range of a limit, relative to the largest coordinate


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
