"""Defects of a run as they happen: what levels entered cannot hold, added up for its warnings (defect_forms.py).

At the start d = y - V xi - y_inf and w = (v - V xi') / Omega, row by row; between levels by the triangular factors of
their map: of the state before alone where one map has made the state after, else also of what was changed beside it,

    s = T xi_l + c - xi_m,   s' = T' xi'_l - xi'_m

A rigid contact that is struck and opens again takes more out than the factors know: where it alone is
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
    GIVEN,
    JUDGED,
    LEVEL,
    MAP_DEFECT,
    MAPPED_AGAIN,
    MODES,
    OPEN,
    PERIODS,
    PLACE,
    SHARED,
    SPEED,
    SPEEDS_CHANGED,
    STATES,
    STRUCK_DEFECTS,
    WORK_NUMBERS,
)
from multiphi_exudyn.events.states.maps import find_map, map_state
from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, compiled

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
    x, v, count, width = ints[before + PLACE], ints[before + SPEED], n, 1 + n + further
    if ints[MAPPED_AGAIN] == 1 or ints[SPEEDS_CHANGED] == 1:
        list_changed(ints, numbers, way, before, after)
        x, v, count = ints[WORK_NUMBERS], ints[WORK_NUMBERS] + n + further, n + further
    numbers[DEFECTS] += squares(numbers, ints[way + MAP_DEFECT], width, x, v, count)


@compiled
def list_changed(ints: Ints, numbers: Numbers, way: int, before: int, after: int) -> None:
    """(xi, s) and (xi', s') (2, n + n_after) into WORK_NUMBERS; s is zero where one map has made the places."""
    n, further = ints[ints[before + LEVEL] + MODES] + ints[CHANNELS], ints[ints[after + LEVEL] + MODES] + ints[CHANNELS]
    x, v, changed = ints[before + PLACE], ints[before + SPEED], ints[MAPPED_AGAIN] == 1
    places, speeds = ints[WORK_NUMBERS], ints[WORK_NUMBERS] + n + further
    for i in range(n):
        numbers[places + i] = numbers[x + i]
        numbers[speeds + i] = numbers[v + i]
    s, slowed, sizes = places + n, speeds + n, speeds + n + further
    map_state(ints, numbers, way, way, x, v, n, n, further, s, slowed, sizes)
    for i in range(further):
        numbers[s + i] = numbers[s + i] - numbers[ints[after + PLACE] + i] if changed else 0.0
        numbers[slowed + i] -= numbers[ints[after + SPEED] + i]


@compiled
def squares(numbers: Numbers, factors: int, width: int, x: int, v: int, count: int) -> float:
    """|R (1, x, 0)|^2 + |R' (v, 0)|^2 of triangular factors R (width, width) and R', one narrower; x, v: (count,)."""
    displaced, moving, constant = factors + 1, factors + width * width, numbers[factors]
    for j in range(count):
        constant += numbers[displaced + j] * numbers[x + j]
    result = constant * constant
    for i in range(count):
        displaced += width
        d, w = 0.0, 0.0
        for j in range(i, count):
            d += numbers[displaced + j] * numbers[x + j]
            w += numbers[moving + j] * numbers[v + j]
        result += d * d + w * w
        moving += width - 1
    return result


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
    """Adds |d|^2 + |w / Omega|^2 of the start from GIVEN to CURRENT; nan where a rigid link holds."""
    if ints[JUDGED] == 0:
        return
    level, base = ints[CURRENT + LEVEL], ints[GIVEN + LEVEL]
    way = find_map(ints, base, level)
    if way < 0 or ints[way + MAP_DEFECT] < 0 or who_is_struck(ints, numbers, CURRENT) != NOBODY:
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
