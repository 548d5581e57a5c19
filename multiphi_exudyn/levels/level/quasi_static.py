"""Quasi-static response: what loads move beside the modes of a level, without inertia."""

from __future__ import annotations

import numpy as np

from multiphi_exudyn.levels.level.level import Level
from multiphi_exudyn.mathematics.round_off import PRODUCT, ZERO, drop_round_off

__all__ = ["quasi_static_response", "static_responses"]


def static_responses(level: Level, loads: np.ndarray, gaps: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return static responses (m, q) and contact forces (k, q) to loads (m, q) and gaps (k, q) of closed contacts."""
    configurations, forces = np.zeros_like(loads), np.zeros_like(gaps)
    for k in np.flatnonzero(np.any(loads, axis=0) | np.any(gaps, axis=0)).tolist():
        forces[:, k], configurations[:, k] = level.static_response(loads[:, k], gaps[:, k])
    return configurations, forces


def quasi_static_response(level: Level, patterns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return static responses (m, q) and contact forces (k, q) to loads, without the part in the level's modes.

    (K_l^-1 - Psi omega^-2 Psi^T) b is computed as K_l^-1 (1 - M Psi Psi^T) b: if a kept mode is soft, both terms of the
    former are large. The remaining part in the modes is round-off, and is removed. A remainder that is round-off of the
    products of a load with modes is zero: of weight on all modes of a free structure nothing remains.
    """
    psi, inertial = level.vectors, level.inertial
    lengths = np.linalg.norm(patterns, axis=0)
    remainder = drop_round_off(patterns - inertial @ (psi.T @ patterns), PRODUCT / ZERO * lengths)
    y, forces = static_responses(level, remainder, np.zeros((len(level.indices), remainder.shape[1])))
    part = inertial.T @ y
    return y - psi @ part, forces - level.force_rows @ part
