"""Free response of oscillating modes with light damping coupling: components of the other modes by iteration.

    (lambda^2 + lambda D + diag(omega^2)) v = 0,   D = diag(d) + G symmetric,   v_i = 1 in pair i

From v = e_i, every row j gives its component, and row i the rate:

    v_j = -lambda (G v)_j / (omega_j^2 - omega_i^2 + lambda (d_j - d_i - (G v)_i)),   j not i
    lambda^2 + lambda (d_i + (G v)_i) + omega_i^2 = 0

all pairs at once. The error falls by the ratio of damping to the distance of two modes in every step. As D is
symmetric, the same vectors give the motion from an initial state (F. Tisseur, K. Meerbergen, The quadratic eigenvalue
problem, SIAM Rev. 43 (2001) 235, sec. 3):

    eta(t) = Re sum_i v_i c_i exp(lambda_i t),   c_i = 2 v_i . (eta'(0) - omega^2 eta(0) / lambda_i) / theta_i
    theta_i = v_i . (2 lambda_i + D) v_i
"""

from __future__ import annotations

import math

from multiphi_exudyn.mathematics.compiling.compiled import Numbers, Waves, compiled

__all__ = ["iterate_pairs", "pair_numbers"]

LIGHT = 0.2  # of omega, and of a distance of two modes: larger damping is not light
SYMMETRIC = 1e-13  # of the largest damping: round-off of a symmetric matrix
LAST = 2e-16  # of a mode: predicted next step, from the slowest reduction so far
MOST_STEPS = 30  # of the iteration; three to ten are typical


def pair_numbers(r: int) -> int:
    """Return how many numbers ``iterate_pairs`` takes beside omega^2, d and D."""
    return (4 * r + 2) * r


@compiled
def iterate_pairs(numbers: Numbers, waves: Waves, r: int) -> int:
    """Iterate v of all pairs until it converges, and write the closed form; return 0 where it does not, else 1.

    It does not where D is not symmetric, or not light. numbers: omega^2, d (r,), D (r, r), replaced by G; v and G v of
    all pairs, a row each, (r, r), first real, then imaginary parts; lambda (2, r); those after G are zero before.
    """
    previous, reduction = 1.0, 0.0
    if start(numbers, r) == 0:
        return 0
    for _ in range(MOST_STEPS):
        step = improve(numbers, r)
        if not step < math.inf:
            return 0
        previous, reduction = step, max(reduction, step / previous)
        multiply(numbers, r)
        if step * reduction <= LAST:
            write(numbers, waves, r)
            return 1
    return 0


@compiled
def multiply(numbers: Numbers, r: int) -> None:
    """Set G v of all pairs."""
    coupling, vectors, products = 2 * r, (2 + r) * r, (2 + 3 * r) * r
    for row in range(2 * r):
        for j in range(r):
            numbers[products + row * r + j] = 0.0
        for k in range(r):
            component = numbers[vectors + row * r + k]
            for j in range(r if component != 0.0 else 0):
                numbers[products + row * r + j] += component * numbers[coupling + k * r + j]


@compiled
def start(numbers: Numbers, r: int) -> int:
    """Return 1 where damping is symmetric and light for all modes and their distances, and start with v = e_i."""
    coupling, vectors, products, largest = 2 * r, (2 + r) * r, (2 + 3 * r) * r, 0.0
    for i in range(r):
        damping = numbers[r + i]
        largest = max(largest, damping)
        if not abs(damping) < LIGHT * math.sqrt(max(numbers[i], 0.0)):
            return 0
        numbers[coupling + i * r + i] = 0.0
        numbers[vectors + i * r + i] = 1.0
    for j in range(r):
        row_sum = 0.0
        for k in range(r):
            value = numbers[coupling + j * r + k]
            if not abs(value - numbers[coupling + k * r + j]) <= SYMMETRIC * largest:
                return 0
            row_sum += abs(value)
            numbers[products + j * r + k] = value
        for i in range(r):
            if i != j and not row_sum * math.sqrt(numbers[i]) <= LIGHT * abs(numbers[j] - numbers[i]):
                return 0
    return 1


@compiled
def set_rate(numbers: Numbers, r: int, i: int) -> int:
    """Set lambda of pair i from G v, the root above the real axis; return 0 where there is none."""
    product, rates = (2 + 3 * r + i) * r + i, (2 + 5 * r) * r + i
    half = 0.5 * complex(numbers[r + i] + numbers[product], numbers[product + r * r])
    difference = numbers[i] - half * half
    if not difference.real > 0.0:
        return 0
    root = math.sqrt(0.5 * (abs(difference) + difference.real))
    numbers[rates] = -0.5 * difference.imag / root - half.real
    numbers[rates + r] = root - half.imag
    return 1


@compiled
def improve(numbers: Numbers, r: int) -> float:
    """Update v of all pairs from G v; return the largest change of a part of v, infinite where one is not finite."""
    vectors, products, rates, step = (2 + r) * r, (2 + 3 * r) * r, (2 + 5 * r) * r, 0.0
    for i in range(r):
        if set_rate(numbers, r, i) == 0:
            return math.inf
        rate, row = complex(numbers[rates + i], numbers[rates + r + i]), i * r
        diagonal = complex(numbers[r + i] + numbers[products + row + i], numbers[products + r * r + row + i])
        for j in range(r):
            if j != i:
                v, coupling = (
                    vectors + row + j,
                    complex(numbers[products + row + j], numbers[products + r * r + row + j]),
                )
                denominator = numbers[j] - numbers[i] + rate * (numbers[r + j] - diagonal)
                size = denominator.real * denominator.real + denominator.imag * denominator.imag
                component = -rate * coupling * denominator.conjugate() * (1.0 / size)
                change = max(abs(component.real - numbers[v]), abs(component.imag - numbers[v + r * r]))
                if not change < math.inf:
                    return math.inf
                step = max(step, change)
                numbers[v], numbers[v + r * r] = component.real, component.imag
    return step


@compiled
def write(numbers: Numbers, waves: Waves, r: int) -> None:
    """Set lambda (r,), and A, B and V^T of all pairs, a row each, (r, r); P, between the latter two, stays zero."""
    vectors, products, rates = (2 + r) * r, (2 + 3 * r) * r, (2 + 5 * r) * r
    for i in range(r):
        set_rate(numbers, r, i)
        rate, row, theta = complex(numbers[rates + i], numbers[rates + r + i]), i * r, 0j
        on_displacement, on_velocity, shape = r + row, (1 + r) * r + row, (1 + 3 * r) * r + row
        for j in range(r):
            v = complex(numbers[vectors + row + j], numbers[vectors + r * r + row + j])
            others = complex(numbers[products + row + j], numbers[products + r * r + row + j])
            theta += v * ((2.0 * rate + numbers[r + j]) * v + others)
            waves[shape + j] = v
        weight = theta.conjugate() * (2.0 / (theta.real * theta.real + theta.imag * theta.imag))
        inverse_rate = rate.conjugate() * (-1.0 / (rate.real * rate.real + rate.imag * rate.imag))
        waves[i] = rate
        for j in range(r):
            waves[on_velocity + j] = weight * waves[shape + j]
            waves[on_displacement + j] = numbers[j] * (inverse_rate * waves[on_velocity + j])
