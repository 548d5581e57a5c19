"""What a comparison found, as its template says it: what was compared, what came out, what to distrust."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np

from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.force_law import ForceLaw
from multiphi_exudyn.study.comparison.beam_places import coefficients
from multiphi_exudyn.study.comparison.compare import LISTED, Comparison
from multiphi_exudyn.study.comparison.pages import sentences
from multiphi_exudyn.study.comparison.run_warnings import run_warnings
from multiphi_exudyn.study.comparison.wording import engineering, listed
from multiphi_exudyn.study.measures import metrics
from multiphi_exudyn.study.running.runs import ModelRun
from multiphi_exudyn.study.scene.scene_loads import described_loads

__all__ = ["comparison_warnings", "findings"]

TEMPLATE = "findings.txt.j2"
HONEST = 0.01  # NRMSE that the headline's model holds, where any does and the reference can tell
GONE = 0.05  # NRMSE above which a pointwise comparison says little


def findings(comparison: Comparison) -> dict[str, tuple[str, ...]]:
    """Sentences: compared, outcome, distrust; and key_figures, each "what | how much | from what"."""
    bench, headline = comparison.bench, _headline_runs(comparison)
    cheapest = [run for run in comparison.cheapest if run.ok]
    best = _most_accurate(comparison, "reduced")
    return sentences(
        __package__ or "",
        TEMPLATE,
        ("compared", "outcome", "distrust", "key_figures"),
        comparison=comparison,
        bench=bench,
        until=comparison.headline_window,
        start=bench.scene.file.start,
        loads=described_loads(bench.scene.file.loads),
        laws=[law.in_words() for law in bench.scene.file.force_laws],
        contacts=_contact_words(bench.mechanics.contacts),
        headline=headline,
        best=None if best in headline else best,
        failed=[run for run in comparison.runs.values() if not run.ok],
        cheapest=cheapest,
        cheapest_worst=max(cheapest, key=lambda run: _error(comparison, run), default=None),
        own=comparison.coarser,
        early=list(_separated(comparison, [*headline, comparison.coarser])),
        followed=[(law, _beyond_span(comparison, law)) for law in bench.mechanics.force_laws],
        twins=list(_twins(comparison)),
        warned=comparison_warnings(comparison),
    )


def comparison_warnings(comparison: Comparison) -> list[str]:
    """What the models say of their own answers, a sentence each."""
    runs = comparison.runs.items()
    horizons = [(name, run.horizon_s) for name, run in runs]
    return run_warnings([(name, run.warnings) for name, run in runs], horizons, comparison.bench.t_end)


def _contact_words(contacts: Sequence[UnilateralContact]) -> list[str]:
    """Each contact, or many at once."""
    if len(contacts) > LISTED:
        return [
            f"{len(contacts)} contacts from {contacts[0].name} to {contacts[-1].name} ({_laws_words(contacts)} each)"
        ]
    told = []
    for contact in contacts:
        points = list(coefficients(contact))
        between = f" between {listed(points)}" if len(points) == 2 else ""
        damping = f", {engineering(contact.damping)}N s/m" if contact.damping else ""
        told.append(f"the contact {contact.name}{between} ({_laws_words([contact])}{damping})")
    return told


def _laws_words(contacts: Sequence[UnilateralContact]) -> str:
    """Gaps and stiffness, from the smallest to the largest."""

    def span(values: Iterable[float], word: Callable[[float], str]) -> str:
        return " to ".join(dict.fromkeys([word(min(values)), word(max(values))]))

    gap = span([1e3 * contact.gap for contact in contacts], "{:g}".format)
    stiffness = [contact.stiffness for contact in contacts]
    return f"gap {gap} mm, {span(stiffness, lambda k: 'rigid' if math.isinf(k) else f'{engineering(k)}N/m')}"


def _error(comparison: Comparison, run: ModelRun) -> float:
    """To the end of the window that the headline speaks of; of a run that is not measured infinite."""
    known = run.name in comparison.measured
    return comparison.worst_error(run, comparison.headline_window) if known else math.inf


def _most_accurate(comparison: Comparison, kind: str) -> ModelRun | None:
    runs = [run for run in comparison.measured.values() if run.kind == kind]
    return min(runs, key=lambda run: _error(comparison, run), default=None)


def _headline_runs(comparison: Comparison) -> list[ModelRun]:
    """Of each kind the fastest accurate one, or else the most accurate; then the scene's first, if it is another."""
    own, runs = comparison.coarser, list(comparison.measured.values())
    floor = max(HONEST, _error(comparison, own) if own is not None else 0.0)
    chosen = []
    for kind in ("reduced", "user-object"):
        accurate = [run for run in runs if run.kind == kind and _error(comparison, run) <= floor]
        best = min(accurate, key=lambda run: run.online_s, default=_most_accurate(comparison, kind))
        chosen += [best.name] if best is not None else []
    first = [run.name for run in runs if run.kind == "reduced"][:1]
    return [comparison.runs[name] for name in dict.fromkeys([*chosen, *first])]


def _separated(comparison: Comparison, runs: Iterable[ModelRun | None]) -> Iterator[str]:
    """Those of the runs that leave the reference, and when."""
    for run in runs:
        end = comparison.bench.t_end if run is None else comparison.horizon(run, GONE)
        if run is not None and end < comparison.bench.t_end:
            yield f"{run.name} {end:.2f} s"


def _beyond_span(comparison: Comparison, law: ForceLaw) -> tuple[float, float] | None:
    """What the reference reaches [mm] where it leaves a law's span; it has recorded all the law's points."""
    places: dict[str, float] = {law.at: 1.0} if isinstance(law.at, str) else dict(law.at)
    points = comparison.reference.points
    if not places.keys() <= points.keys():
        return None
    reached = np.sum([factor * points[name] for name, factor in places.items()], axis=0)
    lowest, highest = float(np.min(reached)), float(np.max(reached))
    return None if law.knots[0] <= lowest <= highest <= law.knots[-1] else (1e3 * lowest, 1e3 * highest)


def _twins(comparison: Comparison) -> Iterator[tuple[ModelRun, ModelRun, float]]:
    """User objects beside the same reduced model, and their largest NRMSE of all points to the end of the run."""
    for run in comparison.runs.values():
        twin = comparison.twin(run)
        if twin is not None:
            points = comparison.bench.points
            apart = [metrics.nrmse(run.points[p], twin.points[p], run.time, comparison.bench.t_end) for p in points]
            yield run, twin, max(apart)
