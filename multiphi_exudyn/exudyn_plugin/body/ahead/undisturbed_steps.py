"""Undisturbed steps: many equal steps of the trapezoidal rule at once, for a body on which no other force acts.

    x_n = T^n x_0,   x = (q, q', q'', 1),   M q'' + D q' + K q = drive  at the end of every step

Exudyn's coordinates are compared with these: a difference means that something else has changed them. The powers T,
T^2, T^4, ... of a level are kept, so n steps are at most log2(n) + 1 products.
"""

from __future__ import annotations

import numpy as np

from multiphi_exudyn.exudyn_plugin.coupling.stepped_level import SteppedLevel

__all__ = ["UndisturbedSteps"]


class UndisturbedSteps:
    """Steps of length ``step`` [s] in one level.

    periods: 1 / omega (s,) [s] of its modes, zero for modes of zero frequency.
    """

    def __init__(self, stepped: SteppedLevel, step: float) -> None:
        self._powers = [_one_step(stepped, step).T]
        omega, self.periods = stepped.loaded.modal.omega, np.zeros(stepped.size)
        np.divide(1.0, omega, out=self.periods[: len(omega)], where=omega > 0)

    def after(self, states: np.ndarray, counts: np.ndarray) -> np.ndarray:
        """States (q, q', q'') (k, 3, s) that ``counts`` (k,) steps reach from ``states`` (k, 3, s)."""
        x = np.ones((len(states), len(self._powers[0])))
        x[:, :-1] = states.reshape(len(states), -1)
        for power in range(int(np.max(counts, initial=0)).bit_length()):
            if power == len(self._powers):
                self._powers.append(self._powers[-1] @ self._powers[-1])
            rows = np.flatnonzero((counts >> power) & 1)
            x[rows] = x[rows] @ self._powers[power]
        return x[:, :-1].reshape(states.shape)


def _one_step(stepped: SteppedLevel, step: float) -> np.ndarray:
    """The matrix T (3 s + 1, 3 s + 1) of one step."""
    s, m, d, k = stepped.size, stepped.mass, stepped.damping, stepped.stiffness
    identity, none, h = np.eye(s), np.zeros((s, s)), step / 2
    q = np.hstack([identity, step * identity, h**2 * identity])
    q_t = np.hstack([none, identity, h * identity])
    right_side = np.hstack([-d @ q_t - k @ q, stepped.drive[:, None]])
    q_tt = np.linalg.solve(m + h * d + h**2 * k, right_side)
    matrix = np.vstack([h**2 * q_tt, h * q_tt, q_tt, np.zeros((1, 3 * s + 1))])
    matrix[:s, : 3 * s] += q
    matrix[s : 2 * s, : 3 * s] += q_t
    matrix[-1, -1] = 1.0
    return matrix
