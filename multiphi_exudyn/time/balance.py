"""What a run has taken and where its energy went."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields

from multiphi_exudyn.display import Shown

__all__ = ["Ledger", "Statistics"]


@dataclass(frozen=True)
class Statistics:
    """Work of a run; function_evaluations counts samples of event signals.

    record_bytes: what its segments and events take; array_bytes: the levels, maps and loads of the loop, which runs of
    one model under the same loads share.
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
    """Energies [J]: initial + work_of_loads = final + all that was lost, which are the other rows.

    work_of_loads: that of moving stops and counter-surfaces too. friction: limits times ways slipped on the
    counter-surfaces, and what springs drop by where a static limit lets go. residual: what is left over of the
    equation.
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

    def _facts(self) -> Iterator[tuple[str, str]]:
        for name in (*(entry.name for entry in fields(self)), "residual"):
            yield name.replace("_", " "), f"{getattr(self, name):.4g} J"
