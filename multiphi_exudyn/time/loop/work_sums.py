"""Works of a segment as it ends, by what the primitives of its powers have changed by (events/work_forms.py).

    damping   y.F y + Re(a.R y) + Re(a.P a + a.P~ conj(a)) / 2
    varying   the same without F, and what is constant in it times what w has changed by
    friction  its constant forces times what xi has changed by

y = (eta, eta') less what channels force, at the segment's two ends. A segment without primitives, or in which y is much
larger than the motion, is left out: work.py integrates it when its works are asked for.
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

__all__ = ["INFLATED", "dissipated", "work_of_segment"]

INFLATED = 100.0  # times the largest energy of the motion, that of a free response: so much their difference loses


@compiled
def work_of_segment(ints: Ints, numbers: Numbers, waves: Waves, duration: float) -> int:
    """Works [J] of the segment from CURRENT to REACHED, into WORKS_NOW (3,); 1, or 0 where it is left out."""
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
    if q > 0 and is_inflated(ints, numbers, first + count) == 1:
        return 0
    for i in range(size):
        numbers[sums + i] = numbers[first + size + i] + numbers[first + i]
        numbers[changes + i] = numbers[first + size + i] - numbers[first + i]
    damping = dissipated(ints, numbers, level, sums + count, changes + count)
    varying, friction = 0.0, 0.0
    if q > 0:
        damping += changed(numbers, ints[forms + CHANGING_DAMPING], count, size, sums, changes)
        varying = changed(numbers, ints[forms + CHANGING_VARYING], count, size, sums, changes)
        for node in range(ints[forms + NODE_COUNT]):
            weight = duration * numbers[ints[forms + WEIGHTS] + node]
            shift(ints, numbers, forms, duration * numbers[ints[forms + NODES] + node], first, sums)
            damping += weight * squared(numbers, ints[forms + LASTING_DAMPING], count, sums)
            varying += weight * squared(numbers, ints[forms + LASTING_VARYING], count, sums)
    x, y, n = ints[CURRENT + PLACE], ints[REACHED + PLACE], r + ints[CHANNELS]
    for k in range(q):
        row = ints[level + POWER] + k * (4 * n + 1)
        constant = numbers[row + 4 * n]
        for held in range(r + q, n):
            constant += numbers[row + n + held] * numbers[x + held]
        varying += constant * (numbers[y + r + k] - numbers[x + r + k])
    if ints[level + RUBBING] >= 0:
        for i in range(n):
            friction += numbers[ints[level + RUBBING] + i] * (numbers[y + i] - numbers[x + i])
    numbers[WORKS_NOW], numbers[WORKS_NOW + 1], numbers[WORKS_NOW + 2] = damping, varying, friction
    return 1


@compiled
def list_coefficients(ints: Ints, numbers: Numbers, waves: Waves, forms: int, terms: int, result: int) -> int:
    """b of the present piece's terms; 0 where they are of other carriers than the forms, else 1."""
    q, piece = ints[PRESCRIBED], ints[PIECE_NOW]
    for i in range(ints[forms + DRIVEN_COUNT]):
        numbers[result + i] = 0.0
    for term in range(ints[piece + PIECE_TERMS]):
        wanted, rate = ints[piece + TERM_INTS + 2 * term], waves[ints[piece + TERM_INTS + 2 * term + 1]]
        place, found = result, 0
        for c in range(ints[forms + CARRIER_COUNT]):
            carrier = forms + CARRIERS + c * CARRIER_WIDTH
            size, parts = ints[carrier] * q, ints[carrier + 2]
            if waves[ints[carrier + 1]] == rate and ints[carrier] >= wanted:
                found = 1
                for k in range(wanted * q):
                    numbers[place + k] = waves[terms + k].real
                    if parts == 2:
                        numbers[place + size + k] = waves[terms + k].imag
            place += parts * size
        if found == 0:
            return 0
        terms += wanted * q
    return 1


