"""Discretised level: the equations of a level for a time integration, plain or with modes matched to the step.

    M q'' + D q' + K q = p + drive,   q = eta, padded to the body's size with coordinates that stay zero

Plain: M = I, D = Phi^T C Phi, K = diag(omega^2), q' = eta'. A growing mode has omega^2 < 0 in both forms. Friction of
sliding contacts adds to D and K, which are then not symmetric (levels/level/sliding.py).

Matched to the step h: the trapezoidal rule replaces exp(h s) by (1 + h s/2) / (1 - h s/2). So it is exact for
z = (eta, eta') if it integrates, instead of z' = A z + B p, the equation z' = A_h z + B_h p with

    A_h = (2/h) tanh(A h/2) = (2/h) (E + I)^-1 (E - I),   B_h = (2/h) (E + I)^-1 Gamma
    E = exp(A h),   Gamma = integral_0^h exp(A t) dt B

also under a constant modal force p. With the first block rows [Q V] of A_h and G of B_h as a new velocity
q' = Q eta + V eta' + G p this is again an equation of second order. Its static stiffness is K itself, and for a mode
without damping M = (omega h/2)^2 / tan(omega h/2)^2 and D = 0. The damping need not be diagonal. Needs |omega| h < pi.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np
import scipy.linalg

from multiphi_exudyn.errors import MultiPhiValueError, NumericalFailure
from multiphi_exudyn.time.loaded_level import LoadedLevel

__all__ = ["DiscretisedLevel"]


@dataclass(frozen=True)
class DiscretisedLevel:
    """Equations of motion of a level for a solver; all matrices (s, s), s >= r the size of the body.

    Coordinates beyond the level's r modes are never excited; they have the frequency of its highest mode.
    loaded: the level. step: h [s] its modes are matched to, or None. mass, damping, stiffness: for the solver.
    modal_damping: D of the plain level. squares: omega^2 (s,). drive: constant force (s,) on modes of zero frequency.
    from_displacement, from_velocity, from_force: Q, V, G.
    """

    loaded: LoadedLevel
    step: float | None
    mass: np.ndarray
    damping: np.ndarray
    stiffness: np.ndarray
    modal_damping: np.ndarray
    squares: np.ndarray
    drive: np.ndarray
    from_displacement: np.ndarray
    from_velocity: np.ndarray
    from_force: np.ndarray

    @classmethod
    def of(cls, loaded: LoadedLevel, size: int, step: float | None) -> DiscretisedLevel:
        """The equations of a level with modes matched to ``step`` [s], or plain for None.

        Raises NumericalFailure where a stick position drives a mode of zero frequency: a solver's force would change
        with it.
        """
        level, held = loaded.modal, loaded.channels.force[:, loaded.excitation.prescribed :]
        if np.any(held):
            raise NumericalFailure(
                f"level {', '.join(level.closed)}: a friction spring drives a motion that nothing holds, by the "
                "friction of a sliding contact or beside a negative stiffness; inside Exudyn that is not possible: "
                "give the motion a small stiffness, or use simulate"
            )
        squares, damping = np.full(size, np.max(level.squares, initial=0.0)), np.zeros((size, size))
        squares[: level.modes] = level.squares
        stiffness = np.diag(squares)
        stiffness[: level.modes, : level.modes] += level.coupling
        damping[: level.modes, : level.modes] = level.damping_matrix
        drive = np.zeros(size)
        drive[: level.modes] = loaded.asymptotic.drive
        maps = _plain(damping) if step is None else _matched(squares, stiffness, damping, step)
        mass, discretised, q, v, g = maps
        return cls(loaded, step, mass, discretised, stiffness, damping, squares, drive, q, v, g)

    @property
    def states(self) -> tuple[int, ...]:
        """State number of every element."""
        return self.loaded.states

    @property
    def modes(self) -> int:
        """Number r of the level's modes."""
        return self.loaded.modal.modes

    @property
    def size(self) -> int:
        """Number of coordinates s."""
        return len(self.drive)

    def acceleration(self, q: np.ndarray, q_t: np.ndarray, force: np.ndarray) -> np.ndarray:
        """q'' (s,) under a modal force."""
        return self._mass_inverse @ (force - self.internal_force(q, q_t))

    def internal_force(self, q: np.ndarray, q_t: np.ndarray) -> np.ndarray:
        """Internal force D q' + K q - drive (s,)."""
        return self.damping.dot(q_t) + self.stiffness.dot(q) - self.drive

    def velocity(self, q: np.ndarray, q_t: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Modal velocity eta' (s,) of a solver's state q, q' (s,) under a modal force (s,)."""
        difference = q_t - self.from_displacement.dot(q) - self.from_force.dot(force + self.drive)
        return self.velocity_inverse.dot(difference)

    def solver_state(self, eta: np.ndarray, eta_t: np.ndarray, force: np.ndarray) -> tuple[np.ndarray, ...]:
        """q, q', q'' (s,) of eta, eta' (r,) under a modal force (s,); stick positions after eta are ignored."""
        r, s = self.modes, self.size
        modal = np.zeros(3 * s)
        modal[:r], modal[s : s + r], modal[2 * s :] = eta[:r], eta_t[:r], force + self.drive
        rates = self.rates.dot(modal)
        return modal[:s], rates[:s], rates[s:]

    def solver_states(self, eta: np.ndarray, eta_t: np.ndarray, force: np.ndarray) -> np.ndarray:
        """(q, q', q'') (k, 3 s) of eta, eta' (k, r) under modal forces (k, s), as in ``solver_state``."""
        states = np.zeros((len(eta), 3 * self.size))
        s = self.size
        q, q_t, q_tt = states[:, :s], states[:, s : 2 * s], states[:, 2 * s :]
        v, r = np.zeros_like(q), self.modes
        q[:, :r], v[:, :r] = eta[:, :r], eta_t[:, :r]
        q_t[:] = q @ self.from_displacement.T + v @ self.from_velocity.T + (force + self.drive) @ self.from_force.T
        q_tt[:] = (force + self.drive - q_t @ self.damping.T - q @ self.stiffness.T) @ self._mass_inverse.T
        return states

    def external_force(self, q: np.ndarray, q_t: np.ndarray, q_tt: np.ndarray) -> np.ndarray:
        """External modal force p (s,) of a state, by the equation of motion."""
        return self.equation_matrix.dot(np.concatenate([q, q_t, q_tt])) - self.drive

    @functools.cached_property
    def to_physical(self) -> np.ndarray:
        """Matrix (3 s, 3 s) from (q, q', q'') to (eta, eta', eta''), for any force."""
        identity, none = np.eye(self.size), np.zeros((self.size, self.size))
        difference = np.hstack([-self.from_displacement, identity, none]) - self.from_force @ self.equation_matrix
        velocity = self.velocity_inverse @ difference
        acceleration = self.equation_matrix - self.modal_damping @ velocity
        acceleration[:, : self.size] -= self.stiffness
        return np.vstack([np.hstack([identity, none, none]), velocity, acceleration])

    @functools.cached_property
    def rates(self) -> np.ndarray:
        """Matrix (2 s, 3 s) from eta, eta' and the total modal force to (q', q'')."""
        velocity = np.hstack([self.from_displacement, self.from_velocity, self.from_force])
        internal_force = self.damping @ velocity
        internal_force[:, : self.size] += self.stiffness
        internal_force[:, 2 * self.size :] -= np.eye(self.size)
        return np.vstack([velocity, -self._mass_inverse @ internal_force])

    @functools.cached_property
    def equation_matrix(self) -> np.ndarray:
        """Matrix (s, 3 s) [K D M]."""
        return np.hstack([self.stiffness, self.damping, self.mass])

    @functools.cached_property
    def velocity_difference(self) -> np.ndarray:
        """Matrix (s, 3 s) from q, q' and the total modal force to V eta'."""
        return np.hstack([-self.from_displacement, np.eye(self.size), -self.from_force])

    @functools.cached_property
    def _mass_inverse(self) -> np.ndarray:
        return np.asarray(np.linalg.inv(self.mass))

    @functools.cached_property
    def velocity_inverse(self) -> np.ndarray:
        """V^-1 (s, s)."""
        return np.asarray(np.linalg.inv(self.from_velocity))


Maps = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]  # M, D, Q, V, G


