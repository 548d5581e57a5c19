"""Entering: the start of a run, or the state that it goes on from, into the arrays of its levels."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from multiphi_exudyn.events import arrays as a
from multiphi_exudyn.events.arrays import (
    CHANNELS,
    COORDINATES,
    DRIVE,
    ELEMENTS,
    GIVEN,
    LEVEL,
    PLACE,
    PRESCRIBED,
    SPEED,
    STATES,
)
from multiphi_exudyn.events.level_arrays import LevelArrays
from multiphi_exudyn.events.state_arrays import measure
from multiphi_exudyn.mathematics.compiled import Ints, Numbers, compiled

__all__ = ["Measure", "enter_start", "set_start", "set_state"]

Measure = Callable[[np.ndarray, np.ndarray, int], None]


@compiled
def enter_start(ints: Ints, numbers: Numbers, states: Ints, given: Numbers, k: int) -> None:
    """GIVEN becomes the k-th start: states (c,) of elements; y, y' (m,) and the places (h,) that links hold."""
    m, q, here = ints[COORDINATES], ints[PRESCRIBED], ints[ints[GIVEN + LEVEL] + STATES]
    held, place, speed = ints[CHANNELS] - q, ints[GIVEN + PLACE], ints[GIVEN + SPEED]
    start = k * (2 * m + held)
    for i in range(ints[ELEMENTS]):
        ints[here + i] = states[k * ints[ELEMENTS] + i]
    for i in range(m):
        numbers[place + i] = given[start + i]
        numbers[speed + i] = given[start + m + i]
    for i in range(q):
        numbers[place + m + i] = numbers[ints[DRIVE] + i]
        numbers[speed + m + i] = numbers[ints[DRIVE] + q + i]
    for i in range(held):
        numbers[place + m + q + i] = given[start + 2 * m + i]
        numbers[speed + m + q + i] = 0.0


def set_start(
    arrays: LevelArrays,
    displacement: np.ndarray,
    velocity: np.ndarray,
    key: Sequence[int],
    held: np.ndarray,
    sprung: Sequence[int],
    entered: Callable[..., None] = enter_start,
) -> None:
    """The start of a run: y, y' (m,), the states of elements, those contacts closed that touch or penetrate.

    held: places (h,) that links hold. sprung: links that hold by their springs. entered: ``enter_start``, or compiled.
    """
    base = arrays.base
    ints, numbers = arrays.buffers.ints, arrays.buffers.numbers
    ints[a.GIVEN + a.LEVEL], ints[a.STARTING] = base, a.FRESH
    entered(ints, numbers, np.array(key, np.int64), np.concatenate([displacement, velocity, held]), 0)
    numbers[a.GIVEN_SPRINGS] = _springs(arrays, sprung) if sprung else 0.0


def _springs(arrays: LevelArrays, sprung: Sequence[int]) -> float:
    """Strain energy [J] that these links have in the place of GIVEN."""
    base, ints, numbers = arrays.levels.model.base, arrays.ints, arrays.numbers
    n, links = int(ints[a.COORDINATES] + ints[a.CHANNELS]), [k for k in sprung if np.isfinite(base.stiffnesses[k])]
    rows = numbers[ints[arrays.base + a.GAPS] :][: len(base.links) * (n + 1)].reshape(-1, n + 1)[links]
    gaps = rows[:, :-1] @ numbers[ints[a.GIVEN + a.PLACE] :][:n] + rows[:, -1]
    return 0.5 * float(base.stiffnesses[links] @ (gaps * gaps))


def set_state(
    arrays: LevelArrays,
    level: int,
    place: np.ndarray,
    speed: np.ndarray,
    phases: Sequence[int],
    measured: Measure = measure,
) -> None:
    """The current state: xi, xi' (n,) in a level, the phases of its exits; measured: ``measure``, or compiled."""
    n, state, ints, numbers = len(place), a.CURRENT, arrays.ints, arrays.numbers
    ints[state + a.LEVEL] = level
    for part, values in ((a.PLACE, place), (a.SPEED, speed)):
        start = int(ints[state + part])
        numbers[start : start + n] = values
    start = int(ints[state + a.PHASES])
    ints[start : start + len(phases)] = phases
    ints[state + a.SETTLED] = int(not any(phases))
    ints[a.STARTING] = 0
    measured(ints, numbers, state)
