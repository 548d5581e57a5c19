"""What the runners of all kinds of models share: preparation, the timed solution, histories, and a gain of energy.

Offline is what is done once for any start: discretisation, linearisation, modes, and here the static start. Online is
the solver alone, from the start to the end of the run. The event loop is compiled before a clock starts: a machine pays
that once.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from multiphi_exudyn.mathematics.compiling.compiled import available, compile_entries
from multiphi_exudyn.study.running.runs import ModelRun
from multiphi_exudyn.study.running.timing import repeated, timed
from multiphi_exudyn.study.scene.workbench import Workbench, start_equilibrium
from reference_models.full_run import ENERGY_GAIN, EnergyBalance

__all__ = ["ENERGY_INTERVAL", "Runner", "modes_text"]

ENERGY_INTERVAL = 1e-3  # s, between samples of the energy


@dataclass(frozen=True)
class Runner(ABC):
    """One model of a scene as it is run. spec: its entry; the others: see ``run_model``."""

    compiled: ClassVar[bool] = False  # whether its own loop is
    may_gain_energy: ClassVar[bool] = False  # whether it may gain energy, which nothing in a released structure gives

    bench: Workbench
    spec: Any
    progress: bool = False
    retry: bool = False
    horizon: bool = False

    @property
    @abstractmethod
    def label(self) -> str:
        """How tables and figures call it."""

    def prepare(self) -> Any:
        """What is done offline: the Multi-Phi model and its start, unless a kind needs something else."""
        model = self.bench.model(self.spec)
        return model, start_equilibrium(self.bench, model)

    @abstractmethod
    def solve(self, prepared: Any) -> tuple[Any, float]:
        """The answer, and what the solver took for it [s]."""

    @abstractmethod
    def outcome(self, prepared: Any, answer: Any) -> dict[str, Any]:
        """The fields of a ModelRun that say how it ended and in what it was computed."""

    @abstractmethod
    def histories(self, prepared: Any, answer: Any) -> dict[str, Any]:
        """The fields of a ModelRun on the common grid, of an answer that reached the end."""

    def repeats(self, answer: Any) -> int:
        """How often an answer is computed again, for its time; more often where that is short."""
        return self.bench.repeats

    def run(self) -> ModelRun:
        """Prepare, solve and sample."""
        if self.compiled and available():
            compile_entries()
        prepared, building = timed(self.prepare)
        answer, first = self.solve(prepared)
        repeats = repeated(lambda: self.solve(prepared)[1], first, self.repeats(answer))
        run = ModelRun(
            name=self.spec.name,
            kind=self.spec.kind,
            label=self.label,
            offline_s=self.bench.structure_s + building,
            first_s=first,
            repeats_s=repeats,
        )
        run = replace(run, **self.outcome(prepared, answer))
        if not run.ok:
            return run
        histories, sampling = timed(lambda: self.histories(prepared, answer))
        fields: dict[str, Any] = {"time": self.bench.time, "sampling_s": sampling}
        whole = replace(run, **fields | histories)
        gained = _energy_gain(whole) if self.may_gain_energy else ""
        return replace(run, status="failed", message=gained) if gained else whole

    def level_text(self) -> str:
        """Which levels a model has, as part of its label."""
        contacts = self.bench.contacts(self.spec.rigid)
        if not contacts:
            return "levels of force laws" if self.bench.mechanics.force_laws else "levels of friction"
        return f"{'rigid' if all(contact.rigid for contact in contacts) else 'compliant'} levels"

    def printed_text(self) -> str:
        """That levels have printed frequencies, as part of a label."""
        return ", printed frequencies" if self.bench.overrides else ""


def modes_text(modes: object) -> str:
    """How many modes a model has: "r = 12", "all modes"."""
    return "all modes" if modes == "all" else f"r = {modes}"


def _energy_gain(run: ModelRun) -> str:
    """The cause of a failure, or "": the energy has risen above an earlier value."""
    balance = EnergyBalance.of(run.energy_time, run.energy, np.zeros_like(run.energy))
    if balance.gain_at is None:
        return ""
    gained = f"energy gained: more than {ENERGY_GAIN:.0%} by {balance.gain_at:.6g} s"
    return f"{gained}, at worst {balance.worst_gain:.2%} at {balance.worst_gain_at:.6g} s"
