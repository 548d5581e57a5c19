"""Segment: the motion in one level between two events, as a sum of exponentials (eq. 38.4, segment_flow.py).

    xi(t) = Re V (c phi(t - t_k))   on [t_k, t_k+1]

Gaps, contact forces and energies follow in closed form, works by quadrature.
"""

from __future__ import annotations

import functools
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from multiphi_exudyn._core import MOTION_SAMPLES as SAMPLES
from multiphi_exudyn.display import Shown
from multiphi_exudyn.events.excitation.loaded_level import LoadedLevel
from multiphi_exudyn.events.transitions.state import Phase
from multiphi_exudyn.mathematics.exponentials import Exponentials
from multiphi_exudyn.time.segments.quadrature import panels, works
from multiphi_exudyn.time.segments.segment_flow import Flow

__all__ = ["Segment", "SegmentList", "Segments", "as_segments", "owners"]

MOST_SAMPLES = 10_000  # of a gap in one segment: bounds the cost of its smallest value


@dataclass(frozen=True, repr=False)
class Segment(Shown):
    """Motion in one level from ``start`` to ``end`` [s]; flow: its closed form, c (p,) its coefficients.

    phases: of every exit at the start; armed_at: delay [s] until the last of them is armed. entry_work: work [J] of
    jumps at the start.
    """

    start: float
    end: float
    level: LoadedLevel
    flow: Flow
    phases: tuple[Phase, ...]
    armed_at: float
    entry_work: float = 0.0

    def _facts(self) -> Iterator[tuple[str, str]]:
        yield "time", f"{self.start:.6g} to {self.end:.6g} s"
        yield "states", str(self.level.states)

    def modal(self, t: np.ndarray, derivative: int = 0) -> np.ndarray:
        """xi or its first or second derivative, (r + q, k) at times (k,)."""
        rows = self.rows
        for _ in range(derivative):
            rows = self.basis.derivative(rows)
        return np.asarray((rows @ self.basis.at(t - self.start).T).real)

    @property
    def basis(self) -> Exponentials:
        """The exponentials phi (p,) of the motion."""
        return self.flow.basis

    @property
    def rows(self) -> np.ndarray:
        """xi = Re rows phi(t - start), (r + q, p)."""
        return self.flow.shapes * self.flow.coefficients

    def gaps(self, contact: int, t: np.ndarray) -> np.ndarray:
        """Gap (k,) [m] of a contact at times (k,)."""
        return np.asarray(self.level.level.gap_rows[contact] @ self.modal(t) + self.level.gap_constants[contact])

    def force(self, contact: int, t: np.ndarray) -> np.ndarray:
        """Contact force (k,) [N] at times (k,), zero where the contact is open."""
        level = self.level.level
        if contact not in level.indices:
            return np.zeros(len(t))
        k = level.indices.index(contact)
        moving = level.force_rows[k] @ self.modal(t) + level.force_rate_rows[k] @ self.modal(t, 1)
        return np.asarray(moving + self.level.asymptotic.forces[k])

    def integral(self, row: np.ndarray, start: float, end: float) -> float:
        """Integral over time of a row (2 (r + q) + 1,) of (xi, xi', 1); the free response in closed form."""
        rows, free, n = self.rows, self.flow.free, len(row) // 2
        terms = row[:n] @ rows + row[n:-1] @ self.basis.derivative(rows)
        basis = Exponentials(self.basis.rates[:free], self.basis.powers[:free], self.basis.unit)
        integral = float((basis.shifted(terms[:free], start - self.start) @ basis.integrals(end - start)).real)
        for times, weights in panels(self.basis.rates[free:], start, end):
            integral += float(((self.basis.at(times - self.start)[:, free:] @ terms[free:]).real) @ weights)
        return integral + float(row[-1]) * (end - start)

    def energy(self, t: np.ndarray) -> np.ndarray:
        """Kinetic + strain energy (k,) [J] at times (k,)."""
        return np.asarray(self.level.kinetic(self.modal(t, 1)) + self.level.strain(self.modal(t)))

    @functools.cached_property
    def works(self) -> tuple[float, float, float]:
        """Work [J] of damping, of loads and stops that vary in time, and of friction."""
        damping, varying, friction = works(self.level, self.modal, self.basis.rates, self.start, self.end)
        return damping, self.entry_work + varying, friction

    def unarmed_times(self, samples: int) -> np.ndarray:
        """Times (k,) from the start until the only unarmed exit is armed, or to the end where several are unarmed.

        ``samples`` in the shortest period of the level and at least as many in all.
        """
        unarmed = sum(phase is not Phase.ARMED for phase in self.phases)
        end = self.start + self.armed_at if unarmed == 1 and self.armed_at > 0 else self.end
        periods = self.level.level.highest_frequency * (end - self.start)
        return np.linspace(self.start, end, samples + math.ceil(min(samples * periods, MOST_SAMPLES)))


