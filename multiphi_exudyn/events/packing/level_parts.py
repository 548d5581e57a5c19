"""Matrices of a level's motion, gaps, energies and powers, and those of the base, as arrays (arrays.py).

All are in the coordinates xi = (eta, w) of a loaded level, with q >= 0 channels.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from multiphi_exudyn.events import arrays as a
from multiphi_exudyn.events.excitation.excitation import Excitation
from multiphi_exudyn.events.excitation.loaded_level import LoadedLevel
from multiphi_exudyn.events.transitions.exits import signal_parts
from multiphi_exudyn.levels.base.modal_base import ModalBase

__all__ = ["base_parts", "channel_parts", "from_base", "level_numbers", "powers"]


def level_numbers(level: LoadedLevel) -> np.ndarray:
    """Return the numbers that describe a level, as level_writing.py takes them."""
    modal, channels, form, response = level.modal, level.channels, level.potential_form, level.response
    parts: tuple[ArrayLike, ...] = (
        [form.constant, level.excitation.highest_frequency, response.basis.unit],
        modal.squares,
        modal.damping_matrix.diagonal() / 2,
        level.asymptotic.drive,
        modal.coupling,
        channels.force,
        modal.damping_matrix,
        channels.force_rate,
        form.linear,
        form.rows,
        form.follows,
        *signal_parts(level),
    )
    return np.concatenate(parts, axis=None)


def channel_parts(level: LoadedLevel) -> dict[int, np.ndarray]:
    """Return what only a level with channels has: work of patterns, motion of rigid stops, speeds of gaps."""
    if level.static is None:
        return {}
    own, modal, channels, parts = level.level, level.modal, level.channels, dict[int, np.ndarray]()
    if level.excitation.channels:
        moved, patterns = channels.carried.T, level.excitation.patterns.T
        parts[a.PATTERNS] = np.column_stack([patterns @ own.vectors, patterns @ level.asymptotic.configuration])
        if np.any(moved):
            parts[a.CARRIED] = np.hstack([moved @ modal.vectors, moved @ channels.carried])
    if own is not modal:
        parts[a.SPEEDS] = np.column_stack([own.speed_rows, np.zeros(len(own.gap_rows))])
    return parts


def base_parts(base: ModalBase, excitation: Excitation) -> dict[int, np.ndarray]:
    """Return gaps and energies of the base, all contacts open, in (y, w)."""
    q, patterns = excitation.channels, excitation.patterns.T
    rows = np.column_stack([patterns, np.zeros((q, q))])
    linear = [-base.preload - excitation.static, np.zeros(q)]
    return {
        a.GAPS: np.column_stack([base.directions.T, -excitation.stops, base.gaps]),
        a.POTENTIAL: np.concatenate([[base.energy_offset], *linear, base.modes.omega**2, -rows.ravel()]),
        a.PATTERNS: np.column_stack([rows, np.zeros(q)]),
    }


def from_base(level: LoadedLevel) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the map (T, c, T') from the base to a level, and the sizes of its terms.

    The sizes (r, q + 1) are those of the terms that the channels and the equilibrium give a mode.
    """
    vectors, channels, rest = level.modal.vectors.T, level.channels, level.asymptotic.configuration
    (r, m), q = vectors.shape, channels.carried.shape[1]
    place, speed = np.eye(r + q, m + q, m - r), np.eye(r + q, m + q, m - r)
    for matrix, moved in ((place, channels.shapes), (speed, channels.carried)):
        matrix[:r, :m], matrix[:r, m:] = vectors, -(vectors @ moved)
    sizes = np.abs(vectors) @ np.abs(np.column_stack([channels.shapes, rest]))
    return place, np.concatenate([-(vectors @ rest), np.zeros(q)]), speed, sizes


def powers(level: LoadedLevel) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the powers in a level, as in work.py: of damping, of varying loads, of constant and of other friction.

    Damping: a form in xi' (n, n). Varying loads: (q, 4 n + 1). Constant friction: (n,). Friction due to the forces of
    links (s, 4 n + 1): T, the velocity on which it works, that on which its constant part works, and this part. Without
    channels only the first and the third are not empty.
    """
    own, base, index, carried = level.level, level.level.base, list(level.level.indices), level.channels.carried
    modal, patterns = level.modal, level.excitation.patterns
    friction = -(level.pushes @ own.gap_rows) if base.general else np.zeros(own.modes)
    if not level.excitation.channels:
        empty = np.zeros((0, 4 * own.modes + 1))
        return modal.damping, empty, friction, empty
    static = level.excitation.static + base.preload
    moved = np.hstack([modal.vectors, carried])
    springs = base.springs[index]
    pulls, drags = springs[:, None] * own.gap_rows[index], base.dampings[index][:, None] * own.speed_rows[index]
    held = springs * level.gap_constants[index]
    stop_columns = carried.T @ base.pushes - level.excitation.stops.T  # work of unit forces of links on w'
    link_columns = stop_columns[:, index]
    on_displacement = link_columns @ pulls + carried.T @ (base.modes.omega[:, None] ** 2 * own.vectors)
    on_displacement[:, modal.modes :] -= carried.T @ patterns
    on_velocity = link_columns @ drags + carried.T @ base.damping @ moved
    constant = link_columns @ held + carried.T @ (base.modes.omega**2 * level.asymptotic.configuration - static)
    constant -= stop_columns @ level.pushes
    slides = [k for k, link in enumerate(index) if link in base.oblique and np.isinf(base.stiffnesses[link])]
    on_displacement -= link_columns[:, slides] @ own.force_rows[slides]
    on_velocity -= link_columns[:, slides] @ own.force_rate_rows[slides]
    constant -= link_columns[:, slides] @ level.asymptotic.forces[slides]
    pairs = []
    for i in level.rubbing_elements:
        held = next(k for k in base.link_indices[i] if base.links[k].held)
        (place, rate, still), moves = level.rubbing(i), level.excitation.stops[held]
        pairs.append(np.concatenate([place, rate, own.speed_rows[held], own.gap_rows[held], [still]]))
        on_displacement -= np.outer(moves, place)
        on_velocity -= np.outer(moves, rate)
        constant -= still * moves
    damping = moved.T @ base.damping @ moved + own.speed_rows[index].T @ drags
    damping[: modal.modes, : modal.modes] = modal.damping  # with the damping ratios given
    varying = np.column_stack([patterns.T @ own.vectors, on_displacement, on_velocity, carried.T @ moved, constant])
    rubbing = np.array(pairs).reshape(-1, 4 * own.modes + 1)
    return damping, varying, friction, rubbing
