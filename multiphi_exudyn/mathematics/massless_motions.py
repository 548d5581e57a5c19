"""Motions without mass, M z = 0, of a mass matrix of lower rank, and stiffness matrices that they leave.

    M = [M_kk  M_kd]    M_kk positive definite,   z = [Y],   Y = -M_kk^-1 M_kd
        [M_dk  M_dd]                                  [I]

d are as many rows as M lacks in rank, and each of them moves in one motion only. Massless rotations are rows of zeros;
a mass at an offset rotates its node about itself; the incompatible modes of a volume element have equal columns. Such
motions are local: those of a sparse matrix are found among the rows that share entries with theirs.

The rows d have pivots of round-off in a Cholesky factorisation of M with a unit diagonal: N. J. Higham, Accuracy and
Stability of Numerical Algorithms, 2002, ch. 10.3. That of a sparse M needs a shift.
"""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
import scipy.linalg
import scipy.sparse
import scipy.sparse.csgraph
import scipy.sparse.linalg

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.mathematics.round_off import MASSLESS

__all__ = ["Indefinite", "Motions", "blockwise_inverse", "massless_motions", "not_definite"]

Motions: TypeAlias = tuple[np.ndarray, Any]  # rows d (z,), ascending, and Z (n, z), sparse, with ones at these rows

SHIFT = MASSLESS / 100  # of the diagonal: lets the factorisation go on behind a pivot of round-off
PREFERENCE = 1e-3  # of equal pivots: the first row is kept, not one that round-off chooses
LARGEST = 600  # rows of a block whose inverse is formed
FULL = 20_000_000  # entries of all inverses: 160 MB


class Indefinite(ValueError):
    """A diagonal block is not positive definite; ``row``: the first row without a stiffness of its own."""

    def __init__(self, row: int) -> None:
        super().__init__(f"row {row}")
        self.row = row


def massless_motions(mass: Any) -> Motions:
    """Return the rows d and the motions Z of a symmetric mass (n, n), none for one that is definite or indefinite.

    A motion is without mass where each |M z| is round-off of its terms.
    """
    sparse = scipy.sparse.csr_array(mass)
    diagonal = sparse.diagonal()
    empty = np.flatnonzero((diagonal <= 0) & (abs(sparse).max(axis=1).toarray().ravel() <= MASSLESS * diagonal.max()))
    others = np.setdiff1d(np.arange(len(diagonal)), empty)
    if not len(others) or np.any(diagonal[others] <= 0):
        return np.zeros(0, int), scipy.sparse.csc_array((len(diagonal), 0))
    scales = scipy.sparse.diags_array(diagonal[others] ** -0.5)
    scaled = scipy.sparse.csr_array(scales @ sparse[others][:, others] @ scales)
    is_dense = not scipy.sparse.issparse(mass)
    dependent, motions = _dense_motions(scaled.toarray()) if is_dense else _sparse_motions(scaled)
    motions = scales @ motions @ scipy.sparse.diags_array(diagonal[others][dependent] ** 0.5)
    rows = np.concatenate([empty, others[dependent]])
    units = scipy.sparse.csc_array((np.ones(len(empty)), (empty, np.arange(len(empty)))), (len(diagonal), len(empty)))
    widened = scipy.sparse.coo_array(motions)
    widened = scipy.sparse.csc_array(
        (widened.data, (others[widened.row], widened.col)), (len(diagonal), len(dependent))
    )
    order = np.argsort(rows)
    return rows[order], scipy.sparse.csc_array(scipy.sparse.hstack([units, widened], format="csc")[:, order])


def not_definite(mass: Any) -> MultiPhiValueError:
    """Return the error for a mass (n, n) that is not positive definite: of lower rank, or indefinite."""
    rows, _ = massless_motions(mass)
    if not len(rows):
        return MultiPhiValueError("mass: indefinite, need a positive definite matrix")
    return MultiPhiValueError(
        f"mass: of lower rank, {len(rows)} motions have no mass, as one of row {rows[0]}, need a positive definite "
        "matrix; to let them follow statically: condensed_structure(mass, stiffness, ...)"
    )


def _dense_motions(scaled: np.ndarray) -> Motions:
    """Return ``massless_motions`` of a matrix (n, n) with a unit diagonal, by Cholesky with complete pivoting."""
    n = len(scaled)
    preference = 1 - PREFERENCE * np.arange(n) / n
    _, order, rank, _ = scipy.linalg.lapack.dpstrf(scaled * np.outer(preference, preference), tol=MASSLESS)
    kept, dependent = np.sort(order[:rank]) - 1, np.sort(order[rank:]) - 1
    motions = np.zeros((n, len(dependent)))
    if len(dependent):
        motions[kept] = -scipy.linalg.solve(scaled[np.ix_(kept, kept)], scaled[np.ix_(kept, dependent)], assume_a="pos")
        motions[dependent, np.arange(len(dependent))] = 1.0
    return _without_mass(scipy.sparse.csr_array(scaled), dependent, scipy.sparse.csc_array(motions))