class Segments(Sequence[Segment], ABC):
    """The segments of a run in order, with values of many of them as arrays."""

    @property
    def defects(self) -> float:
        """Sum of |defect|^2 (defects.py) [m2 kg], nan where the loop has not summed them."""
        return math.nan

    @property
    def truncated(self) -> float:
        """Sum of the absolute energies [J] lost to truncation at events, nan where the loop has not summed them."""
        return math.nan

    @property
    def verdict(self) -> tuple[float, float]:
        """Effect of truncation on the run (verdict.py), nan where it is not known."""
        return math.nan, math.nan

    @property
    @abstractmethod
    def starts(self) -> np.ndarray:
        """Start times (n,) [s]."""

    @property
    @abstractmethod
    def ends(self) -> np.ndarray:
        """End times (n,) [s]."""

    @property
    @abstractmethod
    def numbers(self) -> np.ndarray:
        """Indices (n,) of their levels in ``levels``."""

    @property
    @abstractmethod
    def settled(self) -> np.ndarray:
        """Whether (n,) every exit is armed at the start: then no signal is below zero in the segment."""

    @property
    @abstractmethod
    def levels(self) -> Sequence[LoadedLevel]:
        """The visited levels, each once."""

    @property
    def visited(self) -> tuple[tuple[int, ...], ...]:
        """States of the elements of the visited levels."""
        return tuple([level.states for level in self.levels])

    @abstractmethod
    def states(self, places: np.ndarray, after: np.ndarray) -> np.ndarray:
        """xi and xi' (2, k, n) of the segments ``places`` (k,), times ``after`` (k,) [s] their starts.

        n: largest number of coordinates of a level; coordinates beyond those of a level are zero.
        """

    @abstractmethod
    def values(self, times: np.ndarray, side: str, row: Callable[[LoadedLevel], np.ndarray]) -> np.ndarray:
        """row.(xi, xi', 1) (k,) at times (k,) [s], at an event from the ``side`` "left" or "right".

        row: (2 n + 1,) of a level with n coordinates.
        """

    @abstractmethod
    def sizes(self, end: float) -> tuple[float, float]:
        """Mean of |y|^2 [m2 kg] and largest energy [J] from the first start to ``end`` [s], from SAMPLES even instants.

        The mean is that of a polygon through them; energy: kinetic and strain, its absolute value.
        """

    @property
    @abstractmethod
    def works(self) -> tuple[float, float, float]:
        """Work [J] of damping, of loads and stops that vary in time, and of friction."""

    def integral(self, row: Callable[[LoadedLevel], np.ndarray], first: float, last: float) -> float:
        """Integral over [first, last] [s] of row.(xi, xi', 1); row: (2 n + 1,) of a level with n coordinates."""
        total, starts, ends = 0.0, np.maximum(self.starts, first), np.minimum(self.ends, last)
        for number, level in enumerate(self.levels):
            if np.any(function := row(level)):
                places = np.flatnonzero((self.numbers == number) & (starts < ends))
                total += self._integral(level, function, places, starts[places], ends[places]) if len(places) else 0.0
        return total

    def _integral(
        self, level: LoadedLevel, row: np.ndarray, places: np.ndarray, starts: np.ndarray, ends: np.ndarray
    ) -> float:
        """Integral from ``starts`` to ``ends`` in segments ``places`` (k,) of one level."""
        parts = zip(places.tolist(), starts.tolist(), ends.tolist(), strict=True)
        return sum(self[place].integral(row, start, end) for place, start, end in parts)

    def evaluated(
        self, times: np.ndarray, side: str, values: Callable[[Segment, np.ndarray], np.ndarray]
    ) -> np.ndarray:
        """``values`` (..., k) of the segments that own the times (k,) [s], in the order of the times."""
        owner = self.owners(times, side)
        result: np.ndarray | None = None
        for part in np.split(np.argsort(owner, kind="stable"), np.flatnonzero(np.diff(np.sort(owner))) + 1):
            part_values = values(self[owner[part[0]]], times[part])
            if result is None:
                result = np.empty((*part_values.shape[:-1], len(times)))
            result[..., part] = part_values
        assert result is not None
        return result

    def intervals(self, holds: Callable[[LoadedLevel], bool]) -> list[tuple[float, float]]:
        """Intervals [s] of the levels for which ``holds`` is true, instants left out."""
        intervals: list[tuple[float, float]] = []
        places, starts, ends = np.zeros(0, np.int64), self.starts, self.ends
        if len(self):
            chosen = np.array([holds(level) for level in self.levels], bool)
            places = np.flatnonzero(chosen[self.numbers] & (ends > starts))
        for start, end in zip(starts[places].tolist(), ends[places].tolist(), strict=True):
            if intervals and intervals[-1][1] == start:
                intervals[-1] = (intervals[-1][0], end)
            else:
                intervals.append((start, end))
        return intervals

    def owners(self, times: np.ndarray, side: str = "right") -> np.ndarray:
        """Indices (k,) of the segments of times (k,) [s]."""
        return owners(self.starts, times, side)


