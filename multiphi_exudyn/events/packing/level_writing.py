"""Record of a level, written into the buffers (arrays.py) from arrays that describe the level.

sizes    ints of ``SIZES``, then the states of all elements (c,), the k links that hold, and of the response the powers
         d (p,), 1 for modes that are alone (r,) and 1 for exponentials that are poles (p,)
given    numbers of ``SCALARS``, then omega^2, delta and the force on zero-frequency modes (r,), S - diag(omega^2)
         (r, r), the forces of w (r, q), D (r, r), the forces of w' (r, q), of the potential energy the linear part (n,)
         and rows (q, n), stretches that follow (s, n + 1), and what signals are made of (exits.py)

The exits of all states are described by ``exits`` (e, 4) (exit_table.py), with ``links`` and ``shares`` (exits.py). The
rates, A, B, P and V^T of the response are in the waves already.
"""

from __future__ import annotations

import math

from multiphi_exudyn.events.arrays import (
    ASKED,
    CARRIED,
    ELEMENT,
    ELEMENTS,
    EXIT_COUNT,
    EXIT_INTS,
    EXITS,
    FIRMNESS,
    FIRST_EXITS,
    FOLLOW_COUNT,
    FOLLOWS,
    FORCE,
    FREE_SIZES,
    FREQUENCIES,
    GAPS,
    HIGHEST_FREQUENCY,
    JUDGED,
    LEVEL_INTS,
    MOBILITY,
    MODES,
    MOTION,
    NUMBER,
    PERIODS,
    POTENTIAL,
    PRESCRIBED,
    RATED,
    RESPONSE,
    ROW,
    SIGNAL,
    SPEEDS,
    STATES,
    STRUCK_DEFECTS,
    WAVE,
)
from multiphi_exudyn.events.transitions.exits import write_signal
from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, Waves, compiled, entry
from multiphi_exudyn.mathematics.response.basis_arrays import SIZE, magnitude
from multiphi_exudyn.mathematics.response.response_arrays import (
    FREE,
    FROM_DISPLACEMENT,
    REACHED,
    SHAPES,
    response_ints,
    write_response,
)
from multiphi_exudyn.mathematics.response.response_arrays import MODES as MODES_OF_RESPONSE

__all__ = ["project_signal", "record_sizes", "write_record"]

SIZES = 10
LEVEL_NUMBER, MODE_COUNT, CHANNEL_COUNT, TERMS, LINKS, HELD_LINKS, ALL_EXITS, KEPT_EXITS, FOLLOWING, CHAINS = range(
    SIZES
)
SCALARS = 3
CONSTANT, HIGHEST_OF_LOADS, UNIT = range(SCALARS)
DESCRIPTION = 4  # ints of an exit: its element and state, the state requested, its firmness
OF_STATE, REQUESTED, FIRM = 1, 2, 3
SCALES_WIDTH = 3  # numbers of a basis: T and two more


def record_sizes(c: int, r: int, q: int, p: int, links: int, exits: int, following: int) -> tuple[int, int]:
    """Return how many ints and numbers a record takes; the numbers without FREE_SIZES."""
    n = r + q
    energies = links * (n + 1) + 1 + n + r + q * n + following * (n + 1)
    ints = LEVEL_INTS + 2 * c + 1 + EXIT_INTS * exits + response_ints(r, p)
    return ints, 1 + SCALES_WIDTH + 5 * r + r * (2 * n + 1) + energies + exits * (2 * n + 1)


