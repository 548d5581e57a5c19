"""Exponentials in flat buffers: what exponentials.py says of a basis, for the loop.

    phi_j(t) = (t / T)^d_j exp(lambda_j t)

A basis is a record in the ints:

    ints[basis + SIZE]     p, the number of exponentials
    ints[basis + POWERS]   where d (p,) begins in the ints; j with d_j > 0 follows d_j - 1 at the same rate
    ints[basis + RATES]    where lambda (p,) begins in the waves, 1/s
    ints[basis + SCALES]   where T [s], the largest |lambda| and the largest Re lambda above zero stand in the numbers
    ints[basis + PURE]     1 where every power is zero
    ints[basis + ETERNAL]  1 where moreover nothing grows

Numbers that overflow are infinite, and what is made of them is not finite; nothing raises.
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
SMALL, LARGE = 1e-280, 1e280  # squares between them have lost no digit
LARGEST_EXPONENT = 709.0  # exp of more is no finite number


@compiled
def exponential_size(exponent: float) -> float:
    """exp, infinite where that is too large for a number."""
    return math.exp(exponent) if exponent < LARGEST_EXPONENT else math.inf


@compiled
def modulus(real: float, imag: float) -> float:
    """|z|; the square root of its square where that is a number far from zero and infinity."""
    square = real * real + imag * imag
    return math.sqrt(square) if SMALL < square < LARGE else math.hypot(real, imag)


@compiled
def magnitude(waves: Waves, at: int) -> float:
    """|z| of a wave."""
    return modulus(waves[at].real, waves[at].imag)


@compiled
def describe_basis(ints: Ints, numbers: Numbers, waves: Waves, basis: int) -> None:
    """Fill in what follows from p, d, lambda and T: the largest rates, and whether it is pure and eternal."""
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
    """(t / T)^d_j exp(lambda_j u), (p,): phi at t where u = t, else phi up to the factors exp(lambda_j (t - u))."""
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
def differentiate(ints: Ints, numbers: Numbers, waves: Waves, basis: int, given: int, result: int) -> None:
    """Coefficients (p,) of the time derivative of Re sum_j a_j phi_j; ``result`` may be ``given``."""
    powers, rates, unit = ints[basis + POWERS], ints[basis + RATES], numbers[ints[basis + SCALES]]
    for j in range(ints[basis + SIZE]):
        a = waves[given + j]
        waves[result + j] = a * waves[rates + j]
        if ints[powers + j] > 0:
            waves[result + j - 1] += ints[powers + j] / unit * a
