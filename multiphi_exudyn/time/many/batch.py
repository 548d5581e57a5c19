"""Batch: several starts of one model, advanced to the end one after the other by one call of the loop.

The Python part of a run takes as long as the loop, and only one thread at a time can do it; here it is done once for
many runs. A start that lacks a level, fills the record or fails ends the call, and is then run alone. So every run is
the same, to the bit, as a run alone.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from multiphi_exudyn.events import arrays as a
from multiphi_exudyn.events.arrays import COUNTED, NEED, OF_A_RUN
from multiphi_exudyn.events.excitation.loaded_level import LoadedLevel
from multiphi_exudyn.events.packing.level_arrays import LevelArrays
from multiphi_exudyn.events.packing.start_arrays import Start, set_starts
from multiphi_exudyn.events.transitions.exits import exits_of
from multiphi_exudyn.mathematics.compiling.compiled import entry
from multiphi_exudyn.time.loop.motion_size import INDICATOR, SAMPLES
from multiphi_exudyn.time.loop.verdict import set_verdict
from multiphi_exudyn.time.many.batch_loop import RUN_WIDTH, advance_starts, measure_starts, sample_starts
from multiphi_exudyn.time.record.loop_copies import EMPTY, LoopState, RecordPart, copy_loop
from multiphi_exudyn.time.run.motion import Motion

__all__ = ["Batch"]

advance_batch, sample_batch, measure_batch = entry(advance_starts), entry(sample_starts), entry(measure_starts)
compute_verdict = entry(set_verdict)


@dataclass(frozen=True)
class Batch:
    """Runs from ``starts`` on ``arrays``, of which the first ``count`` have reached the ``end`` [s].

    call: calls a compiled function with its arguments. levels, parts: of the record of the runs. ends, run_numbers: see
    ``advance_starts``.
    """

    arrays: LevelArrays
    starts: Sequence[Start]
    end: float
    call: Callable[..., Any]
    count: int
    levels: Sequence[LoadedLevel]
    parts: dict[str, np.ndarray]
    ends: np.ndarray
    run_numbers: np.ndarray

    @classmethod
    def run(cls, motion: Motion, starts: Sequence[Start], end: float, call: Callable[..., Any]) -> Batch:
        """Advance starts to ``end`` [s] on the arrays of ``motion``, which begins at the first of them."""
        arrays, count = motion.arrays, len(starts)
        motion.take_over()
        set_starts(arrays, starts)
        initial = arrays.numbers[:OF_A_RUN].copy()
        ends, run_numbers = np.zeros((count + 1, COUNTED), np.int64), np.empty((count, RUN_WIDTH))
        arguments = end, arrays.channels.first_end, initial, count, ends.ravel(), run_numbers.ravel()
        count_done = int(call(advance_batch, *arrays.buffers.all, *arguments))
        arrays.owner = None
        if (excitation := arrays.levels.excitation).pushes:  # each start has its own potential
            potentials = [excitation.static.dot(start.displacement) for start in starts[:count_done]]
            run_numbers[:count_done, a.GIVEN_POTENTIAL] = potentials
            run_numbers[:count_done, a.VERDICT] = math.nan
        part, _ = copy_loop(arrays)
        return cls(arrays, starts, end, call, count_done, part.levels, EMPTY | part.arrays(), ends, run_numbers)

    @functools.cached_property
    def events(self) -> np.ndarray:
        """Numbers of events of the runs (count,)."""
        events_so_far = np.concatenate([[0], np.cumsum(self.parts["kinds"][:, 1] != a.SHARED)])
        return np.diff(events_so_far[self.ends[: self.count + 1, 3]])

    @functools.cached_property
    def _numbers(self) -> list[int]:
        """Numbers of the levels of all segments."""
        numbers: list[int] = self.parts["rows"][:, 0].tolist()
        return numbers

    def _visited(self, k: int) -> list[int]:
        """Numbers of the levels of a run, each level once."""
        first, last = self._firsts[k], self._firsts[k + 1] - 1  # the last one is the final state
        return list(dict.fromkeys(self._numbers[first:last]))

    def visited(self, k: int) -> tuple[tuple[int, ...], ...]:
        """States of the levels of a run, each level once."""
        return tuple([self.levels[number].states for number in self._visited(k)])

    @functools.cached_property
    def _firsts(self) -> list[int]:
        """Index of the first segment of every run."""
        firsts: list[int] = self.ends[:, 0].tolist()
        return firsts

    @functools.cached_property
    def _record(self) -> tuple[np.ndarray, ...]:
        """Arrays of the record for compiled functions, with the places of its levels (levels,)."""
        offsets = np.array([self.arrays.level(level.states) for level in self.levels], np.int64)
        parts = self.parts
        return parts["rows"].ravel(), parts["coordinates"], offsets, parts["instants"], self.ends.ravel()

    def _evaluate(self, function: Callable[..., Any], *given: Any) -> None:
        """Call a compiled function of the record until it has all that it needs."""
        record = self._record  # may pack levels, and replace the buffers
        while self.call(function, *self.arrays.buffers.all, *record, *given) == NEED:
            self.arrays.supply()

    def values(self, rows: Callable[[LoadedLevel], Sequence[np.ndarray]], points: int, times: np.ndarray) -> np.ndarray:
        """Displacements (count, points, t) [m] at times (t,) [s]; rows: of all points in a level (level_rows.py)."""
        displacements = np.empty((self.count, points, len(times)))
        if displacements.size:
            levels, width = len(self.levels), max(level.level.modes for level in self.levels)
            functions = np.zeros((points, levels, 2 * width + 1))
            for number, level in enumerate(self.levels):
                n = level.level.modes
                for p, row in enumerate(rows(level)):
                    functions[p, number, :n], functions[p, number, -1] = row[:n], row[-1]
            arguments = functions.ravel(), levels, points, width, times, len(times)
            self._evaluate(sample_batch, self.count, *arguments, displacements.ravel())
        return displacements

    def verdicts(self, runs: Sequence[int], limit: float) -> dict[int, tuple[float, float]]:
        """Verdicts on the truncation of some runs (verdict.py); limit: threshold of the indicator for a warning."""
        if not self.arrays.ints[a.JUDGED]:
            return dict.fromkeys(runs, (0.0, 0.0))
        chosen = self._without_verdict(runs) if limit == INDICATOR else runs
        self._compute_verdicts(chosen, limit)
        if further := self._without_verdict(chosen):
            sizes = np.empty((len(further), 2))
            self._evaluate(measure_batch, np.array(further, np.int64), len(further), self.end, sizes.ravel())
            self.run_numbers[further, a.LOOKED], self.run_numbers[further, a.LOOK_END] = SAMPLES, self.end
            self.run_numbers[further, a.LOOKED + 1 : a.LOOKED + a.LOOK_WIDTH] = sizes
            self._compute_verdicts(further, limit)
        verdicts = self.run_numbers[:, a.VERDICT : a.VERDICT + 2].tolist()
        return {k: (verdicts[k][0], verdicts[k][1]) for k in runs}

    def _without_verdict(self, runs: Sequence[int]) -> list[int]:
        """Those of some runs whose verdict is not known yet."""
        unknown = np.isnan(self.run_numbers[list(runs), a.VERDICT : a.VERDICT + 2]).any(axis=1).tolist()
        return [k for k, still in zip(runs, unknown, strict=True) if still]

    def _compute_verdicts(self, runs: Sequence[int], limit: float) -> None:
        """Compute the verdicts on some runs."""
        isolated = int(self.arrays.ints[a.ISOLATED])
        for k in runs:
            compute_verdict(self.run_numbers[k], isolated, limit, self.end)

    def is_balanced(self, k: int) -> bool:
        """Whether the numbers of a run show that its ledger is closed: no works were left out."""
        return bool(self.run_numbers[k, a.BALANCED] == 1.0 and self.ends[k, 4] == self.ends[k + 1, 4])

    def has_defects(self, k: int) -> bool:
        """Whether all defects of a run are known."""
        return not math.isnan(self.run_numbers[k, a.DEFECTS])

    def struck(self, k: int) -> bool:
        """Whether a rigid contact was struck in a run."""
        rows = slice(self.ends[k, 5], self.ends[k + 1, 5])
        events, impulses = self.parts["struck"][rows], self.parts["impacts"][rows, 0]
        return bool(np.any(impulses[self.parts["kinds"][events, 1] != a.SHARED] > 0))

    def motion(self, k: int) -> Motion:
        """The k-th run as a motion that has reached the end."""
        (s, _, _, e, left, i), (s_end, _, _, e_end, left_end, i_end) = self.ends[k : k + 2].tolist()
        parts, rows, visited = self.parts, self.parts["rows"][s:s_end].copy(), self._visited(k)
        number, piece, start, waits = rows[-1].tolist()
        level = self.levels[number]
        n, exits = level.level.modes, len(exits_of(level))
        phases = parts["phases"][waits : waits + exits].tolist() if waits >= 0 else [a.ARMED] * exits
        x = parts["coordinates"][start : start + 2 * n]
        evaluations, transitions = self.run_numbers[k, OF_A_RUN:].tolist()
        counts = piece, evaluations, int(transitions)
        state = LoopState(self.run_numbers[k, :OF_A_RUN], level, x[:n], x[n:], tuple(phases), *counts)
        numbers = np.zeros(len(self.levels), int)
        numbers[visited] = range(len(visited))
        rows[:, 0] = numbers[rows[:, 0]]
        arrays = {
            "rows": rows[:-1],
            "phases": parts["phases"],
            "left_out": parts["left_out"][left:left_end] - s,
            "kinds": parts["kinds"][e:e_end],
            "struck": parts["struck"][i:i_end] - e,
            "instants": parts["instants"][s:s_end],
            "coordinates": parts["coordinates"],
            "amounts": parts["amounts"][e:e_end],
            "impacts": parts["impacts"][i:i_end],
        }
        levels = [self.levels[number] for number in visited]
        part = RecordPart(levels, s_end - s - 1, left_end - left, int(self.events[k]), lambda: arrays)
        motion = Motion(self.arrays, self.starts[k])
        motion.take_result(part, state)
        return motion
