"""Segment: the motion in one level between two events, as a sum of exponentials (eq. 38.4).

    xi(t) = Re V (c phi(t - t_k))   on [t_k, t_k+1]

Gaps, contact forces and energies follow in closed form, works by quadrature.

Segment flow: the motion of a level during one piece of every channel, in closed form.

    xi(t) = Re V (c exp(lambda t)) + Re sum_j exp(mu_j t) sum_k x_jk (t/T)^k

xi = (eta, w) as in channels.py, T the horizon, so that no power outgrows the motion; the free response and the
closed-form response to the present piece of every channel (core/forced_response.hpp). Without channels there is no sum.

Level rows: displacements, gaps and forces as linear functions of the coordinates of a level.

    x of a point    phi.(Phi_l xi + x_inf,l)          gap  g = h.x + gap       lambda  of the pressing links
    T = -lambda of the held link in stick; in slip -push, or s mu N where it follows the force of another link
    position of the patch on the counter-surface: the held place w in stick, w + q - stretch in slip, q of that link

Rows (2 n + 1,) of (xi, xi', 1), n coordinates, for a level and a point's row (m,) or an element's position.

Quadrature of a segment's motion: integrals of sums of exponentials, and works of damping, loads and friction.

The work of varying loads is that of the loads, of the stops of compliant contacts and of those of rigid ones,

    f.y' + lambda s w' + (Y w').(M y'' + C y' + K y - f)

Gauss-Legendre quadrature is exact to round-off on panels short beside the shortest period.
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
from multiphi_exudyn.events.transitions.exits import state_of
from multiphi_exudyn.events.transitions.state import Phase
from multiphi_exudyn.mathematics.exponentials import Exponentials

__all__ = [
    "Flow",
    "Segment",
    "SegmentList",
    "Segments",
    "as_segments",
    "force_row",
    "gap_row",
    "owners",
    "panels",
    "patch_row",
    "point_row",
    "pressing_row",
    "works",
]

MOST_SAMPLES = 10_000  # of a gap in one segment: bounds the cost of its smallest value


NODES = 20  # of the quadrature on a panel
PANEL = 6.0  # rad, the phase of the fastest exponential on it: products of two have twice that
CHUNK = 512  # panels evaluated at a time


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
        """Sum of |defect|^2 (truncation.py) [m2 kg], nan where the loop has not summed them."""
        return math.nan

    @property
    def truncated(self) -> float:
        """Sum of the absolute energies [J] lost to truncation at events, nan where the loop has not summed them."""
        return math.nan

    @property
    def verdict(self) -> tuple[float, float]:
        """Effect of truncation on the run, nan where it is not known."""
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


@dataclass(frozen=True)
class Flow:
    """xi(t) = Re shapes (coefficients * basis) after a state; the first ``free`` of p terms are the free response."""

    basis: Exponentials
    shapes: np.ndarray
    coefficients: np.ndarray
    free: int


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
    link, push = _held_link(level, element), state_of(level, element).push
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


def works(
    level: LoadedLevel, modal: Callable[[np.ndarray, int], np.ndarray], rates: np.ndarray, start: float, end: float
) -> tuple[float, float, float]:
    """Work [J] of damping, varying loads and friction; modal: xi or a derivative (n, k) at times (k,)."""
    damping = varying = friction = 0.0
    for times, weights in panels(rates, start, end):
        xi, xi_t, xi_tt = (modal(times, derivative) for derivative in range(3))
        damping += float(weights @ _dissipation(level, xi_t))
        varying += float(weights @ _power(level, xi, xi_t, xi_tt))
        friction -= float(weights @ (level.pushes @ level.level.gap_rows @ xi_t))
        friction += sum(
            float(weights @ (tension * speed)) for tension, speed, _ in _following_friction(level, xi, xi_t)
        )
    follows = level.follows
    for sign, time in ((1, start), (-1, end)):
        stretched = follows[:, :-1] @ modal(np.array([time]), 0)[:, 0] + follows[:, -1]
        friction += sign * 0.5 * float(stretched @ stretched)
    return damping, varying, friction


def _following_friction(
    level: LoadedLevel, xi: np.ndarray, xi_t: np.ndarray
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """T (k,) [N] of friction that follows other forces, slip speed (k,) [m/s], and s (q,) of its counter-surface."""
    inner, base = level.level, level.level.base
    for i in level.rubbing_elements:
        held = next(k for k in base.link_indices[i] if base.links[k].held)
        place, rate, constant = level.rubbing(i)
        yield place @ xi + rate @ xi_t + constant, inner.gap_rows[held] @ xi_t, level.excitation.stops[held]


def _dissipation(level: LoadedLevel, xi_t: np.ndarray) -> np.ndarray:
    """Power (k,) [W] dissipated by damping."""
    base, index, modal = level.level.base, list(level.level.indices), level.modal
    velocity, dampers, eta_t = level.motion(xi_t), _dampers(level, xi_t), level.split(xi_t)[0]
    coefficients = base.dampings[index]
    viscous = np.divide(dampers.T**2, coefficients, out=np.zeros_like(dampers.T), where=coefficients > 0)
    # damping matrix of given ratios
    from_ratios = modal.damping - modal.vectors.T @ base.damping_matrix(modal.indices) @ modal.vectors
    total = np.sum(velocity * (base.damping @ velocity), axis=0) + np.sum(eta_t * (from_ratios @ eta_t), axis=0)
    return np.asarray(total + np.sum(viscous, axis=1))


def _dampers(level: LoadedLevel, xi_t: np.ndarray) -> np.ndarray:
    """c g' (k, times) [N] of the closed contacts: the forces of their dampers."""
    index = list(level.level.indices)
    return np.asarray(level.level.base.dampings[index][:, None] * (level.level.speed_rows[index] @ xi_t))


