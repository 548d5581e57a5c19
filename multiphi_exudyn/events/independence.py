"""Redundant contacts: of those that would close an independent set does, by sentence 2 of the law (decision.py)."""

from __future__ import annotations

import math

from multiphi_exudyn.events.arrays import (
    COORDINATES,
    DIRECTIONS,
    ELEMENTS,
    HELD,
    INDEPENDENCE,
    JOIN_NUMBERS,
    JOINED,
    LEVEL,
    LIMITS,
    STATES,
    STICK,
    UNION,
    WORKED,
)
from multiphi_exudyn.events.changes import NOBODY, is_held
from multiphi_exudyn.events.phases import is_refused
from multiphi_exudyn.mathematics.compiled import Ints, Numbers, compiled
from multiphi_exudyn.mathematics.free_rows import norm

__all__ = ["independent", "join", "thin_out"]


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
def thin_out(ints: Ints, numbers: Numbers, wishes: int) -> None:
    """12. Of friction elements that wish to stick each stays that does not follow from those that are held already."""
    union, states = ints[UNION], ints[ints[WORKED + LEVEL] + STATES]
    for i in range(ints[ELEMENTS]):
        held = numbers[ints[LIMITS] + i] > 0.0 and ints[states + i] == STICK and ints[wishes + i] == NOBODY
        ints[union + i] = 1 if held or is_held(ints, WORKED, i) == 1 else 0
    for i in range(ints[ELEMENTS]):
        if numbers[ints[LIMITS] + i] > 0.0 and ints[wishes + i] == STICK:
            ints[union + i] = 1
            if independent(ints, numbers, union) == 0:
                ints[union + i] = 0
                ints[wishes + i] = NOBODY


@compiled
def independent(ints: Ints, numbers: Numbers, flags: int) -> int:
    """1 where of the contacts with a flag (c,) none follows from the others, so that they can be closed together."""
    m, found, smallest = ints[COORDINATES], 0, math.inf
    q = ints[JOIN_NUMBERS]
    for k in range(ints[ELEMENTS]):
        if ints[flags + k] == 0:
            continue
        if found == m:
            return 0
        own = q + found * m
        for i in range(m):
            numbers[own + i] = numbers[ints[DIRECTIONS] + k * m + i]
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
