"""Works of a segment when it ends: the changes of the primitives of its powers (events/work_forms.py).

    damping   y.F y + Re(a.R y) + Re(a.P a + a.P~ conj(a)) / 2
    varying   the same without F, and its constant force times the change of w
    friction  its constant forces times the change of xi

y = (eta, eta') without the forced response to the channels, at the two ends of the segment. A segment without
primitives, or in which y is much larger than the motion, is left out: work.py integrates it when a ledger needs it.
"""

from __future__ import annotations

from multiphi_exudyn.events.arrays import (
    CARRIER_COUNT,
    CARRIER_WIDTH,
    CARRIERS,
    CHANGING_DAMPING,
    CHANGING_VARYING,
    CHANNELS,
    CURRENT,
    DISSIPATED,
    DISSIPATED_MODES,
    DRIVE_NEXT,
    DRIVE_WAVES,
    DRIVEN,
    DRIVEN_COUNT,
    DRIVEN_RESPONSE,
    FREQUENCIES,
    LASTING_DAMPING,
    LASTING_VARYING,
    LEVEL,
    MODES,
    NODE_COUNT,
    NODES,
    PIECE_NOW,
    PIECE_TERMS,
    PLACE,
    POWER,
    PRESCRIBED,
    REACHED,
    RUBBING,
    SPEED,
    SWUNG,
    TERM_INTS,
    WEIGHTS,
    WORK_NUMBERS,
    WORKS_NOW,
)
from multiphi_exudyn.events.states.energies import pattern_work, potential
from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, Waves, compiled

__all__ = ["LARGE_FREE_RESPONSE", "damping_work", "work_of_segment"]

LARGE_FREE_RESPONSE = 100.0  # times the largest energy: differences lose so much accuracy


@compiled
def work_of_segment(ints: Ints, numbers: Numbers, waves: Waves, duration: float) -> int:
    """Put the works [J] of the segment from CURRENT to REACHED into WORKS_NOW (3,).

    Return 1, or 0 where the segment is left out.
    """
    level, q = ints[CURRENT + LEVEL], ints[PRESCRIBED]
    r, forms = ints[level + MODES], ints[level + DRIVEN]
    if ints[level + DISSIPATED] < 0 or (q > 0 and forms < 0):
        return 0
    count = ints[forms + DRIVEN_COUNT] if q > 0 else 0
    size = count + 2 * r
    first, sums, changes = ints[WORK_NUMBERS], ints[WORK_NUMBERS] + 2 * size, ints[WORK_NUMBERS] + 3 * size
    if q > 0 and list_coefficients(ints, numbers, waves, forms, ints[DRIVE_WAVES], first) == 0:
        return 0
    if q > 0:
        list_coefficients(ints, numbers, waves, forms, ints[DRIVE_NEXT], first + size)
    free_state(ints, numbers, CURRENT, forms, count, first)
    free_state(ints, numbers, REACHED, forms, count, first + size)
    if q > 0 and is_free_response_large(ints, numbers, first + count) == 1:
        return 0
    for i in range(size):
        numbers[sums + i] = numbers[first + size + i] + numbers[first + i]
        numbers[changes + i] = numbers[first + size + i] - numbers[first + i]
    damping = damping_work(ints, numbers, level, sums + count, changes + count)
    varying, friction = 0.0, 0.0
    if q > 0:
        damping += bilinear_change(numbers, ints[forms + CHANGING_DAMPING], count, size, sums, changes)
        varying = bilinear_change(numbers, ints[forms + CHANGING_VARYING], count, size, sums, changes)
        for node in range(ints[forms + NODE_COUNT]):
            weight = duration * numbers[ints[forms + WEIGHTS] + node]
            shift_coefficients(ints, numbers, forms, duration * numbers[ints[forms + NODES] + node], first, sums)
            damping += weight * quadratic_form(numbers, ints[forms + LASTING_DAMPING], count, sums)
            varying += weight * quadratic_form(numbers, ints[forms + LASTING_VARYING], count, sums)
    x, y, n = ints[CURRENT + PLACE], ints[REACHED + PLACE], r + ints[CHANNELS]
    for k in range(q):
        row = ints[level + POWER] + k * (4 * n + 1)
        constant = numbers[row + 4 * n]
        for index in range(r + q, n):
            constant += numbers[row + n + index] * numbers[x + index]
        varying += constant * (numbers[y + r + k] - numbers[x + r + k])
    if ints[level + RUBBING] >= 0:
        for i in range(n):
            friction += numbers[ints[level + RUBBING] + i] * (numbers[y + i] - numbers[x + i])
    numbers[WORKS_NOW], numbers[WORKS_NOW + 1], numbers[WORKS_NOW + 2] = damping, varying, friction
    return 1


