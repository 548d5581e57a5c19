"""Linear range: whether a reduced motion stays where the linearisation of its Exudyn system holds.

At a few instants the system is asked for its accelerations in the model's motion (linearisation.py); the largest error
found is relative to the motion's largest displacement. A system cannot be pickled: a pickled check keeps for the lowest
modes the amplitude up to which each of them alone, with the velocity that belongs to it, stays within ``TOLERANCE``.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Collection, Iterator, Sequence
from typing import Any

import numpy as np

from multiphi_exudyn.exudyn_plugin.convert.linearisation import Extent, Linearisation
from multiphi_exudyn.exudyn_plugin.convert.range_check import TOLERANCE, RangeCheck
from multiphi_exudyn.mechanics.element import Element
from multiphi_exudyn.mechanics.friction import Friction
from multiphi_exudyn.time.trajectory import Trajectory

__all__ = ["LinearLimits", "LinearRange"]

SAME = 1e-3  # error up to which user functions do what the model does: a hundred times what differentiating them leaves
NEUTRAL = 1e-6  # of the largest stiffness beside the motion: what differentiating leaves of none
SPREAD = 10  # instants over the run, besides those of the largest displacement and velocity
DENSE = 30  # the same where user functions are to be seen, which may act in a part of the run only
ROUND_OFF = 1e-12  # of the largest coordinate: a motion below it is that of round-off in the forces
SAMPLES = 256  # times at which the largest displacement and velocity are looked for
PROBED = 12  # lowest modes of which limits are kept: those that move far
LARGEST, SMALLEST = 12, -24  # powers of two: amplitudes tried for a limit, of the largest coordinate of the system


def _lag(away: np.ndarray, amplitudes: np.ndarray, turned: float) -> float:
    """Shift [rad] of oscillations through ``turned`` [rad]: half the relative change of omega^2 times what they turn.

    away, amplitudes: (k, n), how far the model is off and what it does, mode by mode, at the instants looked at.
    """
    moving = amplitudes - np.mean(amplitudes, axis=0)
    powers = np.sum(moving**2, axis=1)
    if np.max(powers) <= TOLERANCE**2 * np.max(np.sum(amplitudes**2, axis=1)):
        return 0.0  # it stands, as good as; what is off there is an error, and no shift
    lasting = min(1.0, 2 * float(np.mean(powers) / np.max(powers)))  # share of the run in which it moves; of a sine 1
    return float(0.5 * turned * lasting * abs(np.sum(away * moving)) / np.sum(powers))


def _softest(stiffness: np.ndarray) -> float:
    """The lowest eigenvalue [1/s2] of a matrix (k, k), 0 where it is round-off or there is none."""
    values = np.linalg.eigvalsh(stiffness)
    lowest = float(np.min(values, initial=0.0))
    return lowest if lowest < -NEUTRAL * float(np.max(np.abs(values), initial=0.0)) else 0.0


def _told(left_out: Sequence[str]) -> Iterator[str]:
    for part in left_out:
        yield f"left out: {part}; this motion is without it"


def _let_go(trajectory: Trajectory) -> Iterator[str]:
    """Of contacts with dampers that opened: at that instant Exudyn's pull."""
    damped = {contact.name for contact in trajectory.model.contacts if getattr(contact, "damping", 0.0)}
    opened = [event.contact for event in trajectory.events if event.kind == "open" and event.contact in damped]
    if opened:
        also = f" (and {len(set(opened)) - 1} more)" if len(set(opened)) > 1 else ""
        yield (
            f"contact damper: that of {opened[0]!r}{also} never pulls; Exudyn's pulls where the contact opens, so "
            "rebounds differ from Exudyn's"
        )


