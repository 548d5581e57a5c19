"""Modal force that is held constant for the length of a step, in the arrays that the loop works on.

A force p on the coordinates eta of a level only moves the centre of their motion,

    eta'' + D eta' + S (eta - d) = drive + p_0,   d = S^-1 p,   S = diag(omega^2) and what friction couples (sliding.py)

with S^-1 on the modes that have a frequency and p_0 = (1 - S S^-1) p what acts on the others,

so a level under p is the same level with other constants, those of signals, gaps, energies and maps, and the event rule
holds unchanged. Coordinates of such a level are eta - d. A force on coordinate k acts on mode k of whichever level
holds. Where p comes from forces f on points, a closed rigid contact also takes what no mode of its level sees of them:
L f. What hangs on the points takes part in impacts (attached_inertia.py).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from multiphi_exudyn.events import arrays as a
from multiphi_exudyn.events.exits import after, asked_alone, exits_of, force_shares, way_back
from multiphi_exudyn.events.level_arrays import LevelArrays
from multiphi_exudyn.levels.level import Level
from multiphi_exudyn.mathematics.least_distance import INDEPENDENT

__all__ = ["Acting", "HeldForces", "Inertia", "shift"]


def shift(level: Level, force: np.ndarray) -> np.ndarray:
    """d (r,) of a modal force (s,), s >= r."""
    return np.asarray(_yielding(level) @ force[: level.modes])


def _yielding(level: Level) -> np.ndarray:
    """S^-1 (r, r), zero on modes without a frequency."""
    elastic, inverse = np.flatnonzero(level.squares), np.zeros((level.modes, level.modes))
    place = np.ix_(elastic, elastic)
    inverse[place] = np.linalg.inv(np.diag(level.squares[elastic]) + level.coupling[place])
    return inverse


def _beside(level: Level, inverse: np.ndarray) -> np.ndarray:
    """1 - S S^-1 (r, r), zero on modes with a frequency."""
    left = np.eye(level.modes) - level.coupling @ inverse
    left[level.squares != 0] = 0.0
    return left


@dataclass(frozen=True)
class Acting:
    """What acts in a level: a modal force (s,), and what links that hold carry of forces on points, L f (k,) [N]."""

    force: np.ndarray
    reactions: np.ndarray


class Inertia(Protocol):
    """What hangs on a structure."""

    independence: float  # of directions of length one that it leaves: what is left beside others if they are redundant

    def mobility(self, states: tuple[int, ...]) -> np.ndarray:
        """F (r, r) of a level's B = F F^T."""

    def velocity_map(self, source: tuple[int, ...], target: tuple[int, ...], matrix: np.ndarray) -> np.ndarray:
        """eta'_m from eta'_l, where ``matrix`` is without it."""

    def directions(self, units: np.ndarray) -> np.ndarray:
        """What it leaves of directions (c, b)."""

    @property
    def held(self) -> set[int]:
        """Contacts that cannot move for it."""


@dataclass(frozen=True)
class _Level:
    """Constants of a level, and how forces change them: numbers[places] = constants + gains . (p, reactions).

    inverse: S^-1 (r, r). linear, squares: of its energy without forces, whose constant stands at
    ``energy``. exits: their records. mobility: where F stands.
    """

    states: tuple[int, ...]
    inverse: np.ndarray
    places: np.ndarray
    constants: np.ndarray
    gains: np.ndarray
    energy: int
    potential: float
    linear: np.ndarray
    squares: np.ndarray
    exits: list[int]
    mobility: int


