"""What a comparison found, as its template says it: what was compared, what came out, what to distrust."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.force_law import ForceLaw
from multiphi_exudyn.study.comparison.compare import Comparison
from multiphi_exudyn.study.comparison.contact_totals import LISTED
from multiphi_exudyn.study.comparison.pages import sentences
from multiphi_exudyn.study.comparison.placement import meeting
from multiphi_exudyn.study.comparison.warned import warned
from multiphi_exudyn.study.comparison.wording import engineering
from multiphi_exudyn.study.measures import metrics
from multiphi_exudyn.study.running.runs import ModelRun
from multiphi_exudyn.study.scene.scene_loads import described_loads

__all__ = ["Findings", "findings"]

TEMPLATE = "findings.txt.j2"
HONEST = 0.01  # NRMSE that the headline's model holds, where any does and the reference can tell
GONE = 0.05  # NRMSE above which a pointwise comparison says little


@dataclass(frozen=True)
class Findings:
    """compared and outcome: one sentence or two each. key_figures: (what, how much, from what)."""

    compared: str
    outcome: str
    distrust: tuple[str, ...]
    key_figures: tuple[tuple[str, ...], ...]


def findings(comparison: Comparison) -> Findings:
    """The report's first lines, from the comparison's numbers."""
    cheapest = [run for run in comparison.cheapest if run.ok]
    told = sentences(
        __package__ or "",
        TEMPLATE,
        ("compared", "outcome", "distrust", "key_figures"),
        comparison=comparison,
        bench=comparison.bench,
        until=comparison.headline_window,
        start=comparison.bench.scene.file.start,
        loads=described_loads(comparison.bench.scene.file.loads),
        laws=[law.in_words() for law in comparison.bench.scene.file.force_laws],
        contacts=comparison.bench.mechanics.contacts,
        listed_one_by_one=LISTED,
        meeting=meeting,
        gap=_gap,
        stiffness=_stiffness,
        headline=_headline_runs(comparison),
        best=_most_accurate(comparison),
        failed=[run for run in comparison.runs.values() if not run.ok],
        cheapest=cheapest,
        cheapest_worst=max(cheapest, key=lambda run: _error(comparison, run), default=None),
        own=_own(comparison),
        early=_separated(comparison),
        left=dict(_left(comparison)),
        twins=list(_twins(comparison)),
        warned=warned(comparison),
    )
    rows = tuple(tuple(row.split(" | ")) for row in told["key_figures"])
    return Findings(" ".join(told["compared"]), " ".join(told["outcome"]), told["distrust"], rows)


def _gap(contacts: Sequence[UnilateralContact]) -> str:
    gaps = [1e3 * contact.gap for contact in contacts]
    return f"gap {_span([f'{gap:g}' for gap in (min(gaps), max(gaps))])} mm"


def _stiffness(contacts: Sequence[UnilateralContact]) -> str:
    values = [contact.stiffness for contact in contacts]
    return _span(["rigid" if math.isinf(k) else f"{engineering(k)}N/m" for k in (min(values), max(values))])


def _span(ends: Sequence[str]) -> str:
    return " to ".join(dict.fromkeys(ends))


def _error(comparison: Comparison, run: ModelRun) -> float:
    """To the end of the window that the headline speaks of; of a run that is not measured infinite."""
    known = run.name in comparison.measured
    return comparison.worst_error(run, comparison.headline_window) if known else math.inf


def _own(comparison: Comparison) -> ModelRun | None:
    """The reference's coarser copy, if it can be measured."""
    own = comparison.coarser
    return own if own is not None and own.name in comparison.measured else None


def _headline_runs(comparison: Comparison) -> list[ModelRun]:
    """Of each kind the fastest accurate one, or else the most accurate; then the scene's first, if it is another."""
    runs = [best for kind in ("reduced", "user-object") if (best := _honest(comparison, kind)) is not None]
    first = next((run for run in comparison.measured.values() if run.kind == "reduced"), None)
    return runs if first is None or any(run is first for run in runs) else [*runs, first]


def _honest(comparison: Comparison, kind: str) -> ModelRun | None:
    runs = [run for run in comparison.measured.values() if run.kind == kind]
    own = _own(comparison)
    floor = max(HONEST, _error(comparison, own) if own is not None else 0.0)
    accurate = [run for run in runs if _error(comparison, run) <= floor]
    if accurate:
        return min(accurate, key=lambda run: run.online_s)
    return min(runs, key=lambda run: _error(comparison, run), default=None)


def _most_accurate(comparison: Comparison) -> ModelRun | None:
    """The reduced model with the smallest error, if the headline does not name it."""
    runs = [run for run in comparison.measured.values() if run.kind == "reduced"]
    best = min(runs, key=lambda run: _error(comparison, run), default=None)
    return None if any(run is best for run in _headline_runs(comparison)) else best


def _separated(comparison: Comparison) -> dict[str, float]:
    """Until when [s] the headline's runs and the coarser copy follow the reference, of those that leave it."""
    own = _own(comparison)
    runs = [*_headline_runs(comparison), *([own] if own is not None else [])]
    ends = {run.name: comparison.horizon(run, GONE) for run in runs}
    return {name: end for name, end in ends.items() if end < comparison.bench.t_end}


def _left(comparison: Comparison) -> Iterator[tuple[str, tuple[float, float]]]:
    """The force laws whose span the reference leaves, and what it reaches [mm]."""
    for law in comparison.bench.mechanics.force_laws:
        reached = _reached(comparison, law)
        if len(reached) and not law.knots[0] <= np.min(reached) <= np.max(reached) <= law.knots[-1]:
            yield law.name, (1e3 * float(np.min(reached)), 1e3 * float(np.max(reached)))


def _reached(comparison: Comparison, law: ForceLaw) -> np.ndarray:
    """q (k,) [m] of the reference; empty where it failed or not all of the law's points are recorded."""
    places: dict[str, float] = {law.at: 1.0} if isinstance(law.at, str) else dict(law.at)
    points = comparison.reference.points
    if not all(name in points for name in places):
        return np.empty(0)
    return np.sum([factor * points[name] for name, factor in places.items()], axis=0)


def _twins(comparison: Comparison) -> Iterator[tuple[ModelRun, ModelRun, float]]:
    """User objects beside the same reduced model, and their largest NRMSE of all points to the end of the run."""
    for run in comparison.runs.values():
        twin = comparison.twin(run)
        if twin is not None:
            points = comparison.bench.points
            apart = [metrics.nrmse(run.points[p], twin.points[p], run.time, comparison.bench.t_end) for p in points]
            yield run, twin, max(apart)
