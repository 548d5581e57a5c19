"""Levels found by their keys, and states mapped between them.

xi_m = T xi_l + c,   xi'_m = T' xi'_l + c'                                        (38.6)
"""

from __future__ import annotations

from multiphi_exudyn.events.arrays import (
    CHANNELS,
    ELEMENTS,
    LEVEL,
    LEVEL_SLOTS,
    LEVELS,
    MAP_ENTRY,
    MAP_SLOTS,
    MAP_TERMS,
    MAPPED,
    MAPPED_SPEED,
    MAPS,
    MATRIX,
    MODES,
    NEED,
    NEED_LEVEL,
    NEED_MAP,
    NEEDED,
    NEEDED_FROM,
    NEEDED_KEY,
    OFFSET,
    PLACE,
    PRESCRIBED,
    RATE_MATRIX,
    RATE_OFFSET,
    REACH,
    SET_SIZES,
    SPEED,
    STATES,
    SWING,
)
from multiphi_exudyn.events.states.state_arrays import measure
from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, compiled
from multiphi_exudyn.mathematics.round_off import ZERO

__all__ = ["find_level", "find_map", "level_hash", "map_hash", "map_state", "move"]

HASH_MODULUS = 1_000_003  # of keys: products of it with small numbers stay far below 2^63


@compiled
def level_hash(ints: Ints, key: int, c: int) -> int:
    """Return the hash of a key (c,)."""
    value = 0
    for i in range(c):
        value = (31 * value + ints[key + i] + 1) % HASH_MODULUS
    return value


@compiled
def map_hash(source: int, target: int) -> int:
    """Return the hash of two levels."""
    return (source % HASH_MODULUS * 31 + target) % HASH_MODULUS


@compiled
def find_level(ints: Ints, key: int) -> int:
    """Return the level with a key (c,); NEED if it has not been packed."""
    c, slots = ints[ELEMENTS], ints[LEVEL_SLOTS]
    slot = level_hash(ints, key, c) % slots
    while ints[ints[LEVELS] + slot] != 0:
        level = ints[ints[LEVELS] + slot]
        states = ints[level + STATES]
        i = 0
        while i < c and ints[states + i] == ints[key + i]:
            i += 1
        if i == c:
            return level
        slot = (slot + 1) % slots
    ints[NEEDED] = NEED_LEVEL
    for i in range(c):
        ints[ints[NEEDED_KEY] + i] = ints[key + i]
    return NEED


@compiled
def find_map(ints: Ints, source: int, target: int) -> int:
    """Return the map between two levels; NEED if it has not been packed."""
    slots = ints[MAP_SLOTS]
    slot = map_hash(source, target) % slots
    while True:
        entry = ints[MAPS] + MAP_ENTRY * slot
        if ints[entry] == 0:
            break
        if ints[entry] == source and ints[entry + 1] == target:
            return ints[entry + 2]
        slot = (slot + 1) % slots
    ints[NEEDED] = NEED_MAP
    ints[NEEDED_FROM] = source
    for i in range(ints[ELEMENTS]):
        ints[ints[NEEDED_KEY] + i] = ints[ints[target + STATES] + i]
    return NEED


@compiled
def map_state(
    ints: Ints,
    numbers: Numbers,
    way: int,
    other: int,
    x: int,
    v: int,
    n: int,
    m: int,
    rows: int,
    place: int,
    speed: int,
    sizes: int,
) -> None:
    """xi (rows,) of x (n,) by one map, xi' of v (m,) by that or another one, and the sizes (2, rows) of their terms.

    All at once: they are sums that do not wait for each other. A map that sets places knows the terms of which its own
    numbers are sums.
    """
    matrix, offset, moving = ints[way + MATRIX], ints[way + OFFSET], n
    rates, rate_offset, sliding = ints[other + RATE_MATRIX], ints[other + RATE_OFFSET], m
    while moving > 0 and numbers[x + moving - 1] == 0.0:
        moving -= 1
    while sliding > 0 and numbers[v + sliding - 1] == 0.0:  # a start at rest has no speed at all
        sliding -= 1
    both = min(moving, sliding)
    for i in range(rows):
        total = numbers[offset + i] if offset >= 0 else 0.0
        slope = numbers[rate_offset + i] if rate_offset >= 0 else 0.0
        size, slope_size = abs(total), abs(slope)
        for j in range(both):
            total += numbers[matrix + j] * numbers[x + j]
            slope += numbers[rates + j] * numbers[v + j]
            size += abs(numbers[matrix + j]) * abs(numbers[x + j])
            slope_size += abs(numbers[rates + j]) * abs(numbers[v + j])
        for j in range(both, moving):
            total += numbers[matrix + j] * numbers[x + j]
            size += abs(numbers[matrix + j]) * abs(numbers[x + j])
        for j in range(both, sliding):
            slope += numbers[rates + j] * numbers[v + j]
            slope_size += abs(numbers[rates + j]) * abs(numbers[v + j])
        numbers[place + i], numbers[speed + i] = total, slope
        numbers[sizes + i], numbers[sizes + rows + i] = size, slope_size
        matrix += n
        rates += m
    if ints[way + MAP_TERMS] >= 0:
        size_by_terms(ints, numbers, way, 0, x, n, rows, sizes)
    if ints[other + MAP_TERMS] >= 0:
        size_by_terms(ints, numbers, other, 1, v, m, rows, sizes + rows)


