"""Functions of time of loads, moving stops and moving bases.

    u(t):   Accelerogram, Harmonic, Sampled, Smooth, Sweep

Each becomes a piecewise exponential (piecewise_exponential.py), for which the response is known in closed form. A
harmonic and straight lines between samples are exact; a smooth function and a sweep are interpolated to their
tolerance.

Samples are joined by straight lines, of a function or of its acceleration.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from multiphi_exudyn.errors import MultiPhiError, MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.mathematics.interpolation import FEW_SAMPLES, MANY_SAMPLES, Samples
from multiphi_exudyn.mathematics.piecewise_exponential import PiecewiseExponential
from multiphi_exudyn.mechanics.arguments import is_real, real_array

__all__ = [
    "Accelerogram",
    "Harmonic",
    "Sampled",
    "Smooth",
    "Sweep",
    "TimeFunction",
    "check_numbers",
    "check_time_function",
]

SWEEPS = ("linear", "logarithmic")
TIGHTEST = 1e-12  # smallest tolerance, above the round-off of the polynomials
COLLINEAR = 4 * np.finfo(float).eps  # of the largest sample: a sample this close to a line lies on it


@dataclass(frozen=True)
class Harmonic:
    """Function of time u(t) = amplitude cos(2 pi frequency_hz t + phase).

    Parameters
    ----------
    amplitude : float
        In m for a stop or a base, in N for a force.
    frequency_hz : float
        [Hz], >= 0.
    phase : float, default 0.0
        [rad].

    Raises
    ------
    MultiPhiTypeError
        For values that are not numbers.
    MultiPhiValueError
        For values that are not finite, and a frequency < 0.

    Examples
    --------
    >>> import multiphi_exudyn as mp
    >>> mp.BaseMotion("tip", mp.Harmonic(1e-3, 12.0)).course
    Harmonic(amplitude=0.001, frequency_hz=12.0, phase=0.0)
    """

    amplitude: float
    frequency_hz: float
    phase: float = 0.0

    def __post_init__(self) -> None:
        check_numbers("harmonic", amplitude=self.amplitude, frequency_hz=self.frequency_hz, phase=self.phase)
        if self.frequency_hz < 0:
            raise MultiPhiValueError(f"harmonic frequency_hz: got {self.frequency_hz!r}, need a frequency >= 0 Hz")

    def history(self, end: float, finer: float = 1.0) -> PiecewiseExponential:
        """The function up to ``end`` [s]."""
        return PiecewiseExponential.harmonic(self.amplitude, 2 * math.pi * self.frequency_hz, self.phase)

    def acceleration(self, end: float, finer: float = 1.0) -> PiecewiseExponential:
        """u'' up to ``end`` [s]."""
        return self.history(end).derivative.derivative


@dataclass(frozen=True)
class Smooth:
    """Function of time that is smooth except at single instants, as a Python function.

    It is sampled: a feature shorter than 4.2e-5 of a run's length may be missed (1.1e-4 for a function of single
    times), unless ``breaks`` enclose it.

    Parameters
    ----------
    function : callable
        u as a function of time [s], of (k,) times or of single ones.
    tolerance : float, default 1e-9
        Tolerance of the response, relative to its largest value; 1e-12 <= tolerance < 1.
    breaks : sequence of float, default ()
        Times [s] at which the function or a derivative jumps; jumps that show in the samples are found without.

    Raises
    ------
    MultiPhiTypeError
        For arguments that are not a function, a number, or a sequence of times.
    MultiPhiValueError
        For a tolerance out of range; in a run, for a function that does not give finite numbers.

    Examples
    --------
    >>> import numpy as np
    >>> import multiphi_exudyn as mp
    >>> burst = mp.Smooth(lambda t: 1e-3 * np.exp(-20 * t) * np.sin(80 * t))
    >>> burst.tolerance
    1e-09
    """

    function: Callable[[Any], Any]
    tolerance: float = 1e-9
    breaks: Sequence[float] = ()

    def __post_init__(self) -> None:
        if not callable(self.function):
            raise MultiPhiTypeError(f"function: got {self.function!r}, need a function of time")
        _check_tolerance(self.tolerance)
        object.__setattr__(self, "breaks", _breaks(self.breaks))

    def history(self, end: float, finer: float = 1.0) -> PiecewiseExponential:
        """The function up to ``end`` [s], to tolerance / finer of its largest value."""
        vectorised = self._all_values(np.array([0.0, end])) is not None
        samples = Samples.of(self._values, end, MANY_SAMPLES if vectorised else FEW_SAMPLES)
        return PiecewiseExponential.smooth(
            self._values, end, self.tolerance / finer * samples.largest, samples, self.breaks
        )

    def acceleration(self, end: float, finer: float = 1.0) -> PiecewiseExponential:
        """u'' up to ``end`` [s], of the polynomials that approximate u; less accurate than they are."""
        return self.history(end, finer).derivative.derivative

    def _values(self, times: np.ndarray) -> np.ndarray:
        values = self._all_values(times)
        if values is None:
            values = np.array([self._value(t) for t in times.tolist()])
        if not np.all(np.isfinite(values)):
            worst = float(times[int(np.argmin(np.isfinite(values)))])
            raise MultiPhiValueError(f"function: gives a value that is not finite at t = {worst:g} s, need finite ones")
        return values.astype(float)

    def _all_values(self, times: np.ndarray) -> np.ndarray | None:
        """All values by one call; None for a function of single times only, as with math.sin or branches."""
        try:
            values = np.asarray(self.function(times))
        except Exception:
            return None  # an error of the function will occur again with a single time
        return values if values.shape == times.shape and values.dtype.kind in "biuf" else None

    def _value(self, time: float) -> float:
        """The value at one time [s]."""
        try:
            value = self.function(time)
        except MultiPhiError:
            raise
        except Exception as error:
            cause = " ".join(f"{type(error).__name__} {error}".split())
            raise MultiPhiValueError(f"function: got {cause} at t = {time:g} s, need a number") from error
        if isinstance(value, np.ndarray) and value.ndim == 0:
            value = value[()]
        if not is_real(value):
            raise MultiPhiTypeError(f"function: got {type(value).__name__} at t = {time:g} s, need a number")
        return float(value)


@dataclass(frozen=True)
class Sweep:
    """Function of time u(t) = amplitude cos(phase(t)) whose frequency goes from start_hz to end_hz, then zero.

        linear        f = start + (end - start) t / T
        logarithmic   f = start (end / start)^(t / T)

    Parameters
    ----------
    amplitude : float
        In m for a stop or a base, in N for a force.
    start_hz, end_hz : float
        Frequencies [Hz] at the start and the end, > 0.
    duration : float
        T [s], > 0.
    law : str, default "linear"
        "linear" or "logarithmic".
    tolerance : float, default 1e-9
        Tolerance of the response, relative to its largest value; 1e-12 <= tolerance < 1.

    Raises
    ------
    MultiPhiTypeError
        For values that are not numbers.
    MultiPhiValueError
        For numbers out of these ranges, and another law.

    Examples
    --------
    >>> import numpy as np
    >>> import multiphi_exudyn as mp
    >>> sweep = mp.Sweep(1e-3, start_hz=5.0, end_hz=45.0, duration=2.0)
    >>> print(sweep.frequency(np.array([0.0, 1.0, 2.0])))
    [ 5. 25. 45.]
    """

    amplitude: float
    start_hz: float
    end_hz: float
    duration: float
    law: str = "linear"
    tolerance: float = 1e-9

    def __post_init__(self) -> None:
        positive = {"start_hz": self.start_hz, "end_hz": self.end_hz, "duration": self.duration}
        check_numbers("sweep", amplitude=self.amplitude, **positive)
        for name, value in positive.items():
            if not value > 0:
                raise MultiPhiValueError(f"sweep {name}: got {value!r}, need a value > 0")
        if not (isinstance(self.law, str) and self.law in SWEEPS):
            raise MultiPhiValueError(f"sweep law: got {self.law!r}, need one of: {', '.join(SWEEPS)}")
        _check_tolerance(self.tolerance)

    def frequency(self, t: np.ndarray) -> np.ndarray:
        """Frequency f (k,) [Hz] at times (k,) [s]."""
        if self.law == "linear":
            return self.start_hz + (self.end_hz - self.start_hz) * (t / self.duration)
        return np.asarray(self.start_hz * np.exp(self._log_ratio * (t / self.duration)))

    def phase(self, t: np.ndarray) -> np.ndarray:
        """Phase (k,) [rad], 2 pi times the integral of f."""
        if self.law == "linear" or self._log_ratio == 0:
            cycles = (self.start_hz + (self.end_hz - self.start_hz) * (t / self.duration) / 2) * t
        else:
            cycles = self.start_hz * self.duration / self._log_ratio * np.expm1(self._log_ratio * (t / self.duration))
        return np.asarray(2 * math.pi * cycles)

    @property
    def _log_ratio(self) -> float:
        return math.log(self.end_hz / self.start_hz)

    def history(self, end: float, finer: float = 1.0) -> PiecewiseExponential:
        """The function up to ``end`` [s], to tolerance / finer of its amplitude."""
        return self._modulated(lambda t: np.full_like(t, self.amplitude), abs(self.amplitude), end, finer)

    def acceleration(self, end: float, finer: float = 1.0) -> PiecewiseExponential:
        """u'' up to ``end`` [s], to tolerance / finer of its largest value: (i phi'' - phi'^2) of exp(i phi)."""

        def factor(t: np.ndarray) -> np.ndarray:
            omega = 2 * math.pi * self.frequency(t)
            linear = self.law == "linear"
            rising = 2 * math.pi * (self.end_hz - self.start_hz) if linear else omega * self._log_ratio
            rate = rising / self.duration
            return np.asarray(self.amplitude * (1j * rate - omega**2))

        largest = float(np.max(np.abs(factor(np.array([0.0, self.duration])))))
        return self._modulated(factor, largest, end, finer)

    def _modulated(
        self, amplitude: Callable[[np.ndarray], np.ndarray], largest: float, end: float, finer: float
    ) -> PiecewiseExponential:
        allowed, last = self.tolerance / finer * largest, min(end, self.duration)
        return PiecewiseExponential.modulated(
            amplitude, self.phase, lambda t: 2 * math.pi * self.frequency(t), last, allowed
        )


TimeFunction: TypeAlias = "Accelerogram | Harmonic | Sampled | Smooth | Sweep"


def check_numbers(what: str, **values: float) -> None:
    for name, value in values.items():
        if not is_real(value):
            raise MultiPhiTypeError(f"{what} {name}: got {value!r}, need a number")
        if not math.isfinite(value):
            raise MultiPhiValueError(f"{what} {name}: got {value!r}, need a finite number")


def _check_tolerance(value: float) -> None:
    check_numbers("course", tolerance=value)
    if not TIGHTEST <= value < 1:
        raise MultiPhiValueError(f"course tolerance: got {value!r}, need {TIGHTEST:g} <= tolerance < 1")


def check_time_function(what: str, course: Any, twice: bool = False) -> None:
    """Refuse what is no function of time; twice: whether it has to be twice differentiable, as Sampled is not."""
    if not isinstance(course, (Accelerogram, Harmonic, Sampled, Smooth, Sweep)):
        kinds = "Harmonic, Smooth, Sweep" if twice else "Harmonic, Sampled, Smooth, Sweep"
        raise MultiPhiTypeError(f"{what} course: got {type(course).__name__}, need {kinds} or Accelerogram")


def _breaks(given: Any) -> tuple[float, ...]:
    if isinstance(given, str) or not isinstance(given, Iterable):
        raise MultiPhiTypeError(f"breaks: got {given!r}, need a sequence of times in s")
    times = tuple(given)
    check_numbers("breaks", **{f"{i}": t for i, t in enumerate(times)})
    return tuple(float(t) for t in times)


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
