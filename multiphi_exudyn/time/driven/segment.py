"""Segment of a driven trajectory, and the work of what varies in it.

That is the work of the loads, of the stops of compliant contacts and of those of rigid ones,

    f.y' + lambda s w' + (Y w').(M y'' + C y' + K y - f)

integrated by Gauss-Legendre quadrature, exact to round-off on panels short beside the shortest period.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.mathematics.exponentials import Exponentials
from multiphi_exudyn.time.driven.flow import Flow
from multiphi_exudyn.time.driven.level import DrivenLevel
from multiphi_exudyn.time.segment import Segment

__all__ = ["DrivenSegment"]

NODES = 20  # of the quadrature on a panel
PANEL = 6.0  # rad, the phase of the fastest exponential on it: products of two have twice that
CHUNK = 512  # panels evaluated at a time


@dataclass(frozen=True)
class DrivenSegment(Segment):
    """Motion in one driven level; flow: its closed form. entry_work: work [J] of what jumped where it begins."""

    flow: Flow
    entry_work: float

    @property
    def basis(self) -> Exponentials:
        """The exponentials phi (p,) of the motion."""
        return self.flow.basis

    @property
    def shapes(self) -> np.ndarray:
        """V (r + q, p)."""
        return self.flow.shapes

    @property
    def amplitudes(self) -> np.ndarray:
        """c (p,) of the exponentials ``basis``."""
        return self.flow.coefficients

    def force_integral(self, contact: int, start: float, end: float) -> float:
        """Integral of the force of a closed contact [N s]."""
        return sum(float(weights @ self.force(contact, times)) for times, weights in self._quadrature(start, end))

    def damping_work(self) -> float:
        """Integral of y'^T C y' and of what viscous contacts take up [J]."""
        return self._works[0]

    def varying_work(self) -> float:
        """Work [J] of loads and stops that vary in time."""
        return self.entry_work + self._works[1]

    @functools.cached_property
    def _works(self) -> tuple[float, float]:
        """Work [J] of damping and of what varies, by one quadrature."""
        own = self.level.level
        damped, damping, varying = bool(np.any(own.base.damping_matrix(own.indices))), 0.0, 0.0
        for times, weights in self._quadrature(self.start, self.end):
            xi, xi_t = self.modal(times), self.modal(times, 1)
            varying += float(weights @ self._power(xi, xi_t, times))
            if damped:
                damping += float(weights @ self._dissipation(xi_t))
        return damping, varying

    @property
    def _driven(self) -> DrivenLevel:
        assert isinstance(self.level, DrivenLevel)
        return self.level

    def _dissipation(self, xi_t: np.ndarray) -> np.ndarray:
        """Power (k,) [W] of damping."""
        moved, dampers = self._driven.motion(xi_t), self._dampers(xi_t)
        coefficients = self._driven.level.base.dampings[list(self._driven.level.indices)]
        viscous = np.divide(dampers.T**2, coefficients, out=np.zeros_like(dampers.T), where=coefficients > 0)
        return np.asarray(np.sum(moved * (self._driven.level.base.damping @ moved), axis=0) + np.sum(viscous, axis=1))

    def _dampers(self, xi_t: np.ndarray) -> np.ndarray:
        """c g' (k, times) [N] of the closed contacts: what their dampers hold against opening."""
        index = list(self._driven.level.indices)
        return np.asarray(
            self._driven.level.base.dampings[index][:, None] * (self._driven.level.speed_rows[index] @ xi_t)
        )

    def _power(self, xi: np.ndarray, xi_t: np.ndarray, times: np.ndarray) -> np.ndarray:
        """Power (k,) [W] of the channels."""
        level, base = self._driven, self._driven.level.base
        w, w_t = level.split(xi)[1], level.split(xi_t)[1]
        varying = level.excitation.patterns @ w
        power = np.sum(varying * (level.level.vectors @ xi_t), axis=0)
        index = list(level.level.indices)
        stiffness = np.where(np.isinf(base.stiffnesses[index]), 0.0, base.stiffnesses[index])
        gaps = level.level.gap_rows[index] @ xi + level.gap_constants[index][:, None]
        springs = stiffness[:, None] * gaps + self._dampers(xi_t)
        power -= np.sum(springs * (level.excitation.stops[index] @ w_t), axis=0)
        if np.any(level.carried):
            moved, accelerated = level.motion(xi_t), level.motion(self.modal(times, 2))
            y = level.configuration(xi)
            load = (level.excitation.static + base.preload)[:, None] + varying
            residual = accelerated + base.damping @ moved + (base.modes.omega**2 * y.T).T - load
            residual += base.directions[:, index] @ springs
            power += np.sum((level.carried @ w_t) * residual, axis=0)
        return np.asarray(power)

    def _quadrature(self, start: float, end: float) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Times and weights of the integral from start to end, in parts."""
        fastest = float(np.max(np.abs(self.flow.basis.rates), initial=0.0))
        panels = max(1, math.ceil(fastest * (end - start) / PANEL))
        width, (nodes, weights) = (end - start) / panels, _gauss_legendre()
        for first in range(0, panels, CHUNK):
            lefts = start + width * np.arange(first, min(panels, first + CHUNK))
            yield (lefts[:, None] + width * nodes).ravel(), np.tile(width * weights, len(lefts))


@functools.cache
def _gauss_legendre() -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights on [0, 1]."""
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    return (nodes + 1) / 2, weights / 2
