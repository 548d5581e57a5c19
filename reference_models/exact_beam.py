"""Natural frequencies of a planar beam from its transcendental equation.

Harmonic motion of a Timoshenko beam, y = (w, theta, M, V) with the bending moment M = EI theta' and the
shear force V = k G A (w' - theta):

    w' = theta + V / (k G A)    theta' = M / (EI)    M' = -V - rho I omega^2 theta    V' = -rho A omega^2 w

A section of length l carries y over by exp(A l), a point mass by M += -J omega^2 theta, V += -m omega^2 w, a
pin by an unknown jump of V with w = 0. M = V = 0 at the far end; a clamp leaves two unknowns at the first.
omega is a natural frequency where the determinant of these conditions vanishes; it has no poles, so its
roots are bracketed by its signs and found by Brent's method. Euler-Bernoulli: 1/(k G A) = rho I = 0.

Sources: W. T. Thomson, Theory of Vibration with Applications, ch. 12 (transfer matrices); G. R. Cowper,
J. Appl. Mech. 33 (1966) 335 (equations). Independent of any finite element.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.mechanics.beam import Beam, Section

__all__ = ["exact_frequencies"]

W, THETA, MOMENT, SHEAR = range(4)  # the state's components
SCAN_STEP = 0.02  # of a mode's wave number pi/L: far below the distance of two frequencies
ROOT_TOLERANCE = 1e-14  # of the wave number, relative


def exact_frequencies(beam: Beam, count: int, pins: Sequence[float] = (), *, shear: bool = True) -> np.ndarray:
    """The lowest ``count`` natural frequencies [Hz] above zero, (count,), ascending.

    pins: positions [m] where w = 0. shear: Timoshenko beam; False for Euler-Bernoulli.
    """
    for x in pins:
        if not beam.start < x <= beam.end:
            raise MultiPhiValueError(f"pins: got x = {x!r} m, need {beam.start:g} < x <= {beam.end:g}")
    scale = min(_wave_scale(section) for section in beam.sections)
    step = SCAN_STEP * math.pi / beam.length
    roots = _roots(lambda k: _determinant(beam, pins, shear, scale * k**2), step)
    return np.array([scale * next(roots) ** 2 / (2 * math.pi) for _ in range(count)])


def _wave_scale(section: Section) -> float:
    """omega / k^2 of the Euler-Bernoulli beam."""
    return math.sqrt(section.youngs_modulus * section.second_moment / (section.density * section.area))


def _roots(function: Callable[[np.ndarray], np.ndarray], step: float) -> Iterator[float]:
    """Positive simple roots, ascending: one per change of sign on a grid of the given step."""
    start = step
    while True:
        grid = start + step * np.arange(101)
        signs = np.sign(function(grid))
        for i in np.flatnonzero(signs[:-1] * signs[1:] < 0):
            xtol = ROOT_TOLERANCE * grid[i]
            yield brentq(_scalar(function), grid[i], grid[i + 1], xtol=xtol, rtol=ROOT_TOLERANCE)
        start = grid[-1]


def _scalar(function: Callable[[np.ndarray], np.ndarray]) -> Callable[[float], float]:
    return lambda k: float(function(np.array([k]))[0])


def _determinant(beam: Beam, pins: Sequence[float], shear: bool, omega: np.ndarray) -> np.ndarray:
    """Determinant of the end and pin conditions over the unknowns, for omega (k,) [rad/s]; (k,)."""
    columns = np.zeros((len(omega), 4, 2 + len(pins)))
    columns[:, :, :2] = _clamp_columns(beam)
    conditions = []
    places = {beam.start, *pins, *(s.end for s in beam.sections), *(mass.at for mass in beam.masses)}
    for left, right in pairwise(sorted(places)):
        columns = _across_masses(beam, left, omega, columns)
        columns = _transfer(beam.section_at((left + right) / 2), right - left, shear, omega) @ columns
        if right in pins:
            conditions.append(columns[:, W, :].copy())
            columns[:, SHEAR, 1 + len(conditions)] = 1.0
    columns = _across_masses(beam, beam.end, omega, columns)
    return np.linalg.det(np.stack([columns[:, MOMENT, :], columns[:, SHEAR, :], *conditions], axis=1))


def _clamp_columns(beam: Beam) -> np.ndarray:
    """States at the first end that its support allows, (4, 2): V = k_w w and M = k_theta theta there."""
    columns = np.zeros((4, 2))
    springs = (beam.clamp.translation, beam.clamp.rotation)
    for column, (spring, motion, force) in enumerate(zip(springs, (W, THETA), (SHEAR, MOMENT), strict=True)):
        if math.isinf(spring):
            columns[force, column] = 1.0
        else:
            columns[[motion, force], column] = 1.0, spring
    return columns


def _across_masses(beam: Beam, x: float, omega: np.ndarray, columns: np.ndarray) -> np.ndarray:
    after = columns.copy()
    for mass in (mass for mass in beam.masses if mass.at == x):
        after[:, SHEAR, :] -= mass.mass * omega[:, None] ** 2 * columns[:, W, :]
        after[:, MOMENT, :] -= mass.inertia * omega[:, None] ** 2 * columns[:, THETA, :]
    return after


def _transfer(section: Section, length: float, shear: bool, omega: np.ndarray) -> np.ndarray:
    """exp(A l), (k, 4, 4), by Sylvester's formula: A^2 has two double eigenvalues z."""
    matrix = _state_matrix(section, shear, omega)
    square = matrix @ matrix
    low, high = _squared_eigenvalues(square)
    onto_low = (square - high * np.eye(4)) / (low - high)
    onto_high = (square - low * np.eye(4)) / (high - low)
    even = _cosh(low * length**2) * onto_low + _cosh(high * length**2) * onto_high
    odd = _sinhc(low * length**2) * onto_low + _sinhc(high * length**2) * onto_high
    return even + length * matrix @ odd


def _state_matrix(section: Section, shear: bool, omega: np.ndarray) -> np.ndarray:
    matrix = np.zeros((len(omega), 4, 4))
    matrix[:, W, THETA] = 1.0
    matrix[:, THETA, MOMENT] = 1 / (section.youngs_modulus * section.second_moment)
    matrix[:, MOMENT, SHEAR] = -1.0
    matrix[:, SHEAR, W] = -section.density * section.area * omega**2
    if shear:
        matrix[:, W, SHEAR] = 1 / (section.shear_factor * section.shear_modulus * section.area)
        matrix[:, MOMENT, THETA] = -section.density * section.second_moment * omega**2
    return matrix


def _squared_eigenvalues(square: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The two double eigenvalues of A^2, each (k, 1, 1): z = p/2 -+ sqrt(p^2/4 - q)."""
    half_sum = np.trace(square, axis1=1, axis2=2) / 4
    half_square_sum = np.trace(square @ square, axis1=1, axis2=2) / 4
    root = np.sqrt(half_square_sum - half_sum**2)
    return (half_sum - root)[:, None, None], (half_sum + root)[:, None, None]


def _cosh(z: np.ndarray) -> np.ndarray:
    """cosh(sqrt(z)), which is cos(sqrt(-z)) below zero."""
    return np.cosh(np.sqrt(z.astype(complex))).real


def _sinhc(z: np.ndarray) -> np.ndarray:
    """sinh(sqrt(z)) / sqrt(z)."""
    root = np.sqrt(z.astype(complex))
    return (np.sinh(root) / root).real
