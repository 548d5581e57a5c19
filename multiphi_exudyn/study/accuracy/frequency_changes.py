"""What a study's axis does to the frequencies that its responses show, from the rows alone.

Of a run at one value of the axis, in one window, with the repetition rate f of a point and the first natural frequency
f_1 of the run's own open level; the run that changes are counted from is the *ideal* one:

    rise = f / f_1 - 1          what contacts, and large displacement, add to the free frequency
    change = f / f_ideal - 1    what the axis adds, the contacts being there in both
    shift = f_k / f_k,ideal - 1   of a level's k-th natural frequency: its own, and the one seen in the response

A natural frequency seen in the response belongs to the level's own that is nearest, if it is near enough.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from multiphi_exudyn.study.accuracy.analysis import COARSER, REFERENCE, Setting, StudyResult, references, settings
from multiphi_exudyn.study.accuracy.study_file import FrequencySpec
from multiphi_exudyn.study.measures.response_frequencies import level_name

__all__ = [
    "OPEN",
    "Mode",
    "Shown",
    "Window",
    "asked_of",
    "axis_of",
    "ideal_of",
    "rate_uncertainty",
    "shown_of",
    "values_of",
]

OPEN = level_name(())
NEAR = 0.05  # of a frequency: half the distance of the rig's two nearest, three times what 0.1 m of displacement moves
WHOLE = 1e-9  # of a time: windows that end together

Mode = tuple[str, int]  # level, number of the mode from 1


@dataclass(frozen=True)
class Window:
    """What one window of a run shows; times in s, rate in Hz, the others relative; None where it is not known.

    closed: contact -> share of the window in contact. seen: mode -> shift of its frequency as seen in the response.
    """

    start: float
    end: float
    rate: float | None
    rise: float | None
    change: float | None
    closed: Mapping[str, float]
    seen: Mapping[Mode, float]


@dataclass(frozen=True, eq=False)
class Shown:
    """What one run shows. natural: level -> natural frequencies [Hz]; shifts: mode -> shift of the level's own."""

    method: str
    value: Any
    natural: Mapping[str, Sequence[float]]
    shifts: Mapping[Mode, float]
    windows: tuple[Window, ...]

    def mean(self, quantity: str, until: float) -> float | None:
        """Mean over time of a window's ``quantity``, rate, rise or change, in the windows that end by ``until`` [s]."""
        early = [window for window in self.windows if window.end <= until * (1 + WHOLE)]
        known = [(getattr(w, quantity), w.end - w.start) for w in early if getattr(w, quantity) is not None]
        return sum(value * length for value, length in known) / sum(length for _, length in known) if known else None


def asked_of(result: StudyResult) -> FrequencySpec:
    """What the study's file asks for; only of a study that asks."""
    assert result.study.frequencies is not None, "the study asks for frequencies"
    return result.study.frequencies


def axis_of(result: StudyResult) -> str:
    """The field that is varied: the study's only axis."""
    return next(iter(result.study.axes))


def values_of(result: StudyResult) -> list[Any]:
    """The axis' values in the file's order, of those that a run has."""
    return list(dict.fromkeys(shown.value for shown in shown_of(result)))


def shown_of(result: StudyResult) -> list[Shown]:
    """What the reference and every method show at each value; [] of a study that asks for no frequencies."""
    if result.study.frequencies is None:
        return []
    runs = [s for s in (*references(result), *settings(result)) if s.method != COARSER and "shown" in s.values]
    return [_shown(setting, ideal, axis_of(result)) for setting, ideal in _with_ideal(result, runs)]


def ideal_of(result: StudyResult) -> list[Shown]:
    """What the runs show that the reference's changes are counted from."""
    asked = asked_of(result)
    method = asked.ideal_method or REFERENCE
    return [s for s in shown_of(result) if s.method == method and asked.ideal in (None, s.value)]


def rate_uncertainty(result: StudyResult) -> float | None:
    """Largest difference, over the values, of the early repetition rate between the reference and its coarser copy."""
    asked, axis = asked_of(result), axis_of(result)
    runs = [s for s in references(result) if "shown" in s.values]
    rates = {(s.method, s.at[axis]): _shown(s, None, axis).mean("rate", asked.early) for s in runs}
    pairs = [(rates.get((COARSER, value)), rates.get((REFERENCE, value))) for value in values_of(result)]
    return max((abs(coarser / own - 1) for coarser, own in pairs if coarser and own), default=None)


def _with_ideal(result: StudyResult, runs: Sequence[Setting]) -> Iterator[tuple[Setting, Setting | None]]:
    asked, axis = asked_of(result), axis_of(result)
    known = {(run.method, run.at[axis]): run for run in runs}
    for run in runs:
        value = run.at[axis] if asked.ideal is None else asked.ideal
        yield run, known.get((asked.ideal_method or run.method, value))


def _shown(run: Setting, ideal: Setting | None, axis: str) -> Shown:
    natural = run.values["natural"]
    base = {} if ideal is None else _modes(ideal.values["natural"])
    others = [] if ideal is None else ideal.values["shown"]
    rates = {(other["from"], other["until"]): other["rate"] for other in others}
    return Shown(
        run.method,
        run.at[axis],
        natural,
        {mode: f / base[mode] - 1 for mode, f in _modes(natural).items() if mode in base},
        tuple(
            _window(given, natural, base, rates.get((given["from"], given["until"]))) for given in run.values["shown"]
        ),
    )


def _window(
    given: Mapping[str, Any], natural: Mapping[str, Sequence[float]], base: Mapping[Mode, float], ideal: float | None
) -> Window:
    own = _modes(natural)
    return Window(
        given["from"],
        given["until"],
        given["rate"],
        _relative(given["rate"], own[OPEN, 1]),
        _relative(given["rate"], ideal),
        given["closed"],
        {mode: f / base[mode] - 1 for mode, f in _seen(given["levels"], own).items() if mode in base},
    )


def _seen(levels: Mapping[str, Sequence[float]], own: Mapping[Mode, float]) -> dict[Mode, float]:
    """Mode -> frequency [Hz] of those that the response shows near a level's own."""
    found: dict[Mode, float] = {}
    for (level, number), frequency in own.items():
        distances = {abs(f / frequency - 1): f for f in levels.get(level, ())}
        if distances and min(distances) < NEAR:
            found[level, number] = distances[min(distances)]
    return found


def _modes(natural: Mapping[str, Sequence[float]]) -> dict[Mode, float]:
    return {(level, i): f for level, values in natural.items() for i, f in enumerate(values, 1)}


def _relative(value: float | None, base: float | None) -> float | None:
    return None if value is None or not base else value / base - 1