@compiled
def list_coefficients(ints: Ints, numbers: Numbers, waves: Waves, forms: int, terms: int, result: int) -> int:
    """List the coefficients b of the present piece; return 0 where the forms lack one of its carriers, else 1."""
    q, piece = ints[PRESCRIBED], ints[PIECE_NOW]
    for i in range(ints[forms + DRIVEN_COUNT]):
        numbers[result + i] = 0.0
    for term in range(ints[piece + PIECE_TERMS]):
        powers, rate = ints[piece + TERM_INTS + 2 * term], waves[ints[piece + TERM_INTS + 2 * term + 1]]
        place, is_listed = result, 0
        for c in range(ints[forms + CARRIER_COUNT]):
            carrier = forms + CARRIERS + c * CARRIER_WIDTH
            size, parts = ints[carrier] * q, ints[carrier + 2]
            if waves[ints[carrier + 1]] == rate and ints[carrier] >= powers:
                is_listed = 1
                for k in range(powers * q):
                    numbers[place + k] = waves[terms + k].real
                    if parts == 2:
                        numbers[place + size + k] = waves[terms + k].imag
            place += parts * size
        if is_listed == 0:
            return 0
        terms += powers * q
    return 1


@compiled
def free_state(ints: Ints, numbers: Numbers, state: int, forms: int, count: int, result: int) -> None:
    """Put y of a state behind the ``count`` coefficients of u."""
    r, row = ints[ints[state + LEVEL] + MODES], ints[forms + DRIVEN_RESPONSE] if count > 0 else 0
    for part in range(2):
        source, free = ints[state + PLACE + part], result + count + part * r
        for i in range(r):
            value = numbers[source + i]
            for k in range(count):
                value -= numbers[row + k] * numbers[result + k]
            numbers[free + i] = value
            row += count


@compiled
def is_free_response_large(ints: Ints, numbers: Numbers, free: int) -> int:
    """Return 1 where |eta'|^2 + |omega eta|^2 of y is much more than twice the largest energy so far, else 0."""
    level, v, total, kinetic = ints[CURRENT + LEVEL], ints[CURRENT + SPEED], 0.0, 0.0
    r = ints[level + MODES]
    for i in range(r):
        elastic = numbers[ints[level + FREQUENCIES] + i] * numbers[free + i]
        total += numbers[free + r + i] * numbers[free + r + i] + elastic * elastic
        kinetic += numbers[v + i] * numbers[v + i]
    numbers[SWUNG] = max(numbers[SWUNG], kinetic)
    if total > LARGE_FREE_RESPONSE * numbers[SWUNG]:
        energy = potential(ints, numbers, CURRENT) + pattern_work(ints, numbers, CURRENT)
        numbers[SWUNG] = max(numbers[SWUNG], kinetic + 2.0 * abs(energy))
    return 0 if total <= LARGE_FREE_RESPONSE * numbers[SWUNG] else 1


@compiled
def damping_work(ints: Ints, numbers: Numbers, level: int, sums: int, changes: int) -> float:
    """Return (y_1 + y_0).F (y_1 - y_0) from the sum and the difference (2 r,) of y: the work of damping [J]."""
    r, form, mode_ranges, total = ints[level + MODES], ints[level + DISSIPATED], ints[level + DISSIPATED_MODES], 0.0
    for i in range(r):  # four sums that do not wait for each other
        first, second, third, fourth = 0.0, 0.0, 0.0, 0.0
        row, other = form + 2 * r * i, form + 2 * r * (r + i)
        for k in range(ints[mode_ranges + 2 * i], ints[mode_ranges + 2 * i + 1]):
            place, speed = numbers[changes + k], numbers[changes + r + k]
            first += numbers[row + k] * place
            second += numbers[row + r + k] * speed
            third += numbers[other + k] * place
            fourth += numbers[other + r + k] * speed
        total += numbers[sums + i] * (first + second) + numbers[sums + r + i] * (third + fourth)
    return total


@compiled
def bilinear_change(numbers: Numbers, rows: int, count: int, size: int, sums: int, changes: int) -> float:
    """Return the change of b.B u, B (count, size), from the sum and the difference of u."""
    total = 0.0
    for i in range(count):
        of_change, of_sum = 0.0, 0.0
        for k in range(size):
            of_change += numbers[rows + k] * numbers[changes + k]
            of_sum += numbers[rows + k] * numbers[sums + k]
        total += numbers[sums + i] * of_change + numbers[changes + i] * of_sum
        rows += size
    return 0.5 * total


@compiled
def shift_coefficients(ints: Ints, numbers: Numbers, forms: int, delay: float, source: int, result: int) -> None:
    """Put b at a delay [s] later, without the phase of its carriers, into ``result``: synthetic division."""
    q, place = ints[PRESCRIBED], result
    for i in range(ints[forms + DRIVEN_COUNT]):
        numbers[result + i] = numbers[source + i]
    for c in range(ints[forms + CARRIER_COUNT]):
        carrier = forms + CARRIERS + c * CARRIER_WIDTH
        for _ in range(ints[carrier + 2]):
            for lowest in range(ints[carrier] - 1):
                for d in range(ints[carrier] - 2, lowest - 1, -1):
                    for k in range(q):
                        numbers[place + d * q + k] += delay * numbers[place + (d + 1) * q + k]
            place += ints[carrier] * q


@compiled
def quadratic_form(numbers: Numbers, form: int, count: int, source: int) -> float:
    """Return b.Z b, Z (count, count)."""
    total = 0.0
    for i in range(count):
        row_sum = 0.0
        for k in range(count):
            row_sum += numbers[form + i * count + k] * numbers[source + k]
        total += numbers[source + i] * row_sum
    return total
