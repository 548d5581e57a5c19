"""What a comparison found, in plain words: what was compared, what came out, what to distrust."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.force_law import ForceLaw
from multiphi_exudyn.study.comparison.compare import Comparison
from multiphi_exudyn.study.comparison.contact_totals import LISTED
from multiphi_exudyn.study.comparison.placement import meeting
from multiphi_exudyn.study.comparison.warned import warned
from multiphi_exudyn.study.comparison.wording import engineering, listed, percent, seconds, sentence, times
from multiphi_exudyn.study.measures import metrics
from multiphi_exudyn.study.running.runs import ModelRun
from multiphi_exudyn.study.scene.scene_file import DisplacedStart
from multiphi_exudyn.study.scene.scene_laws import described_laws
from multiphi_exudyn.study.scene.scene_loads import described_loads

__all__ = ["Findings", "findings"]

HONEST = 0.01  # NRMSE that the headline's model holds, where any does and the reference can tell
GONE = 0.05  # NRMSE above which a pointwise comparison says little


@dataclass(frozen=True)
class Findings:
    """compared and outcome: one sentence or two each. key_figures: (what, how much, from what)."""

    compared: str
    outcome: str
    distrust: tuple[str, ...]
    key_figures: tuple[tuple[str, str, str], ...]


def findings(comparison: Comparison) -> Findings:
    """The report's sentences, from the comparison's numbers."""
    return Findings(
        compared=_compared(comparison),
        outcome=_outcome(comparison),
        distrust=tuple(_distrust(comparison)),
        key_figures=tuple(_key_figures(comparison)),
    )


def first_of(comparison: Comparison, kind: str) -> ModelRun | None:
    """The scene's first measured model of a kind: the one the headline speaks of."""
    return next((run for run in comparison.measured.values() if run.kind == kind), None)


def _compared(comparison: Comparison) -> str:
    stops = _contacts(comparison.bench.mechanics.contacts)
    return (
        f"{len(comparison.runs)} models answer one question over {comparison.bench.t_end:g} s: {_start(comparison)}"
        f"{_driven(comparison)}{', and meets ' + stops if stops else ''}{_on_it(comparison)}. "
        f"Reference: {comparison.reference.label}."
    )


def _contacts(contacts: Sequence[UnilateralContact]) -> str:
    """Few contacts one by one, of many how many; nothing without one."""
    if len(contacts) <= LISTED:
        return " and ".join(
            f"the contact {c.name}{_between(c)} ({_gap([c])}, {_stiffness([c])}{_damped(c)})" for c in contacts
        )
    return (
        f"{len(contacts)} contacts from {contacts[0].name} to {contacts[-1].name} "
        f"({_gap(contacts)}, {_stiffness(contacts)} each)"
    )


def _between(contact: UnilateralContact) -> str:
    """The points of a contact that has two."""
    points = meeting(contact)
    return f" between {' and '.join(points)}" if len(points) == 2 else ""


def _gap(contacts: Sequence[UnilateralContact]) -> str:
    gaps = [1e3 * contact.gap for contact in contacts]
    return f"gap {_span([f'{gap:g}' for gap in (min(gaps), max(gaps))])} mm"


def _stiffness(contacts: Sequence[UnilateralContact]) -> str:
    values = [contact.stiffness for contact in contacts]
    return _span(["rigid" if math.isinf(k) else f"{engineering(k)}N/m" for k in (min(values), max(values))])


def _span(ends: Sequence[str]) -> str:
    return " to ".join(dict.fromkeys(ends))


def _on_it(comparison: Comparison) -> str:
    laws = described_laws(comparison.bench.scene)
    return f"; on it acts {' and '.join(laws)}" if laws else ""


def _damped(contact: UnilateralContact) -> str:
    return f", {engineering(contact.damping)}N s/m" if contact.damping else ""


def _start(comparison: Comparison) -> str:
    start = comparison.bench.scene.file.start
    what = "the structure" if comparison.bench.mechanics.beam is None else "the beam"
    if start is None:
        return f"{what} starts straight and at rest"
    if isinstance(start, DisplacedStart):
        return (
            f"{what} is bent by a static force at {start.load_at} until {start.measured_at} "
            f"stands at {1e3 * start.displacement:+g} mm, released from rest"
        )
    return f"{what} is bent by a static force of {start.force:+g} N at {start.load_at}, released from rest"


