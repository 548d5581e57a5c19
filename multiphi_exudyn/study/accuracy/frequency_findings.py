"""What a study's axis does to the frequencies of the response, in plain words: levels, rise, change, what is seen."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from multiphi_exudyn.study.accuracy.analysis import COARSER, REFERENCE, StudyResult, is_number, references
from multiphi_exudyn.study.accuracy.frequency_changes import (
    OPEN,
    Shown,
    Window,
    asked_of,
    axis_of,
    ideal_of,
    rate_uncertainty,
    shown_of,
    values_of,
)
from multiphi_exudyn.study.accuracy.study_file import FrequencySpec
from multiphi_exudyn.study.measures.apparent_frequencies import bilinear_frequency

__all__ = ["frequency_asked", "frequency_outcome", "signed", "value_words"]

SAME = 1e-6  # of a natural frequency: what eigenvalue solvers leave of no shift
NOTABLE = 0.01  # of a rate: a rise or a change below it answers no question
SURE = 3.0  # times the uncertainty of a rate: nearby runs scatter, and a single coarser copy is not the worst of them
SEEN = 1e-3  # of a natural frequency: below it lies the reference's own time step


def frequency_asked(result: StudyResult) -> str:
    """The question, and what is looked at."""
    asked = asked_of(result)
    return (
        f"{asked.question} Along {axis_of(result)}, at {len(values_of(result))} values: how often the motion of "
        f"{asked.point} comes round, and which natural frequencies the response shows, in each of "
        f"{len(asked.windows)} windows."
    )


def frequency_outcome(result: StudyResult) -> Iterator[str]:
    """The answer first, then what it rests on; nothing where no run shows anything."""
    own = [shown for shown in shown_of(result) if shown.method == REFERENCE]
    if not own:
        return
    yield from _answer(result, own)
    yield from _levels(own)
    yield from _rises(result, own)
    yield from _limit(own)
    yield from _changes(result, own)
    yield from _seen(own)


def signed(share: float | None) -> str:
    """A change: "+57 %", "-0.73 %"; "–" where it is not known."""
    if share is None:
        return "–"
    percent = 100 * share
    return (
        f"{percent:+.0f} %" if abs(percent) >= 10 else f"{percent:+.1f} %" if abs(percent) >= 1 else f"{percent:+.2f} %"
    )


def value_words(value: Any) -> str:
    """A value of the axis."""
    return f"{value:g}" if is_number(value) else str(value)


# ------------------------------------------------------------------ the answer


def _answer(result: StudyResult, own: Sequence[Shown]) -> Iterable[str]:
    asked = asked_of(result)
    changes = [(s, s.mean("change", asked.early)) for s in own if s.value != asked.ideal]
    known = [change for _, change in changes if change is not None]
    if known:
        floor = max(NOTABLE, SURE * (rate_uncertainty(result) or 0.0))
        sign = _by_sign(min(known), max(known), floor, asked.early)
        yield f"{asked.question} {sign}{_contact(result)}{_own_free(own, asked)}"


def _by_sign(lowest: float, highest: float, floor: float, early: float) -> str:
    rate = f"the repetition rate of the first {early:g} s"
    both = _range([lowest, highest])
    if -floor <= lowest and highest <= floor:
        return f"No, by its size: it changes {rate} by {both}."
    if highest <= floor:
        return f"No, by its sign: it lowers {rate}: {both}."
    if lowest >= -floor:
        return f"It can add to such a rise: it changes {rate} by {both}."
    return f"That depends on its value: it changes {rate} by {both}."


def _contact(result: StudyResult) -> str:
    """What the ideal model shows of a rise, without what is studied."""
    early = asked_of(result).early
    rises = [rise for each in ideal_of(result) if (rise := each.mean("rise", early)) is not None]
    if not rises or min(rises) < NOTABLE:
        return ""
    return (
        f" The contact makes a rise without it: in {_ideal_words(result)} that rate already is {_range(rises)} above "
        "the free frequency, since a closed contact turns the motion round sooner."
    )


def _own_free(own: Sequence[Shown], asked: FrequencySpec) -> str:
    """What the axis makes of the rise where the free frequency, to which the rate falls in the end, moves as well."""
    moved = [s for s in own if abs(s.shifts.get((OPEN, 1), 0.0)) > SAME]
    rises = [rise for s in moved if (rise := s.mean("rise", asked.early)) is not None]
    if not rises:
        return ""
    return f" Against the run's own free frequency, which it moves too, the rise is {_range(rises)}."


def _range(shares: Sequence[float]) -> str:
    ends = list(dict.fromkeys((signed(min(shares)), signed(max(shares)))))
    return " to ".join(ends)


def _ideal_words(result: StudyResult) -> str:
    asked = asked_of(result)
    if asked.ideal_method is not None:
        return f"“{asked.ideal_method}”"
    return f"the {_model_words(result)} at {axis_of(result)} = {value_words(asked.ideal)}"


def _model_words(result: StudyResult) -> str:
    label = next((s.values.get("label") for s in references(result) if s.method != COARSER), None)
    return str(label or REFERENCE)


# ------------------------------------------------------------------ what it rests on


def _levels(own: Sequence[Shown]) -> Iterator[str]:
    """The levels' own natural frequencies: nothing of them depends on how they are passed through."""
    for level in own[0].natural:
        sizes = {value_words(s.value): _shifts(s, level) for s in own}
        moved = {value: shifts for value, shifts in sizes.items() if max(map(abs, shifts), default=0.0) > SAME}
        name = _level_words(level)
        if not moved:
            yield f"Natural frequencies of the {name}: the same at all values."
            continue
        most, least = (choose(moved, key=lambda v: max(map(abs, moved[v]))) for choose in (max, min))
        shown = [most] if most == least else [most, least]
        told = "; ".join(f"at {value} {', '.join(map(signed, moved[value]))}" for value in shown)
        yield f"Natural frequencies of the {name}, modes 1 to {len(moved[most])}: {told}."


