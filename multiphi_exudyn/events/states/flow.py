"""Flow in flat arrays: the motion from a state, within one piece of every channel.

    xi(t) = Re V (c phi(t)) + Re sum_j exp(mu_j t) sum_k x_jk (t/T)^k

xi = (eta, w); phi the p exponentials of the free response, x (n,) the forced response to the channels' pieces and these
themselves, T the horizon, a power of two. The scratch memory of the flow holds its basis, the coefficients c of its
exponentials (one for each x), the sizes of their terms, and the x.
"""

from __future__ import annotations

from multiphi_exudyn.events.arrays import (
    CHANNELS,
    FLOW_BASIS,
    FLOW_COUNT,
    FLOW_FORCED,
    FLOW_FREE,
    FLOW_FROM,
    FLOW_RECORD,
    FLOW_STATE,
    FLOW_WAVES,
    FORCE,
    FORCED,
    FORCED_ROOM,
    FORCED_WANTED,
    FORCED_WORK,
    FORCES,
    HORIZON,
    LEVEL,
    MODES,
    MOTION,
    PIECE_NOW,
    PIECE_TERMS,
    PLACE,
    PRESCRIBED,
    REACH,
    RESPONSE,
    SCALED_TERM,
    SET_SIZES,
    SPEED,
    SWING,
    TERM_INTS,
    TERMS_NOW,
    WORK_WAVES,
)
from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, Waves, compiled
from multiphi_exudyn.mathematics.response.basis_arrays import (
    POWERS,
    PURE,
    RATES,
    SCALES,
    SIZE,
    describe_basis,
    differentiate,
    exponentials,
    magnitude,
)
from multiphi_exudyn.mathematics.response.forced_arrays import forced_response
from multiphi_exudyn.mathematics.response.response_arrays import (
    FREE,
    REACHED,
    SHAPES,
    coefficients_of,
)

__all__ = ["expand", "next_state", "scale_by_terms", "state_at", "unit_of_flow"]


@compiled
def expand(ints: Ints, numbers: Numbers, waves: Waves, state: int) -> None:
    """Compute the flow from a state."""
    level, c, x, v = ints[state + LEVEL], ints[FLOW_WAVES], ints[state + PLACE], ints[state + SPEED]
    response, force = ints[level + RESPONSE], ints[level + FORCE]
    p = ints[ints[response + FREE] + SIZE]
    ints[FLOW_FROM] = state
    ints[FLOW_FREE], ints[FLOW_COUNT], ints[FLOW_BASIS] = p, p, ints[response + FREE]
    if ints[PRESCRIBED] > 0:
        r = ints[level + MODES]
        force_flow(ints, numbers, waves, state)
        x, v = ints[FLOW_STATE], ints[FLOW_STATE] + r
    if force >= 0 and ints[CHANNELS] > ints[PRESCRIBED]:
        drive_free_modes(ints, numbers, state)
    coefficients_of(ints, numbers, waves, response, x, v, force, c)
    for j in range(p if ints[ints[response + FREE] + PURE] == 0 else 0):
        waves[c + j] *= unit_of_flow(ints, numbers, ints[response + FREE], j)


@compiled
def drive_free_modes(ints: Ints, numbers: Numbers, state: int) -> None:
    """Set the force on zero-frequency modes of a level: that of static loads, and of held channels at their values."""
    level, x = ints[state + LEVEL], ints[state + PLACE]
    r, row = ints[level + MODES], ints[level + MOTION]
    n = r + ints[CHANNELS]
    for i in range(r):
        total = numbers[row + 2 * n]
        for k in range(r + ints[PRESCRIBED], n):
            total += numbers[row + k] * numbers[x + k]
        numbers[ints[level + FORCE] + i] = total
        row += 2 * n + 1


@compiled
def unit_of_flow(ints: Ints, numbers: Numbers, basis: int, j: int) -> float:
    """Return the factor from a coefficient on the basis of the free response to that of the flow."""
    ratio, unit = numbers[ints[ints[FLOW_BASIS] + SCALES]] / numbers[ints[basis + SCALES]], 1.0
    for _ in range(ints[ints[basis + POWERS] + j]):
        unit *= ratio
    return unit


