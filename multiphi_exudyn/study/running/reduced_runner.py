"""Runs a Multi-Phi model by itself, or one basis for all of its levels.

A level is built when it is first visited, so the first run is longer than its repeats; both are kept. Steps are events,
of which there are as many as the motion has.
"""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import Any

import numpy as np

from multiphi_exudyn.levels.model import MultiPhiModel
from multiphi_exudyn.levels.static_equilibrium import Equilibrium
from multiphi_exudyn.mechanics.structure import LinearStructure
from multiphi_exudyn.study.running.runner import ENERGY_INTERVAL, Runner, modes_words
from multiphi_exudyn.study.running.runs import interval_array
from multiphi_exudyn.study.running.timing import timed
from multiphi_exudyn.study.scene.workbench import start_of
from multiphi_exudyn.time.reliability.truncation import truncation_indicator
from multiphi_exudyn.time.simulate import simulate
from multiphi_exudyn.time.trajectory.trajectory import Trajectory
from reference_models.global_basis import global_basis
from reference_models.pod_basis import pod_basis

__all__ = ["GlobalBasisRunner", "ReducedRunner", "TrainedBasisRunner"]

APART = 0.01  # of the motion, by which a run and a nudged one differ at the end of its horizon: what a reader sees

Prepared = tuple[MultiPhiModel, Equilibrium]


class ReducedRunner(Runner):
    """The model of a scene's entry from the scene's start."""

    compiled = True

    @property
    def label(self) -> str:
        given = self.spec
        chosen = f"modes for a truncation error of {given.tolerance:g}" if given.tolerance else modes_words(given.modes)
        return f"Multi-Phi, {self.level_words()}, {chosen}{self.printed_words()}"

    def solve(self, prepared: Prepared) -> tuple[Trajectory, float]:
        model, start = prepared
        return timed(lambda: simulate(model, self.bench.t_end, start=start, loads=self.bench.loads))

    def outcome(self, prepared: Prepared, answer: Trajectory) -> dict[str, Any]:
        return {
            "dofs": answer.segments[0].level.level.modes if answer.segments else 0,
            "status": answer.status,
            "message": answer.message,
            "steps": len(answer.events),
            "warnings": answer.warnings,
        }

    def histories(self, prepared: Prepared, answer: Trajectory) -> dict[str, Any]:
        time, t_end = self.bench.time, self.bench.t_end
        contacts, frictions = [c.name for c in self.bench.mechanics.contacts], self.bench.mechanics.rubbing
        points, of_points = timed(lambda: {name: answer.at(name, time) for name in self.bench.points})
        gaps, of_gaps = timed(lambda: {name: answer.gap(name, time) for name in contacts})
        energy_time = np.linspace(0.0, t_end, round(t_end / ENERGY_INTERVAL) + 1)
        return {
            "points": points,
            "gaps": gaps,
            "contact_force": {name: answer.contact_force(name, time) for name in contacts},
            "contact_intervals": {name: interval_array(answer.contact_intervals(name)) for name in contacts},
            "impulse": {name: answer.contact_impulse(name, 0.0, t_end) for name in contacts},
            "friction_force": {name: answer.friction_force(name, time) for name in frictions},
            "slip": {name: answer.slip(name, time) for name in frictions},
            "stick_intervals": {name: answer.stick_intervals(name) for name in frictions},
            "energy_time": energy_time,
            "energy": answer.energy(energy_time),
            "ledger": asdict(answer.ledger) | {"residual": answer.ledger.residual},
            "sampling_s": of_points + of_gaps,
            "indicators": self.indicators(answer),
            "horizon_s": {f"{APART:g}": answer.horizon(APART)} if self.horizon else {},
        }

    def indicators(self, answer: Trajectory) -> dict[str, float]:
        """Its own estimates of its truncation error."""
        return {f"{until:g}": truncation_indicator(answer, until) for until in self.bench.windows}


class GlobalBasisRunner(ReducedRunner):
    """The structure projected on one basis, from its own static equilibrium; with all its modes exact in time."""

    @property
    def label(self) -> str:
        return f"global basis, {self.level_words()}, r = {self.spec.modes} from each of two"

    def prepare(self) -> Prepared:
        projected = self.projected()
        model = MultiPhiModel(projected, self.bench.nonlinearities(self.spec.rigid), modes="all")
        return model, start_of(replace(self.bench, structure=projected), model)

    def projected(self) -> LinearStructure:
        """The structure on its basis."""
        return global_basis(self.bench.structure, self.bench.contacts(self.spec.rigid), self.spec.modes)

    def indicators(self, answer: Trajectory) -> dict[str, float]:
        """None: the basis is not of levels."""
        return {}


class TrainedBasisRunner(GlobalBasisRunner):
    """The structure on a basis of snapshots; the training run is part of what is done offline."""

    @property
    def label(self) -> str:
        return f"POD basis of {self.spec.training:g} s, {self.level_words()}, r = {self.spec.modes}"

    def projected(self) -> LinearStructure:
        """The structure on its basis."""
        bench = self.bench
        whole = MultiPhiModel(bench.structure, bench.nonlinearities(self.spec.rigid), modes="all")
        until = min(self.spec.training, bench.t_end)
        return pod_basis(simulate(whole, until, start=start_of(bench, whole), loads=bench.loads), self.spec.modes)
