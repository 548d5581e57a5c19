"""Linear structure: mass, damping and stiffness matrices with named points (eq. 38.1).

    M x'' + C x' + K x = f(t),   x in R^n

M [kg, kg m2] symmetric positive definite, K [N/m, N m] symmetric positive semidefinite (rigid-body
modes are welcome), C [N s/m, N m s] symmetric positive semidefinite. A *point* is a row p of n
numbers: its value is p.x, and a force F at it acts as p F.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
import scipy.linalg
import scipy.sparse

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError

__all__ = ["At", "LinearStructure", "Matrix", "ModalDamping", "RayleighDamping"]

Matrix: TypeAlias = Any  # (n, n) numpy array or scipy.sparse array
At: TypeAlias = "str | Mapping[str, float] | np.ndarray"  # point name, {point: coefficient}, or (n,) row

SYMMETRY_TOLERANCE = 1e-9  # of the largest entry: above what assembling in floating point leaves


@dataclass(frozen=True)
class ModalDamping:
    """Damping ratios of the open level's modes, lowest first: C = M Phi diag(2 zeta omega) Phi^T M.

    ratios: fractions of critical damping (0.01 is 1 %), one per mode from the lowest.
    beyond: the ratio of every mode that is not listed.
    """

    ratios: Sequence[float]
    beyond: float = 0.0

    def __post_init__(self) -> None:
        values = np.asarray(self.ratios, dtype=float)
        if values.ndim != 1 or not np.all(np.isfinite(values)) or np.any(values < 0):
            raise MultiPhiValueError(f"ratios: got {self.ratios!r}, need a list of finite ratios >= 0")
        if not (np.isfinite(self.beyond) and self.beyond >= 0):
            raise MultiPhiValueError(f"beyond: got {self.beyond!r}, need a finite ratio >= 0")

    def of(self, count: int) -> np.ndarray:
        """Ratios of the lowest ``count`` modes, (count,)."""
        ratios = np.full(count, float(self.beyond))
        listed = np.asarray(self.ratios, dtype=float)[:count]
        ratios[: len(listed)] = listed
        return ratios


@dataclass(frozen=True)
class RayleighDamping:
    """C = alpha M + beta K, alpha in 1/s, beta in s."""

    alpha: float = 0.0
    beta: float = 0.0

    def __post_init__(self) -> None:
        if not (np.isfinite(self.alpha) and np.isfinite(self.beta) and min(self.alpha, self.beta) >= 0):
            raise MultiPhiValueError(
                f"alpha, beta: got {self.alpha!r}, {self.beta!r}, need finite values >= 0"
            )


@dataclass(frozen=True)
class LinearStructure:
    """A linear structure; see the module's docstring for the equation.

    mass, stiffness: (n, n), dense or scipy.sparse, symmetric; kept as given, never modified.
    damping: None | (n, n) | ModalDamping | RayleighDamping.
    points: name -> DoF index or (n,) row.

    Raises MultiPhiValueError or MultiPhiTypeError for a wrong shape, a value that is not finite, an
    asymmetric matrix, a mass that is not positive definite, a negative diagonal of the stiffness.
    """

    mass: Matrix
    stiffness: Matrix
    damping: Matrix | ModalDamping | RayleighDamping | None = None
    points: Mapping[str, int | np.ndarray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        mass = _symmetric("mass", self.mass, None)
        stiffness = _symmetric("stiffness", self.stiffness, mass.shape[0])
        _check_positive_definite(mass)
        if np.any(stiffness.diagonal() < 0):
            raise MultiPhiValueError(
                f"stiffness: diagonal entry {int(np.argmin(stiffness.diagonal()))} is "
                f"{stiffness.diagonal().min():g}, need values >= 0"
            )
        damping = self.damping
        if not (damping is None or isinstance(damping, (ModalDamping, RayleighDamping))):
            damping = _symmetric("damping", damping, mass.shape[0])
        rows = {name: _point_row(name, given, mass.shape[0]) for name, given in dict(self.points).items()}
        for name, value in zip(("mass", "stiffness", "damping", "points"), (mass, stiffness, damping, rows), strict=True):
            object.__setattr__(self, name, value)

    @property
    def n(self) -> int:
        """Number of degrees of freedom."""
        return int(self.mass.shape[0])

    def row(self, at: At) -> np.ndarray:
        """The row p, (n,), of a point name, of {point: coefficient}, or of a row given as such."""
        if isinstance(at, str):
            if at not in self.points:
                known = ", ".join(sorted(self.points)) or "none"
                raise MultiPhiValueError(f"point: got {at!r}, need one of: {known}")
            return np.asarray(self.points[at])
        if isinstance(at, Mapping):
            if not at:
                raise MultiPhiValueError("direction: got an empty mapping, need {point: coefficient, ...}")
            return np.sum([_coefficient(name, value) * self.row(name) for name, value in at.items()], axis=0)
        return _vector("row", at, self.n)


def _symmetric(name: str, given: Matrix, n: int | None) -> Matrix:
    if scipy.sparse.issparse(given):
        matrix = scipy.sparse.csr_array(given, dtype=float)
        values = matrix.data
    else:
        try:
            matrix = np.array(given, dtype=float)
        except (TypeError, ValueError) as error:
            raise MultiPhiTypeError(
                f"{name}: got {type(given).__name__}, need an (n, n) array of real numbers"
            ) from error
        values = matrix
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or matrix.shape[0] == 0:
        raise MultiPhiValueError(f"{name}: got shape {matrix.shape}, need (n, n)")
    if n is not None and matrix.shape[0] != n:
        raise MultiPhiValueError(f"{name}: got shape {matrix.shape}, need {(n, n)} as the mass has")
    if not np.all(np.isfinite(values)):
        raise MultiPhiValueError(f"{name}: got a value that is NaN or infinite, need finite numbers")
    largest = np.max(np.abs(values), initial=0.0)
    difference = matrix - matrix.T
    asymmetry = np.max(np.abs(difference.data if scipy.sparse.issparse(difference) else difference), initial=0.0)
    if asymmetry > SYMMETRY_TOLERANCE * largest:
        raise MultiPhiValueError(f"{name}: asymmetric by {asymmetry:g}, need a symmetric matrix")
    symmetric = (matrix + matrix.T) / 2
    if not scipy.sparse.issparse(symmetric):
        symmetric.flags.writeable = False
    return symmetric


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


def _point_row(name: str, given: int | np.ndarray, n: int) -> np.ndarray:
    if not isinstance(name, str) or not name:
        raise MultiPhiTypeError(f"points: got the name {name!r}, need a non-empty string")
    if isinstance(given, (int, np.integer)) and not isinstance(given, bool):
        if not 0 <= given < n:
            raise MultiPhiValueError(f"points[{name!r}]: got DoF {given}, need 0 <= DoF < {n}")
        row = np.zeros(n)
        row[given] = 1.0
    else:
        row = _vector(f"points[{name!r}]", given, n)
    row.flags.writeable = False
    return row


def _vector(name: str, given: Any, n: int) -> np.ndarray:
    try:
        vector = np.array(given, dtype=float)
    except (TypeError, ValueError) as error:
        raise MultiPhiTypeError(f"{name}: got {type(given).__name__}, need an ({n},) array") from error
    if vector.shape != (n,):
        raise MultiPhiValueError(f"{name}: got shape {vector.shape}, need ({n},)")
    if not np.all(np.isfinite(vector)):
        raise MultiPhiValueError(f"{name}: got a value that is NaN or infinite, need finite numbers")
    return vector


def _coefficient(name: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float, np.number)) or not np.isfinite(value):
        raise MultiPhiValueError(f"direction[{name!r}]: got {value!r}, need a finite coefficient")
    return float(value)