@compiled
def free_state(ints: Ints, numbers: Numbers, state: int, forms: int, count: int, result: int) -> None:
    """y behind the ``count`` coefficients of u."""
    r, row = ints[ints[state + LEVEL] + MODES], ints[forms + DRIVEN_RESPONSE] if count > 0 else 0
    for part in range(2):
        given, free = ints[state + PLACE + part], result + count + part * r
        for i in range(r):
            value = numbers[given + i]
            for k in range(count):
                value -= numbers[row + k] * numbers[result + k]
            numbers[free + i] = value
            row += count


@compiled
def is_inflated(ints: Ints, numbers: Numbers, free: int) -> int:
    """1 where |eta'|^2 + |omega eta|^2 of y is much more than twice the largest energy so far."""
    level, v, total, moving = ints[CURRENT + LEVEL], ints[CURRENT + SPEED], 0.0, 0.0
    r = ints[level + MODES]
    for i in range(r):
        swing = numbers[ints[level + FREQUENCIES] + i] * numbers[free + i]
        total += numbers[free + r + i] * numbers[free + r + i] + swing * swing
        moving += numbers[v + i] * numbers[v + i]
    numbers[SWUNG] = max(numbers[SWUNG], moving)
    if total > INFLATED * numbers[SWUNG]:
        energy = potential(ints, numbers, CURRENT) + pattern_work(ints, numbers, CURRENT)
        numbers[SWUNG] = max(numbers[SWUNG], moving + 2.0 * abs(energy))
    return 0 if total <= INFLATED * numbers[SWUNG] else 1


@compiled
def dissipated(ints: Ints, numbers: Numbers, level: int, sums: int, changes: int) -> float:
    """(y_1 + y_0).F (y_1 - y_0) of (2 r,), from the sum and the difference."""
    r, form, reached, total = ints[level + MODES], ints[level + DISSIPATED], ints[level + DISSIPATED_MODES], 0.0
    for i in range(r):  # four sums that do not wait for each other
        first, second, third, fourth = 0.0, 0.0, 0.0, 0.0
        row, other = form + 2 * r * i, form + 2 * r * (r + i)
        for k in range(ints[reached + 2 * i], ints[reached + 2 * i + 1]):
            place, speed = numbers[changes + k], numbers[changes + r + k]
            first += numbers[row + k] * place
            second += numbers[row + r + k] * speed
            third += numbers[other + k] * place
            fourth += numbers[other + r + k] * speed
        total += numbers[sums + i] * (first + second) + numbers[sums + r + i] * (third + fourth)
    return total


@compiled
def changed(numbers: Numbers, rows: int, count: int, size: int, sums: int, changes: int) -> float:
    """What b.B u changes by, B (count, size), from the sum and the difference of u."""
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
def shift(ints: Ints, numbers: Numbers, forms: int, delay: float, given: int, result: int) -> None:
    """b as it is a delay [s] later, but for what its carriers turn by: synthetic division."""
    q, place = ints[PRESCRIBED], result
    for i in range(ints[forms + DRIVEN_COUNT]):
        numbers[result + i] = numbers[given + i]
    for c in range(ints[forms + CARRIER_COUNT]):
        carrier = forms + CARRIERS + c * CARRIER_WIDTH
        for _ in range(ints[carrier + 2]):
            for lowest in range(ints[carrier] - 1):
                for d in range(ints[carrier] - 2, lowest - 1, -1):
                    for k in range(q):
                        numbers[place + d * q + k] += delay * numbers[place + (d + 1) * q + k]
            place += ints[carrier] * q


@compiled
def squared(numbers: Numbers, form: int, count: int, given: int) -> float:
    """b.Z b, Z (count, count)."""
    total = 0.0
    for i in range(count):
        part = 0.0
        for k in range(count):
            part += numbers[form + i * count + k] * numbers[given + k]
        total += numbers[given + i] * part
    return total
