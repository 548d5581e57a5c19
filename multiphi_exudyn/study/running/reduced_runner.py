"""Run a Multi-Phi model by itself, or a model with one basis for all levels.

A level is built when it is first visited, so the first run takes longer than its repeats; both times are kept. The
number of steps is the number of events.
"""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import Any

import numpy as np

from multiphi_exudyn.levels.equilibrium.static_equilibrium import Equilibrium
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mechanics.structure import LinearStructure
from multiphi_exudyn.study.running.runner import ENERGY_INTERVAL, Runner, modes_text
from multiphi_exudyn.study.running.runs import interval_array
from multiphi_exudyn.study.running.timing import timed
from multiphi_exudyn.study.setup import start_equilibrium
from multiphi_exudyn.time.simulate import simulate
from multiphi_exudyn.time.trajectory import Trajectory
from multiphi_exudyn.time.truncation import truncation_indicator
from reference_models.global_basis import global_basis
from reference_models.pod_basis import pod_basis

__all__ = ["GlobalBasisRunner", "ReducedRunner", "TrainedBasisRunner"]

HORIZON_TOLERANCE = 0.01  # of the motion: difference to a perturbed run that is visible in a plot

Prepared = tuple[MultiPhiModel, Equilibrium]


class ReducedRunner(Runner):
    """Run the Multi-Phi model of an entry of the scene."""

    builds_levels = True

    @property
    def label(self) -> str:
        spec = self.spec
        modes = f"modes for a truncation error of {spec.tolerance:g}" if spec.tolerance else modes_text(spec.modes)
        return f"Multi-Phi, {self.level_text()}, {modes}{self.printed_text()}"

    def solve(self, prepared: Prepared) -> tuple[Trajectory, float]:
        model, start = prepared
        return timed(lambda: simulate(model, self.setup.t_end, start=start, loads=self.setup.loads))

    def outcome(self, prepared: Prepared, answer: Trajectory) -> dict[str, Any]:
        return {
            "dofs": answer.segments[0].level.level.modes if answer.segments else 0,
            "status": answer.status,
            "message": answer.message,
            "steps": len(answer.events),
            "warnings": answer.warnings,
        }

    def histories(self, prepared: Prepared, answer: Trajectory) -> dict[str, Any]:
        time, t_end = self.setup.time, self.setup.t_end
        contacts, frictions = [c.name for c in self.setup.mechanics.contacts], self.setup.mechanics.friction_names
        points, points_s = timed(lambda: {name: answer.at(name, time) for name in self.setup.points})
        gaps, gaps_s = timed(lambda: {name: answer.gap(name, time) for name in contacts})
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
            "sampling_s": points_s + gaps_s,
            "indicators": self.indicators(answer),
            "horizon_s": {f"{HORIZON_TOLERANCE:g}": answer.horizon(HORIZON_TOLERANCE)} if self.horizon else {},
        }

    def indicators(self, answer: Trajectory) -> dict[str, float]:
        """The model's estimates of its truncation error: end of the window [s] -> estimate."""
        return {f"{until:g}": truncation_indicator(answer, until) for until in self.setup.windows}


class GlobalBasisRunner(ReducedRunner):
    """Run the structure projected on one basis, from its static equilibrium, with all modes of the basis."""

    @property
    def label(self) -> str:
        return f"global basis, {self.level_text()}, r = {self.spec.modes} from each of two"

    def prepare(self) -> Prepared:
        projected = self.projected()
        model = MultiPhiModel(projected, self.setup.nonlinearities(self.spec.rigid), modes="all")
        return model, start_equilibrium(replace(self.setup, structure=projected), model)

    def projected(self) -> LinearStructure:
        """The structure projected on the basis."""
        return global_basis(self.setup.structure, self.setup.contacts(self.spec.rigid), self.spec.modes)

    def indicators(self, answer: Trajectory) -> dict[str, float]:
        """Empty: the estimate needs modes of levels."""
        return {}


class TrainedBasisRunner(GlobalBasisRunner):
    """Run the structure on a basis of snapshots; the training run belongs to the offline time."""

    @property
    def label(self) -> str:
        return f"POD basis of {self.spec.training:g} s, {self.level_text()}, r = {self.spec.modes}"

    def projected(self) -> LinearStructure:
        """The structure projected on the basis."""
        setup = self.setup
        complete = MultiPhiModel(setup.structure, setup.nonlinearities(self.spec.rigid), modes="all")
        until = min(self.spec.training, setup.t_end)
        return pod_basis(
            simulate(complete, until, start=start_equilibrium(setup, complete), loads=setup.loads), self.spec.modes
        )
