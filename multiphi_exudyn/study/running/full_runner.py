"""Run the full nonlinear beam."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mechanics.beam import beam_nodes
from multiphi_exudyn.mechanics.structure import damping_matrix
from multiphi_exudyn.study.running.runner import Runner
from multiphi_exudyn.study.running.runs import interval_array
from multiphi_exudyn.study.scene_elements import DisplacedStart
from multiphi_exudyn.study.setup import start_configuration
from reference_models.full_beam import FullBeam, FullRun
from reference_models.gentler import Attempt, attempts

__all__ = ["FullRunner"]

STICK_DISTANCE = 1e-6  # of the range of its slip: a patch that moves less between two samples sticks


class FullRunner(Runner):
    """A full beam with the scene's damping on its own mesh; histories come on the common grid.

    With ``retry`` a failed run is repeated with other settings (reference_models/gentler.py); the message then says
    with which, and the time is that of all attempts.
    """

    @property
    def label(self) -> str:
        kind = "ANCF" if self.spec.beam == "ancf" else "geometrically exact"
        beam, each = ("beams", " each") if self.setup.mechanics.beam is None else ("beam", "")
        return f"full Exudyn {beam}, {kind}, {self._elements()} elements{each}, step {self.spec.step * 1e6:g} µs"

    def _elements(self) -> str:
        """How many a beam has: more than asked for where points need nodes."""
        beams = self.setup.mechanics.beams
        assert beams is not None, "checked where the scene was loaded"
        counts = [len(beam_nodes(beam, self.spec.elements)) - 1 for beam in beams.parts.values()]
        return " to ".join(dict.fromkeys(f"{count}" for count in (min(counts), max(counts))))

    def prepare(self) -> tuple[FullBeam, dict[str, Any]]:
        beam = self.setup.full_beam(self.spec)
        damping = damping_matrix(replace(beam.structure, damping=self.setup.mechanics.damping))
        return beam, {"damping": damping, "loads": self.setup.loads_on(beam), **self._start()}

    def solve(self, prepared: tuple[FullBeam, dict[str, Any]]) -> tuple[list[Attempt], float]:
        beam, options = prepared

        def run(beam: FullBeam) -> FullRun:
            return beam.run(self.setup.t_end, progress=self.progress, **options)

        runs = attempts(beam, run) if self.retry else [Attempt("as asked", run(beam))]
        return runs, sum(attempt.run.online_s for attempt in runs)

    def repeats(self, answer: list[Attempt]) -> int:
        return self.setup.repeats if len(answer) == 1 else 0

    def outcome(self, prepared: Any, answer: list[Attempt]) -> dict[str, Any]:
        result = answer[-1].run
        return {
            "dofs": result.dofs,
            "status": result.status,
            "message": _message(answer),
            "steps": result.steps,
            "offline_s": result.offline_s,
        }

    def histories(self, prepared: Any, answer: list[Attempt]) -> dict[str, Any]:
        result = answer[-1].run
        forces, balance = result.contact_force, result.balance
        assert balance is not None, "a run that is ok has a balance"
        return {
            "points": {name: result.points[name] for name in self.setup.points},
            "gaps": result.gaps,
            "contact_force": forces,
            "contact_intervals": {name: interval_array(pairs) for name, pairs in result.contact_intervals.items()},
            "impulse": {name: float(np.trapezoid(force, result.time)) for name, force in forces.items()},
            "friction_force": result.friction_force,
            "slip": result.slip,
            "stick_intervals": {name: _stick_intervals(result.time, slip) for name, slip in result.slip.items()},
            "energy_time": result.energy_time,
            "energy": result.energy,
            "ledger": {
                "initial": balance.initial,
                "work_of_loads": balance.work,
                "damping": balance.dissipated,
                **({"friction": balance.friction} if result.slip else {}),
                "final": balance.final,
                "residual": balance.initial + balance.work - balance.dissipated - balance.friction - balance.final,
                "worst_gain": balance.worst_gain * balance.scale,
            },
            "sampling_s": 0.0,  # recorded on the grid
        }

    def _start(self) -> dict[str, Any]:
        """Options of the static start load: point and displacement; empty for a start at rest."""
        setup, start = self.setup, self.setup.scene.file.start
        if start is None:
            return {}
        if isinstance(start, DisplacedStart):
            return start.model_dump()
        model = MultiPhiModel(setup.structure, setup.nonlinearities(rigid=False))
        displacement = float(setup.structure.row(start.load_at) @ start_configuration(setup, model))
        return {"load_at": start.load_at, "measured_at": start.load_at, "displacement": displacement}


def _message(runs: Sequence[Attempt]) -> str:
    """Message of a single attempt; of several, what was tried and with which settings the run succeeded."""
    last = runs[-1]
    if len(runs) == 1:
        return last.run.message
    if last.run.status == "ok":
        return f"ran with gentler settings ({last.settings}); {'; '.join(attempt.told for attempt in runs[:-1])}"
    return f"failed with every setting; {'; '.join(attempt.told for attempt in runs)}"


def _stick_intervals(time: np.ndarray, slip: np.ndarray) -> np.ndarray:
    """Intervals (m, 2) [s] in which a patch with slip (k,) on a time grid sticks."""
    sticks = np.abs(np.diff(slip)) <= STICK_DISTANCE * np.ptp(slip)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], sticks, [False]]).astype(int)))
    return np.asarray(time[edges].reshape(-1, 2))
