"""Sums of exponentials, compiled: phi_j(t) = exp(lambda_j t), complex numbers as rows of real and imaginary parts.

    phi(t + h) = phi(t) exp(lambda h),   h = shortest 2^k: tabulated factors

and a series for what is shorter than the tabulated lengths, so that no run of a search evaluates an exponential.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numba
import numpy as np

__all__ = [
    "BOUNDS",
    "SHORTEST",
    "cached",
    "copy",
    "derivatives",
    "exponentials",
    "inlined",
    "jit",
    "multiply",
    "prepare",
    "sample",
    "shift",
]

SHORTEST = 24  # halvings of the reciprocal of a level's largest rate: the shortest interval
SERIES = SHORTEST - 12  # doublings of it: an interval in which exp is its series to the fourth power
THIRD = 1 / 3
BOUNDS = 6  # derivatives that are bounded: g to its fifth

jit = numba.njit(error_model="numpy")
inlined = numba.njit(error_model="numpy", forceinline=True)  # a call would copy the levels' many arrays


def cached(function: Callable[..., Any]) -> Callable[..., Any]:
    """``function`` compiled when it is first called, and kept on disk where there is a place for it."""
    try:
        return numba.njit(function, cache=True, nogil=True, error_model="numpy")
    except RuntimeError:  # neither beside the source nor in the user's cache folder
        return numba.njit(function, nogil=True, error_model="numpy")


@jit
def copy(given: np.ndarray, n: int, result: np.ndarray) -> None:
    """The first n values of a vector."""
    for i in range(n):
        result[i] = given[i]


@jit
def exponentials(rates: np.ndarray, t: float, p: int, phi: np.ndarray) -> None:
    """phi (2, p) at t."""
    for j in range(p):
        size = math.exp(rates[0, j] * t)
        phi[0, j] = size * math.cos(rates[1, j] * t)
        phi[1, j] = size * math.sin(rates[1, j] * t)


@jit
def multiply(a: np.ndarray, b: np.ndarray, p: int, result: np.ndarray) -> None:
    """Products of p complex numbers."""
    for j in range(p):
        re = a[0, j] * b[0, j] - a[1, j] * b[1, j]
        result[1, j] = a[0, j] * b[1, j] + a[1, j] * b[0, j]
        result[0, j] = re


@jit
def shift(
    rates: np.ndarray,
    factors: np.ndarray,
    shortest: float,
    top: int,
    u: float,
    p: int,
    given: np.ndarray,
    phi: np.ndarray,
) -> None:
    """phi (2, p) a time u <= shortest 2^top after the ``given`` ones: tabulated factors, and exp by its series."""
    copy(given[0], p, phi[0])
    copy(given[1], p, phi[1])
    h = math.ldexp(shortest, top)
    for k in range(top, SERIES - 1, -1):
        if u >= h:
            u -= h
            multiply(phi, factors[k], p, phi)
        h *= 0.5
    for j in range(p):
        x, y = rates[0, j] * u, rates[1, j] * u
        re, im = 1 + x * 0.25, y * 0.25
        re, im = 1 + (re * x - im * y) * THIRD, (re * y + im * x) * THIRD
        re, im = 1 + (re * x - im * y) * 0.5, (re * y + im * x) * 0.5
        re, im = 1 + re * x - im * y, re * y + im * x
        phi[0, j], phi[1, j] = phi[0, j] * re - phi[1, j] * im, phi[0, j] * im + phi[1, j] * re


@jit
def derivatives(
    signal: np.ndarray, constant: float, rates: np.ndarray, phi: np.ndarray, p: int
) -> tuple[float, float, float, float]:
    """g, g', g'', g''' where the exponentials are phi."""
    g, g1, g2, g3 = constant, 0.0, 0.0, 0.0
    for j in range(p):
        re = signal[0, j] * phi[0, j] - signal[1, j] * phi[1, j]
        im = signal[0, j] * phi[1, j] + signal[1, j] * phi[0, j]
        g += re
        re, im = re * rates[0, j] - im * rates[1, j], re * rates[1, j] + im * rates[0, j]
        g1 += re
        re, im = re * rates[0, j] - im * rates[1, j], re * rates[1, j] + im * rates[0, j]
        g2 += re
        g3 += re * rates[0, j] - im * rates[1, j]
    return g, g1, g2, g3


@jit
def prepare(
    signal: np.ndarray,
    rates: np.ndarray,
    magnitudes: np.ndarray,
    swell: float,
    p: int,
    slope: np.ndarray,
    bounds: np.ndarray,
) -> None:
    """The coefficients of g', and the bounds sum |a_j| |lambda_j|^k of its derivatives, k up to 5, times ``swell``."""
    for k in range(BOUNDS):
        bounds[k] = 0.0
    for j in range(p):
        re, im = signal[0, j], signal[1, j]
        slope[0, j] = re * rates[0, j] - im * rates[1, j]
        slope[1, j] = re * rates[1, j] + im * rates[0, j]
        size = math.sqrt(re * re + im * im)
        for k in range(BOUNDS):
            bounds[k] += swell * size * magnitudes[j, k]


@jit
def sample(signal: np.ndarray, slope: np.ndarray, constant: float, phi: np.ndarray, p: int, values: np.ndarray) -> None:
    """g and g' where the exponentials are phi."""
    re, im, d_re, d_im = constant, 0.0, 0.0, 0.0
    for j in range(p):
        re += signal[0, j] * phi[0, j]
        im += signal[1, j] * phi[1, j]
        d_re += slope[0, j] * phi[0, j]
        d_im += slope[1, j] * phi[1, j]
    values[0], values[1] = re - im, d_re - d_im
