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
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from multiphi_exudyn.events.loaded_level import LoadedLevel
from multiphi_exudyn.events.state import event_table
from multiphi_exudyn.levels.modal_base import ModalBase
from multiphi_exudyn.time.segment import Segments, listed
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
    segments, sizes = history.segments, np.sqrt(history.squares).tolist()
    closed = [segments.levels[number].level.closed for number in segments.numbers[history.places].tolist()]
    starts = segments.starts[history.places].tolist()
    return [Defect(*given) for given in zip(starts, closed, sizes, strict=True)]


@dataclass(frozen=True)
class DefectHistory:
    """The defects of a run in arrays.

    segments: of the run. table: its events, as ``event_table`` has them. places: (k,) of the segments that begin with
    a defect. squares: (k,) its |.|^2 [m2 kg]. samples: level, eta and eta' (r, k) at times evenly spaced over [0, end].
    """

    end: float
    segments: Segments
    table: np.ndarray
    places: np.ndarray
    squares: np.ndarray
    samples: list[Sample]

    @classmethod
    def of(cls, trajectory: Trajectory) -> DefectHistory:
        """Of a run with segments."""
        segments, end = listed(trajectory.segments), trajectory.t_end
        table = event_table(trajectory.events, trajectory.model.index)
        stopped = _stopped(table, segments.starts)
        ways = _ways(segments.numbers, stopped)
        entered = np.array([0, *sorted(itertools.chain(*ways.values()))])
        left, times = entered[1:] - 1, np.linspace(trajectory.start.time, end, SAMPLES)
        owners, k = segments.owners(times), len(entered)
        after = np.zeros(k), segments.ends[left] - segments.starts[left], times - segments.starts[owners]
        states = segments.states(np.concatenate([entered, left, owners]), np.concatenate(after))
        first, last, sampled = states[:, :k], states[:, k : 2 * k - 1], states[:, 2 * k - 1 :]
        squares = np.empty(k)
        squares[0] = _at_start(trajectory, segments.levels[segments.numbers[0]], stopped.get(0, ()), first[:, 0])
        for (before, after_it, struck), places in ways.items():
            rows = np.searchsorted(entered, places)
            way = _way(segments.levels[before], segments.levels[after_it], struck)
            squares[rows] = way.squares(last[:, rows - 1], first[:, rows])
        return cls(end, segments, table, entered, squares, _by_level(segments, owners, sampled))

    @property
    def largest_energy(self) -> float:
        """The largest kinetic + strain energy [J] of the run, without its sign."""
        energies = (level.kinetic(eta_t) + level.strain(eta) for level, eta, eta_t in self.samples)
        return max(float(np.max(np.abs(energy), initial=0.0)) for energy in energies)

    def indicator(self, end: float) -> float:
        """The truncation indicator of [0, end] (truncation.py)."""
        lost = float(np.sum(self.squares[self.segments.starts[self.places] <= end]))
        samples = self.samples if end == self.end else _samples(self.segments, end)
        amplitude = math.sqrt(sum(_square(level, eta) for level, eta, _ in samples) / SAMPLES)
        if amplitude == 0:
            return math.inf if lost else 0.0
        return math.sqrt(lost) / amplitude


def _samples(segments: Segments, end: float) -> list[Sample]:
    """The motion at times evenly spaced up to ``end`` [s]."""
    times = np.linspace(segments.starts[0], end, SAMPLES)
    owners = segments.owners(times)
    return _by_level(segments, owners, segments.states(owners, times - segments.starts[owners]))


def _square(level: LoadedLevel, eta: np.ndarray) -> float:
    """Sum of |y|^2 over the columns of eta (r, k), by a factor that the level keeps."""
    if "place" not in level.entries:
        level.entries["place"] = _factor(np.column_stack([level.level.vectors, level.asymptotic.configuration]))
    factor: np.ndarray = level.entries["place"]
    return float(np.sum((factor[:, :-1] @ eta + factor[:, -1:]) ** 2))


def _by_level(segments: Segments, owners: np.ndarray, states: np.ndarray) -> list[Sample]:
    """States (2, k, n) of the segments ``owners`` (k,), level by level."""
    numbers, samples = segments.numbers[owners], list[Sample]()
    for number in dict.fromkeys(numbers.tolist()):
        level = segments.levels[number]
        eta, eta_t = states[:, numbers == number, : level.level.modes]
        samples.append((level, eta.T, eta_t.T))
    return samples


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
    """The maps into a level, which keeps them: under one load a level has one neighbour with given states."""
    key = before.states, stopped
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
    base, held, r = level.level.base, _held(level), level.level.modes
    given = trajectory.start
    d = _allowed(base, held, given.displacement - level.configuration(state[0, :r]))
    v = _allowed(base, held | set(stopped), given.velocity - level.level.vectors @ state[1, :r])
    w = _over_omega(base, v)
    return float(d @ d + w @ w)


def _held(level: LoadedLevel) -> set[int]:
    """The closed rigid contacts."""
    return {i for i in level.level.indices if level.level.base.links[i].rigid}


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
    numbers: np.ndarray, stopped: dict[int, tuple[int, ...]]
) -> dict[tuple[int, int, tuple[int, ...]], list[int]]:
    """Places of the segments that begin in another level or after an impact, by their levels and who was stopped.

    numbers: (n,) of the levels of all segments.
    """
    ways: dict[tuple[int, int, tuple[int, ...]], list[int]] = {}
    begins = np.append(False, numbers[1:] != numbers[:-1])
    begins[[place for place in stopped if place > 0]] = True
    entered = np.flatnonzero(begins)
    for place, before, after in zip(
        entered.tolist(), numbers[entered - 1].tolist(), numbers[entered].tolist(), strict=True
    ):
        ways.setdefault((before, after, stopped.get(place, ())), []).append(place)
    return ways
