"""Flow: the motion of a driven level while one piece of every load lasts, in closed form.

    xi(t) = Re V (c exp(lambda t)) + Re sum_j exp(mu_j t) sum_k x_jk (t/T)^k

xi = (eta, w) as in driven/level.py, T the horizon, so that no power outgrows the motion; the free response and the
closed-form response to the present piece of every load (forced_response.py).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.mathematics.exponentials import Exponentials
from multiphi_exudyn.mathematics.forced_response import particular
from multiphi_exudyn.mathematics.piecewise_exponential import differentiated
from multiphi_exudyn.time.driven.excitation import Drive
from multiphi_exudyn.time.driven.level import DrivenLevel

__all__ = ["Basis", "Flow"]

Basis = tuple[float, tuple[tuple[complex, int], ...]]  # unit of powers, carriers and numbers of their powers


@dataclass(frozen=True)
class Flow:
    """xi(t) = Re shapes (coefficients * basis) from a state on. key: what distinguishes its basis in its level.

    parts: of which sizes (2, r) eta and eta' are the sums, free and forced.
    """

    basis: Exponentials
    shapes: np.ndarray
    coefficients: np.ndarray
    key: Basis
    parts: np.ndarray

    @classmethod
    def of(cls, level: DrivenLevel, xi: np.ndarray, xi_t: np.ndarray, drive: Drive, horizon: float) -> Flow:
        """The motion from xi, xi' under a drive, good for [0, horizon], a power of two."""
        own = level.plain.level
        response, q = own.response, level.excitation.channels
        blocks, carriers = list[np.ndarray](), list[tuple[complex, int]]()
        for rate, terms in drive.terms:
            given = (terms.T * horizon ** np.arange(len(terms))).T
            forces = given @ level.force.T
            if np.any(level.force_rate):
                forces = forces + differentiated(rate, given, horizon) @ level.force_rate.T
            x = particular(own.squares, own.damping, response, rate, forces, horizon)
            block = np.zeros((max(len(x), len(given)), own.modes + q), complex)
            block[: len(x), : own.modes], block[: len(given), own.modes :] = x, given
            blocks.append(block)
            carriers.append((rate, len(block)))
        at_once = sum(block[0] for block in blocks).real
        rates_at_once = (differentiated(c[0], b, horizon)[0] for c, b in zip(carriers, blocks, strict=True))
        rate_at_once = sum(rates_at_once).real
        (eta, _), (eta_t, _) = level.split(xi - at_once), level.split(xi_t - rate_at_once)
        steady = level.plain.asymptotic.drive if level.plain.driven else None
        free = response.coefficients(eta, eta_t, steady)
        forced = np.concatenate(blocks).T
        shapes = np.hstack([np.vstack([response.shapes, np.zeros((q, len(free)))]), forced])
        unit = horizon if max(count for _, count in carriers) > 1 else response.basis.unit
        own_powers = (unit / response.basis.unit) ** response.basis.powers
        coefficients = np.concatenate([free * own_powers, np.ones(forced.shape[1])])
        key = unit, tuple(carriers)
        parts = np.abs([eta, eta_t]) + np.abs([at_once[: own.modes], rate_at_once[: own.modes]])
        return cls(_basis(response.basis, key), shapes, coefficients, key, parts)

    @property
    def rows(self) -> np.ndarray:
        """xi = Re rows phi(t), (r + q, p)."""
        return self.shapes * self.coefficients

    def at(self, t: np.ndarray | float, derivative: int = 0) -> np.ndarray:
        """xi or a derivative, (r + q,) for a scalar, (r + q, k) for (k,) times from the state on."""
        rows = self.rows
        for _ in range(derivative):
            rows = self.basis.derivative(rows)
        return np.asarray((rows @ self.basis.at(t).T).real)


def _basis(free: Exponentials, key: Basis) -> Exponentials:
    """The exponentials of the free response and (t/T)^k exp(mu t) of every carrier."""
    unit, carriers = key
    rates = np.concatenate([free.rates, *(np.full(count, rate) for rate, count in carriers)])
    return Exponentials(rates, np.concatenate([free.powers, *(np.arange(count) for _, count in carriers)]), unit)
