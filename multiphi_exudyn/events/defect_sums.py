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
    SET_SIZES,
    SHARED,
    SPEED,
    SPEEDS_CHANGED,
    STATES,
    STRUCK_DEFECTS,
)
from multiphi_exudyn.events.maps import find_map, move_part
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
    n, n_after = ints[ints[before + LEVEL] + MODES] + ints[CHANNELS], ints[ints[after + LEVEL] + MODES] + ints[CHANNELS]
    row, changes = ints[way + MAP_DEFECT], ints[SET_SIZES]
    for part in range(2):
        x, constants, further = ints[before + PLACE + part], 1 - part, 0
        if ints[MAPPED_AGAIN] == 1 or (part == 1 and ints[SPEEDS_CHANGED] == 1):
            move_part(ints, numbers, way, part, x, ints[after + LEVEL], n, changes, changes + n_after)
            further = n_after
        for i in range(further):
            numbers[changes + i] -= numbers[ints[after + PLACE + part] + i]
        width = constants + n + n_after
        rows = min(ints[COORDINATES], constants + n + further)
        numbers[DEFECTS] += square(numbers, row, width, rows, constants, x, n, changes, further)
        row += min(ints[COORDINATES], width) * width


@compiled
def square(
    numbers: Numbers, factor: int, width: int, rows: int, constants: int, x: int, n: int, changes: int, further: int
) -> float:
    """|R z|^2 of the first rows of a triangular factor R (.., width), z = (1, x, changes, 0) or without the 1.

    constants: 1 or 0. x: (n,). changes: (further,).
    """
    result = 0.0
    for i in range(rows):
        row = factor + i * width
        total = numbers[row] if i < constants else 0.0
        for j in range(max(i - constants, 0), n):
            total += numbers[row + constants + j] * numbers[x + j]
        for j in range(max(i - constants - n, 0), further):
            total += numbers[row + constants + n + j] * numbers[changes + j]
        result += total * total
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
