"""Defects of a run: the parts of motions that the levels entered cannot hold (defect_forms.py), summed for warnings.

At the start d = y - V xi - y_inf and w = (v - V xi') / Omega, row by row. Between levels the triangular factors of the
map are used: on the state before alone if one map has made the state after, else also on the changes beside the map,

    s = T xi_l + c - xi_m,   s' = T' xi'_l - xi'_m

A rigid contact that is struck and opens again removes more than the factors hold. If it alone is struck, that part is
proportional to the square of its impulse. If several are struck, or an instant passes through further levels, the sum
is nan.
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
    NEED_STRUCK,
    NEEDED,
    NEEDED_FROM,
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
from multiphi_exudyn.mathematics.orthonormal import scalar_product

__all__ = ["add_defect", "add_start_defect", "lacks_struck_defects"]

NO_IMPACT, STAYS_CLOSED, REOPENS = 0, 1, 2


@compiled
def add_defect(ints: Ints, numbers: Numbers, before: int, after: int) -> None:
    """Add |d|^2 + |w / Omega|^2 between two states of an instant, with its listed changes."""
    struck, map_record = impact_kind(ints, numbers, after), -1
    if ints[JUDGED] == 0 or (struck == NO_IMPACT and ints[before + LEVEL] == ints[after + LEVEL]):
        return
    if struck == REOPENS and ints[before + LEVEL] == ints[after + LEVEL]:
        numbers[DEFECTS] += impact_defect(ints, numbers, ints[ints[after + LEVEL] + STRUCK_DEFECTS])
        return
    if struck != REOPENS:
        map_record = find_map(ints, ints[before + LEVEL], ints[after + LEVEL])
    if map_record < 0 or ints[map_record + MAP_DEFECT] < 0:
        numbers[DEFECTS] = math.nan
        return
    n, further = ints[ints[before + LEVEL] + MODES] + ints[CHANNELS], ints[ints[after + LEVEL] + MODES] + ints[CHANNELS]
    x, v, count, width = ints[before + PLACE], ints[before + SPEED], n, 1 + n + further
    if ints[MAPPED_AGAIN] == 1 or ints[SPEEDS_CHANGED] == 1:
        list_differences(ints, numbers, map_record, before, after)
        x, v, count = ints[WORK_NUMBERS], ints[WORK_NUMBERS] + n + further, n + further
    numbers[DEFECTS] += squares(numbers, ints[map_record + MAP_DEFECT], width, x, v, count)


@compiled
def lacks_struck_defects(ints: Ints, numbers: Numbers, before: int, after: int) -> int:
    """Return 1 with a request where ``add_defect`` needs what a struck contact that opens again removes, else 0."""
    level = ints[after + LEVEL]
    if (
        ints[level + STRUCK_DEFECTS] != 0
        or ints[before + LEVEL] != level
        or impact_kind(ints, numbers, after) != REOPENS
    ):
        return 0
    ints[NEEDED], ints[NEEDED_FROM] = NEED_STRUCK, level
    return 1


@compiled
def list_differences(ints: Ints, numbers: Numbers, map_record: int, before: int, after: int) -> None:
    """Write (xi, s) and (xi', s') (2, n + n_after) to WORK_NUMBERS; s is zero if one map has made the displacements."""
    n, further = ints[ints[before + LEVEL] + MODES] + ints[CHANNELS], ints[ints[after + LEVEL] + MODES] + ints[CHANNELS]
    x, v, changed = ints[before + PLACE], ints[before + SPEED], ints[MAPPED_AGAIN] == 1
    places, speeds = ints[WORK_NUMBERS], ints[WORK_NUMBERS] + n + further
    for i in range(n):
        numbers[places + i] = numbers[x + i]
        numbers[speeds + i] = numbers[v + i]
    s, s_rate, sizes = places + n, speeds + n, speeds + n + further
    map_state(ints, numbers, map_record, map_record, x, v, n, n, further, s, s_rate, sizes)
    for i in range(further):
        numbers[s + i] = numbers[s + i] - numbers[ints[after + PLACE] + i] if changed else 0.0
        numbers[s_rate + i] -= numbers[ints[after + SPEED] + i]


@compiled
def squares(numbers: Numbers, factors: int, width: int, x: int, v: int, count: int) -> float:
    """Return |R (1, x, 0)|^2 + |R' (v, 0)|^2 of triangular factors R (width, width) and R', one narrower.

    x, v: (count,).
    """
    displaced, moving = factors + 1, factors + width * width
    constant = numbers[factors] + scalar_product(numbers, displaced, numbers, x, count)
    result = constant * constant
    for i in range(count):
        displaced += width
        d = scalar_product(numbers, displaced + i, numbers, x + i, count - i)
        w = scalar_product(numbers, moving + i, numbers, v + i, count - i)
        result += d * d + w * w
        moving += width - 1
    return result


@compiled
def impact_kind(ints: Ints, numbers: Numbers, after: int) -> int:
    """Return NO_IMPACT, STAYS_CLOSED if all contacts that are struck stay closed, or REOPENS."""
    states, result = ints[ints[after + LEVEL] + STATES], NO_IMPACT
    for k in range(ints[CHANGE_COUNT]):
        change = ints[CHANGES] + k * CHANGE_WIDTH
        if numbers[ints[CHANGE_IMPULSES] + k] > 0.0 and ints[change + 1] != SHARED:
            result = max(result, REOPENS if ints[states + ints[change]] == OPEN else STAYS_CLOSED)
    return result


@compiled
def impact_defect(ints: Ints, numbers: Numbers, sizes: int) -> float:
    """Return |w / Omega|^2 of a contact that was struck and has opened again; nan if there are several."""
    count, result = 0, math.nan
    for k in range(ints[CHANGE_COUNT]):
        change, impulse = ints[CHANGES] + k * CHANGE_WIDTH, numbers[ints[CHANGE_IMPULSES] + k]
        if impulse > 0.0 and ints[change + 1] != SHARED:
            count += 1
            result = impulse * impulse * numbers[sizes + ints[change]]
    return result if count == 1 else math.nan


@compiled
def add_start_defect(ints: Ints, numbers: Numbers) -> None:
    """Add |d|^2 + |w / Omega|^2 of the start from GIVEN to CURRENT; nan if a rigid link holds."""
    if ints[JUDGED] == 0:
        return
    level, base = ints[CURRENT + LEVEL], ints[GIVEN + LEVEL]
    map_record = find_map(ints, base, level)
    if map_record < 0 or ints[map_record + MAP_DEFECT] < 0 or impact_kind(ints, numbers, CURRENT) != NO_IMPACT:
        numbers[DEFECTS] = math.nan
        return
    n, row = ints[level + MODES] + ints[CHANNELS], ints[map_record + MAP_DEFECT]
    for i in range(ints[COORDINATES]):
        d = numbers[ints[GIVEN + PLACE] + i] - numbers[row + n]
        w = numbers[ints[GIVEN + SPEED] + i]
        for j in range(n):
            d -= numbers[row + j] * numbers[ints[CURRENT + PLACE] + j]
            w -= numbers[row + j] * numbers[ints[CURRENT + SPEED] + j]
        w *= numbers[ints[base + PERIODS] + i]
        numbers[DEFECTS] += d * d + w * w
        row += n + 1
