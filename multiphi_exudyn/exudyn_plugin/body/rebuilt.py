"""Rebuilt: what the coordinates of a body say of its points and elements (eq. 38.4).

    x_p(t) = p.(Phi_l eta(t) + x_inf,l),   g_i(t) = h_i.x + gap_i,   lambda_i(t) from eta, eta' (level.py), and L f

and of friction T and the places of its patches (time/level_rows.py).
"""

from __future__ import annotations

import numpy as np

from multiphi_exudyn.events.loaded_level import LoadedLevel
from multiphi_exudyn.exudyn_plugin.body.body import MultiPhiBody
from multiphi_exudyn.time.level_rows import force_row, patch_row, pressing_row

__all__ = ["rebuilt"]


def rebuilt(
    body: MultiPhiBody,
    rows: np.ndarray,
    data: np.ndarray,
    time: np.ndarray,
    stored: np.ndarray,
    on_points: np.ndarray,
) -> tuple[np.ndarray, ...]:
    """Displacements and velocities of points, gaps, lambda, T and patches of elements, each (.., k).

    data: of the levels (k, width), one after the other of which they are rebuilt. on_points: f (m, k).
    """
    layout, elements = body.coordinates.layout, body.model.contacts
    k, all_states = len(stored), layout.states(data)
    moved, velocities = np.zeros((2, len(rows), k))
    gaps, forces, tensions, patches = np.zeros((4, len(elements), k))
    in_base = rows @ body.model.base.modes.shapes
    for states in np.unique(all_states, axis=0):
        here = np.flatnonzero(np.all(all_states == states, axis=1))
        stepped, held = body.stepped_level(states.tolist()), layout.held(data[here]).T
        r, physical = stepped.modes, stepped.physical @ stored[here].T
        eta, eta_t = physical[:r], physical[stepped.size : stepped.size + r]
        loaded, xi, xi_t = body.own.shown(stepped, eta, eta_t, held, time[here])
        own, rest = loaded.level, loaded.asymptotic
        moved[:, here] = in_base @ (own.vectors @ xi + rest.configuration[:, None])
        velocities[:, here] = in_base @ own.vectors @ xi_t
        gaps[:, here] = (own.gap_rows @ xi + loaded.gap_constants[:, None])[: len(elements)]
        state, direct = np.vstack([xi, xi_t, np.ones(len(here))]), body.coordinates.direct(stepped) @ on_points[:, here]
        for i in range(len(elements)):
            forces[i, here] = pressing_row(i, loaded) @ state + _carried(loaded, i, direct, held=False)
        for i in body.model.rubbing:
            tensions[i, here] = force_row(i, loaded) @ state - _carried(loaded, i, direct, held=True)
            patches[i, here] = patch_row(i, loaded) @ state
    return moved, velocities, gaps, forces, tensions, patches


def _carried(level: LoadedLevel, element: int, direct: np.ndarray, held: bool) -> np.ndarray:
    """What the links of an element with or without held places carry of L f (k, ..), summed."""
    base, indices = level.level.base, level.level.indices
    signs = {k: 1 for k in base.link_places[element] if base.links[k].held} if held else base.pressing(element)
    carried = [sign * direct[indices.index(link)] for link, sign in signs.items() if link in indices]
    return np.asarray(sum(carried, np.zeros(direct.shape[1])))
