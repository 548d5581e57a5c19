"""Segment restart: the flow of a recorded segment in flat arrays once more, from the state at its start.

Its channels continue in their piece; the horizon of its powers of time is the recorded one, or a longer one.
"""

from __future__ import annotations

import math

from multiphi_exudyn.events.arrays import (
    AFTER,
    CHANNELS,
    DRIVE_NEXT,
    FORCED_ROOM,
    FORCED_WANTED,
    HORIZON,
    LEVEL,
    MODES,
    NEED,
    NEED_ROOM,
    NEEDED,
    OK,
    PIECE,
    PIECE_NOW,
    PIECE_TERMS,
    PLACE,
    PRESCRIBED,
    RESPONSE,
    SEGMENT_WIDTH,
    SPEED,
    TERM_INTS,
)
from multiphi_exudyn.events.states.channel_values import load_piece, set_drive
from multiphi_exudyn.events.states.flow import expand
from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, Shorts, Waves, compiled
from multiphi_exudyn.mathematics.response.basis_arrays import RATES, SIZE
from multiphi_exudyn.mathematics.response.forced_response import NEAREST_FAR, PER_DEGREE
from multiphi_exudyn.mathematics.response.response_arrays import FREE

__all__ = ["restart_segment"]


@compiled
def restart_segment(
    ints: Ints,
    numbers: Numbers,
    waves: Waves,
    rows: Shorts,
    coordinates: Numbers,
    offsets: Ints,
    i: int,
    largest_factor: float,
) -> int:
    """Set up the flow of the i-th segment; return OK, or NEED where there is no room for a response.

    largest_factor: how many times its recorded horizon the new one may be, for a response of fewer terms.
    """
    segment, level = i * SEGMENT_WIDTH, offsets[rows[i * SEGMENT_WIDTH]]
    n, start = ints[level + MODES] + ints[CHANNELS], rows[segment + 2]
    for k in range(n):
        numbers[ints[AFTER + PLACE] + k] = coordinates[start + k]
        numbers[ints[AFTER + SPEED] + k] = coordinates[start + n + k]
    ints[AFTER + LEVEL] = level
    ints[PIECE] = rows[segment + 1]
    if ints[PRESCRIBED] > 0:
        load_piece(ints, waves)
        set_drive(ints, numbers, waves, ints[DRIVE_NEXT], coordinates[start + 2 * n + 2], 0.0, 1.0)
        numbers[HORIZON] = coordinates[start + 2 * n]
        numbers[HORIZON] *= horizon_factor(ints, numbers, waves, ints[level + RESPONSE], largest_factor)
    expand(ints, numbers, waves, AFTER)
    if ints[FORCED_WANTED] > ints[FORCED_ROOM]:
        ints[NEEDED] = NEED_ROOM
        return NEED
    return OK


@compiled
def horizon_factor(ints: Ints, numbers: Numbers, waves: Waves, response: int, largest_factor: float) -> float:
    """Power of two by which the horizon is to be longer for all poles to be far from the rates of the present piece.

    The response then has no more powers of time than the piece; the price is as many digits of what the piece adds to
    the motion in its first horizon. The factor is 1 where ``largest_factor`` is too small for that.
    """
    free, piece, nearest, degree, factor = ints[response + FREE], ints[PIECE_NOW], math.inf, 0, 1.0
    if largest_factor <= 1.0:
        return factor
    for term in range(ints[piece + PIECE_TERMS]):
        rate = waves[ints[piece + TERM_INTS + 2 * term + 1]]
        degree = max(degree, ints[piece + TERM_INTS + 2 * term] - 1)
        for j in range(ints[free + SIZE]):
            pole = waves[ints[free + RATES] + j]
            nearest = min(nearest, math.hypot(pole.real - rate.real, abs(pole.imag) - abs(rate.imag)))
    nearest *= numbers[HORIZON] / (NEAREST_FAR + PER_DEGREE * (degree + 1))
    limit = largest_factor ** (1.0 / max(degree, 1))
    while nearest * factor < 1.0 and factor < limit:
        factor *= 2.0
    return factor if nearest * factor >= 1.0 else 1.0
