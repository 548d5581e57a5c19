"""Whether a run has gained energy: nothing in a released structure gives it any, so a gain is a failure."""

from __future__ import annotations

import numpy as np

from reference_models.full_run import ENERGY_GAIN, EnergyBalance

__all__ = ["energy_gain"]


def energy_gain(time: np.ndarray, energy: np.ndarray) -> str:
    """The cause of a failure, or "": the energy (k,) [J] at times (k,) [s] has risen above an earlier value."""
    balance = EnergyBalance.of(time, energy, np.zeros_like(energy))
    if balance.gain_at is None:
        return ""
    gained = f"energy gained: more than {ENERGY_GAIN:.0%} by {balance.gain_at:.6g} s"
    return f"{gained}, at worst {balance.worst_gain:.2%} at {balance.worst_gain_at:.6g} s"
