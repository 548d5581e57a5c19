"""Contact problems whose motion is known in closed form.

``ClampedBar``           an elastic bar, clamped at one end, meets a rigid stop at the other
``BouncingBar``          an elastic bar falls on a rigid floor and bounces
``BilinearOscillator``   one mass, two stiffnesses, zero gap: a compliant stop
``PlasticImpact``        one mass on a spring strikes a rigid stop, restitution 0

Positions x and times t broadcast against each other; everything returned is a numpy array. At the instant of
an event the value is the one that holds right after it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from multiphi_exudyn.errors import MultiPhiValueError

__all__ = ["BilinearOscillator", "BouncingBar", "ClampedBar", "PlasticImpact"]

Array: TypeAlias = np.ndarray
ArrayLike: TypeAlias = Any  # a number or an array of numbers


class ClampedBar:
    """Bar on 0 < x < 1, clamped at x = 1, over a rigid stop at x = 0; dimensionless.

        u_tt = u_xx,   u(1, t) = 0,   0 <= u(0, t),  0 <= lambda = -u_x(0, t),  u lambda = 0
        u(x, 0) = (1 - x)/2,   u_t(x, 0) = 0

    Open for 0 < t < 1, closed for 1 < t < 2 with lambda = 1/2, open for 2 < t < 3, period 3, energy 1/8.
    Source: Dabaghi, Petrov, Pousin, Renard, Convergence of mass redistribution method for the one-dimensional
    wave equation with a unilateral constraint at the boundary, ESAIM: M2AN 48 (2014) 1147; arXiv:1601.00778.
    """

    period = 3.0
    energy = 1 / 8
    closed_interval = (1.0, 2.0)  # in the first period

    def displacement(self, x: ArrayLike, t: ArrayLike) -> Array:
        """u(x, t): three pieces of d'Alembert's solution, one per phase."""
        x, s = np.asarray(x, dtype=float), np.mod(t, self.period)
        falling = (1 - np.maximum(x, s)) / 2
        pressed = -np.minimum(np.minimum(s - 1, 2 - s), np.minimum(x, 1 - x)) / 2
        rising = np.minimum(s - 2, 1 - x) / 2
        return np.select([s < 1, s < 2], [falling, pressed], rising)

    def velocity(self, x: ArrayLike, t: ArrayLike) -> Array:
        """u_t(x, t): 0 or plus or minus 1/2, with jumps along the characteristics."""
        x, s = np.asarray(x, dtype=float), np.mod(t, self.period)
        inner = np.minimum(x, 1 - x)
        falling = np.where(x <= s, -0.5, 0.0)
        pressed = np.where(s - 1 < inner, -0.5, np.where(2 - s <= inner, 0.5, 0.0))
        rising = np.where(s - 2 < 1 - x, 0.5, 0.0)
        return np.select([s < 1, s < 2], [falling, pressed], rising)

    def closed(self, t: ArrayLike) -> Array:
        """True while the bar touches the stop."""
        s = np.mod(t, self.period)
        return (s >= 1) & (s < 2)

    def reaction(self, t: ArrayLike) -> Array:
        """lambda(t), the force of the stop on the bar."""
        return np.where(self.closed(t), 0.5, 0.0)


class BouncingBar:
    """Free bar of length L above a rigid floor at u(0) = 0, dropped at rest from the height h0.

        rho u_tt = E u_xx - rho g,   u_x(L, t) = 0,   0 <= u(0, t),  0 <= p = -E u_x(0, t),  u p = 0
        u(x, 0) = h0,   u_t(x, 0) = 0

    L = 10 m, E = 900 Pa, rho = 1 kg/m3, area 1 m2, g = 10 m/s2, h0 = 5 m: wave speed c = 30 m/s, one passage
    tau = L/c = 1/3 s, first impact at 1 s with v0 = 10 m/s. Contact lasts 2 tau, the flight between two
    contacts 2 v0/g = 6 tau: a whole number of the bar's own periods, so that the motion is symmetric in time
    about 8/3 s and has the period 16/3 s. u includes the height h0: it is the gap of the lower end.
    Source: D. Doyen, A. Ern, S. Piperno, Time-integration schemes for the finite element dynamic Signorini
    problem, SIAM J. Sci. Comput. 33 (2011) 223.
    """

    length = 10.0
    modulus = 900.0
    density = 1.0
    gravity = 10.0
    height = 5.0
    wave_speed = 30.0
    impact_speed = 10.0
    period = 16 / 3
    contact_intervals = ((1.0, 5 / 3), (11 / 3, 13 / 3))  # in the first period [s]

    def displacement(self, x: ArrayLike, t: ArrayLike) -> Array:
        """u(x, t) [m]: free fall, plus what the wave from the lower end has changed."""
        s, _ = self._folded(t)
        a = np.asarray(x, dtype=float) / self.wave_speed
        contact, flight = s - 1, s - 5 / 3
        pressed = -self._fall(contact) + self._wave(contact - a) + self._wave(contact - 2 * self._passage + a)
        flying = self._rise(flight) + (self._released(a - flight) + self._released(a + flight)) / 2
        return np.select([s < 1, s < 5 / 3], [self.height - self.gravity * s**2 / 2 + 0 * a, pressed], flying)

    def velocity(self, x: ArrayLike, t: ArrayLike) -> Array:
        """u_t(x, t) [m/s]."""
        s, sign = self._folded(t)
        a = np.asarray(x, dtype=float) / self.wave_speed
        contact, flight = s - 1, s - 5 / 3
        pressed = self._wave_rate(contact - a) + self._wave_rate(contact - 2 * self._passage + a)
        pressed = pressed - self.impact_speed - self.gravity * contact
        waves = (self._released_rate(a + flight) - self._released_rate(a - flight)) / 2
        flying = self.impact_speed - self.gravity * flight + waves
        return sign * np.select([s < 1, s < 5 / 3], [-self.gravity * s + 0 * a, pressed], flying)

    def closed(self, t: ArrayLike) -> Array:
        """True while the bar touches the floor."""
        s = np.mod(t, self.period)
        return np.any([(s >= start) & (s < end) for start, end in self.contact_intervals], axis=0)

    def pressure(self, t: ArrayLike) -> Array:
        """p(t) = rho c (v0 + g t') [Pa], t' from the first impact; in the second contact its mirror image."""
        s, _ = self._folded(t)
        rising = self.density * self.wave_speed * (self.impact_speed + self.gravity * (s - 1))
        return np.where(self.closed(t), rising, 0.0)

    def centre_of_mass(self, t: ArrayLike) -> Array:
        """Mean of u(x, t) over the bar [m]."""
        s, _ = self._folded(t)
        contact = s - 1
        pushed = self.impact_speed * contact**2 / 2 + self.gravity * contact**3 / 6
        pressed = pushed / self._passage - self._fall(contact)
        flying = self._rise(s - 5 / 3) - 2 / 3 * self.gravity * self._passage**2
        return np.select([s < 1, s < 5 / 3], [self.height - self.gravity * s**2 / 2, pressed], flying)

    @property
    def _passage(self) -> float:
        return self.length / self.wave_speed

    def _folded(self, t: ArrayLike) -> tuple[Array, Array]:
        """Time mapped into the first half period by the symmetry in time, and the sign of velocities."""
        s = np.mod(t, self.period)
        first = s < self.period / 2
        return np.where(first, s, self.period - s), np.where(first, 1.0, -1.0)

    def _fall(self, s: Array) -> Array:
        return self.impact_speed * s + self.gravity * s**2 / 2

    def _rise(self, s: Array) -> Array:
        return self.impact_speed * s - self.gravity * s**2 / 2

    def _wave(self, s: Array) -> Array:
        return self._fall(np.maximum(s, 0))

    def _wave_rate(self, s: Array) -> Array:
        return np.where(s > 0, self.impact_speed + self.gravity * s, 0.0)

    def _released(self, a: Array) -> Array:
        """Shape at release, g (a^2 - 2 tau a) over a = x/c, continued evenly with the period 2 tau."""
        a = np.mod(a, 2 * self._passage)
        return self.gravity * a * (a - 2 * self._passage)

    def _released_rate(self, a: Array) -> Array:
        return 2 * self.gravity * (np.mod(a, 2 * self._passage) - self._passage)


@dataclass(frozen=True)
class BilinearOscillator:
    """Mass m [kg] on a spring k [N/m] over a compliant stop of stiffness k_c [N/m] with zero gap.

        m x'' + k x - k_c max(0, -x) = 0,   x(0) = amplitude > 0,   x'(0) = 0

    omega1 = sqrt(k/m) while open, omega2 = sqrt((k + k_c)/m) while closed; period pi/omega1 + pi/omega2.
    Source: S. W. Shaw, P. J. Holmes, A periodically forced piecewise linear oscillator,
    J. Sound Vib. 90 (1983) 129.
    """

    mass: float
    stiffness: float
    contact_stiffness: float
    amplitude: float

    def __post_init__(self) -> None:
        for name in ("mass", "stiffness", "contact_stiffness", "amplitude"):
            _check_positive(name, getattr(self, name))

    @property
    def omega1(self) -> float:
        """Open [rad/s]."""
        return math.sqrt(self.stiffness / self.mass)

    @property
    def omega2(self) -> float:
        """Closed [rad/s]."""
        return math.sqrt((self.stiffness + self.contact_stiffness) / self.mass)

    @property
    def period(self) -> float:
        """pi/omega1 + pi/omega2 [s]."""
        return math.pi / self.omega1 + math.pi / self.omega2

    @property
    def closed_interval(self) -> tuple[float, float]:
        """Closing and opening time in the first period [s]."""
        closing = math.pi / (2 * self.omega1)
        return closing, closing + math.pi / self.omega2

    def displacement(self, t: ArrayLike) -> Array:
        """x(t) [m]."""
        s, closed = self._phase(t)
        depth = -self.amplitude * self.omega1 / self.omega2
        return np.where(closed, depth * np.sin(self.omega2 * s), self.amplitude * np.cos(self.omega1 * s))

    def velocity(self, t: ArrayLike) -> Array:
        """x'(t) [m/s]."""
        s, closed = self._phase(t)
        speed = -self.amplitude * self.omega1
        return np.where(closed, speed * np.cos(self.omega2 * s), speed * np.sin(self.omega1 * s))

    def reaction(self, t: ArrayLike) -> Array:
        """Contact force k_c max(0, -x) [N]."""
        return self.contact_stiffness * np.maximum(0.0, -self.displacement(t))

    def _phase(self, t: ArrayLike) -> tuple[Array, Array]:
        """Time since closing where closed, since the nearest turning point where open; and which of both."""
        closing, opening = self.closed_interval
        s = np.mod(t, self.period)
        closed = (s >= closing) & (s < opening)
        return np.where(closed, s - closing, np.where(s < closing, s, s - self.period)), closed


@dataclass(frozen=True)
class PlasticImpact:
    """Mass m [kg] on a spring k [N/m] released at rest over a rigid stop at x = -gap; restitution 0.

        m x'' + k x = lambda,   0 <= x + gap,  0 <= lambda,  (x + gap) lambda = 0,   x(0) = start, x'(0) = 0

    It strikes once, at t1 = arccos(-gap/start)/omega, and loses its kinetic energy k (start^2 - gap^2)/2.
    gap > 0: the spring lifts it off at once, x = -gap cos(omega (t - t1)), and it grazes the stop without
    speed once per period. gap < 0: it stays on the stop, with lambda = -k gap. Needs |gap| < start, gap != 0.
    """

    mass: float
    stiffness: float
    gap: float
    start: float

    def __post_init__(self) -> None:
        for name in ("mass", "stiffness", "start"):
            _check_positive(name, getattr(self, name))
        if not 0 < abs(self.gap) < self.start:
            raise MultiPhiValueError(f"gap: got {self.gap!r}, need 0 < |gap| < start = {self.start!r}")

    @property
    def omega(self) -> float:
        """sqrt(k/m) [rad/s]."""
        return math.sqrt(self.stiffness / self.mass)

    @property
    def impact_time(self) -> float:
        """t1 [s]."""
        return math.acos(-self.gap / self.start) / self.omega

    @property
    def energy_loss(self) -> float:
        """Kinetic energy taken by the impact [J]."""
        return self.stiffness * (self.start**2 - self.gap**2) / 2

    def displacement(self, t: ArrayLike) -> Array:
        """x(t) [m]."""
        before = self.start * np.cos(self.omega * np.asarray(t, dtype=float))
        return np.where(np.asarray(t) < self.impact_time, before, -self.gap * np.cos(self._angle_after(t)))

    def velocity(self, t: ArrayLike) -> Array:
        """x'(t) [m/s]."""
        before = -self.start * self.omega * np.sin(self.omega * np.asarray(t, dtype=float))
        after = self.gap * self.omega * np.sin(self._angle_after(t))
        return np.where(np.asarray(t) < self.impact_time, before, after)

    def reaction(self, t: ArrayLike) -> Array:
        """lambda(t) [N], without the impulse of the impact."""
        return np.where(np.asarray(t) < self.impact_time, 0.0, self.stiffness * max(0.0, -self.gap))

    def _angle_after(self, t: ArrayLike) -> Array:
        """omega (t - t1) for a gap, 0 for ever for a preload."""
        return self.omega * (np.asarray(t, dtype=float) - self.impact_time) * (self.gap > 0)


def _check_positive(name: str, value: float) -> None:
    if not (math.isfinite(value) and value > 0):
        raise MultiPhiValueError(f"{name}: got {value!r}, need a finite value > 0")
