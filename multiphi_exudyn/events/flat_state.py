"""States, signals and maps between levels in flat arrays (arrays.py): what the event rule reads.

    eta'' = motion . (xi, xi', 1),   s = row . (xi, xi', 1),   xi_m = T xi_l + c,   xi'_m = T' xi'_l

A sum is judged by the sizes of its own terms (round_off.py), to which belong how far the speeds carry the modes,
|eta'| / omega, and how fast the displacements make them, omega |eta|.
"""

from __future__ import annotations

from multiphi_exudyn.events.arrays import (
    ACCELERATION,
    CARRIED,
    CHANNELS,
    DAMPING,
    DRIVE,
    ELEMENTS,
    FREQUENCIES,
    GAPS,
    KINDS,
    KINETIC,
    LEVEL,
    LEVEL_SLOTS,
    LEVELS,
    MAP_ENTRY,
    MAP_SLOTS,
    MAPS,
    MATRIX,
    MODES,
    MOTION,
    NEED,
    NEED_LEVEL,
    NEED_MAP,
    NEEDED,
    NEEDED_FROM,
    NEEDED_KEY,
    OFFSET,
    PATTERNS,
    PERIODS,
    PHASES,
    PLACE,
    POTENTIAL,
    RATE_MATRIX,
    RATE_OFFSET,
    RATED,
    REACH,
    ROW,
    SETTLED,
    SPEED,
    STATES,
    STIFFNESSES,
    STRAIN,
    SWING,
    VISCOUS,
)
from multiphi_exudyn.mathematics.compiled import Ints, Numbers, compiled
from multiphi_exudyn.mathematics.round_off import ZERO

__all__ = [
    "accelerate",
    "acceleration_sizes",
    "copy_state",
    "find_level",
    "find_map",
    "gap",
    "kinetic",
    "level_hash",
    "lose",
    "map_hash",
    "measure",
    "move",
    "pattern_work",
    "potential",
    "rate_sign",
    "row_sign",
    "same_level",
    "sign_of",
]

HASH_MODULUS = 1_000_003  # of keys: products of it with small numbers stay far below 2^63


@compiled
def sign_of(value: float, size: float) -> int:
    """Sign of a sum, zero where it is round-off of its terms, which add up to ``size`` without their signs."""
    if abs(value) <= ZERO * size:
        return 0
    return 1 if value > 0.0 else -1


# ---------------------------------------------------------------------- tables


@compiled
def level_hash(ints: Ints, key: int) -> int:
    """A number made of a key (c,)."""
    value = 0
    for i in range(ints[ELEMENTS]):
        value = (31 * value + ints[key + i] + 1) % HASH_MODULUS
    return value


@compiled
def map_hash(source: int, target: int) -> int:
    """A number made of two levels."""
    return (source % HASH_MODULUS * 31 + target) % HASH_MODULUS


@compiled
def find_level(ints: Ints, key: int) -> int:
    """The level with a key (c,); NEED where it has not been packed."""
    c, slots = ints[ELEMENTS], ints[LEVEL_SLOTS]
    slot = level_hash(ints, key) % slots
    while ints[ints[LEVELS] + slot] != 0:
        level = ints[ints[LEVELS] + slot]
        states = ints[level + STATES]
        i = 0
        while i < c and ints[states + i] == ints[key + i]:
            i += 1
        if i == c:
            return level
        slot = (slot + 1) % slots
    ints[NEEDED] = NEED_LEVEL
    for i in range(c):
        ints[ints[NEEDED_KEY] + i] = ints[key + i]
    return NEED


@compiled
def find_map(ints: Ints, source: int, target: int) -> int:
    """The map between two levels; NEED where it has not been packed."""
    slots = ints[MAP_SLOTS]
    slot = map_hash(source, target) % slots
    while True:
        entry = ints[MAPS] + MAP_ENTRY * slot
        if ints[entry] == 0:
            break
        if ints[entry] == source and ints[entry + 1] == target:
            return ints[entry + 2]
        slot = (slot + 1) % slots
    ints[NEEDED] = NEED_MAP
    ints[NEEDED_FROM] = source
    for i in range(ints[ELEMENTS]):
        ints[ints[NEEDED_KEY] + i] = ints[ints[target + STATES] + i]
    return NEED


# ---------------------------------------------------------------------- states


@compiled
def same_level(ints: Ints, one: int, other: int) -> int:
    """1 where two states are of the same level."""
    return 1 if ints[one + LEVEL] == ints[other + LEVEL] else 0


@compiled
def copy_state(ints: Ints, numbers: Numbers, given: int, result: int) -> None:
    """A copy of a state, phases included."""
    ints[result + LEVEL] = ints[given + LEVEL]
    ints[result + SETTLED] = ints[given + SETTLED]
    n = ints[ints[given + LEVEL] + MODES] + ints[CHANNELS]
    for part in range(PLACE, SWING + 1):
        start, end = ints[given + part], ints[result + part]
        for i in range(n):
            numbers[end + i] = numbers[start + i]
    for i in range(ints[ELEMENTS]):
        ints[ints[result + PHASES] + i] = ints[ints[given + PHASES] + i]