def _power(level: LoadedLevel, xi: np.ndarray, xi_t: np.ndarray, xi_tt: np.ndarray) -> np.ndarray:
    """Power (k,) [W] of the channels."""
    base, carried = level.level.base, level.channels.carried
    w, w_t = level.split(xi)[1], level.split(xi_t)[1]
    varying = level.excitation.patterns @ w
    power = np.sum(varying * (level.level.vectors @ xi_t), axis=0)
    index = list(level.level.indices)
    stiffness = np.where(np.isinf(base.stiffnesses[index]), 0.0, base.stiffnesses[index])
    gaps = level.level.gap_rows[index] @ xi + level.gap_constants[index][:, None]
    springs = stiffness[:, None] * gaps + _dampers(level, xi_t)
    residual = np.isin(index, base.residual)
    springs[residual] = -(level.level.force_rows[residual] @ xi + level.asymptotic.forces[residual, None])
    power -= np.sum(springs * (level.excitation.stops[index] @ w_t), axis=0)
    power += level.pushes @ level.excitation.stops @ w_t
    for tension, _, surface in _following_friction(level, xi, xi_t):
        power -= tension * (surface @ w_t)
    if np.any(carried):
        y, velocity, acceleration = level.configuration(xi), level.motion(xi_t), level.motion(xi_tt)
        load = (level.excitation.static + base.preload + base.pushes @ level.pushes)[:, None] + varying
        remainder = acceleration + base.damping @ velocity + (base.modes.omega**2 * y.T).T - load
        remainder += base.pushes[:, index] @ (springs - _reactions(level, xi, xi_t))
        power += np.sum((carried @ w_t) * remainder, axis=0)
    return np.asarray(power)


def _reactions(level: LoadedLevel, xi: np.ndarray, xi_t: np.ndarray) -> np.ndarray:
    """Forces (k, times) [N] of the closed rigid contacts that slide; their friction acts on the carried motion."""
    inner, index = level.level, list(level.level.indices)
    forces = inner.force_rows @ xi + inner.force_rate_rows @ xi_t + level.asymptotic.forces[:, None]
    slides = [link in inner.base.oblique and np.isinf(inner.base.stiffnesses[link]) for link in index]
    return np.where(np.array(slides, bool)[:, None], forces, 0.0)


@functools.cache
def _gauss_legendre() -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights on [0, 1]."""
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    return (nodes + 1) / 2, weights / 2
