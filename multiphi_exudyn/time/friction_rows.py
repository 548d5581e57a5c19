"""Friction along a motion: its force and the place of its patch as linear functions of a level's coordinates.

    T = -lambda of the held link while it sticks; while it slips -push, or s mu N where it goes with the force of a link
    place of the patch on the counter-surface: the held place w while it sticks, w + q - stretch else, q of that link

Rows (2 n + 1,) of (xi, xi', 1), n coordinates.
"""

from __future__ import annotations

import numpy as np

from multiphi_exudyn.events.exits import state_of
from multiphi_exudyn.events.loaded_level import LoadedLevel

__all__ = ["force_row", "patch_row", "pressing_row"]


def force_row(level: LoadedLevel, element: int) -> np.ndarray:
    """T [N]."""
    link, push = _held_link(level, element), state_of(level, element).push
    if link in level.level.indices:
        row = -_link_row(level, link)
        row[-1] -= push
        return row
    place, rate, constant = level.rubbing(element)
    return np.concatenate([place, rate, [constant - push]])


def patch_row(level: LoadedLevel, element: int) -> np.ndarray:
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


def pressing_row(level: LoadedLevel, element: int) -> np.ndarray:
    """lambda [N] of a contact's normal link, with friction or without."""
    own = level.level
    for link in own.base.link_places[element]:
        if link in own.indices and not own.base.links[link].held:
            return _link_row(level, link)
    return np.zeros(2 * own.modes + 1)


def _held_link(level: LoadedLevel, element: int) -> int:
    """The link of an element that has a held place."""
    base = level.level.base
    return next(k for k in base.link_places[element] if base.links[k].held)


def _link_row(level: LoadedLevel, link: int) -> np.ndarray:
    """lambda [N] of a link that holds."""
    own = level.level
    k = own.indices.index(link)
    return np.concatenate([own.force_rows[k], own.force_rate_rows[k], [level.asymptotic.forces[k]]])
