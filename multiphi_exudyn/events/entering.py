"""Entering: the start of a run, or the state that it goes on from, into the arrays of its levels."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from multiphi_exudyn.events import arrays as a
from multiphi_exudyn.events.level_arrays import LevelArrays
from multiphi_exudyn.events.state_arrays import measure

__all__ = ["Measure", "set_start", "set_state"]

Measure = Callable[[np.ndarray, np.ndarray, int], None]


def set_start(
    arrays: LevelArrays,
    displacement: np.ndarray,
    velocity: np.ndarray,
    key: Sequence[int],
    held: np.ndarray,
    sprung: Sequence[int],
) -> None:
    """The start of a run: y, y' (m,), the states of elements, those contacts closed that touch or penetrate.

    held: places (h,) that links hold. sprung: links that hold by their springs.
    """
    base = arrays.base
    ints, numbers = arrays.buffers.ints, arrays.buffers.numbers
    m, q, states = len(displacement), int(ints[a.PRESCRIBED]), int(ints[base + a.STATES])
    for i, state in enumerate(key):
        ints[states + i] = state
    ints[a.GIVEN + a.LEVEL], ints[a.STARTING] = base, a.FRESH
    drive = int(ints[a.DRIVE])
    for k, (part, values, placed) in enumerate(((a.PLACE, displacement, held), (a.SPEED, velocity, 0.0 * held))):
        start = int(ints[a.GIVEN + part])
        numbers[start : start + m] = values
        if q:
            numbers[start + m : start + m + q] = numbers[drive + k * q : drive + (k + 1) * q]
        if len(held):
            numbers[start + m + q : start + m + q + len(held)] = placed
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