def _sparse_motions(scaled: Any) -> Motions:
    """Return ``massless_motions`` of a sparse matrix with a unit diagonal: each among the rows next to its own."""
    n = scaled.shape[0]
    none = np.zeros(0, int), scipy.sparse.csc_array((n, 0))
    if scaled.nnz == n:
        return none
    shifted = scipy.sparse.csc_array(scaled + SHIFT * scipy.sparse.eye_array(n))
    factor = scipy.sparse.linalg.splu(
        shifted, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    )
    if not np.array_equal(factor.perm_r, factor.perm_c):
        return none
    is_dependent = np.abs(factor.U.diagonal()[factor.perm_c]) <= MASSLESS
    dependent = np.flatnonzero(is_dependent)
    entries = scaled[dependent].tocoo()
    beside = ~is_dependent[entries.col]
    columns, neighbours = entries.row[beside], entries.col[beside]
    counts = np.bincount(columns, minlength=len(dependent))
    values = np.empty(len(columns))
    for count in np.unique(counts[counts > 0]).tolist():
        of_size = counts[columns] == count
        members = neighbours[of_size].reshape(-1, count)
        blocks = scaled[np.repeat(members, count, axis=1).ravel(), np.tile(members, count).ravel()]
        own = entries.data[beside][of_size].reshape(-1, count, 1)
        values[of_size] = -np.linalg.solve(np.asarray(blocks).reshape(-1, count, count), own).ravel()
    units = np.ones(len(dependent)), (dependent, np.arange(len(dependent)))
    motions = scipy.sparse.csc_array((values, (neighbours, columns)), (n, len(dependent)))
    return _without_mass(scaled, dependent, motions + scipy.sparse.csc_array(units, (n, len(dependent))))


def _without_mass(scaled: Any, dependent: np.ndarray, motions: Any) -> Motions:
    """Return those motions Z for which M Z is round-off of its terms, without the round-off of Z itself."""
    motions.data[np.abs(motions.data) <= MASSLESS] = 0.0
    motions.eliminate_zeros()
    momenta, sizes = abs(scaled @ motions), abs(scaled) @ abs(motions)
    excess = scipy.sparse.csc_array(momenta - MASSLESS * sizes)
    is_massless = excess.max(axis=0).toarray().ravel() <= 0 if len(dependent) else np.zeros(0, bool)
    return dependent[is_massless], scipy.sparse.csc_array(motions[:, is_massless])


def blockwise_inverse(matrix: Any, largest: int = LARGEST) -> Any | None:
    """Return the sparse inverse of a positive definite (z, z) matrix of blocks with up to ``largest`` rows, else None.

    Raises Indefinite for a block that is not positive definite to round-off.
    """
    matrix = scipy.sparse.csr_array(matrix)
    _, labels = scipy.sparse.csgraph.connected_components(matrix, directed=False)
    order, sizes = np.argsort(labels, kind="stable"), np.bincount(labels)
    if np.max(sizes) > largest or np.sum(sizes**2) > FULL:
        return None
    firsts = np.concatenate([[0], np.cumsum(sizes)[:-1]])
    place, first_of = np.empty(len(order), int), firsts[labels]
    place[order] = np.arange(len(order))
    entries = scipy.sparse.coo_array(matrix)
    values, rows, columns = [], [], []
    for size in np.unique(sizes).tolist():
        chosen = np.flatnonzero(sizes == size)
        members = order[firsts[chosen][:, None] + np.arange(size)]
        number = np.full(len(sizes), -1)
        number[chosen] = np.arange(len(chosen))
        inside = number[labels[entries.row]] >= 0
        i, j = entries.row[inside], entries.col[inside]
        blocks = np.zeros((len(chosen), size, size))
        blocks[number[labels[i]], place[i] - first_of[i], place[j] - first_of[j]] = entries.data[inside]
        values.append(_inverses(blocks, members).ravel())
        rows.append(np.repeat(members, size, axis=1).ravel())
        columns.append(np.tile(members, (1, size)).ravel())
    inverse = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
    return scipy.sparse.csr_array(inverse, shape=matrix.shape)


def _inverses(blocks: np.ndarray, members: np.ndarray) -> np.ndarray:
    """Return the inverses of blocks (b, k, k); members: their rows (b, k)."""
    diagonals = np.einsum("bii->bi", blocks)
    wrong = np.argwhere(diagonals <= 0)
    if len(wrong):
        raise Indefinite(int(members[tuple(wrong[0])]))
    scales = diagonals**-0.5
    scaled = blocks * scales[:, :, None] * scales[:, None, :]
    squares, vectors = np.linalg.eigh(scaled)
    singular = np.flatnonzero(squares[:, 0] <= MASSLESS)
    if len(singular):
        raise Indefinite(int(members[singular[0], np.argmax(np.abs(vectors[singular[0], :, 0]))]))
    inverses = np.einsum("bik,bk,bjk->bij", vectors, 1 / squares, vectors)
    return np.asarray(inverses * scales[:, :, None] * scales[:, None, :])