def _shifts(shown: Shown, level: str) -> list[float]:
    return [shift for (of, _), shift in shown.shifts.items() if of == level]


def _level_words(level: str) -> str:
    return "open level" if level == OPEN else f"level with {level} closed"


def _rises(result: StudyResult, own: Sequence[Shown]) -> Iterable[str]:
    early = asked_of(result).early
    rises = {s: s.mean("rise", early) for s in own}
    known = {s: rise for s, rise in rises.items() if rise is not None}
    if not known:
        return
    listed = ", ".join(f"{signed(rise)} at {value_words(s.value)}" for s, rise in known.items())
    yield f"Rise of the repetition rate above the run's own free frequency, first {early:g} s: {listed}."
    for shown in dict.fromkeys((max(known, key=lambda s: known[s]), min(known, key=lambda s: known[s]))):
        told = ", ".join(f"{_span(w)} {signed(w.rise)}" for w in shown.windows)
        yield f"Window by window at {value_words(shown.value)}: {told}."


def _span(window: Window) -> str:
    return f"{window.start:g} to {window.end:g} s"


def _limit(own: Sequence[Shown]) -> Iterable[str]:
    """How far a contact alone can raise the rate."""
    limits = [
        bilinear_frequency(s.natural[OPEN][0], closed[0]) / s.natural[OPEN][0] - 1
        for s in own
        for level, closed in s.natural.items()
        if level != OPEN
    ]
    if limits:
        size = _range(limits)
        yield f"Half cycles of the open and of the closed level in turn, the limit of large motion, make it {size}."


def _changes(result: StudyResult, own: Sequence[Shown]) -> Iterable[str]:
    asked = asked_of(result)
    known = [(s.value, s.mean("change", asked.early)) for s in own if s.value != asked.ideal]
    listed = ", ".join(f"{signed(change)} at {value_words(value)}" for value, change in known if change is not None)
    if not listed:
        return
    size = rate_uncertainty(result)
    doubt = "" if size is None else f" The reference's own uncertainty of it: {signed(size).removeprefix('+')}."
    yield f"Change of that rate against {_ideal_words(result)}, in the same windows: {listed}.{doubt}"


def _seen(own: Sequence[Shown]) -> Iterator[str]:
    """Natural frequencies told from the response: of which levels, and how far from the ideal ones."""
    for level in own[0].natural:
        found = [
            (abs(x), x, mode, w, s) for s in own for w in s.windows for (of, mode), x in w.seen.items() if of == level
        ]
        total = sum(len(s.windows) for s in own)
        windows = len({(id(s), w.start) for _, _, _, w, s in found})
        name = _level_words(level)
        if not found:
            yield f"In the response no natural frequency of the {name} is seen: its intervals are too short."
            continue
        size, shift, mode, window, shown = max(found, key=lambda each: each[0])
        where = f"mode {mode} by {signed(shift)} at {value_words(shown.value)}, {_span(window)}"
        far = (
            f"furthest from the ideal ones: {where}"
            if size > SEEN
            else f"all within {100 * SEEN:g} % of the ideal ones"
        )
        yield f"In the response natural frequencies of the {name} are seen in {windows} of {total} windows, {far}."
        yield from _course(shown, (level, mode), size)


def _course(shown: Shown, mode: tuple[str, int], size: float) -> Iterable[str]:
    """How that shift goes on from window to window."""
    course = [(w, w.seen[mode]) for w in shown.windows if mode in w.seen]
    shifts = [shift for _, shift in course]
    if size > SEEN and max(shifts) - min(shifts) > SEEN:
        told = ", ".join(f"{_span(window)} {signed(shift)}" for window, shift in course)
        yield f"That mode window by window: {told}."
