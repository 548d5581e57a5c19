"""Starts of runs, or the state from which a run continues, written into the arrays of its levels."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.display import Shown
from multiphi_exudyn.events import arrays as a
from multiphi_exudyn.events.packing.level_arrays import LevelArrays
from multiphi_exudyn.events.states.state_arrays import measure
from multiphi_exudyn.events.transitions.state import State

__all__ = ["Measure", "Start", "set_starts", "set_state"]

Measure = Callable[[np.ndarray, np.ndarray, int], None]


@dataclass(repr=False)  # not frozen: every run makes one, which would take three times as long
class Start(Shown):
    """y, y' (m,) in base coordinates; compliant contacts that start closed, rigid ones that start at their gap.

    penetrating: includes the friction that sticks. gaps: (c,) [m] of all contacts at y = 0, with the stops and held
    displacements at the start. states: numbers of all elements' states, those contacts closed. held: displacements (h,)
    that links hold. time [s], state: of the start, and the final state of the run that is continued, if any.
    """

    displacement: np.ndarray
    velocity: np.ndarray
    penetrating: tuple[int, ...]
    touching: tuple[int, ...]
    gaps: np.ndarray
    states: tuple[int, ...]
    held: np.ndarray
    time: float = 0.0
    state: State | None = None

    def _facts(self) -> Iterator[tuple[str, str]]:
        yield "time", f"{self.time:g} s"
        yield "states", str(self.states)


def set_starts(arrays: LevelArrays, starts: Sequence[Start]) -> None:
    """Write the starts of runs, the first of which begins with the next call of the loop (first_state.py)."""
    arrays.reserve_starts(len(starts))
    ints, numbers = arrays.buffers.ints, arrays.buffers.numbers
    place, here = ints[a.STARTS : a.START_STATES + 1].tolist()
    for start in starts:
        m, held, states = len(start.displacement), start.held, start.states
        ints[here : here + len(states)] = states
        numbers[place : place + m], numbers[place + m : place + 2 * m] = start.displacement, start.velocity
        here, place = here + len(states), place + 2 * m + len(held) + 1
        if len(held):
            numbers[place - len(held) - 1 : place - 1] = held
        numbers[place - 1] = _springs(arrays, start) if start.penetrating else 0.0
    ints[a.START], ints[a.STARTING] = 0, a.FRESH


def _springs(arrays: LevelArrays, start: Start) -> float:
    """Return the strain energy [J] of the links that hold by their springs."""
    base, ints, numbers = arrays.levels.model.base, arrays.ints, arrays.numbers
    links = [k for k in start.penetrating if np.isfinite(base.stiffnesses[k])]
    place = np.concatenate([start.displacement, numbers[ints[a.DRIVE] :][: ints[a.PRESCRIBED]], start.held])
    n = len(place)
    rows = numbers[ints[arrays.base + a.GAPS] :][: len(base.links) * (n + 1)].reshape(-1, n + 1)[links]
    gaps = rows[:, :-1] @ place + rows[:, -1]
    return 0.5 * float(base.stiffnesses[links] @ (gaps * gaps))


def set_state(
    arrays: LevelArrays,
    level: int,
    place: np.ndarray,
    speed: np.ndarray,
    phases: Sequence[int],
    measured: Measure = measure,
) -> None:
    """Write the current state: xi, xi' (n,) in a level, the phases of its exits; measured: ``measure``, or compiled."""
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
