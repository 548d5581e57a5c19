"""Linear structure: mass, damping and stiffness matrices with named points (eq. 38.1).

    M x'' + C x' + K x = f(t),   x in R^n

M [kg, kg m2] symmetric positive definite, K [N/m, N m] symmetric positive semidefinite (rigid-body
modes are welcome), C [N s/m, N m s] symmetric positive semidefinite. A *point* is a row p of n
numbers: its value is p.x, and a force F at it acts as p F.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
import scipy.linalg
import scipy.sparse

from multiphi_exudyn.display import Shown, names
from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.mathematics.modes import complete_modes
from multiphi_exudyn.mechanics.arguments import Matrix, is_real, real_array
from multiphi_exudyn.mechanics.damping import ModalDamping, RayleighDamping

__all__ = ["At", "LinearStructure", "damping_matrix"]

At: TypeAlias = "str | Mapping[str, float] | np.ndarray"  # point name, {point: coefficient}, or (n,) row

ROUND_OFF = 1e-9  # of the largest entry: above what assembling in floating point leaves of a zero


@dataclass(frozen=True, eq=False, repr=False)
class LinearStructure(Shown):
    """A linear structure: mass, damping and stiffness matrices with named points (eq. 38.1).

        M x'' + C x' + K x = f(t),   x in R^n

    A point is a row p of n numbers: its value is p.x, and a force F at it acts as p F. Two structures are equal only if
    they are the same object.

    Memory of sparse matrices: some times their own, while they are checked. A model's base then has n numbers for each
    of its modes and static shapes, 4 r + 40 + contacts + points, a few times while it is computed, and once the factors
    of K. A plate of n = 98400, 3e6 entries in K, r = 20: 0.4 GB for matrices and mesh, at most 1.1 GB in all.

    Parameters
    ----------
    mass : array (n, n)
        M [kg, kg m2], dense or scipy.sparse, symmetric positive definite; kept as given, never modified.
    stiffness : array (n, n)
        K [N/m, N m], dense or scipy.sparse, symmetric positive semidefinite; rigid-body modes are welcome.
    damping : array (n, n), ModalDamping, RayleighDamping or None, default None
        C [N s/m, N m s], symmetric positive semidefinite, or how it is made; None for no damping.
    points : mapping of str to int or array (n,), default empty
        Name to degree of freedom, counted from 0, or to row p; afterwards name to row.

    Raises
    ------
    MultiPhiTypeError
        For what are no real numbers or no names.
    MultiPhiValueError
        For a wrong shape, a value that is not finite, an asymmetric matrix, a mass that is not positive definite, a
        negative diagonal of stiffness or damping, and a degree of freedom that there is not.

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
    points: Mapping[str, int | np.ndarray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        mass = _symmetric("mass", self.mass, None)
        _check_positive_definite(mass)
        stiffness = _semidefinite_diagonal("stiffness", self.stiffness, mass.shape[0])
        damping = self.damping
        if not (damping is None or isinstance(damping, (ModalDamping, RayleighDamping))):
            damping = _semidefinite_diagonal("damping", damping, mass.shape[0])
        rows = _point_rows(self.points, mass.shape[0])
        checked = {"mass": mass, "stiffness": stiffness, "damping": damping, "points": rows}
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
        """The row p (n,) of a point name, of {point: coefficient}, or of a row given as such.

        MultiPhiValueError for a point that there is not, MultiPhiTypeError for coefficients that are no numbers.
        """
        if isinstance(at, str):
            if at not in self.points:
                known = ", ".join(sorted(self.points)) or "none"
                raise MultiPhiValueError(f"point: got {at!r}, need one of: {known}")
            return np.asarray(self.points[at])
        if isinstance(at, Mapping):
            if not at:
                raise MultiPhiValueError("direction: got an empty mapping, need {point: coefficient, ...}")
            return np.sum([_coefficient(name, c) * self.row(name) for name, c in at.items()], axis=0)
        return _vector("row", at, self.n)

    @property
    def point_rows(self) -> np.ndarray:
        """The rows (k, n) of all points."""
        return np.array(list(self.points.values())).reshape(-1, self.n)

    def vector(self, name: str, given: Any) -> np.ndarray:
        """A copy of ``given`` as finite (n,) numbers; ``name`` is what an error calls it."""
        return _vector(name, given, self.n)


def damping_matrix(structure: LinearStructure) -> Matrix | None:
    """C (n, n) [N s/m] of a structure's damping, however it is given; modal damping needs dense matrices."""
    given = structure.damping
    if isinstance(given, ModalDamping):
        if scipy.sparse.issparse(structure.mass) or scipy.sparse.issparse(structure.stiffness):
            raise MultiPhiValueError("damping: got ModalDamping of sparse matrices as one matrix, need dense ones")
        modes = complete_modes(structure.mass, structure.stiffness).turned(structure.point_rows)
        momenta = structure.mass @ modes.shapes
        return (momenta * (2 * given.of(modes.count) * modes.omega)) @ momenta.T
    if isinstance(given, RayleighDamping):
        return given.alpha * structure.mass + given.beta * structure.stiffness
    return given


def _symmetric(name: str, given: Matrix, n: int | None) -> Matrix:
    matrix = real_array(name, given, "an (n, n) array of real numbers")
    values = matrix.data if scipy.sparse.issparse(matrix) else matrix
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or matrix.shape[0] == 0:
        raise MultiPhiValueError(f"{name}: got shape {matrix.shape}, need (n, n)")
    if n is not None and matrix.shape[0] != n:
        raise MultiPhiValueError(f"{name}: got shape {matrix.shape}, need {(n, n)} as the mass has")
    if not np.all(np.isfinite(values)):
        raise MultiPhiValueError(f"{name}: got a value that is NaN or infinite, need finite numbers")
    asymmetry = _largest(matrix - matrix.T)
    if asymmetry > ROUND_OFF * _largest(matrix):
        raise MultiPhiValueError(f"{name}: asymmetric by {asymmetry:g}, need a symmetric matrix")
    symmetric = (matrix + matrix.T) / 2
    if not scipy.sparse.issparse(symmetric):
        symmetric.flags.writeable = False
    return symmetric


def _largest(matrix: Matrix) -> float:
    return float(np.max(np.abs(matrix.data if scipy.sparse.issparse(matrix) else matrix), initial=0.0))


def _semidefinite_diagonal(name: str, given: Matrix, n: int) -> Matrix:
    matrix = _symmetric(name, given, n)
    diagonal = matrix.diagonal()
    if np.any(diagonal < -ROUND_OFF * _largest(matrix)):
        worst = int(np.argmin(diagonal))
        raise MultiPhiValueError(f"{name}: diagonal entry {worst} is {diagonal[worst]:g}, need values >= 0")
    return matrix


def _check_positive_definite(mass: Matrix) -> None:
    if np.any(mass.diagonal() <= 0):
        worst = int(np.argmin(mass.diagonal()))
        raise MultiPhiValueError(
            f"mass: diagonal entry {worst} is {mass.diagonal()[worst]:g}, need a positive definite matrix"
        )
    if scipy.sparse.issparse(mass):
        return  # a factorisation would cost what the modes cost; they are checked when they are computed
    try:
        scipy.linalg.cholesky(mass, lower=True)
    except scipy.linalg.LinAlgError as error:
        raise MultiPhiValueError("mass: indefinite, need a positive definite matrix") from error


class _PointRows(Mapping[str, np.ndarray]):
    """Rows (n,) by name, made when asked for: kept are the entries that are not zero, (places, values) each."""

    def __init__(self, n: int, entries: dict[str, tuple[np.ndarray, np.ndarray]]) -> None:
        self.n = n
        self._entries = entries

    def __getitem__(self, name: str) -> np.ndarray:
        row = np.zeros(self.n)
        places, values = self._entries[name]
        row[places] = values
        row.flags.writeable = False
        return row

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries)

    def __len__(self) -> int:
        return len(self._entries)

    def __contains__(self, name: object) -> bool:
        return name in self._entries