class SegmentList(Segments):
    """Segments from a sequence of objects."""

    def __init__(self, segments: Sequence[Segment]) -> None:
        self._segments = segments
        # by states: a level may have been built twice
        self._numbered_levels: dict[tuple[int, ...], tuple[int, LoadedLevel]] = {}
        for segment in segments:
            self._numbered_levels.setdefault(segment.level.states, (len(self._numbered_levels), segment.level))

    @functools.cached_property
    def levels(self) -> Sequence[LoadedLevel]:
        """See ``Segments``."""
        return [level for _, level in self._numbered_levels.values()]

    @functools.cached_property
    def numbers(self) -> np.ndarray:
        """See ``Segments``."""
        return np.array([self._numbered_levels[segment.level.states][0] for segment in self._segments], np.int64)

    @functools.cached_property
    def starts(self) -> np.ndarray:
        """See ``Segments``."""
        return np.array([segment.start for segment in self._segments])

    @functools.cached_property
    def ends(self) -> np.ndarray:
        """See ``Segments``."""
        return np.array([segment.end for segment in self._segments])

    @property
    def settled(self) -> np.ndarray:
        """See ``Segments``."""
        return np.array([all(phase is Phase.ARMED for phase in segment.phases) for segment in self._segments], bool)

    def __len__(self) -> int:
        return len(self._segments)

    def __getitem__(self, index: Any) -> Any:
        return self._segments[index]

    def states(self, places: np.ndarray, after: np.ndarray) -> np.ndarray:
        """See ``Segments``."""
        states = np.zeros((2, len(places), max(level.width for level in self.levels)))
        for place in np.unique(places).tolist():
            chosen, segment = np.flatnonzero(places == place), self._segments[place]
            for derivative in range(2):
                xi = segment.modal(segment.start + after[chosen], derivative)
                states[derivative, chosen, : len(xi)] = xi.T
        return states

    def values(self, times: np.ndarray, side: str, row: Callable[[LoadedLevel], np.ndarray]) -> np.ndarray:
        """See ``Segments``."""
        places, values = self.owners(times, side), np.empty(len(times))
        x, v = self.states(places, times - self.starts[places])
        for number in np.unique(self.numbers[places]).tolist():
            level, in_level = self.levels[number], self.numbers[places] == number
            n, function = level.width, row(level)
            values[in_level] = x[in_level, :n] @ function[:n] + v[in_level, :n] @ function[n:-1] + function[-1]
        return values

    def sizes(self, end: float) -> tuple[float, float]:
        """See ``Segments``."""
        times = np.linspace(self.starts[0], end, SAMPLES)
        places, squares, energies = self.owners(times), np.empty(SAMPLES), np.empty(SAMPLES)
        states = self.states(places, times - self.starts[places])
        for k, number in enumerate(self.numbers[places].tolist()):
            level = self.levels[number]
            x, v = states[:, k, : level.width]
            squares[k] = np.sum(level.configuration(x) ** 2)
            energies[k] = level.kinetic(v) + level.strain(x)
        square = (np.sum(squares) - 0.5 * (squares[0] + squares[-1])) / (SAMPLES - 1)
        return float(square), float(np.max(np.abs(energies)))

    @property
    def works(self) -> tuple[float, float, float]:
        """See ``Segments``."""
        damping, varying, friction = np.sum([s.works for s in self._segments], axis=0).tolist()
        return damping, varying, friction


def owners(starts: np.ndarray, times: np.ndarray, side: str) -> np.ndarray:
    """Indices (k,) of the segments, by their starts (n,), of times (k,) [s]."""
    return np.maximum(np.searchsorted(starts, times, side="left" if side == "left" else "right") - 1, 0)


def as_segments(segments: Sequence[Segment]) -> Segments:
    """Return segments as ``Segments``, which have values of many of them as arrays."""
    return segments if isinstance(segments, Segments) else SegmentList(segments)
