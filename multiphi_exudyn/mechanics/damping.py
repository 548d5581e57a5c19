"""Damping of a structure by modal ratios or by its matrices, as alternatives to a matrix C.

C = M Phi diag(2 zeta omega) Phi^T M   (ModalDamping),   C = alpha M + beta K   (RayleighDamping)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.mechanics.arguments import is_real, real_array

__all__ = ["ModalDamping", "RayleighDamping"]


@dataclass(frozen=True)
class ModalDamping:
    """Damping ratios of the structure's modes, lowest first.

        C = M Phi diag(2 zeta omega) Phi^T M

    Modes of equal frequency are chosen so that the first point with any displacement in them moves in the first mode
    only.

    Parameters
    ----------
    ratios : sequence of float, or float
        zeta, fractions of critical damping (0.01 is 1 %), one per mode from the lowest, or a single number for all
        modes.
    beyond : float, default None
        Ratio of every mode that is not listed. None: these modes are undamped, and a run with such modes issues a
        warning.

    Raises
    ------
    MultiPhiTypeError
        For values that are not real numbers.
    MultiPhiValueError
        For ratios that are negative or not finite, and ``beyond`` together with a single number.

    Examples
    --------
    >>> import multiphi_exudyn as mp
    >>> mp.ModalDamping([0.01, 0.02], beyond=0.03).of(4).tolist()
    [0.01, 0.02, 0.03, 0.03]
    """

    ratios: Sequence[float] | float
    beyond: float | None = None

    def __post_init__(self) -> None:
        if is_real(self.ratios):
            if self.beyond is not None:
                raise MultiPhiValueError(
                    f"ratios: got the number {self.ratios!r} and beyond, need a list of ratios with beyond"
                )
            object.__setattr__(self, "beyond", self.ratios)
            object.__setattr__(self, "ratios", (self.ratios,))
        values = real_array("ratios", self.ratios, "a ratio or a list of ratios")
        if values.ndim != 1 or not np.all(np.isfinite(values)) or np.any(values < 0):
            raise MultiPhiValueError(f"ratios: got {self.ratios!r}, need a finite ratio >= 0 or a list of them")
        object.__setattr__(self, "ratios", tuple(values.tolist()))
        if self.beyond is not None:
            _check_not_negative("beyond", self.beyond)

    @property
    def listed(self) -> np.ndarray:
        """Listed ratios (k,), one per mode from the lowest."""
        return np.asarray(self.ratios, dtype=float)

    def of(self, count: int) -> np.ndarray:
        """Ratios (count,) of the lowest ``count`` modes."""
        ratios = np.full(count, self.beyond or 0.0)
        listed = self.listed[:count]
        ratios[: len(listed)] = listed
        return ratios


@dataclass(frozen=True)
class RayleighDamping:
    """Damping by the matrices, C = alpha M + beta K.

    Parameters
    ----------
    alpha : float, default 0.0
        [1/s], >= 0.
    beta : float, default 0.0
        [s], >= 0.

    Raises
    ------
    MultiPhiTypeError
        For values that are not numbers.
    MultiPhiValueError
        For values that are negative or not finite.

    Examples
    --------
    >>> import numpy as np
    >>> import multiphi_exudyn as mp
    >>> K = 4e4 * np.array([[2, -1, 0], [-1, 2, -1], [0, -1, 1]])  # N/m
    >>> rayleigh = mp.RayleighDamping(alpha=1.0, beta=1e-4)
    >>> chain = mp.LinearStructure(np.eye(3), K, rayleigh, {"tip": 2})
    >>> print(mp.MultiPhiModel(chain).level(()).ratios.round(4))
    [0.0101 0.0145 0.0194]
    """

    alpha: float = 0.0
    beta: float = 0.0

    def __post_init__(self) -> None:
        _check_not_negative("alpha", self.alpha)
        _check_not_negative("beta", self.beta)


def _check_not_negative(name: str, value: Any) -> None:
    if not is_real(value):
        raise MultiPhiTypeError(f"{name}: got {value!r}, need a number")
    if not (np.isfinite(value) and value >= 0):
        raise MultiPhiValueError(f"{name}: got {value!r}, need a finite value >= 0")
