"""Linear structure: mass, damping and stiffness matrices with named points (eq. 38.1).

    M x'' + C x' + K x = f(t),   x in R^n

M [kg, kg m2] symmetric positive definite, K [N/m, N m] symmetric positive semidefinite (rigid-body
modes are allowed), C [N s/m, N m s] symmetric positive semidefinite. A *point* is a row p of n
numbers: its value is p.x, and a force F at it acts as p F.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import InitVar, dataclass, field
from typing import Any, TypeAlias

import numpy as np
import scipy.linalg
import scipy.sparse

from multiphi_exudyn.display import Shown, names
from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.mathematics.massless_motions import not_definite
from multiphi_exudyn.mathematics.modes import complete_modes
from multiphi_exudyn.mathematics.round_off import all_finite
from multiphi_exudyn.mechanics.arguments import FLOAT, Matrix, is_real, one_of, real_array
from multiphi_exudyn.mechanics.damping import ModalDamping, RayleighDamping
from multiphi_exudyn.mechanics.dofs import DofTable, Place, dof_table, fixed_dofs, required_table

__all__ = [
    "At",
    "LinearStructure",
    "PointRows",
    "checked_vector",
    "damping_matrix",
    "named_row",
    "point_rows",
    "symmetric_matrix",
    "without_rows",
]

At: TypeAlias = "str | Mapping[str, float] | np.ndarray"  # point name, {point: coefficient}, or (n,) row

NAMED = 3  # further degrees of freedom that an error lists after the first
ROUND_OFF = 1e-9  # of the largest entry: larger than the round-off of assembled zeros


@dataclass(frozen=True, eq=False, repr=False)
class LinearStructure(Shown):
    """A linear structure: mass, damping and stiffness matrices with named points (eq. 38.1).

        M x'' + C x' + K x = f(t),   x in R^n

    A point is a row p of n numbers: its value is p.x, and a force F at it acts as p F. Two structures are equal only if
    they are the same object.

    Memory with sparse matrices: several times that of the matrices while they are checked. The base of a model has n
    numbers for each of its coordinates, r + 8 and some for each contact and point, a few times more during its
    computation, and the factors of K once. A plate of n = 98400, 3e6 entries in K, r = 20: 0.5 GB for matrices and
    mesh, at most 0.8 GB in all.

    Parameters
    ----------
    mass : array (n, n)
        M [kg, kg m2], dense or scipy.sparse, symmetric positive definite; kept as given, never modified.
    stiffness : array (n, n)
        K [N/m, N m], dense or scipy.sparse, symmetric positive semidefinite; rigid-body modes are allowed.
    damping : array (n, n), ModalDamping, RayleighDamping or None, default None
        C [N s/m, N m s], symmetric positive semidefinite, or its definition by ratios; None for no damping.
    points : mapping of str to int, (int, str) or array (n,), default empty
        Name to degree of freedom, counted from 0, or with dofs to (node, component), or to row p; afterwards name to
        row.
    dofs : sequence of (int, str or int), default None
        (node, component) of every row of the matrices, "ux", "uy", "uz", "rx", "ry", "rz" or 1 to 6; None if unknown.
        Afterwards a DofTable.
    fixed : iterable of int or (int, str), default ()
        Degrees of freedom that supports fix, or with dofs (node, component) or (node, "all"). Matrices, points, dofs
        and fixed itself are in the numbering without supports; the fixed rows and columns are then removed.
    free : array (n,), default empty
        The remaining degrees of freedom, in the numbering without supports; follows from ``fixed``.

    Raises
    ------
    MultiPhiTypeError
        For values that are not real numbers, and names that are not strings.
    MultiPhiValueError
        For a wrong shape, a value that is not finite, an asymmetric matrix, a mass that is not positive definite, a
        negative diagonal of stiffness or damping, and a degree of freedom that does not exist.

    Examples
    --------
    >>> import numpy as np
    >>> import multiphi_exudyn as mp
    >>> K = 4e4 * np.array([[2, -1, 0], [-1, 2, -1], [0, -1, 1]])  # N/m
    >>> mp.LinearStructure(np.eye(3), K, mp.ModalDamping(0.01), points={"tip": 2})
    <LinearStructure: degrees of freedom 3; matrices dense; damping ModalDamping; points tip>
    """

    mass: Matrix
    stiffness: Matrix
    damping: Matrix | ModalDamping | RayleighDamping | None = None
    points: Mapping[str, Place | np.ndarray] = field(default_factory=dict)
    dofs: DofTable | Sequence[tuple[int, int | str]] | None = None
    fixed: InitVar[Iterable[Place]] = ()
    free: np.ndarray = field(default_factory=lambda: np.zeros(0, int), repr=False)

    def __post_init__(self, fixed: Iterable[Place]) -> None:
        mass = symmetric_matrix("mass", self.mass, None)
        total = mass.shape[0]
        dofs = None if self.dofs is None else dof_table(self.dofs, total)
        supported = fixed_dofs(fixed, total, dofs)
        moving = np.setdiff1d(np.arange(total), supported)
        mass = _check_positive_definite(without_rows(supported, moving, mass), moving, dofs)
        stiffness = _semidefinite_diagonal("stiffness", self.stiffness, supported, moving)
        damping = self.damping
        if not (damping is None or isinstance(damping, (ModalDamping, RayleighDamping))):
            damping = _semidefinite_diagonal("damping", damping, supported, moving)
        rows = point_rows(self.points, total, dofs)
        checked = {
            "mass": mass,
            "stiffness": stiffness,
            "damping": damping,
            "points": rows.restricted_to(moving) if len(supported) else rows,
            "dofs": dofs if dofs is None or not len(supported) else dofs.restricted_to(moving),
            "free": self.free[moving] if len(self.free) else moving,
        }
        for name, value in checked.items():
            object.__setattr__(self, name, value)

    @property
    def n(self) -> int:
        """Number of degrees of freedom."""
        return int(self.mass.shape[0])

    def _facts(self) -> Iterator[tuple[str, str]]:
        yield "degrees of freedom", str(self.n)
        yield "matrices", "sparse" if scipy.sparse.issparse(self.stiffness) else "dense"
        yield "damping", "none" if self.damping is None else type(self.damping).__name__
        yield "points", names(list(self.points))

    def row(self, at: At) -> np.ndarray:
        """The row p (n,) of a point name, of {point: coefficient}, or of a row.

        MultiPhiValueError for a point that does not exist, MultiPhiTypeError for coefficients that are not numbers.
        """
        if isinstance(at, str):
            if at not in self.points:
                raise MultiPhiValueError(f"point: got {at!r}, need {one_of(at, sorted(self.points))}")
            return np.asarray(self.points[at])
        if isinstance(at, Mapping):
            if not at:
                raise MultiPhiValueError("direction: got an empty mapping, need {point: coefficient, ...}")
            return np.sum([_coefficient(name, c) * self.row(name) for name, c in at.items()], axis=0)
        if is_real(at) or (isinstance(at, tuple) and any(isinstance(part, str) for part in at)):
            raise MultiPhiTypeError(f"point: got {at!r}, need the name of a point: points={{'name': {at!r}}}")
        return checked_vector("row", at, self.n).copy()

    @property
    def point_rows(self) -> np.ndarray:
        """The rows (k, n) of all points."""
        return np.array(list(self.points.values())).reshape(-1, self.n)

    def vector(self, name: str, given: Any) -> np.ndarray:
        """``given`` as finite (n,) numbers, not copied if it is a float array; name: of the argument, for errors."""
        return checked_vector(name, given, self.n)


def damping_matrix(structure: LinearStructure) -> Matrix | None:
    """C (n, n) [N s/m] of a structure's damping in any form; modal damping needs dense matrices."""
    damping = structure.damping
    if isinstance(damping, ModalDamping):
        if scipy.sparse.issparse(structure.mass) or scipy.sparse.issparse(structure.stiffness):
            raise MultiPhiValueError(
                "damping: got ModalDamping of sparse matrices where the damping matrix C is needed, need dense matrices"
            )
        modes = complete_modes(structure.mass, structure.stiffness).aligned(structure.point_rows)
        momenta = structure.mass @ modes.shapes
        return (momenta * (2 * damping.of(modes.count) * modes.omega)) @ momenta.T
    if isinstance(damping, RayleighDamping):
        return damping.alpha * structure.mass + damping.beta * structure.stiffness
    return damping