def _driven(comparison: Comparison) -> str:
    """What acts from then on, as a clause; nothing for a structure that is only released."""
    loads = described_loads(comparison.bench.scene)
    return f", is driven from t = 0 on by {' and '.join(loads)}" if loads else ""


def _outcome(comparison: Comparison) -> str:
    if not comparison.reference.ok:
        return f"The reference failed, so nothing can be measured: {comparison.reference.message}"
    failed = [f"{run.name} ({run.message})" for run in comparison.runs.values() if not run.ok]
    return " ".join(
        [
            *(_answer(comparison, run) for run in _headline_runs(comparison)),
            *_most_accurate(comparison),
            *([f"Failed: {'; '.join(failed)}."] if failed else []),
        ]
    )


def _headline_runs(comparison: Comparison) -> list[ModelRun]:
    """Of each kind the fastest accurate one, or else the most accurate; then the scene's first, if it is another."""
    runs = [best for kind in ("reduced", "user-object") if (best := _honest(comparison, kind)) is not None]
    first = first_of(comparison, "reduced")
    return runs if first is None or any(run is first for run in runs) else [*runs, first]


def _honest(comparison: Comparison, kind: str) -> ModelRun | None:
    def error(run: ModelRun) -> float:
        return comparison.worst_error(run, comparison.headline_window)

    runs = [run for run in comparison.measured.values() if run.kind == kind]
    own = comparison.coarser
    floor = max(HONEST, error(own) if own is not None and own.name in comparison.measured else 0.0)
    accurate = [run for run in runs if error(run) <= floor]
    if accurate:
        return min(accurate, key=lambda run: run.online_s)
    return min(runs, key=error, default=None)


def _answer(comparison: Comparison, run: ModelRun) -> str:
    return (
        f"{run.label} differs from the reference by {_error(comparison, run)} to {comparison.headline_window:g} s "
        f"(NRMSE{_judged(comparison)}) and takes {seconds(run.online_s)}: {_cheapest_words(comparison, run)}"
        f"{times(comparison.speedup(run))} faster than the reference."
    )


def _cheapest_words(comparison: Comparison, run: ModelRun) -> str:
    cheapest = [each for each in comparison.cheapest if each.ok]
    if not cheapest:
        return ""
    return f"{times(cheapest[0].online_s / run.online_s)} faster than the cheapest fair full model, "


def _most_accurate(comparison: Comparison) -> Iterable[str]:
    runs = [run for run in comparison.measured.values() if run.kind == "reduced"]
    best = min(runs, key=lambda run: comparison.worst_error(run, comparison.headline_window), default=None)
    if best is not None and not any(run is best for run in _headline_runs(comparison)):
        error, speed = _error(comparison, best), times(comparison.speedup(best))
        yield f"The most accurate reduced model is {best.label}: {error}, {speed} faster."


def _distrust(comparison: Comparison) -> Iterable[str]:
    yield from map(sentence, warned(comparison))
    yield from _own_uncertainty(comparison)
    yield from _sensitivity(comparison)
    yield from _rigid_levels(comparison)
    yield from _force_laws(comparison)
    if comparison.bench.overrides:
        yield (
            "The reduced levels have the printed frequencies and ratios, which no one linear model has. The full "
            "beam has its own, so this difference is one of data, not of reduction."
        )
    if comparison.bench.mechanics.assumptions:
        yield (
            "No measurement is compared here. Section, length, tip inertia, hole positions, start and support "
            "stiffness are assumed, not printed; they are listed under Assumptions."
        )
    yield (
        "Run times are wall clock on one machine that may have been busy: ratios count, and those of short runs "
        "vary by tens of per cent."
    )


def _own_uncertainty(comparison: Comparison) -> Iterable[str]:
    own = comparison.coarser
    if own is None or own.name not in comparison.measured:
        yield "The reference's own uncertainty is unknown here: no coarser copy of it ran."
        return
    known = ", ".join(f"{percent(comparison.worst_error(own, w))} to {w:g} s" for w in comparison.bench.windows)
    yield (
        f"The reference is uncertain itself: it differs from a coarser copy of itself by {known}. "
        "Smaller differences say nothing."
    )


def _rigid_levels(comparison: Comparison) -> Iterable[str]:
    if comparison.stiff is not None and not comparison.stiff.ok:
        cause = comparison.stiff.message
        yield f"Rigid levels are the limit of stiff stops, but nothing with stiff stops ran: {cause}."
    elif comparison.rigid:
        yield (
            "Rigid levels are the limit of stiff stops: from a soft one they differ by its softness, which no number "
            "of modes removes. The table “Rigid levels against stiff stops” measures them against their limit."
        )


