"""Products of vectors, and what a few directions leave of them."""

from __future__ import annotations

import math

import numpy as np

from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, compiled, entry
from multiphi_exudyn.mathematics.round_off import CLEAR, INDEPENDENT, ZERO

__all__ = [
    "absolute_product",
    "add_direction",
    "clear_products",
    "norm",
    "product_error",
    "remove_direction",
    "scalar_product",
    "span",
    "without",
    "write_following",
    "write_span",
]

ALMOST = 0.99  # of a direction's square: with a smaller part in the span of others it is independent of them


def without(directions: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Return the part of vectors (m, ...) that is orthogonal to directions (m, k), column by column in memory."""
    result = np.array(vectors.T, dtype=float, order="C")
    if directions.shape[1] == 1:
        remove_from(np.ascontiguousarray(directions[:, 0]), 0, result.ravel(), 0, len(directions), vectors[0].size)
    else:
        result -= np.linalg.lstsq(directions, vectors, rcond=None)[0].T @ directions.T
    return result.T


def product_error(vectors: np.ndarray) -> float:
    """Return the largest element of |V^T V - I|, V (m, r)."""
    return float(largest_error(np.ascontiguousarray(vectors.T).ravel(), *vectors.shape))


@compiled
def scalar_product(a: Numbers, first: int, b: Numbers, second: int, m: int) -> float:
    """Return the product of two vectors (m,) in four independent sums, which a processor adds up together."""
    sum_0, sum_1, sum_2, sum_3 = 0.0, 0.0, 0.0, 0.0
    for i in range(0, m - 3, 4):
        sum_0 += a[first + i] * b[second + i]
        sum_1 += a[first + i + 1] * b[second + i + 1]
        sum_2 += a[first + i + 2] * b[second + i + 2]
        sum_3 += a[first + i + 3] * b[second + i + 3]
    for i in range(m - m % 4, m):
        sum_0 += a[first + i] * b[second + i]
    return (sum_0 + sum_1) + (sum_2 + sum_3)


@compiled
def norm(numbers: Numbers, vector: int, m: int) -> float:
    """Return the length of a vector (m,)."""
    return math.sqrt(scalar_product(numbers, vector, numbers, vector, m))


@compiled
def absolute_product(a: Numbers, first: int, b: Numbers, second: int, m: int) -> float:
    """Return the sum of the absolute terms of ``scalar_product``, which bounds its round-off."""
    sum_0, sum_1, sum_2, sum_3 = 0.0, 0.0, 0.0, 0.0
    for i in range(0, m - 3, 4):
        sum_0 += abs(a[first + i] * b[second + i])
        sum_1 += abs(a[first + i + 1] * b[second + i + 1])
        sum_2 += abs(a[first + i + 2] * b[second + i + 2])
        sum_3 += abs(a[first + i + 3] * b[second + i + 3])
    for i in range(m - m % 4, m):
        sum_0 += abs(a[first + i] * b[second + i])
    return (sum_0 + sum_1) + (sum_2 + sum_3)


@compiled
def clear_products(numbers: Numbers, products: int, given: int, matrix: Numbers, row_sums: int, count: int) -> None:
    """Set products A x (count,) to zero where they are round-off of their terms, |A| |x|.

    matrix: |A|, row by row. The terms are at most ``row_sums`` of |A| times the largest |x|; they are added up only
    where this bound does not decide.
    """
    largest = 0.0
    for j in range(count):
        largest = max(largest, abs(numbers[given + j]))
    for i in range(count if largest > 0.0 else 0):
        size = abs(numbers[products + i])
        if size <= CLEAR * (numbers[row_sums + i] * largest):
            is_round_off = size <= ZERO * absolute_product(matrix, i * count, numbers, given, count)
            numbers[products + i] = 0.0 if is_round_off else numbers[products + i]


@compiled
def remove_direction(direction: Numbers, first: int, vectors: Numbers, start: int, m: int, count: int) -> None:
    """Remove a direction (m,), which begins at ``first``, from vectors (count, m), which begin at ``start``."""
    square = scalar_product(direction, first, direction, first, m)
    for k in range(count if square > 0.0 else 0):
        vector = start + k * m
        share = scalar_product(direction, first, vectors, vector, m) / square
        for i in range(m):
            vectors[vector + i] -= share * direction[first + i]


@compiled
def add_direction(vectors: Numbers, vector: int, length: float, scratch: Numbers, basis: int, m: int, k: int) -> int:
    """Add a direction to k orthonormal vectors, and return 1; where it depends on them, zeros, and return 0.

    vector: where the direction (m,) of this ``length`` begins. scratch: the k vectors from ``basis`` on, and memory for
    one more. The direction is orthogonalised twice, which leaves round-off only.
    """
    added = basis + k * m
    for i in range(m):
        scratch[added + i] = vectors[vector + i] / length if length > 0.0 else 0.0
    for _ in range(2):
        for p in range(k):
            share = scalar_product(scratch, basis + p * m, scratch, added, m)
            for i in range(m):
                scratch[added + i] -= share * scratch[basis + p * m + i]
    size = norm(scratch, added, m)
    for i in range(m):
        scratch[added + i] *= 1.0 / size if size > INDEPENDENT else 0.0
    return 1 if size > INDEPENDENT else 0


@compiled
def write_span(
    links: Numbers, directions: int, lengths: int, rigid: Ints, first: int, scratch: Numbers, basis: int, m: int, k: int
) -> int:
    """Write unit vectors (k, m) of the space of k rigid links; return 1 where these are independent, else 0.

    links: holds the directions (m,) of all links from ``directions`` on, and their lengths from ``lengths`` on. rigid:
    numbers of the rigid ones, from ``first`` on. scratch: from ``basis`` on the unit vectors, and memory (m,).
    """
    for p in range(k):
        link = rigid[first + p]
        if add_direction(links, directions + link * m, links[lengths + link], scratch, basis, m, p) == 0:
            return 0
    return 1


@compiled
def write_following(
    links: Numbers, directions: int, lengths: int, scratch: Numbers, basis: int, flags: int, m: int, count: int, k: int
) -> None:
    """Set flags (count,) of links that k rigid ones hold, and of those that no mode moves.

    links: as in ``write_span``. scratch: from ``basis`` on what that has written, (k, m), and memory (m,); from
    ``flags`` on the flags.
    """
    for link in range(count):
        length, direction, square = links[lengths + link], directions + link * m, 0.0
        for p in range(k if length > 0.0 else 0):
            share = scalar_product(scratch, basis + p * m, links, direction, m) / length
            square += share * share
        scratch[flags + link] = 1.0 if length == 0.0 else 0.0
        if square > ALMOST and add_direction(links, direction, length, scratch, basis, m, k) == 0:
            scratch[flags + link] = 1.0


@compiled
def largest_product_error(vectors: Numbers, m: int, r: int) -> float:
    """Return ``product_error`` of vectors (r, m); NaN where one is not finite."""
    largest = 0.0
    for i in range(r):
        for j in range(i + 1):
            error = abs(scalar_product(vectors, i * m, vectors, j * m, m) - (1.0 if i == j else 0.0))
            if not error <= largest:
                largest = error
    return largest


remove_from, largest_error, span = entry(remove_direction), entry(largest_product_error), entry(write_span)
