"""Certified test that nothing happens within a time step, from the states at its two ends.

For a contact's function s (events/rule.py) the cubic Hermite interpolant of s, s' at both ends is off by at most
h^4/384 max|s''''|, and it lies above the least of its Bernstein coefficients: s > 0 on the whole step if

    min(s0, s0 + h s0'/3, s1 - h s1'/3, s1) > h^4/384 |[P R] A^3 S^-1| max |S z'| exp(sigma h)

s = P eta + R eta' + c, z = (eta, eta'), z' = A z + constant, S = diag(|omega|, I). |S z'| is an energy norm of the
velocities: under a constant force it grows no faster than with the largest rate sigma of a growing mode (omega^2 < 0),
mostly not at all, so the values at the two ends bound it in between, whatever that force is. What fails the test is
looked at exactly (body.py): the test may not decide, but it does not err. Of forces f on points s also holds L f
(modal_force.py), of the step's mean: what stands at each end, less half its change.
"""

from __future__ import annotations

import math

import numpy as np

from multiphi_exudyn.events.state import Row
from multiphi_exudyn.exudyn_plugin.coupling.stepped_level import SteppedLevel
from multiphi_exudyn.mathematics.root_search import HERMITE

__all__ = ["StepTest", "energy_norm", "gains", "swell"]

NEGLIGIBLE = float(np.finfo(float).eps)  # of a contact's function: what no test needs to tell from zero


class StepTest:
    """The test for the functions ``rows`` of all contacts in one level, for steps of length ``step`` [s].

    direct: L (c, m) for them. directly: whether any of it counts.
    """

    def __init__(self, stepped: SteppedLevel, rows: list[Row], step: float, direct: np.ndarray) -> None:
        size, count = stepped.size, len(rows)
        norm = np.hstack([energy_norm(stepped), np.zeros((2 * size, 1 + direct.shape[1]))])
        self.directly = bool(np.any(direct))
        self._added = np.tile(direct, (3, 1)) / _scales(stepped, rows, step)[:, None]
        self._matrix = np.vstack([np.hstack([_conditions(stepped, rows, step), self._added]), norm])
        self._forces = 3 * size + 1
        self._one, self._two, self._three = count, 2 * count, 3 * count

    def at(self, x: np.ndarray) -> tuple[float, float, float]:
        """Of a state x = (q, q', q'', 1, f): least condition for the step before it and after it, and |S z'|.

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

    def half_change(self, before: np.ndarray, after: np.ndarray) -> float:
        """How far L f of the mean can be from that of either end of a step, in units of the conditions."""
        return float(np.max(np.abs(self._added @ (after - before)[self._forces :]), initial=0.0)) / 2


def _conditions(stepped: SteppedLevel, rows: list[Row], step: float) -> np.ndarray:
    """s - h s'/3, s, s + h s'/3 of all contacts as functions of x = (q, q', q'', 1), (3 c, 3 s + 1).

    Each is divided by its factor of max |S z'| at the start, so that all have the same right-hand side.
    """
    along, rate = _padded(stepped, rows)
    none = np.zeros_like(along)
    value, third = np.hstack([along, rate, none]), np.hstack([none, along, rate]) * (step / 3)
    functions = np.vstack([value - third, value, value + third]) @ stepped.physical
    constants = np.tile([row.constant for row in rows], 3)
    return np.hstack([functions, constants[:, None]]) / _scales(stepped, rows, step)[:, None]


def _scales(stepped: SteppedLevel, rows: list[Row], step: float) -> np.ndarray:
    """The factors (3 c,) of max |S z'| at the start, by which the conditions are divided.

    Free motion has no fourth derivative: then round-off of the way that max |S z'| makes in a step, or for a contact
    that no mode moves of its gap, stands in for it.
    """
    along, rate = _padded(stepped, rows)
    scale = HERMITE * step**4 * gains(stepped, np.hstack([along, rate]), 3)
    way = step**2 * np.linalg.norm(along, axis=1) + step * np.linalg.norm(rate, axis=1)
    constants = np.array([abs(row.constant) for row in rows]).reshape(-1)
    least = NEGLIGIBLE * np.where(way > 0, way, np.where(constants > 0, constants, 1.0))
    return np.tile(np.maximum(scale, least) * swell(stepped, step), 3)


def _padded(stepped: SteppedLevel, rows: list[Row]) -> tuple[np.ndarray, np.ndarray]:
    """P and R (c, s) of functions."""
    modes, size, count = stepped.loaded.level.modes, stepped.size, len(rows)
    along, rate = np.zeros((2, count, size))
    along[:, :modes] = np.reshape([row.position for row in rows], (count, modes))
    rate[:, :modes] = np.reshape([row.rate for row in rows], (count, modes))
    return along, rate


def _omega(stepped: SteppedLevel) -> np.ndarray:
    return np.asarray(np.sqrt(np.abs(np.diagonal(stepped.stiffness))))


def _signed(stepped: SteppedLevel) -> np.ndarray:
    """omega^2 / |omega|."""
    return np.asarray(np.sign(np.diagonal(stepped.stiffness)) * _omega(stepped))


def swell(stepped: SteppedLevel, duration: float) -> float:
    """How much |S z'| can grow in this time."""
    lowest = float(np.min(np.diagonal(stepped.stiffness), initial=0.0))
    return math.exp(math.sqrt(-lowest) * duration)


def energy_norm(stepped: SteppedLevel) -> np.ndarray:
    """S z' (2 s,) from (q, q', q'')."""
    scale = np.concatenate([_omega(stepped), np.ones(stepped.size)])
    return np.asarray(scale[:, None] * stepped.physical[stepped.size :])


def gains(stepped: SteppedLevel, functionals: np.ndarray, power: int) -> np.ndarray:
    """|[P R] A^power S^-1| of every row [P R] (2 s,)."""
    size = stepped.size
    none, identity = np.zeros((size, size)), np.eye(size)
    system = np.block([[none, identity], [-stepped.stiffness, -stepped.own_damping]])
    scaled = np.block(
        [[none, identity], [-np.diag(_signed(stepped)), -stepped.own_damping]]
    )  # A S^-1, also where omega = 0
    return np.asarray(np.linalg.norm(functionals @ np.linalg.matrix_power(system, power - 1) @ scaled, axis=1))
