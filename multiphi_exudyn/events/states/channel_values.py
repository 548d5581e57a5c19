"""Values of the channels: the terms of their present pieces, and w, w', w'' with the sizes of their terms, all (q,).

w(t) = Re sum_j exp(mu_j s) sum_d a_jd s^d,   s = t - t_i                         (arrays.py, piece)
"""

from __future__ import annotations

import math

from multiphi_exudyn.events.arrays import (
    DRIVE,
    DRIVE_NEXT,
    DRIVE_WAVES,
    HORIZON,
    PIECE,
    PIECE_NOW,
    PIECE_TERMS,
    PIECE_TIMES,
    PIECES,
    PRESCRIBED,
    TERM_INTS,
    TERMS_NOW,
)
from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, Waves, compiled
from multiphi_exudyn.mathematics.response.basis_arrays import exponential_size, magnitude, modulus
from multiphi_exudyn.mathematics.search.signal_bounds import power_of_two_above

__all__ = ["keep_drive", "load_piece", "piece_end", "set_drive"]


@compiled
def load_piece(ints: Ints, waves: Waves) -> None:
    """Make the terms of the present piece, as they are at its start, the present terms."""
    piece, target, q = ints[ints[PIECES] + ints[PIECE]], ints[DRIVE_WAVES], ints[PRESCRIBED]
    ints[PIECE_NOW] = piece
    for term in range(ints[piece + PIECE_TERMS]):
        count, source = ints[piece + TERM_INTS + 2 * term], ints[piece + TERM_INTS + 2 * term + 1]
        for k in range(count * q):
            waves[target + k] = waves[source + 1 + k]
        target += count * q


@compiled
def set_drive(ints: Ints, numbers: Numbers, waves: Waves, result: int, delay: float, time: float, until: float) -> None:
    """Set the terms at a delay after those in DRIVE_WAVES, from ``time`` to ``until`` [s], by synthetic division.

    With them w, w', w'' (3, q) and the sizes of their terms (3, q) are set. The horizon of motions that begin there is
    the power of two above the remaining time, so that bases are shared among pieces of about the same length.
    """
    q, drive, source, piece = ints[PRESCRIBED], ints[DRIVE], ints[DRIVE_WAVES], ints[PIECE_NOW]
    numbers[HORIZON] = power_of_two_above(until - time if until > time else until)
    ints[TERMS_NOW] = result
    for k in range(6 * q):
        numbers[drive + k] = 0.0
    for term in range(ints[piece + PIECE_TERMS]):
        count, rate = ints[piece + TERM_INTS + 2 * term], waves[ints[piece + TERM_INTS + 2 * term + 1]]
        factor = 1.0 + 0j
        if rate * delay != 0.0:
            size, angle = exponential_size(rate.real * delay), rate.imag * delay
            factor = complex(size * math.cos(angle), size * math.sin(angle))
        for k in range(count * q):
            waves[result + k] = waves[source + k] * factor
        for k in range(q):
            for lowest in range(count - 1):
                for d in range(count - 2, lowest - 1, -1):
                    waves[result + d * q + k] += delay * waves[result + (d + 1) * q + k]
            first = rate * waves[result + k]
            second = rate * first
            if count > 1:
                first += waves[result + q + k]
                second += 2.0 * rate * waves[result + q + k]
            if count > 2:
                second += 2.0 * waves[result + 2 * q + k]
            numbers[drive + k] += waves[result + k].real
            numbers[drive + q + k] += first.real
            numbers[drive + 2 * q + k] += second.real
            numbers[drive + 3 * q + k] += magnitude(waves, result + k)
            numbers[drive + 4 * q + k] += modulus(first.real, first.imag)
            numbers[drive + 5 * q + k] += modulus(second.real, second.imag)
        source += count * q
        result += count * q


@compiled
def keep_drive(ints: Ints, waves: Waves) -> None:
    """Make the terms of the instant the present terms."""
    q, piece, count = ints[PRESCRIBED], ints[PIECE_NOW], 0
    for term in range(ints[piece + PIECE_TERMS]):
        count += ints[piece + TERM_INTS + 2 * term] * q
    for k in range(count):
        waves[ints[DRIVE_WAVES] + k] = waves[ints[DRIVE_NEXT] + k]


@compiled
def piece_end(ints: Ints, numbers: Numbers) -> float:
    """Return the end [s] of the present piece of the channels."""
    return numbers[ints[ints[ints[PIECES] + ints[PIECE]] + PIECE_TIMES] + 1]