def _point_rows(given: Any, n: int) -> _PointRows:
    if isinstance(given, _PointRows) and given.n == n:
        return given
    if not isinstance(given, Mapping):
        raise MultiPhiTypeError(f"points: got {type(given).__name__}, need {{name: DoF index or ({n},) row}}")
    return _PointRows(n, {name: _point_entries(name, place, n) for name, place in given.items()})


def _point_entries(name: str, given: int | np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    if not isinstance(name, str) or not name:
        raise MultiPhiTypeError(f"points: got the name {name!r}, need a non-empty string")
    if isinstance(given, (int, np.integer)) and not isinstance(given, bool):
        if not 0 <= given < n:
            raise MultiPhiValueError(f"points[{name!r}]: got DoF {given}, need 0 <= DoF < {n}")
        return np.array([given]), np.ones(1)
    row = _vector(f"points[{name!r}]", given, n)
    places = np.flatnonzero(row)
    return places, row[places]


def _vector(name: str, given: Any, n: int) -> np.ndarray:
    vector = real_array(name, given, f"an ({n},) array of real numbers")
    if vector.shape != (n,):
        raise MultiPhiValueError(f"{name}: got shape {vector.shape}, need ({n},)")
    if not np.all(np.isfinite(vector)):
        raise MultiPhiValueError(f"{name}: got a value that is NaN or infinite, need finite numbers")
    return vector


def _coefficient(name: str, value: Any) -> float:
    if not isinstance(name, str):
        raise MultiPhiTypeError(f"direction: got the name {name!r}, need the name of a point")
    if not is_real(value):
        raise MultiPhiTypeError(f"direction[{name!r}]: got {value!r}, need a number")
    if not np.isfinite(value):
        raise MultiPhiValueError(f"direction[{name!r}]: got {value!r}, need a finite coefficient")
    return float(value)
