"""Base class of the runners of all kinds of models: preparation, timed solution, histories, check of energy gain.

Offline: discretisation, linearisation, modes, and here the static start. Online: the solver alone, from the start to
the end of the run.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from multiphi_exudyn.errors import NumericalFailure
from multiphi_exudyn.study.running.runs import ModelRun
from multiphi_exudyn.study.running.timing import repeated, timed
from multiphi_exudyn.study.setup import Setup, start_equilibrium
from reference_models.full_run import ENERGY_GAIN, EnergyBalance

__all__ = ["ENERGY_INTERVAL", "Runner", "modes_text"]

ENERGY_INTERVAL = 1e-3  # s, between samples of the energy


@dataclass(frozen=True)
class Runner(ABC):
    """Runner of one model of a scene. spec: its entry in the scene; other fields: see ``run_model``."""

    builds_levels: ClassVar[bool] = False  # in its first run, which takes longer than a repeat
    may_gain_energy: ClassVar[bool] = False  # whether time integration may gain energy, an error

    setup: Setup
    spec: Any
    progress: bool = False
    retry: bool = False
    horizon: bool = False

    @property
    @abstractmethod
    def label(self) -> str:
        """Name of the model in tables and figures."""

    def prepare(self) -> Any:
        """Do the offline part; by default build the Multi-Phi model and its start equilibrium."""
        model = self.setup.model(self.spec)
        return model, start_equilibrium(self.setup, model)

    @abstractmethod
    def solve(self, prepared: Any) -> tuple[Any, float]:
        """Solve, and return the answer and the time of the solver [s]."""

    @abstractmethod
    def outcome(self, prepared: Any, answer: Any) -> dict[str, Any]:
        """Fields of a ModelRun about status, size and steps."""

    @abstractmethod
    def histories(self, prepared: Any, answer: Any) -> dict[str, Any]:
        """Fields of a ModelRun on the common grid, for an answer that reached the end."""

    def repeats(self, answer: Any) -> int:
        """Number of timed repeats, more for a short run."""
        return self.setup.repeats

    def run(self) -> ModelRun:
        """Prepare, solve and sample."""
        prepared, preparation_s = timed(self.prepare)
        answer, first = self.solve(prepared)
        as_long = 0.0 if self.builds_levels else first
        repeats = repeated(lambda: self.solve(prepared)[1], as_long, self.repeats(answer))
        run = ModelRun(
            name=self.spec.name,
            kind=self.spec.kind,
            label=self.label,
            offline_s=self.setup.structure_s + preparation_s,
            first_s=first,
            repeats_s=repeats,
        )
        run = replace(run, **self.outcome(prepared, answer))
        if not run.ok:
            return run
        histories, sampling_s = timed(lambda: self.histories(prepared, answer))
        fields: dict[str, Any] = {"time": self.setup.time, "sampling_s": sampling_s}
        complete = replace(run, **fields | histories)
        cause = _energy_gain(complete) if self.may_gain_energy else ""
        return replace(run, status="failed", message=cause) if cause else complete

    def ready(self) -> Callable[[], float]:
        """Prepare and solve once; every call solves again, and returns the time of the solver [s].

        Raises NumericalFailure where the answer has failed.
        """
        prepared = self.prepare()
        outcome = self.outcome(prepared, self.solve(prepared)[0])
        if outcome["status"] != "ok":
            raise NumericalFailure(f"{self.label}: {outcome['message']}")
        return lambda: self.solve(prepared)[1]

    def level_text(self) -> str:
        """Kind of levels, as part of a label."""
        contacts = self.setup.contacts(self.spec.rigid)
        if not contacts:
            return "levels of force laws" if self.setup.mechanics.force_laws else "levels of friction"
        return f"{'rigid' if all(contact.rigid for contact in contacts) else 'compliant'} levels"

    def printed_text(self) -> str:
        """Note on printed frequencies, as part of a label; else empty."""
        return ", printed frequencies" if self.setup.overrides else ""


def modes_text(modes: object) -> str:
    """Number of modes as text: "r = 12", "all modes"."""
    return "all modes" if modes == "all" else f"r = {modes}"


def _energy_gain(run: ModelRun) -> str:
    """Message if the energy has risen above an earlier value; empty if not."""
    balance = EnergyBalance.of(run.energy_time, run.energy, np.zeros_like(run.energy))
    if balance.gain_at is None:
        return ""
    gained = f"energy gained: more than {ENERGY_GAIN:.0%} by {balance.gain_at:.6g} s"
    return f"{gained}, at worst {balance.worst_gain:.2%} at {balance.worst_gain_at:.6g} s"
