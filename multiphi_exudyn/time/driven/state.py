"""State under an excitation: xi = (eta, w), xi' and the drive that takes them on."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, replace

import numpy as np

from multiphi_exudyn.events.state import State
from multiphi_exudyn.mathematics.bounded_cache import BoundedCache
from multiphi_exudyn.mathematics.exponentials import Exponentials
from multiphi_exudyn.mathematics.first_descent import DescentFinder
from multiphi_exudyn.time.driven.excitation import Drive
from multiphi_exudyn.time.driven.flow import Basis, Flow
from multiphi_exudyn.time.driven.level import DrivenLevel

__all__ = ["DrivenState"]


@dataclass(frozen=True)
class DrivenState(State):
    """A state xi, xi' of a driven level, with the drive from its instant on, that is looked at up to ``until`` [s]."""

    level: DrivenLevel
    drive: Drive
    until: float
    finders: BoundedCache[tuple[tuple[int, ...], Basis], DescentFinder]

    @functools.cached_property
    def flow(self) -> Flow:
        """The motion that starts here."""
        until = min(self.drive.until, self.until)
        horizon = _bucket(until - self.drive.time if until > self.drive.time else until)
        return Flow.of(self.level, self.displacement, self.velocity, self.drive, horizon)

    @property
    def plain(self) -> State:
        """eta, eta' alone, in the level under static loads."""
        eta, eta_t = self.level.split(self.displacement)[0], self.level.split(self.velocity)[0]
        return State(self.level.plain, eta, eta_t, self.phases)

    @functools.cached_property
    def acceleration(self) -> np.ndarray:
        """xi'' (r + q,)."""
        (eta, w), (eta_t, w_t) = self.level.split(self.displacement), self.level.split(self.velocity)
        forced = self.level.force @ w + self.level.force_rate @ w_t
        return np.concatenate([self.level.plain.acceleration(eta, eta_t) + forced, self.drive.values[2]])

    @functools.cached_property
    def reach(self) -> np.ndarray:
        """How far (r + q,) the velocities carry the modes, and the terms of the channels."""
        return np.concatenate([self.plain.reach, self.drive.sizes[0]])

    @functools.cached_property
    def swing(self) -> np.ndarray:
        """How fast (r + q,) the displacements make the modes, and the terms of the channels' rates."""
        return np.concatenate([self.plain.swing, self.drive.sizes[1]])

    @functools.cached_property
    def accelerating(self) -> np.ndarray:
        """Of which terms (r + q,) the accelerations are the sums, and how large the velocities make them."""
        w, w_t, w_tt = self.drive.sizes
        forced = np.abs(self.level.force) @ w + np.abs(self.level.force_rate) @ w_t
        return np.concatenate([self.plain.accelerating + forced, w_tt])

    @property
    def basis(self) -> Exponentials:
        """The exponentials of the motion that starts here."""
        return self.flow.basis

    @property
    def shapes(self) -> np.ndarray:
        """xi is the real part of these times coefficients times exponentials."""
        return self.flow.shapes

    @property
    def finder(self) -> DescentFinder:
        """Event location on these exponentials."""
        key = self.closed, self.flow.key
        return self.finders.get_or_build(key, lambda: DescentFinder(self.flow.basis))

    def coefficients(self) -> np.ndarray:
        """Coefficients (p,) of the exponentials for the motion that starts here."""
        return self.flow.coefficients

    @property
    def terms(self) -> np.ndarray:
        """Of which terms (p,) the coefficients are the sums."""
        response = self.level.plain.level.response
        eta, eta_t = self.flow.parts
        free = response.sizes(eta, eta_t, np.abs(self.level.plain.asymptotic.drive))
        units = (self.flow.basis.unit / response.basis.unit) ** response.basis.powers
        return np.concatenate([free * units, np.ones(len(self.flow.coefficients) - len(free))])

    def after(self, coefficients: np.ndarray, t: float) -> DrivenState:
        """The state a time t [s] later."""
        return replace(self, displacement=self.flow.at(t), velocity=self.flow.at(t, 1), drive=self.drive.after(t))


def _bucket(duration: float) -> float:
    """The power of two above a duration: bases are shared among pieces of about the same length."""
    return math.ldexp(1.0, math.frexp(duration)[1])
