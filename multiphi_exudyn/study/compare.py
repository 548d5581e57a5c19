"""Comparison: every model of a scene run once, and measured against the reference.

Rigid levels are measured against stiff stops too (measures.py). ``summary`` and ``histories`` are written to disk.
"""

from __future__ import annotations

import functools
import math
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from multiphi_exudyn.study import measures
from multiphi_exudyn.study.measures import StiffStops, rigid_models, stiff_stops
from multiphi_exudyn.study.model_kinds import CraigBamptonModel, ReducedModel, UserObjectModel
from multiphi_exudyn.study.runners import run_model
from multiphi_exudyn.study.runs import ModelRun, load_average
from multiphi_exudyn.study.setup import ROUND_OFF, Setup
from multiphi_exudyn.study.store import plain

__all__ = ["HIGH", "MOST_LISTED", "Comparison", "compare", "histories", "summary"]


HIGH = 20e-6  # m, of a loss of contact that a displacement plot shows
MOST_LISTED = 4  # contacts that pages tell of one by one; of more, what they did together


@dataclass(frozen=True)
class Comparison:
    """Runs of one scene, in the scene's order; environment: where they ran.

    stiff: what rigid levels are measured against beside the reference; None where there are none.
    """

    setup: Setup
    runs: Mapping[str, ModelRun]
    environment: Mapping[str, Any]
    stiff: StiffStops | None = None

    @property
    def reference(self) -> ModelRun:
        """What the others are measured against."""
        return self.runs[self.setup.scene.file.comparison.reference]

    @property
    def coarser(self) -> ModelRun | None:
        """The reference's coarser copy, if it can be measured."""
        return self.measured.get(self.setup.scene.file.comparison.coarser or "")

    @property
    def cheapest(self) -> tuple[ModelRun, ...]:
        """The full model at its cheapest fair setting, at nearby steps."""
        return tuple(self.runs[name] for name in self.setup.scene.file.comparison.cheapest)

    @property
    def components(self) -> list[tuple[ModelRun, ...]]:
        """Exudyn's own linear component, setting by setting: runs with one number of modes, at nearby steps."""
        measured = self.measured
        found = ([measured[name] for name in names if name in measured] for names in _components(self.setup))
        return [tuple(runs) for runs in found if runs]

    @property
    def nearby(self) -> set[str]:
        """Names of the runs that only show that a setting holds at nearby steps."""
        return _nearby(self.setup)

    @property
    def measured(self) -> dict[str, ModelRun]:
        """Runs that can be measured: those that are ok, if the reference is."""
        if not self.reference.ok:
            return {}
        return {name: run for name, run in self.runs.items() if run.ok and run is not self.reference}

    @property
    def rigid(self) -> dict[str, ModelRun]:
        """Runs with rigid levels that can be measured against stiff stops."""
        if self.stiff is None or not self.stiff.ok:
            return {}
        return {name: self.runs[name] for name in rigid_models(self.setup) if self.runs[name].ok}

    @property
    def horizon_tolerances(self) -> tuple[str, ...]:
        """Tolerances for which runs know their sensitivity horizon."""
        return tuple(dict.fromkeys(tolerance for run in self.runs.values() for tolerance in run.horizon_s))

    @property
    def headline_window(self) -> float:
        """The window the headline figures speak of: the longest the scene names that fits into the run."""
        end = self.setup.t_end
        return max((w for w in self.setup.scene.file.outputs.windows if w <= end / ROUND_OFF), default=end)

    def error(self, run: ModelRun, point: str, until: float) -> float:
        """NRMSE of a point to the reference from 0 to ``until`` [s]."""
        return measures.nrmse(run.points[point], self.reference.points[point], run.time, until)

    def errors(self, run: ModelRun) -> dict[str, dict[str, float | None]]:
        """NRMSE by window and point."""
        error = functools.partial(self.error, run)
        return measures.by_window(self.setup.windows, self.setup.points, error)

    def worst_error(self, run: ModelRun, until: float) -> float:
        """Largest NRMSE of the judged points."""
        return max(self.error(run, point, until) for point in self.setup.judged_points)

    def worst_of(self, runs: Sequence[ModelRun], until: float) -> float:
        """The same of the worst of a setting's runs at nearby steps."""
        return max(self.worst_error(run, until) for run in runs)

    def component_within(self, tolerance: float) -> tuple[ModelRun, ...]:
        """The fastest setting of the linear component that holds at all its steps, in the headline's window."""
        within = [runs for runs in self.components if self.worst_of(runs, self.headline_window) <= tolerance]
        return min(within, key=lambda runs: runs[0].online_s, default=())

    def stiff_error(self, run: ModelRun, until: float) -> float:
        """Largest NRMSE of the judged points of one of the ``rigid`` runs to the stiff stops."""
        assert self.stiff is not None, "there are no rigid runs without one"
        return self.stiff.error(run, self.setup.judged_points, until)

    def horizon(self, run: ModelRun, tolerance: float) -> float:
        """Agreement horizon [s] of the judged points."""
        pairs = [(run.points[p], self.reference.points[p]) for p in self.setup.judged_points]
        return measures.agreement_horizon(pairs, run.time, tolerance)

    def twin(self, run: ModelRun) -> ModelRun | None:
        """Of a user object, the same reduced model run by itself, if there is one that is ok."""
        specs = self.setup.scene.models
        own = specs[run.name]
        if not (isinstance(own, UserObjectModel) and run.ok):
            return None
        equal = {
            name
            for name, spec in specs.items()
            if isinstance(spec, ReducedModel) and (spec.modes, spec.contact) == (own.modes, own.contact)
        }
        return next((other for name, other in self.runs.items() if name in equal and other.ok), None)

    def speedup(self, run: ModelRun) -> float | None:
        """Online time of the reference over the run's own; None where there is no such ratio."""
        timed = run.ok and self.reference.ok and run.online_s > 0
        return self.reference.online_s / run.online_s if timed else None

    def energy_scale(self, run: ModelRun) -> float:
        """What energies of a run are shares of [J]: the initial energy; under loads, the largest of the run; or 0."""
        if self.setup.scene.file.loads:
            return float(np.max(run.energy, initial=0.0))
        return float(run.ledger.get("initial", 0.0))

    @property
    def energy_scale_name(self) -> str:
        """The same in words."""
        return "largest energy of the run" if self.setup.scene.file.loads else "initial energy"

    def first_phase(self, run: ModelRun, contact: str) -> np.ndarray:
        """Contact intervals (m, 2) [s] of the first contact phase."""
        return measures.first_phase(run.contact_intervals[contact], self.setup.longest_period)

    def high_losses(self, run: ModelRun, contact: str) -> int:
        """Number of these openings that are higher than HIGH, which a displacement plot shows."""
        return sum(height > HIGH for height in self.lift_offs(run, contact))

    def lift_offs(self, run: ModelRun, contact: str) -> list[float]:
        """Largest gap [m], on the common grid, of every opening inside the first contact phase."""
        phase = self.first_phase(run, contact)
        gap = run.gaps[contact]
        openings = [(run.time >= a) & (run.time <= b) for a, b in zip(phase[:-1, 1], phase[1:, 0], strict=True)]
        return [float(np.max(gap[inside], initial=0.0)) for inside in openings]