@compiled
def size_by_terms(ints: Ints, numbers: Numbers, way: int, part: int, given: int, n: int, rows: int, sizes: int) -> None:
    """Compute the sizes (rows,) of the terms of xi (part 0) or xi' (part 1), from those of the map's numbers."""
    terms, offset = ints[way + MAP_TERMS], ints[way + RATE_OFFSET]
    for i in range(rows):
        size = numbers[terms + n]  # that one is of places
        if part == 1:
            size = abs(numbers[offset + i]) if offset >= 0 else 0.0
        for j in range(n):
            size += abs(numbers[terms + j] * numbers[given + j])
        numbers[sizes + i] = size
        terms += n + 1


@compiled
def move(ints: Ints, numbers: Numbers, places: int, speeds: int, level: int, result: int) -> int:
    """xi of the state ``places`` and xi' of ``speeds``, of the same instant, as a state of a level; OK or NEED.

    The sizes of the map's terms, with the scales of the state before, are kept for the decisions of this instant: a
    mode that hardly moves has the round-off of those from which it was mapped. If the map sets places, its terms are
    added to the scales of the following motion.
    """
    here, there = ints[places + LEVEL], ints[speeds + LEVEL]
    way = find_map(ints, here, level)
    if way < 0:
        return way
    other = way if there == here else find_map(ints, there, level)
    if other < 0:
        return other
    channels, rows, sizes = ints[CHANNELS], ints[level + MODES] + ints[CHANNELS], ints[SET_SIZES]
    map_state(
        ints, numbers, way, other, ints[places + PLACE], ints[speeds + SPEED], ints[here + MODES] + channels,
        ints[there + MODES] + channels, rows, ints[result + PLACE], ints[result + SPEED], sizes,
    )  # fmt: skip
    for i in range(ints[level + MODES] + ints[PRESCRIBED], rows):  # a held place that is round-off of its map is zero
        if abs(numbers[ints[result + PLACE] + i]) <= ZERO * numbers[sizes + i]:
            numbers[ints[result + PLACE] + i] = 0.0
    ints[result + LEVEL] = level
    measure(ints, numbers, result)
    sets_places = ints[other + MAP_TERMS] >= 0
    for i in range(ints[level + MODES]):
        numbers[ints[result + MAPPED] + i] = numbers[sizes + i]
        numbers[ints[result + MAPPED_SPEED] + i] = numbers[sizes + rows + i]
        if sets_places:
            numbers[ints[result + REACH] + i] += numbers[sizes + i]
            numbers[ints[result + SWING] + i] += numbers[sizes + rows + i]
    map_scales(ints, numbers, places, ints[way + MATRIX], 0, result)
    map_scales(ints, numbers, speeds, ints[other + RATE_MATRIX], 1, result)
    return 0


@compiled
def map_scales(ints: Ints, numbers: Numbers, state: int, matrix: int, rate: int, result: int) -> None:
    """Add to the sizes of a map's terms those of the scales of the state before; rate: 1 for velocities, else 0."""
    reach, mapped, sizes = ints[state + REACH], ints[state + MAPPED], ints[result + MAPPED]
    if rate == 1:
        reach, mapped, sizes = ints[state + SWING], ints[state + MAPPED_SPEED], ints[result + MAPPED_SPEED]
    n = ints[ints[state + LEVEL] + MODES] + ints[CHANNELS]
    for i in range(ints[ints[result + LEVEL] + MODES]):
        for j in range(n):
            numbers[sizes + i] += abs(numbers[matrix + j]) * max(numbers[reach + j], numbers[mapped + j])
        matrix += n