def symmetric_matrix(name: str, given: Matrix, n: int | None) -> Matrix:
    """The symmetric part of a matrix (n, n) of an argument with this name, which is symmetric to round-off."""
    matrix = real_array(name, given, "an (n, n) array of real numbers")
    values = matrix.data if scipy.sparse.issparse(matrix) else matrix
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or matrix.shape[0] == 0:
        ratio = f"; a ratio is ModalDamping({given!r})" if name == "damping" and matrix.ndim == 0 else ""
        raise MultiPhiValueError(f"{name}: got shape {matrix.shape}, need (n, n){ratio}")
    if n is not None and matrix.shape[0] != n:
        raise MultiPhiValueError(f"{name}: got shape {matrix.shape}, need {(n, n)} as the mass has")
    if not np.all(np.isfinite(values)):
        raise MultiPhiValueError(f"{name}: got a value that is NaN or infinite, need finite numbers")
    if _largest(matrix - matrix.T) > ROUND_OFF * _largest(matrix):
        raise MultiPhiValueError(f"{name}: {_asymmetry(matrix)}, need a symmetric matrix")
    symmetric = (matrix + matrix.T) / 2
    if not scipy.sparse.issparse(symmetric):
        symmetric.flags.writeable = False
    return symmetric


def _asymmetry(matrix: Matrix) -> str:
    """Text about the two mirrored entries with the largest difference."""
    skew = scipy.sparse.coo_array(matrix - matrix.T)
    worst = int(np.argmax(np.abs(skew.data)))
    i, j = int(skew.row[worst]), int(skew.col[worst])
    share = abs(skew.data[worst]) / _largest(matrix)
    return f"got {matrix[i, j]:g} at {i, j} and {matrix[j, i]:g} at {j, i}, {share:.2g} of its largest entry apart"


