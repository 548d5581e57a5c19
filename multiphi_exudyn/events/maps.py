"""Levels found by their keys, and states moved between them.

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
    RATE_MATRIX,
    RATE_OFFSET,
    REACH,
    SET_SIZES,
    SPEED,
    STATES,
    SWING,
)
from multiphi_exudyn.events.state_arrays import measure
from multiphi_exudyn.mathematics.compiled import Ints, Numbers, compiled

__all__ = ["find_level", "find_map", "level_hash", "map_hash", "move", "move_part"]

HASH_MODULUS = 1_000_003  # of keys: products of it with small numbers stay far below 2^63


@compiled
def level_hash(ints: Ints, key: int) -> int:
    """A number made of a key (c,)."""
    value = 0
    for i in range(ints[ELEMENTS]):
        value = (31 * value + ints[key + i] + 1) % HASH_MODULUS
    return value


@compiled
def map_hash(source: int, target: int) -> int:
    """A number made of two levels."""
    return (source % HASH_MODULUS * 31 + target) % HASH_MODULUS


@compiled
def find_level(ints: Ints, key: int) -> int:
    """The level with a key (c,); NEED where it has not been packed."""
    c, slots = ints[ELEMENTS], ints[LEVEL_SLOTS]
    slot = level_hash(ints, key) % slots
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
    """The map between two levels; NEED where it has not been packed."""
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
def move_part(
    ints: Ints, numbers: Numbers, way: int, rates: int, given: int, target: int, n: int, result: int, sizes: int
) -> None:
    """xi (rates 0) or xi' (rates 1) of a level with n coordinates in level ``target``, and the sizes of its terms.

    A map that sets places knows the terms of which its own numbers are sums.
    """
    matrix, offset, moving = ints[way + MATRIX], ints[way + OFFSET], n
    if rates == 1:
        matrix, offset = ints[way + RATE_MATRIX], ints[way + RATE_OFFSET]
    while moving > 0 and numbers[given + moving - 1] == 0.0:  # a start at rest has no speed at all
        moving -= 1
    for i in range(ints[target + MODES] + ints[CHANNELS]):
        total, row = numbers[offset + i] if offset >= 0 else 0.0, matrix + i * n
        size, terms = abs(total), row
        if ints[way + MAP_TERMS] >= 0:
            terms = ints[way + MAP_TERMS] + i * (n + 1)
            size = size if rates == 1 else numbers[terms + n]  # that one is of places
        for j in range(moving):
            total += numbers[row + j] * numbers[given + j]
            size += abs(numbers[terms + j] * numbers[given + j])
        numbers[result + i] = total
        numbers[sizes + i] = size


@compiled
def move(ints: Ints, numbers: Numbers, places: int, speeds: int, level: int, result: int) -> int:
    """xi of the state ``places`` and xi' of ``speeds``, of the same instant, as a state of a level; OK or NEED.

    The sizes of the map's terms are kept for the decisions of this instant: a mode that then hardly moves has the
    round-off of those that did. Where the map sets places, they belong to the scales of the motion that follows too.
    """
    here, there = ints[places + LEVEL], ints[speeds + LEVEL]
    way = find_map(ints, here, level)
    if way < 0:
        return way
    channels, x, v = ints[CHANNELS], ints[result + PLACE], ints[result + SPEED]
    sizes, slopes = ints[SET_SIZES], ints[SET_SIZES] + ints[level + MODES] + channels
    move_part(ints, numbers, way, 0, ints[places + PLACE], level, ints[here + MODES] + channels, x, sizes)
    if there != here:
        way = find_map(ints, there, level)
        if way < 0:
            return way
    move_part(ints, numbers, way, 1, ints[speeds + SPEED], level, ints[there + MODES] + channels, v, slopes)
    ints[result + LEVEL] = level
    measure(ints, numbers, result)
    sets_places = ints[way + MAP_TERMS] >= 0
    for i in range(ints[level + MODES]):
        numbers[ints[result + MAPPED] + i] = numbers[sizes + i]
        if sets_places:
            numbers[ints[result + REACH] + i] += numbers[sizes + i]
            numbers[ints[result + SWING] + i] += numbers[slopes + i]
    return 0
