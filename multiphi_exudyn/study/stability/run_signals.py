"""What an element of a run is watched by, on one analytic segment, and its lowest value there.

Between samples h apart a signal g stays above min(g0, g1) - h^2/8 max|g''|; where that bound may lie below zero, the
lowest value is looked for in extended precision.
"""

from __future__ import annotations

import numpy as np

from multiphi_exudyn.time.segments import Segment

__all__ = ["Signal"]

BLOCK = 2**18  # samples held at one time
POLISH = 41  # samples around a lowest one, ROUNDS times over
ROUNDS = 4


class Signal:
    """s of a link on a segment: constant + Re sum a_j t^d_j exp(lambda_j t).

    of: what it is made of, a "gap", its "rate", a "reaction" or the "tension" of a spring. arm: what a coordinate, or
    a load, of 1 can at most make of it. grain: what coordinates of 1 m make of a reaction, term by term: it has the
    round-off of that, the force of a stiff spring at a place of 1 m.
    """

    def __init__(self, segment: Segment, link: int, of: str, sign: float, constant: float) -> None:
        level = segment.level
        own, self.basis, modal, self.of = level.level, segment.basis, segment.rows, of
        row, self.arm, self.terms = own.base.directions[:, link], 1.0, abs(constant)
        if of in ("reaction", "tension"):
            k = own.indices.index(link)
            self.coefficients = own.force_rows[k] @ modal + own.force_rate_rows[k] @ self.basis.derivative(modal)
            self.constant = float(level.asymptotic.forces[k])
        else:
            self.coefficients = own.gap_rows[link] @ modal
            self.constant = float(level.gap_constants[link])
        if of == "rate":
            self.coefficients, self.constant = self.basis.derivative(self.coefficients), 0.0
        if of == "reaction":
            self.arm = float(np.sum(np.abs(row)) / (row @ row))
        else:
            row, self.arm = np.abs(row), float(np.sum(np.abs(row)))
        if of == "gap":
            self.terms = float(row @ (np.abs(own.vectors) @ np.sum(np.abs(modal), axis=1)))
            self.terms += float(row @ np.abs(level.asymptotic.configuration)) + abs(float(own.base.gaps[link]))
        self.grain, shapes = 0.0, level.modal.vectors
        if of == "reaction":
            self.grain = float(np.sum(np.abs(shapes) @ np.abs(own.force_rows[k][: shapes.shape[1]])))
        self.coefficients, self.constant = sign * self.coefficients, sign * self.constant + constant
        self.stiffness = float(own.base.stiffnesses[link])

    def per_metre(self) -> float:
        """What a length of 1 can at most make of it: the fastest rate of a speed, the stiffness of a spring."""
        if self.of == "rate":
            return float(np.max(np.abs(self.basis.rates), initial=0.0))
        return self.stiffness if self.of == "tension" else 1.0

    def size(self, duration: float) -> float:
        """What round-off of s is measured against on [0, duration]: its bound, and what a gap is the sum of."""
        return max(self._bound(self.coefficients, duration) + abs(self.constant), self.terms)

    def _bound(self, coefficients: np.ndarray, duration: float) -> float:
        growth = (
            np.exp(np.maximum(self.basis.rates.real, 0) * duration) * (duration / self.basis.unit) ** self.basis.powers
        )
        return float(np.abs(coefficients) @ growth)

    def __call__(self, t: np.ndarray) -> np.ndarray:
        """s at t (k,) from the segment's start [s]."""
        return (self.basis.at(t) @ self.coefficients).real + self.constant

    def steepness(self, t: float) -> float:
        """|s'| at t: with the resolution of time it is what s may be at its root."""
        return float(np.abs((self.basis.at(t) @ self.basis.derivative(self.coefficients)).real))

    def exactly(self, t: np.ndarray) -> np.ndarray:
        """The same in extended precision."""
        wide = np.asarray(t, np.longdouble)[:, None]
        phi = np.exp(wide * self.basis.rates.astype(np.clongdouble)) * (wide / self.basis.unit) ** self.basis.powers
        return (phi @ self.coefficients.astype(np.clongdouble)).real + np.longdouble(self.constant)

    def samples(self, duration: float, per_period: float) -> int:
        """How many it takes on [0, duration], so many in the shortest period."""
        fastest = np.max(np.abs(self.basis.rates), initial=0.0)
        return int(np.ceil(per_period * duration * fastest / (2 * np.pi))) + 8

    def lowest(self, duration: float, samples: float) -> tuple[float, float]:
        """(lowest value on [0, duration], where); only the values below zero need be right."""
        curvature = self._bound(self.basis.derivative(self.basis.derivative(self.coefficients)), duration)
        if self.constant > self._bound(self.coefficients, duration):
            return self.constant - self._bound(self.coefficients, duration), 0.0
        count = self.samples(duration, samples)
        step, best = duration / count, (np.inf, 0.0)
        for first in range(0, count + 1, BLOCK):
            t = step * np.arange(first, min(first + BLOCK, count) + 1)
            g = self(t)
            doubtful = g < step**2 / 8 * curvature
            lower = np.r_[True, g[1:] <= g[:-1]] & np.r_[g[:-1] <= g[1:], True]
            best = min(best, (float(np.min(g)), float(t[np.argmin(g)])))
            for place in t[doubtful & lower]:
                if not self._is_end_minimum(place, step * curvature, duration):
                    best = min(best, self._polished(place, step, duration))
        return best

    def _is_end_minimum(self, place: float, change: float, duration: float) -> bool:
        """Whether an end of the interval is the lowest place near it: the slope there cannot turn within a step."""
        if step_inside := int(place <= 0) - int(place >= duration):
            rate = self.basis.at(place) @ self.basis.derivative(self.coefficients)
            return step_inside * rate.real > change
        return False

    def _polished(self, place: float, step: float, duration: float) -> tuple[float, float]:
        for _ in range(ROUNDS):
            t = np.linspace(max(place - step, 0.0), min(place + step, duration), POLISH)
            g = self.exactly(t)
            place, step = float(t[np.argmin(g)]), 2 * step / (POLISH - 1)
        return float(np.min(g)), place
