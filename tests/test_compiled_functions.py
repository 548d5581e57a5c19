"""Functions on flat buffers: compiled, they are what they are in Python."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest

from multiphi_exudyn.mathematics.compiled import Ints, Numbers, Waves, compiled, entry

HALF = 0.5


@compiled
def square(numbers: Numbers, k: int) -> float:
    return numbers[k] * numbers[k]


@compiled
def turn(numbers: Numbers, waves: Waves, n: int) -> None:
    for k in range(n):
        waves[k] = cmath.exp(complex(0.0, numbers[k])) * waves[k]


@compiled
def total(ints: Ints, numbers: Numbers, waves: Waves, n: int, start: float) -> float:
    found = start
    turn(numbers, waves, n)
    for k in range(n):
        found += HALF * square(numbers, ints[k]) + waves[k].imag + math.sqrt(abs(waves[k]))
    ints[0] = n // 2
    return found


@compiled
def falling(ints: Ints, n: int) -> int:
    while n > 0 and ints[n - 1] > ints[n]:
        n -= 1
    return n


def buffers() -> tuple[np.ndarray, ...]:
    return np.array([3, 0, 2, 1]), np.linspace(0.1, 2.0, 4), np.arange(4) * (1.0 - 0.5j)


def test_a_compiled_function_and_what_it_calls_are_what_they_are_in_python():
    plain, fast = buffers(), buffers()
    assert entry(total)(*fast, 4, 1.5) == pytest.approx(total(*plain, 4, 1.5), rel=1e-15)
    for of_plain, of_fast in zip(plain, fast, strict=True):
        np.testing.assert_allclose(of_fast, of_plain, rtol=1e-15)


def test_a_compiled_function_returns_an_integer():
    ints = np.array([0, 9, 7, 5])
    assert entry(falling)(ints, 3) == falling(ints, 3) == 1