def _largest(matrix: Matrix) -> float:
    return float(np.max(np.abs(matrix.data if scipy.sparse.issparse(matrix) else matrix), initial=0.0))


def without_rows(supported: np.ndarray, moving: np.ndarray, matrix: Matrix) -> Matrix:
    """A matrix without the rows and columns that supports fix."""
    if not len(supported):
        return matrix
    reduced = matrix[moving][:, moving]
    if not scipy.sparse.issparse(reduced):
        reduced.flags.writeable = False
    return reduced


def _semidefinite_diagonal(name: str, given: Matrix, supported: np.ndarray, moving: np.ndarray) -> Matrix:
    matrix = without_rows(supported, moving, symmetric_matrix(name, given, len(supported) + len(moving)))
    diagonal = matrix.diagonal()
    if np.any(diagonal < -ROUND_OFF * _largest(matrix)):
        worst = int(np.argmin(diagonal))
        raise MultiPhiValueError(f"{name}: diagonal entry {moving[worst]} is {diagonal[worst]:g}, need values >= 0")
    return matrix


def _check_positive_definite(mass: Matrix, moving: np.ndarray, dofs: DofTable | None) -> Matrix:
    massless = np.flatnonzero(mass.diagonal() <= 0)
    if len(massless):
        has_lower_rank = np.all(mass.diagonal() >= 0) and np.any(mass.diagonal() > 0)
        follow = ", or let them follow statically: condensed_structure(mass, stiffness, ...)" if has_lower_rank else ""
        also = f" and {len(massless) - 1} more are 0 or less" if len(massless) > 1 else ""
        raise MultiPhiValueError(
            f"mass: diagonal entry {named_row(moving[massless[0]], dofs)} is {mass.diagonal()[massless[0]]:g}{also}"
            f"{_first(moving[massless[1:]], dofs)}, need values > 0: hold these (fixed=), or give them "
            f"a small mass{follow}"
        )
    if scipy.sparse.issparse(mass):
        return mass  # a factorisation is as expensive as the modes, whose computation checks the mass as well
    try:
        scipy.linalg.cholesky(mass, lower=True)
    except scipy.linalg.LinAlgError as error:
        raise not_definite(mass) from error
    return mass


def _first(rows: np.ndarray, dofs: DofTable | None) -> str:
    """Text " (6 (rx of node 10), 7 (ry of node 10), ...)" with the first NAMED rows; empty without rows."""
    named = [named_row(row, dofs) for row in rows[:NAMED]] + ["..."] * (len(rows) > NAMED)
    return f" ({', '.join(named)})" if named else ""


