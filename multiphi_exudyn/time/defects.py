"""Defects: what the modes of a level could not hold of the motion that came into it.

Inside a level every kept mode moves as it would among all modes, so what a truncated answer lacks came in where a level
was entered, and where a rigid contact was struck. There the state before, y and v, is known in all modes of the base,
and so is what all modes would make of it: P takes out the motion that closed rigid contacts prevent, Q also that which
an impact has stopped. The difference to the state after it is the defect

    d = P (y - Psi eta - y_inf),   w = Q (v - Psi eta'),   |defect|^2 = |d|^2 + |w / Omega|^2

in the displacement norm of the mass matrix: w / Omega is the displacement that a lost velocity would have become in the
open level, to which it comes back. At the start it is the static residual of the starting configuration. From level to
level d and w / Omega are linear in the states before and after; of these maps the triangular factors are kept, a few
numbers per pair of levels.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from multiphi_exudyn.events.state import event_table
from multiphi_exudyn.events.transition import LoadedLevel
from multiphi_exudyn.levels.modal_base import ModalBase
from multiphi_exudyn.time.segment import Batch, batches
from multiphi_exudyn.time.trajectory import Trajectory

__all__ = ["Defect", "DefectHistory", "defects"]

Sample: TypeAlias = tuple[LoadedLevel, np.ndarray, np.ndarray]

SAMPLES = 100  # of the motion, for its mean square


@dataclass(frozen=True)
class Defect:
    """What the level entered at ``time`` [s] could not hold; closed: its contacts; size: of the defect [m sqrt(kg)]."""

    time: float
    closed: tuple[str, ...]
    size: float


def defects(trajectory: Trajectory) -> list[Defect]:
    """The defect of the start, of every transition to another level and of every impact, in order of time."""
    history = DefectHistory.of(trajectory)
    starts, sizes = history.starts.tolist(), np.sqrt(history.squares).tolist()
    return [Defect(starts[k], history.levels[k].level.closed, sizes[k]) for k in history.places]


@dataclass(frozen=True)
class DefectHistory:
    """The defects of a run in arrays.

    parts: the run's segments. table: its events, as ``event_table`` has them. starts: (s,) [s], levels: of every
    segment. places: of the segments that begin with a defect. squares: (s,) its |.|^2 [m2 kg], else zero. samples:
    level, eta and eta' (r, k) at times evenly spaced over [0, end].
    """

    end: float
    parts: list[Batch]
    table: np.ndarray
    starts: np.ndarray
    levels: list[LoadedLevel]
    places: list[int]
    squares: np.ndarray
    samples: list[Sample]

    @classmethod
    def of(cls, trajectory: Trajectory) -> DefectHistory:
        """Of a run with segments."""
        parts, count = batches(trajectory.segments), len(trajectory.segments)
        table = event_table(trajectory.events, trajectory.model.index)
        starts, squares, levels = np.empty(count), np.zeros(count), [parts[0].level] * count
        first, last = np.zeros((2, 2, count, max(len(part.shapes) for part in parts)))
        for part in parts:
            starts[part.places] = part.starts
            for place in part.places.tolist():
                levels[place] = part.level
        times = np.linspace(0.0, trajectory.t_end, SAMPLES)
        owners, samples = np.searchsorted(starts, times, side="right") - 1, list[Sample]()
        for part in parts:
            k, r, (rows, own) = len(part.places), len(part.shapes), _rows(part, owners)
            every = np.arange(k)
            after = np.concatenate([np.zeros(k), part.ends - part.starts, times[own] - part.starts[rows]])
            states = part.states(np.concatenate([every, every, rows]), after)
            first[:, part.places, :r], last[:, part.places, :r] = states[:, :k], states[:, k : 2 * k]
            samples.append((part.level, states[0, 2 * k :].T, states[1, 2 * k :].T))
        stopped = _stopped(table, starts)
        squares[0] = _at_start(trajectory, levels[0], stopped.get(0, ()), first[:, 0])
        ways = _ways(levels, stopped)
        for (_, _, struck), found in ways.items():
            entered = np.array(found)
            way = _way(levels[found[0] - 1], levels[found[0]], struck)
            squares[entered] = way.squares(last[:, entered - 1], first[:, entered])
        places = sorted([0, *(place for found in ways.values() for place in found)])
        return cls(trajectory.t_end, parts, table, starts, levels, places, squares, samples)

    @property
    def largest_energy(self) -> float:
        """The largest kinetic + strain energy [J] of the run, without its sign."""
        energies = (level.kinetic(eta_t) + level.strain(eta) for level, eta, eta_t in self.samples)
        return max(float(np.max(np.abs(energy), initial=0.0)) for energy in energies)

    def indicator(self, end: float) -> float:
        """The truncation indicator of [0, end] (truncation.py)."""
        lost = float(np.sum(self.squares[self.starts <= end]))
        samples = self.samples if end == self.end else self._sampled(end)
        amplitude = math.sqrt(sum(float(np.sum(level.configuration(eta) ** 2)) for level, eta, _ in samples) / SAMPLES)
        if amplitude == 0:
            return math.inf if lost else 0.0
        return math.sqrt(lost) / amplitude

    def _sampled(self, end: float) -> Iterator[Sample]:
        times = np.linspace(0.0, end, SAMPLES)
        owners = np.searchsorted(self.starts, times, side="right") - 1
        for part in self.parts:
            rows, own = _rows(part, owners)
            eta, eta_t = part.states(rows, times[own] - part.starts[rows])
            yield part.level, eta.T, eta_t.T


def _rows(part: Batch, owners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Which of the segments (k,) by their places are in a batch: their rows in it (j,), and whether they are (k,)."""
    rows = np.minimum(np.searchsorted(part.places, owners), len(part.places) - 1)
    own = part.places[rows] == owners
    return rows[own], own