@compiled
def write_level(
    ints: Ints,
    numbers: Numbers,
    waves: Waves,
    sizes: Ints,
    given: Numbers,
    exits: Ints,
    links: Ints,
    shares: Numbers,
    record: int,
    at: int,
    rates: int,
    signals: int,
    rated: int,
) -> None:
    """Write a record at ``record``, its numbers from ``at`` on, and the exponentials of its signals.

    rates, signals: where the waves of the response begin, and those of the signals; rated: 1 if these may depend on
    xi'.
    """
    c, r, q, p = ints[ELEMENTS], sizes[MODE_COUNT], sizes[CHANNEL_COUNT], sizes[TERMS]
    n, held, squares = r + q, SIZES + c, at + 1 + SCALES_WIDTH
    for slot in range(LEVEL_INTS):
        ints[record + slot] = 0
    ints[record + NUMBER], ints[record + MODES], ints[record + STATES] = sizes[LEVEL_NUMBER], r, record + LEVEL_INTS
    ints[record + CARRIED], ints[record + MOBILITY] = -1, -1
    ints[record + STRUCK_DEFECTS] = 0 if ints[JUDGED] else -1
    for i in range(c):
        ints[record + LEVEL_INTS + i] = sizes[SIZES + i]
    write_modes(ints, numbers, given, record, at, r)
    write_motion(ints, numbers, given, record, squares + 5 * r, r, q)
    parts = SCALARS + 3 * r + 2 * r * n + (1 + q) * n + sizes[FOLLOWING] * (n + 1)
    end = write_energies(ints, numbers, given, sizes, parts, record, squares + 5 * r + r * (2 * n + 1), n)
    response = record + LEVEL_INTS + 2 * c + 1 + EXIT_INTS * sizes[KEPT_EXITS]
    ints[record + RESPONSE], described = response, held + sizes[HELD_LINKS]
    write_response(
        ints, numbers, waves, response, squares, squares + r, at + 1, rates, sizes, described, sizes[CHAINS], r, p
    )
    ints[record + FREE_SIZES] = -1
    if ints[PRESCRIBED]:
        ints[record + FREE_SIZES] = end
        for k in range(3 * p * r):
            numbers[end + k] = magnitude(waves, ints[response + FROM_DISPLACEMENT] + k)
        end += 3 * p * r
    write_exits(ints, numbers, waves, sizes, given, exits, links, shares, parts, record, end, signals, rated, n)


@compiled
def write_modes(ints: Ints, numbers: Numbers, given: Numbers, record: int, at: int, r: int) -> None:
    """Write the highest frequency, T, omega^2, delta, the force on zero-frequency modes, omega and its inverses."""
    squares = at + 1 + SCALES_WIDTH
    numbers[at], numbers[at + 1] = given[HIGHEST_OF_LOADS], given[UNIT]
    ints[record + HIGHEST_FREQUENCY], ints[record + FORCE] = at, -1
    ints[record + FREQUENCIES], ints[record + PERIODS] = squares + 3 * r, squares + 4 * r
    for i in range(3 * r):
        numbers[squares + i] = given[SCALARS + i]
    for i in range(r):
        omega = math.sqrt(abs(numbers[squares + i]))
        numbers[squares + 3 * r + i] = omega
        if numbers[squares + i] > 0.0:
            numbers[at] = max(numbers[at], omega / (2.0 * math.pi))
        numbers[squares + 4 * r + i] = 1.0 / omega if omega > 0.0 else 0.0
        if numbers[squares + 2 * r + i] != 0.0:
            ints[record + FORCE] = squares + 2 * r


@compiled
def write_motion(ints: Ints, numbers: Numbers, given: Numbers, record: int, motion: int, r: int, q: int) -> None:
    """Write eta'' = motion . (xi, xi', 1), a row (2 n + 1,) for every mode."""
    n, squares, coupling = r + q, SCALARS, SCALARS + 3 * r
    force, damping = coupling + r * r, coupling + r * n
    ints[record + MOTION] = motion
    for i in range(r):
        row = motion + i * (2 * n + 1)
        for j in range(r):
            numbers[row + j] = -given[coupling + i * r + j]
            numbers[row + n + j] = -given[damping + i * r + j]
        for j in range(q):
            numbers[row + r + j] = given[force + i * q + j]
            if j >= ints[PRESCRIBED] and given[force + i * q + j] != 0.0:  # a held place drives a mode
                ints[record + FORCE] = motion - 3 * r  # where write_modes has put the force
            numbers[row + n + r + j] = given[damping + r * r + i * q + j]
        numbers[row + i] -= given[squares + i]
        numbers[row + 2 * n] = given[squares + 2 * r + i]