@compiled
def measure(ints: Ints, numbers: Numbers, state: int) -> None:
    """Scales of a state: |eta'| / omega and omega |eta|, for channels the sizes of the terms of w and w'."""
    level, x, v = ints[state + LEVEL], ints[state + PLACE], ints[state + SPEED]
    r, q, reach, swing = ints[level + MODES], ints[CHANNELS], ints[state + REACH], ints[state + SWING]
    for i in range(r):
        numbers[reach + i] = abs(numbers[v + i]) * numbers[ints[level + PERIODS] + i]
        numbers[swing + i] = abs(numbers[x + i]) * numbers[ints[level + FREQUENCIES] + i]
    sizes = ints[DRIVE] + 3 * q
    for k in range(q):
        numbers[reach + r + k] = numbers[sizes + k]
        numbers[swing + r + k] = numbers[sizes + q + k]


@compiled
def accelerate(ints: Ints, numbers: Numbers, state: int, result: int) -> None:
    """xi'' (n,)."""
    level, x, v = ints[state + LEVEL], ints[state + PLACE], ints[state + SPEED]
    r, q = ints[level + MODES], ints[CHANNELS]
    n = r + q
    row = ints[level + MOTION]
    for i in range(r):
        total = numbers[row + 2 * n]
        for j in range(n):
            total += numbers[row + j] * numbers[x + j] + numbers[row + n + j] * numbers[v + j]
        numbers[result + i] = total
        row += 2 * n + 1
    for k in range(q):
        numbers[result + r + k] = numbers[ints[DRIVE] + 2 * q + k]


@compiled
def acceleration_sizes(ints: Ints, numbers: Numbers, state: int, result: int) -> None:
    """Of which terms (n,) the accelerations are the sums, and omega |eta'|, how large the velocities make them."""
    level, x, v = ints[state + LEVEL], ints[state + PLACE], ints[state + SPEED]
    r, q, sizes = ints[level + MODES], ints[CHANNELS], ints[DRIVE] + 3 * ints[CHANNELS]
    n = r + q
    row = ints[level + MOTION]
    for i in range(r):
        total = abs(numbers[row + 2 * n]) + numbers[ints[level + FREQUENCIES] + i] * abs(numbers[v + i])
        for j in range(r):
            total += abs(numbers[row + j] * numbers[x + j]) + abs(numbers[row + n + j] * numbers[v + j])
        for k in range(q):
            total += abs(numbers[row + r + k]) * numbers[sizes + k]
            total += abs(numbers[row + n + r + k]) * numbers[sizes + q + k]
        numbers[result + i] = total
        row += 2 * n + 1
    for k in range(q):
        numbers[result + r + k] = numbers[sizes + 2 * q + k]


# ---------------------------------------------------------------------- signals


@compiled
def row_sign(ints: Ints, numbers: Numbers, state: int, signal: int) -> int:
    """Sign of a signal, zero where it is round-off of its terms.

    At the root of a signal all displacements may be round-off of what they were before: |eta'| / omega counts too.
    """
    n, row = ints[ints[state + LEVEL] + MODES] + ints[CHANNELS], ints[signal + ROW]
    x, v, reach = ints[state + PLACE], ints[state + SPEED], ints[state + REACH]
    value = numbers[row + 2 * n]
    size = abs(value)
    for i in range(n):
        term = numbers[row + i] * numbers[x + i] + numbers[row + n + i] * numbers[v + i]
        value += term
        size += abs(term) + abs(numbers[row + i]) * numbers[reach + i]
    return sign_of(value, size)


@compiled
def rate_sign(ints: Ints, numbers: Numbers, state: int, signal: int) -> int:
    """Sign of a signal's time derivative, zero where it is round-off of its terms.

    At a turning point all velocities may be round-off of what they were before: omega |eta| counts too.
    """
    n, row = ints[ints[state + LEVEL] + MODES] + ints[CHANNELS], ints[signal + ROW]
    v, swing, accelerations = ints[state + SPEED], ints[state + SWING], ints[ACCELERATION]
    if ints[signal + RATED] == 1:
        accelerate(ints, numbers, state, accelerations)
    value, size = 0.0, 0.0
    for i in range(n):
        term = numbers[row + i] * numbers[v + i]
        if ints[signal + RATED] == 1:
            term += numbers[row + n + i] * numbers[accelerations + i]
        value += term
        size += abs(term) + abs(numbers[row + i]) * numbers[swing + i]
    return sign_of(value, size)


@compiled
def gap(ints: Ints, numbers: Numbers, state: int, element: int) -> float:
    """Gap of a contact [m]."""
    level, x = ints[state + LEVEL], ints[state + PLACE]
    n = ints[level + MODES] + ints[CHANNELS]
    row = ints[level + GAPS] + element * (n + 1)
    value = numbers[row + n]
    for i in range(n):
        value += numbers[row + i] * numbers[x + i]
    return value