@dataclass(frozen=True)
class _Way:
    """The maps to defects from level to level: (eta, eta_after, 1) to d, (eta', eta'_after) to w / Omega.

    modes: of either level.
    """

    displaced: np.ndarray
    moving: np.ndarray
    modes: tuple[int, int]

    def squares(self, before: np.ndarray, after: np.ndarray) -> np.ndarray:
        """|defect|^2 (k,) between states (2, k, >= r) at an instant."""
        r, s = self.modes
        states = np.concatenate([before[:, :, :r], after[:, :, :s]], axis=2)
        d = states[0] @ self.displaced[:, :-1].T + self.displaced[:, -1]
        w = states[1] @ self.moving.T
        return np.asarray(np.sum(d * d, axis=1) + np.sum(w * w, axis=1))


def _way(before: LoadedLevel, after: LoadedLevel, stopped: tuple[int, ...]) -> _Way:
    """The maps into a level, which keeps them: under one load a level has one neighbour with given closed contacts."""
    key = before.level.indices, stopped
    if key not in after.entries:
        base, source, target = after.level.base, before.level.vectors, after.level.vectors
        jump = before.asymptotic.configuration - after.asymptotic.configuration
        held = _held(after)
        displaced = _allowed(base, held, np.column_stack([source, -target, jump]))
        moving = _over_omega(base, _allowed(base, held | set(stopped), np.column_stack([source, -target])))
        modes = source.shape[1], target.shape[1]
        after.entries[key] = _Way(_factor(displaced), _factor(moving), modes)
    way: _Way = after.entries[key]
    return way


def _factor(rows: np.ndarray) -> np.ndarray:
    """R with |R z| = |rows z|."""
    return np.asarray(np.linalg.qr(rows, mode="r"))


def _at_start(trajectory: Trajectory, level: LoadedLevel, stopped: tuple[int, ...], state: np.ndarray) -> float:
    """|defect|^2 of the start, whose first state is (2, >= r)."""
    base, held, r = level.level.base, _held(level), level.level.vectors.shape[1]
    given = trajectory.start
    d = _allowed(base, held, given.displacement - level.configuration(state[0, :r]))
    v = _allowed(base, held | set(stopped), given.velocity - level.level.vectors @ state[1, :r])
    w = _over_omega(base, v)
    return float(d @ d + w @ w)


def _held(level: LoadedLevel) -> set[int]:
    """The closed rigid contacts."""
    return {i for i in level.level.indices if level.level.base.contacts[i].rigid}


def _allowed(base: ModalBase, held: set[int], motion: np.ndarray) -> np.ndarray:
    """The part of motions (m, ...) that rigid contacts allow."""
    if not held:
        return motion
    directions = base.directions[:, sorted(held)]
    return motion - directions @ np.linalg.lstsq(directions, motion, rcond=None)[0]


def _over_omega(base: ModalBase, motion: np.ndarray) -> np.ndarray:
    """Motions (m, ...) over Omega, zero where that is zero."""
    omega = base.modes.omega
    weights = np.divide(1.0, omega, out=np.zeros_like(omega), where=omega > 0)
    return np.asarray((motion.T * weights).T)


def _stopped(table: np.ndarray, starts: np.ndarray) -> dict[int, tuple[int, ...]]:
    """Contacts that an impact has stopped, by the place of the segment after it."""
    found: dict[int, tuple[int, ...]] = {}
    struck = table[table[:, 2] > 0]
    places = np.searchsorted(starts, struck[:, 0])
    for place, contact in zip(places.tolist(), struck[:, 1].astype(int).tolist(), strict=True):
        found[place] = tuple(sorted({*found.get(place, ()), contact}))
    return found


def _ways(
    levels: list[LoadedLevel], stopped: dict[int, tuple[int, ...]]
) -> dict[tuple[int, int, tuple[int, ...]], list[int]]:
    """Places of the segments that begin in another level or after an impact, by their levels and who was stopped."""
    ways: dict[tuple[int, int, tuple[int, ...]], list[int]] = {}
    known = list(map(id, levels))
    for place, (before, after) in enumerate(itertools.pairwise(known), start=1):
        if before != after or place in stopped:
            ways.setdefault((before, after, stopped.get(place, ())), []).append(place)
    return ways
