"""Run a Multi-Phi model as a body inside Exudyn."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from multiphi_exudyn.exudyn_plugin import BodyHistories
from multiphi_exudyn.levels.equilibrium.static_equilibrium import Equilibrium
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.study.running.runner import Runner
from multiphi_exudyn.study.running.runs import interval_array, path_length
from reference_models.body_alone import solve_body_alone

__all__ = ["BodyRunner"]

Prepared = tuple[MultiPhiModel, Equilibrium]


class BodyRunner(Runner):
    """Run the body alone in a system, its modes matched to the step."""

    @property
    def label(self) -> str:
        levels = f"{self.level_text()}, r = {self.spec.modes}{self.printed_text()}"
        return f"Exudyn user object, {levels}, step {self.spec.step * 1e6:g} µs"

    @property
    def steps(self) -> int:
        """Number of time steps of the run."""
        return int(np.ceil(self.setup.t_end / self.spec.step * (1 - 1e-9)))

    def solve(self, prepared: Prepared) -> tuple[BodyHistories, float]:
        setup = self.setup
        return solve_body_alone(*prepared, setup.t_end, self.steps, setup.points, loads=setup.loads)

    def outcome(self, prepared: Prepared, answer: BodyHistories) -> dict[str, Any]:
        return {"dofs": prepared[0].level(()).modes, "steps": self.steps, "warnings": answer.warnings}

    def histories(self, prepared: Prepared, answer: BodyHistories) -> dict[str, Any]:
        contacts = [contact.name for contact in self.setup.mechanics.contacts]
        return {
            "points": {
                name: CubicHermiteSpline(answer.time, values, answer.velocities[name])(self.setup.time)
                for name, values in answer.points.items()
            },
            "gaps": self._interpolated(answer, {name: answer.gaps[name] for name in contacts}),
            "contact_force": self._interpolated(answer, {name: answer.contact_force[name] for name in contacts}),
            "contact_intervals": {name: interval_array(answer.contact_intervals[name]) for name in contacts},
            "impulse": {name: _impulse(answer, name) for name in contacts},
            "friction_force": self._interpolated(answer, answer.friction_force),
            "slip": self._interpolated(answer, answer.slip),
            "stick_intervals": dict(answer.stick_intervals),
            "ledger": self._ledger(answer),
        }

    def _interpolated(self, answer: BodyHistories, histories: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        return {name: np.interp(self.setup.time, answer.time, values) for name, values in histories.items()}

    def _ledger(self, answer: BodyHistories) -> dict[str, float]:
        """Energy lost at events, and dissipated by friction along the sampled slip [J]."""
        rows = ["impact", "truncation_kinetic", "truncation_strain", *(["friction"] if answer.slip else [])]
        losses = {row: float(sum(getattr(event.loss, row) for event in answer.events)) for row in rows}
        for friction in self.setup.mechanics.frictions:
            losses["friction"] += friction.limit * path_length(answer.slip[friction.name])
        for contact in self.setup.mechanics.contacts:
            if contact.friction:
                force, slip = answer.friction_force[contact.name], answer.slip[contact.name]
                losses["friction"] += float(np.trapezoid(force, slip))
        return losses


def _impulse(answer: BodyHistories, contact: str) -> float:
    """Impulse [N s] of the recorded force, by the trapezoidal rule, and of the impacts."""
    impacts = sum(event.impulse for event in answer.events if event.contact == contact)
    return float(np.trapezoid(answer.contact_force[contact], answer.time) + impacts)
