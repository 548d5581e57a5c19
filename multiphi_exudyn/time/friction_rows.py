"""Friction along a motion: its force and the place of its patch as linear functions of a level's coordinates.

    T = -lambda while it sticks, -push while it slips
    place of the patch on the counter-surface: the held place w while it sticks, w + q - stretch while it slips

Rows (2 n + 1,) of (xi, xi', 1), n coordinates.
"""

from __future__ import annotations

import numpy as np

from multiphi_exudyn.events.exits import state_of
from multiphi_exudyn.events.loaded_level import LoadedLevel

__all__ = ["force_row", "patch_row"]


def force_row(level: LoadedLevel, element: int) -> np.ndarray:
    """T [N]."""
    own, push = level.level, state_of(level, element).push
    if element not in own.indices:
        return np.concatenate([np.zeros(2 * own.modes), [-push]])
    k = own.indices.index(element)
    return -np.concatenate([own.force_rows[k], own.force_rate_rows[k], [level.asymptotic.forces[k] + push]])


def patch_row(level: LoadedLevel, element: int) -> np.ndarray:
    """The place [m]."""
    own, state = level.level, state_of(level, element)
    held = [i for i, other in enumerate(own.base.contacts) if other.held]
    row = np.zeros(2 * own.modes + 1)
    row[own.modes - len(held) + held.index(element)] = 1.0
    if not state.holds:
        row[: own.modes] += own.gap_rows[element]
        row[-1] = level.gap_constants[element] - state.stretch
    return row
