"""A level as a time integration takes it: plain, or with its modes matched to the step.

    M q'' + D q' + K q = p + drive,   q = eta, padded to the body's size with coordinates that stay zero

Plain: M = I, D = Phi^T C Phi, K = diag(omega^2), q' = eta'. A growing mode has omega^2 < 0 in either. Where contacts
slide friction adds its own to D and K, which are then not symmetric (levels/sliding.py).

Matched to the step h: the trapezoidal rule turns exp(h s) into (1 + h s/2) / (1 - h s/2), so it is exact for
z = (eta, eta') if it is given, instead of z' = A z + B p,

    A_h = (2/h) tanh(A h/2) = (2/h) (E + I)^-1 (E - I),   B_h = (2/h) (E + I)^-1 Gamma
    E = exp(A h),   Gamma = integral_0^h exp(A t) dt B

exactly also under a constant modal force p. With the first block rows [Q V] of A_h and G of B_h as a new velocity
q' = Q eta + V eta' + G p this is again of second order, its static stiffness is K itself, and for a mode without
damping M = (omega h/2)^2 / tan(omega h/2)^2 and D = 0. The damping need not be diagonal. Needs |omega| h < pi.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np
import scipy.linalg

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.events.loaded_level import LoadedLevel

__all__ = ["SteppedLevel"]


@dataclass(frozen=True)
class SteppedLevel:
    """See the module's docstring. All matrices (s, s), s >= r the size of the body.

    Coordinates beyond the level's r modes are never excited; they have the frequency of its highest one.
    loaded: the level. mass, damping, stiffness: for the solver. own_damping: D of the plain level. squares: omega^2
    (s,). drive: (s,).
    from_displacement, from_velocity, from_force: Q, V, G. step: h [s], or None.
    """

    loaded: LoadedLevel
    step: float | None
    mass: np.ndarray
    damping: np.ndarray
    stiffness: np.ndarray
    own_damping: np.ndarray
    squares: np.ndarray
    drive: np.ndarray
    from_displacement: np.ndarray
    from_velocity: np.ndarray
    from_force: np.ndarray

    @classmethod
    def of(cls, loaded: LoadedLevel, size: int, step: float | None) -> SteppedLevel:
        """A level matched to ``step`` [s], or plain for None."""
        level = loaded.modal
        squares, damping = np.full(size, np.max(level.squares, initial=0.0)), np.zeros((size, size))
        squares[: level.modes] = level.squares
        stiffness = np.diag(squares)
        stiffness[: level.modes, : level.modes] += level.coupling
        damping[: level.modes, : level.modes] = level.damping_matrix
        drive = np.zeros(size)
        drive[: level.modes] = loaded.asymptotic.drive
        maps = _plain(damping) if step is None else _matched(squares, stiffness, damping, step)
        mass, stepped, q, v, g = maps
        return cls(loaded, step, mass, stepped, stiffness, damping, squares, drive, q, v, g)

    @property
    def states(self) -> tuple[int, ...]:
        """The number of every element's state."""
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
        return self._mass_inverse @ (force - self.resisting(q, q_t))

    def resisting(self, q: np.ndarray, q_t: np.ndarray) -> np.ndarray:
        """D q' + K q - drive (s,)."""
        return self.damping.dot(q_t) + self.stiffness.dot(q) - self.drive

    def velocity(self, q: np.ndarray, q_t: np.ndarray, force: np.ndarray) -> np.ndarray:
        """eta' (s,) of a state in the solver under a modal force."""
        shown = q_t - self.from_displacement.dot(q) - self.from_force.dot(force + self.drive)
        return self._velocity_inverse.dot(shown)

    def state(self, eta: np.ndarray, eta_t: np.ndarray, force: np.ndarray) -> tuple[np.ndarray, ...]:
        """q, q', q'' (s,) of eta, eta' (r,) under a modal force (s,); behind eta may stand what links hold."""
        r, s = self.modes, self.size
        given = np.zeros(3 * s)
        given[:r], given[s : s + r], given[2 * s :] = eta[:r], eta_t[:r], force + self.drive
        moved = self._rates.dot(given)
        return given[:s], moved[:s], moved[s:]

    def shown(self, eta: np.ndarray, eta_t: np.ndarray, force: np.ndarray) -> np.ndarray:
        """(q, q', q'') (k, 3 s) of eta, eta' (k, r) under modal forces (k, s); behind eta as in ``state``."""
        found = np.zeros((len(eta), 3 * self.size))
        s = self.size
        q, q_t, q_tt = found[:, :s], found[:, s : 2 * s], found[:, 2 * s :]
        v, r = np.zeros_like(q), self.modes
        q[:, :r], v[:, :r] = eta[:, :r], eta_t[:, :r]
        q_t[:] = q @ self.from_displacement.T + v @ self.from_velocity.T + (force + self.drive) @ self.from_force.T
        q_tt[:] = (force + self.drive - q_t @ self.damping.T - q @ self.stiffness.T) @ self._mass_inverse.T
        return found

    @functools.cached_property
    def outside(self) -> np.ndarray:
        """The matrix (s, 3 s + 1) from (q, q', q'', 1) to the modal force p, by the equation of motion."""
        return np.hstack([self._total, -self.drive[:, None]])

    @functools.cached_property
    def physical(self) -> np.ndarray:
        """The matrix (3 s, 3 s) from (q, q', q'') to (eta, eta', eta''), whatever force acts."""
        identity, none = np.eye(self.size), np.zeros((self.size, self.size))
        shown = np.hstack([-self.from_displacement, identity, none]) - self.from_force @ self._total
        velocity = self._velocity_inverse @ shown
        acceleration = self._total - self.own_damping @ velocity
        acceleration[:, : self.size] -= self.stiffness
        return np.vstack([np.hstack([identity, none, none]), velocity, acceleration])

    @functools.cached_property
    def _rates(self) -> np.ndarray:
        """The matrix (2 s, 3 s) from eta, eta' and the whole modal force to (q', q'')."""
        velocity = np.hstack([self.from_displacement, self.from_velocity, self.from_force])
        resisting = self.damping @ velocity
        resisting[:, : self.size] += self.stiffness
        resisting[:, 2 * self.size :] -= np.eye(self.size)
        return np.vstack([velocity, -self._mass_inverse @ resisting])

    @functools.cached_property
    def _total(self) -> np.ndarray:
        return np.hstack([self.stiffness, self.damping, self.mass])

    @functools.cached_property
    def _mass_inverse(self) -> np.ndarray:
        return np.asarray(np.linalg.inv(self.mass))

    @functools.cached_property
    def _velocity_inverse(self) -> np.ndarray:
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
    scale = np.where(omega > 0, omega, 1 / step)  # both halves of z alike
    system = np.zeros((3 * s, 3 * s))
    system[:s, s : 2 * s] = np.diag(scale)
    system[s : 2 * s, :s] = -stiffness / scale
    system[s : 2 * s, s : 2 * s] = -damping
    system[s : 2 * s, 2 * s :] = identity
    flow = scipy.linalg.expm(system * step)[: 2 * s]
    turned = np.linalg.solve(flow[:, : 2 * s] + np.eye(2 * s), flow - np.eye(2 * s, 3 * s)) * (2 / step)
    turned[:, :s] *= scale
    turned[:s] /= scale[:, None]
    return _second_order(turned, s)


def _second_order(turned: np.ndarray, s: int) -> Maps:
    """M, D, Q, V, G from [A_h B_h] (2 s, 3 s)."""
    (q, v, g), (_, lower, forced) = np.hsplit(turned[:s], 3), np.hsplit(turned[s:], 3)
    inverse = np.linalg.inv(v)
    mass = np.linalg.inv(v @ (forced - lower @ inverse @ g))
    damping = -mass @ (q + v @ lower @ inverse)
    return mass, damping, q, v, g
