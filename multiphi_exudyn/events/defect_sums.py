"""Defects of a run as they happen: what levels entered cannot hold, added up for its warnings (defect_forms.py).

At the start d = y - V xi - y_inf and w = (v - V xi') / Omega, row by row; between levels by the triangular factors
of their map. A rigid contact that is struck and opens again takes more out than the factors know: where it alone is
struck, that goes with the square of its impulse; where several are, or an instant passed through further levels, the
sum is nan.
"""

from __future__ import annotations

import math

from multiphi_exudyn.events.arrays import (
    CHANGE_COUNT,
    CHANGE_IMPULSES,
    CHANGE_WIDTH,
    CHANGES,
    CHANNELS,
    COORDINATES,
    CURRENT,
    DEFECTS,
    ELEMENTS,
    GIVEN,
    JUDGED,
    KINDS,
    LEVEL,
    MAP_DEFECT,
    MODES,
    OPEN,
    PERIODS,
    PLACE,
    RIGID,
    SHARED,
    SPEED,
    STATES,
    STRUCK_DEFECTS,
)
from multiphi_exudyn.events.maps import find_map
from multiphi_exudyn.mathematics.compiled import Ints, Numbers, compiled

__all__ = ["add_defect", "add_start_defect"]

NOBODY, STAYS, LEAVES = 0, 1, 2


@compiled
def add_defect(ints: Ints, numbers: Numbers, before: int, after: int) -> None:
    """Adds |d|^2 + |w / Omega|^2 between two states of an instant with the changes that are listed."""
    struck, way = who_is_struck(ints, numbers, after), -1
    if ints[JUDGED] == 0 or (struck == NOBODY and ints[before + LEVEL] == ints[after + LEVEL]):
        return
    if struck == LEAVES and ints[before + LEVEL] == ints[after + LEVEL]:
        numbers[DEFECTS] += left_by_impact(ints, numbers, ints[ints[after + LEVEL] + STRUCK_DEFECTS])
        return
    if struck != LEAVES:
        way = find_map(ints, ints[before + LEVEL], ints[after + LEVEL])
    if way < 0 or ints[way + MAP_DEFECT] < 0:
        numbers[DEFECTS] = math.nan
        return
    n, further = ints[ints[before + LEVEL] + MODES] + ints[CHANNELS], ints[ints[after + LEVEL] + MODES] + ints[CHANNELS]
    width, m = n + further, ints[COORDINATES]
    row = ints[way + MAP_DEFECT]
    for part in range(2):
        x, y = ints[before + PLACE + part], ints[after + PLACE + part]
        constant = 1 - part
        for i in range(min(m, width + constant)):
            total = numbers[row + width] if part == 0 else 0.0
            for j in range(i, n):
                total += numbers[row + j] * numbers[x + j]
            for j in range(max(i - n, 0), further):
                total += numbers[row + n + j] * numbers[y + j]
            numbers[DEFECTS] += total * total
            row += width + constant


@compiled
def who_is_struck(ints: Ints, numbers: Numbers, after: int) -> int:
    """Whether a change is an impact, and all contacts that are struck stay closed: NOBODY, STAYS or LEAVES."""
    states, result = ints[ints[after + LEVEL] + STATES], NOBODY
    for k in range(ints[CHANGE_COUNT]):
        change = ints[CHANGES] + k * CHANGE_WIDTH
        if numbers[ints[CHANGE_IMPULSES] + k] > 0.0 and ints[change + 1] != SHARED:
            result = max(result, LEAVES if ints[states + ints[change]] == OPEN else STAYS)
    return result


@compiled
def left_by_impact(ints: Ints, numbers: Numbers, sizes: int) -> float:
    """|w / Omega|^2 of a contact that was struck and has opened again; nan where there are several."""
    count, result = 0, math.nan
    for k in range(ints[CHANGE_COUNT]):
        change, impulse = ints[CHANGES] + k * CHANGE_WIDTH, numbers[ints[CHANGE_IMPULSES] + k]
        if impulse > 0.0 and ints[change + 1] != SHARED:
            count += 1
            result = impulse * impulse * numbers[sizes + ints[change]]
    return result if count == 1 else math.nan


@compiled
def add_start_defect(ints: Ints, numbers: Numbers) -> None:
    """Adds |d|^2 + |w / Omega|^2 of the start from GIVEN to CURRENT; nan where rigid contacts are closed."""
    if ints[JUDGED] == 0:
        return
    level, base = ints[CURRENT + LEVEL], ints[GIVEN + LEVEL]
    way = find_map(ints, base, level)
    known = way >= 0 and who_is_struck(ints, numbers, CURRENT) == NOBODY
    for i in range(ints[ELEMENTS]):
        if ints[ints[KINDS] + i] == RIGID and ints[ints[level + STATES] + i] != OPEN:
            known = False
    if not known:
        numbers[DEFECTS] = math.nan
        return
    n, row = ints[level + MODES] + ints[CHANNELS], ints[way + MAP_DEFECT]
    for i in range(ints[COORDINATES]):
        d = numbers[ints[GIVEN + PLACE] + i] - numbers[row + n]
        w = numbers[ints[GIVEN + SPEED] + i]
        for j in range(n):
            d -= numbers[row + j] * numbers[ints[CURRENT + PLACE] + j]
            w -= numbers[row + j] * numbers[ints[CURRENT + SPEED] + j]
        w *= numbers[ints[base + PERIODS] + i]
        numbers[DEFECTS] += d * d + w * w
        row += n + 1
