"""Exact motion of a body within a step, from event to event, under constant forces, by the loop of ``simulate``.

All bodies of the same levels share the arrays of the loop. So every advance first writes its state there, and the ring
buffer of the chatter check.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.errors import MultiPhiError, NumericalFailure
from multiphi_exudyn.events import arrays as a
from multiphi_exudyn.events.packing.level_arrays import LevelArrays
from multiphi_exudyn.events.packing.start_arrays import set_state
from multiphi_exudyn.events.transitions.loaded_levels import LoadedLevels
from multiphi_exudyn.events.transitions.state import Event, State
from multiphi_exudyn.exudyn_plugin.coupling.modal_force import ConstantForces, Inertia, LevelForces
from multiphi_exudyn.time.loop.chatter import limits
from multiphi_exudyn.time.record.record import PHASES, Record
from multiphi_exudyn.time.record.recorded_segments import Events
from multiphi_exudyn.time.run.motion import Motion, carry, measured
from multiphi_exudyn.time.trajectory.final_state import NUMBERS

__all__ = ["AdvanceResult", "ExactMotion"]

ROOM = 32  # segments that the arrays record before they are copied


@dataclass(frozen=True)
class AdvanceResult:
    """Result of an advance: ``state`` at ``time`` [s], and the state right before its last event.

    changed: whether an event occurred, or a request was refused.
    """

    time: float
    state: State
    changed: bool
    state_before: State


class ExactMotion:
    """Motions in the levels of ``motion``, in a run that begins at ``time`` [s].

    levels: those under static loads alone. name: for messages of failures.
    """

    def __init__(self, motion: Motion, levels: LoadedLevels, name: str, time: float) -> None:
        self._motion, self._levels, self._name = motion, levels, name
        self._forces = motion.levels.held = motion.levels.held or _constant_forces(motion.levels)
        self._arrays = motion.arrays = self._forces.arrays
        self._window, self._allowed = limits(motion.model)
        self._ring, self._decisions, self._last_decision = np.zeros(0), 0, time
        self._record = Record(motion.model.contacts, self._arrays)

    @property
    def events(self) -> Sequence[Event]:
        """Events of the run, without those of trials."""
        return Events(self._record, self._record.losses.sum(axis=0))

    def set_forces(self, forces: Callable[[tuple[int, ...]], LevelForces], inertia: Inertia | None) -> None:
        """Set the forces, a function of a level's states, and the inertia that is attached to the structure."""
        if self._arrays.full:
            self._forces.forget()
        self._forces.set_forces(forces, inertia)

    def advance(
        self, state: State, time: float, until: float, stop: bool = False, trial: bool = False
    ) -> AdvanceResult:
        """Advance from a state at ``time`` [s] to ``until`` [s]; stop: end at the first event.

        trial: the events are not recorded, as the advance will be repeated. A trial that fails ends in the state right
        before the failure.
        """
        arrays = self._arrays
        level = arrays.level(state.level.states)
        arrays.begin_record()
        self._write_ring()
        self._write_start(level, state, time)
        arrays.ints[a.STOP_AT_EVENT] = int(stop)
        try:
            with np.errstate(all="ignore"):
                changed = self._run(until, trial)
        except (MultiPhiError, np.linalg.LinAlgError) as failure:
            singular = "" if isinstance(failure, MultiPhiError) else "linear algebra of a level or an impact fails: "
            at = float(arrays.numbers[a.TIME])
            raise NumericalFailure(f"{self._name}: at t = {at:.9g} s: {singular}{failure}") from failure
        if not trial:
            self._read_ring()
        after, end = self._state(a.CURRENT), float(arrays.numbers[a.TIME])
        return AdvanceResult(end, after, changed, self._state(a.REACHED) if stop else after)

    def _write_ring(self) -> None:
        """Write the ring buffer of the chatter check into the arrays, which other bodies use too."""
        arrays = self._arrays
        arrays.set_chatter(self._window, self._decisions, self._ring)
        arrays.numbers[a.ALLOWED], arrays.numbers[a.LAST_DECISION] = self._allowed, self._last_decision

    def _read_ring(self) -> None:
        """Read the ring buffer of the chatter check from the arrays."""
        arrays = self._arrays
        if arrays.ints[a.DECISIONS] != self._decisions:
            self._decisions, self._ring = arrays.chatter
            self._last_decision = float(arrays.numbers[a.LAST_DECISION])

    def _write_start(self, level: int, state: State, time: float) -> None:
        """Write a state at a time [s] into the arrays."""
        arrays, centre = self._arrays, self._forces.centre(level)
        r, arrays.numbers[a.TIME] = len(centre), time
        position, velocity = state.displacement.copy(), state.velocity
        position[:r] -= centre
        w, w_t = arrays.channels.at(arrays.buffers, time)
        if len(w):
            position, velocity = (np.concatenate([x[:r], at, x[r:]]) for x, at in ((position, w), (velocity, w_t)))
        set_state(arrays, level, position, velocity, [NUMBERS[phase] for phase in state.phases], measured)

    def _run(self, until: float, trial: bool) -> bool:
        """Run the loop until it ends, and supply the levels it needs; whether an event occurred or was refused."""
        arrays, changed = self._arrays, False
        while True:
            status = int(arrays.buffers.bound(carry)(until))
            if status == a.NEED:
                arrays.supply()
                if not arrays.outgrown:
                    continue
            changed = changed or bool(arrays.ints[a.EVENT_COUNT])
            if not trial:
                self._record.collect_events()
                if status == a.FAILED:
                    raise self._motion.failure()
            if status not in (a.FULL, a.NEED):
                return changed or status == a.FAILED
            arrays.begin_record()

    def _state(self, position: int) -> State:
        """A state in the arrays, in coordinates of the levels under static loads."""
        ints, numbers = self._arrays.ints, self._arrays.numbers
        state = ints[position : position + a.STATE_INTS].tolist()
        record, phases = state[a.LEVEL], state[a.PHASES]
        level = self._levels.level(self._arrays.loaded[int(ints[record + a.NUMBER])].states)
        phase_numbers = ints[phases : phases + ints[record + a.EXIT_COUNT]].tolist()
        r, q = level.modal.modes, int(ints[a.PRESCRIBED])
        n = r + int(ints[a.CHANNELS])
        xi, xi_t = (numbers[start : start + n].copy() for start in (state[a.PLACE], state[a.SPEED]))
        if q:
            xi, xi_t = (np.delete(x, slice(r, r + q)) for x in (xi, xi_t))
        xi[:r] += self._forces.centre(record)
        return State(level, xi, xi_t, tuple([PHASES[k] for k in phase_numbers]))


def _constant_forces(levels: LoadedLevels) -> ConstantForces:
    """Constant forces in levels, with arrays that only bodies use."""
    arrays = LevelArrays(levels)
    arrays.room = ROOM
    return ConstantForces(arrays)
