"""Trajectory: what a simulation leaves, as analytic segments that can be asked at any time (eq. 38.4).

    x(t) = Phi_l eta(t) + x_inf,l,   eta(t) = Re V (c exp(lambda (t - t_k)))   on [t_k, t_k+1]

Energies come from two independent sides: the ledger adds what was lost (impacts, truncation, damping, the last as
a closed-form integral of eta'^T D eta') and what loads did; its residual is the difference to kinetic + strain.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError, NumericalFailure
from multiphi_exudyn.events.exits import exits_of
from multiphi_exudyn.events.loaded_level import LoadedLevel
from multiphi_exudyn.events.state import Event, Loss, Phase, State, event_table, total_loss
from multiphi_exudyn.levels.model import MultiPhiModel
from multiphi_exudyn.mechanics.arguments import is_real
from multiphi_exudyn.mechanics.friction import Friction
from multiphi_exudyn.mechanics.structure import At
from multiphi_exudyn.time.base_share import row_warnings
from multiphi_exudyn.time.friction_rows import force_row, patch_row, pressing_row
from multiphi_exudyn.time.segment import Segment, Segments, listed
from multiphi_exudyn.time.warning_groups import issue

__all__ = ["Again", "Ledger", "Start", "Statistics", "Trajectory"]

NUDGE = 1e-12  # of the largest speed: more than round-off makes of a run, less than anybody knows of a start
INSTANTS = 1001  # at which a nudged run is compared, beside the events

Again: TypeAlias = "Callable[[np.ndarray, np.ndarray], Trajectory]"


@dataclass(frozen=True)
class Start:
    """y, y' (m,) in base coordinates; compliant contacts that start closed, rigid ones that start at their gap.

    penetrating: with the friction that sticks. gaps: (c,) [m] of all contacts at y = 0, as stops that have moved, and
    held places, leave them.
    states: numbers of all elements' states, those contacts closed. held: places (h,) that links hold.
    time [s], state: when the run begins, and of one that goes on from another what that has come to.
    """

    displacement: np.ndarray
    velocity: np.ndarray
    penetrating: tuple[int, ...]
    touching: tuple[int, ...]
    gaps: np.ndarray
    states: tuple[int, ...]
    held: np.ndarray
    time: float = 0.0
    state: State | None = None


@dataclass(frozen=True)
class Statistics:
    """Work of a run; function_evaluations counts samples of event signals.

    record_bytes: what its segments and events take; array_bytes: the levels, maps and loads of the loop, which runs of
    one model under the same loads share.
    """

    levels_built: int
    levels_possible: int
    transitions: int
    events: int
    segments: int
    function_evaluations: int
    record_bytes: int = 0
    array_bytes: int = 0


@dataclass(frozen=True)
class Ledger:
    """Energies [J]: initial + work_of_loads = final + all that was lost, which are the other rows.

    work_of_loads: that of moving stops and counter-surfaces too. friction: limits times ways slipped on the
    counter-surfaces, and what springs drop by where a static limit lets go. residual: what is left over of the
    equation.
    """

    initial: float
    work_of_loads: float
    impact: float
    truncation_kinetic: float
    truncation_strain: float
    damping: float
    friction: float
    final: float

    @property
    def residual(self) -> float:
        """initial + work - losses - final [J]; round-off if everything is accounted for."""
        lost = self.impact + self.truncation_kinetic + self.truncation_strain + self.damping + self.friction
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
    again: Again | None = field(default=None, repr=False, compare=False)

    def displacement(self, t: float | np.ndarray, side: str = "right") -> np.ndarray:
        """x [m, rad]: (n,) for a scalar t, (n, k) for (k,) times."""
        return self._full(t, side, 0)

    def velocity(self, t: float | np.ndarray, side: str = "right") -> np.ndarray:
        """x' [m/s, rad/s]: (n,) or (n, k)."""
        return self._full(t, side, 1)

    def acceleration(self, t: float | np.ndarray, side: str = "right") -> np.ndarray:
        """x'' [m/s2, rad/s2]: (n,) or (n, k)."""
        shapes = self.model.base.modes.shapes
        return np.asarray(
            self._evaluate(
                t, side, lambda segment, times: shapes @ (segment.level.level.vectors @ segment.modal(times, 2))
            )
        )

    def at(self, point: At, t: float | np.ndarray, side: str = "right") -> float | np.ndarray:
        """Displacement [m] of a point (name, {point: coefficient} or row): a float, or (k,)."""
        if not isinstance(point, (str, Mapping)):
            issue(row_warnings(self.model, self.model.structure.row(point)))
        row = self.model.base.modes.shapes.T @ self.model.structure.row(point)

        def function(level: LoadedLevel) -> np.ndarray:
            place = row @ level.level.vectors
            return np.concatenate([place, np.zeros(len(place)), [row @ level.asymptotic.configuration]])

        return self._values(t, side, function)

    def gap(self, contact: str, t: float | np.ndarray, side: str = "right") -> float | np.ndarray:
        """Gap [m] of a contact: a float, or (k,)."""
        i = self._contact("gap", contact)

        def function(level: LoadedLevel) -> np.ndarray:
            gap = level.level.gap_rows[i]
            return np.concatenate([gap, np.zeros(len(gap)), [level.gap_constants[i]]])

        return self._values(t, side, function)

    def contact_force(self, contact: str, t: float | np.ndarray, side: str = "right") -> float | np.ndarray:
        """Contact force lambda >= 0 [N]: a float, or (k,); impacts of rigid contacts are impulses, not forces."""
        i = self._contact("contact_force", contact)
        return self._values(t, side, lambda level: pressing_row(level, i))

    def contact_impulse(self, contact: str, t0: float, t1: float) -> float:
        """Integral of the contact force over [t0, t1] [N s], impulses of impacts in it included."""
        i = self._contact("contact_impulse", contact)
        first, last = float(self._times(t0)[0]), float(self._times(t1)[0])
        if first > last:
            raise MultiPhiValueError(f"contact_impulse: got t0 = {t0!r} > t1 = {t1!r}, need t0 <= t1")
        links = self.model.pressing_links(i)
        pushed = sum(
            segment.force_integral(link, max(first, segment.start), min(last, segment.end))
            for segment in self.segments
            for link in links
            if link in segment.level.level.indices and segment.start < last and segment.end > first
        )
        within = [event for event in self.events if first <= event.time <= last]
        struck = sum(event.impulse for event in within if event.contact == contact)
        struck += sum(impulse for event in within for name, impulse in event.shared if name == contact)
        return float(pushed + struck)

    def contact_intervals(self, contact: str) -> list[tuple[float, float]]:
        """[(closed at, opened at), ...] [s]; one still closed at the end ends at t_end, instants are left out."""
        return self._intervals(self.model.pressing_links(self._contact("contact_intervals", contact)))

    def friction_force(self, name: str, t: float | np.ndarray, side: str = "right") -> float | np.ndarray:
        """T [N] of a friction, whose force on the structure is -h T: a float, or (k,)."""
        i = self._friction("friction_force", name)
        return self._values(t, side, lambda level: force_row(level, i))

    def slip(self, name: str, t: float | np.ndarray, side: str = "right") -> float | np.ndarray:
        """How far [m] along +h the patch of a friction has moved on its counter-surface since the start.

        A float, or (k,). Exact: it does not change by a bit while the patch sticks.
        """
        i = self._friction("slip", name)
        begun = self._values(self.start.time, "right", lambda level: patch_row(level, i))
        return self._values(t, side, lambda level: patch_row(level, i)) - begun

    def stick_intervals(self, name: str) -> np.ndarray:
        """[[sticks from, slips from], ...] (k, 2) [s]; the first may begin at the start, the last end at t_end.

        Instants are left out: a block without a spring that turns sticks at one and slips on.
        """
        places = self.model.link_places[self._friction("stick_intervals", name)]
        return np.array(self._intervals([k for k in places if self.model.links[k].held])).reshape(-1, 2)

    def _contact(self, what: str, name: str) -> int:
        """Position of what is no friction."""
        i = self.model.index(name)
        if isinstance(self.model.contacts[i], Friction):
            raise MultiPhiValueError(
                f"{what}: got the friction {name!r}, need a contact (friction_force, slip, stick_intervals)"
            )
        return i

    def _friction(self, what: str, name: str) -> int:
        """Position of a friction."""
        i = self.model.index(name)
        if not any(self.model.links[k].held for k in self.model.link_places[i]):
            raise MultiPhiValueError(f"{what}: got {name!r}, which has no friction, need the name of one that has")
        return i

    def _intervals(self, links: Sequence[int]) -> list[tuple[float, float]]:
        """When one of these links holds [s], instants left out."""
        intervals: list[tuple[float, float]] = []
        own = self._segments
        closed = np.array([not set(links).isdisjoint(level.level.indices) for level in own.levels], bool)
        places = np.flatnonzero(closed[own.numbers] & (own.ends > own.starts)) if len(own) else np.zeros(0, np.int64)
        for start, end in zip(own.starts[places].tolist(), own.ends[places].tolist(), strict=True):
            if intervals and intervals[-1][1] == start:
                intervals[-1] = (intervals[-1][0], end)
            else:
                intervals.append((start, end))
        return intervals

    def energy(self, t: float | np.ndarray, side: str = "right") -> float | np.ndarray:
        """Kinetic + strain energy [J], that of closed compliant contacts and of force laws included."""
        return self._evaluate(t, side, lambda segment, times: segment.energy(times))

    @functools.cached_property
    def ledger(self) -> Ledger:
        """Where the energy went; computed when it is asked for. A run that failed at its start has none."""
        if not self.segments:
            raise NumericalFailure(f"ledger: got a run without motion ({self.message}), need one that has started")
        losses = self.start_loss + total_loss(self.events)
        damped, varying, rubbed = self._segments.works
        y0, last = self.start.displacement, self.final
        assert last is not None, "a run with segments has a final state"
        reached = last.level.configuration(last.displacement)
        return Ledger(
            initial=self._initial_energy,
            work_of_loads=float(self.load @ (reached - y0)) + losses.stop_work + varying + self.final_work,
            impact=losses.impact,
            truncation_kinetic=losses.truncation_kinetic,
            truncation_strain=losses.truncation_strain,
            damping=losses.damping + damped,
            friction=losses.friction + rubbed,
            final=last.kinetic + float(last.level.strain(last.displacement)),
        )

    @property
    def _initial_energy(self) -> float:
        """Kinetic and strain energy [J] at the start."""
        start = self.start
        if start.state is not None:
            return start.state.kinetic + float(start.state.level.strain(start.state.displacement))
        strain = self.model.base.strain(start.displacement, start.penetrating, start.gaps)
        return 0.5 * float(start.velocity @ start.velocity) + strain

    def deepest_gap(self, contact: str, samples: int = 20) -> float:
        """Smallest gap [m] of a contact while it is open, 0.0 where truncation left none below zero.

        Looked for where the event rule let the gap be negative, ``samples`` in the shortest period of the level and
        at least as many in a segment.
        """
        i = self._contact("deepest_gap", contact)
        depth = 0.0
        for segment in self.segments:
            exits = [k for k, (element, _) in enumerate(exits_of(segment.level)) if element == i]
            waits = any(segment.phases[k] is not Phase.ARMED for k in exits)
            if waits and set(self.model.pressing_links(i)).isdisjoint(segment.level.level.indices):
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
        even = np.linspace(self.start.time, self.t_end, INSTANTS)
        return np.union1d(even, event_table(self.events, self.model.index)[:, 0])

    def _configurations(self, times: np.ndarray) -> np.ndarray:
        """y (m, k)."""
        return self.model.base.coordinates(self.displacement(times))

    # ------------------------------------------------------------------ evaluation

    def _full(self, t: float | np.ndarray, side: str, derivative: int) -> np.ndarray:
        times = self._times(t)
        places, segments = self._owners(times, side), self._segments
        shapes, states = self.model.base.modes.shapes, segments.states(places, times - segments.starts[places])
        numbers, result = segments.numbers[places], np.empty((len(shapes), len(times)))
        for number in np.unique(numbers).tolist():
            level, own = segments.levels[number], numbers == number
            x = np.linalg.multi_dot([shapes, level.level.vectors, states[derivative, own, : level.level.modes].T])
            result[:, own] = x if derivative else x + (shapes @ level.asymptotic.configuration)[:, None]
        return result if np.ndim(t) else result[:, 0]

    def _values(self, t: float | np.ndarray, side: str, row: Callable[[LoadedLevel], np.ndarray]) -> float | np.ndarray:
        """row.(xi, xi', 1) at times, as ``Segments.values`` has it."""
        found = self._segments.values(self._times(t), _side(side), row)
        return found if np.ndim(t) else float(found[0])

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
        if not self.segments or not np.all((times >= self.start.time) & (times <= self.t_end)):
            raise MultiPhiValueError(
                f"t: got {np.min(times):g} to {np.max(times):g} s, need {self.start.time:g} <= t <= {self.t_end:g} s"
            )
        return times

    @functools.cached_property
    def _segments(self) -> Segments:
        return listed(self.segments)

    def _owners(self, times: np.ndarray, side: str) -> np.ndarray:
        return self._segments.owners(times, _side(side))


def _side(side: str) -> str:
    if side not in ("left", "right"):
        raise MultiPhiValueError(f"side: got {side!r}, need 'left' or 'right'")
    return side


def _parted(run: Trajectory, times: np.ndarray, expected: np.ndarray, limit: float) -> float:
    """First of the times (k,) [s] at which a run is over ``limit`` from y (m, k), or has ended; else the last."""
    reached = int(np.sum(times <= run.t_end))
    apart = np.linalg.norm(run._configurations(times[:reached]) - expected[:, :reached], axis=0)
    first = int(np.argmax(apart > limit)) if np.any(apart > limit) else min(reached, len(times) - 1)
    return float(times[first])
