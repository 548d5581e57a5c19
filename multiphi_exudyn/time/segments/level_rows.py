"""Rows of a level: what is asked of a motion as linear functions of the level's coordinates.

    x of a point    phi.(Phi_l xi + x_inf,l)          gap  g = h.x + gap       lambda  of what presses
    T = -lambda of the held link while it sticks; while it slips -push, or s mu N where it goes with the force of a link
    place of the patch on the counter-surface: the held place w while it sticks, w + q - stretch else, q of that link

Rows (2 n + 1,) of (xi, xi', 1), n coordinates, for a level and a point's row (m,) or an element's position.
"""

from __future__ import annotations

import numpy as np

from multiphi_exudyn.events.excitation.loaded_level import LoadedLevel
from multiphi_exudyn.events.transitions.exits import state_of

__all__ = ["force_row", "gap_row", "patch_row", "point_row", "pressing_row"]


def point_row(row: np.ndarray, level: LoadedLevel) -> np.ndarray:
    """Displacement [m] of a point, row (m,) in base coordinates."""
    place = row @ level.level.vectors
    return np.concatenate([place, np.zeros(len(place)), [row @ level.asymptotic.configuration]])


def gap_row(element: int, level: LoadedLevel) -> np.ndarray:
    """Gap [m]."""
    gap = level.level.gap_rows[element]
    return np.concatenate([gap, np.zeros(len(gap)), [level.gap_constants[element]]])


def force_row(element: int, level: LoadedLevel) -> np.ndarray:
    """T [N]."""
    link, push = _held_link(level, element), state_of(level, element).push
    if link in level.level.indices:
        row = -_link_row(level, link)
        row[-1] -= push
        return row
    place, rate, constant = level.rubbing(element)
    return np.concatenate([place, rate, [constant - push]])


def patch_row(element: int, level: LoadedLevel) -> np.ndarray:
    """The place [m]."""
    own, link = level.level, _held_link(level, element)
    held = [k for k, other in enumerate(own.base.links) if other.held]
    row = np.zeros(2 * own.modes + 1)
    row[own.modes - len(held) + held.index(link)] = 1.0
    if link not in own.indices:
        stretch, constant = level.stretch(element)
        row[: own.modes] += own.gap_rows[link] - stretch
        row[-1] = level.gap_constants[link] - constant
    return row


def pressing_row(element: int, level: LoadedLevel) -> np.ndarray:
    """lambda [N] of a contact, with friction or without; of a force law -F."""
    base, row = level.level.base, np.zeros(2 * level.level.modes + 1)
    row[-1] = -base.laws[element].constant if element in base.laws else 0.0
    for link, sign in base.pressing(element).items():
        if link in level.level.indices:
            row += sign * _link_row(level, link)
    return row


def _held_link(level: LoadedLevel, element: int) -> int:
    """The link of an element that has a held place."""
    base = level.level.base
    return next(k for k in base.link_indices[element] if base.links[k].held)


def _link_row(level: LoadedLevel, link: int) -> np.ndarray:
    """lambda [N] of a link that holds."""
    own = level.level
    k = own.indices.index(link)
    return np.concatenate([own.force_rows[k], own.force_rate_rows[k], [level.asymptotic.forces[k]]])
