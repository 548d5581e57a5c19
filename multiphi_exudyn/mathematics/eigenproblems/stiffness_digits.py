"""What the digits of a stiffness matrix leave unknown: rigid-body modes, and soft modes beside stiff springs.

    omega^2 = phi.K phi,   error of omega^2 = sum_v S_v d_v,   S_v = sum of phi_i phi_k over the entries +-v of K

Every value v of K is known up to half a unit of its last digit, |d_v| <= u_v / 2: of 53 bits, of 24 in single
precision, or of the decimals with which a program printed it. With errors d_v that are independent of each other and
uniform, omega^2 has the standard deviation sigma, sigma^2 = sum_v (S_v u_v)^2 / 12. Equal values have equal errors.

A soft mode beside stiff springs is a small difference of large energies. Products of K with it are therefore formed
in twice the precision (T. J. Dekker, Numer. Math. 18 (1971) 224), and first-order perturbations by the other modes make
it exact for the numbers that K holds.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg
import scipy.sparse

__all__ = ["CERTAIN", "Digits", "digits_of", "doubled_product", "energy_noise", "has_soft_ground", "is_exact"]

DECIMALS = range(6, 14)  # digits of printed matrices that can be told: with more, every number of 53 bits has them
DISTINCT = 5  # values at least, as a few springs may have short numbers by chance
USED = 0.5  # of the values that have a last digit other than zero; of any digits it is 9 in 10
LAST = 4  # bits of single precision of which one is not zero
SAMPLED = 200  # values that tell most matrices of all 53 bits
INTEGER = 8 * float(np.finfo(float).eps)  # of a value: a remainder below it is round-off of the decimal number
MOVED = 1e-5  # of the largest displacement of rigid-body modes: smaller ones are round-off
DEVIATIONS = 4.0  # sigma: the largest error of omega^2
UNUSED = 4.0  # units of the last bit of the largest entry
CERTAIN = 8.0  # units: few matrices of rounded numbers are multiples of them by chance
NEARLY_FREE = 1e-13  # of a row's diagonal entry: larger row sums are springs to the ground without doubt, or gears
SPLIT = 2.0**27 + 1


@dataclass(frozen=True)
class Digits:
    """Digits of a matrix. name: "9 digits", or "single precision". unit: u of values (k,) > 0."""

    name: str
    unit: Callable[[np.ndarray], np.ndarray]


def digits_of(matrix: Any) -> Digits | None:
    """Return the digits of a matrix (n, n) that has fewer than 53 bits, None for others."""
    values = matrix.data if scipy.sparse.issparse(matrix) else matrix.ravel()
    few = np.unique(np.abs(values[values != 0])[:: max(1, len(values) // SAMPLED)])
    if not any(test(few) for test in (_is_single, _has_decimals)):
        return None
    distinct = np.unique(np.abs(values[values != 0]))
    if len(distinct) < DISTINCT:
        return None
    if _is_single(distinct) and np.mean(distinct.astype(np.float32).view(np.int32) % 2**LAST != 0) >= USED:
        return Digits("single precision", lambda v: np.spacing(v.astype(np.float32)).astype(float))
    for count in DECIMALS:
        scaled = distinct / _unit(distinct, count)
        if _are_integers(scaled):
            is_used = float(np.mean(np.round(scaled) % 10 != 0)) >= USED
            return Digits(f"{count} digits", functools.partial(_unit, count=count)) if is_used else None
    return None


def is_exact(matrix: np.ndarray, units: float = UNUSED) -> bool:
    """Return whether all entries are multiples of a few units of the last bit of the largest: sums of exact numbers.

    Round-off of smaller entries leaves fractions of it.
    """
    step = units * np.spacing(np.max(np.abs(matrix)))
    return bool(np.all(matrix == step * np.round(matrix / step)))


def energy_noise(stiffness: Any, shapes: np.ndarray, digits: Digits | None = None) -> np.ndarray:
    """Return the largest error (m,) of omega^2 of shapes (n, m) that the digits of K leave open; None: 53 bits."""
    upper = scipy.sparse.triu(scipy.sparse.coo_array(stiffness)).tocoo()
    distinct, groups = np.unique(np.abs(upper.data), return_inverse=True)
    unit = np.spacing(distinct) if digits is None else digits.unit(np.where(distinct > 0, distinct, 1.0))
    unit = np.where(distinct > 0, unit, 0.0)
    factors = np.sign(upper.data) * np.where(upper.row == upper.col, 1.0, 2.0)
    noise = np.empty(shapes.shape[1])
    for j, shape in enumerate(shapes.T):
        sums = np.bincount(groups, factors * shape[upper.row] * shape[upper.col], len(distinct))
        noise[j] = DEVIATIONS * np.linalg.norm(sums * unit) / np.sqrt(12)
    return noise


def has_soft_ground(stiffness: np.ndarray, shapes: np.ndarray) -> bool:
    """Return whether springs (n, n) between coordinates that shapes (n, m) move have soft ones to the ground.

    No entry beside the diagonal is positive, and a row sum is more than the round-off of the additions in it.
    """
    diagonal, moved = np.diagonal(stiffness), np.any(np.abs(shapes) > MOVED * np.max(np.abs(shapes)), axis=1)
    if np.any(stiffness - np.diag(diagonal) > 0):
        return False
    sums = doubled_product(stiffness, np.ones((len(stiffness), 1)))[:, 0]
    additions = np.count_nonzero(stiffness, axis=1)
    is_soft = (sums > additions * np.spacing(diagonal)) & (sums <= NEARLY_FREE * diagonal)
    return bool(np.any(is_soft & moved))


def doubled_product(matrix: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Return K X (n, p) of (n, n) and (n, p), each sum formed in twice the precision."""
    total, rest = np.zeros((2, *vectors.shape))
    for column, row in zip(np.ascontiguousarray(matrix.T), vectors, strict=True):
        product, product_error = _product(column[:, None], row[None, :])
        added = total + product
        part = added - total
        rest += (total - (added - part)) + (product - part) + product_error
        total = added
    return np.asarray(total + rest)


def _product(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the rounded product and its error."""
    product = a * b
    a_high, b_high = SPLIT * a - (SPLIT * a - a), SPLIT * b - (SPLIT * b - b)
    a_low, b_low = a - a_high, b - b_high
    return product, a_low * b_low - (((product - a_high * b_high) - a_low * b_high) - a_high * b_low)


def _is_single(values: np.ndarray) -> bool:
    with np.errstate(over="ignore"):
        return bool(np.all(values.astype(np.float32) == values))


def _has_decimals(values: np.ndarray) -> bool:
    return _are_integers(values / _unit(values, DECIMALS[-1]))


def _are_integers(values: np.ndarray) -> bool:
    return bool(np.all(np.abs(values - np.round(values)) <= INTEGER * values))


def _unit(values: np.ndarray, count: int) -> np.ndarray:
    """Return a unit of the last of ``count`` decimal digits of values (k,) > 0."""
    return np.asarray(10.0 ** (np.floor(np.log10(values) + INTEGER) - (count - 1)))
