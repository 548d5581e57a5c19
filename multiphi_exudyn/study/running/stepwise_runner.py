"""Run models with time steps outside Exudyn: the reduced equations through scipy's solve_ivp, and a Craig-Bampton
component by exact free motion with penalty forces in between (reference_models/splitting.py).

Step size control with a loose tolerance can add energy to the highest modes; such a run has failed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from multiphi_exudyn.levels.equilibrium.static_equilibrium import Equilibrium
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.study.running.runner import ENERGY_INTERVAL, Runner, modes_text
from multiphi_exudyn.study.running.runs import interval_array
from multiphi_exudyn.study.running.timing import timed
from multiphi_exudyn.study.setup import start_configuration
from reference_models.splitting import Splitting, SplittingRun, splitting
from reference_models.stepwise import StepwiseHistories, StepwiseRun, solve_stepwise

__all__ = ["SplittingRunner", "StepwiseRunner"]


class _StepRunner(Runner):
    """Runner of a method whose answer has histories at arbitrary times."""

    may_gain_energy = True

    def sampler(self, answer: Any) -> Callable[[Sequence[str], np.ndarray], StepwiseHistories]:
        """Return the function that evaluates histories of points at times (k,) [s]."""
        return answer.histories

    def histories(self, prepared: Any, answer: StepwiseRun | SplittingRun) -> dict[str, Any]:
        time, t_end, sampler = self.setup.time, self.setup.t_end, self.sampler(answer)
        histories, sampling = timed(lambda: sampler(self.setup.points, time))
        energy_time = np.linspace(0.0, t_end, round(t_end / ENERGY_INTERVAL) + 1)
        forces = histories.contact_force
        return {
            "points": histories.points,
            "gaps": histories.gaps,
            "contact_force": forces,
            "contact_intervals": {name: interval_array(answer.contact_intervals(name)) for name in forces},
            "impulse": {name: float(np.trapezoid(force, time)) for name, force in forces.items()},
            "energy_time": energy_time,
            "energy": sampler((), energy_time).energy,
            "sampling_s": sampling,
        }


class StepwiseRunner(_StepRunner):
    """The reduced equations of a Multi-Phi model by solve_ivp."""

    @property
    def label(self) -> str:
        method = f"{self.spec.method}, rtol {self.spec.rtol:g}"
        return f"solve_ivp, {method}, compliant levels, {modes_text(self.spec.modes)}"

    def solve(self, prepared: tuple[MultiPhiModel, Equilibrium]) -> tuple[StepwiseRun, float]:
        model, start = prepared
        options = {"method": self.spec.method, "rtol": self.spec.rtol}
        return timed(lambda: solve_stepwise(model, self.setup.t_end, start.displacement, **options))

    def outcome(self, prepared: Any, answer: StepwiseRun) -> dict[str, Any]:
        return {
            "dofs": answer.segments[0].level.level.modes,
            "status": "failed" if answer.message else "ok",
            "message": answer.message,
            "steps": answer.steps,
        }


class SplittingRunner(_StepRunner):
    """A Craig-Bampton component by Strang splitting; a motion that overflows is a failed run."""

    builds_levels = True

    def sampler(self, answer: Any) -> Callable[[Sequence[str], np.ndarray], StepwiseHistories]:
        return partial(answer.histories, self.setup.structure)

    @property
    def label(self) -> str:
        modes = f"{self.spec.modes} + {len(self.setup.interface)} modes"
        return f"Strang splitting, {modes}, step {1e6 * self.spec.step:g} us"

    def prepare(self) -> tuple[Splitting, np.ndarray]:
        setup = self.setup
        contacts = setup.contacts(rigid=False)
        component = splitting(setup.structure, contacts, setup.interface, self.spec.modes)
        return component, start_configuration(setup, MultiPhiModel(setup.structure, contacts))

    def solve(self, prepared: tuple[Splitting, np.ndarray]) -> tuple[SplittingRun, float]:
        component, start = prepared
        with np.errstate(over="ignore", invalid="ignore"):
            return timed(lambda: component.run(start, self.setup.t_end, self.spec.step))

    def outcome(self, prepared: tuple[Splitting, np.ndarray], answer: SplittingRun) -> dict[str, Any]:
        return {
            "dofs": len(prepared[0].squares),
            "status": "ok" if answer.finite else "failed",
            "message": "" if answer.finite else "its displacements overflow",
            "steps": answer.steps,
        }
