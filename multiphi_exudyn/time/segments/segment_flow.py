"""Segment flow: the motion of a level during one piece of every channel, in closed form.

    xi(t) = Re V (c exp(lambda t)) + Re sum_j exp(mu_j t) sum_k x_jk (t/T)^k

xi = (eta, w) as in channels.py, T the horizon, so that no power outgrows the motion; the free response and the
closed-form response to the present piece of every channel (forced_response.py). Without channels there is no sum.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.mathematics.exponentials import Exponentials

__all__ = ["Flow"]


@dataclass(frozen=True)
class Flow:
    """xi(t) = Re shapes (coefficients * basis) after a state; the first ``free`` of p terms are the free response."""

    basis: Exponentials
    shapes: np.ndarray
    coefficients: np.ndarray
    free: int