def compare(
    setup: Setup,
    environment: Mapping[str, Any],
    progress: bool = True,
    started: Callable[[str], None] = lambda name: None,
) -> Comparison:
    """Run every model of the scene; ``started`` is called with each name before it runs.

    Its environment also has the largest load average meanwhile, zero where the system knows none. A full beam that
    fails is tried again at gentler settings, and its row says so.
    """
    runs, loads = {}, []
    once, nearby = replace(setup, repeats=0), _nearby(setup)
    for name in setup.scene.models:
        started(name)
        runs[name] = run_model(once if name in nearby else setup, name, progress, retry=True, horizon=True)
        loads.append(load_average() or 0.0)
    return Comparison(setup, runs, {**environment, "load_average": max(loads)}, stiff_stops(setup))


def _components(setup: Setup) -> list[list[str]]:
    """Names of the models that are Exudyn's linear component, those of one number of modes together."""
    settings = defaultdict[int, list[str]](list)
    for name, model in setup.scene.models.items():
        if isinstance(model, CraigBamptonModel):
            settings[model.modes].append(name)
    return list(settings.values())


def _nearby(setup: Setup) -> set[str]:
    settings = [setup.scene.file.comparison.cheapest, *_components(setup)]
    return {name for names in settings for name in names[1:]}


