"""Reconstruction of the motion of points and of contact forces from the coordinates of a body (eq. 38.4).

    x_p(t) = p.(Phi_l eta(t) + x_inf,l),   g_i(t) = h_i.x + gap_i,   lambda_i(t) from eta, eta' (level.py), and L f

Friction forces T and the positions of friction patches follow in the same way (time/level_rows.py). L f are reactions
of closed contacts to forces f on points (coupling/interface.py).
"""

from __future__ import annotations

import numpy as np

from multiphi_exudyn.events.excitation.loaded_level import LoadedLevel
from multiphi_exudyn.exudyn_plugin.body.body import MultiPhiBody
from multiphi_exudyn.time.segments.level_rows import force_row, patch_row, pressing_row

__all__ = ["reconstruct"]


def reconstruct(
    body: MultiPhiBody,
    rows: np.ndarray,
    data: np.ndarray,
    time: np.ndarray,
    stored: np.ndarray,
    on_points: np.ndarray,
) -> tuple[np.ndarray, ...]:
    """Displacements and velocities of points, gaps, lambda, T and patch positions of elements, each (.., k).

    rows (p, n): of the points. data (k, width): level data. stored (k, 3 s): q, q', q''. on_points: f (m, k) [N].
    """
    layout, elements = body.coordinates.layout, body.model.contacts
    k, all_states = len(stored), layout.states(data)
    displacements, velocities = np.zeros((2, len(rows), k))
    gaps, forces, friction_forces, patches = np.zeros((4, len(elements), k))
    in_base = rows @ body.model.base.modes.shapes
    for states in np.unique(all_states, axis=0):
        samples = np.flatnonzero(np.all(all_states == states, axis=1))
        stepped, held = body.stepped_level(states.tolist()), layout.held(data[samples]).T
        r, physical = stepped.modes, stepped.to_physical @ stored[samples].T
        eta, eta_t = physical[:r], physical[stepped.size : stepped.size + r]
        loaded, xi, xi_t = body.own_loads.level_coordinates(stepped, eta, eta_t, held, time[samples])
        level, asymptotic = loaded.level, loaded.asymptotic
        displacements[:, samples] = in_base @ (level.vectors @ xi + asymptotic.configuration[:, None])
        velocities[:, samples] = in_base @ level.vectors @ xi_t
        gaps[:, samples] = (level.gap_rows @ xi + loaded.gap_constants[:, None])[: len(elements)]
        state = np.vstack([xi, xi_t, np.ones(len(samples))])
        direct_reactions = body.coordinates.direct_reactions(stepped) @ on_points[:, samples]
        for i in range(len(elements)):
            forces[i, samples] = pressing_row(i, loaded) @ state + _direct_share(
                loaded, i, direct_reactions, held=False
            )
        for i in body.model.rubbing:
            friction_forces[i, samples] = force_row(i, loaded) @ state - _direct_share(
                loaded, i, direct_reactions, held=True
            )
            patches[i, samples] = patch_row(i, loaded) @ state
    return displacements, velocities, gaps, forces, friction_forces, patches


def _direct_share(loaded: LoadedLevel, element: int, direct_reactions: np.ndarray, held: bool) -> np.ndarray:
    """Sum of the reactions L f (k, ..) of the links of an element with (``held``) or without stick position."""
    base, indices = loaded.level.base, loaded.level.indices
    signs = {k: 1 for k in base.link_indices[element] if base.links[k].held} if held else base.pressing(element)
    shares = [sign * direct_reactions[indices.index(link)] for link, sign in signs.items() if link in indices]
    return np.asarray(sum(shares, np.zeros(direct_reactions.shape[1])))
