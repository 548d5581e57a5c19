"""What a comparison found, in plain words: what was compared, what came out, what to distrust."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from multiphi_exudyn.study.compare import Comparison
from multiphi_exudyn.study.runs import ModelRun
from multiphi_exudyn.study.scene_file import DisplacedStart

__all__ = ["Findings", "findings", "percent", "seconds", "times"]

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


def percent(value: float | None) -> str:
    """0.0123 -> "1.2 %"; below 0.01 % the size only."""
    if value is None or not math.isfinite(value):
        return "–"
    if 0 < abs(value) < 1e-4:
        return f"{100 * value:.0e} %"
    return f"{100 * value:.2f} %" if abs(value) < 0.1 else f"{100 * value:.1f} %"


def seconds(value: float | None) -> str:
    """A time with the unit that reads best."""
    if value is None or not math.isfinite(value):
        return "–"
    for scale, unit in ((1.0, "s"), (1e-3, "ms")):
        if abs(value) >= scale:
            return f"{value / scale:.3g} {unit}"
    return f"{value * 1e6:.3g} µs"


def times(value: float | None) -> str:
    """A ratio: "812 ×"."""
    if value is None or not math.isfinite(value):
        return "–"
    return f"{value:.0f} ×" if value >= 10 else f"{value:.2g} ×"


def first_of(comparison: Comparison, kind: str) -> ModelRun | None:
    """The scene's first measured model of a kind: the one the headline speaks of."""
    return next((run for run in comparison.measured.values() if run.kind == kind), None)


def _compared(comparison: Comparison) -> str:
    contacts = comparison.bench.mechanics.contacts
    stops = " and ".join(
        f"the contact {c.name} (gap {1e3 * c.gap:g} mm, {'rigid' if c.rigid else f'{c.stiffness:g} N/m'})"
        for c in contacts
    )
    return (
        f"{len(comparison.runs)} models answer one question over {comparison.bench.t_end:g} s: {_start(comparison)}, "
        f"released from rest{', and meets ' + stops if stops else ''}. The reference is {comparison.reference.label}."
    )


def _start(comparison: Comparison) -> str:
    start = comparison.bench.scene.file.start
    if isinstance(start, DisplacedStart):
        return (
            f"a structure is bent by a static force at {start.load_at} until {start.measured_at} "
            f"stands at {1e3 * start.displacement:+g} mm"
        )
    return f"a structure is bent by a static force of {start.force:+g} N at {start.load_at}"


def _outcome(comparison: Comparison) -> str:
    if not comparison.reference.ok:
        return f"The reference failed, so nothing can be measured: {comparison.reference.message}"
    sentences = [_answer(comparison, run) for run in _headline_runs(comparison)]
    failed = [f"{run.name} ({run.message})" for run in comparison.runs.values() if not run.ok]
    return " ".join([*sentences, *([f"Failed: {'; '.join(failed)}."] if failed else [])])


def _headline_runs(comparison: Comparison) -> list[ModelRun]:
    return [run for kind in ("reduced", "user-object") if (run := first_of(comparison, kind))]


def _answer(comparison: Comparison, run: ModelRun) -> str:
    until = comparison.headline_window
    return (
        f"{run.label} differs from the reference by {percent(comparison.worst_error(run, until))} to {until:g} s "
        f"(NRMSE, worst of {_listed(comparison.bench.judged_points)}) and takes {seconds(run.online_s)} instead of "
        f"{seconds(comparison.reference.online_s)}: {times(comparison.speedup(run))} faster."
    )


def _distrust(comparison: Comparison) -> Iterable[str]:
    yield from _own_uncertainty(comparison)
    yield from _sensitivity(comparison)
    yield from _contact_law(comparison)
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
    known = ", ".join(f"{percent(comparison.worst_error(own, w))} to {w:g} s" for w in comparison.windows)
    yield f"The reference is uncertain itself: it differs from a coarser copy by {known}. Smaller differences say nothing."


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


def _contact_law(comparison: Comparison) -> Iterable[str]:
    rigid = [run for run in comparison.measured.values() if run.kind != "full" and "rigid levels" in run.label]
    if not rigid or all(contact.rigid for contact in comparison.bench.mechanics.contacts):
        return
    until = comparison.headline_window
    errors = ", ".join(f"{run.name} {percent(comparison.worst_error(run, until))}" for run in rigid)
    yield (
        f"Rigid levels (to {until:g} s: {errors}) obey another contact law than the reference: an impact without "
        "rebound against a stop that gives way and pushes back. More modes do not remove that difference; "
        "it is the law, not the truncation. Levels of the reference's own stiffness have no such difference."
    )


def _key_figures(comparison: Comparison) -> Iterable[tuple[str, str, str]]:
    if not comparison.reference.ok:
        return
    until = comparison.headline_window
    judged = f"NRMSE to {until:g} s, worst of {_listed(comparison.bench.judged_points)}"
    own, reduced, body = comparison.coarser, first_of(comparison, "reduced"), first_of(comparison, "user-object")
    if own is not None and own.name in comparison.measured:
        yield "The reference's own uncertainty", percent(comparison.worst_error(own, until)), f"{judged}; against {own.name}"
    cheapest = [run for run in comparison.cheapest if run.ok]
    if cheapest:
        worst = max(comparison.worst_error(run, until) for run in cheapest)
        source = f"{judged} and of {len(cheapest)} nearby steps; online {seconds(cheapest[0].online_s)}"
        yield "The full model at its cheapest fair setting", percent(worst), source
    if reduced:
        source = f"{seconds(comparison.reference.online_s)} / {seconds(reduced.online_s)}, error {_error(comparison, reduced)}"
        yield f"{reduced.name} over the reference", f"{times(comparison.speedup(reduced))} faster", source
    if reduced and cheapest:
        ratio = cheapest[0].online_s / reduced.online_s
        source = f"{seconds(cheapest[0].online_s)} / {seconds(reduced.online_s)}"
        yield f"{reduced.name} over the cheapest fair full model", f"{times(ratio)} faster", source
    if body:
        source = f"{seconds(comparison.reference.online_s)} / {seconds(body.online_s)}, error {_error(comparison, body)}"
        yield f"{body.name} over the reference", f"{times(comparison.speedup(body))} faster", source


def _error(comparison: Comparison, run: ModelRun) -> str:
    return percent(comparison.worst_error(run, comparison.headline_window))


def _listed(names: Sequence[str]) -> str:
    return " and ".join([", ".join(names[:-1]), names[-1]]) if len(names) > 1 else "".join(names)
