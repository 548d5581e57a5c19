"""Final state: the state of a run when its loop stops, copied out of the arrays, which another run may then use."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from multiphi_exudyn.events import arrays as a
from multiphi_exudyn.events.excitation.loaded_level import LoadedLevel
from multiphi_exudyn.events.transitions.state import Loss, State
from multiphi_exudyn.time.record.record import PHASES, Record
from multiphi_exudyn.time.trajectory.ledger import Statistics

__all__ = ["NUMBERS", "FinalState"]

NUMBERS = {phase: number for number, phase in enumerate(PHASES)}
NONE = np.zeros(0)


class FinalState(NamedTuple):
    """State, sums and counts of a run, from which it is continued and its ledger and statistics are made.

    numbers: the run's own numbers, the first ones of the arrays. record: its segments and events. level: of the last
    state, None before the first one, with displacement xi, velocity xi' (n,) and the numbers of its exits' phases.
    piece: of the channels. evaluations, transitions: counts so far. decisions, ring: of the chatter check.
    levels_built, array_bytes: of the model, and of the arrays.
    """

    numbers: np.ndarray
    record: Record
    level: LoadedLevel | None = None
    displacement: np.ndarray = NONE
    velocity: np.ndarray = NONE
    phases: tuple[int, ...] = ()
    piece: int = 0
    evaluations: float = 0.0
    transitions: int = 0
    decisions: int = 0
    ring: np.ndarray = NONE
    levels_built: int = 0
    array_bytes: int = 0

    def at(self, state: State) -> FinalState:
        """Return a copy with another state."""
        return self._replace(
            level=state.level,
            displacement=state.displacement,
            velocity=state.velocity,
            phases=tuple([NUMBERS[phase] for phase in state.phases]),
        )

    @property
    def state(self) -> State | None:
        """The last state, None before the first one."""
        if self.level is None:
            return None
        return State(self.level, self.displacement, self.velocity, tuple([PHASES[k] for k in self.phases]))

    @property
    def start_loss(self) -> Loss:
        """Energies [J] lost at the start that no event records."""
        if self.level is None:
            return Loss()
        return Loss(*self.numbers[a.LOST_AT_START : a.LOST_AT_START + a.LOSSES].tolist())

    @property
    def sums(self) -> list[float]:
        """Numbers from which a ledger is made, see ``ledger_of``."""
        sums: list[float] = self.numbers[a.LOST_AT_START : a.WORK + 1].tolist()
        return sums

    @property
    def given_energy(self) -> float:
        """Kinetic and strain energy [J] at the start of a run that does not continue another one."""
        energy, potential = self.numbers[a.GIVEN_ENERGY : a.GIVEN_POTENTIAL + 1].tolist()
        return float(energy + potential)

    @property
    def energy(self) -> float:
        """Kinetic and strain energy [J] of the last state, from the loop where it has computed it."""
        assert self.level is not None, "a run with segments has a final state"
        from_loop = float(self.numbers[a.LEFT_ENERGY])
        if not math.isnan(from_loop):
            return from_loop
        self.record.arrays.add_strain(self.level.states)
        return self.level.energy(self.displacement, self.velocity)

    def statistics(self, segments: int, events: int, possible: int) -> Statistics:
        """Work of the run; possible: number of possible levels."""
        return Statistics(
            levels_built=self.levels_built,
            levels_possible=possible,
            transitions=self.transitions,
            events=events,
            segments=segments,
            function_evaluations=int(self.evaluations),
            record_bytes=self.record.bytes,
            array_bytes=self.array_bytes,
        )
