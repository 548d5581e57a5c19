"""Free response of oscillating modes that damping couples lightly: what each has of the others, by iteration.

    (lambda^2 + lambda D + diag(omega^2)) v = 0,   D symmetric with the diagonal d,   v_i = 1 in pair i

From v = e_i, every row j gives its component, and row i the rate:

    v_j = -lambda ((D v)_j - d_j v_j) / (omega_j^2 - omega_i^2 + lambda (d_j - (D v)_i)),   j not i
    lambda^2 + lambda (D v)_i + omega_i^2 = 0

It converges by the factor that damping is of the distance of two modes. As D is symmetric, the same vectors make the
motion of a start (F. Tisseur, K. Meerbergen, The quadratic eigenvalue problem, SIAM Rev. 43 (2001) 235, sec. 3):

    eta(t) = Re sum_i v_i c_i exp(lambda_i t),   c_i = 2 v_i . (eta'(0) - omega^2 eta(0) / lambda_i) / theta_i
    theta_i = v_i . (2 lambda_i + D) v_i
"""

from __future__ import annotations

import math

import numpy as np

from multiphi_exudyn.mathematics.compiled import Numbers, Waves, compiled, entry
from multiphi_exudyn.mathematics.exponentials import Exponentials
from multiphi_exudyn.mathematics.free_response import ModalResponse

__all__ = ["find_pairs", "lightly_damped"]

LIGHT = 0.2  # of omega, and of a distance of two modes: more damping is not light
SYMMETRIC = 1e-13  # of the largest damping: round-off of a symmetric matrix
LAST = 2e-16  # of a mode: the step after the last, if it is as much smaller as the least of those before
MOST_STEPS = 30  # of the iteration; three to ten are typical


def lightly_damped(squares: np.ndarray, damping: np.ndarray) -> ModalResponse | None:
    """Closed form for omega^2 (r,) and damping D (r, r); None where D is not symmetric, or not light."""
    r = len(squares)
    waves = np.zeros((2 + 4 * r) * r, complex)
    if not find_pairs(np.concatenate([squares, damping.ravel()]), waves, r):
        return None
    rows = waves.reshape(-1, r)
    return ModalResponse(
        basis=Exponentials(rows[0], np.zeros(r, int)),
        shapes=rows[2 : 2 + r].T,
        from_displacement=rows[2 + r : 2 + 2 * r],
        from_velocity=rows[2 + 2 * r : 2 + 3 * r],
        from_force=rows[2 + 3 * r :],
        diagonal=False,
        alone=np.zeros(r, bool),
        poles=np.ones(r, bool),
    )


@compiled
def light_pairs(numbers: Numbers, waves: Waves, r: int) -> int:
    """Whether all pairs are found. numbers: omega^2 (r,), D (r, r). waves: lambda, D v (r,), rows v_i, A, B (r, r)."""
    if is_light(numbers, r) == 0:
        return 0
    for i in range(r):
        v, on_place, on_speed = (2 + i) * r, (2 + r + i) * r, (2 + 2 * r + i) * r
        if light_pair(numbers, waves, r, i, v) == 0:
            return 0
        rate, theta = waves[i], 0j
        for j in range(r):
            theta += waves[v + j] * (2.0 * rate * waves[v + j] + waves[r + j])
        weight = theta.conjugate() * (2.0 / (theta.real * theta.real + theta.imag * theta.imag))
        inverse = rate.conjugate() * (1.0 / (rate.real * rate.real + rate.imag * rate.imag))
        for j in range(r):
            waves[on_speed + j] = weight * waves[v + j]
            waves[on_place + j] = -numbers[j] * inverse * waves[on_speed + j]
    return 1


@compiled
def is_light(numbers: Numbers, r: int) -> int:
    """Whether damping is symmetric, and light for every mode and for every distance of two."""
    largest = 0.0
    for i in range(r):
        own = numbers[r + i * r + i]
        largest = max(largest, own)
        if not abs(own) < LIGHT * math.sqrt(max(numbers[i], 0.0)):
            return 0
    for j in range(r):
        others = 0.0
        for k in range(r):
            given = numbers[r + j * r + k]
            if not abs(given - numbers[r + k * r + j]) <= SYMMETRIC * largest:
                return 0
            others += abs(given) if k != j else 0.0
        for i in range(r):
            if i != j and not others * math.sqrt(numbers[i]) <= LIGHT * abs(numbers[j] - numbers[i]):
                return 0
    return 1


@compiled
def light_pair(numbers: Numbers, waves: Waves, r: int, i: int, v: int) -> int:
    """Whether the iteration for pair i converges: its rate, its vector v (r,), and D v."""
    for j in range(r):
        waves[v + j] = 1.0 if j == i else 0.0
        waves[r + j] = numbers[r + j * r + i]
    before, falls = 1.0, 0.0
    for _ in range(MOST_STEPS):
        set_rate(numbers, waves, r, i)
        rate, whole, step = waves[i], waves[r + i], 0.0
        for j in range(r):
            if j != i:
                own = numbers[r + j * r + j]
                others = waves[r + j] - own * waves[v + j]
                apart = numbers[j] - numbers[i] + rate * (own - whole)
                size = apart.real * apart.real + apart.imag * apart.imag
                found = -rate * others * apart.conjugate() * (1.0 / size)
                change = found - waves[v + j]
                step += abs(change.real) + abs(change.imag)
                waves[v + j] = found
        for j in range(r):
            damped = 0j
            for k in range(r):
                damped += numbers[r + j * r + k] * waves[v + k]
            waves[r + j] = damped
        falls = max(falls, step / before)
        before = step
        if step * falls <= LAST:
            set_rate(numbers, waves, r, i)
            return 1
    return 0


@compiled
def set_rate(numbers: Numbers, waves: Waves, r: int, i: int) -> None:
    """lambda of pair i, of lambda^2 + lambda (D v)_i + omega_i^2 = 0 the root above the real axis."""
    whole = waves[r + i]
    left = numbers[i] - 0.25 * whole * whole
    root = math.sqrt(0.5 * (abs(left) + left.real))
    waves[i] = complex(-0.5 * left.imag / root, root) - 0.5 * whole


find_pairs = entry(light_pairs)
