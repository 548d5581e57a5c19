"""The event rule of one model under one load as arrays, level by level, for the compiled loop.

A level is packed when the NumPy loop has visited it, a way between two levels when that loop has computed it. Arrays
are as wide as the largest level packed so far. Complex numbers are rows of real and imaginary parts.

What is packed stays, for trajectories refer to it. Levels that ``PACK_BYTES`` have no room for are left to the NumPy
loop.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from multiphi_exudyn.events.rule import EventRule
from multiphi_exudyn.events.state import Row
from multiphi_exudyn.events.transition import LoadedLevel
from multiphi_exudyn.time.compiled.waves import BOUNDS, SHORTEST

__all__ = ["Levels", "Pack"]

PACK_BYTES = 2**29  # of all arrays of a pack: half of what a model may keep (model.py)
LENGTHS = 56  # interval lengths, each twice the one before


class Levels(NamedTuple):
    """n levels of up to r modes and p exponentials, c contacts.

    sizes (n, 2): modes and exponentials. scales (n, 5): growth, shortest interval [s], refine, highest frequency [Hz],
    potential at rest [J]. rates (n, 2, p). magnitudes (n, p, BOUNDS): |lambda|^k. factors (n, LENGTHS, 2, p).
    from_state (n, 2r, 2, p), to_state (n, p, 2, 2r): between eta, eta' and coefficients.
    squared (n, r): omega^2. damping (n, r, r). closed (n, c). rigid (c,).
    rated (n,): whether the s of a contact feels eta'. own, entered (n, c, 2, r): s of a contact, and s after its
    change, from eta and eta'; their constants (n, c) and signals (n, c, 2, p).
    target (n, c): the level after a contact's change, -1 if the way is not packed. matrix (n, c, r, r), transposed,
    offset (n, c, r): the transition there.
    """

    sizes: np.ndarray
    scales: np.ndarray
    rates: np.ndarray
    magnitudes: np.ndarray
    factors: np.ndarray
    from_state: np.ndarray
    to_state: np.ndarray
    squared: np.ndarray
    damping: np.ndarray
    closed: np.ndarray
    rigid: np.ndarray
    rated: np.ndarray
    own: np.ndarray
    own_constant: np.ndarray
    own_signal: np.ndarray
    entered: np.ndarray
    entered_constant: np.ndarray
    entered_signal: np.ndarray
    target: np.ndarray
    matrix: np.ndarray
    offset: np.ndarray

    @classmethod
    def empty(cls, n: int, r: int, p: int, rigid: np.ndarray) -> Levels:
        """Room for n levels."""
        c = len(rigid)
        return cls(
            sizes=np.zeros((n, 2), np.int64),
            scales=np.zeros((n, 5)),
            rates=np.zeros((n, 2, p)),
            magnitudes=np.zeros((n, p, BOUNDS)),
            factors=np.zeros((n, LENGTHS, 2, p)),
            from_state=np.zeros((n, 2 * r, 2, p)),
            to_state=np.zeros((n, p, 2, 2 * r)),
            squared=np.zeros((n, r)),
            damping=np.zeros((n, r, r)),
            closed=np.zeros((n, c), np.bool_),
            rigid=rigid,
            rated=np.zeros(n, np.bool_),
            own=np.zeros((n, c, 2, r)),
            own_constant=np.zeros((n, c)),
            own_signal=np.zeros((n, c, 2, p)),
            entered=np.zeros((n, c, 2, r)),
            entered_constant=np.zeros((n, c)),
            entered_signal=np.zeros((n, c, 2, p)),
            target=np.full((n, c), -1, np.int64),
            matrix=np.zeros((n, c, r, r)),
            offset=np.zeros((n, c, r)),
        )


class Pack:
    """The levels of ``rule`` that the compiled loop knows; ``levels`` are their arrays, ``loaded`` themselves."""

    def __init__(self, rule: EventRule) -> None:
        self.rule = rule
        self.loaded: list[LoadedLevel] = []
        self._positions: dict[tuple[int, ...], int | None] = {}
        self._rigid = np.isinf(rule.model.base.stiffnesses)
        self._seen = 0, 0
        self.levels = Levels.empty(0, 0, 0, self._rigid)

    def position(self, level: LoadedLevel) -> int | None:
        """Where a level stands, None where the compiled loop cannot run: powers, a drive, no motion."""
        indices = level.level.indices
        if indices not in self._positions:
            basis = level.level.response.basis
            runs = basis.pure and not level.driven and np.any(basis.rates) and self._has_room(level)
            self._positions[indices] = self._add(level) if runs else None
        return self._positions[indices]

    def known(self, level: LoadedLevel) -> int | None:
        """Where a level stands, None where it has not been packed."""
        position = self._positions.get(level.level.indices)
        return position if position is not None and self.loaded[position] is level else None

    def connect(self) -> None:
        """Pack the ways between packed levels that the rule has computed since."""
        if (self.rule.mapped, len(self.loaded)) == self._seen:
            return
        ways = self.rule.ways
        self._seen = self.rule.mapped, len(self.loaded)
        for source, target in ways:
            changed, here, there = {*source} ^ {*target}, self._positions.get(source), self._positions.get(target)
            if len(changed) == 1 and here is not None and there is not None:
                (contact,) = changed
                if self.levels.target[here, contact] < 0:
                    self._connect(here, there, contact)

    def _has_room(self, level: LoadedLevel) -> bool:
        """Whether the arrays with one more level are no larger than ``PACK_BYTES``."""
        held, r, p = self._sizes(len(self.loaded) + 1, level.level.modes, len(level.level.response.basis.rates))
        one = Levels.empty(1, r, p, self._rigid)
        return held * sum(array.nbytes for array in one) <= PACK_BYTES

    def _sizes(self, count: int, r: int, p: int) -> tuple[int, int, int]:
        """Levels, modes and exponentials that arrays with room for so many levels of these sizes have room for."""
        held = len(self.levels.sizes)
        wider = max(r, self.levels.squared.shape[1]), max(p, self.levels.rates.shape[2])
        return (max(2 * held, 2) if count > held else held), *wider

    def _add(self, level: LoadedLevel) -> int:
        own, response = level.level, level.level.response
        self._reserve(len(self.loaded) + 1, own.modes, len(response.basis.rates))
        k = len(self.loaded)
        self.loaded.append(level)
        r, p, rates, a = own.modes, len(response.basis.rates), response.basis.rates, self.levels
        size = np.abs(rates)
        shortest = math.ldexp(1.0, -math.frexp(float(np.max(size)))[1] - SHORTEST)
        a.sizes[k] = r, p
        growth = max(0.0, float(np.max(rates.real)))
        a.scales[k] = growth, shortest, own.finder.refine, own.highest_frequency, level.asymptotic.potential
        _split(rates, a.rates[k])
        a.magnitudes[k, :p] = size[:, None] ** np.arange(BOUNDS)
        with np.errstate(over="ignore", invalid="ignore"):  # growth: no interval is longer than the horizon
            _split(np.exp(rates * (shortest * 2.0 ** np.arange(LENGTHS))[:, None]), a.factors[k])
        _split(response.from_displacement.T, a.from_state[k, :r])
        _split(response.from_velocity.T, a.from_state[k, r : 2 * r])
        both = np.vstack([response.shapes, response.shapes * rates]).T
        _split(both.conj(), a.to_state[k, :p])
        a.squared[k, :r], a.damping[k, :r, :r] = own.squares, own.damping
        a.closed[k, list(own.indices)] = True
        a.rated[k] = np.any(own.force_rate_rows)
        for contact in range(len(self._rigid)):
            row = self.rule.function(level, contact)
            a.own_constant[k, contact] = _put(row, level, a.own[k, contact], a.own_signal[k, contact])
        return k

    def _connect(self, source: int, target: int, contact: int) -> None:
        level, a = self.loaded[source], self.levels
        move = self.rule.transition(level, self.loaded[target])
        to, of = move.matrix.shape
        a.matrix[source, contact, :of, :to] = move.matrix.T
        a.offset[source, contact, :to] = move.offset
        row = self.rule.entered_function(level, contact)
        found = _put(row, level, a.entered[source, contact], a.entered_signal[source, contact])
        a.entered_constant[source, contact] = found
        a.target[source, contact] = target

    def _reserve(self, count: int, r: int, p: int) -> None:
        """Room for so many levels of these sizes; what is packed moves to wider arrays where it is too small."""
        n, r, p = self._sizes(count, r, p)
        if (n, r, p) == (len(self.levels.sizes), self.levels.squared.shape[1], self.levels.rates.shape[2]):
            return
        wider = Levels.empty(n, r, p, self._rigid)
        for name, old, new in zip(Levels._fields, self.levels, wider, strict=True):
            if name != "rigid":
                new[tuple(slice(n) for n in old.shape)] = old
        self.levels = wider


def _split(values: np.ndarray, into: np.ndarray) -> None:
    """Complex values (..., p) as rows (..., 2, >= p) of real and imaginary parts."""
    into[..., 0, : values.shape[-1]], into[..., 1, : values.shape[-1]] = values.real, values.imag


def _put(row: Row, level: LoadedLevel, parts: np.ndarray, signal: np.ndarray) -> float:
    """A function of a level's state, and its signal; returns its constant."""
    response = level.level.response
    parts[0, : level.level.modes], parts[1, : level.level.modes] = row.position, row.rate
    _split(row.position @ response.shapes + (row.rate @ response.shapes) * response.basis.rates, signal)
    return row.constant
