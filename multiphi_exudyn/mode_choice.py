"""Choice of modes: how many a level has, where it is not said by a number.

UpTo         all up to a cut-off frequency
Tolerance    as many as a truncation error of the run needs (truncation.py)
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.structure import is_real

__all__ = ["Tolerance", "UpTo", "is_count"]


@dataclass(frozen=True)
class UpTo:
    """Every level with its modes up to a cut-off frequency [Hz], at least one and at most ``most``.

    A closed contact raises frequencies, so no level has more modes than the open one.
    """

    frequency: float
    most: int = 60

    def __post_init__(self) -> None:
        _check_limits(self, "frequency", self.frequency, self.most)


@dataclass(frozen=True)
class Tolerance:
    """Wanted truncation error of a run, from which its cut-off frequency follows.

    error: of ``truncation_indicator``, an estimate of the relative error of displacements; 0.01 is 1 %.
    most: modes that a level is given at most.
    """

    error: float
    most: int = 60

    def __post_init__(self) -> None:
        _check_limits(self, "error", self.error, self.most)


def is_count(value: object) -> bool:
    """Whether a value is a whole number."""
    return is_real(value) and isinstance(value, (int, np.integer))


def _check_limits(given: UpTo | Tolerance, name: str, value: float, most: int) -> None:
    kind = type(given).__name__
    if not is_real(value) or not is_count(most):
        raise MultiPhiTypeError(f"{kind}: got {value!r} and {most!r}, need a number and an integer")
    if not (math.isfinite(value) and value > 0 and most >= 1):
        raise MultiPhiValueError(f"{kind}: got {name} {value!r} and most {most}, need {name} > 0 and most >= 1")
