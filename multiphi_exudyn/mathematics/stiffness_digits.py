"""What the digits of a stiffness matrix leave unknown: rigid-body modes, and soft modes beside stiff springs.

    omega^2 = phi.K phi,   error of omega^2 = sum_v S_v d_v,   S_v = sum of phi_i phi_k over the entries +-v of K

Every value v of K is known up to half a unit of its last digit, |d_v| <= u_v / 2: of 53 bits, of 24 in single
precision, or of the decimals with which a program printed it: as many digits in every value, as many behind the point,
or the first in some of the values and 53 bits in the others. With errors d_v that are independent of each other and
uniform, omega^2 has the standard deviation sigma, sigma^2 = sum_v (S_v u_v)^2 / 12. Equal values have equal errors.

A soft mode beside stiff springs is a small difference of large energies. Products of K with it are therefore formed
in twice the precision (T. J. Dekker, Numer. Math. 18 (1971) 224), and first-order perturbations by the other modes make
it exact for the numbers that K holds.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg
import scipy.sparse

__all__ = ["CERTAIN", "Digits", "digits_of", "doubled_product", "energy_noise", "has_soft_ground", "is_exact"]

DECIMALS = range(6, 14)  # digits of printed matrices that can be told: with more, every number of 53 bits has them
DISTINCT = 5  # values at least, as a few springs may have short numbers by chance
MIXED = 0.25  # of the values that have few digits where others have 53 bits
LONG = 1e5  # units of the last decimal in most values: whole numbers of less are exact
USED = 0.5  # of the values that have a last digit other than zero; of any digits it is 9 in 10
LAST = 4  # bits of single precision of which one is not zero
SAMPLED = 200  # values that tell most matrices of all 53 bits
INTEGER = 8 * float(np.finfo(float).eps)  # of a value: a remainder below it is round-off of the decimal number
MOVED = 1e-5  # of the largest displacement of rigid-body modes: smaller ones are round-off
DEVIATIONS = 4.0  # sigma: the largest error of omega^2
UNUSED = 4.0  # units of the last bit of the largest entry
CERTAIN = 8.0  # units: few matrices of rounded numbers are multiples of them by chance
NEARLY_FREE = 1e-9  # of a row's diagonal entry: larger row sums are springs to the ground without doubt, or gears
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
    if not (_is_single(few) or np.mean(_are_integers(few / _unit(few, DECIMALS[-1]))) >= MIXED / 2):
        return None
    distinct = np.unique(np.abs(values[values != 0]))
    if len(distinct) < DISTINCT:
        return None
    if _is_single(distinct) and np.mean(distinct.astype(np.float32).view(np.int32) % 2**LAST != 0) >= USED:
        return Digits("single precision", lambda v: np.spacing(v.astype(np.float32)).astype(float))
    equal = _equal_digits(distinct)
    return equal if equal or _are_springs(matrix) else _equal_decimals(distinct) or _mixed_digits(distinct)


def _equal_digits(distinct: np.ndarray) -> Digits | None:
    """Return the digits of values (k,) that all have the same number of them."""
    for count in DECIMALS:
        unit = functools.partial(_unit, count=count)
        if np.all(_are_integers(distinct / unit(distinct))):
            return Digits(f"{count} digits", unit) if np.mean(_has_last(distinct / unit(distinct))) >= USED else None
    return None


def _equal_decimals(distinct: np.ndarray) -> Digits | None:
    """Return the digits of values (k,) that all have the same number of decimals behind the point."""
    first = math.floor(math.log10(distinct[-1]))
    for exponent in (first + 1 - count for count in DECIMALS):
        unit = 10.0**exponent
        if np.all(_are_integers(distinct / unit)):
            is_long = np.median(distinct) >= LONG * unit and np.mean(_has_last(distinct / unit)) >= USED
            name = f"{-exponent} decimals" if exponent < 0 else f"steps of {unit:g}"
            return Digits(name, _one_unit(unit)) if is_long else None
    return None


def _mixed_digits(distinct: np.ndarray) -> Digits | None:
    """Return the digits of values (k,) of which a share has equally many, the others 53 bits."""
    for count in DECIMALS:
        scaled = distinct / _unit(distinct, count)
        if np.mean(_are_integers(scaled) & _has_last(scaled)) >= MIXED:
            return Digits(f"{count} digits in some of its entries", functools.partial(_mixed_unit, count=count))
    return None


def _mixed_unit(values: np.ndarray, count: int) -> np.ndarray:
    unit = _unit(values, count)
    return np.where(_are_integers(values / unit), unit, np.spacing(values))


def _one_unit(unit: float) -> Callable[[np.ndarray], np.ndarray]:
    return lambda values: np.full(len(values), unit)


def _are_springs(matrix: Any) -> bool:
    """Return whether springs, between coordinates and to the ground, add up to K exactly: rounded ones would not."""
    entries = scipy.sparse.coo_array(matrix)
    return bool(np.all(entries.data[entries.row != entries.col] <= 0) and np.all(matrix.sum(axis=1) >= 0))


def is_exact(matrix: Any, units: float = UNUSED) -> bool:
    """Return whether all entries are multiples of a few units of the last bit of the largest: sums of exact numbers.

    Round-off of smaller entries leaves fractions of it.
    """
    values = matrix.data if scipy.sparse.issparse(matrix) else matrix
    step = units * np.spacing(np.max(np.abs(values), initial=0.0))
    return bool(np.all(values == step * np.round(values / step)))


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


def has_soft_ground(stiffness: Any, shapes: np.ndarray) -> bool:
    """Return whether springs (n, n) between coordinates that shapes (n, m) move have soft ones to the ground.

    No entry beside the diagonal is positive, and a row sum is more than the round-off of the additions in it.
    """
    entries, diagonal = scipy.sparse.coo_array(stiffness), stiffness.diagonal()
    moved = np.any(np.abs(shapes) > MOVED * np.max(np.abs(shapes)), axis=1)
    if np.any(entries.data[entries.row != entries.col] > 0):
        return False
    sums = doubled_product(stiffness, np.ones((len(diagonal), 1)))[:, 0]
    additions = np.bincount(entries.row, minlength=len(diagonal))
    is_soft = (sums > additions * np.spacing(diagonal)) & (sums <= NEARLY_FREE * diagonal)
    return bool(np.any(is_soft & moved))


def doubled_product(matrix: Any, vectors: np.ndarray) -> np.ndarray:
    """Return K X (n, p) of (n, n), dense or sparse, and (n, p), each sum formed in twice the precision."""
    entries = scipy.sparse.csr_array(matrix)
    counts = np.diff(entries.indptr)
    total, rest = np.zeros((2, *vectors.shape))
    for k in range(int(np.max(counts, initial=0))):  # the k-th entry of every row
        rows = np.flatnonzero(counts > k)
        places = entries.indptr[rows] + k
        product, product_error = _product(entries.data[places, None], vectors[entries.indices[places]])
        before = total[rows]
        added = before + product
        part = added - before
        rest[rows] += (before - (added - part)) + (product - part) + product_error
        total[rows] = added
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


def _are_integers(values: np.ndarray) -> np.ndarray:
    return np.asarray(np.abs(values - np.round(values)) <= INTEGER * values)


def _has_last(values: np.ndarray) -> np.ndarray:
    """Return which of whole numbers (k,) have another last digit than zero."""
    return np.asarray(np.round(values) % 10 != 0)


def _unit(values: np.ndarray, count: int) -> np.ndarray:
    """Return a unit of the last of ``count`` decimal digits of values (k,) > 0."""
    return np.asarray(10.0 ** (np.floor(np.log10(values) + INTEGER) - (count - 1)))
