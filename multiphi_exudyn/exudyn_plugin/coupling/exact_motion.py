"""Exact motion of a body within a step, from event to event, under forces that are held constant: the loop's.

The arrays serve all bodies in the same levels, one after the other: what the loop finds there is put there for every
advance, the ring of the chatter check too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.errors import MultiPhiError, NumericalFailure
from multiphi_exudyn.events import arrays as a
from multiphi_exudyn.events.entering import set_state
from multiphi_exudyn.events.level_arrays import LevelArrays
from multiphi_exudyn.events.loaded_levels import LoadedLevels
from multiphi_exudyn.events.state import Event, State
from multiphi_exudyn.exudyn_plugin.coupling.modal_force import Acting, HeldForces, Inertia
from multiphi_exudyn.time.chatter import limits
from multiphi_exudyn.time.ending import NUMBERS
from multiphi_exudyn.time.motion import Motion, carry, measured
from multiphi_exudyn.time.record import PHASES, Record
from multiphi_exudyn.time.recorded import Events

__all__ = ["ExactMotion", "Reached"]

ROOM = 32  # segments of a step that are recorded before they are taken


@dataclass(frozen=True)
class Reached:
    """state at ``time`` [s]; changed: whether anything happened on the way.

    before: the state right before the last instant.
    """

    time: float
    state: State
    changed: bool
    before: State


class ExactMotion:
    """Motions in the levels of ``motion``; levels: those of its static loads. name: with which failures are told.

    A run begins at a time [s].
    """

    def __init__(self, motion: Motion, levels: LoadedLevels, name: str, time: float) -> None:
        self._motion, self._levels, self._name = motion, levels, name
        self._forces = motion.levels.held = motion.levels.held or _forces_in(motion.levels)
        self._arrays = motion.arrays = self._forces.arrays
        self._window, self._allowed = limits(motion.model)
        self._ring, self._decisions, self._last_decision = np.zeros(0), 0, time
        self._record = Record(motion.model.contacts, self._arrays)

    @property
    def events(self) -> Sequence[Event]:
        """What has happened in the run but for trials."""
        return Events(self._record, self._record.losses.sum(axis=0))

    def hold(self, acting: Callable[[tuple[int, ...]], Acting], inertia: Inertia | None) -> None:
        """From now on these forces act, by the states of a level, and this hangs on the structure."""
        if self._arrays.full:
            self._forces.forget()
        self._forces.hold(acting, inertia)

    def advance(self, state: State, time: float, until: float, stop: bool = False, trial: bool = False) -> Reached:
        """From a state at a time [s] until another; stop: no further than an event; trial: it is done once more.

        A trial that fails ends there, in the state right before.
        """
        arrays = self._arrays
        level = arrays.level(state.level.states)
        arrays.begin_record()
        self._put_ring()
        self._set_out(level, state, time)
        arrays.ints[a.STOP_AT_EVENT] = int(stop)
        try:
            with np.errstate(all="ignore"):
                changed = self._run(until, trial)
        except (MultiPhiError, np.linalg.LinAlgError) as failure:
            singular = "" if isinstance(failure, MultiPhiError) else "linear algebra of a level or an impact fails: "
            at = float(arrays.numbers[a.TIME])
            raise NumericalFailure(f"{self._name}: at t = {at:.9g} s: {singular}{failure}") from failure
        if not trial:
            self._take_ring()
        after, end = self._state(a.CURRENT), float(arrays.numbers[a.TIME])
        return Reached(end, after, changed, self._state(a.REACHED) if stop else after)

    def _put_ring(self) -> None:
        """The ring of the chatter check into the arrays, which other bodies use too."""
        arrays = self._arrays
        arrays.set_chatter(self._window, self._decisions, self._ring)
        arrays.numbers[a.ALLOWED], arrays.numbers[a.LAST_DECISION] = self._allowed, self._last_decision

    def _take_ring(self) -> None:
        """The same from the arrays."""
        arrays = self._arrays
        if arrays.ints[a.DECISIONS] != self._decisions:
            self._decisions, self._ring = arrays.chatter
            self._last_decision = float(arrays.numbers[a.LAST_DECISION])

    def _set_out(self, level: int, state: State, time: float) -> None:
        """A state at a time [s] into the arrays."""
        arrays, centre = self._arrays, self._forces.centre(level)
        r, arrays.numbers[a.TIME] = len(centre), time
        place, speed = state.displacement.copy(), state.velocity
        place[:r] -= centre
        w, w_t = arrays.channels.at(arrays.buffers, time)
        if len(w):
            place, speed = (np.concatenate([x[:r], at, x[r:]]) for x, at in ((place, w), (speed, w_t)))
        set_state(arrays, level, place, speed, [NUMBERS[phase] for phase in state.phases], measured)

    def _run(self, until: float, trial: bool) -> bool:
        """The loop until it ends, with all that it needs; whether anything happened on the way."""
        arrays, changed = self._arrays, False
        while True:
            answer = int(carry(*arrays.buffers.all, until))
            if answer == a.NEED:
                arrays.supply()
                if not arrays.outgrown:
                    continue
            changed = changed or bool(arrays.ints[a.EVENT_COUNT])
            if not trial:
                self._record.take_events()
                if answer == a.FAILED:
                    raise self._motion.failure()
            if answer not in (a.FULL, a.NEED):
                return changed or answer == a.FAILED
            arrays.begin_record()

    def _state(self, place: int) -> State:
        """A state of the run record, under static loads."""
        ints, numbers = self._arrays.ints, self._arrays.numbers
        state = ints[place : place + a.STATE_INTS].tolist()
        record, phases = state[a.LEVEL], state[a.PHASES]
        level = self._levels.level(self._arrays.loaded[int(ints[record + a.NUMBER])].states)
        standing = ints[phases : phases + ints[record + a.EXIT_COUNT]].tolist()
        r, q = level.modal.modes, int(ints[a.PRESCRIBED])
        n = r + int(ints[a.CHANNELS])
        xi, xi_t = (numbers[start : start + n].copy() for start in (state[a.PLACE], state[a.SPEED]))
        if q:
            xi, xi_t = (np.delete(x, slice(r, r + q)) for x in (xi, xi_t))
        xi[:r] += self._forces.centre(record)
        return State(level, xi, xi_t, tuple([PHASES[k] for k in standing]))


def _forces_in(levels: LoadedLevels) -> HeldForces:
    """Forces in levels, with arrays that only bodies use."""
    arrays = LevelArrays(levels)
    arrays.room = ROOM
    return HeldForces(arrays)
