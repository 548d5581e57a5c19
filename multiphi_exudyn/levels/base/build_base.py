"""Building the base: all modes of the structure where that is affordable, else a small base by Krylov vectors.

A level of r modes takes them from the structure's lowest r + BEYOND modes and, for each contact, friction, load and
point, from as many Krylov vectors (K^-1 M)^j K^-1 h as its frequencies need (lowest_modes.py). That is judged on
samples: levels with the first, a middle or the last contact closed alone, and one with many contacts closed.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse

from multiphi_exudyn.levels.base.modal_base import ModalBase, parallel
from multiphi_exudyn.mathematics.lowest_modes import HeldRows, LowestModes, lowest_modes
from multiphi_exudyn.mathematics.modes import Modes, complete_modes
from multiphi_exudyn.mathematics.round_off import drop_round_off
from multiphi_exudyn.mechanics.arguments import Matrix
from multiphi_exudyn.mechanics.damping import ModalDamping, RayleighDamping
from multiphi_exudyn.mechanics.element import AnyLink, Element, Link, link_indices, links_of
from multiphi_exudyn.mechanics.residual_contact import ResidualContact
from multiphi_exudyn.mechanics.structure import LinearStructure

__all__ = ["COMPLETE", "build_base"]

BEYOND = 8  # modes of an incomplete base beyond those of a level
COMPLETE = 600  # DoFs up to which the base holds every mode; above, the lowest ones and Krylov vectors


def build_base(
    structure: LinearStructure,
    contacts: Sequence[Element],
    modes: int | str,
    previous: ModalBase | None = None,
    load_rows: np.ndarray | None = None,
) -> ModalBase:
    """Return the base for levels with ``modes`` modes at most, or with all modes for "all".

    previous: a base of the same structure, whose modes are not computed again. load_rows: rows (k, n) of loads, which
    the base represents like those of contacts and points.
    """
    links = links_of(contacts)
    rows = np.array([structure.row(link.direction) for link in links]).reshape(-1, structure.n)
    force_rows = np.array([_force_row(structure, link) for link in links]).reshape(-1, structure.n)
    points = structure.point_rows
    load_rows = np.zeros((0, structure.n)) if load_rows is None else load_rows
    complete = structure.n <= COMPLETE or modes == "all"
    if complete:
        lowest = LowestModes(complete_modes(_dense(structure.mass), _dense(structure.stiffness)), structure.n, 0.0)
    else:
        first = np.array(parallel(rows.T), int)
        distinct = np.unique(first)
        stiffness = _largest_stiffnesses(contacts, first)[distinct]
        shown = np.vstack([rows[distinct], points, load_rows])
        krylov_rows = shown[sorted(set(parallel(shown.T)))]  # the distinct rows of contacts come first
        own = [place for place, link in enumerate(distinct.tolist()) if not isinstance(links[link], ResidualContact)]
        samples = _sample_levels(own, stiffness, int(modes))
        lowest = _incomplete_base_modes(structure, krylov_rows, samples, int(modes), previous)
    aligned = lowest.modes.aligned(points)
    return ModalBase(
        modes=aligned,
        points=points @ aligned.shapes,
        damping=_base_damping(structure, aligned),
        directions=_projected_rows(aligned, rows),
        pushes=_projected_rows(aligned, force_rows),
        contacts=tuple(contacts),
        complete=complete,
        mass=structure.mass,
        exact_count=lowest.exact,
        most_level_modes=aligned.count if complete else max(int(modes), lowest.exact - BEYOND),
        load_rows=load_rows,
        error=lowest.error,
    )


def _incomplete_base_modes(
    structure: LinearStructure, rows: np.ndarray, samples: Sequence[HeldRows], modes: int, previous: ModalBase | None
) -> LowestModes:
    """Return the lowest modes and the Krylov vectors of ``rows`` (k, n)."""
    count = min(structure.n - 2, modes + BEYOND)
    known_modes = None if previous is None or previous.complete else previous.structure_modes
    return lowest_modes(structure.mass, structure.stiffness, count, rows, samples, known_modes, least=min(modes, count))


def _sample_levels(own: Sequence[int], stiffness: np.ndarray, modes: int) -> list[HeldRows]:
    """Return the levels on which a base is judged: one row alone, and ``modes`` rows spread over all of them.

    own: the rows of contacts with own modes; of those on a residual boundary the static response is all that counts.
    """
    count = len(own)
    single = [[own[k]] for k in sorted({0, count // 2, count - 1})] if count else []
    spread = np.unique(np.linspace(0, count - 1, min(count, modes)).astype(int)).tolist() if count else []
    row_sets = [*single, [own[k] for k in spread]] if count > 1 else single
    return [HeldRows(rows, stiffness[rows], modes) for rows in row_sets]


def _largest_stiffnesses(contacts: Sequence[Element], first: np.ndarray) -> np.ndarray:
    """Return the largest stiffness (l,) [N/m] of an element in one of its states along each direction.

    first: for every link the first one of its direction, at whose place the stiffness is.
    """
    links, largest = links_of(contacts), np.zeros(len(first))
    for element, indices in zip(contacts, link_indices(contacts), strict=True):
        for state in element.states:
            together = np.zeros(len(first))
            for k in state.holds:
                together[first[indices[k]]] += links[indices[k]].stiffness
            largest = np.maximum(largest, together)
    return largest


def _force_row(structure: LinearStructure, link: AnyLink) -> np.ndarray:
    """Return the row (n,) along which the force of a link acts."""
    if isinstance(link, Link) and link.push:
        return np.sum([share * structure.row(at) for share, at in link.push], axis=0)
    return structure.row(link.direction)


def _projected_rows(modes: Modes, rows: np.ndarray) -> np.ndarray:
    """Return rows (l, n) in base coordinates (m, l), column by column in memory, with zeros in place of round-off."""
    return drop_round_off(rows @ modes.shapes, np.abs(rows) @ np.abs(modes.shapes)).T


def _dense(matrix: Matrix) -> np.ndarray:
    return matrix.toarray() if scipy.sparse.issparse(matrix) else np.asarray(matrix)


def _base_damping(structure: LinearStructure, modes: Modes) -> np.ndarray:
    """Return the damping matrix Phi^T C Phi (m, m)."""
    damping = structure.damping
    if damping is None:
        return np.zeros((modes.count, modes.count))
    if isinstance(damping, ModalDamping):
        return np.diag(2 * damping.of(modes.count) * modes.omega)
    if isinstance(damping, RayleighDamping):
        return np.diag(damping.alpha + damping.beta * modes.omega**2)
    projected = modes.shapes.T @ (damping @ modes.shapes)
    return (projected + projected.T) / 2
