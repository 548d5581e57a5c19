"""Step by step: one run of a body that is coupled to other items of the system, or acted on by them.

After every step a certified test (certified_step.py) shows that no event can have occurred in it. Where the test fails,
the core computes the step again from its start (exact_step.py), with the mean force of the step held
constant. If an event occurred, its result replaces Exudyn's coordinates, matrices and level. The accelerations that are
written belong to the forces of loads and connectors in the new level.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

import multiphi_exudyn._core as core
from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.events.transitions.state import Event, Phase, State
from multiphi_exudyn.exudyn_plugin.body.solver.switching import bodies_of
from multiphi_exudyn.exudyn_plugin.body.state.coordinates import SAME_STEP
from multiphi_exudyn.exudyn_plugin.body.state.run_record import RunRecord
from multiphi_exudyn.exudyn_plugin.body.stepping.certified_step import step_test
from multiphi_exudyn.exudyn_plugin.body.stepping.exact_step import BodyInStep, Step, exact_step
from multiphi_exudyn.exudyn_plugin.body.stepping.own_loads import OwnLoads
from multiphi_exudyn.exudyn_plugin.coupling.exact_motion import ExactMotion
from multiphi_exudyn.mathematics.bounded_cache import BoundedCache
from multiphi_exudyn.time.reliability.law_span import laws_at_an_end

__all__ = ["StepwiseRun"]


class StepwiseRun:
    """One run of ``body`` under its own ``loads``, from a time [s] on in steps of length ``step`` [s].

    motion: computes steps again. record: of levels and energies, for the warnings. running: until another solver
    begins. state: after the last step with an event, or at the start of the run.
    """

    def __init__(
        self,
        body: BodyInStep,
        loads: OwnLoads,
        motion: ExactMotion,
        record: RunRecord,
        time: float,
        step: float,
        state: State,
    ) -> None:
        self.running, self.state = True, state
        self._body, self._loads, self._motion, self._record = body, loads, motion, record
        self._announced_end, self._largest_energy = time, 0.0
        self._tests = BoundedCache[tuple[int, ...], core.StepTest](body.model.most_levels)
        self._prepare(step)
        self._begin(time, body.coordinates.copy_state())

    @property
    def time(self) -> float:
        """End of the last finished step [s]."""
        return self._test.time

    @property
    def events(self) -> Sequence[Event]:
        """Events of the run so far."""
        return self._motion.events

    @property
    def is_step_clear(self) -> Callable[[float], int]:
        """Function of the end of a step [s]: nonzero if no event can have occurred in the step."""
        interface = self._body.coordinates.interface
        is_watched = self._is_at_end or (interface is not None and interface.shows_rotations)
        return self._watch_and_test if is_watched else self._test.is_step_clear

    def is_step_end(self, t: float) -> bool:
        """Whether a step of this length ends at t [s]."""
        return abs(t - self.time - self._step_size) <= self._rounding

    def change_step_size(self, step: float) -> None:
        """Take another step size [s], from the present step on."""
        time, start = self._test.time, self._test.start
        self._prepare(step)
        self._begin(time, start)

    def announce_step_end(self, t: float) -> None:
        """Announce, before a step, that it ends at t [s]; needed for loads that vary."""
        self._announced_end = t
        if not self._loads.has_jump(self.time, t, self._rounding):
            self._test.set_end_channels(t, self._loads.channels_at(t))

    def check(self, mbs: Any, t: float) -> None:
        """Compute the step that ends at t [s] again if an event may have occurred in it."""
        if self._loads.varies and self._announced_end != t:
            raise MultiPhiValueError(
                f"PreStepUserFunction: got a function that replaced the one of {self._body.name!r}, which applies its "
                "loads; need yours set before CreateMultiPhiBody, then both are called"
            )
        if self._body.coordinates.interface is not None:
            self._body.coordinates.interface.record_angles()
        if not self._test.is_step_clear(t):
            self._repeat(mbs, t)
            self._begin(t, self._body.coordinates.copy_state())
        self._record_laws(t)

    def restart_step(self) -> None:
        """Take the present state as the start of the next step."""
        self._begin(self.time, self._body.coordinates.copy_state())

    def _repeat(self, mbs: Any, t: float) -> None:
        """Compute the step that ends at t [s] again, exactly."""
        coordinates, start_time = self._body.coordinates, self.time
        load_jumps = self._loads.has_jump(start_time, t, self._rounding)
        step = Step(
            start_time, t, self._test.start, coordinates.copy_state(), self.state, self._largest_energy, load_jumps
        )
        outcome = exact_step(self._body, mbs, self._motion, step)
        self._largest_energy, self.state = outcome.largest_energy, outcome.state
        self._record.include_state(outcome.state)
        self._choose_test()
        coordinates.write_level_data(coordinates.layout.from_state(outcome.state))
        self._body.include_step_error(t)
        bodies = bodies_of(mbs)
        bodies.others_disturbed = bodies.others_disturbed or outcome.disturbs_others

    def _prepare(self, step: float) -> None:
        """Prepare loads and test for a step size [s]."""
        self._step_size, self._rounding = step, SAME_STEP * step
        self._loads.set_step(step)
        self._tests.clear()
        self._choose_test()

    def _begin(self, time: float, x: np.ndarray) -> None:
        """Begin a step at a time [s] with the state x."""
        armed = all(phase is Phase.ARMED for phase in self.state.phases)
        channels = (self._loads.channels_at(time),) if self._loads.varies else ()
        self._test.begin(time, np.concatenate([x, self.state.held, *channels]), armed)

    def _watch_and_test(self, t: float) -> int:
        """``is_step_clear`` of a body whose turning, or a force law in a last segment, is recorded."""
        if self._body.coordinates.interface is not None:
            self._body.coordinates.interface.record_angles()
        is_clear = self._test.is_step_clear(t)
        if is_clear:
            self._record_laws(t)
        return is_clear

    def _record_laws(self, t: float) -> None:
        """Record the places of force laws at t [s] if one in a last segment may be beyond its span."""
        if not self._is_at_end:
            return
        coordinates = self._body.coordinates
        stepped, times = coordinates.stepped, np.array([t])
        q = coordinates.views[0][: stepped.modes]
        if not self._loads.varies and np.abs(self._span_rows.dot(q) + self._span_offsets).max() <= 1.0:
            return
        level, xi, _ = self._loads.level_coordinates(
            stepped, q[:, None], 0 * q[:, None], self.state.held[:, None], times
        )
        self._record.include_places(level, xi, times)

    def _prepare_spans(self) -> None:
        """Prepare the places of force laws in a last segment, -1 to 1 inside their spans, for constant loads."""
        laws = laws_at_an_end(self._body.model, [self.state.states])
        self._is_at_end = bool(laws)
        if not laws or self._loads.varies:
            return
        level, r = self._loads.loaded_levels.level(self.state.states), self._body.coordinates.stepped.modes
        indices = [self._body.model.index(law.name) for law in laws]
        ends = np.array([[law.knots[0], law.knots[-1]] for law in laws])
        middles, halves = np.mean(ends, axis=1), np.diff(ends, axis=1)[:, 0] / 2
        rows, centres = level.level.gap_rows[indices], np.array([law.centre for law in laws])
        places = centres + level.gap_constants[indices] + rows[:, r:] @ self.state.held
        self._span_rows, self._span_offsets = rows[:, :r] / halves[:, None], (places - middles) / halves

    def _choose_test(self) -> None:
        self._prepare_spans()
        self._test = self._tests.get_or_build(self.state.states, self._new_test)

    def _new_test(self) -> core.StepTest:
        coordinates = self._body.coordinates
        indices = [] if coordinates.interface is None else coordinates.interface.multipliers.tolist()
        conditions = self._loads.conditions(
            coordinates.stepped, self._step_size, coordinates.direct_reactions(coordinates.stepped)
        )
        return step_test(
            conditions, self._step_size, self._rounding, (*coordinates.views, coordinates.multipliers), indices
        )
