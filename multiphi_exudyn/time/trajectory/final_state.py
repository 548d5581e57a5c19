"""Final state: the state of a run where it stops, from which it is continued, and what its ledger is made of."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

import multiphi_exudyn._core as core
from multiphi_exudyn.events.excitation.loaded_level import LoadedLevel
from multiphi_exudyn.events.transitions.state import Loss, State
from multiphi_exudyn.time.record.record import PHASES, Record
from multiphi_exudyn.time.trajectory.ledger import Statistics

__all__ = ["NUMBERS", "FinalState"]

NUMBERS = {phase: number for number, phase in enumerate(PHASES)}


@dataclass(frozen=True)
class FinalState:
    """State and sums of a run.

    record: its segments and events. state: the last one, None before the first one. ledger: of the core.
    levels_built: of the model.
    """

    record: Record
    state: State | None
    ledger: core.Ledger
    levels_built: int = 0

    @property
    def level(self) -> LoadedLevel | None:
        """Level of the last state."""
        return None if self.state is None else self.state.level

    @property
    def displacement(self) -> np.ndarray:
        """xi (n,) of the last state."""
        assert self.state is not None, "a run with segments has a final state"
        return self.state.displacement

    def at(self, state: State) -> FinalState:
        """Return a copy with another state."""
        return replace(self, state=state)

    @property
    def start_loss(self) -> Loss:
        """Energies [J] lost at the start that no event records."""
        return Loss() if self.state is None else Loss(*self.ledger.at_start)

    @property
    def given_energy(self) -> float:
        """Kinetic and strain energy [J] at the start of a run that does not continue another one."""
        return self.ledger.start_energy + self.ledger.start_potential

    @property
    def energy(self) -> float:
        """Kinetic and strain energy [J] of the last state."""
        assert self.state is not None, "a run with segments has a final state"
        if not math.isnan(self.ledger.end_energy):
            return self.ledger.end_energy
        return self.state.level.energy(self.state.displacement, self.state.velocity)

    def statistics(self, segments: int, events: int, possible: int) -> Statistics:
        """Work of the run; possible: number of possible levels."""
        return Statistics(
            levels_built=self.levels_built,
            levels_possible=possible,
            transitions=self.record.trajectory.transitions,
            events=events,
            segments=segments,
            function_evaluations=self.record.trajectory.evaluations,
            record_bytes=self.record.bytes,
            array_bytes=self.record.core_levels.bytes,
        )
