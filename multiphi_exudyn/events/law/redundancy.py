"""Redundant contacts and friction: only an independent set of links holds (sentences 2 and 12 of the law)."""

from __future__ import annotations

import math

from multiphi_exudyn.events.arrays import (
    COORDINATES,
    DIRECTIONS,
    ELEMENTS,
    HELD,
    HELD_LINKS,
    INDEPENDENCE,
    JOIN_NUMBERS,
    JOINED,
    KINDS,
    LEVEL,
    OPEN,
    RIGID,
    ROUGHEST_FIRST,
    SPRINGS,
    STATES,
    STICKS,
    UNION,
    WORKED,
)
from multiphi_exudyn.events.law.changes import NO_REQUEST, state_without_stick
from multiphi_exudyn.events.law.phases import is_refused
from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, compiled
from multiphi_exudyn.mathematics.orthonormal import norm

__all__ = ["are_independent", "drop_redundant_stick", "held_links", "is_redundant_stick", "keep_independent"]


@compiled
def keep_independent(ints: Ints, numbers: Numbers, closing: int) -> int:
    """2. Keep in ``closing`` (c,) contacts that are independent beside HELD, penetrating ones first; return how many.

    Of redundant contacts an independent set carries all forces, of those that close together the roughest ones. Between
    two stops without clearance, an unloaded contact would otherwise keep the loaded one open.
    """
    c, union, joined, count = ints[ELEMENTS], ints[UNION], ints[JOINED], 0
    for i in range(c):
        ints[union + i] = max(ints[ints[HELD] + i], ints[closing + i])
        count += ints[closing + i]
    if are_independent(ints, numbers, union) == 1:
        return count
    for i in range(c):
        ints[union + i] = ints[ints[HELD] + i]
        ints[joined + i] = 0
    count = 0
    for penetrating in range(1, -1, -1):
        for k in range(c):
            i = ints[ints[ROUGHEST_FIRST] + k]
            if ints[closing + i] == 1 and is_refused(ints, WORKED, i) == penetrating:
                before = ints[union + i]
                ints[union + i] = 1
                if are_independent(ints, numbers, union) == 1:
                    ints[joined + i] = 1
                    count += 1
                else:
                    ints[union + i] = before
    for i in range(c):
        ints[closing + i] = ints[joined + i]
    return count


@compiled
def held_links(ints: Ints, numbers: Numbers, element: int, state: int) -> int:
    """Return the links of an element that a state holds without a spring: 1 the first, 2 that of friction, 3 both.

    The first link holds in a closed rigid contact.
    """
    first = 1 if ints[ints[KINDS] + element] == RIGID and state != OPEN else 0
    has_friction = numbers[ints[SPRINGS] + element] == 0.0 and ints[ints[STICKS] + element] >= 0
    return first + 2 if has_friction and state == ints[ints[STICKS] + element] else first


@compiled
def is_redundant_stick(ints: Ints, numbers: Numbers, key: int, element: int) -> int:
    """12. Return 1 if friction sticks in the level with a key, and the other links held prevent its slip anyway."""
    if held_links(ints, numbers, element, ints[key + element]) < 2:
        return 0
    for i in range(ints[ELEMENTS]):
        ints[ints[UNION] + i] = held_links(ints, numbers, i, ints[key + i])
    return 1 - are_independent(ints, numbers, ints[UNION])


@compiled
def drop_redundant_stick(ints: Ints, numbers: Numbers, targets: int) -> None:
    """12. Remove requests to stick of friction elements whose slip the links that hold already prevent."""
    union, states = ints[UNION], ints[ints[WORKED + LEVEL] + STATES]
    for i in range(ints[ELEMENTS]):
        held = held_links(ints, numbers, i, ints[states + i])
        ints[union + i] = held if ints[targets + i] == NO_REQUEST else held % 2
    for i in range(ints[ELEMENTS]):
        held, before = held_links(ints, numbers, i, ints[targets + i]), ints[union + i]
        if ints[targets + i] != NO_REQUEST and held >= 2:
            ints[union + i] = held
            if are_independent(ints, numbers, union) == 0:
                ints[union + i] = before
                slips = ints[states + i] > ints[ints[STICKS] + i]
                ints[targets + i] = NO_REQUEST if slips else state_without_stick(ints, i, ints[states + i])


@compiled
def are_independent(ints: Ints, numbers: Numbers, flags: int) -> int:
    """Return 1 if no direction of the flagged links depends on the others, so that all can be held together.

    Flags (c,) of elements: 1 for the first link, 2 for the link of friction, 3 for both.
    """
    m, rank, smallest = ints[COORDINATES], 0, math.inf
    q = ints[JOIN_NUMBERS]
    for k in range(2 * ints[ELEMENTS]):
        i, link = k // 2, k // 2 if k % 2 == 0 else ints[ints[HELD_LINKS] + k // 2]
        if ints[flags + i] % 2 != 1 if k % 2 == 0 else ints[flags + i] < 2:
            continue
        if rank == m:
            return 0
        direction = q + rank * m
        for j in range(m):
            numbers[direction + j] = numbers[ints[DIRECTIONS] + link * m + j]
        for _ in range(2):
            for b in range(rank):
                product = 0.0
                for i in range(m):
                    product += numbers[q + b * m + i] * numbers[direction + i]
                for i in range(m):
                    numbers[direction + i] -= product * numbers[q + b * m + i]
        length = norm(numbers, direction, m)
        smallest = min(smallest, length)
        for i in range(m):
            numbers[direction + i] /= length if length > 0.0 else 1.0
        rank += 1
    return 1 if smallest > numbers[INDEPENDENCE] else 0
