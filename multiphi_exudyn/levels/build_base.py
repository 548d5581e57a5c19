"""Building the base: all modes of the structure where that is affordable, else a small base by Krylov vectors.

A level of r modes takes them from the structure's lowest r + BEYOND modes and, for each contact, friction, load and
point, from as many Krylov vectors (K^-1 M)^j K^-1 h as its frequencies need (lowest_modes.py). That is judged on
samples: levels in which the first, a middle or the last contact holds alone, and one in which many do.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
import scipy.sparse

from multiphi_exudyn.levels.modal_base import ModalBase, parallel
from multiphi_exudyn.mathematics.eigenproblems.lowest_modes import HeldRows, LowestModes, lowest_modes
from multiphi_exudyn.mathematics.eigenproblems.modes import Modes, complete_modes
from multiphi_exudyn.mathematics.round_off import drop_round_off
from multiphi_exudyn.mechanics.arguments import Matrix
from multiphi_exudyn.mechanics.damping import ModalDamping, RayleighDamping
from multiphi_exudyn.mechanics.element import AnyLink, Element, Link, link_indices, links_of
from multiphi_exudyn.mechanics.structure import LinearStructure

__all__ = ["build_base"]

BEYOND = 8  # modes of an incomplete base beyond those of a level
COMPLETE = 600  # DoFs up to which the base holds every mode; above, the lowest ones and Krylov vectors


def build_base(
    structure: LinearStructure,
    contacts: Sequence[Element],
    modes: int | str,
    less: ModalBase | None = None,
    further: np.ndarray | None = None,
) -> ModalBase:
    """The base of a structure for levels with ``modes`` modes at most, all that it has for "all".

    less: one of the same structure, whose own modes are not computed again. further: rows (k, n) that it is to hold
    beside those of contacts and points, as loads have.
    """
    links = links_of(contacts)
    rows = np.array([structure.row(link.direction) for link in links]).reshape(-1, structure.n)
    pushed = np.array([_pushed(structure, link) for link in links]).reshape(-1, structure.n)
    points = structure.point_rows
    further = np.zeros((0, structure.n)) if further is None else further
    complete = structure.n <= COMPLETE or modes == "all"
    if complete:
        found = LowestModes(complete_modes(_dense(structure.mass), _dense(structure.stiffness)), structure.n, 0.0)
    else:
        first = np.array(parallel(rows.T), int)
        distinct = np.unique(first)
        stiffness = np.array([_largest_stiffness(contacts, np.flatnonzero(first == own)) for own in distinct])
        held = np.vstack([rows[distinct], points, further])
        found = _small(structure, held, _samples(stiffness, int(modes)), int(modes), less)
    own = found.modes.turned(points)
    return ModalBase(
        modes=own,
        points=points @ own.shapes,
        damping=_base_damping(structure, own),
        directions=_seen(own, rows),
        pushes=_seen(own, pushed),
        contacts=tuple(contacts),
        complete=complete,
        mass=structure.mass,
        exact=found.exact,
        served=own.count if complete else max(int(modes), found.exact - BEYOND),
        further=further,
        error=found.error,
    )


def _small(
    structure: LinearStructure, rows: np.ndarray, samples: Sequence[HeldRows], modes: int, less: ModalBase | None
) -> LowestModes:
    """The lowest modes and the Krylov vectors of ``rows`` (k, n)."""
    count = min(structure.n - 2, modes + BEYOND)
    known = None if less is None or less.complete else _own(less)
    return lowest_modes(structure.mass, structure.stiffness, count, rows, samples, known, least=min(modes, count))


def _own(base: ModalBase) -> Modes:
    """The structure's own modes in a base."""
    return dataclasses.replace(
        base.modes, omega=base.modes.omega[: base.exact], shapes=base.modes.shapes[:, : base.exact]
    )


def _samples(stiffness: np.ndarray, modes: int) -> list[HeldRows]:
    """Levels on which a base is judged: one row held alone, and as many as there are modes, spread over all."""
    count = len(stiffness)
    alone = [[k] for k in sorted({0, count // 2, count - 1})] if count else []
    together = np.unique(np.linspace(0, count - 1, min(count, modes)).astype(int)).tolist()
    held = [*alone, together] if count > 1 else alone
    return [HeldRows(rows, stiffness[rows], modes) for rows in held]


def _largest_stiffness(contacts: Sequence[Element], same: np.ndarray) -> float:
    """The largest stiffness [N/m] that an element has in one of its states in the direction of these links."""
    links, places = links_of(contacts), link_indices(contacts)
    found = [
        sum(links[own[k]].stiffness for k in state.holds if own[k] in same)
        for element, own in zip(contacts, places, strict=True)
        for state in element.states
    ]
    return max(*found, 0.0)


def _pushed(structure: LinearStructure, link: AnyLink) -> np.ndarray:
    """The row (n,) along which a link's force acts."""
    if isinstance(link, Link) and link.push:
        return np.sum([share * structure.row(at) for share, at in link.push], axis=0)
    return structure.row(link.direction)


def _seen(modes: Modes, rows: np.ndarray) -> np.ndarray:
    """Rows (l, n) in base coordinates (m, l), zero where that is round-off."""
    return drop_round_off(modes.shapes.T @ rows.T, np.abs(modes.shapes.T) @ np.abs(rows.T))


def _dense(matrix: Matrix) -> np.ndarray:
    return matrix.toarray() if scipy.sparse.issparse(matrix) else np.asarray(matrix)


def _base_damping(structure: LinearStructure, modes: Modes) -> np.ndarray:
    """Phi^T C Phi (m, m)."""
    given = structure.damping
    if given is None:
        return np.zeros((modes.count, modes.count))
    if isinstance(given, ModalDamping):
        return np.diag(2 * given.of(modes.count) * modes.omega)
    if isinstance(given, RayleighDamping):
        return np.diag(given.alpha + given.beta * modes.omega**2)
    projected = modes.shapes.T @ (given @ modes.shapes)
    return (projected + projected.T) / 2