def _plain(damping: np.ndarray) -> Maps:
    identity, none = np.eye(len(damping)), np.zeros_like(damping)
    return identity, damping, none, identity, none


def _matched(squares: np.ndarray, stiffness: np.ndarray, damping: np.ndarray, step: float) -> Maps:
    omega = np.sqrt(np.abs(squares))
    fastest = math.sqrt(np.max(np.abs(np.linalg.eigvals(stiffness))))
    if fastest * step >= math.pi:
        raise MultiPhiValueError(
            f"matchedStepSize: got {step:g} s, need less than {math.pi / fastest:g} s, half the shortest "
            "period of the kept modes"
        )
    s, identity = len(squares), np.eye(len(squares))
    scale = np.where(omega > 0, omega, 1 / step)  # displacements and velocities of one size
    system = np.zeros((3 * s, 3 * s))
    system[:s, s : 2 * s] = np.diag(scale)
    system[s : 2 * s, :s] = -stiffness / scale
    system[s : 2 * s, s : 2 * s] = -damping
    system[s : 2 * s, 2 * s :] = identity
    transition = scipy.linalg.expm(system * step)[: 2 * s]
    rule = np.linalg.solve(transition[:, : 2 * s] + np.eye(2 * s), transition - np.eye(2 * s, 3 * s)) * (2 / step)
    rule[:, :s] *= scale
    rule[:s] /= scale[:, None]
    return _second_order(rule, s)


def _second_order(rule: np.ndarray, s: int) -> Maps:
    """M, D, Q, V, G from [A_h B_h] (2 s, 3 s)."""
    (q, v, g), (_, lower, input_matrix) = np.hsplit(rule[:s], 3), np.hsplit(rule[s:], 3)
    inverse = np.linalg.inv(v)
    mass = np.linalg.inv(v @ (input_matrix - lower @ inverse @ g))
    damping = -mass @ (q + v @ lower @ inverse)
    return mass, damping, q, v, g
