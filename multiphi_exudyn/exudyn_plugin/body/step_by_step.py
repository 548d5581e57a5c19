"""Step by step: a body beside others in one run of a solver.

After every step a certified test (certified_step.py) says whether a contact can have asked to change. If so, the step
is done again from its start by the loop of ``simulate`` (exact_step.py), with the force of the step's mean held
constant; where something happened, Exudyn's coordinates, matrices and level are replaced by what came out. The
accelerations that are written carry the force which loads and connectors give in the new level.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.events.state import Event, Phase, State
from multiphi_exudyn.exudyn_plugin.body.certified_step import StepTest
from multiphi_exudyn.exudyn_plugin.body.coordinates import SAME_STEP
from multiphi_exudyn.exudyn_plugin.body.exact_step import BodyInStep, Step, exact_step
from multiphi_exudyn.exudyn_plugin.body.own_loads import OwnLoads
from multiphi_exudyn.exudyn_plugin.body.run_record import RunRecord
from multiphi_exudyn.exudyn_plugin.body.switching import bodies_of
from multiphi_exudyn.exudyn_plugin.coupling.exact_motion import ExactMotion
from multiphi_exudyn.mathematics.bounded_cache import BoundedCache

__all__ = ["StepByStep"]


class StepByStep:
    """One run of ``body`` under ``own`` loads, from a time [s] on in steps of length ``step`` [s].

    motion: does steps again. record: is told of what has happened. running: until another solver begins. state: after
    the last step with an event, or at the start of the run.
    """

    def __init__(
        self,
        body: BodyInStep,
        own: OwnLoads,
        motion: ExactMotion,
        record: RunRecord,
        time: float,
        step: float,
        state: State,
    ) -> None:
        self.running, self.state = True, state
        self._body, self._own, self._motion, self._record = body, own, motion, record
        self._told, self._most = time, 0.0
        self._tests = BoundedCache[tuple[int, ...], StepTest](body.model.most_levels)
        self._prepare(step)
        self._begin(time, body.coordinates.read())

    @property
    def time(self) -> float:
        """Of the last step [s] that is done."""
        return self._test.time

    @property
    def events(self) -> Sequence[Event]:
        """What has happened so far."""
        return self._motion.events

    @property
    def clear(self) -> Callable[[float], int]:
        """Says at the end of a step, by its time [s], whether there is nothing to do."""
        interface = self._body.coordinates.interface
        return self._seen_clear if interface is not None and interface.turns else self._test.clear

    def ends(self, t: float) -> bool:
        """Whether a step of this length ends at t [s]."""
        return abs(t - self.time - self._step) <= self._rounding

    def follow(self, step: float) -> None:
        """Steps have another length [s], that of the present one too."""
        time, start = self._test.time, self._test.start
        self._prepare(step)
        self._begin(time, start)

    def tell(self, t: float) -> None:
        """A step begins that ends at t [s], under loads that vary."""
        self._told = t
        if not self._own.jump(self.time, t, self._rounding):
            self._test.tell(t, self._own.channels_at(t))

    def check(self, mbs: Any, t: float) -> None:
        """Do the step that ends at a time [s] again exactly where something may have happened in it."""
        if self._own.varies and self._told != t:
            raise MultiPhiValueError(
                f"PreStepUserFunction: got a function that replaced the one of {self._body.name!r}, which applies its "
                "loads; need yours set before CreateMultiPhiBody, then both are called"
            )
        if self._body.coordinates.interface is not None:
            self._body.coordinates.interface.look()
        if not self._test.clear(t):
            self._repeat(mbs, t)
            self._begin(t, self._body.coordinates.read())

    def look_again(self) -> None:
        """Take the present state as the start of the next step."""
        self._begin(self.time, self._body.coordinates.read())

    def _repeat(self, mbs: Any, t: float) -> None:
        """Do the step that ends at a time [s] again exactly."""
        here, begun = self._body.coordinates, self.time
        jumped = self._own.jump(begun, t, self._rounding)
        step = Step(begun, t, self._test.start, here.read(), self.state, self._most, jumped)
        found = exact_step(self._body, mbs, self._motion, step)
        self._most, self.state = found.most, found.state
        self._record.see(found.state)
        self._choose_test()
        here.store(here.layout.of(found.state))
        bodies = bodies_of(mbs)
        bodies.disturbed = bodies.disturbed or found.disturbed

    def _prepare(self, step: float) -> None:
        """For steps of this length [s]."""
        self._step, self._rounding = step, SAME_STEP * step
        self._own.take_step(step)
        self._tests.clear()
        self._choose_test()

    def _begin(self, time: float, x: np.ndarray) -> None:
        """A step begins at a time [s] with x."""
        armed = all(phase is Phase.ARMED for phase in self.state.phases)
        channels = (self._own.channels_at(time),) if self._own.varies else ()
        self._test.begin(time, np.concatenate([x, self.state.held, *channels]), armed)

    def _seen_clear(self, t: float) -> int:
        """``clear`` of a body whose interface may turn."""
        assert self._body.coordinates.interface is not None
        self._body.coordinates.interface.look()
        return self._test.clear(t)

    def _choose_test(self) -> None:
        self._test = self._tests.get_or_build(self.state.states, self._new_test)

    def _new_test(self) -> StepTest:
        here = self._body.coordinates
        places = [] if here.interface is None else here.interface.multipliers.tolist()
        conditions = self._own.conditions(here.stepped, self._step, here.direct(here.stepped))
        return StepTest(conditions, self._step, self._rounding, (*here.views, here.multipliers), places)
