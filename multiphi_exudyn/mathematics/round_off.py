"""Round-off: which sums of floating-point numbers are zero, and which have a sign.

    |sum a_j| <= ZERO sum |a_j|   is round-off: the sum has no sign

A sum is compared with the sizes of its own terms, so decisions do not depend on units.
"""

from __future__ import annotations

import math

import numpy as np

__all__ = ["BALANCED", "CLEAR", "FOLLOWING", "INDEPENDENT", "MASSLESS", "PRODUCT", "SLOW"]
__all__ += ["ZERO", "all_finite", "drop_round_off", "power_of_two_above", "sign_of"]

ZERO = 1e-13  # of the sum of |terms|: a sum below it is round-off
PRODUCT = 1e-15  # of two unit vectors: an absolute value below it is the round-off of their scalar product
INDEPENDENT = 1e-10  # of its length: a direction with a smaller remainder beside others depends on them
FOLLOWING = 10 * INDEPENDENT  # of its terms: allowed violation of an inequality that depends on others
SLOW = 0.1  # of 1 / |lambda|: a shorter motion is given by a few powers of time, without 1 / lambda
BALANCED = 1e-9  # of the sum of |forces|: a resultant below it is round-off of their directions and of modes
MASSLESS = 1e-9  # of the terms of M z: a smaller remainder is round-off of matrices in files, the motion has no mass
CLEAR = 2 * ZERO  # of a sum's terms: a larger sum is above ZERO for any order of addition


def all_finite(values: np.ndarray) -> bool:
    """Return whether no value (k,) is NaN or infinite."""
    return math.isfinite(values.dot(values)) or bool(np.count_nonzero(np.isfinite(values)) == values.size)


def drop_round_off(sums: np.ndarray, sizes: np.ndarray | np.floating) -> np.ndarray:
    """Return sums with zeros in place of round-off; sizes: the sums of the absolute values of their terms.

    The gap of a contact that another one keeps constant has a rate of round-off, which has no sign.
    """
    result = sums.copy()
    np.putmask(result, np.abs(sums) <= ZERO * sizes, 0.0)
    return result


def sign_of(terms: np.ndarray, constant: float, size: float = 0.0) -> int:
    """Return the sign of a sum, zero where it is round-off of its terms and of ``size``."""
    values = terms.tolist()
    value = sum(values) + constant
    if abs(value) <= ZERO * (sum(map(abs, values)) + abs(constant) + size):
        return 0
    return 1 if value > 0 else -1


def power_of_two_above(value: float) -> float:
    """Return the smallest power of two that is larger than a positive value."""
    return math.ldexp(1.0, math.frexp(value)[1])
