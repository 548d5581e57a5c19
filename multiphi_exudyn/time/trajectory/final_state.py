"""Ending: where a run stands when its loop stops, copied out of the arrays, which another run may have from then on."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from multiphi_exudyn.events import arrays as a
from multiphi_exudyn.events.excitation.loaded_level import LoadedLevel
from multiphi_exudyn.events.transitions.state import Loss, State
from multiphi_exudyn.time.record.record import PHASES, Record
from multiphi_exudyn.time.trajectory.ledger import Statistics

__all__ = ["NUMBERS", "Ending"]

NUMBERS = {phase: number for number, phase in enumerate(PHASES)}
NONE = np.zeros(0)


class Ending(NamedTuple):
    """What a run goes on from, and what is told of it when somebody asks.

    numbers: the first ones of the arrays, which are a run's own. record: what it has left. level: of its last state,
    None before the first one, with displacement xi, velocity xi' (n,) and the numbers of its exits' phases.
    decisions, ring: of the chatter check. piece: of the channels. evaluations, transitions: so far. levels_built,
    array_bytes: of the model, and of the arrays.
    """

    numbers: np.ndarray
    record: Record
    level: LoadedLevel | None = None
    displacement: np.ndarray = NONE
    velocity: np.ndarray = NONE
    phases: tuple[int, ...] = ()
    decisions: int = 0
    ring: np.ndarray = NONE
    piece: int = 0
    evaluations: float = 0.0
    transitions: int = 0
    levels_built: int = 0
    array_bytes: int = 0

    def at(self, state: State) -> Ending:
        """The same in another state."""
        return self._replace(
            level=state.level,
            displacement=state.displacement,
            velocity=state.velocity,
            phases=tuple([NUMBERS[phase] for phase in state.phases]),
        )

    @property
    def state(self) -> State | None:
        """The last state."""
        if self.level is None:
            return None
        return State(self.level, self.displacement, self.velocity, tuple([PHASES[k] for k in self.phases]))

    @property
    def start_loss(self) -> Loss:
        """Energies [J] that the start took, where no event carries them."""
        if self.level is None:
            return Loss()
        return Loss(*self.numbers[a.LOST_AT_START : a.LOST_AT_START + a.LOSSES].tolist())

    @property
    def sums(self) -> list[float]:
        """What a ledger is made of, see ``ledger_of``."""
        sums: list[float] = self.numbers[a.LOST_AT_START : a.WORK + 1].tolist()
        return sums

    @property
    def given_energy(self) -> float:
        """Kinetic and strain energy [J] that a run was given that sets out."""
        energy, potential = self.numbers[a.GIVEN_ENERGY : a.GIVEN_POTENTIAL + 1].tolist()
        return float(energy + potential)

    @property
    def energy(self) -> float:
        """Kinetic and strain energy [J] of the last state; the loop has that of runs which end like this one."""
        assert self.level is not None, "a run with segments has a final state"
        left = float(self.numbers[a.LEFT_ENERGY])
        if not math.isnan(left):
            return left
        self.record.arrays.add_strain(self.level.states)
        return self.level.energy(self.displacement, self.velocity)

    def statistics(self, segments: int, events: int, possible: int) -> Statistics:
        """What the run has taken; possible: levels."""
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
