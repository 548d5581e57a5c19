"""Functions of time of loads, moving stops and moving bases.

    u(t):   Accelerogram, Harmonic, Sampled, Smooth, Sweep

Each becomes a piecewise exponential (piecewise_exponential.py), for which the response is known in closed form. A
harmonic and straight lines between samples are exact; a smooth function and a sweep are interpolated to their
tolerance.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from multiphi_exudyn.errors import MultiPhiError, MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.mathematics.functions.interpolation import FEW_SAMPLES, MANY_SAMPLES, Samples
from multiphi_exudyn.mathematics.functions.piecewise_exponential import PiecewiseExponential
from multiphi_exudyn.mechanics.loads.samples import Accelerogram, Sampled
from multiphi_exudyn.mechanics.structures.arguments import is_real

__all__ = ["Harmonic", "Smooth", "Sweep", "TimeFunction", "check_numbers", "check_time_function"]

SWEEPS = ("linear", "logarithmic")
TIGHTEST = 1e-12  # smallest tolerance, above the round-off of the polynomials


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
