"""What to distrust in the friction of a run: what several bear together, and what truncation turns round.

Friction without a spring that follows from what sticks beside it moves as that does: it pushes with its kinetic limit,
as if it slipped (decision.py). Which of them bears the load is then not determined, and where static limits are higher
neither is when they begin to slip: two of equal limits F and static limits S do at S + F here, and might at 2 S.

A truncated basis may leave friction that slips a speed s (h_t.x' - v_t - T'/k_t) < 0 against its slip (decision.py).
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator

import numpy as np

from multiphi_exudyn.display import per_cent
from multiphi_exudyn.events.exits import signal_row, state_of
from multiphi_exudyn.events.loaded_level import LoadedLevel
from multiphi_exudyn.levels.model import MultiPhiModel
from multiphi_exudyn.mathematics.least_distance import INDEPENDENT
from multiphi_exudyn.mathematics.round_off import CLEAR
from multiphi_exudyn.mechanics.element import friction_spring
from multiphi_exudyn.time.segment import Segments

__all__ = ["rubbing_warnings"]

SEEN = 1e-9  # of the largest speed: less against a slip is round-off
BACKWARDS = 0.01  # of the time that it slips: less of it against its slip is not told
REMEDY = "give one element with the sum of their limits, or each a spring (stiffness, tangential_stiffness)"


def rubbing_warnings(segments: Segments, model: MultiPhiModel) -> Iterator[str]:
    """Of a model with friction, one sentence of each kind at most."""
    yield from _shared(segments)
    if not model.whole:
        yield from _backwards(segments)


def _shared(segments: Segments) -> Iterator[str]:
    """Of those that push with the smallest share of their static limit."""
    contacts = segments.levels[0].level.base.contacts
    springs = [(i, *friction_spring(element)) for i, element in enumerate(contacts)]
    dropping = [(i, sticks, number, drop) for i, sticks, number, spring, drop in springs if drop > 0 and not spring]
    found = [together for level in segments.levels for given in dropping for together in _together(level, *given)]
    if found:
        share, name, others = min(found)
        yield (
            f"redundant friction: {name!r} follows from what sticks at {', '.join(map(repr, others))}, so which of "
            f"them bears the load, and when they begin to slip, is not unique: it pushes with its kinetic limit, "
            f"{per_cent(share)} of its static one; {REMEDY}"
        )


def _together(
    level: LoadedLevel, element: int, sticks: int, number: int, drop: float
) -> Iterator[tuple[float, str, tuple[str, ...]]]:
    """Of friction that follows from what is held in a level: its share of its static limit, itself, and the others."""
    base = level.level.base
    held, link = [k for k in level.level.indices if base.links[k].rigid], base.link_places[element][number]
    if not held or level.states[element] <= sticks:
        return
    rows, row = base.directions[:, held], base.directions[:, link]
    shares = np.linalg.lstsq(rows, row, rcond=None)[0]
    own, carried = base.links[link].velocity, shares * [base.links[k].velocity for k in held]
    slides = abs(own - np.sum(carried)) > CLEAR * (abs(own) + np.sum(np.abs(carried)))
    if slides or np.linalg.norm(row - rows @ shares) > INDEPENDENT * np.linalg.norm(row):
        return
    owners = {k: i for i, places in enumerate(base.link_places) for k in places}
    taken = [owners[k] for k, share in zip(held, shares, strict=True) if abs(share) > INDEPENDENT]
    others = tuple(dict.fromkeys(base.contacts[k].name for k in taken))
    yield math.sqrt(1.0 - drop), base.contacts[element].name, others


def _backwards(segments: Segments) -> Iterator[str]:
    """Of the friction that for the largest part of its slip has a speed against it, seen in the middle of segments."""
    contacts = segments.levels[0].level.base.contacts
    middles, lasting = (segments.starts + segments.ends) / 2, segments.ends - segments.starts
    worst, name = 0.0, ""
    for i, element in enumerate(contacts):
        sticks = friction_spring(element)[0]
        slips = np.array([level.states[i] > sticks for level in segments.levels])[segments.numbers]
        if sticks < 0 or not np.any(slips):
            continue
        speeds = segments.values(middles, "right", functools.partial(_slip_row, i, sticks))
        against = slips & (speeds < -SEEN * np.max(np.abs(speeds)))
        share = float(np.sum(lasting[against]) / (np.sum(lasting[slips]) or 1.0))
        worst, name = max((worst, name), (share, element.name))
    if worst > BACKWARDS:
        yield (
            f"backward slip: {name!r} moves against its slip for {per_cent(worst)} of the time that it slips, as "
            "truncation has turned its speed round; give the model more modes, or modes=Tolerance(0.01)"
        )


def _slip_row(element: int, sticks: int, level: LoadedLevel) -> np.ndarray:
    """s (h_t.x' - v_t - T'/k_t) [m/s] of an element while it slips, else zero."""
    width = level.width
    if level.states[element] <= sticks:
        return np.zeros(2 * width + 1)
    row = signal_row(level, element, state_of(level, element).exits[0])
    return np.concatenate([row.position, row.rate, [row.constant]])
