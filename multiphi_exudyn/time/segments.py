"""Segments: the motion in one level between two events, as a sum of exponentials (eq. 38.4).

    xi(t) = Re V (c exp(lambda (t - t_k))) + Re sum_j exp(mu_j (t - t_k)) sum_d x_jd ((t - t_k) / T)^d   on [t_k, t_k+1]

xi = (eta, w) are the modes of the level and its channels. The first sum is the free response, the second the response
to the present piece of every channel (core/forced_response.hpp).

Displacements, gaps and forces are rows (2 n + 1,) of (xi, xi', 1), n coordinates, of a level:

    x of a point    phi.(Phi_l xi + x_inf,l)          gap  g = h.x + gap       lambda  of the pressing links
    T = -lambda of the held link in stick; in slip -push, or s mu N where it follows the force of another link
    position of the patch on the counter-surface: the held place w in stick, w + q - stretch in slip, q of that link
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from multiphi_exudyn.display import Shown
from multiphi_exudyn.mathematics.exponentials import Exponentials
from multiphi_exudyn.time.loaded_level import LoadedLevel
from multiphi_exudyn.time.state import Phase

__all__ = ["Segment", "Segments", "force_row", "gap_row", "panels", "patch_row", "point_row", "pressing_row"]

MOST_SAMPLES = 10_000  # of a gap in one segment: bounds the cost of its smallest value
NODES = 20  # of the Gauss-Legendre quadrature on a panel
PANEL = 6.0  # rad, the phase of the fastest exponential on it: exact to round-off for products of two
CHUNK = 512  # panels evaluated at a time


@dataclass(frozen=True, repr=False)
class Segment(Shown):
    """Motion in one level from ``start`` to ``end`` [s], xi = Re rows phi(t - start).

    rows: (n, p), those of the first ``free`` terms are the free response. phases: of every exit at the start; armed_at:
    delay [s] until the last of them is armed.
    """

    start: float
    end: float
    level: LoadedLevel
    basis: Exponentials
    rows: np.ndarray
    free: int
    phases: tuple[Phase, ...] = ()
    armed_at: float = 0.0

    def _facts(self) -> Iterator[tuple[str, str]]:
        yield "time", f"{self.start:.6g} to {self.end:.6g} s"
        yield "states", str(self.level.states)

    def modal(self, t: np.ndarray, derivative: int = 0) -> np.ndarray:
        """xi or its first or second derivative, (n, k) at times (k,)."""
        rows = self.rows
        for _ in range(derivative):
            rows = self.basis.derivative(rows)
        return np.asarray((rows @ self.basis.at(t - self.start).T).real)

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
        """Integral over time of a row (2 n + 1,); the free response in closed form."""
        rows, free, n = self.rows, self.free, len(row) // 2
        terms = row[:n] @ rows + row[n:-1] @ self.basis.derivative(rows)
        basis = Exponentials(self.basis.rates[:free], self.basis.powers[:free], self.basis.unit)
        integral = float((basis.shifted(terms[:free], start - self.start) @ basis.integrals(end - start)).real)
        for times, weights in panels(self.basis.rates[free:], start, end):
            integral += float(((self.basis.at(times - self.start)[:, free:] @ terms[free:]).real) @ weights)
        return integral + float(row[-1]) * (end - start)

    def energy(self, t: np.ndarray) -> np.ndarray:
        """Kinetic + strain energy (k,) [J] at times (k,)."""
        return np.asarray(self.level.kinetic(self.modal(t, 1)) + self.level.strain(self.modal(t)))

    def unarmed_times(self, samples: int) -> np.ndarray:
        """Times (k,) from the start until the only unarmed exit is armed, or to the end where several are unarmed.

        ``samples`` in the shortest period of the level and at least as many in all.
        """
        unarmed = sum(phase is not Phase.ARMED for phase in self.phases)
        end = self.start + self.armed_at if unarmed == 1 and self.armed_at > 0 else self.end
        periods = self.level.level.highest_frequency * (end - self.start)
        return np.linspace(self.start, end, samples + math.ceil(min(samples * periods, MOST_SAMPLES)))


class Segments(Sequence[Segment]):
    """The segments of a motion in order, with values of many of them as arrays.

    starts, ends: (n,) [s]. levels: the visited levels, each once. numbers: (n,) of the segments' levels.
    """

    def __init__(self, segments: Sequence[Segment]) -> None:
        self._segments = segments
        places = dict[tuple[int, ...], int]()  # by states: a level may have been built twice
        self.levels: Sequence[LoadedLevel] = []
        for segment in segments:
            if segment.level.states not in places:
                places[segment.level.states] = len(places)
                self.levels.append(segment.level)
        self.numbers = np.array([places[segment.level.states] for segment in segments], np.int64)
        self.starts = np.array([segment.start for segment in segments])
        self.ends = np.array([segment.end for segment in segments])

    def __len__(self) -> int:
        return len(self._segments)

    def __getitem__(self, index: Any) -> Any:
        return self._segments[index]

    def __repr__(self) -> str:
        return repr(tuple(self))

    @property
    def visited(self) -> tuple[tuple[int, ...], ...]:
        """States of the elements of the visited levels."""
        return tuple([level.states for level in self.levels])

    def owners(self, times: np.ndarray, side: str = "right") -> np.ndarray:
        """Indices (k,) of the segments of times (k,) [s], at an event of the one on the ``side``."""
        return np.maximum(np.searchsorted(self.starts, times, side="left" if side == "left" else "right") - 1, 0)

    def states(self, places: np.ndarray, after: np.ndarray) -> np.ndarray:
        """xi and xi' (2, k, n) of the segments ``places`` (k,), times ``after`` (k,) [s] their starts.

        n: largest number of coordinates of a level; coordinates beyond those of a level are zero.
        """
        states = np.zeros((2, len(places), max(level.width for level in self.levels)))
        for place in np.unique(places).tolist():
            chosen, segment = np.flatnonzero(places == place), self[place]
            for derivative in range(2):
                xi = segment.modal(segment.start + after[chosen], derivative)
                states[derivative, chosen, : len(xi)] = xi.T
        return states

    def values(self, times: np.ndarray, side: str, row: Callable[[Any], np.ndarray]) -> np.ndarray:
        """row.(xi, xi', 1) (k,) at times (k,) [s]; row: (2 n + 1,) of a level."""
        places, values = self.owners(times, side), np.empty(len(times))
        x, v = self.states(places, times - self.starts[places])
        for number in np.unique(self.numbers[places]).tolist():
            level, in_level = self.levels[number], self.numbers[places] == number
            n, function = level.width, row(level)
            values[in_level] = x[in_level, :n] @ function[:n] + v[in_level, :n] @ function[n:-1] + function[-1]
        return values

    def evaluated(
        self, times: np.ndarray, side: str, values: Callable[[Segment, np.ndarray], np.ndarray]
    ) -> np.ndarray:
        """``values`` (..., k) of the segments that own the times (k,) [s], in the order of the times."""
        owner = self.owners(times, side)
        order = np.argsort(owner, kind="stable")
        parts = np.split(order, np.flatnonzero(np.diff(owner[order])) + 1)
        found = [values(self[owner[part[0]]], times[part]) for part in parts]
        return np.concatenate(found, axis=-1)[..., np.argsort(order)]

    def integral(self, row: Callable[[Any], np.ndarray], first: float, last: float) -> float:
        """Integral over [first, last] [s] of row.(xi, xi', 1); row: (2 n + 1,) of a level."""
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

    def intervals(self, holds: Callable[[Any], bool]) -> list[tuple[float, float]]:
        """Intervals [s] of the levels for which ``holds`` is true, instants left out."""
        intervals: list[tuple[float, float]] = []
        if not len(self):
            return intervals
        chosen = np.array([holds(level) for level in self.levels], bool)
        places = np.flatnonzero(chosen[self.numbers] & (self.ends > self.starts))
        for start, end in zip(self.starts[places].tolist(), self.ends[places].tolist(), strict=True):
            if intervals and intervals[-1][1] == start:
                intervals[-1] = (intervals[-1][0], end)
            else:
                intervals.append((start, end))
        return intervals


def point_row(row: np.ndarray, level: LoadedLevel) -> np.ndarray:
    """Displacement [m] of a point, row (m,) in base coordinates."""
    place = row @ level.level.vectors
    return np.concatenate([place, np.zeros(len(place)), [row @ level.asymptotic.configuration]])


def gap_row(element: int, level: LoadedLevel) -> np.ndarray:
    """Gap [m]."""
    gap = level.level.gap_rows[element]
    return np.concatenate([gap, np.zeros(len(gap)), [level.gap_constants[element]]])


def force_row(element: int, level: LoadedLevel) -> np.ndarray:
    """Friction force T [N]."""
    link, push = _held_link(level, element), level.state_of(element).push
    if link in level.level.indices:
        row = -_link_row(level, link)
        row[-1] -= push
        return row
    place, rate, constant = level.rubbing(element)
    return np.concatenate([place, rate, [constant - push]])


def patch_row(element: int, level: LoadedLevel) -> np.ndarray:
    """Position [m] of the patch of friction on its counter-surface."""
    modes, link = level.level, _held_link(level, element)
    held_links = [k for k, other in enumerate(modes.base.links) if other.held]
    row = np.zeros(2 * modes.modes + 1)
    row[modes.modes - len(held_links) + held_links.index(link)] = 1.0
    if link not in modes.indices:
        stretch, constant = level.stretch(element)
        row[: modes.modes] += modes.gap_rows[link] - stretch
        row[-1] = level.gap_constants[link] - constant
    return row


def pressing_row(element: int, level: LoadedLevel) -> np.ndarray:
    """Contact force lambda [N], with friction or without; -F of a force law."""
    base, row = level.level.base, np.zeros(2 * level.level.modes + 1)
    row[-1] = -base.laws[element].constant if element in base.laws else 0.0
    for link, sign in base.pressing(element).items():
        if link in level.level.indices:
            row += sign * _link_row(level, link)
    return row


def _held_link(level: LoadedLevel, element: int) -> int:
    """Link of an element that has a held place."""
    base = level.level.base
    return next(k for k in base.link_indices[element] if base.links[k].held)


def _link_row(level: LoadedLevel, link: int) -> np.ndarray:
    """lambda [N] of a link that acts in the level."""
    modal_level = level.level
    k = modal_level.indices.index(link)
    return np.concatenate([modal_level.force_rows[k], modal_level.force_rate_rows[k], [level.asymptotic.forces[k]]])


def panels(rates: np.ndarray, start: float, end: float) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Times and weights, in parts, of the integral from start to end [s] of exponentials (p,); none where p = 0."""
    if not len(rates):
        return
    fastest = float(np.max(np.abs(rates)))
    count = max(1, math.ceil(fastest * (end - start) / PANEL))
    width, (nodes, weights) = (end - start) / count, _gauss_legendre()
    for first in range(0, count, CHUNK):
        lefts = start + width * np.arange(first, min(count, first + CHUNK))
        yield (lefts[:, None] + width * nodes).ravel(), np.tile(width * weights, len(lefts))


@functools.cache
def _gauss_legendre() -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights on [0, 1]."""
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    return (nodes + 1) / 2, weights / 2
