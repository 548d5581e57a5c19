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

import numpy as np

from multiphi_exudyn.exudyn_plugin.stepped_level import SteppedLevel
from multiphi_exudyn.first_root import HERMITE
from multiphi_exudyn.state import Row

__all__ = ["StepTest"]


class StepTest:
    """The test for the functions ``rows`` of all contacts in one level, for steps of length ``step`` [s].

    Every function is divided by the factor of max |S z'| in its condition, so that all have the same right-hand side.
    """

    def __init__(self, stepped: SteppedLevel, rows: list[Row], step: float) -> None:
        level, size, count = stepped.loaded.level, stepped.size, len(rows)
        along, rate = np.zeros((count, size)), np.zeros((count, size))
        along[:, : level.modes] = np.reshape([row.position for row in rows], (count, level.modes))
        rate[:, : level.modes] = np.reshape([row.rate for row in rows], (count, level.modes))
        omega, none = np.sqrt(np.diagonal(stepped.stiffness)), np.zeros((count, size))
        scale = HERMITE * step**4 * _bounds(stepped, np.hstack([along, rate]), omega) + np.finfo(float).tiny
        value, third = np.hstack([along, rate, none]), np.hstack([none, along, rate]) * (step / 3)
        norm = np.hstack([np.zeros((2 * size, size)), np.diag(np.concatenate([omega, np.ones(size)]))])
        conditions = np.vstack([value - third, value, value + third]) / np.tile(scale, 3)[:, None]
        constants = np.tile(np.array([row.constant for row in rows]) / scale, 3)
        matrix = np.vstack([conditions, norm]) @ stepped.physical
        self._matrix = np.hstack([matrix, np.concatenate([constants, np.zeros(2 * size)])[:, None]])
        self._one, self._two, self._three = count, 2 * count, 3 * count

    def at(self, x: np.ndarray) -> tuple[float, float, float]:
        """Of a state x = (q, q', q'', 1): least condition for the step before it and after it, and |S z'|.

        A step is clear if the former of its end and the latter of its start exceed the larger |S z'| of the two.
        """
        y = self._matrix.dot(x)
        norm = y[self._three :]
        conditions: list[float] = y[: self._three].tolist()
        speed = math.sqrt(norm.dot(norm))
        if self._one == 1:  # the common case, at a third of the cost
            behind, here, ahead = conditions
            return (behind if behind < here else here), (ahead if ahead < here else here), speed
        return min(conditions[: self._two], default=math.inf), min(conditions[self._one :], default=math.inf), speed


def _bounds(stepped: SteppedLevel, functionals: np.ndarray, omega: np.ndarray) -> np.ndarray:
    """|[P R] A^3 S^-1| of every row [P R] (2 s,)."""
    size = stepped.size
    none, identity = np.zeros((size, size)), np.eye(size)
    system = np.block([[none, identity], [-stepped.stiffness, -stepped.own_damping]])
    scaled = np.block([[none, identity], [-np.diag(omega), -stepped.own_damping]])  # A S^-1, also where omega = 0
    return np.asarray(np.linalg.norm(functionals @ system @ system @ scaled, axis=1))
