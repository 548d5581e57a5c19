"""Signals on a flow: the coefficients of its exponentials in s = row . (xi, xi', 1), and the sizes of their terms."""

from __future__ import annotations

from multiphi_exudyn.events.arrays import (
    CHANNELS,
    FLOW_BASIS,
    FLOW_COUNT,
    FLOW_FORCED,
    FLOW_FREE,
    FLOW_STATE,
    FLOW_TERMS,
    FLOW_WAVES,
    FORCE,
    FREE_SIZES,
    LEVEL,
    MAPPED,
    MAPPED_SPEED,
    MODES,
    PLACE,
    PRESCRIBED,
    RATED,
    RESPONSE,
    ROW,
    SPEED,
    WAVE,
    WORK_WAVES,
)
from multiphi_exudyn.events.states.flow import unit_of_flow
from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, Waves, compiled
from multiphi_exudyn.mathematics.response.basis_arrays import (
    POWERS,
    RATES,
    SCALES,
    differentiate,
    magnitude,
)
from multiphi_exudyn.mathematics.response.response_arrays import (
    FREE,
    FROM_DISPLACEMENT,
    FROM_VELOCITY,
    REACHED,
    SHAPES,
)

__all__ = ["signal_sizes", "signal_waves"]


@compiled
def signal_waves(ints: Ints, numbers: Numbers, waves: Waves, state: int, signal: int, result: int) -> None:
    """Compute the coefficients (p,) of a signal on the flow from a state, without its constant."""
    n, row, c = ints[ints[state + LEVEL] + MODES] + ints[CHANNELS], ints[signal + ROW], ints[FLOW_WAVES]
    moving = n - ints[CHANNELS] + ints[PRESCRIBED]
    free, count, rate = ints[FLOW_FREE], ints[FLOW_COUNT], ints[WORK_WAVES] + ints[FLOW_COUNT]
    rated = ints[signal + RATED] == 1
    for j in range(free):
        waves[result + j] = waves[ints[signal + WAVE] + j] * waves[c + j]
        waves[rate + j] = waves[ints[signal + WAVE] + free + j] * waves[c + j] if rated else 0j
    for j in range(free, count):
        forced = ints[FLOW_FORCED] + (j - free) * moving
        value = 0j
        slope = 0j
        for i in range(moving):
            value += numbers[row + i] * waves[forced + i]
            slope += numbers[row + n + i] * waves[forced + i]
        waves[result + j] = value
        waves[rate + j] = slope
    if rated:
        differentiate(ints, numbers, waves, ints[FLOW_BASIS], rate, rate)
        for j in range(count):
            waves[result + j] += waves[rate + j]


@compiled
def signal_sizes(ints: Ints, numbers: Numbers, waves: Waves, state: int, signal: int, result: int) -> None:
    """Compute the sizes (p,) of the terms of a signal's coefficients.

    |row| |V| |c| + |row'| |V| |c| |lambda|, and of a power d > 0 its derivative d / T at the one before.
    """
    n, row, basis = ints[ints[state + LEVEL] + MODES] + ints[CHANNELS], ints[signal + ROW], ints[FLOW_BASIS]
    r, response = n - ints[CHANNELS], ints[ints[state + LEVEL] + RESPONSE]
    moving = r + ints[PRESCRIBED]
    free, count, unit = ints[FLOW_FREE], ints[FLOW_COUNT], numbers[ints[ints[FLOW_BASIS] + SCALES]]
    rated = ints[signal + RATED] == 1
    size_terms(ints, numbers, waves, state)
    for j in range(count):
        first, end, shape = 0, moving, ints[FLOW_FORCED] + (j - free) * moving
        if j < free:
            first, end = ints[ints[response + REACHED] + 2 * j], ints[ints[response + REACHED] + 2 * j + 1]
            shape = ints[response + SHAPES] + j * r
        value = 0.0
        slope = 0.0
        for i in range(first, end):
            value += abs(numbers[row + i]) * magnitude(waves, shape + i)
            slope += abs(numbers[row + n + i]) * magnitude(waves, shape + i) if rated else 0.0
        terms = numbers[ints[FLOW_TERMS] + j]
        numbers[result + j] = value * terms
        if rated:
            numbers[result + j] += slope * terms * abs(waves[ints[basis + RATES] + j])
            if ints[ints[basis + POWERS] + j] > 0:
                numbers[result + j - 1] += ints[ints[basis + POWERS] + j] / unit * slope * terms


@compiled
def size_terms(ints: Ints, numbers: Numbers, waves: Waves, state: int) -> None:
    """Compute the sizes (p,) of the terms of the coefficients of the flow from a state.

    The map that has made the state counts: a stiff mode that hardly moves has the round-off of the modes from which it
    was mapped, and accelerates with it.
    """
    for j in range(ints[FLOW_COUNT]):
        numbers[ints[FLOW_TERMS] + j] = abs(waves[ints[FLOW_WAVES] + j])
    if ints[PRESCRIBED] > 0:
        size_driven_terms(ints, numbers, state)
    response, r = ints[ints[state + LEVEL] + RESPONSE], ints[ints[state + LEVEL] + MODES]
    for j in range(ints[FLOW_FREE]):
        reached, size = ints[response + REACHED] + 2 * j, 0.0
        for i in range(ints[reached], ints[reached + 1]):
            k = j * r + i
            size += magnitude(waves, ints[response + FROM_DISPLACEMENT] + k) * numbers[ints[state + MAPPED] + i]
            size += magnitude(waves, ints[response + FROM_VELOCITY] + k) * numbers[ints[state + MAPPED_SPEED] + i]
        numbers[ints[FLOW_TERMS] + j] += size * unit_of_flow(ints, numbers, ints[response + FREE], j)


@compiled
def size_driven_terms(ints: Ints, numbers: Numbers, state: int) -> None:
    """Compute the same of the free response beside channels, where the forced response may exceed the motion."""
    level, own, x, v = ints[state + LEVEL], ints[FLOW_STATE], ints[state + PLACE], ints[state + SPEED]
    response, force, p, r = ints[level + RESPONSE], ints[level + FORCE], ints[FLOW_FREE], ints[level + MODES]
    for j in range(p):
        size, row = 0.0, ints[level + FREE_SIZES] + j * r
        for i in range(ints[ints[response + REACHED] + 2 * j], ints[ints[response + REACHED] + 2 * j + 1]):
            place, speed = numbers[own + i], numbers[own + r + i]
            size += numbers[row + i] * (abs(place) + abs(numbers[x + i] - place))
            size += numbers[row + p * r + i] * (abs(speed) + abs(numbers[v + i] - speed))
            if force >= 0:
                size += numbers[row + 2 * p * r + i] * abs(numbers[force + i])
        numbers[ints[FLOW_TERMS] + j] = size * unit_of_flow(ints, numbers, ints[response + FREE], j)
