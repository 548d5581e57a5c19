"""Trajectory: what a simulation leaves, as analytic segments that can be asked at any time (eq. 38.4).

    x(t) = Phi_l eta(t) + x_inf,l,   eta(t) = Re V (c exp(lambda (t - t_k)))   on [t_k, t_k+1]

Energies come from two independent sides: the ledger adds what was lost (impacts, truncation, damping, the last as
a closed-form integral of eta'^T D eta') and what loads did; its residual is the difference to kinetic + strain.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError, NumericalFailure
from multiphi_exudyn.events.state import Event, Loss, Phase, State
from multiphi_exudyn.levels.model import MultiPhiModel
from multiphi_exudyn.mechanics.arguments import is_real
from multiphi_exudyn.mechanics.structure import At
from multiphi_exudyn.time.segment import Segment

__all__ = ["Ledger", "Start", "Statistics", "Trajectory"]

NUDGE = 1e-12  # of the largest speed: more than round-off makes of a run, less than anybody knows of a start
INSTANTS = 1001  # at which a nudged run is compared, beside the events


@dataclass(frozen=True)
class Start:
    """y, y' (m,) in base coordinates; compliant contacts that start closed, rigid ones that start at their gap.

    gaps: (c,) [m] of all contacts at y = 0, as stops that have moved leave them.
    """

    displacement: np.ndarray
    velocity: np.ndarray
    penetrating: tuple[int, ...]
    touching: tuple[int, ...]
    gaps: np.ndarray


@dataclass(frozen=True)
class Statistics:
    """Work of a run; function_evaluations counts samples of event signals."""

    levels_built: int
    levels_possible: int
    transitions: int
    events: int
    segments: int
    function_evaluations: int


@dataclass(frozen=True)
class Ledger:
    """Energies [J]: initial + work_of_loads = final + impact + truncation_kinetic + truncation_strain + damping.

    residual: what is left over of that equation.
    """

    initial: float
    work_of_loads: float
    impact: float
    truncation_kinetic: float
    truncation_strain: float
    damping: float
    final: float

    @property
    def residual(self) -> float:
        """initial + work - losses - final [J]; round-off if everything is accounted for."""
        lost = self.impact + self.truncation_kinetic + self.truncation_strain + self.damping
        return self.initial + self.work_of_loads - lost - self.final


@dataclass(frozen=True)
class Trajectory:
    """Result of ``simulate``.

    final: the state it ends in, after whatever happened at that instant; final_work: see Motion.

    status: "ok" | "failed"; message: the cause. warnings: what to distrust in this answer, and what to do about it, a
    sentence each that begins with its kind and a colon (reliability.py). t_end [s]: how far it goes. events: in order
    of time. again: the same run from other y, y' (m,), without warnings.
    Times are scalars or (k,); at an event ``side`` chooses the limit from the "right" (default) or "left".
    """

    model: MultiPhiModel
    segments: Sequence[Segment]
    events: Sequence[Event]
    t_end: float
    status: str
    message: str
    start: Start
    start_loss: Loss
    final: State | None
    final_work: float
    load: np.ndarray
    stats: Statistics
    warnings: tuple[str, ...] = ()
    again: Callable[[np.ndarray, np.ndarray], Trajectory] | None = field(default=None, repr=False, compare=False)

    def displacement(self, t: float | np.ndarray, side: str = "right") -> np.ndarray:
        """x [m, rad]: (n,) for a scalar t, (n, k) for (k,) times."""
        return self._full(t, side, 0)

    def velocity(self, t: float | np.ndarray, side: str = "right") -> np.ndarray:
        """x' [m/s, rad/s]: (n,) or (n, k)."""
        return self._full(t, side, 1)

    def acceleration(self, t: float | np.ndarray, side: str = "right") -> np.ndarray:
        """x'' [m/s2, rad/s2]: (n,) or (n, k)."""
        return self._full(t, side, 2)

    def at(self, point: At, t: float | np.ndarray, side: str = "right") -> float | np.ndarray:
        """Displacement [m] of a point (name, {point: coefficient} or row): a float, or (k,)."""
        row = self.model.base.modes.shapes.T @ self.model.structure.row(point)
        return self._evaluate(t, side, lambda segment, times: self._of_row(segment, row, times))

    def gap(self, contact: str, t: float | np.ndarray, side: str = "right") -> float | np.ndarray:
        """Gap [m] of a contact: a float, or (k,)."""
        i = self.model.index(contact)

        return self._evaluate(t, side, lambda segment, times: segment.gaps(i, times))

    def contact_force(self, contact: str, t: float | np.ndarray, side: str = "right") -> float | np.ndarray:
        """Contact force lambda >= 0 [N]: a float, or (k,); impacts of rigid contacts are impulses, not forces."""
        i = self.model.index(contact)
        return self._evaluate(t, side, lambda segment, times: segment.force(i, times))

    def contact_impulse(self, contact: str, t0: float, t1: float) -> float:
        """Integral of the contact force over [t0, t1] [N s], impulses of impacts in it included."""
        i = self.model.index(contact)
        first, last = float(self._times(t0)[0]), float(self._times(t1)[0])
        if first > last:
            raise MultiPhiValueError(f"contact_impulse: got t0 = {t0!r} > t1 = {t1!r}, need t0 <= t1")
        pushed = sum(
            segment.force_integral(i, max(first, segment.start), min(last, segment.end))
            for segment in self.segments
            if i in segment.level.level.indices and segment.start < last and segment.end > first
        )
        within = [event for event in self.events if first <= event.time <= last]
        struck = sum(event.impulse for event in within if event.contact == contact)
        struck += sum(impulse for event in within for name, impulse in event.shared if name == contact)
        return float(pushed + struck)

    def contact_intervals(self, contact: str) -> list[tuple[float, float]]:
        """[(closed at, opened at), ...] [s]; one still closed at the end ends at t_end, instants are left out."""
        i = self.model.index(contact)
        intervals: list[tuple[float, float]] = []
        for segment in self.segments:
            if i not in segment.level.level.indices or segment.end <= segment.start:
                continue
            if intervals and intervals[-1][1] == segment.start:
                intervals[-1] = (intervals[-1][0], segment.end)
            else:
                intervals.append((segment.start, segment.end))
        return intervals

    def energy(self, t: float | np.ndarray, side: str = "right") -> float | np.ndarray:
        """Kinetic + strain energy [J], that of closed compliant contacts and of force laws included."""
        return self._evaluate(t, side, lambda segment, times: segment.energy(times))

    @functools.cached_property
    def ledger(self) -> Ledger:
        """Where the energy went; computed when it is asked for. A run that failed at its start has none."""
        if not self.segments:
            raise NumericalFailure(f"ledger: got a run without motion ({self.message}), need one that has started")
        losses = sum((event.loss for event in self.events), self.start_loss)
        y0, v0 = self.start.displacement, self.start.velocity
        last = self.final
        assert last is not None, "a run with segments has a final state"
        varying = sum((segment.varying_work() for segment in self.segments), self.final_work)
        reached = last.level.configuration(last.displacement)
        return Ledger(
            initial=0.5 * float(v0 @ v0) + self.model.base.strain(y0, self.start.penetrating, self.start.gaps),
            work_of_loads=float(self.load @ (reached - y0)) + losses.stop_work + varying,
            impact=losses.impact,
            truncation_kinetic=losses.truncation_kinetic,
            truncation_strain=losses.truncation_strain,
            damping=losses.damping + sum(segment.damping_work() for segment in self.segments),
            final=last.kinetic + float(last.level.strain(last.displacement)),
        )

    def deepest_gap(self, contact: str, samples: int = 20) -> float:
        """Smallest gap [m] of a contact while it is open, 0.0 where truncation left none below zero.

        Looked for where the event rule let the gap be negative, ``samples`` in the shortest period of the level and
        at least as many in a segment.
        """
        i = self.model.index(contact)
        depth = 0.0
        for segment in self.segments:
            if segment.phases[i] is not Phase.ARMED and i not in segment.level.level.indices:
                depth = min(depth, float(np.min(segment.gaps(i, segment.unarmed_times(samples)))))
        return depth

    def horizon(self, tolerance: float = 0.01) -> float:
        """Sensitivity horizon [s]: until when runs nudged at their start stay within ``tolerance`` of this one.

        The nudges are +-NUDGE of the speeds y' that the run has where it is fastest, added to those it starts with. The
        distance is that of y, in the norm of the mass matrix, relative to the largest |y| of the run. t_end where it
        never exceeds the tolerance. A nudged run that fails tells nothing beyond its end. No answer beyond the horizon
        is to be compared point by point: round-off would change it as much. Costs two more runs.
        """
        if not (is_real(tolerance) and 0 < tolerance < 1):
            raise MultiPhiValueError(f"tolerance: got {tolerance!r}, need a number between 0 and 1")
        if not self.segments or self.again is None:
            raise NumericalFailure(f"horizon: got a run without motion ({self.message}), need one that has started")
        times = self._instants
        own, speeds = self._configurations(times), self.model.base.coordinates(self.velocity(times))
        nudge = NUDGE * speeds[:, int(np.argmax(np.linalg.norm(speeds, axis=0)))]
        start = self.start
        runs = [self.again(start.displacement, start.velocity + sign * nudge) for sign in (1, -1)]
        limit = tolerance * float(np.max(np.linalg.norm(own, axis=0)))
        whole = [run for run in runs if run.status == self.status] or runs
        return min(_parted(run, times, own, limit) for run in whole)

    @property
    def _instants(self) -> np.ndarray:
        """Times (k,) [s] at which runs are compared: evenly spaced, and the events."""
        even = np.linspace(0.0, self.t_end, INSTANTS)
        return np.union1d(even, [event.time for event in self.events])

    def _configurations(self, times: np.ndarray) -> np.ndarray:
        """y (m, k)."""
        return self.model.base.coordinates(self.displacement(times))

    # ------------------------------------------------------------------ evaluation

    def _of_row(self, segment: Segment, row: np.ndarray, times: np.ndarray) -> np.ndarray:
        own = segment.level
        return (row @ own.level.vectors) @ segment.modal(times) + row @ own.asymptotic.configuration

    def _full(self, t: float | np.ndarray, side: str, derivative: int) -> np.ndarray:
        shapes = self.model.base.modes.shapes

        def values(segment: Segment, times: np.ndarray) -> np.ndarray:
            y = segment.level.level.vectors @ segment.modal(times, derivative)
            if derivative == 0:
                y = y + segment.level.asymptotic.configuration[:, None]
            return shapes @ y

        return np.asarray(self._evaluate(t, side, values))

    def _evaluate(
        self, t: float | np.ndarray, side: str, values: Callable[[Segment, np.ndarray], np.ndarray]
    ) -> float | np.ndarray:
        """``values`` of the segments that own the times, in the order of the times."""
        times = self._times(t)
        owner = self._owners(times, side)
        parts = np.split(np.argsort(owner, kind="stable"), np.flatnonzero(np.diff(np.sort(owner))) + 1)
        result: np.ndarray | None = None
        for part in parts:
            found = values(self.segments[owner[part[0]]], times[part])
            if result is None:
                result = np.empty((*found.shape[:-1], len(times)))
            result[..., part] = found
        assert result is not None
        if np.ndim(t) == 0:
            return float(result[0]) if result.ndim == 1 else result[:, 0]
        return result

    def _times(self, t: float | np.ndarray) -> np.ndarray:
        try:
            times = np.atleast_1d(np.asarray(t, dtype=float))
        except (TypeError, ValueError) as error:
            raise MultiPhiTypeError(f"t: got {type(t).__name__}, need a time or (k,) times in s") from error
        if times.ndim != 1 or len(times) == 0:
            raise MultiPhiValueError(f"t: got shape {np.shape(t)}, need a scalar or (k,)")
        if not self.segments or not np.all((times >= 0) & (times <= self.t_end)):
            raise MultiPhiValueError(
                f"t: got {np.min(times):g} to {np.max(times):g} s, need 0 <= t <= {self.t_end:g} s"
            )
        return times

    @functools.cached_property
    def _starts(self) -> np.ndarray:
        kept = getattr(self.segments, "starts", None)  # of the loop (record.py)
        return np.array([segment.start for segment in self.segments]) if kept is None else np.asarray(kept)

    def _owners(self, times: np.ndarray, side: str) -> np.ndarray:
        if side not in ("left", "right"):
            raise MultiPhiValueError(f"side: got {side!r}, need 'left' or 'right'")
        found = np.searchsorted(self._starts, times, side="right" if side == "right" else "left") - 1
        return np.maximum(found, 0)


def _parted(run: Trajectory, times: np.ndarray, expected: np.ndarray, limit: float) -> float:
    """First of the times (k,) [s] at which a run is over ``limit`` from y (m, k), or has ended; else the last."""
    reached = int(np.sum(times <= run.t_end))
    apart = np.linalg.norm(run._configurations(times[:reached]) - expected[:, :reached], axis=0)
    first = int(np.argmax(apart > limit)) if np.any(apart > limit) else min(reached, len(times) - 1)
    return float(times[first])
