"""Exact motion of a body within a step, from event to event, under constant forces, by the core.

All bodies in the same levels share those under such forces: what has been made for one step serves all later ones, only
its constants change. So the forces have to be set before every advance, where another body may have set its own.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

import multiphi_exudyn._core as core
from multiphi_exudyn.errors import MultiPhiError, NumericalFailure
from multiphi_exudyn.events.transitions.loaded_levels import LoadedLevels
from multiphi_exudyn.events.transitions.state import Event, Loss, Phase, State
from multiphi_exudyn.exudyn_plugin.coupling.modal_force import Inertia, LevelForces
from multiphi_exudyn.levels.core_model import core_model
from multiphi_exudyn.mathematics.blas_threads import one_blas_thread
from multiphi_exudyn.mathematics.round_off import INDEPENDENT
from multiphi_exudyn.mechanics.elements.element import Element, event_kind
from multiphi_exudyn.time.core_levels import core_excitation, level_data
from multiphi_exudyn.time.run.chatter import limits
from multiphi_exudyn.time.run.failures import failure

__all__ = ["AdvanceResult", "ExactMotion"]

LEVEL_BYTES = 2**29  # of all levels under held forces: with more they are made anew
CORE_PHASES = {phase: getattr(core.Phase, phase.name.lower()) for phase in Phase}
PHASES = {number: phase for phase, number in CORE_PHASES.items()}


@dataclass(frozen=True)
class AdvanceResult:
    """Result of an advance: ``state`` at ``time`` [s], and the state right before its last event.

    changed: whether an event occurred, or a trial failed.
    """

    time: float
    state: State
    changed: bool
    state_before: State


class ExactMotion:
    """Motions in these levels under held forces, in a run that begins at ``time`` [s]; name: for messages of failures.

    Its states are those under static loads alone, without the forces.
    """

    def __init__(self, levels: LoadedLevels, name: str, time: float) -> None:
        self._model, self._static_levels, self._name = levels.model, levels.alone, name
        self._levels = levels.held = levels.held or _held_levels(levels)
        self._run = core.Run(self._levels, *limits(self._model), time)
        self._run.sums_works = self._run.keeps_summary = False  # a body does not report them
        self._attached: Inertia | None = None
        self._any_rigid = any(element.rigid and not element.held for element in self._model.contacts)
        self.events: list[Event] = []

    def set_forces(self, forces: Callable[[tuple[int, ...]], LevelForces], inertia: Inertia | None) -> None:
        """Set the forces, a function of a level's states, and the inertia that is attached to the structure."""
        if self._levels.bytes > LEVEL_BYTES:
            self._levels.forget()
        self._levels.set_forces(forces, None if inertia is None else (inertia.mobility, inertia.velocity_map))
        if self._any_rigid and inertia is not self._attached:
            self._run.set_attached(*_attached(self._levels, inertia))
            self._attached = inertia

    def advance(
        self, state: State, time: float, until: float, stop: bool = False, trial: bool = False
    ) -> AdvanceResult:
        """Advance from a state at ``time`` [s] to ``until`` [s]; stop: end at the first event.

        trial: the events are not recorded, as the advance will be repeated. A trial that fails ends in the state right
        before the failure.
        """
        run, chatter = self._run, self._run.chatter if trial else None
        try:
            with np.errstate(all="ignore"):
                run.begin_step(time, _core_state(state))
                told = run.advance(until, stop)
            if told is not None and not trial:
                raise failure(self._model, told, run.present.key)
        except (MultiPhiError, np.linalg.LinAlgError) as error:
            singular = "" if isinstance(error, MultiPhiError) else "linear algebra of a level or an impact fails: "
            raise NumericalFailure(f"{self._name}: at t = {run.time:.9g} s: {singular}{error}") from error
        finally:
            events = _events(run.trajectory, self._model.contacts)
            if chatter is None:
                self.events.extend(events)
            else:
                run.chatter = chatter
        after, changed = self._state(run.present), told is not None or bool(events)
        return AdvanceResult(run.time, after, changed, self._state(run.reached) if stop else after)

    def _state(self, state: core.StepState) -> State:
        phases = tuple([PHASES[phase] for phase in state.phases])
        return State(self._static_levels.level(state.key), state.displacement, state.velocity, phases)


def _held_levels(levels: LoadedLevels) -> core.HeldLevels:
    """Levels under held forces, each built on first use."""

    @one_blas_thread()
    def build(states: Sequence[int]) -> core.LevelData:
        return level_data(levels.level(states))

    return core.HeldLevels(core_model(levels.model), core_excitation(levels), build)


def _core_state(state: State) -> core.StepState:
    phases = [CORE_PHASES[phase] for phase in state.phases]
    return core.StepState(state.level.states, state.displacement, state.velocity, phases)


def _attached(levels: core.HeldLevels, inertia: Inertia | None) -> tuple[np.ndarray, float, list[int]]:
    """Directions of the links under attached inertia, empty without it, which of them are redundant, and immovable."""
    if inertia is None:
        return np.zeros((0, 0)), INDEPENDENT, []
    directions, elements = levels.model.unit_directions, levels.model.size
    directions[:elements] = inertia.directions(directions[:elements])
    return directions, inertia.independence, list(inertia.immovable)


def _events(trajectory: core.Trajectory, elements: Sequence[Element]) -> list[Event]:
    """Events of a trajectory; an impulse on a contact that stays closed belongs to the next one."""
    events, shared = list[Event](), list[tuple[str, float]]()
    names = "times", "elements", "entered", "left", "impulses", "losses"
    columns = (getattr(trajectory, f"event_{name}").tolist() for name in names)
    for time, index, entered, left, impulse, loss in zip(*columns, strict=True):
        element = elements[index]
        if entered == core.SHARED:
            shared.append((element.name, impulse))
            continue
        kind = event_kind(element.states, left, entered)
        state = element.states[entered].name
        events.append(Event(time, element.name, kind, Loss(*loss), impulse, tuple(shared), state))
        shared.clear()
    return events