class LinearRange:
    """Validity of a model that ``reduce`` made: asks its system, and names what was left out (grouped sentences).

    asked: the part of what was left out that the system has at any state, which is named where the two disagree. idle:
    directions in which nothing moves the system, named where it is unstable there in the mean of the motion: then the
    least push, which no run of it has, would take it away. Pickled it becomes ``LinearLimits``; a copy asks the same
    system.
    """

    def __init__(
        self,
        mbs: Any,
        linear: Linearisation,
        left_out: Sequence[str],
        asked: Sequence[str] = (),
        idle: Sequence[str] = (),
    ) -> None:
        self._mbs, self._linear = mbs, linear
        self._left_out = tuple(part for part in left_out if part not in (*asked, *idle))
        self._asked, self._idle = tuple(asked), tuple(idle)

    def __call__(self, trajectory: Trajectory) -> tuple[str, ...]:
        """Sentences for ``Trajectory.warnings``."""
        found = self.check(trajectory)
        asked = self._asked if found.error > SAME or found.reason else ()
        idle = self._idle if found.softest < 0 or found.reason else ()
        return (*_told((*self._left_out, *asked, *idle)), *_let_go(trajectory), *found.sentences)

    def __copy__(self) -> LinearRange:
        return self

    def __deepcopy__(self, memo: Any) -> LinearRange:
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        return LinearLimits, ((*self._left_out, *self._asked, *self._idle), *self._limits)

    def check(self, trajectory: Trajectory) -> RangeCheck:
        """The error of a trajectory of this model at a few instants."""
        samples, z, z_t = _sampled(trajectory)
        linear = self._linear
        sizes, speeds = linear.size(z), linear.size(z_t)
        spread = np.linspace(0.0, trajectory.t_end, (DENSE if self._asked else SPREAD) + 1)[1:]
        extremes = samples[np.argmax(sizes)], samples[np.argmax(speeds)]
        times = np.unique([*spread, *extremes, *_closings(trajectory, linear.spheres)])
        reach = float(np.max(np.abs(linear.basis @ z)))
        if not reach > ROUND_OFF * linear.largest:
            return RangeCheck(times, np.zeros(len(times)))
        if reason := self._changed():
            return RangeCheck(times, np.zeros(len(times)), reason)
        rate = max(float(np.max(speeds) / np.max(sizes)), 1.0 / trajectory.t_end)  # no motion is slower than its run
        extent = Extent(reach, float(np.max(sizes)), rate)
        known = [contact for contact in trajectory.model.contacts if contact.name in linear.contacts]
        with linear.beside(self._mbs) as compared:
            found = [
                compared.error(
                    trajectory.displacement(t),
                    trajectory.velocity(t),
                    extent,
                    TOLERANCE,
                    t,
                    {contact.name: _pushing(trajectory, contact, t) for contact in known},
                )
                for t in times
            ]
            turned = [compared.turned(trajectory.displacement(t), reach) for t in times]
            beside = np.mean([compared.stiffening(trajectory.displacement(t), reach) for t in spread], axis=0)
        errors, away = (np.array(parts) for parts in zip(*found, strict=True))
        errors = np.maximum(errors, turned)
        amplitudes = (linear.modes[1].T @ (linear.mass @ trajectory.displacement(times))).T
        return RangeCheck(times, errors, "", _lag(away, amplitudes, rate * trajectory.t_end), _softest(beside))

    def _changed(self) -> str:
        """Why the system is no longer the one that was reduced, as far as its size tells; empty if it is."""
        if not self._mbs.systemIsConsistent:
            return "the Exudyn system has been changed and not assembled since it was reduced"
        now, before = self._mbs.systemData.ODE2Size(), len(self._linear.displacement)
        if now != before:
            return f"the Exudyn system has {now} coordinates, and had {before} when it was reduced"
        return ""

    @functools.cached_property
    def _limits(self) -> tuple[np.ndarray, np.ndarray, str]:
        """Rows and limits of LinearLimits, or why there are none."""
        linear, reason = self._linear, self._changed()
        squares, shapes = linear.modes
        rows = (linear.mass @ shapes[:, :PROBED]).T
        limits = [] if reason else [self._limit(squares[i], shapes[:, i]) for i in range(len(rows))]
        return rows, np.array(limits), reason

    def _limit(self, square: float, shape: np.ndarray) -> float:
        """The largest amplitude of a mode of omega^2 found linear, by bisection; infinite if the largest tried is."""
        unit = (self._linear.largest or 1.0) / float(np.max(np.abs(self._linear.basis @ shape)))
        if self._is_linear(square, shape, 2.0**LARGEST * unit):
            return math.inf
        linear, beyond = SMALLEST, LARGEST
        while beyond - linear > 1:
            tried = (linear + beyond) // 2
            if self._is_linear(square, shape, 2.0**tried * unit):
                linear = tried
            else:
                beyond = tried
        return 2.0**linear * unit

    def _is_linear(self, square: float, shape: np.ndarray, size: float) -> bool:
        """Whether a mode of omega^2 stays linear at a modal amplitude and the velocity that belongs to it."""
        loaded = float(np.linalg.norm(self._linear.modes[1].T @ self._linear.static))
        rate = math.sqrt(max(square, loaded / size))
        if rate == 0.0:
            return True  # nothing acts on it
        extent = Extent(size * float(np.max(np.abs(self._linear.basis @ shape))), size, rate)
        with self._linear.beside(self._mbs) as compared:
            off = compared.error(size * shape, size * rate * shape, extent, TOLERANCE)[0]
            return max(off, compared.turned(size * shape, extent.reach)) <= TOLERANCE


class LinearLimits:
    """What a pickled check keeps: rows (k, n) of the lowest modes' coordinates, and their limits (k,), or why not."""

    def __init__(self, left_out: Sequence[str], rows: np.ndarray, limits: np.ndarray, reason: str) -> None:
        self._left_out, self._rows, self._limits, self._reason = tuple(left_out), rows, limits, reason

    def __call__(self, trajectory: Trajectory) -> tuple[str, ...]:
        """Sentences for ``Trajectory.warnings``."""
        return (*_told(self._left_out), *_let_go(trajectory), *self.check(trajectory).sentences)

    def check(self, trajectory: Trajectory) -> RangeCheck:
        """The error at many times, every mode alone: TOLERANCE at its limit, in proportion to its amplitude."""
        samples, z, _ = _sampled(trajectory)
        if self._reason:
            return RangeCheck(samples, np.zeros(SAMPLES), self._reason)
        return RangeCheck(samples, TOLERANCE * np.max(np.abs(self._rows @ z) / self._limits[:, None], axis=0))


def _pushing(trajectory: Trajectory, contact: Element, t: float) -> float:
    """Force [N] along its direction that a contact, or a friction, exerts on the structure at t [s]."""
    if isinstance(contact, Friction):
        return -float(trajectory.friction_force(contact.name, t))
    return float(trajectory.contact_force(contact.name, t))


def _closings(trajectory: Trajectory, names: Collection[str]) -> np.ndarray:
    """Instants [s], at most SPREAD spread over the run, at which contacts of these names close."""
    times = [event.time for event in trajectory.events if event.kind == "close" and event.contact in names]
    return np.array(times)[np.unique(np.linspace(0, len(times) - 1, SPREAD).astype(int))] if times else np.array(times)


def _sampled(trajectory: Trajectory) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times (SAMPLES,) over the run, displacements and velocities (n, SAMPLES)."""
    samples = np.linspace(0.0, trajectory.t_end, SAMPLES)
    return samples, trajectory.displacement(samples), trajectory.velocity(samples)
