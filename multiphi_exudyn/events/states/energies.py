"""Energies of a state, and the losses in a transition."""

from __future__ import annotations

import math

from multiphi_exudyn.events.arrays import (
    CARRIED,
    CHANNELS,
    DAMPING,
    DROPS,
    ELEMENTS,
    FOLLOW_COUNT,
    FOLLOWS,
    FRICTION,
    HELD_LINKS,
    KINDS,
    KINETIC,
    LEVEL,
    MODES,
    OPEN,
    PATTERNS,
    PLACE,
    POTENTIAL,
    SPEED,
    SPRINGS,
    STATES,
    STICKS,
    STIFFNESSES,
    STRAIN,
    STRAIN_FORM,
    STRAIN_ROWS,
    VISCOUS,
)
from multiphi_exudyn.events.states.signals import gap
from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, compiled

__all__ = ["energy", "kinetic", "lose", "pattern_work", "potential", "strain"]


@compiled
def kinetic(ints: Ints, numbers: Numbers, state: int) -> float:
    """Return the kinetic energy [J]: |Psi eta' + Y w'|^2 / 2."""
    level, v = ints[state + LEVEL], ints[state + SPEED]
    r, q, row = ints[level + MODES], ints[CHANNELS], ints[level + CARRIED]
    total = 0.0
    for i in range(r):
        total += 0.5 * numbers[v + i] * numbers[v + i]
    if row >= 0:
        for k in range(q):
            for i in range(r):
                total += numbers[row + i] * numbers[v + i] * numbers[v + r + k]
            for j in range(q):
                total += 0.5 * numbers[row + r + j] * numbers[v + r + j] * numbers[v + r + k]
            row += r + q
    return total


@compiled
def potential(ints: Ints, numbers: Numbers, state: int) -> float:
    """Return the strain energy less the potential of the loads [J]."""
    level, x = ints[state + LEVEL], ints[state + PLACE]
    r, q, form = ints[level + MODES], ints[CHANNELS], ints[level + POTENTIAL]
    n = r + q
    total = numbers[form]
    for i in range(n):
        total += numbers[form + 1 + i] * numbers[x + i]
    for i in range(r):
        total += 0.5 * numbers[form + 1 + n + i] * numbers[x + i] * numbers[x + i]
    row = form + 1 + n + r
    for k in range(q):
        for i in range(r):
            total += numbers[row + i] * numbers[x + i] * numbers[x + r + k]
        for j in range(q):
            total += 0.5 * numbers[row + r + j] * numbers[x + r + j] * numbers[x + r + k]
        row += n
    row = ints[level + FOLLOWS]
    for _ in range(ints[level + FOLLOW_COUNT]):
        stretch = numbers[row + n]
        for i in range(n):
            stretch += numbers[row + i] * numbers[x + i]
        total += 0.5 * stretch * stretch
        row += n + 1
    return total


@compiled
def pattern_work(ints: Ints, numbers: Numbers, state: int) -> float:
    """Return the potential [J] of the varying loads at their present values: (b w) . y."""
    level, x = ints[state + LEVEL], ints[state + PLACE]
    r, q, row = ints[level + MODES], ints[CHANNELS], ints[level + PATTERNS]
    total = 0.0
    for k in range(q):
        value = numbers[row + r + q]
        for i in range(r + q):
            value += numbers[row + i] * numbers[x + i]
        total += value * numbers[x + r + k]
        row += r + q + 1
    return total


@compiled
def energy(ints: Ints, numbers: Numbers, state: int) -> float:
    """Return the kinetic and strain energy less the potential of static loads [J]."""
    return kinetic(ints, numbers, state) + potential(ints, numbers, state) + pattern_work(ints, numbers, state)


@compiled
def strain(ints: Ints, numbers: Numbers, state: int) -> float:
    """Return the strain energy [J] (StrainForm), no difference of large energies; nan if its form is not packed."""
    level, x = ints[state + LEVEL], ints[state + PLACE]
    form, n, total = ints[level + STRAIN_FORM], ints[level + MODES] + ints[CHANNELS], 0.0
    if form == 0:
        return math.nan
    row = form + 1 + n
    for _ in range(ints[level + STRAIN_ROWS]):
        stretch = numbers[row + 1 + n]
        for i in range(n):
            stretch += numbers[row + 1 + i] * numbers[x + i]
        total += 0.5 * numbers[row] * stretch * stretch
        row += n + 2
    for i in range(n):
        total += numbers[form + 1 + i] * numbers[x + i]
    return total + numbers[form]


@compiled
def lose(ints: Ints, numbers: Numbers, before: int, after: int, collided: float, losses: int) -> None:
    """Add the losses (6,) between two states of one instant, less the energy ``collided`` lost in an impact.

    Viscous contacts that open inside their stop lose the energy of their springs, and those that close there regain it.
    A spring that begins to slip loses the difference of its energies before and after the drop from its static limit.
    """
    relaxed, dropped = 0.0, 0.0
    states, later = ints[ints[before + LEVEL] + STATES], ints[ints[after + LEVEL] + STATES]
    for i in range(ints[ELEMENTS]):
        was_open, is_open = ints[states + i] == OPEN, ints[later + i] == OPEN
        if ints[ints[KINDS] + i] == VISCOUS and was_open != is_open:
            depth = gap(ints, numbers, before, i)
            stored = 0.5 * numbers[ints[STIFFNESSES] + i] * depth * depth
            relaxed += stored if is_open else -stored
        sticks = ints[ints[STICKS] + i]
        if sticks >= 0 and ints[states + i] == sticks and ints[later + i] != sticks:
            stretch = gap(ints, numbers, before, ints[ints[HELD_LINKS] + i])
            dropped += 0.5 * numbers[ints[SPRINGS] + i] * stretch * stretch * numbers[ints[DROPS] + i]
    numbers[losses + KINETIC] += kinetic(ints, numbers, before) - kinetic(ints, numbers, after) - collided
    numbers[losses + STRAIN] += potential(ints, numbers, before) - potential(ints, numbers, after) - relaxed - dropped
    numbers[losses + DAMPING] += relaxed
    numbers[losses + FRICTION] += dropped