@compiled
def write_energies(
    ints: Ints, numbers: Numbers, given: Numbers, sizes: Ints, parts: int, record: int, gaps: int, n: int
) -> int:
    """Write the gaps, rows (n + 1,), the potential energy and the stretches that follow; return where they end."""
    r, q, links, following = sizes[MODE_COUNT], sizes[CHANNEL_COUNT], sizes[LINKS], sizes[FOLLOWING] * (n + 1)
    ints[record + GAPS], ints[record + SPEEDS] = gaps, gaps
    for k in range(links):
        for i in range(n):
            numbers[gaps + k * (n + 1) + i] = given[parts + k * n + i]
        numbers[gaps + k * (n + 1) + n] = given[parts + links * n + k]
    potential, linear = gaps + links * (n + 1), parts - following - (1 + q) * n
    ints[record + POTENTIAL], numbers[potential] = potential, given[CONSTANT]
    for i in range(n):
        numbers[potential + 1 + i] = given[linear + i]
    for i in range(r):
        numbers[potential + 1 + n + i] = given[SCALARS + i]
    rest = potential + 1 + n + r
    for i in range(q * n + following):
        numbers[rest + i] = given[linear + n + i]
    ints[record + FOLLOWS], ints[record + FOLLOW_COUNT] = rest + q * n, sizes[FOLLOWING]
    return rest + q * n + following


@compiled
def write_exits(
    ints: Ints,
    numbers: Numbers,
    waves: Waves,
    sizes: Ints,
    given: Numbers,
    exits: Ints,
    links: Ints,
    shares: Numbers,
    parts: int,
    record: int,
    signals: int,
    signal_waves: int,
    rated: int,
    n: int,
) -> None:
    """Write the exits of the elements' states, and where the first one of every element is."""
    c, count, k = ints[ELEMENTS], sizes[ALL_EXITS], 0
    firsts, response = record + LEVEL_INTS + c, ints[record + RESPONSE]
    table, held, width = firsts + c + 1, SIZES + c, (1 + rated) * sizes[TERMS]
    ints[record + FIRST_EXITS], ints[record + EXITS], ints[record + EXIT_COUNT] = firsts, table, sizes[KEPT_EXITS]
    for exit_ in range(count):
        element = exits[exit_ * DESCRIPTION + ELEMENT]
        if exits[exit_ * DESCRIPTION + OF_STATE] == sizes[SIZES + element]:
            signal, row, wave = table + k * EXIT_INTS, signals + k * (2 * n + 1), signal_waves + k * width
            for slot in range(EXIT_INTS):
                ints[signal + slot] = -1
            ints[signal + ELEMENT], ints[signal + ASKED] = element, exits[exit_ * DESCRIPTION + REQUESTED]
            ints[signal + FIRMNESS] = exits[exit_ * DESCRIPTION + FIRM]
            write_signal(
                numbers, row, given, parts, sizes, held, links, shares, sizes[LINKS], n, sizes[HELD_LINKS], count, exit_
            )
            ints[signal + SIGNAL + ROW], ints[signal + SIGNAL + WAVE] = row, wave
            ints[signal + SIGNAL + RATED] = project(ints, numbers, waves, response, row, wave, n)
            k += 1
            ints[firsts + element + 1] = k
    for i in range(c):
        ints[firsts + i + 1] = max(ints[firsts + i], ints[firsts + i + 1])


@compiled
def project(ints: Ints, numbers: Numbers, waves: Waves, response: int, row: int, wave: int, n: int) -> int:
    """Set row times V (p,) of a signal, and of its part in xi' if it has one, (2, p); return 1 if it has."""
    r, p, rated = ints[response + MODES_OF_RESPONSE], ints[ints[response + FREE] + SIZE], 0
    for i in range(n):
        if numbers[row + n + i] != 0.0:
            rated = 1
    for j in range(p):
        first, end = ints[ints[response + REACHED] + 2 * j], ints[ints[response + REACHED] + 2 * j + 1]
        shape = ints[response + SHAPES] + j * r
        for part in range(1 + rated):
            value = 0j
            for i in range(first, end):
                value += numbers[row + part * n + i] * waves[shape + i]
            waves[wave + part * p + j] = value
    return rated


write_record, project_signal = entry(write_level), entry(project)
