"""Modal force that is constant for the length of a step, in the arrays of the loop.

A constant force p on the coordinates eta of a level only shifts the centre of their motion,

    eta'' + D eta' + S (eta - d) = drive + p_0,   d = S^-1 p,   p_0 = (1 - S S^-1) p

S is diag(omega^2) and the coupling by friction (sliding.py), S^-1 its inverse on the modes of nonzero frequency, p_0
the force on the others. So a level under p is the same level with other constants in signals, gaps, energies and maps,
and the event rule is unchanged. The coordinates of such a level are eta - d. A force on coordinate k acts on mode k of
the present level. If p comes from forces f on points, closed rigid contacts have the reactions L f in addition, which
the modes of the level do not contain. Masses attached to the points take part in impacts (attached_inertia.py).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from multiphi_exudyn.events import arrays as a
from multiphi_exudyn.events.packing.level_arrays import LevelArrays
from multiphi_exudyn.events.transitions.exits import after, entering_exit, exits_of, force_shares, return_exit
from multiphi_exudyn.levels.level.level import Level
from multiphi_exudyn.mathematics.round_off import INDEPENDENT

__all__ = ["ConstantForces", "Inertia", "LevelForces", "static_shift"]


def static_shift(level: Level, force: np.ndarray) -> np.ndarray:
    """Static shift d (r,) under a modal force (s,), s >= r."""
    return np.asarray(_compliance(level) @ force[: level.modes])


def _compliance(level: Level) -> np.ndarray:
    """S^-1 (r, r), zero for modes of zero frequency."""
    elastic, inverse = np.flatnonzero(level.squares), np.zeros((level.modes, level.modes))
    place = np.ix_(elastic, elastic)
    inverse[place] = np.linalg.inv(np.diag(level.squares[elastic]) + level.coupling[place])
    return inverse


def _free_mode_share(level: Level, inverse: np.ndarray) -> np.ndarray:
    """1 - S S^-1 (r, r), zero for modes of nonzero frequency."""
    share = np.eye(level.modes) - level.coupling @ inverse
    share[level.squares != 0] = 0.0
    return share


@dataclass(frozen=True)
class LevelForces:
    """Forces in a level: a modal force (s,), and the direct reactions L f (k,) [N] of its links to forces on points."""

    force: np.ndarray
    reactions: np.ndarray


class Inertia(Protocol):
    """Inertia of masses and constraints that are attached to a structure."""

    independence: float  # of directions of length one: those whose remaining part is smaller count as redundant

    def mobility(self, states: tuple[int, ...]) -> np.ndarray:
        """F (r, r) of a level's B = F F^T."""

    def velocity_map(self, source: tuple[int, ...], target: tuple[int, ...], matrix: np.ndarray) -> np.ndarray:
        """Matrix of eta'_m from eta'_l; ``matrix`` is that without attached inertia."""

    def directions(self, units: np.ndarray) -> np.ndarray:
        """Directions (c, b) of contacts, reduced by the attached inertia."""

    @property
    def immovable(self) -> set[int]:
        """Indices of contacts that the attached inertia leaves no mobility."""


