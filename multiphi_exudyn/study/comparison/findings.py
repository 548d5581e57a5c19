"""Sentences about a comparison, from its template: what was compared, results, limits of the results."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np

from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.force_law import ForceLaw
from multiphi_exudyn.study.comparison.beam_places import coefficients
from multiphi_exudyn.study.comparison.compare import MOST_LISTED, Comparison
from multiphi_exudyn.study.comparison.pages import sentences
from multiphi_exudyn.study.comparison.run_warnings import run_warnings
from multiphi_exudyn.study.comparison.wording import engineering, listed
from multiphi_exudyn.study.measures import metrics
from multiphi_exudyn.study.running.runs import ModelRun
from multiphi_exudyn.study.setup import Setup

__all__ = ["comparison_warnings", "findings"]

TEMPLATE = "findings.txt.j2"
HEADLINE_ERROR = 0.01  # NRMSE that the headline's model meets, if any model does and the reference is certain enough
MOST_PLACES = 12  # points whose places are told
CURVE_TOLERANCE = 0.05  # NRMSE above which a pointwise comparison says little


def findings(comparison: Comparison) -> dict[str, tuple[str, ...]]:
    """Sentences by section: compared, outcome, distrust; and key_figures, each "quantity | value | source"."""
    setup, headline = comparison.setup, _headline_runs(comparison)
    cheapest = [run for run in comparison.cheapest if run.ok]
    best = _most_accurate(comparison, "reduced")
    return sentences(
        __package__ or "",
        TEMPLATE,
        ("compared", "outcome", "distrust", "key_figures"),
        comparison=comparison,
        setup=setup,
        until=comparison.headline_window,
        start=setup.scene.file.start,
        loads=[f"the load {load.phrase()}" for load in setup.scene.file.loads],
        laws=[f"the force law {law.phrase()}" for law in setup.scene.file.force_laws],
        contacts=_contact_phrases(setup.mechanics.contacts),
        headline=headline,
        best=None if best in headline else best,
        failed=[run for run in comparison.runs.values() if not run.ok],
        cheapest=cheapest,
        cheapest_error=max((_error(comparison, run) for run in cheapest), default=math.inf),
        component=comparison.component_within(math.inf),
        component_as_accurate=lambda run: comparison.component_within(max(_error(comparison, run), _own(comparison))),
        unjudged=[name for name in setup.points if name not in setup.judged_points],
        own=comparison.coarser,
        places=_places(setup),
        load=comparison.environment.get("load_average", 0.0),
        cores=comparison.environment.get("cores", math.inf),
        early=list(_separated(comparison, [*headline, comparison.coarser])),
        followed=[(law, _displacements_beyond_span(comparison, law)) for law in setup.mechanics.force_laws],
        twins=list(_twins(comparison)),
        warnings=comparison_warnings(comparison),
    )


def comparison_warnings(comparison: Comparison) -> list[str]:
    """Warnings of the models about their own results, one sentence for each kind."""
    runs = comparison.runs.items()
    horizons = [(name, run.horizon_s) for name, run in runs]
    return run_warnings([(name, run.warnings) for name, run in runs], horizons, comparison.setup.t_end)


def _contact_phrases(contacts: Sequence[UnilateralContact]) -> list[str]:
    """A phrase for each contact, or one for all if there are many."""
    if len(contacts) > MOST_LISTED:
        return [
            f"{len(contacts)} contacts from {contacts[0].name} to {contacts[-1].name} "
            f"({_gap_and_stiffness_text(contacts)} each)"
        ]
    phrases = []
    for contact in contacts:
        points = list(coefficients(contact))
        between = f" between {listed(points)}" if len(points) == 2 else ""
        damping = f", {engineering(contact.damping)}N s/m" if contact.damping else ""
        phrases.append(f"the contact {contact.name}{between} ({_gap_and_stiffness_text([contact])}{damping})")
    return phrases


def _gap_and_stiffness_text(contacts: Sequence[UnilateralContact]) -> str:
    """Ranges of gap [mm] and stiffness of the contacts."""

    def span(values: Iterable[float], text: Callable[[float], str]) -> str:
        return " to ".join(dict.fromkeys([text(min(values)), text(max(values))]))

    gap = span([1e3 * contact.gap for contact in contacts], "{:g}".format)
    stiffness = [contact.stiffness for contact in contacts]
    return f"gap {gap} mm, {span(stiffness, lambda k: 'rigid' if math.isinf(k) else f'{engineering(k)}N/m')}"


def _places(setup: Setup) -> list[str]:
    """A phrase for each point that is named on a page: where it is on its beam; none of matrices, or of many points."""
    beams, start = setup.mechanics.beams, setup.scene.file.start
    started = [] if start is None else [start.load_at, getattr(start, "measured_at", start.load_at)]
    named = list(dict.fromkeys([*setup.points, *setup.contact_points, *started]))
    if beams is None or len(named) > MOST_PLACES:
        return []
    return [f"{name} {1e3 * beams.points[name][1]:g} mm" for name in named]


def _error(comparison: Comparison, run: ModelRun) -> float:
    """Worst error in the headline's window; infinite for a run without an error."""
    has_error = run.name in comparison.measured
    return comparison.worst_error(run, comparison.headline_window) if has_error else math.inf


