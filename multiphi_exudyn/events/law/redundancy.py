"""Redundant contacts: of those that would close an independent set does, by sentence 2 of the law (decision.py)."""

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
    SPRINGS,
    STATES,
    STICKS,
    UNION,
    WORKED,
)
from multiphi_exudyn.events.law.changes import NOBODY, without_stick
from multiphi_exudyn.events.law.phases import is_refused
from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, compiled
from multiphi_exudyn.mathematics.complementarity.free_rows import norm

__all__ = ["follows", "held_links", "independent", "join", "thin_out"]


@compiled
def join(ints: Ints, numbers: Numbers, closing: int) -> int:
    """2. Leave in ``closing`` (c,) those that can close beside HELD and each other, penetrating ones first; how many.

    Of redundant contacts a set that is independent carries all. Between two stops without clearance the one on which
    nothing presses would keep the other out.
    """
    c, union, joined, left = ints[ELEMENTS], ints[UNION], ints[JOINED], 0
    for i in range(c):
        ints[union + i] = max(ints[ints[HELD] + i], ints[closing + i])
        left += ints[closing + i]
    if independent(ints, numbers, union) == 1:
        return left
    for i in range(c):
        ints[union + i] = ints[ints[HELD] + i]
        ints[joined + i] = 0
    left = 0
    for penetrating in range(1, -1, -1):
        for i in range(c):
            if ints[closing + i] == 1 and is_refused(ints, WORKED, i) == penetrating:
                taken = ints[union + i]
                ints[union + i] = 1
                if independent(ints, numbers, union) == 1:
                    ints[joined + i] = 1
                    left += 1
                else:
                    ints[union + i] = taken
    for i in range(c):
        ints[closing + i] = ints[joined + i]
    return left


@compiled
def held_links(ints: Ints, numbers: Numbers, element: int, state: int) -> int:
    """Which links a state holds without a spring: 1 an element's first, of a rigid contact, 2 that of friction."""
    first = 1 if ints[ints[KINDS] + element] == RIGID and state != OPEN else 0
    rubs = numbers[ints[SPRINGS] + element] == 0.0 and ints[ints[STICKS] + element] >= 0
    return first + 2 if rubs and state == ints[ints[STICKS] + element] else first


@compiled
def follows(ints: Ints, numbers: Numbers, key: int, element: int) -> int:
    """12. 1 where friction sticks in the level with a key, and cannot move for what else is held there."""
    if held_links(ints, numbers, element, ints[key + element]) < 2:
        return 0
    for i in range(ints[ELEMENTS]):
        ints[ints[UNION] + i] = held_links(ints, numbers, i, ints[key + i])
    return 1 - independent(ints, numbers, ints[UNION])


@compiled
def thin_out(ints: Ints, numbers: Numbers, wishes: int) -> None:
    """12. Of friction elements that wish to stick each stays that does not follow from those that are held already."""
    union, states = ints[UNION], ints[ints[WORKED + LEVEL] + STATES]
    for i in range(ints[ELEMENTS]):
        held = held_links(ints, numbers, i, ints[states + i])
        ints[union + i] = held if ints[wishes + i] == NOBODY else held % 2
    for i in range(ints[ELEMENTS]):
        held, before = held_links(ints, numbers, i, ints[wishes + i]), ints[union + i]
        if ints[wishes + i] != NOBODY and held >= 2:
            ints[union + i] = held
            if independent(ints, numbers, union) == 0:
                ints[union + i] = before
                slips = ints[states + i] > ints[ints[STICKS] + i]
                ints[wishes + i] = NOBODY if slips else without_stick(ints, i, ints[states + i])


@compiled
def independent(ints: Ints, numbers: Numbers, flags: int) -> int:
    """1 where of the links with a flag none follows from the others, so that they can be held together.

    Flags (c,) of elements: 1 for the first link, 2 for the one that friction holds, 3 for both.
    """
    m, found, smallest = ints[COORDINATES], 0, math.inf
    q = ints[JOIN_NUMBERS]
    for k in range(2 * ints[ELEMENTS]):
        i, link = k // 2, k // 2 if k % 2 == 0 else ints[ints[HELD_LINKS] + k // 2]
        if ints[flags + i] % 2 != 1 if k % 2 == 0 else ints[flags + i] < 2:
            continue
        if found == m:
            return 0
        own = q + found * m
        for j in range(m):
            numbers[own + j] = numbers[ints[DIRECTIONS] + link * m + j]
        for _ in range(2):
            for b in range(found):
                product = 0.0
                for i in range(m):
                    product += numbers[q + b * m + i] * numbers[own + i]
                for i in range(m):
                    numbers[own + i] -= product * numbers[q + b * m + i]
        length = norm(numbers, own, m)
        smallest = min(smallest, length)
        for i in range(m):
            numbers[own + i] /= length if length > 0.0 else 1.0
        found += 1
    return 1 if smallest > numbers[INDEPENDENCE] else 0