class HeldForces:
    """The levels of ``arrays`` under constant forces, and with what hangs on the structure."""

    def __init__(self, arrays: LevelArrays) -> None:
        self.arrays = arrays
        self._levels = dict[int, _Level]()
        self._shifts = dict[int, np.ndarray]()
        self._offsets = dict[int, np.ndarray]()  # of maps
        self._rates = dict[int, tuple[int, int]]()  # where maps have velocities: the plain ones, and of what hangs
        self._entered = dict[int, float]()  # constants, by exit
        self._acting: Callable[[tuple[int, ...]], Acting] = _nothing
        self._inertia: Inertia | None = None
        kinds = arrays.ints[arrays.ints[a.KINDS] :][: arrays.ints[a.ELEMENTS]]
        self._rigid = bool(np.any(kinds == a.RIGID))  # only these are struck
        start, shape = int(arrays.ints[a.DIRECTIONS]), (int(arrays.ints[a.ELEMENTS]), int(arrays.ints[a.COORDINATES]))
        self._units = arrays.numbers[start : start + shape[0] * shape[1]].reshape(shape).copy()
        arrays.held = self

    def hold(self, acting: Callable[[tuple[int, ...]], Acting], inertia: Inertia | None) -> None:
        """From now on these forces act, by the states of a level."""
        if self._rigid and not (inertia is None and self._inertia is None):
            self._hang(inertia)
        self._acting, self._inertia = acting, inertia
        self.arrays.hide()

    def _hang(self, inertia: Inertia | None) -> None:
        """Along which directions impacts go, and which elements nothing lets move."""
        ints, numbers = self.arrays.buffers.ints, self.arrays.buffers.numbers
        units = self._units if inertia is None else inertia.directions(self._units)
        start, idle = int(ints[a.DIRECTIONS]), int(ints[a.UNMOVED])
        numbers[start : start + units.size] = units.ravel()
        numbers[a.INDEPENDENCE] = INDEPENDENT if inertia is None else inertia.independence
        ints[idle : idle + ints[a.ELEMENTS]] = 0
        ints[[idle + i for i in (() if inertia is None else inertia.held)]] = 1

    def forget(self) -> None:
        """Begin anew, without any level."""
        self.arrays.forget()
        self._inertia = None
        for kept in (self._levels, self._shifts, self._offsets, self._rates, self._entered):
            kept.clear()

    def centre(self, level: int) -> np.ndarray:
        """d (r,) of a level."""
        return self._shifts[level]

    # ------------------------------------------------------------------ what the arrays ask for

    def change_level(self, level: int) -> None:
        """Give a level the constants that belong to the forces, and the mobility that is left to it."""
        known = self._known(level)
        ints, numbers, acting = self.arrays.ints, self.arrays.numbers, self._acting(known.states)
        force = acting.force[: len(known.inverse)]
        d = self._shifts[level] = known.inverse @ force
        numbers[known.places] = known.constants + known.gains.dot(np.concatenate([force, acting.reactions]))
        numbers[known.energy] = known.potential + known.linear.dot(d) + 0.5 * known.squares.dot(d * d)
        for exit_ in known.exits:
            if ints[exit_ + a.ENTERED] >= 0:
                self.change_entered(level, exit_)
        if self._rigid and (self._inertia is not None or ints[level + a.MOBILITY] >= 0):
            self._limit(level, known)

    def change_map(self, source: int, target: int, record: int) -> None:
        """Give a map the offset that belongs to the forces, and the velocities of what hangs on the points."""
        ints, numbers = self.arrays.ints, self.arrays.numbers
        rows, width, r = self._width(target), self._width(source), len(self._shifts[source])
        matrix = numbers[ints[record + a.MATRIX] :][: rows * width].reshape(rows, width)
        start = int(ints[record + a.OFFSET])
        if record not in self._offsets:
            self._offsets[record] = numbers[start : start + rows].copy()
        offset = self._offsets[record] + matrix[:, :r] @ self._shifts[source]
        offset[: len(self._shifts[target])] -= self._shifts[target]
        numbers[start : start + rows] = offset
        if self._inertia is None:
            if record in self._rates:
                ints[record + a.RATE_MATRIX] = self._rates[record][0]
            return
        if record not in self._rates:
            plain = int(ints[record + a.RATE_MATRIX])
            self._rates[record] = plain, self.arrays.buffers.take("numbers", matrix.size)
        plain, start = self._rates[record]
        rates = self.arrays.numbers[plain : plain + matrix.size].reshape(matrix.shape).copy()
        ends, left = (self._levels[source].states, self._levels[target].states), len(self._shifts[target])
        rates[:left, :r] = self._inertia.velocity_map(*ends, rates[:left, :r])
        self.arrays.ints[record + a.RATE_MATRIX] = start
        self.arrays.numbers[start : start + rates.size] = rates.ravel()

    def change_entered(self, level: int, exit_: int) -> None:
        """Give the signal of a contact in the level entered alone its constant."""
        ints, numbers, n, r = self.arrays.ints, self.arrays.numbers, self._width(level), len(self._shifts[level])
        loaded, row = self.arrays.loaded[int(ints[level + a.NUMBER])], int(ints[ints[exit_ + a.ENTERED] + a.ROW])
        element, exit_taken = exits_of(loaded)[(exit_ - int(ints[level + a.EXITS])) // a.EXIT_INTS]
        taken = asked_alone(exit_taken)
        back = way_back(loaded, element, taken)
        plain = self._entered.setdefault(exit_, float(numbers[row + 2 * n]))
        numbers[row + 2 * n] = plain + numbers[row : row + r] @ self._shifts[level]
        entered = self.arrays.levels.level(after(loaded, element, taken))
        for k, share in force_shares(entered, element, back):
            numbers[row + 2 * n] += share * self._acting(entered.states).reactions[k]

    # ------------------------------------------------------------------ levels

    def _width(self, level: int) -> int:
        return int(self.arrays.ints[level + a.MODES] + self.arrays.ints[a.CHANNELS])

    def _known(self, level: int) -> _Level:
        if level not in self._levels:
            self._levels[level] = self._read(level)
        return self._levels[level]

    def _read(self, level: int) -> _Level:
        arrays = self.arrays
        loaded, n, r = arrays.loaded[int(arrays.ints[level + a.NUMBER])], self._width(level), self._modes(level)
        own, ways, inverse = loaded.level, exits_of(loaded), _yielding(loaded.modal)
        beside = _beside(loaded.modal, inverse)
        if np.any(beside) and arrays.ints[level + a.FORCE] < 0:
            place = arrays.buffers.take("numbers", r)
            arrays.ints[level + a.FORCE] = place
        mobility = arrays.buffers.take("numbers", r * r)
        ints, numbers = arrays.ints, arrays.numbers
        exits = ints[level + a.EXITS] + a.EXIT_INTS * np.arange(ints[level + a.EXIT_COUNT])
        rows, energy = ints[exits + a.SIGNAL + a.ROW], int(ints[level + a.POTENTIAL])
        forms = numbers[energy + 1 + n + r :][: (n - r) * n].reshape(n - r, n)
        follows = numbers[ints[level + a.FOLLOWS] :][: ints[level + a.FOLLOW_COUNT] * (n + 1)].reshape(-1, n + 1)
        gaps, patterns, channels = len(own.gap_rows), self._patterns(level), np.arange(n - r)
        parts = [
            (ints[level + a.MOTION] + 2 * n + (2 * n + 1) * np.arange(r), beside),
            (ints[level + a.GAPS] + n + (n + 1) * np.arange(gaps), own.gap_rows[:, :r] @ inverse),
            (energy + 1 + np.arange(r), numbers[energy + 1 + n :][:r, None] * inverse),
            (energy + 1 + r + channels, forms[:, :r] @ inverse),
            (ints[level + a.PATTERNS] + n + (n + 1) * channels, patterns @ inverse),
            (ints[level + a.FORCE] + np.arange(r if ints[level + a.FORCE] >= 0 else 0), beside),
            (ints[level + a.FOLLOWS] + n + (n + 1) * np.arange(len(follows)), follows[:, :r] @ inverse),
            (rows + 2 * n, numbers[rows[:, None] + np.arange(r)] @ inverse),
        ]
        places = np.concatenate([at for at, _ in parts])
        gains = np.zeros((len(places), r + len(own.indices)))
        gains[:, :r] = np.vstack([gain[: len(at)] for at, gain in parts])
        for e, (element, exit_) in enumerate(ways):
            for k, share in force_shares(loaded, element, exit_):
                gains[len(places) - len(ways) + e, r + k] = share
        return _Level(
            states=loaded.states,
            inverse=inverse,
            places=places,
            constants=numbers[places],
            gains=gains,
            energy=energy,
            potential=float(numbers[energy]),
            linear=numbers[energy + 1 : energy + 1 + r].copy(),
            squares=numbers[energy + 1 + n :][:r].copy(),
            exits=exits.tolist(),
            mobility=mobility,
        )

    def _modes(self, level: int) -> int:
        return int(self.arrays.ints[level + a.MODES])

    def _patterns(self, level: int) -> np.ndarray:
        """What the modes (q, r) do along the patterns of the channels."""
        r, n = self._modes(level), self._width(level)
        rows = self.arrays.numbers[self.arrays.ints[level + a.PATTERNS] :][: (n - r) * (n + 1)]
        return np.asarray(rows.reshape(n - r, n + 1)[:, :r])

    def _limit(self, level: int, plain: _Level) -> None:
        """The mobility that is left by what hangs on the structure."""
        ints, r = self.arrays.ints, len(plain.inverse)
        ints[level + a.MOBILITY] = -1
        if self._inertia is not None:
            ints[level + a.MOBILITY] = plain.mobility
            root = self._inertia.mobility(plain.states)
            self.arrays.numbers[plain.mobility : plain.mobility + r * r] = root.ravel()


def _nothing(states: tuple[int, ...]) -> Acting:
    raise AssertionError("no force has been given yet")