@compiled
def force_flow(ints: Ints, numbers: Numbers, waves: Waves, state: int) -> None:
    """Compute the response to the channels' terms, with these terms, as x_k of the flow, and its basis.

    FLOW_STATE becomes eta and eta' at the start without the forced response (2, r). If there is too little memory for
    the powers of a response, FORCED_WANTED is set to their number.
    """
    level, q, horizon = ints[state + LEVEL], ints[PRESCRIBED], numbers[HORIZON]
    r, free, given, moved = ints[level + MODES], ints[FLOW_FREE], ints[PIECE_NOW], ints[TERMS_NOW]
    own, record, most = ints[FLOW_STATE], ints[FLOW_RECORD], ints[FORCED_ROOM]
    basis = ints[FLOW_BASIS]
    for i in range(r):
        numbers[own + i] = numbers[ints[state + PLACE] + i]
        numbers[own + r + i] = numbers[ints[state + SPEED] + i]
    count, powers = free, 0
    for term in range(ints[given + PIECE_TERMS]):
        degree, carrier = ints[given + TERM_INTS + 2 * term] - 1, ints[given + TERM_INTS + 2 * term + 1]
        force_modes(ints, numbers, waves, level, carrier, moved, degree)
        rows = forced_response(
            ints, numbers, waves, ints[level + RESPONSE], carrier, ints[FORCES], degree, horizon,
            ints[state + PLACE], ints[state + SPEED], most, ints[FORCED_WORK], ints[FORCED],
        )  # fmt: skip
        if rows > most:
            ints[FORCED_WANTED] = max(ints[FORCED_WANTED], rows)
            rows = most
        powers = max(powers, max(rows, degree + 1) - 1)
        add_forced(ints, numbers, waves, level, carrier, degree, rows, count)
        count += max(rows, degree + 1)
        moved += (degree + 1) * q
    for j in range(free):
        ints[ints[record + POWERS] + j] = ints[ints[basis + POWERS] + j]
        waves[ints[record + RATES] + j] = waves[ints[basis + RATES] + j]
    ints[record + SIZE] = count
    numbers[ints[record + SCALES]] = horizon if powers > 0 else numbers[ints[basis + SCALES]]
    describe_basis(ints, numbers, waves, record)
    ints[FLOW_COUNT], ints[FLOW_BASIS] = count, record


@compiled
def force_modes(ints: Ints, numbers: Numbers, waves: Waves, level: int, carrier: int, moved: int, degree: int) -> None:
    """Write a term in powers of t / T, and its modal forces P w + Q w' (degree + 1, r)."""
    r, q, horizon, rate = ints[level + MODES], ints[PRESCRIBED], numbers[HORIZON], waves[carrier]
    n, scale, scaled = r + ints[CHANNELS], 1.0, ints[SCALED_TERM]
    for d in range(degree + 1):
        for k in range(q):
            waves[scaled + d * q + k] = waves[moved + d * q + k] * scale
        scale *= horizon
    for d in range(degree + 1):
        forces = ints[FORCES] + d * r
        for i in range(r):
            waves[forces + i] = 0j
        for k in range(q):
            row, value = ints[level + MOTION] + r + k, waves[scaled + d * q + k]
            slope = rate * value
            if d < degree:
                slope += (d + 1) / horizon * waves[scaled + (d + 1) * q + k]
            for i in range(r):
                waves[forces + i] += numbers[row] * value + numbers[row + n] * slope
                row += 2 * n + 1


@compiled
def add_forced(
    ints: Ints,
    numbers: Numbers,
    waves: Waves,
    level: int,
    carrier: int,
    degree: int,
    rows: int,
    count: int,
) -> None:
    """Append the response (rows, r) to a term, and the term itself, behind ``count`` exponentials."""
    r, q, record, own = ints[level + MODES], ints[PRESCRIBED], ints[FLOW_RECORD], ints[FLOW_STATE]
    n, rate = r + q, waves[carrier]
    for k in range(max(rows, degree + 1)):
        j = count + k
        x = ints[FLOW_FORCED] + (j - ints[FLOW_FREE]) * n
        for i in range(r):
            waves[x + i] = waves[ints[FORCED] + k * r + i] if k < rows else 0j
        for i in range(q):
            waves[x + r + i] = waves[ints[SCALED_TERM] + k * q + i] if k <= degree else 0j
        ints[ints[record + POWERS] + j] = k
        waves[ints[record + RATES] + j] = rate
        waves[ints[FLOW_WAVES] + j] = 1.0 + 0j
    for i in range(r):
        value = waves[ints[FORCED] + i]
        slope = rate * value
        if rows > 1:
            slope += 1.0 / numbers[HORIZON] * waves[ints[FORCED] + r + i]
        numbers[own + i] -= value.real
        numbers[own + r + i] -= slope.real


