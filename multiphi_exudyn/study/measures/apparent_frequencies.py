"""Frequencies as the response shows them, window by window, whichever levels it passes through.

*Repetition rate* of a point: how often in a second its motion comes round. With the times t_k at which it passes zero
downwards, and as a second series those at which it passes upwards,

    f = sum_k o_k / T_k / sum_k o_k,   T_k = t_k+1 - t_k,   o_k [s]: what cycle k and the window have in common

over both series. In free motion of one level it is the frequency of the mode that leads; in a motion that changes
levels twice in every period it is one over that period, above the open level's first frequency, because a closed
contact turns the motion round sooner. Half cycles of either level in turn give

    f_bilinear = 2 f_open f_closed / (f_open + f_closed),

the limit of large motion (S. W. Shaw, P. J. Holmes, J. Sound Vib. 90 (1983) 129).

A passage counts where the point goes from one side of zero to the other by more than a tenth of the window's largest
displacement: ripples of higher modes are none.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from multiphi_exudyn.levels.model import MultiPhiModel
from multiphi_exudyn.study.measures.response_frequencies import level_frequencies, level_name
from multiphi_exudyn.study.running.runs import ModelRun
from multiphi_exudyn.study.scene.workbench import Workbench

__all__ = ["apparent_frequencies", "bilinear_frequency", "natural_frequencies", "repetition_rate"]

RIPPLE = 0.1  # of a window's largest displacement: what stays below it on one side of zero is no passage
COVERED = 0.5  # of a window, at least, by whole cycles: from less no rate is told
WHOLE_SAMPLE = 1e-9  # of the last time: how far the end of a window may lie beyond it


def apparent_frequencies(bench: Workbench, run: ModelRun, point: str, ends: Sequence[float]) -> list[dict[str, Any]]:
    """For each window between 0 and the ``ends`` [s] that the run reaches: what the response shows in it.

    from, until [s]; rate: repetition rate of ``point`` [Hz], None where too little of the window is whole cycles;
    closed: contact -> share of the window in contact; levels: level -> natural frequencies [Hz] identified from all
    points' histories in the longest interval in which it holds.
    """
    contacts = [contact.name for contact in bench.mechanics.contacts]
    reached = [end for end in ends if end <= run.time[-1] * (1 + WHOLE_SAMPLE)]
    return [
        {
            "from": start,
            "until": end,
            "rate": repetition_rate(run.time, run.points[point], (start, end)),
            "closed": {name: _share(run.contact_intervals[name], start, end) for name in contacts},
            "levels": level_frequencies(run, contacts, (start, end)),
        }
        for start, end in pairwise([0.0, *reached])
    ]


def repetition_rate(time: np.ndarray, history: np.ndarray, window: tuple[float, float]) -> float | None:
    """Repetition rate [Hz] of a ``history`` (k,) at ``time`` (k,) [s] in a window [s]; None where it is not known.

    Cycles reach beyond the window's ends: the whole history is looked at.
    """
    start, end = window
    inside = np.abs(history[(time >= start) & (time <= end)])
    if not len(inside) or not np.max(inside) > 0:
        return None
    shares, rates = [], []
    for passages in _passages(time, history, RIPPLE * float(np.max(inside))):
        common = np.minimum(passages[1:], end) - np.maximum(passages[:-1], start)
        shares.append(np.maximum(common, 0.0))
        rates.append(1 / np.diff(passages))
    weights = np.concatenate(shares)
    if np.sum(weights) < COVERED * 2 * (end - start):  # two series
        return None
    return float(np.average(np.concatenate(rates), weights=weights))


def bilinear_frequency(opened: float, closed: float) -> float:
    """Repetition rate [Hz] of half cycles of two frequencies [Hz] in turn."""
    return 2 * opened * closed / (opened + closed)


def natural_frequencies(bench: Workbench, rigid: bool) -> dict[str, list[float]]:
    """Level -> its natural frequencies [Hz], all of them: of the open one, and of each contact closed alone."""
    model = MultiPhiModel(bench.structure, bench.contacts(rigid), modes="all", overrides=bench.overrides)
    levels: list[tuple[str, ...]] = [(), *((contact.name,) for contact in model.contacts)]
    return {level_name(closed): [float(f) for f in model.level(closed).frequencies] for closed in levels}


def _passages(time: np.ndarray, history: np.ndarray, beyond: float) -> Iterator[np.ndarray]:
    """Times (m,) [s] of the passages through zero from above ``beyond`` to below it, then of those back."""
    side = np.where(history > beyond, 1, np.where(history < -beyond, -1, 0))
    outside = np.flatnonzero(side)
    last, first = outside[:-1], outside[1:]
    for to in (-1, 1):
        changes = (side[first] == to) & (side[last] == -to)
        yield np.array([_zero(time, history, a, b) for a, b in zip(last[changes], first[changes], strict=True)])


def _zero(time: np.ndarray, history: np.ndarray, last: int, first: int) -> float:
    """Middle [s] of the zeros between two samples on different sides, each interpolated linearly."""
    values, times = history[last : first + 1], time[last : first + 1]
    before = np.flatnonzero((values[:-1] > 0) != (values[1:] > 0))[[0, -1]]
    slopes = np.diff(values)[before] / np.diff(times)[before]
    return float(np.mean(times[before] - values[before] / slopes))


def _share(intervals: np.ndarray, start: float, end: float) -> float:
    """Of a window: how much of it the intervals (k, 2) [s] fill."""
    return float(np.sum(np.diff(np.clip(intervals, start, end), axis=1)) / (end - start))