def summary(comparison: Comparison) -> dict[str, Any]:
    """The content of summary.json; numbers that do not exist are None. With friction it has ``stick_intervals``."""
    setup, runs, measured = comparison.setup, comparison.runs, comparison.measured
    errors = {name: comparison.errors(run) for name, run in measured.items()}
    own = comparison.coarser
    content = {
        "scene": _scene(comparison),
        "environment": dict(comparison.environment),
        "reference": comparison.reference.name,
        "models": {name: _row(comparison, run) for name, run in runs.items()},
        "reference_uncertainty": errors[own.name] if own else {},
        "errors": errors,
        "agreement_horizon_s": {
            name: {
                f"{tolerance:g}": comparison.horizon(run, tolerance)
                for tolerance in setup.scene.file.outputs.tolerances
            }
            for name, run in measured.items()
        },
        "contact_intervals": {name: _lists(run.contact_intervals) for name, run in runs.items()},
        "ledger": {name: dict(run.ledger) for name, run in runs.items()},
        "stiff_stops": comparison.stiff.values(setup, comparison.rigid) if comparison.stiff else {},
    }
    if setup.mechanics.frictions:
        content["stick_intervals"] = {name: _lists(run.stick_intervals) for name, run in runs.items()}
    return dict(plain(content, "summary"))


def histories(comparison: Comparison) -> dict[str, np.ndarray]:
    """The content of histories.npz: "time" [s], "MODEL/point/NAME" [m], "MODEL/gap/CONTACT" [m],
    "MODEL/force/CONTACT" [N], "MODEL/friction/NAME" [N], "MODEL/slip/NAME" [m], "MODEL/energy_time" [s],
    "MODEL/energy" [J]."""
    arrays = {"time": comparison.setup.time}
    for name, run in comparison.runs.items():
        if run.ok:
            kinds = {"point": run.points, "gap": run.gaps, "force": run.contact_force}
            kinds |= {"friction": run.friction_force, "slip": run.slip}
            arrays |= {f"{name}/{kind}/{of}": values for kind, each in kinds.items() for of, values in each.items()}
            arrays |= {f"{name}/energy_time": run.energy_time, f"{name}/energy": run.energy}
    return arrays


def _lists(intervals: Mapping[str, np.ndarray]) -> dict[str, list[list[float]]]:
    return {name: given.tolist() for name, given in intervals.items()}


def _scene(comparison: Comparison) -> dict[str, Any]:
    setup, file = comparison.setup, comparison.setup.scene.file
    return {
        "name": setup.scene.name,
        "title": file.title,
        "t_end": setup.t_end,
        "points": setup.points,
        "judged_points": setup.judged_points,
        "start": None if file.start is None else file.start.model_dump(),
        "loads": [load.model_dump(exclude_none=True) for load in file.loads],
        "contacts": {
            contact.name: {"gap": contact.gap, "stiffness": _stiffness(contact.stiffness), "damping": contact.damping}
            for contact in setup.mechanics.contacts
        },
        "force_laws": [law.model_dump(exclude_none=True) for law in file.force_laws],
        "friction": [
            friction.model_dump(exclude_none=True) | {"stiffness": _stiffness(friction.stiffness)}
            for friction in file.friction
        ],
        "assumptions": setup.mechanics.assumptions,
    }


def _stiffness(value: float) -> float | str:
    """As a scene's file has it."""
    return "rigid" if math.isinf(value) else value


def _row(comparison: Comparison, run: ModelRun) -> dict[str, Any]:
    names = ("kind", "label", "dofs", "status", "message", "steps", "offline_s", "online_s", "first_s", "repeats_s")
    intervals = run.contact_intervals
    return {
        **{name: getattr(run, name) for name in (*names, "sampling_s")},
        "speedup": comparison.speedup(run),
        "first_contact_s": {name: measures.first_contact(given) for name, given in intervals.items()},
        "inner_lift_offs_m": {name: comparison.lift_offs(run, name) for name in intervals},
        "impulse_Ns": run.impulse,
        "warnings": run.warnings,
        "horizon_s": run.horizon_s,
    }
