"""What a comparison found, as its template says it: what was compared, what came out, what to distrust."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.study.comparison.beam_places import coefficients
from multiphi_exudyn.study.comparison.compare import LISTED, Comparison
from multiphi_exudyn.study.comparison.pages import sentences
from multiphi_exudyn.study.comparison.run_warnings import run_warnings
from multiphi_exudyn.study.comparison.wording import engineering
from multiphi_exudyn.study.measures import metrics
from multiphi_exudyn.study.running.runs import ModelRun
from multiphi_exudyn.study.scene.scene_laws import described_laws
from multiphi_exudyn.study.scene.scene_loads import described_loads

__all__ = ["comparison_warnings", "findings"]

TEMPLATE = "findings.txt.j2"
HONEST = 0.01  # NRMSE that the headline's model holds, where any does and the reference can tell
GONE = 0.05  # NRMSE above which a pointwise comparison says little


def findings(comparison: Comparison) -> dict[str, tuple[str, ...]]:
    """Sentences: compared, outcome, distrust; and key_figures, each "what | how much | from what"."""
    bench, file = comparison.bench, comparison.bench.scene.file
    cheapest = [run for run in comparison.cheapest if run.ok]
    return sentences(
        __package__ or "",
        TEMPLATE,
        ("compared", "outcome", "distrust", "key_figures"),
        comparison=comparison,
        bench=bench,
        until=comparison.headline_window,
        start=file.start,
        loads=described_loads(bench.scene),
        laws=described_laws(bench.scene),
        contacts=bench.mechanics.contacts,
        listed_one_by_one=LISTED,
        meeting=coefficients,
        gap=_gap,
        stiffness=_stiffness,
        headline=_headline_runs(comparison),
        best=_most_accurate(comparison),
        failed=[run for run in comparison.runs.values() if not run.ok],
        cheapest=cheapest,
        cheapest_worst=max(cheapest, key=lambda run: _error(comparison, run), default=None),
        own=comparison.coarser,
        early=_separated(comparison),
        left=dict(_left(comparison)),
        twins=list(_twins(comparison)),
        warned=comparison_warnings(comparison),
    )


def comparison_warnings(comparison: Comparison) -> list[str]:
    """What the models say of their own answers, a sentence each."""
    runs = comparison.runs.items()
    horizons = [(name, run.horizon_s) for name, run in runs]
    return run_warnings([(name, run.warnings) for name, run in runs], horizons, comparison.bench.t_end)


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


def _headline_runs(comparison: Comparison) -> list[ModelRun]:
    """Of each kind the fastest accurate one, or else the most accurate; then the scene's first, if it is another."""
    runs = [best for kind in ("reduced", "user-object") if (best := _honest(comparison, kind)) is not None]
    first = next((run for run in comparison.measured.values() if run.kind == "reduced"), None)
    return runs if first is None or any(run is first for run in runs) else [*runs, first]


def _honest(comparison: Comparison, kind: str) -> ModelRun | None:
    errors = {run.name: _error(comparison, run) for run in comparison.measured.values() if run.kind == kind}
    own = comparison.coarser
    floor = max(HONEST, _error(comparison, own) if own is not None else 0.0)
    accurate = [comparison.runs[name] for name, error in errors.items() if error <= floor]
    if accurate:
        return min(accurate, key=lambda run: run.online_s)
    return comparison.runs[min(errors, key=lambda name: errors[name])] if errors else None


def _most_accurate(comparison: Comparison) -> ModelRun | None:
    """The reduced model with the smallest error, if the headline does not name it."""
    runs = [run for run in comparison.measured.values() if run.kind == "reduced"]
    best = min(runs, key=lambda run: _error(comparison, run), default=None)
    return None if any(run is best for run in _headline_runs(comparison)) else best


def _separated(comparison: Comparison) -> dict[str, float]:
    """Until when [s] the headline's runs and the coarser copy follow the reference, of those that leave it."""
    runs = [run for run in (*_headline_runs(comparison), comparison.coarser) if run is not None]
    ends = {run.name: comparison.horizon(run, GONE) for run in runs}
    return {name: end for name, end in ends.items() if end < comparison.bench.t_end}


def _left(comparison: Comparison) -> Iterator[tuple[str, tuple[float, float]]]:
    """The force laws whose span the reference leaves, and what it reaches [mm]; it has recorded all their points."""
    points = comparison.reference.points
    for law in comparison.bench.mechanics.force_laws:
        places: dict[str, float] = {law.at: 1.0} if isinstance(law.at, str) else dict(law.at)
        if places.keys() <= points.keys():
            reached = sum(factor * points[name] for name, factor in places.items())
            lowest, highest = float(np.min(reached)), float(np.max(reached))
            if not law.knots[0] <= lowest <= highest <= law.knots[-1]:
                yield law.name, (1e3 * lowest, 1e3 * highest)


def _twins(comparison: Comparison) -> Iterator[tuple[ModelRun, ModelRun, float]]:
    """User objects beside the same reduced model, and their largest NRMSE of all points to the end of the run."""
    for run in comparison.runs.values():
        twin = comparison.twin(run)
        if twin is not None:
            points = comparison.bench.points
            apart = [metrics.nrmse(run.points[p], twin.points[p], run.time, comparison.bench.t_end) for p in points]
            yield run, twin, max(apart)
