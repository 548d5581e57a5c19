"""Exponentials in flat buffers: the basis of exponentials.py, for the loop.

    phi_j(t) = (t / T)^d_j exp(lambda_j t)

A basis is a record in the ints:

    ints[basis + SIZE]     p, the number of exponentials
    ints[basis + POWERS]   where d (p,) begins in the ints; j with d_j > 0 follows d_j - 1 at the same rate
    ints[basis + RATES]    where lambda (p,) begins in the waves, 1/s
    ints[basis + SCALES]   where T [s], the largest |lambda| and the largest Re lambda above zero stand in the numbers
    ints[basis + PURE]     1 where every power is zero
    ints[basis + ETERNAL]  1 where also nothing grows

Numbers that overflow become infinite, and results that depend on them are not finite; nothing raises.
"""

from __future__ import annotations

import math

from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, Waves, compiled

__all__ = [
    "BASIS",
    "ETERNAL",
    "POWERS",
    "PURE",
    "RATES",
    "SCALES",
    "SIZE",
    "describe_basis",
    "differentiate",
    "exponential_size",
    "exponentials",
    "magnitude",
    "modulus",
]

SIZE, POWERS, RATES, SCALES, PURE, ETERNAL = 0, 1, 2, 3, 4, 5
BASIS = 6  # ints of the record
SMALL, LARGE = 1e-280, 1e280  # squares between them are neither denormal nor infinite
LARGEST_EXPONENT = 709.0  # exp of a larger number overflows


@compiled
def exponential_size(exponent: float) -> float:
    """Return exp, infinite on overflow."""
    return math.exp(exponent) if exponent < LARGEST_EXPONENT else math.inf


@compiled
def modulus(real: float, imag: float) -> float:
    """Return |z|, without overflow or underflow of its square."""
    square = real * real + imag * imag
    return math.sqrt(square) if SMALL < square < LARGE else math.hypot(real, imag)


@compiled
def magnitude(waves: Waves, at: int) -> float:
    """Return |z| of a wave."""
    return modulus(waves[at].real, waves[at].imag)


@compiled
def describe_basis(ints: Ints, numbers: Numbers, waves: Waves, basis: int) -> None:
    """Set what follows from p, d, lambda and T: the largest rates, PURE and ETERNAL."""
    powers, rates, scales = ints[basis + POWERS], ints[basis + RATES], ints[basis + SCALES]
    pure = 1
    fastest = 0.0
    growth = 0.0
    for j in range(ints[basis + SIZE]):
        fastest = max(fastest, magnitude(waves, rates + j))
        growth = max(growth, waves[rates + j].real)
        if ints[powers + j] > 0:
            pure = 0
    numbers[scales + 1] = fastest
    numbers[scales + 2] = growth
    ints[basis + PURE] = pure
    ints[basis + ETERNAL] = pure if growth == 0.0 else 0


@compiled
def exponentials(ints: Ints, numbers: Numbers, waves: Waves, basis: int, u: float, t: float, result: int) -> None:
    """Set (t / T)^d_j exp(lambda_j u), (p,): phi at t where u = t, else phi up to the factors exp(lambda_j (t - u))."""
    powers, rates = ints[basis + POWERS], ints[basis + RATES]
    ratio = t / numbers[ints[basis + SCALES]]
    for j in range(ints[basis + SIZE]):
        if ints[powers + j] > 0:
            waves[result + j] = waves[result + j - 1] * ratio
        elif u == 0.0:
            waves[result + j] = 1 + 0j
        else:
            rate = waves[rates + j]
            size, angle = exponential_size(rate.real * u), rate.imag * u
            waves[result + j] = complex(size * math.cos(angle), size * math.sin(angle))


@compiled
def differentiate(ints: Ints, numbers: Numbers, waves: Waves, basis: int, c: int, result: int) -> None:
    """Set coefficients (p,) of the time derivative of Re sum_j a_j phi_j; ``result`` may be ``c``."""
    powers, rates, unit = ints[basis + POWERS], ints[basis + RATES], numbers[ints[basis + SCALES]]
    for j in range(ints[basis + SIZE]):
        a = waves[c + j]
        waves[result + j] = a * waves[rates + j]
        if ints[powers + j] > 0:
            waves[result + j - 1] += ints[powers + j] / unit * a