@compiled
def state_at(ints: Ints, numbers: Numbers, waves: Waves, level: int, t: float, x: int, v: int) -> None:
    """Compute xi, xi' of the flow at a time t after its state; held channels keep their values."""
    basis, phi = ints[FLOW_BASIS], ints[WORK_WAVES]
    exponentials(ints, numbers, waves, basis, t, t, phi)
    differentiate(ints, numbers, waves, basis, ints[FLOW_WAVES], phi + ints[FLOW_COUNT])
    sum_flow(ints, numbers, waves, level, x, v)


@compiled
def next_state(ints: Ints, numbers: Numbers, waves: Waves, level: int, step: float, again: int, x: int, v: int) -> None:
    """Compute the state a step [s] after that of the last call; again: 1 if the last call made the same step.

    For a flow without powers of time the exponentials are multiplied by those of the step.
    """
    basis, phi, p = ints[FLOW_BASIS], ints[WORK_WAVES], ints[FLOW_COUNT]
    if again == 0:
        exponentials(ints, numbers, waves, basis, step, step, phi + 2 * p)
    for j in range(p):
        waves[phi + j] *= waves[phi + 2 * p + j]
    sum_flow(ints, numbers, waves, level, x, v)


@compiled
def sum_flow(ints: Ints, numbers: Numbers, waves: Waves, level: int, x: int, v: int) -> None:
    """Sum xi, xi' from the exponentials at a time, and the coefficients of their derivatives."""
    r, basis, response = ints[level + MODES], ints[FLOW_BASIS], ints[level + RESPONSE]
    n, free, count, c = r + ints[PRESCRIBED], ints[FLOW_FREE], ints[FLOW_COUNT], ints[FLOW_WAVES]
    phi, rate = ints[WORK_WAVES], ints[WORK_WAVES] + ints[FLOW_COUNT]
    for i in range(r + ints[CHANNELS]):
        numbers[x + i] = 0.0 if i < n else numbers[ints[ints[FLOW_FROM] + PLACE] + i]
        numbers[v + i] = 0.0
    for j in range(count):
        value, slope = waves[c + j] * waves[phi + j], waves[rate + j] * waves[phi + j]
        first, end, row = 0, n, ints[FLOW_FORCED] + (j - free) * n
        if j < free:
            first, end = ints[ints[response + REACHED] + 2 * j], ints[ints[response + REACHED] + 2 * j + 1]
            row = ints[response + SHAPES] + j * r
        else:  # every power has an x of its own
            slope = waves[ints[basis + RATES] + j] * value
            if ints[ints[basis + POWERS] + j] > 0:
                slope += ints[ints[basis + POWERS] + j] / numbers[ints[basis + SCALES]] * waves[phi + j - 1]
        for i in range(first, end):
            numbers[x + i] += (waves[row + i] * value).real
            numbers[v + i] += (waves[row + i] * slope).real


@compiled
def scale_by_terms(ints: Ints, numbers: Numbers, waves: Waves, state: int) -> None:
    """Raise the scales of a state to the sizes of the terms of which the last ``state_at`` has summed it.

    They say more than |eta'| / omega and omega |eta| where a mode has no frequency, and where a forced response cancels
    a free one.
    """
    level = ints[state + LEVEL]
    r, basis, response = ints[level + MODES], ints[FLOW_BASIS], ints[level + RESPONSE]
    n, free, count, c = r + ints[PRESCRIBED], ints[FLOW_FREE], ints[FLOW_COUNT], ints[FLOW_WAVES]
    phi, places, speeds = ints[WORK_WAVES], ints[SET_SIZES], ints[SET_SIZES] + r
    for i in range(2 * r):
        numbers[places + i] = 0.0
    for j in range(count):
        size = magnitude(waves, c + j)
        value = size * magnitude(waves, phi + j)
        slope = magnitude(waves, ints[basis + RATES] + j) * value
        if ints[ints[basis + POWERS] + j] > 0:
            power = ints[ints[basis + POWERS] + j] / numbers[ints[basis + SCALES]]
            slope += power * size * magnitude(waves, phi + j - 1)
        first, end, row = 0, r, ints[FLOW_FORCED] + (j - free) * n
        if j < free:
            first, end = ints[ints[response + REACHED] + 2 * j], ints[ints[response + REACHED] + 2 * j + 1]
            row = ints[response + SHAPES] + j * r
        for i in range(first, end):
            shape = magnitude(waves, row + i)
            numbers[places + i] += shape * value
            numbers[speeds + i] += shape * slope
    for i in range(r):
        numbers[ints[state + REACH] + i] = max(numbers[ints[state + REACH] + i], numbers[places + i])
        numbers[ints[state + SWING] + i] = max(numbers[ints[state + SWING] + i], numbers[speeds + i])
