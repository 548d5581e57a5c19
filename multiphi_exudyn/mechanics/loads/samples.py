"""Samples: a function of time by its values, or by those of its acceleration, with straight lines between them."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.mathematics.functions.piecewise_exponential import PiecewiseExponential
from multiphi_exudyn.mechanics.structures.arguments import is_real, real_array

__all__ = ["Accelerogram", "Sampled"]

COLLINEAR = 4 * np.finfo(float).eps  # of the largest sample: a sample this close to a line lies on it


@dataclass(frozen=True, eq=False)
class Sampled:
    """Function of time in straight lines between samples; zero before the first and after the last.

    Parameters
    ----------
    time : array (k,)
        Ascending times [s], two or more.
    values : array (k,)
        Values, in m for a motion or N for a force.

    Raises
    ------
    MultiPhiTypeError
        For values that are not real numbers.
    MultiPhiValueError
        For fewer than two samples, unequal numbers of times and values, times that do not ascend, and values that are
        not finite.

    Examples
    --------
    >>> import multiphi_exudyn as mp
    >>> pulse = mp.Sampled([0.0, 0.01, 0.02], [0.0, 50.0, 0.0])
    >>> pulse.values.shape
    (3,)
    """

    time: np.ndarray
    values: np.ndarray

    def __post_init__(self) -> None:
        time, values = _samples("time", self.time), _samples("values", self.values)
        if time.shape != values.shape or len(time) < 2:
            raise MultiPhiValueError(
                f"samples: got {len(time)} times and {len(values)} values, need two or more of each, as many of both"
            )
        if not np.all(np.diff(time) > 0):
            worst = int(np.argmin(np.diff(time)))
            raise MultiPhiValueError(
                f"samples: got time {time[worst + 1]:g} s after {time[worst]:g} s, need ascending times"
            )
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "values", values)

    @classmethod
    def from_csv(cls, path: str | Path, column: int = 1) -> Sampled:
        """Samples from a CSV file of two or more columns of numbers, time [s] first.

        Lines that begin with # are skipped.

        Parameters
        ----------
        path : str or path
            Path of the file.
        column : int, default 1
            Column of the values, counted from 0.

        Raises
        ------
        MultiPhiTypeError
            For a column that is not a whole number.
        MultiPhiValueError
            For a file or a column that cannot be read.
        """
        if not is_real(column) or int(column) != column:
            raise MultiPhiTypeError(f"samples: got column {column!r} of {path}, need a whole number >= 1")
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)  # of an empty file
                table = np.loadtxt(path, delimiter=",", ndmin=2)
            if not 1 <= column < table.shape[1]:
                raise MultiPhiValueError(f"got column {column}, need 1 to {table.shape[1] - 1}")
            return cls(table[:, 0], table[:, int(column)])
        except (OSError, TypeError, ValueError) as error:
            cause = " ".join(str(error).split())
            raise MultiPhiValueError(f"samples: got {path}, need a CSV file of numbers: {cause}") from error

    def history(self, end: float, finer: float = 1.0) -> PiecewiseExponential:
        """The function up to ``end`` [s]; samples on the line between their neighbours are left out."""
        bends = _bends(self.time, self.values)
        return PiecewiseExponential.sampled(self.time[bends], self.values[bends])


@dataclass(frozen=True, eq=False)
class Accelerogram:
    """Motion z(t) [m] of a base or a stop given by samples of its acceleration, as of an earthquake or a shaker.

        z'' = factor u(t),   z = z' = 0 at the first sample

    u goes in straight lines between samples and is zero before the first and after the last, for which the response is
    exact. The base then keeps the velocity that the record leaves, as the integral of a record without correction does.

    Parameters
    ----------
    time : array (k,)
        Ascending times [s], two or more.
    values : array (k,)
        Acceleration u, in m/s2 divided by ``factor``.
    factor : float, default 1.0
        Unit of the record [m/s2]: 9.81 for a record in g, 0.01 for one in cm/s2.

    Raises
    ------
    MultiPhiTypeError
        For values that are not real numbers.
    MultiPhiValueError
        For fewer than two samples, unequal numbers of times and values, times that do not ascend, and values that are
        not finite.

    Examples
    --------
    >>> import numpy as np
    >>> import multiphi_exudyn as mp
    >>> K = 4e4 * np.array([[2, -1, 0], [-1, 2, -1], [0, -1, 1]])  # N/m
    >>> chain = mp.LinearStructure(np.eye(3), K, mp.ModalDamping(0.01), {"tip": 2})
    >>> stop = mp.UnilateralContact("stop", "tip", gap=1e-3, stiffness=1e6)
    >>> quake = mp.Accelerogram([0.0, 0.1, 0.2, 0.3], [0.0, 0.8, -0.8, 0.0], factor=9.81)  # in g
    >>> tr = mp.simulate(mp.MultiPhiModel(chain, [stop]), 0.5, loads=[mp.BaseMotion(np.ones(3), quake)])
    >>> tr.events[0].kind
    'close'
    >>> print(1e3 * quake.displacement(np.array([0.1, 0.2])).round(6))  # mm of the base, which x is relative to
    [13.08 65.4 ]
    """

    time: np.ndarray
    values: np.ndarray
    factor: float = 1.0

    def __post_init__(self) -> None:
        samples = Sampled(self.time, self.values)
        if not is_real(self.factor):
            raise MultiPhiTypeError(f"accelerogram factor: got {self.factor!r}, need a number [m/s2]")
        factor = float(self.factor)
        if not np.isfinite(factor):
            raise MultiPhiValueError(f"accelerogram factor: got {self.factor!r}, need a finite number [m/s2]")
        largest = float(np.max(np.abs(samples.values)))
        if not np.isfinite(2 * largest * factor):
            raise MultiPhiValueError(
                f"accelerogram factor: got {self.factor!r} times values up to {largest:g}, need finite accelerations"
            )
        object.__setattr__(self, "factor", factor)
        object.__setattr__(self, "time", samples.time)
        object.__setattr__(self, "values", samples.values)

    @classmethod
    def from_csv(cls, path: str | Path, column: int = 1, factor: float = 1.0) -> Accelerogram:
        """Samples from a CSV file of two or more columns of numbers, time [s] first, as by ``Sampled.from_csv``."""
        samples = Sampled.from_csv(path, column)
        return cls(samples.time, samples.values, factor)

    def displacement(self, t: float | np.ndarray) -> np.ndarray:
        """Displacement z [m] at times [s]: () for a scalar t, (k,) for (k,) times.

        Raises
        ------
        MultiPhiTypeError
            For times that are not real numbers.
        MultiPhiValueError
            For times that are not finite, or not a scalar or (k,).
        """
        times = np.asarray(real_array("t", t, "a time or (k,) times in s"))
        if times.ndim > 1:
            raise MultiPhiValueError(f"t: got shape {times.shape}, need a scalar or (k,)")
        if not np.all(np.isfinite(times)):
            raise MultiPhiValueError("t: got a value that is NaN or infinite, need times in s")
        each = np.atleast_1d(times)
        return self.history(2 * float(np.max(each, initial=0.0))).at(each).reshape(times.shape)

    def acceleration(self, end: float, finer: float = 1.0) -> PiecewiseExponential:
        """z'' up to ``end`` [s]."""
        return Sampled(self.time, self.factor * self.values).history(end)

    def history(self, end: float, finer: float = 1.0) -> PiecewiseExponential:
        """z up to ``end`` [s]."""
        return self.acceleration(end).integral(end).integral(end)


def _bends(time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Indices of the samples between which all others lie on straight lines, up to round-off of the largest value."""
    widths, round_off = np.diff(time), COLLINEAR * float(np.max(np.abs(values)))
    turns = np.abs(np.diff(np.diff(values) / widths)) > round_off * (1 / widths[1:] + 1 / widths[:-1])
    bends = np.flatnonzero(np.concatenate([[True], turns, [True]]))
    off = np.abs(np.interp(time, time[bends], values[bends]) - values) > round_off
    return np.union1d(bends, np.flatnonzero(off))


def _samples(name: str, given: Any) -> np.ndarray:
    """A read-only copy (k,) of finite numbers."""
    values = np.asarray(real_array(f"samples {name}", given, "(k,) real numbers"))
    if values.ndim != 1:
        raise MultiPhiValueError(f"samples {name}: got shape {values.shape}, need (k,)")
    if not np.all(np.isfinite(values)):
        raise MultiPhiValueError(f"samples {name}: got a value that is NaN or infinite, need finite numbers")
    values.flags.writeable = False
    return values
