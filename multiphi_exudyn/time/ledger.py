"""Ledger: the energy balance of a run, its work in counts and bytes, and the final state from which it is continued.

initial + work of loads = final + losses, each side added up on its own
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from typing import NamedTuple

import numpy as np

import multiphi_exudyn._core as core
from multiphi_exudyn.display import Shown
from multiphi_exudyn.time.loaded_level import LoadedLevel
from multiphi_exudyn.time.record import PHASES, Record
from multiphi_exudyn.time.state import Loss, State

__all__ = ["NUMBERS", "FinalState", "Ledger", "Statistics", "ledger_of"]


NUMBERS = {phase: number for number, phase in enumerate(PHASES)}


class Statistics(NamedTuple):
    """Work of a run; function_evaluations counts samples of event signals.

    record_bytes: memory of its segments and events; array_bytes: of the levels, maps and loads of the core, which runs
    of one model under the same loads share.
    """

    levels_built: int
    levels_possible: int
    transitions: int
    events: int
    segments: int
    function_evaluations: int
    record_bytes: int = 0
    array_bytes: int = 0


@dataclass(frozen=True, repr=False)
class Ledger(Shown):
    """Energy balance of a run, all in J: initial + work_of_loads = final + all losses.

    Made by ``Trajectory.ledger``. Two independent sides: losses are added up event by event and in closed form, the
    final energy is that of the last state; ``residual`` is the difference, round-off if no loss is missing.

    Attributes
    ----------
    initial : float
        Kinetic + strain energy [J] at the start.
    work_of_loads : float
        Of loads, moving stops and counter-surfaces [J].
    impact : float
        Lost [J] in impacts of rigid contacts.
    truncation_kinetic, truncation_strain : float
        Lost [J] at transitions, in motion that the modes of the next level do not contain.
    damping : float
        Of the structure and of contacts [J].
    friction : float
        Limits times slip on the counter-surfaces, and losses of springs where a static limit is exceeded [J].
    final : float
        Kinetic + strain energy [J] at the end.
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

    @property
    def turned_over(self) -> float:
        """Sum of the absolute values of all rows [J]: the scale of the residual."""
        lost = abs(self.impact) + abs(self.truncation_kinetic) + abs(self.truncation_strain)
        lost += abs(self.damping) + abs(self.friction)
        return abs(self.initial) + abs(self.work_of_loads) + lost + abs(self.final)

    def _facts(self) -> Iterator[tuple[str, str]]:
        for name in (*(entry.name for entry in fields(self)), "residual"):
            yield name.replace("_", " "), f"{getattr(self, name):.4g} J"


def ledger_of(
    kept: core.Ledger, works: tuple[float, float, float], static: float, initial: float, final: float
) -> Ledger:
    """The ledger of a run from the numbers that the core has kept.

    works [J]: of damping, varying loads and friction, of all segments. static: work [J] of constant loads.
    """
    damped, varying, rubbed = works
    lost = Loss(*kept.at_start) + Loss(*kept.at_events)
    return Ledger(
        initial=initial,
        work_of_loads=static + lost.stop_work + varying + kept.load_work,
        impact=lost.impact,
        truncation_kinetic=lost.truncation_kinetic,
        truncation_strain=lost.truncation_strain,
        damping=lost.damping + damped,
        friction=lost.friction + rubbed,
        final=final,
    )


class Counts(NamedTuple):
    """Work of a run so far, a copy: later runs in the same levels do not change it. Bytes: see Statistics."""

    levels_built: int
    transitions: int
    function_evaluations: int
    record_bytes: int
    array_bytes: int


@dataclass(frozen=True)
class FinalState:
    """State and sums of a run.

    record: its segments and events. state: the last one, None before the first one. ledger: of the core.
    counts: of its work.
    """

    record: Record
    state: State | None
    ledger: core.Ledger
    counts: Counts

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
        return Statistics(levels_possible=possible, events=events, segments=segments, **self.counts._asdict())
