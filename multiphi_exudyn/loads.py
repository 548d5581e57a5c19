"""Loads on a structure: f(t) in M x'' + C x' + K x = f(t) (eq. 38.1).

A constant load belongs to the asymptotic configuration of every level, K_l x_inf,l = f, so that it is exact for any
number of modes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.structure import At, is_real

__all__ = ["ConstantLoad"]


@dataclass(frozen=True)
class ConstantLoad:
    """f(t) = p force.

    at: where, a point name, {point: coefficient} or an (n,) row p. force: N (N m on a rotation).
    Gravity g is the row M e g, e the direction's unit vector, with force 1.
    """

    at: At
    force: float

    def __post_init__(self) -> None:
        if not is_real(self.force):
            raise MultiPhiTypeError(f"load force: got {self.force!r}, need a number")
        if not math.isfinite(self.force):
            raise MultiPhiValueError(f"load force: got {self.force!r}, need a finite number")
