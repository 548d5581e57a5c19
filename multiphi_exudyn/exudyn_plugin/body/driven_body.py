"""Multi-Phi body under loads and stops that vary in time (driven/excitation.py).

    M q'' + D q' + K q = drive + P w(t) + Q w'(t) + (loads and connectors of the system)

A body on which nothing else acts is told to Exudyn at the end of every step as its known motion has it (run_ahead.py):
its histories are those of ``simulate``.

Beside others Exudyn is given the modal force at the end of every step before it; the trapezoidal rule makes of it a
motion of second order in the step. Where an event is in doubt the step is repeated exactly, with w(t) itself and not
its mean, as a native run would do it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.events.rule import EventRule
from multiphi_exudyn.events.state import Phase, State
from multiphi_exudyn.events.transition import LoadedLevel
from multiphi_exudyn.exudyn_plugin.body.body import MultiPhiBody
from multiphi_exudyn.exudyn_plugin.body.certified_driven_step import DrivenStepTest, jump_times
from multiphi_exudyn.exudyn_plugin.coupling.stepped_level import SteppedLevel
from multiphi_exudyn.mathematics.bounded_cache import BoundedCache
from multiphi_exudyn.mechanics.loads import Load
from multiphi_exudyn.time.driven.excitation import Excitation
from multiphi_exudyn.time.driven.motion import DrivenMotion
from multiphi_exudyn.time.driven.rule import DrivenRule
from multiphi_exudyn.time.driven.state import DrivenState
from multiphi_exudyn.time.motion import Motion
from multiphi_exudyn.time.simulate import motion_of

__all__ = ["DrivenBody"]

FINER = 10.0  # smooth courses of loads are taken to a tenth of their tolerance
CHUNK = 256  # steps whose channels are evaluated at once


class DrivenBody(MultiPhiBody):
    """A body with an excitation; see the module's docstring."""

    def __init__(self, name: str, motion: DrivenMotion, loads: Sequence[Load], matched_step: float | None) -> None:
        assert isinstance(motion.rule, DrivenRule)
        self._loads = tuple(loads)
        self._driven: DrivenRule = motion.rule
        self._channels = _Channels(motion.rule.excitation)
        self._driven_tests: BoundedCache[tuple[int, ...], DrivenStepTest] = BoundedCache(motion.model.most_levels)
        self._w = np.zeros((2, motion.rule.excitation.channels))
        self._told = 0.0
        super().__init__(name, motion, matched_step)

    @property
    def excitation(self) -> Excitation:
        """The body's own loads."""
        return self._driven.excitation

    def force_vector(self, stepped: SteppedLevel) -> np.ndarray:
        """Constant force (s,) of the object in a level, at the present time."""
        return stepped.drive + self._force_at(stepped.closed, self._now)

    @property
    def varies(self) -> bool:
        """Whether its loads vary in time."""
        return True

    def own_forces(self, closed: tuple[int, ...], times: np.ndarray) -> np.ndarray:
        """Modal forces (k, s) of its own varying loads at times (k,) [s], in a level."""
        return self._forces(closed, self.excitation.values(times))

    def _forces(self, closed: tuple[int, ...], values: np.ndarray) -> np.ndarray:
        """Modal forces (k, s) of w, w' (k, 2, q) in a level."""
        level, forces = self._driven.level(closed), np.zeros((len(values), self._size))
        forces[:, : level.plain.level.modes] = values[:, 0] @ level.force.T + values[:, 1] @ level.force_rate.T
        return forces

    def _force_at(self, closed: tuple[int, ...], time: float) -> np.ndarray:
        """The same (s,) at the end of a step, of which many are evaluated at once."""
        return self._forces(closed, self._channels.at(time)[None])[0]

    def shown(
        self, stepped: SteppedLevel, eta: np.ndarray, eta_t: np.ndarray, time: np.ndarray
    ) -> tuple[LoadedLevel, np.ndarray, np.ndarray]:
        """Level and coordinates xi, xi' (r + q, k) in which configurations and forces at times (k,) are read."""
        w, w_t = self.excitation.values(time).transpose(1, 2, 0)
        return self._driven.level(stepped.closed), np.vstack([eta, w]), np.vstack([eta_t, w_t])

    def before_step(self, mbs: Any, t: float) -> None:
        """Called by Exudyn before a step that ends at t: beside others, the force that will then act."""
        if self._run_ahead is not None:
            return
        self._told = t
        force = self.coordinates.stepped.drive + self._force_at(self.coordinates.stepped.closed, t)
        mbs.SetObjectParameter(self.items["oGenericODE2"], "forceVector", force)

    def _check_step(self, mbs: Any, begun: float) -> None:
        """Do the step from a time [s] on again exactly where something may have happened in it."""
        t = self.time
        if self._told != t:
            raise MultiPhiValueError(
                f"PreStepUserFunction: got a function that replaced the loads of {self.name!r}, need it set before "
                "CreateMultiPhiBody (it is then called after them)"
            )
        x, w = self.coordinates.read(), self._channels.at(t)
        test = self._driven_test()
        armed = all(phase is Phase.ARMED for phase in self._state.phases)
        jumped = self._jumps(begun, t)
        if not (armed and test.clear(self._x, self._w, x, w) and not jumped):
            self._repeat(mbs, begun, self._x, x, jumped)
            x = self.coordinates.read()
        self._x, self._w = x, w

    @property
    def _now(self) -> float:
        return 0.0 if math.isnan(self.time) else self.time

    def _jumps(self, begun: float, t: float) -> bool:
        """Whether a load jumps in a step, its ends included: their times are rounded, in a force as in the solver."""
        first = int(np.searchsorted(self._jump_times, begun - self._rounding))
        return first < len(self._jump_times) and self._jump_times[first] <= t + self._rounding

    def _begin(self, mbs: Any, t: float) -> None:
        """Take state and level from the system, and the loads up to the end of its run."""
        end = float(mbs.sys["simulationSettings"].timeIntegration.endTime)
        excitation = Excitation.of(self.model, self._loads, end, FINER)
        self._driven = DrivenRule(self._driven.plain, excitation, t, end)
        self._channels = _Channels(excitation)
        self._jump_times = jump_times(excitation)
        super()._begin(mbs, t)
        self._told = t

    def _take_step(self, step: float) -> None:
        super()._take_step(step)
        self._driven_tests.clear()
        self._channels.step = step
        self._w = self._channels.at(self._now)

    def _sample(self) -> None:
        """Take the present state as the start of the next step."""
        self._x = self.coordinates.read()

    def _driven_test(self) -> DrivenStepTest:
        return self._driven_tests.get_or_build(self.coordinates.stepped.closed, self._new_test)

    def _new_test(self) -> DrivenStepTest:
        closed = self.coordinates.stepped.closed
        level = self._driven.level(closed)
        rows = [self._driven.function(level, contact) for contact in self._driven.ends(closed)]
        return DrivenStepTest(self.coordinates.stepped, level, rows, self._step)

    def _plain_rule(self) -> EventRule:
        return self._driven.plain

    def _plain(self, state: State) -> State:
        return state.plain if isinstance(state, DrivenState) else state

    def _own_force(self, closed: tuple[int, ...], time: float) -> np.ndarray:
        return self._force_at(closed, time)  # there is no interface

    def _departing(self, rule: EventRule, state: State, time: float) -> tuple[EventRule, State]:
        forced = DrivenRule(rule, self.excitation, time, self.time)
        return forced, forced.state(state)

    def _own_motion(self, end: float) -> tuple[Motion, State]:
        self._driven.set_out(self.time, end)
        return motion_of(self.model, self._driven, self._motion.start, None), self._driven.state(self._state)

    def _read_by(self, state: State, time: float) -> tuple[EventRule, State]:
        self._driven.set_out(time, time)
        return self._driven, self._driven.state(state)


class _Channels:
    """w, w' at the ends of equal steps, evaluated many at a time."""

    def __init__(self, excitation: Excitation) -> None:
        self._excitation = excitation
        self.step = math.nan
        self._begun, self._values = math.nan, np.zeros((0, 2, excitation.channels))

    def at(self, t: float) -> np.ndarray:
        """(2, q) at a time."""
        place = (t - self._begun) / self.step
        index = round(place) if math.isfinite(place) else -1
        if not (0 <= index < len(self._values) and abs(place - index) <= 1e-9 * max(1.0, t / self.step)):
            if not math.isfinite(self.step):
                return self._excitation.values(np.array([t]))[0]
            self._begun, index = t, 0
            self._values = self._excitation.values(t + self.step * np.arange(CHUNK))
        found: np.ndarray = self._values[index]
        return found
