"""Segment flow: the motion of a level during one piece of every channel, in closed form.

    xi(t) = Re V (c exp(lambda t)) + Re sum_j exp(mu_j t) sum_k x_jk (t/T)^k

xi = (eta, w) as in channels.py, T the horizon, so that no power outgrows the motion; the free response and the
closed-form response to the present piece of every channel (forced_response.py). Without channels there is no sum.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.events.excitation.excitation import Drive
from multiphi_exudyn.events.excitation.loaded_level import LoadedLevel
from multiphi_exudyn.mathematics.functions.piecewise_exponential import differentiated
from multiphi_exudyn.mathematics.response.exponentials import Exponentials
from multiphi_exudyn.mathematics.response.forced_response import particular

__all__ = ["Flow"]


@dataclass(frozen=True)
class Flow:
    """xi(t) = Re shapes (coefficients * basis) after a state; the first ``free`` of p terms are the free response."""

    basis: Exponentials
    shapes: np.ndarray
    coefficients: np.ndarray
    free: int

    @classmethod
    def of(cls, level: LoadedLevel, xi: np.ndarray, xi_t: np.ndarray, drive: Drive, horizon: float) -> Flow:
        """Motion from xi, xi' under a drive, accurate in [0, horizon] [s], a power of two."""
        response, steady = level.response, level.asymptotic.drive if level.driven else None
        blocks = [_forced(level, rate, terms, horizon) for rate, terms in drive.terms]
        for (rate, _), block in zip(drive.terms, blocks, strict=True):
            xi, xi_t = xi - block[0].real, xi_t - differentiated(rate, block, horizon)[0].real
        free = response.coefficients(level.split(xi)[0], level.split(xi_t)[0], steady)
        if not blocks:
            return cls(response.basis, response.shapes, free, len(free))
        forced, counts = np.concatenate(blocks).T, [len(block) for block in blocks]
        unit = horizon if max(counts) > 1 else response.basis.unit
        rates = np.repeat([rate for rate, _ in drive.terms], counts)
        basis = Exponentials(
            np.concatenate([response.basis.rates, rates]),
            np.concatenate([response.basis.powers, *map(np.arange, counts)]),
            unit,
        )
        free_coefficients = free * (unit / response.basis.unit) ** response.basis.powers
        no_channels = np.zeros((len(xi) - len(response.shapes), len(free)))
        shapes = np.hstack([np.vstack([response.shapes, no_channels]), forced])
        return cls(basis, shapes, np.concatenate([free_coefficients, np.ones(forced.shape[1])]), len(free))


def _forced(level: LoadedLevel, rate: complex, terms: np.ndarray, horizon: float) -> np.ndarray:
    """x_jk (K, r + q) of a term of the drive (D + 1, q)."""
    modal, channels = level.modal, level.channels
    scaled_terms = (terms.T * horizon ** np.arange(len(terms))).T
    forces = scaled_terms @ channels.force.T
    if np.any(channels.force_rate):
        forces = forces + differentiated(rate, scaled_terms, horizon) @ channels.force_rate.T
    x = particular(modal.squares, modal.damping_matrix, level.response, rate, forces, horizon)
    block = np.zeros((max(len(x), len(scaled_terms)), modal.modes + scaled_terms.shape[1]), complex)
    block[: len(x), : modal.modes], block[: len(scaled_terms), modal.modes :] = x, scaled_terms
    return block
