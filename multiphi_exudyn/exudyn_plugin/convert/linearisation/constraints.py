"""Constraints of an Exudyn system at its current state: their residuals, on positions and on velocities.

    g(q, t) = 0,   C = dg/dq          h(q, v, t) = 0,   C = dh/dv

A constraint on velocities (velocityLevel, rolling without slip) has the residual h, whatever the level asked for.
"""

from __future__ import annotations

from typing import Any

import numpy as np

__all__ = ["on_velocities", "residuals"]


def residuals(mbs: Any, solver: Any) -> np.ndarray:
    """g or h (m,) at the current state and time."""
    solver.ComputeAlgebraicEquations(mbs, False)
    return np.array(solver.GetSystemResidual())[solver.GetODE2size() :]


def on_velocities(mbs: Any, solver: Any, jacobian: np.ndarray) -> np.ndarray:
    """Whether each constraint is one on velocities, (m,) bool: whether its residual depends on them."""
    data = mbs.systemData
    velocity = data.GetODE2Coordinates_t()
    change = np.random.default_rng(0).uniform(1.0, 2.0, len(velocity))  # across no row but by chance
    before = residuals(mbs, solver)
    data.SetODE2Coordinates_t(velocity + change)
    after = residuals(mbs, solver)
    data.SetODE2Coordinates_t(velocity)
    return np.asarray(np.abs(after - before) > np.abs(jacobian @ change) / 2)
