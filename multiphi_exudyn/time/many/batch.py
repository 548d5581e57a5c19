"""Several starts of one model carried to the end one after the other, by one call of the loop.

What Python does for a run takes as long as the loop does, and is done by one thread at a time; here it is done for many
runs at once. A start that meets something on its way, a level that is not there yet, a full record, a failure, ends
the call: whoever has asked carries that one by itself. So a run is what it is alone, to the bit.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from multiphi_exudyn.events import arrays as a
from multiphi_exudyn.events.arrays import NEED, OF_A_RUN
from multiphi_exudyn.events.excitation.loaded_level import LoadedLevel
from multiphi_exudyn.events.packing.level_arrays import LevelArrays
from multiphi_exudyn.events.packing.start_arrays import Start, set_starts
from multiphi_exudyn.mathematics.compiling.compiled import entry
from multiphi_exudyn.time.loop.motion_size import INDICATOR, SAMPLES
from multiphi_exudyn.time.loop.verdict import judge
from multiphi_exudyn.time.many.batch_loop import ENDS, TOLD_WIDTH, carry_starts, measure_starts, sample_starts
from multiphi_exudyn.time.record.loop_copies import EMPTY, PARTS, taken
from multiphi_exudyn.time.run.motion import Motion

__all__ = ["Several"]

carry_several, sampled_several, measured_several = entry(carry_starts), entry(sample_starts), entry(measure_starts)
judged = entry(judge)


@dataclass(frozen=True)
class Several:
    """Runs from ``starts`` on ``arrays``, of which the first ``count`` have come to the ``end`` [s].

    call: calls a compiled function with what it is given. parts: their record. ends, told: see ``carry_starts``.
    """

    arrays: LevelArrays
    starts: Sequence[Start]
    end: float
    call: Callable[..., Any]
    count: int
    parts: dict[str, np.ndarray]
    ends: np.ndarray
    told: np.ndarray

    @classmethod
    def carried(cls, motion: Motion, starts: Sequence[Start], end: float, call: Callable[..., Any]) -> Several:
        """Starts carried to ``end`` [s]; motion: from the first of them, on whose arrays they are."""
        arrays, count = motion.arrays, len(starts)
        motion.take_over()
        set_starts(arrays, starts)
        fresh = arrays.numbers[:OF_A_RUN].copy()
        ends, told = np.zeros((count + 1, ENDS), np.int64), np.empty((count, TOLD_WIDTH))
        given = end, arrays.channels.first_end, fresh, count, ends.ravel(), told.ravel()
        done = int(call(carry_several, *arrays.buffers.all, *given))
        arrays.owner = None
        if (excitation := arrays.levels.excitation).pushes:  # each start has its own potential
            told[:done, a.GIVEN_POTENTIAL] = [excitation.static.dot(start.displacement) for start in starts[:done]]
            told[:done, a.VERDICT] = math.nan
        return cls(arrays, starts, end, call, done, EMPTY | taken(arrays, PARTS), ends, told)

    @property
    def events(self) -> np.ndarray:
        """Their numbers (count,)."""
        own = np.concatenate([[0], np.cumsum(self.parts["kinds"][:, 1] != a.SHARED)])
        return np.diff(own[self.ends[: self.count + 1, 3]])

    @functools.cached_property
    def _numbers(self) -> list[int]:
        """Of the levels of all segments."""
        numbers: list[int] = self.parts["rows"][:, 0].tolist()
        return numbers

    @functools.cached_property
    def _visited(self) -> list[int]:
        """The numbers of all levels visited."""
        return sorted(set(self._numbers))

    def visited(self, k: int) -> tuple[tuple[int, ...], ...]:
        """The levels of a run, each once, by their states."""
        first, last = self._firsts[k], self._firsts[k + 1] - 1
        return tuple([self.arrays.loaded[n].states for n in dict.fromkeys(self._numbers[first:last])])

    @functools.cached_property
    def _firsts(self) -> list[int]:
        """The first segments of all runs."""
        firsts: list[int] = self.ends[:, 0].tolist()
        return firsts

    @functools.cached_property
    def _record(self) -> tuple[np.ndarray, ...]:
        """What compiled functions are given of the record, and where its levels stand, (levels,)."""
        offsets = np.zeros(self._visited[-1] + 1, np.int64)
        for number in self._visited:
            offsets[number] = self.arrays.level(self.arrays.loaded[number].states)
        parts = self.parts
        return parts["rows"].ravel(), parts["coordinates"], offsets, parts["instants"], self.ends.ravel()

    def _asked(self, function: Callable[..., Any], *given: Any) -> None:
        """Call a compiled function about the record until it has all that it needs."""
        while self.call(function, *self.arrays.buffers.all, *self._record, *given) == NEED:
            self.arrays.supply()

    def values(self, rows: Callable[[LoadedLevel], Sequence[np.ndarray]], points: int, times: np.ndarray) -> np.ndarray:
        """Displacements (count, points, t) [m] at times (t,) [s]; rows: of all points in a level (level_rows.py)."""
        found = np.empty((self.count, points, len(times)))
        if found.size:
            loaded = [(number, self.arrays.loaded[number]) for number in self._visited]
            levels, width = self._visited[-1] + 1, max(level.level.modes for _, level in loaded)
            functions = np.zeros((points, levels, 2 * width + 1))
            for number, level in loaded:
                n = level.level.modes
                for p, row in enumerate(rows(level)):
                    functions[p, number, :n], functions[p, number, -1] = row[:n], row[-1]
            asked = functions.ravel(), levels, points, width, times, len(times)
            self._asked(sampled_several, self.count, *asked, found.ravel())
        return found

    def verdicts(self, runs: Sequence[int], limit: float) -> dict[int, tuple[float, float]]:
        """What truncation took of some runs (verdict.py); limit: of the indicator, from which it is told."""
        if not self.arrays.ints[a.JUDGED]:
            return dict.fromkeys(runs, (0.0, 0.0))
        asked = self._unjudged(runs) if limit == INDICATOR else runs
        self._judge(asked, limit)
        if further := self._unjudged(asked):
            sizes = np.empty((len(further), 2))
            self._asked(measured_several, np.array(further, np.int64), len(further), self.end, sizes.ravel())
            self.told[further, a.LOOKED], self.told[further, a.LOOK_END] = SAMPLES, self.end
            self.told[further, a.LOOKED + 1 : a.LOOKED + a.LOOK_WIDTH] = sizes
            self._judge(further, limit)
        found = self.told[:, a.VERDICT : a.VERDICT + 2].tolist()
        return {k: (found[k][0], found[k][1]) for k in runs}

    def _unjudged(self, runs: Sequence[int]) -> list[int]:
        """Those of some runs whose verdict is not known."""
        unknown = np.isnan(self.told[list(runs), a.VERDICT : a.VERDICT + 2]).any(axis=1).tolist()
        return [k for k, still in zip(runs, unknown, strict=True) if still]

    def _judge(self, runs: Sequence[int], limit: float) -> None:
        """The verdict on some runs."""
        isolated = int(self.arrays.ints[a.ISOLATED])
        for k in runs:
            judged(self.told[k], isolated, limit, self.end)

    def has_defects(self, k: int) -> bool:
        """Whether all defects of a run are known."""
        return not math.isnan(self.told[k, a.DEFECTS])

    def struck(self, k: int) -> bool:
        """Whether a rigid contact was struck in a run."""
        own = slice(self.ends[k, 5], self.ends[k + 1, 5])
        events, impulses = self.parts["struck"][own], self.parts["impacts"][own, 0]
        return bool(np.any(impulses[self.parts["kinds"][events, 1] != a.SHARED] > 0))

    def land(self, k: int) -> Motion:
        """The run as a motion that has come to the end."""
        (s, _, _, e, left, i), (s_end, _, _, e_end, left_end, i_end) = self.ends[k : k + 2].tolist()
        part = {name: given for name, given in self.parts.items() if name in ("coordinates", "phases")}
        part |= {"rows": self.parts["rows"][s:s_end].copy(), "instants": self.parts["instants"][s:s_end]}
        part |= {name: self.parts[name][e:e_end] for name in ("kinds", "amounts") if e_end > e}
        if i_end > i:
            part |= {"struck": self.parts["struck"][i:i_end] - e, "impacts": self.parts["impacts"][i:i_end]}
        if left_end > left:
            part["left_out"] = self.parts["left_out"][left:left_end] - s
        motion = Motion(self.arrays, self.starts[k])
        motion.land(part, self.told[k])
        return motion