def named_row(row: int, dofs: DofTable | None) -> str:
    """Text "6 (rx of node 10)" for a row of the matrices, "6" without nodes."""
    return str(row) if dofs is None else "{2} ({1} of node {0})".format(*dofs.rows[row], row)


def _coefficient(name: str, value: Any) -> float:
    if not isinstance(name, str):
        raise MultiPhiTypeError(f"direction: got the name {name!r}, need the name of a point")
    if not is_real(value):
        raise MultiPhiTypeError(f"direction[{name!r}]: got {value!r}, need a number")
    if not np.isfinite(value):
        raise MultiPhiValueError(f"direction[{name!r}]: got {value!r}, need a finite coefficient")
    return float(value)


class PointRows(Mapping[str, np.ndarray]):
    """Rows (n,) by name, built on access from their nonzero entries (indices, values)."""

    def __init__(self, n: int, entries: dict[str, tuple[np.ndarray, np.ndarray]]) -> None:
        self.n = n
        self._entries = entries

    def __getitem__(self, name: str) -> np.ndarray:
        row = np.zeros(self.n)
        indices, values = self._entries[name]
        row[indices] = values
        row.flags.writeable = False
        return row

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries)

    def __len__(self) -> int:
        return len(self._entries)

    def __contains__(self, name: object) -> bool:
        return name in self._entries

    def __repr__(self) -> str:
        return f"<rows of {self.n} degrees of freedom, by point: {names(list(self))}>"

    def restricted_to(self, moving: np.ndarray) -> PointRows:
        """Rows of these degrees of freedom alone; raise for a point that moves with the others only."""
        entries = {}
        for name in self:
            row = self[name]
            if np.any(row) and not np.any(row[moving]):
                raise MultiPhiValueError(f"points[{name!r}]: got a place that is fixed, need one that can move")
            indices = np.flatnonzero(row[moving])
            entries[name] = indices, row[moving][indices]
        return PointRows(len(moving), entries)


def point_rows(given: Any, n: int, dofs: DofTable | None) -> PointRows:
    """Rows of points from degrees of freedom, (node, component), or rows (n,)."""
    if isinstance(given, PointRows) and given.n == n:
        return given
    if not isinstance(given, Mapping):
        needed = f"{{name: DoF index, (node, component) or ({n},) row}}"
        raise MultiPhiTypeError(f"points: got {type(given).__name__}, need {needed}")
    return PointRows(n, {name: _point_entries(name, place, n, dofs) for name, place in given.items()})


def _point_entries(name: str, given: Any, n: int, dofs: DofTable | None) -> tuple[np.ndarray, np.ndarray]:
    if not isinstance(name, str) or not name:
        raise MultiPhiTypeError(f"points: got the name {name!r}, need a non-empty string")
    if isinstance(given, tuple) and len(given) == 2 and (n != 2 or dofs is not None or isinstance(given[1], str)):
        label = f"points[{name!r}]"
        return np.array([required_table(label, dofs).place(label, *given)]), np.ones(1)
    if isinstance(given, (int, np.integer)) and not isinstance(given, bool):
        if dofs is not None:
            raise MultiPhiValueError(
                f"points[{name!r}]: got {given}, need (node, component), as ({given}, 'uz'): the rows have nodes"
            )
        if not 0 <= given < n:
            raise MultiPhiValueError(f"points[{name!r}]: got DoF {given}, need 0 <= DoF < {n}")
        return np.array([given]), np.ones(1)
    row = checked_vector(f"points[{name!r}]", given, n)
    indices = np.flatnonzero(row)
    return indices, row[indices]


def checked_vector(name: str, given: Any, n: int) -> np.ndarray:
    """``given`` as finite (n,) numbers, not copied if it is a float array; name: of the argument, for errors."""
    is_float = type(given) is np.ndarray and given.dtype == FLOAT
    vector: np.ndarray = given if is_float else real_array(name, given, f"an ({n},) array of real numbers")
    if vector.shape != (n,):
        raise MultiPhiValueError(f"{name}: got shape {vector.shape}, need ({n},)")
    if not all_finite(vector):
        raise MultiPhiValueError(f"{name}: got a value that is NaN or infinite, need finite numbers")
    return vector
