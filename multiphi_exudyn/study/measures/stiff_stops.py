"""Stiff stops: a second reference for models with rigid levels.

For large stop stiffness k results converge, about as k^-1/2, to those of rigid levels. From a soft stop rigid levels
differ by its compliance, whatever the number of modes; their own error shows against a stiff stop. The second
reference is the same linear structure with all modes and stops of k, 10 k and 100 k, where k is the power of ten above
the scene's own stops and above STIFF times the structure's static stiffness at any contact,

    1 / sum (a / omega)^2,  a = Phi^T h, over the elastic modes of the open level.                              [N/m]

The largest of the three differences counts, since with many contacts a single one may be small by chance. The
uncertainty is the largest difference between two of the three runs: effect of the stiffness, and sensitivity of the
motion. Geometric nonlinearity is not included.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from multiphi_exudyn.errors import MultiPhiError, NumericalFailure
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.study.measures import metrics
from multiphi_exudyn.study.running.runs import ModelRun
from multiphi_exudyn.study.setup import Setup, start_configuration
from multiphi_exudyn.time.model_warnings import kept_back
from multiphi_exudyn.time.simulate import simulate

__all__ = ["StiffStops", "rigid_models", "stiff_stops"]

STIFF = 1e5  # static stiffnesses: above, more stiffness changes the rig's motion as little as a perturbed start
FACTORS = (1.0, 10.0, 100.0)  # of the softest of the stiff stops

Histories = Mapping[str, np.ndarray]  # point -> displacements (k,) [m] on the common grid


@dataclass(frozen=True)
class StiffStops:
    """Runs with stiff stops.

    stiffness: of the stops [N/m], ascending. histories: one entry for each; empty if a run failed for the cause
    ``message``.
    """

    stiffness: tuple[float, ...]
    histories: tuple[Histories, ...]
    message: str = ""

    @property
    def ok(self) -> bool:
        """Whether all runs reached their end."""
        return not self.message

    def error(self, run: ModelRun, points: Sequence[str], until: float) -> float:
        """Largest NRMSE of the points from 0 to ``until`` [s] to the runs with stiff stops."""
        return max(_largest_nrmse(run.points, stiff, points, run.time, until) for stiff in self.histories)

    def uncertainty(self, time: np.ndarray, points: Sequence[str], until: float) -> float:
        """Largest NRMSE of the points between two runs with stiff stops, from 0 to ``until`` [s]."""
        pairs = itertools.combinations(self.histories, 2)
        return max(_largest_nrmse(softer, stiffer, points, time, until) for softer, stiffer in pairs)

    def values(self, setup: Setup, runs: Mapping[str, ModelRun]) -> dict[str, Any]:
        """JSON values: uncertainty by window and point, and the errors of ``runs`` by name."""

        def uncertainty(point: str, until: float) -> float:
            return self.uncertainty(setup.time, (point,), until)

        def errors(run: ModelRun) -> dict[str, dict[str, float | None]]:
            return metrics.by_window(setup.windows, setup.points, lambda point, until: self.error(run, (point,), until))

        return {
            "stiffness": list(self.stiffness),
            "message": self.message,
            "uncertainty": metrics.by_window(setup.windows, setup.points, uncertainty) if self.ok else {},
            "errors": {name: errors(run) for name, run in runs.items() if self.ok and run.ok},
        }


def rigid_models(setup: Setup) -> tuple[str, ...]:
    """Names of the models in which every contact is rigid; empty where levels have printed frequencies."""
    if setup.overrides or not setup.mechanics.contacts:
        return ()
    all_rigid = all(contact.rigid for contact in setup.mechanics.contacts)
    models = setup.scene.models
    return tuple(name for name in models if all_rigid or models[name].rigid)


def stiff_stops(setup: Setup) -> StiffStops | None:
    """Run the linear structure against stiff stops; None where no model of the scene has rigid levels."""
    if not rigid_models(setup):
        return None
    softest = 10.0 ** math.ceil(math.log10(_least_stiffness(setup)))
    stiffness = tuple(factor * softest for factor in FACTORS)
    try:
        return StiffStops(stiffness, tuple(_histories(setup, each) for each in stiffness))
    except MultiPhiError as error:
        return StiffStops(stiffness, (), str(error))


def _largest_nrmse(
    values: Histories, reference: Histories, points: Sequence[str], time: np.ndarray, until: float
) -> float:
    return max(metrics.nrmse(values[point], reference[point], time, until) for point in points)


def _least_stiffness(setup: Setup) -> float:
    """Lower bound of the stiffness of the stops [N/m]; 1 for a structure without stiffness."""
    level = MultiPhiModel(setup.structure, setup.contacts(rigid=True), modes="all").level(())
    elastic = level.squares > 0
    flexibilities = level.gap_rows[:, elastic] ** 2 @ (1 / level.squares[elastic])
    stiffnesses = [contact.stiffness for contact in setup.mechanics.contacts if not contact.rigid]
    return float(max([*stiffnesses, *(STIFF / flexibilities[flexibilities > 0])], default=1.0))


def _histories(setup: Setup, stiffness: float) -> Histories:
    """Displacements of the structure with all modes and this stiffness [N/m] of every stop."""
    contacts = [replace(contact, stiffness=stiffness) for contact in setup.contacts(rigid=True)]
    model = MultiPhiModel(setup.structure, [*contacts, *setup.mechanics.force_laws], modes="all")
    with kept_back():
        run = simulate(model, setup.t_end, displacement=start_configuration(setup, model), loads=setup.loads)
    if run.status != "ok":
        raise NumericalFailure(f"a stop of {stiffness:g} N/m: {run.status}, {run.message}")
    return {point: np.asarray(run.at(point, setup.time)) for point in setup.points}