@dataclass(frozen=True)
class _LevelConstants:
    """Constants of a level and their change by forces: numbers[places] = constants + gains . (p, reactions).

    inverse: S^-1 (r, r). linear, squares: of its energy without forces; energy: place of the energy's constant.
    exits: records of its exits. mobility: place of F.
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


class ConstantForces:
    """The levels of ``arrays`` under constant forces, and with inertia attached to the structure."""

    def __init__(self, arrays: LevelArrays) -> None:
        self.arrays = arrays
        self._levels = dict[int, _LevelConstants]()
        self._shifts = dict[int, np.ndarray]()
        self._offsets = dict[int, np.ndarray]()  # plain offsets, by map
        self._rate_matrices = dict[int, tuple[int, int]]()  # by map: plain, and with inertia
        self._entered_constants = dict[int, float]()  # plain constants of signals in the level entered, by exit
        self._level_forces: Callable[[tuple[int, ...]], LevelForces] = _nothing
        self._inertia: Inertia | None = None
        kinds = arrays.ints[arrays.ints[a.KINDS] :][: arrays.ints[a.ELEMENTS]]
        self._rigid = bool(np.any(kinds == a.RIGID))  # only these have impacts
        start, shape = int(arrays.ints[a.DIRECTIONS]), (int(arrays.ints[a.ELEMENTS]), int(arrays.ints[a.COORDINATES]))
        self._units = arrays.numbers[start : start + shape[0] * shape[1]].reshape(shape).copy()
        arrays.held = self

    def set_forces(self, forces: Callable[[tuple[int, ...]], LevelForces], inertia: Inertia | None) -> None:
        """Set the forces, a function of a level's states, and the attached inertia."""
        if self._rigid and not (inertia is None and self._inertia is None):
            self._set_inertia(inertia)
        self._level_forces, self._inertia = forces, inertia
        self.arrays.hide()

    def _set_inertia(self, inertia: Inertia | None) -> None:
        """Set the directions of impacts, and the elements without mobility."""
        ints, numbers = self.arrays.buffers.ints, self.arrays.buffers.numbers
        units = self._units if inertia is None else inertia.directions(self._units)
        start, unmoved = int(ints[a.DIRECTIONS]), int(ints[a.UNMOVED])
        numbers[start : start + units.size] = units.ravel()
        numbers[a.INDEPENDENCE] = INDEPENDENT if inertia is None else inertia.independence
        ints[unmoved : unmoved + ints[a.ELEMENTS]] = 0
        ints[[unmoved + i for i in (() if inertia is None else inertia.immovable)]] = 1

    def forget(self) -> None:
        """Forget all levels."""
        self.arrays.forget()
        self._inertia = None
        for stored in (self._levels, self._shifts, self._offsets, self._rate_matrices, self._entered_constants):
            stored.clear()

    def centre(self, level: int) -> np.ndarray:
        """Centre d (r,) of the motion in a level."""
        return self._shifts[level]

    # ------------------------------------------------------------------ called by the arrays

    def change_level(self, level: int) -> None:
        """Set the constants of a level under the forces, and its mobility with the attached inertia."""
        plain = self._constants_of(level)
        ints, numbers, acting = self.arrays.ints, self.arrays.numbers, self._level_forces(plain.states)
        force = acting.force[: len(plain.inverse)]
        d = self._shifts[level] = plain.inverse @ force
        numbers[plain.places] = plain.constants + plain.gains.dot(np.concatenate([force, acting.reactions]))
        numbers[plain.energy] = plain.potential + plain.linear.dot(d) + 0.5 * plain.squares.dot(d * d)
        for exit_ in plain.exits:
            if ints[exit_ + a.ENTERED] >= 0:
                self.change_entered(level, exit_)
        if self._rigid and (self._inertia is not None or ints[level + a.MOBILITY] >= 0):
            self._set_mobility(level, plain)

    def change_map(self, source: int, target: int, record: int) -> None:
        """Set the offset of a map under the forces, and its velocities with the attached inertia."""
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
            if record in self._rate_matrices:
                ints[record + a.RATE_MATRIX] = self._rate_matrices[record][0]
            return
        if record not in self._rate_matrices:
            plain = int(ints[record + a.RATE_MATRIX])
            self._rate_matrices[record] = plain, self.arrays.buffers.take("numbers", matrix.size)
        plain, start = self._rate_matrices[record]
        rates = self.arrays.numbers[plain : plain + matrix.size].reshape(matrix.shape).copy()
        states, modes = (self._levels[source].states, self._levels[target].states), len(self._shifts[target])
        rates[:modes, :r] = self._inertia.velocity_map(*states, rates[:modes, :r])
        self.arrays.ints[record + a.RATE_MATRIX] = start
        self.arrays.numbers[start : start + rates.size] = rates.ravel()

    def change_entered(self, level: int, exit_: int) -> None:
        """Set the constant of an element's signal in the level that its exit alone enters."""
        ints, numbers, n, r = self.arrays.ints, self.arrays.numbers, self._width(level), len(self._shifts[level])
        loaded, row = self.arrays.loaded[int(ints[level + a.NUMBER])], int(ints[ints[exit_ + a.ENTERED] + a.ROW])
        element, exit_taken = exits_of(loaded)[(exit_ - int(ints[level + a.EXITS])) // a.EXIT_INTS]
        alone = entering_exit(exit_taken)
        back = return_exit(loaded, element, alone)
        plain = self._entered_constants.setdefault(exit_, float(numbers[row + 2 * n]))
        numbers[row + 2 * n] = plain + numbers[row : row + r] @ self._shifts[level]
        entered = self.arrays.levels.level(after(loaded, element, alone))
        for k, share in force_shares(entered, element, back):
            numbers[row + 2 * n] += share * self._level_forces(entered.states).reactions[k]

    # ------------------------------------------------------------------ levels

    def _width(self, level: int) -> int:
        return int(self.arrays.ints[level + a.MODES] + self.arrays.ints[a.CHANNELS])

    def _constants_of(self, level: int) -> _LevelConstants:
        if level not in self._levels:
            self._levels[level] = self._read_constants(level)
        return self._levels[level]

    def _read_constants(self, level: int) -> _LevelConstants:
        arrays = self.arrays
        loaded, n, r = arrays.loaded[int(arrays.ints[level + a.NUMBER])], self._width(level), self._modes(level)
        plain, level_exits, inverse = loaded.level, exits_of(loaded), _compliance(loaded.modal)
        free_share = _free_mode_share(loaded.modal, inverse)
        if np.any(free_share) and arrays.ints[level + a.FORCE] < 0:
            place = arrays.buffers.take("numbers", r)
            arrays.ints[level + a.FORCE] = place
        mobility = arrays.buffers.take("numbers", r * r)
        ints, numbers = arrays.ints, arrays.numbers
        exits = ints[level + a.EXITS] + a.EXIT_INTS * np.arange(ints[level + a.EXIT_COUNT])
        rows, energy = ints[exits + a.SIGNAL + a.ROW], int(ints[level + a.POTENTIAL])
        forms = numbers[energy + 1 + n + r :][: (n - r) * n].reshape(n - r, n)
        follow_rows = numbers[ints[level + a.FOLLOWS] :][: ints[level + a.FOLLOW_COUNT] * (n + 1)].reshape(-1, n + 1)
        gaps, patterns, channels = len(plain.gap_rows), self._patterns(level), np.arange(n - r)
        parts = [
            (ints[level + a.MOTION] + 2 * n + (2 * n + 1) * np.arange(r), free_share),
            (ints[level + a.GAPS] + n + (n + 1) * np.arange(gaps), plain.gap_rows[:, :r] @ inverse),
            (energy + 1 + np.arange(r), numbers[energy + 1 + n :][:r, None] * inverse),
            (energy + 1 + r + channels, forms[:, :r] @ inverse),
            (ints[level + a.PATTERNS] + n + (n + 1) * channels, patterns @ inverse),
            (ints[level + a.FORCE] + np.arange(r if ints[level + a.FORCE] >= 0 else 0), free_share),
            (ints[level + a.FOLLOWS] + n + (n + 1) * np.arange(len(follow_rows)), follow_rows[:, :r] @ inverse),
            (rows + 2 * n, numbers[rows[:, None] + np.arange(r)] @ inverse),
        ]
        places = np.concatenate([at for at, _ in parts])
        gains = np.zeros((len(places), r + len(plain.indices)))
        gains[:, :r] = np.vstack([gain[: len(at)] for at, gain in parts])
        for e, (element, exit_) in enumerate(level_exits):
            for k, share in force_shares(loaded, element, exit_):
                gains[len(places) - len(level_exits) + e, r + k] = share
        return _LevelConstants(
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
        """Products (q, r) of the modes with the patterns of the channels."""
        r, n = self._modes(level), self._width(level)
        rows = self.arrays.numbers[self.arrays.ints[level + a.PATTERNS] :][: (n - r) * (n + 1)]
        return np.asarray(rows.reshape(n - r, n + 1)[:, :r])

    def _set_mobility(self, level: int, plain: _LevelConstants) -> None:
        """Set the mobility of a level with the attached inertia."""
        ints, r = self.arrays.ints, len(plain.inverse)
        ints[level + a.MOBILITY] = -1
        if self._inertia is not None:
            ints[level + a.MOBILITY] = plain.mobility
            root = self._inertia.mobility(plain.states)
            self.arrays.numbers[plain.mobility : plain.mobility + r * r] = root.ravel()


def _nothing(states: tuple[int, ...]) -> LevelForces:
    raise AssertionError("no forces have been set yet")