def _sensitivity(comparison: Comparison) -> Iterable[str]:
    runs = [*_headline_runs(comparison), *((comparison.coarser,) if comparison.coarser else ())]
    ends = {run.name: comparison.horizon(run, GONE) for run in runs if run.name in comparison.measured}
    early = {name: end for name, end in ends.items() if end < comparison.bench.t_end}
    if early:
        listed = ", ".join(f"{name} {end:.2f} s" for name, end in early.items())
        yield (
            f"Contact makes nearby runs separate. Curve by curve the comparison holds to 5 % until: {listed}; "
            "after that compare contact times and energies, not curves."
        )


def _force_laws(comparison: Comparison) -> Iterable[str]:
    """How well segments follow a law, and whether the reference stays where they do."""
    for law in comparison.bench.mechanics.force_laws:
        low, high = law.knots[[0, -1]]
        span = f"{1e3 * low:g} to {1e3 * high:g} mm"
        if callable(law.law):
            yield (
                f"Reduced models follow the force law {law.name} by {len(law.slopes)} straight segments from {span}, "
                f"to {percent(law.error)} of its largest force there; the full beam has the law itself."
            )
        reached = _reached(comparison, law)
        if len(reached) and not low <= np.min(reached) <= np.max(reached) <= high:
            yield (
                f"The reference leaves the span of the force law {law.name} ({span}): it reaches "
                f"{1e3 * np.min(reached):.3g} to {1e3 * np.max(reached):.3g} mm. Beyond the span reduced models go on "
                "along the last segments."
            )


def _reached(comparison: Comparison, law: ForceLaw) -> np.ndarray:
    """q (k,) [m] of the reference; empty where it failed or not all of the law's points are recorded."""
    places: dict[str, float] = {law.at: 1.0} if isinstance(law.at, str) else dict(law.at)
    points = comparison.reference.points
    if not all(name in points for name in places):
        return np.empty(0)
    return np.sum([factor * points[name] for name, factor in places.items()], axis=0)


def _key_figures(comparison: Comparison) -> Iterable[tuple[str, str, str]]:
    if not comparison.reference.ok:
        return
    judged = f"NRMSE to {comparison.headline_window:g} s{_judged(comparison)}"
    own, cheapest = comparison.coarser, [run for run in comparison.cheapest if run.ok]
    if own is not None and own.name in comparison.measured:
        yield "the reference's own uncertainty", _error(comparison, own), f"{judged}; against {own.name}"
    if cheapest:
        worst = max(cheapest, key=lambda run: comparison.worst_error(run, comparison.headline_window))
        nearby = f", worst of {len(cheapest)} nearby steps" if len(cheapest) > 1 else ""
        source = f"{judged}{nearby}; online {seconds(cheapest[0].online_s)}"
        yield "the full model at its cheapest fair setting", _error(comparison, worst), source
    for run in _headline_runs(comparison):
        yield f"{run.name} over the reference", *_faster(comparison, run, comparison.reference)
        if cheapest:
            yield f"{run.name} over the cheapest fair full model", *_faster(comparison, run, cheapest[0])
    yield from _same_model_twice(comparison)


def _same_model_twice(comparison: Comparison) -> Iterable[tuple[str, str, str]]:
    for run in comparison.runs.values():
        twin = comparison.twin(run)
        if twin is not None:
            worst = max(
                metrics.nrmse(run.points[point], twin.points[point], run.time, comparison.bench.t_end)
                for point in comparison.bench.points
            )
            source = f"NRMSE to {comparison.bench.t_end:g} s, worst of all points: one model, two ways to run it"
            yield f"{run.name} against {twin.name}", percent(worst), source


def _faster(comparison: Comparison, run: ModelRun, than: ModelRun) -> tuple[str, str]:
    sampled = times(than.online_s / (run.online_s + run.sampling_s))
    source = f"{seconds(than.online_s)} / {seconds(run.online_s)} ({sampled} with its histories sampled)"
    return f"{times(than.online_s / run.online_s)} faster", f"{source}; its error {_error(comparison, run)}"


def _error(comparison: Comparison, run: ModelRun) -> str:
    return percent(comparison.worst_error(run, comparison.headline_window))


def _judged(comparison: Comparison) -> str:
    points = comparison.bench.judged_points
    return f"{', worst' if len(points) > 1 else ''} of {listed(points)}"