# ---------------------------------------------------------------------- energies


@compiled
def kinetic(ints: Ints, numbers: Numbers, state: int) -> float:
    """Kinetic energy [J]: |Psi eta' + Y w'|^2 / 2."""
    level, v = ints[state + LEVEL], ints[state + SPEED]
    r, q, row = ints[level + MODES], ints[CHANNELS], ints[level + CARRIED]
    total = 0.0
    for i in range(r):
        total += 0.5 * numbers[v + i] * numbers[v + i]
    if row >= 0:
        for k in range(q):
            for i in range(r):
                total += numbers[row + i] * numbers[v + i] * numbers[v + r + k]
            for j in range(q):
                total += 0.5 * numbers[row + r + j] * numbers[v + r + j] * numbers[v + r + k]
            row += r + q
    return total


@compiled
def potential(ints: Ints, numbers: Numbers, state: int) -> float:
    """Strain energy less the potential of the loads [J]."""
    level, x = ints[state + LEVEL], ints[state + PLACE]
    r, q, form = ints[level + MODES], ints[CHANNELS], ints[level + POTENTIAL]
    n = r + q
    total = numbers[form]
    for i in range(n):
        total += numbers[form + 1 + i] * numbers[x + i]
    for i in range(r):
        total += 0.5 * numbers[form + 1 + n + i] * numbers[x + i] * numbers[x + i]
    row = form + 1 + n + r
    for k in range(q):
        for i in range(r):
            total += numbers[row + i] * numbers[x + i] * numbers[x + r + k]
        for j in range(q):
            total += 0.5 * numbers[row + r + j] * numbers[x + r + j] * numbers[x + r + k]
        row += n
    return total


@compiled
def pattern_work(ints: Ints, numbers: Numbers, state: int) -> float:
    """Potential [J] that the varying loads have at their present values: (b w) . y."""
    level, x = ints[state + LEVEL], ints[state + PLACE]
    r, q, row = ints[level + MODES], ints[CHANNELS], ints[level + PATTERNS]
    total = 0.0
    for k in range(q):
        value = numbers[row + r + q]
        for i in range(r + q):
            value += numbers[row + i] * numbers[x + i]
        total += value * numbers[x + r + k]
        row += r + q + 1
    return total


@compiled
def lose(ints: Ints, numbers: Numbers, before: int, after: int, collided: float, losses: int) -> None:
    """Add what is lost between two states of one instant to losses (5,), less the energy ``collided`` in an impact.

    Viscous contacts that open inside their stop lose what their springs hold, those that close there bring it back.
    """
    relaxed = 0.0
    states, later = ints[ints[before + LEVEL] + STATES], ints[ints[after + LEVEL] + STATES]
    for i in range(ints[ELEMENTS]):
        if ints[ints[KINDS] + i] == VISCOUS and ints[states + i] != ints[later + i]:
            depth = gap(ints, numbers, before, i)
            stored = 0.5 * numbers[ints[STIFFNESSES] + i] * depth * depth
            relaxed += stored if ints[states + i] > ints[later + i] else -stored
    numbers[losses + KINETIC] += kinetic(ints, numbers, before) - kinetic(ints, numbers, after) - collided
    numbers[losses + STRAIN] += potential(ints, numbers, before) - potential(ints, numbers, after) - relaxed
    numbers[losses + DAMPING] += relaxed


# ---------------------------------------------------------------------- maps


@compiled
def move_part(ints: Ints, numbers: Numbers, way: int, rates: int, given: int, target: int, n: int, result: int) -> None:
    """xi (rates 0) or xi' (rates 1) of a level with n coordinates in level ``target``."""
    matrix, offset = ints[way + MATRIX], ints[way + OFFSET]
    if rates == 1:
        matrix, offset = ints[way + RATE_MATRIX], ints[way + RATE_OFFSET]
    for i in range(ints[target + MODES] + ints[CHANNELS]):
        total = numbers[offset + i] if offset >= 0 else 0.0
        row = matrix + i * n
        for j in range(n):
            total += numbers[row + j] * numbers[given + j]
        numbers[result + i] = total


@compiled
def move(ints: Ints, numbers: Numbers, places: int, speeds: int, level: int, result: int) -> int:
    """xi of the state ``places`` and xi' of ``speeds``, of the same instant, as a state of a level; OK or NEED."""
    here, there = ints[places + LEVEL], ints[speeds + LEVEL]
    way = find_map(ints, here, level)
    if way < 0:
        return way
    channels, x, v = ints[CHANNELS], ints[result + PLACE], ints[result + SPEED]
    move_part(ints, numbers, way, 0, ints[places + PLACE], level, ints[here + MODES] + channels, x)
    if there != here:
        way = find_map(ints, there, level)
        if way < 0:
            return way
    move_part(ints, numbers, way, 1, ints[speeds + SPEED], level, ints[there + MODES] + channels, v)
    ints[result + LEVEL] = level
    measure(ints, numbers, result)
    return 0