def _own(comparison: Comparison) -> float:
    """The reference's own uncertainty in the headline's window; 0 where it is unknown."""
    own = comparison.coarser
    return 0.0 if own is None else _error(comparison, own)


def _most_accurate(comparison: Comparison, kind: str) -> ModelRun | None:
    runs = [run for run in comparison.measured.values() if run.kind == kind]
    return min(runs, key=lambda run: _error(comparison, run), default=None)


def _headline_runs(comparison: Comparison) -> list[ModelRun]:
    """Fastest accurate run of each kind (else its most accurate one), then the scene's first reduced model."""
    runs, floor = list(comparison.measured.values()), max(HEADLINE_ERROR, _own(comparison))
    names = []
    for kind in ("reduced", "user-object"):
        accurate = [run for run in runs if run.kind == kind and _error(comparison, run) <= floor]
        best = min(accurate, key=lambda run: run.online_s, default=_most_accurate(comparison, kind))
        names += [best.name] if best is not None else []
    first = [run.name for run in runs if run.kind == "reduced"][:1]
    return [comparison.runs[name] for name in dict.fromkeys([*names, *first])]


def _separated(comparison: Comparison, runs: Iterable[ModelRun | None]) -> Iterator[str]:
    """Name and time of the runs whose NRMSE exceeds CURVE_TOLERANCE before the end."""
    for run in runs:
        end = comparison.setup.t_end if run is None else comparison.horizon(run, CURVE_TOLERANCE)
        if run is not None and end < comparison.setup.t_end:
            yield f"{run.name} {end:.2f} s"


def _displacements_beyond_span(comparison: Comparison, law: ForceLaw) -> tuple[float, float] | None:
    """Range of the reference's displacement [mm] along a law, if it exceeds the law's span; else None.

    None also where the reference has not recorded all points of the law.
    """
    coefficients_of: dict[str, float] = {law.at: 1.0} if isinstance(law.at, str) else dict(law.at)
    points = comparison.reference.points
    if not coefficients_of.keys() <= points.keys():
        return None
    displacement = np.sum([factor * points[name] for name, factor in coefficients_of.items()], axis=0)
    lowest, highest = float(np.min(displacement)), float(np.max(displacement))
    return None if law.knots[0] <= lowest <= highest <= law.knots[-1] else (1e3 * lowest, 1e3 * highest)


def _twins(comparison: Comparison) -> Iterator[tuple[ModelRun, ModelRun, float]]:
    """Each user object, the same reduced model run alone, and the largest NRMSE of all points between them."""
    for run in comparison.runs.values():
        twin = comparison.twin(run)
        if twin is not None:
            points = comparison.setup.points
            errors = [metrics.nrmse(run.points[p], twin.points[p], run.time, comparison.setup.t_end) for p in points]
            yield run, twin, max(errors)
