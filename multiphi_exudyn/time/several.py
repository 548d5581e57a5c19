"""Several starts of one model carried to the end one after the other, by one call of the loop.

What Python does for a run takes as long as the loop does, and is done by one thread at a time; here it is done for many
runs at once. A start that meets something on its way, a level that is not there yet, a full record, a failure, ends
the call: whoever has asked carries that one by itself. So a run is what it is alone, to the bit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from multiphi_exudyn.events import arrays as a
from multiphi_exudyn.events.arrays import (
    CHANNELS,
    COORDINATE_COUNT,
    CURRENT,
    DECISIONS,
    DRIVE_NEXT,
    END_REACHED,
    EVENT_COUNT,
    FOUND,
    FRESH,
    GIVEN_UP,
    HORIZON,
    LEVEL,
    MODES,
    NEED,
    OF_A_RUN,
    OK,
    PHASE_COUNT,
    PIECE,
    PLACE,
    PRESCRIBED,
    SEGMENT_COUNT,
    SEGMENT_ROOM,
    START,
    STARTING,
    STOP_AT_EVENT,
    TIME,
    TRANSITIONS,
)
from multiphi_exudyn.events.drive import keep_drive, load_piece, set_drive
from multiphi_exudyn.events.entering import set_starts
from multiphi_exudyn.events.level_arrays import LevelArrays
from multiphi_exudyn.mathematics.compiled import Ints, Numbers, Waves, compiled, entry
from multiphi_exudyn.time.level_rows import point_row
from multiphi_exudyn.time.loop import advance
from multiphi_exudyn.time.loop_record import keep_segment
from multiphi_exudyn.time.motion import Motion
from multiphi_exudyn.time.reliability import looked_into
from multiphi_exudyn.time.sampling import sample_rows
from multiphi_exudyn.time.taken import PARTS, taken

__all__ = ["Several", "carry_several"]

ENDS = 4  # ints: segments, coordinates, phases and events up to the end of a run
TOLD_WIDTH = OF_A_RUN + 2


@compiled
def carry_starts(
    ints: Ints,
    numbers: Numbers,
    waves: Waves,
    end: float,
    until: float,
    fresh: Numbers,
    count: int,
    ends: Ints,
    told: Numbers,
) -> int:
    """Carries the starts that stand in the arrays to ``end`` one after the other; how many of them have come there.

    until: how long the first piece of the channels lasts. fresh: the numbers of a run at its start. ends: counts
    (count + 1, ENDS) of the record, the first ones zero. told: numbers (count, TOLD_WIDTH) of each run, and its
    function evaluations and transitions. A segment of no length after those of a run has its final state.
    """
    for k in range(count):
        for i in range(OF_A_RUN):
            numbers[i] = fresh[i]
        ints[START], ints[STARTING], ints[STOP_AT_EVENT], ints[GIVEN_UP] = k, FRESH, 0, 0
        ints[DECISIONS], ints[TRANSITIONS], ints[PIECE] = 0, 0, 0
        numbers[ints[FOUND] + 1] = 0.0
        if ints[PRESCRIBED] > 0:
            load_piece(ints, waves)
            set_drive(ints, numbers, waves, ints[DRIVE_NEXT], 0.0, numbers[TIME], until)
            keep_drive(ints, waves)
        status = advance(ints, numbers, waves, end)
        if status != END_REACHED or ints[SEGMENT_COUNT] >= ints[SEGMENT_ROOM] or is_finite(ints, numbers) == 0:
            before = ENDS * k
            ints[SEGMENT_COUNT], ints[COORDINATE_COUNT] = ends[before], ends[before + 1]
            ints[PHASE_COUNT], ints[EVENT_COUNT] = ends[before + 2], ends[before + 3]
            return k
        for i in range(OF_A_RUN):
            told[k * TOLD_WIDTH + i] = numbers[i]
        told[k * TOLD_WIDTH + OF_A_RUN] = numbers[ints[FOUND] + 1]
        told[k * TOLD_WIDTH + OF_A_RUN + 1] = ints[TRANSITIONS]
        keep_segment(ints, numbers, 0.0, numbers[HORIZON])
        after = ENDS * (k + 1)
        ends[after], ends[after + 1] = ints[SEGMENT_COUNT], ints[COORDINATE_COUNT]
        ends[after + 2], ends[after + 3] = ints[PHASE_COUNT], ints[EVENT_COUNT]
    return count


@compiled
def is_finite(ints: Ints, numbers: Numbers) -> int:
    """1 where all coordinates of the present state are finite."""
    x = ints[CURRENT + PLACE]
    for i in range(ints[ints[CURRENT + LEVEL] + MODES] + ints[CHANNELS]):
        if numbers[x + i] - numbers[x + i] != 0.0:
            return 0
    return 1


@compiled
def sample_starts(
    ints: Ints,
    numbers: Numbers,
    waves: Waves,
    rows: Ints,
    spans: Numbers,
    coordinates: Numbers,
    offsets: Ints,
    ends: Ints,
    runs: int,
    functions: Numbers,
    levels: int,
    points: int,
    width: int,
    times: Numbers,
    count: int,
    values: Numbers,
) -> int:
    """Values (runs, points, count) at times [s] in a record of ``carry_starts`` (sampling.py); OK or NEED.

    functions: the points' rows (points, levels, 2 width + 1).
    """
    for k in range(runs):
        for p in range(points):
            place, function = (k * points + p) * count, p * levels * (2 * width + 1)
            status = sample_rows(
                ints, numbers, waves, rows, spans, coordinates, offsets, ends[ENDS * k], ends[ENDS * (k + 1)] - 1,
                functions, function, width, times, count, 0, values, place,
            )  # fmt: skip
            if status == NEED:
                return NEED
    return OK


carry_several, sampled_several = entry(carry_starts), entry(sample_starts)


@dataclass(frozen=True)
class Several:
    """Motions that have set out on ``arrays``, of which the first ``count`` have come to the end.

    parts: their record. ends, told: see ``carry_starts``.
    """

    arrays: LevelArrays
    motions: Sequence[Motion]
    count: int
    parts: dict[str, np.ndarray]
    ends: np.ndarray
    told: np.ndarray

    @classmethod
    def carried(cls, motions: Sequence[Motion], end: float, loop: Callable[..., Any]) -> Several:
        """Motions on the same arrays to ``end`` [s]; loop: ``carry_several``, or what calls it."""
        arrays, count = motions[0].arrays, len(motions)
        motions[0].take_over()
        set_starts(arrays, [motion.start for motion in motions])
        fresh = arrays.numbers[:OF_A_RUN].copy()
        ends, told = np.zeros((count + 1, ENDS), np.int64), np.empty((count, TOLD_WIDTH))
        outer = arrays.buffers.all
        done = loop(*outer, end, arrays.channels.first_end, fresh, count, ends.ravel(), told.ravel())
        arrays.owner = None
        return cls(arrays, motions, int(done), taken(arrays, PARTS), ends, told)

    @property
    def events(self) -> np.ndarray:
        """Their numbers (count,)."""
        own = np.concatenate([[0], np.cumsum(self.parts["kinds"][:, 1] != a.SHARED)]) if "kinds" in self.parts else None
        return np.zeros(self.count, int) if own is None else np.diff(own[self.ends[: self.count + 1, 3]])

    def visited(self, k: int) -> tuple[tuple[int, ...], ...]:
        """The levels of a run, each once, by their states."""
        first, last = self.ends[k, 0], self.ends[k + 1, 0] - 1
        return tuple(self.arrays.loaded[n].states for n in dict.fromkeys(self.parts["rows"][first:last, 0].tolist()))

    def values(self, rows: Sequence[np.ndarray], times: np.ndarray) -> np.ndarray:
        """Displacements (count, p, t) [m] of points at times (t,) [s]; rows: p of (m,) in base coordinates."""
        arrays, found = self.arrays, np.empty((self.count, len(rows), len(times)))
        if not found.size:
            return found
        loaded = {n: arrays.loaded[n] for n in dict.fromkeys(self.parts["rows"][:, 0].tolist())}
        levels, width = max(loaded) + 1, max(level.level.modes for level in loaded.values())
        functions, offsets = np.zeros((len(rows), levels, 2 * width + 1)), np.zeros(levels, np.int64)
        for number, level in loaded.items():
            offsets[number] = arrays.level(level.states)
            for p, row in enumerate(rows):
                function, n = point_row(row, level), level.level.modes
                functions[p, number, :n], functions[p, number, -1] = function[:n], function[-1]
        record = self.parts["rows"].ravel(), self.parts["spans"].ravel(), self.parts["coordinates"], offsets
        asked = self.ends.ravel(), self.count, functions.ravel(), levels, len(rows), width, times, len(times)
        while sampled_several(*arrays.buffers.all, *record, *asked, found.ravel()) == NEED:
            arrays.supply()
        return found

    def land(self, k: int) -> Motion:
        """A motion where it has come to."""
        (s, _, _, e), (s_end, _, _, e_end) = self.ends[k].tolist(), self.ends[k + 1].tolist()
        part = {name: given for name, given in self.parts.items() if name in ("coordinates", "phases")}
        part |= {name: self.parts[name][s:s_end] for name in ("rows", "spans")}
        part |= {name: self.parts[name][e:e_end] for name in ("kinds", "amounts") if e_end > e}
        part["rows"][:, 2] -= e
        self.motions[k].land(part, self.told[k])
        return self.motions[k]

    def silent(self, k: int, least: float) -> bool:
        """Whether reliability.py says nothing of a run that depends on more than the levels visited.

        least: the indicator from which truncation is told.
        """
        model = self.arrays.levels.model
        if model.general or model.validity is not None or not model.base.complete:
            return False
        told, y = self.told[k], self.motions[k].start.displacement
        kinetic, strain = told[a.LOST_AT_START + a.KINETIC : a.LOST_AT_START + a.STRAIN + 1].tolist()
        defects, truncated = told[a.DEFECTS : a.TRUNCATED + 1].tolist()
        given = abs(float(told[a.GIVEN_ENERGY]) + float(self.arrays.levels.excitation.static.dot(y)))
        return not any(looked_into((abs(kinetic + strain) + truncated, defects, given), y, least))
