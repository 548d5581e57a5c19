"""Record of the loop: segments, events, and the check of the last decisions for chatter."""

from __future__ import annotations

from multiphi_exudyn.events.arrays import (
    AGE,
    ALLOWED,
    BY_IMPACT,
    CHANGE_COUNT,
    CHANGE_IMPULSES,
    CHANGE_WIDTH,
    CHANGES,
    CHANNELS,
    COORDINATE_COUNT,
    COORDINATE_NUMBERS,
    CURRENT,
    DAMPING,
    DECISIONS,
    DRIVEN_WIDTH,
    EVENT_COUNT,
    EVENT_INTS,
    EVENT_NUMBERS,
    EVENT_WIDTH,
    EVENT_WIDTH_NUMBERS,
    EXIT_COUNT,
    FRICTION,
    IMPACT_COUNT,
    IMPACT_INTS,
    IMPACT_NUMBERS,
    IMPACT_WIDTH,
    INSTANT_TIME,
    INSTANTS,
    KINETIC,
    LEFT_OUT,
    LEFT_OUT_COUNT,
    LEVEL,
    LOSSES,
    LOST,
    LOST_SO_FAR,
    MODES,
    NUMBER,
    PHASE_COUNT,
    PHASE_INTS,
    PHASES,
    PIECE,
    PLACE,
    PRESCRIBED,
    RING,
    SEGMENT_COUNT,
    SEGMENT_INTS,
    SEGMENT_WIDTH,
    SETTLED,
    SHARED,
    SPEED,
    STOP_WORK,
    STRAIN,
    SUMMED,
    TIME,
    TOLD,
    TRUNCATED,
    WINDOW,
    WORK,
    WORKS,
    WORKS_NOW,
)
from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, compiled

__all__ = ["ACCUMULATED", "is_chatter", "keep_events", "keep_segment"]

ACCUMULATED = 1e-6  # of the time so far: a window of events within it is chatter, also where no mode oscillates


@compiled
def keep_segment(ints: Ints, numbers: Numbers, armed_at: float, horizon: float) -> None:
    """Record the segment from CURRENT to the instant, which becomes the present time."""
    k, level = ints[SEGMENT_COUNT], ints[CURRENT + LEVEL]
    n, row = ints[level + MODES] + ints[CHANNELS], ints[SEGMENT_INTS] + k * SEGMENT_WIDTH
    ints[row] = ints[level + NUMBER]
    ints[row + 1] = ints[PIECE]
    ints[row + 2] = ints[COORDINATE_COUNT]
    ints[row + 3] = -1
    numbers[ints[INSTANTS] + k] = numbers[TIME]
    numbers[ints[INSTANTS] + k + 1] = numbers[INSTANT_TIME]
    place = ints[COORDINATE_NUMBERS] + ints[COORDINATE_COUNT]
    for i in range(n):
        numbers[place + i] = numbers[ints[CURRENT + PLACE] + i]
        numbers[place + n + i] = numbers[ints[CURRENT + SPEED] + i]
    place += 2 * n
    if ints[PRESCRIBED] > 0:
        numbers[place] = horizon
        numbers[place + 1] = numbers[WORK]
        numbers[place + 2] = numbers[AGE]
        place += DRIVEN_WIDTH
    if ints[CURRENT + SETTLED] == 0:
        ints[row + 3] = ints[PHASE_COUNT]
        for e in range(ints[level + EXIT_COUNT]):
            ints[ints[PHASE_INTS] + ints[PHASE_COUNT] + e] = ints[ints[CURRENT + PHASES] + e]
        ints[PHASE_COUNT] += ints[level + EXIT_COUNT]
        numbers[place] = armed_at
        place += 1
    ints[COORDINATE_COUNT] = place - ints[COORDINATE_NUMBERS]
    ints[SEGMENT_COUNT] = k + 1
    if ints[SUMMED] == 1:
        numbers[WORKS + 1] += numbers[WORK]
        for part in range(3):
            numbers[WORKS + part] += numbers[WORKS_NOW + part]
    else:
        ints[ints[LEFT_OUT] + ints[LEFT_OUT_COUNT]] = k
        ints[LEFT_OUT_COUNT] += 1
    numbers[TIME] = numbers[INSTANT_TIME]
    numbers[WORK] = 0.0


