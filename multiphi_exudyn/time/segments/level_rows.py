"""Level rows: displacements, gaps and forces as linear functions of the coordinates of a level.

    x of a point    phi.(Phi_l xi + x_inf,l)          gap  g = h.x + gap       lambda  of the pressing links
    T = -lambda of the held link in stick; in slip -push, or s mu N where it follows the force of another link
    position of the patch on the counter-surface: the held place w in stick, w + q - stretch in slip, q of that link

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
    """Friction force T [N]."""
    link, push = _held_link(level, element), state_of(level, element).push
    if link in level.level.indices:
        row = -_link_row(level, link)
        row[-1] -= push
        return row
    place, rate, constant = level.rubbing(element)
    return np.concatenate([place, rate, [constant - push]])


def patch_row(element: int, level: LoadedLevel) -> np.ndarray:
    """Position [m] of the patch of friction on its counter-surface."""
    modes, link = level.level, _held_link(level, element)
    held_links = [k for k, other in enumerate(modes.base.links) if other.held]
    row = np.zeros(2 * modes.modes + 1)
    row[modes.modes - len(held_links) + held_links.index(link)] = 1.0
    if link not in modes.indices:
        stretch, constant = level.stretch(element)
        row[: modes.modes] += modes.gap_rows[link] - stretch
        row[-1] = level.gap_constants[link] - constant
    return row


def pressing_row(element: int, level: LoadedLevel) -> np.ndarray:
    """Contact force lambda [N], with friction or without; -F of a force law."""
    base, row = level.level.base, np.zeros(2 * level.level.modes + 1)
    row[-1] = -base.laws[element].constant if element in base.laws else 0.0
    for link, sign in base.pressing(element).items():
        if link in level.level.indices:
            row += sign * _link_row(level, link)
    return row


def _held_link(level: LoadedLevel, element: int) -> int:
    """Link of an element that has a held place."""
    base = level.level.base
    return next(k for k in base.link_indices[element] if base.links[k].held)


def _link_row(level: LoadedLevel, link: int) -> np.ndarray:
    """lambda [N] of a link that acts in the level."""
    modal_level = level.level
    k = modal_level.indices.index(link)
    return np.concatenate([modal_level.force_rows[k], modal_level.force_rate_rows[k], [level.asymptotic.forces[k]]])
