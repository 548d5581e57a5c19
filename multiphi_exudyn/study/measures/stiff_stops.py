"""Stiff stops: what rigid levels are measured against beside the scene's own stop.

With the stiffness k of a stop answers converge, about as k^-1/2, and to those of rigid levels. From a soft stop rigid
levels differ by its softness, which no number of modes removes; what is their own error shows against a stiff one. That
reference has the same linear structure with all modes, and stops of k, 10 k and 100 k. k is the power of ten above the
scene's own stops and above STIFF times the structure's static stiffness at any contact,

    1 / sum (a / omega)^2,  a = Phi^T h, over the elastic modes of the open level.                              [N/m]

Of the differences to the three the largest counts: with so many contacts a single one can be lucky. Their own
uncertainty is the largest difference between two of them: what stiffness still changes, and what the answer is
sensitive to anyway. Large displacements are not in it.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from multiphi_exudyn.errors import MultiPhiError, NumericalFailure
from multiphi_exudyn.levels.model import MultiPhiModel
from multiphi_exudyn.study.measures import metrics
from multiphi_exudyn.study.running.runs import ModelRun
from multiphi_exudyn.study.scene.workbench import Workbench, start_configuration
from multiphi_exudyn.time.simulate import simulate
from multiphi_exudyn.time.warnings.warning_groups import kept_back

__all__ = ["StiffStops", "rigid_models", "stiff_stops"]

STIFF = 1e5  # static stiffnesses: from there on more changes the rig's answers by no more than a nudged start
FACTORS = (1.0, 10.0, 100.0)  # of the softest of the stiff stops

Histories = Mapping[str, np.ndarray]  # point -> displacements (k,) [m] on the common grid


@dataclass(frozen=True)
class StiffStops:
    """stiffness: of the stops [N/m], ascending. histories: the answer with each; none if one failed: ``message``."""

    stiffness: tuple[float, ...]
    histories: tuple[Histories, ...]
    message: str = ""

    @property
    def ok(self) -> bool:
        """Whether there is something to measure against."""
        return not self.message

    def error(self, run: ModelRun, points: Sequence[str], until: float) -> float:
        """Largest NRMSE of the points from 0 to ``until`` [s], against any of the stops."""
        return max(_apart(run.points, stiff, points, run.time, until) for stiff in self.histories)

    def uncertainty(self, time: np.ndarray, points: Sequence[str], until: float) -> float:
        """The same of every stop against the stiffer ones."""
        pairs = itertools.combinations(self.histories, 2)
        return max(_apart(softer, stiffer, points, time, until) for softer, stiffer in pairs)

    def values(self, bench: Workbench, runs: Mapping[str, ModelRun]) -> dict[str, Any]:
        """What JSON holds of it: by window and point its uncertainty, and the errors of ``runs`` by name."""

        def own(point: str, until: float) -> float:
            return self.uncertainty(bench.time, (point,), until)

        def errors(run: ModelRun) -> dict[str, dict[str, float | None]]:
            return metrics.by_window(bench.windows, bench.points, lambda point, until: self.error(run, (point,), until))

        return {
            "stiffness": list(self.stiffness),
            "message": self.message,
            "uncertainty": metrics.by_window(bench.windows, bench.points, own) if self.ok else {},
            "errors": {name: errors(run) for name, run in runs.items() if self.ok and run.ok},
        }


def rigid_models(bench: Workbench) -> tuple[str, ...]:
    """Names of the scene's models that take every contact as rigid; none where printed frequencies are a level's."""
    if bench.overrides or not bench.mechanics.contacts:
        return ()
    given = all(contact.rigid for contact in bench.mechanics.contacts)
    models = bench.scene.models
    return tuple(name for name in models if given or models[name].rigid)


def stiff_stops(bench: Workbench) -> StiffStops | None:
    """Run the linear structure against stiff stops; None where no model of the scene has rigid levels."""
    if not rigid_models(bench):
        return None
    softest = 10.0 ** math.ceil(math.log10(_softest(bench)))
    stiffness = tuple(factor * softest for factor in FACTORS)
    try:
        return StiffStops(stiffness, tuple(_histories(bench, each) for each in stiffness))
    except MultiPhiError as error:
        return StiffStops(stiffness, (), str(error))


def _apart(values: Histories, reference: Histories, points: Sequence[str], time: np.ndarray, until: float) -> float:
    return max(metrics.nrmse(values[point], reference[point], time, until) for point in points)


def _softest(bench: Workbench) -> float:
    """What the softest of the stops has at least [N/m]; a structure without any stiffness gives no scale."""
    level = MultiPhiModel(bench.structure, bench.contacts(rigid=True), modes="all").level(())
    elastic = level.squares > 0
    flexibilities = level.gap_rows[:, elastic] ** 2 @ (1 / level.squares[elastic])
    own = [contact.stiffness for contact in bench.mechanics.contacts if not contact.rigid]
    return float(max([*own, *(STIFF / flexibilities[flexibilities > 0])], default=1.0))


def _histories(bench: Workbench, stiffness: float) -> Histories:
    """All modes of the bench's structure, every stop of one stiffness."""
    contacts = [replace(contact, stiffness=stiffness) for contact in bench.contacts(rigid=True)]
    model = MultiPhiModel(bench.structure, [*contacts, *bench.mechanics.force_laws], modes="all")
    with kept_back():
        run = simulate(model, bench.t_end, displacement=start_configuration(bench, model), loads=bench.loads)
    if run.status != "ok":
        raise NumericalFailure(f"a stop of {stiffness:g} N/m: {run.status}, {run.message}")
    return {point: np.asarray(run.at(point, bench.time)) for point in bench.points}