@compiled
def keep_events(ints: Ints, numbers: Numbers) -> None:
    """Record the changes of a decision as events; the first one has the energy lost at the whole instant."""
    first = 1
    for k in range(ints[CHANGE_COUNT]):
        row = ints[EVENT_INTS] + (ints[EVENT_COUNT] + k) * EVENT_WIDTH
        amounts = ints[EVENT_NUMBERS] + (ints[EVENT_COUNT] + k) * EVENT_WIDTH_NUMBERS
        entered, impulse, has_losses = ints[ints[CHANGES] + k * CHANGE_WIDTH + 1], numbers[ints[CHANGE_IMPULSES] + k], 0
        ints[row] = ints[ints[CHANGES] + k * CHANGE_WIDTH]
        ints[row + 1] = entered
        ints[row + 2] = ints[ints[CHANGES] + k * CHANGE_WIDTH + 2]
        has_impact = 1 if impulse != 0.0 else 0
        if first == 1 and entered != SHARED:
            first, has_losses = 0, 1
            for part in range(LOSSES):
                numbers[LOST_SO_FAR + part] += numbers[LOST + part]
                if part != KINETIC and part != STRAIN and numbers[LOST + part] != 0.0:
                    has_impact = 1
            numbers[TRUNCATED] += abs(numbers[LOST + KINETIC] + numbers[LOST + STRAIN])
        numbers[amounts] = numbers[TIME]
        numbers[amounts + 1] = numbers[LOST + KINETIC] if has_losses == 1 else 0.0
        numbers[amounts + 2] = numbers[LOST + STRAIN] if has_losses == 1 else 0.0
        if has_impact == 1:
            keep_impact(ints, numbers, ints[EVENT_COUNT] + k, impulse, has_losses)
    ints[EVENT_COUNT] += ints[CHANGE_COUNT]


@compiled
def keep_impact(ints: Ints, numbers: Numbers, event: int, impulse: float, has_losses: int) -> None:
    """Record the impulse of an event and, with ``has_losses``, the losses of its instant but those to truncation."""
    amounts = ints[IMPACT_NUMBERS] + ints[IMPACT_COUNT] * IMPACT_WIDTH
    ints[ints[IMPACT_INTS] + ints[IMPACT_COUNT]] = event
    numbers[amounts] = impulse
    numbers[amounts + 1] = numbers[LOST + BY_IMPACT] if has_losses == 1 else 0.0
    numbers[amounts + 2] = numbers[LOST + STOP_WORK] if has_losses == 1 else 0.0
    numbers[amounts + 3] = numbers[LOST + DAMPING] if has_losses == 1 else 0.0
    numbers[amounts + 4] = numbers[LOST + FRICTION] if has_losses == 1 else 0.0
    ints[IMPACT_COUNT] += 1


@compiled
def is_chatter(ints: Ints, numbers: Numbers) -> int:
    """Return 1 where the last window of decisions is chatter, else 0.

    It is where they are more than ALLOWED in a period of the fastest mode or load, or take no time.
    """
    window, decisions, ring = ints[WINDOW], ints[DECISIONS], ints[RING]
    if decisions <= window:
        return 0
    oldest = (decisions - window) % (window + 1)
    elapsed, limit = numbers[TIME] - numbers[ring + 2 * oldest], window / numbers[ALLOWED]
    last = (decisions - 1) % (window + 1)
    if elapsed > ACCUMULATED * numbers[TIME] and numbers[ring + 2 * last + 1] * elapsed >= limit:
        return 0
    highest = 0.0
    for k in range(window + 1):
        if k != (decisions - window - 1) % (window + 1):
            highest = max(highest, numbers[ring + 2 * k + 1])
    numbers[TOLD] = elapsed
    numbers[TOLD + 1] = highest
    return 1 if elapsed <= ACCUMULATED * numbers[TIME] or 0.0 < highest * elapsed < limit else 0
