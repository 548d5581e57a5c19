"""Condensed structures: of a mass of lower rank, whose motions without mass follow the others statically.

    M Z = 0,   x = T u + R w

Loads on masses leave the motions Z without mass (massless_motions.py) in static equilibrium, Z^T K x = 0. With d the
rows of Z that are unit vectors, k the others, and Y the rows k of Z, the motion is exactly

    u = x_k - Y x_d,   M_u = M_kk,   K_u = T^T K T,   T = [I - Y G],   G = (Z^T K Z)^-1 (Z^T K)_k
                                                          [  - G  ]

A force F at a point p that they move displaces it by a further rho F at once, rho = p.Z (Z^T K Z)^-1 Z^T p. As in
modal_structure.py this is a coordinate w of its own, with a frequency omega_a far above the others instead of none:

    R = Z (Z^T K Z)^-1 Z^T p / rho,   K_w = R^T K R,   M_w = K_w / omega_a^2

Where points keep as many w as there are motions without mass, (u, w) are as many coordinates as x, and the same motion
is written in x itself: no vector can be meant in the one and taken in the other.

    x = T u + Z a,   a = (Z^T K Z)^-1 Z^T K x,   M_x = M + K Z (Z^T K Z)^-1 Z^T K / omega_a^2,   K_x = K

Source: R. J. Guyan, Reduction of stiffness and mass matrices, AIAA J. 3 (1965) 380, which is exact here.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.mathematics.lowest_modes import definite_factor
from multiphi_exudyn.mathematics.massless_motions import Indefinite, blockwise_inverse, massless_motions
from multiphi_exudyn.mathematics.round_off import INDEPENDENT, MASSLESS, drop_round_off
from multiphi_exudyn.mechanics.arguments import Matrix
from multiphi_exudyn.mechanics.damping import ModalDamping, RayleighDamping
from multiphi_exudyn.mechanics.dofs import DofTable, Place, dof_table, fixed_dofs
from multiphi_exudyn.mechanics.structure import (
    LinearStructure,
    checked_vector,
    named_row,
    point_rows,
    symmetric_matrix,
    without_rows,
)

__all__ = ["CondensedStructure", "condensed_structure"]

ABOVE = 1e6  # of the largest K_ii / M_ii, omega_a^2: forces of stops at points without mass err by some 1e-3


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class CondensedStructure(LinearStructure):
    """A structure without the rows of its motions without mass; the result of ``condensed_structure``.

        x = T u + R w,   M Z = 0

    It is a LinearStructure in (u, w): u are the displacements of the rows that are kept, without the part that motions
    without mass have in them, w the direct displacements of points without mass by forces at these points. Where these
    would be as many as the rows that were given, it is a LinearStructure in these rows, x.

    Attributes
    ----------
    mass, stiffness : array (n, n)
        M [kg, kg m2] and K [N/m, N m] in (u, w), sparse if those given are.
    damping : array (n, n), ModalDamping, RayleighDamping or None
        C [N s/m, N m s] in (u, w), or its definition by ratios.
    points : mapping of str to array (n,)
        Rows of the points in (u, w), those without mass too.
    dofs : DofTable or None
        Nodes and components of the rows that are kept, and of those in whose place w stand.
    free : array (n,)
        Their indices among the N rows that were given.
    transformation : sparse array (N, n)
        (T, R), with rows of zeros where supports hold.
    condensation : sparse array (n, N)
        Coordinates of the motion T u of all rows, by their displacements.
    motions : sparse array (N, z)
        Z.
    massless : array (z,)
        Indices of the rows that are condensed, d among the N.

    Examples
    --------
    >>> import numpy as np
    >>> import multiphi_exudyn as mp
    >>> K = 4e4 * np.array([[2, -1, 0], [-1, 2, -1], [0, -1, 1]])  # N/m
    >>> chain = mp.condensed_structure(np.diag([1.0, 0.0, 1.0]), K, points={"tip": 2})
    >>> chain.massless.tolist(), chain.n
    ([1], 2)
    >>> x = mp.MultiPhiModel(chain).static_equilibrium({"tip": 100.0})
    >>> print(1e3 * chain.full(x).round(6))  # mm
    [2.5 5.  7.5]
    """

    transformation: Matrix
    condensation: Matrix
    motions: Matrix
    massless: np.ndarray

    def full(self, displacement: np.ndarray) -> np.ndarray:
        """Displacements (or velocities) of all rows that were given, (N,) or (N, k), from (n,) or (n, k)."""
        values = np.asarray(displacement, float)
        if values.ndim not in (1, 2) or values.shape[0] != self.n:
            raise MultiPhiValueError(f"displacement: got shape {values.shape}, need ({self.n},) or ({self.n}, k)")
        return np.asarray(self.transformation @ values)

    def condensed(self, displacement: np.ndarray) -> np.ndarray:
        """Displacements (or velocities) of the masses, (n,), from those of all rows that were given, (N,)."""
        return np.asarray(
            self.condensation @ checked_vector("displacement", displacement, self.transformation.shape[0])
        )


def condensed_structure(
    mass: Matrix,
    stiffness: Matrix,
    damping: Matrix | ModalDamping | RayleighDamping | None = None,
    points: Mapping[str, Place | np.ndarray] | None = None,
    dofs: DofTable | Sequence[tuple[int, int | str]] | None = None,
    fixed: Iterable[Place] = (),
) -> LinearStructure:
    """A structure of a mass of lower rank, without its motions without mass, M Z = 0, which follow statically.

        x = T u + R w,   T = [I - Y G],   G = (Z^T K Z)^-1 (Z^T K)_k,   u = x_k - Y x_d
                             [  - G  ]

    Massless rotations, masses at an offset, and incompatible modes of elements make such masses. For forces on masses
    the result is exact. A point that a motion without mass moves keeps a coordinate w for the direct displacement by
    forces there, exact in statics, with a frequency omega_a of a thousand times the highest of a row,
    sqrt(K_ii / M_ii), instead of none. Where more than 600 rows of sparse matrices without mass are connected, as the
    rotations of a shell, K without them would no longer be sparse: they are kept, with masses for frequencies of
    omega_a, and omega^2 of the other modes err by less than 1e-6.

    Parameters
    ----------
    mass : array (N, N)
        M [kg, kg m2], dense or scipy.sparse, symmetric positive semidefinite.
    stiffness : array (N, N)
        K [N/m, N m], positive definite for motions without mass.
    damping : array (N, N), ModalDamping, RayleighDamping or None, default None
        C [N s/m, N m s], without a damper that couples masses with motions without mass; or as of LinearStructure.
    points : mapping of str to int, (int, str) or array (N,), default None
        As of LinearStructure, in the numbering of the N rows.
    dofs : sequence of (int, str or int), default None
        (node, component) of every row.
    fixed : iterable of int or (int, str), default ()
        Degrees of freedom that supports fix, in the same numbering.

    Returns
    -------
    LinearStructure
        A CondensedStructure, or a structure of all rows where each has mass or keeps a small one.

    Raises
    ------
    MultiPhiTypeError
        For values that are not real numbers, and names that are not strings.
    MultiPhiValueError
        For arguments that LinearStructure refuses, rows with neither mass nor stiffness, and dampers that couple masses
        with motions without mass.

    Examples
    --------
    A mass of 2 kg at an offset of 0.1 m from its node, which turns about the mass without inertia:

    >>> import numpy as np
    >>> import multiphi_exudyn as mp
    >>> offset = np.array([1.0, 0.1])
    >>> arm = mp.condensed_structure(2.0 * np.outer(offset, offset), np.diag([1e4, 300.0]))
    >>> arm.n, round(float(mp.MultiPhiModel(arm).level(()).frequencies[0]), 2)  # springs in series: 7500 N/m
    (1, 9.75)
    """
    fixed = tuple(fixed) if isinstance(fixed, Iterator) else fixed
    whole_mass = symmetric_matrix("mass", mass, None)
    total = whole_mass.shape[0]
    table = None if dofs is None else dof_table(dofs, total)
    supported = fixed_dofs(fixed, total, table)
    moving = np.setdiff1d(np.arange(total), supported)
    given_mass = without_rows(supported, moving, whole_mass)
    rows, motions = massless_motions(given_mass)
    if not len(rows):
        return LinearStructure(mass, stiffness, damping, {} if points is None else points, table, fixed)
    given = {"stiffness": stiffness}
    if not (damping is None or isinstance(damping, (ModalDamping, RayleighDamping))):
        given["damping"] = damping
    matrices = {
        name: without_rows(supported, moving, symmetric_matrix(name, matrix, total)) for name, matrix in given.items()
    }
    named = point_rows({} if points is None else points, total, table).restricted_to(moving)
    point_matrix = np.array(list(named.values())).reshape(len(named), len(moving))
    inverse = _inverse(motions, matrices["stiffness"], moving[rows], table)
    if inverse is None:
        added = _small_masses(motions, given_mass, matrices["stiffness"], rows)
        widened = scipy.sparse.coo_array((added, (moving[rows], moving[rows])), (total, total))
        return LinearStructure(whole_mass + widened, stiffness, damping, {} if points is None else points, table, fixed)
    kept = np.setdiff1d(np.arange(len(moving)), rows)
    follow = _following(motions, matrices["stiffness"], inverse, rows, kept)
    direct, at = _direct(motions, inverse, point_matrix, rows)
    if "damping" in matrices:
        _check_damping(motions, matrices["damping"], follow, moving[rows], table)
    masses = scipy.sparse.csr_array(given_mass)[kept][:, kept]
    stiffnesses = _symmetric_product(follow, matrices["stiffness"]).diagonal()
    square = ABOVE * float(np.max(stiffnesses / masses.diagonal())) or 1.0
    identity = scipy.sparse.eye_array(len(moving), format="csr")
    condensation = identity[kept] - scipy.sparse.csr_array(motions)[kept] @ identity[rows]  # u = x_k - Y x_d
    if len(at) == len(rows):
        shapes, places = identity, moving
        pulled = scipy.sparse.csr_array(motions.T @ scipy.sparse.csr_array(matrices["stiffness"]))
        united = {name: scipy.sparse.csr_array(matrix) for name, matrix in matrices.items()}
        united["mass"] = scipy.sparse.csr_array(given_mass) + _symmetric_product(pulled, inverse / square)
        condensation = follow @ condensation
    else:
        shapes, places = (
            scipy.sparse.csr_array(scipy.sparse.hstack([follow, direct])),
            moving[np.concatenate([kept, at])],
        )
        united = {name: _symmetric_product(shapes, matrix) for name, matrix in matrices.items()}
        own = united["stiffness"][len(kept) :, len(kept) :]
        united["mass"] = scipy.sparse.block_diag([masses, own / square], "csr")
        condensation = scipy.sparse.vstack([condensation, scipy.sparse.csr_array((len(at), len(moving)))])
    if not scipy.sparse.issparse(whole_mass):
        united = {name: matrix.toarray() for name, matrix in united.items()}
    among_all = scipy.sparse.csr_array((np.ones(len(moving)), (moving, np.arange(len(moving)))), (total, len(moving)))
    return CondensedStructure(
        united["mass"],
        united["stiffness"],
        united.get("damping", damping),
        dict(zip(named, point_matrix @ shapes, strict=True)),
        None if table is None else table.restricted_to(places),
        free=places,
        transformation=scipy.sparse.csr_array(among_all @ shapes),
        condensation=scipy.sparse.csr_array(condensation @ among_all.T),
        motions=scipy.sparse.csr_array(among_all @ motions),
        massless=moving[rows],
    )


def _inverse(motions: Matrix, stiffness: Matrix, rows: np.ndarray, table: DofTable | None) -> Matrix | None:
    """(Z^T K Z)^-1, sparse; None where it would not be. rows: those of the motions in the numbering of the files."""
    largest = {} if scipy.sparse.issparse(stiffness) else {"largest": stiffness.shape[0]}
    try:
        return blockwise_inverse(_symmetric_product(motions, stiffness), **largest)
    except Indefinite as error:
        raise MultiPhiValueError(
            f"mass: row {named_row(rows[error.row], table)} can move without mass and without stiffness, need one of "
            "both, or its support (fixed=)"
        ) from error


def _small_masses(motions: Matrix, mass: Matrix, stiffness: Matrix, rows: np.ndarray) -> np.ndarray:
    """Masses (z,) of the rows of motions without mass, in which these have the frequency omega_a or one above it."""
    own = _symmetric_product(motions, stiffness)
    if definite_factor(scipy.sparse.csc_array(own)) is None:
        raise MultiPhiValueError(
            f"mass: {len(rows)} rows have no mass, and some of them can move without stiffness, need one of both, or "
            "their supports (fixed=)"
        )
    heavy = np.setdiff1d(np.arange(mass.shape[0]), rows)
    return np.asarray(own.diagonal() / (ABOVE * np.max(stiffness.diagonal()[heavy] / mass.diagonal()[heavy])))


def _following(motions: Matrix, stiffness: Matrix, inverse: Matrix, rows: np.ndarray, kept: np.ndarray) -> Matrix:
    """T (n, k), sparse: the motion of all rows with that of the masses."""
    n = stiffness.shape[0]
    units = scipy.sparse.csc_array((np.ones(len(kept)), (kept, np.arange(len(kept)))), (n, len(kept)))
    pulled = scipy.sparse.csr_array(motions.T @ scipy.sparse.csr_array(stiffness))[:, kept]
    return scipy.sparse.csr_array(units - motions @ (inverse @ pulled))


def _direct(motions: Matrix, inverse: Matrix, points: np.ndarray, rows: np.ndarray) -> tuple[Matrix, np.ndarray]:
    """R (n, w) and the row in whose place each of its motions stands.

    points: their rows (k, n). Points that depend on others in the motions without mass have no motion of their own.
    """
    moved = drop_round_off(points @ motions, np.abs(points) @ abs(motions))
    moved = moved[np.any(moved, axis=1)]
    chosen, places, basis = list[int](), list[int](), np.zeros((0, len(rows)))
    for i, row in enumerate(moved):
        remainder = row - (basis @ row) @ basis
        remainder -= (basis @ remainder) @ basis
        if np.linalg.norm(remainder) > INDEPENDENT * np.linalg.norm(row):
            basis = np.vstack([basis, remainder / np.linalg.norm(remainder)])
            chosen.append(i)
            free = np.setdiff1d(np.flatnonzero(row), places)
            places.append(int(free[np.argmax(np.abs(row[free]))]) if len(free) else -1)
    flexible = inverse @ moved[chosen].T
    own = np.einsum("ij,ji->i", moved[chosen], flexible)
    return scipy.sparse.csc_array(motions @ (flexible / own)), rows[places]


def _check_damping(motions: Matrix, damping: Matrix, follow: Matrix, rows: np.ndarray, table: DofTable | None) -> None:
    """Raise where the motions without mass are not quasi-static, as a damper couples them with the masses."""
    coupling = abs(motions.T @ damping @ follow)
    sizes = abs(motions).T @ abs(scipy.sparse.csr_array(damping)) @ abs(follow)
    excess = scipy.sparse.csr_array(coupling - MASSLESS * sizes).max(axis=1).toarray().ravel()
    if np.any(excess > 0):
        raise MultiPhiValueError(
            f"damping: got a damper at row {named_row(rows[int(np.argmax(excess))], table)}, which has no mass of its "
            "own, need a mass there, or damping by ratios (ModalDamping, RayleighDamping)"
        )


def _symmetric_product(shapes: Matrix, matrix: Matrix) -> Matrix:
    product = scipy.sparse.csr_array(shapes.T @ scipy.sparse.csr_array(matrix) @ shapes)
    return scipy.sparse.csr_array(product + product.T) / 2
