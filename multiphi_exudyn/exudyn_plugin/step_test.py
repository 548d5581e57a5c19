"""Certified test that nothing happens within a time step, from the states at its two ends.

For a contact's function s (event_rule.py) the cubic Hermite interpolant of s, s' at both ends is off by at most
h^4/384 max|s''''|, and it lies above the least of its Bernstein coefficients: s > 0 on the whole step if

    min(s0, s0 + h s0'/3, s1 - h s1'/3, s1) > h^4/384 |[P R] A^3 S^-1| max |S z'|

s = P eta + R eta' + c, z = (eta, eta'), z' = A z + constant, S = diag(omega, I). |S z'| is an energy norm of the
velocities: under a constant force it cannot grow, so the values at the two ends bound it in between, whatever
that force is. What fails the test is looked at exactly (body.py): the test may not decide, but it does not err.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from multiphi_exudyn.exudyn_plugin.stepped_level import SteppedLevel
from multiphi_exudyn.first_root import HERMITE
from multiphi_exudyn.state import Row

__all__ = ["Sample", "StepTest"]


class Sample(NamedTuple):
    """State x = (q, q', q'') (3 s,), s and s' of every contact, |S z'|."""

    x: np.ndarray
    values: list[float]
    speed: float


class StepTest:
    """The test for the functions ``rows`` of all contacts in one level."""

    def __init__(self, stepped: SteppedLevel, rows: list[Row]) -> None:
        level, size = stepped.loaded.level, stepped.size
        r, count = level.modes, len(rows)
        along, rate = np.zeros((count, size)), np.zeros((count, size))
        along[:, :r] = np.reshape([row.position for row in rows], (count, r))
        rate[:, :r] = np.reshape([row.rate for row in rows], (count, r))
        omega, none = np.sqrt(np.diagonal(stepped.stiffness)), np.zeros((count, size))
        signals = np.vstack([np.hstack([along, rate, none]), np.hstack([none, along, rate])])
        scaled = np.hstack([np.zeros((2 * size, size)), np.diag(np.concatenate([omega, np.ones(size)]))])
        self._matrix = np.vstack([signals, scaled]) @ stepped.physical
        self._constants = [row.constant for row in rows]
        self._bounds = [HERMITE * bound for bound in _bounds(stepped, np.hstack([along, rate]), omega)]
        self._count, self._signals = count, 2 * count

    def at(self, x: np.ndarray) -> Sample:
        """What the test needs of a state."""
        y = self._matrix.dot(x)
        scaled = y[self._signals :]
        return Sample(x, y[: self._signals].tolist(), math.sqrt(scaled.dot(scaled)))

    def passes(self, before: Sample, after: Sample, h: float) -> bool:
        """True where no contact's function can have reached zero in the step of length h [s]."""
        remainder = h**4 * max(before.speed, after.speed)
        third, n = h / 3, self._count
        for i, (bound, constant) in enumerate(zip(self._bounds, self._constants, strict=True)):
            s0, s1 = before.values[i] + constant, after.values[i] + constant
            least = bound * remainder
            if s0 <= least or s1 <= least:
                return False
            if s0 + third * before.values[n + i] <= least or s1 - third * after.values[n + i] <= least:
                return False
        return True


def _bounds(stepped: SteppedLevel, functionals: np.ndarray, omega: np.ndarray) -> list[float]:
    """|[P R] A^3 S^-1| of every row [P R] (2 s,)."""
    size = stepped.size
    none, identity = np.zeros((size, size)), np.eye(size)
    system = np.block([[none, identity], [-stepped.stiffness, -stepped.own_damping]])
    scaled = np.block([[none, identity], [-np.diag(omega), -stepped.own_damping]])  # A S^-1, also where omega = 0
    return np.linalg.norm(functionals @ system @ system @ scaled, axis=1).tolist()
