"""Checks that the matrices of an Exudyn system are those of a linear structure; errors name the coordinates concerned.

M is positive definite, K positive semidefinite, and all are symmetric, in z with q = q_0 + S z; S (n_full, n). The
coordinate with the largest part in S z names the cause: by its node, its number there and the bodies of that node.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import exudyn as exu
import numpy as np
import scipy.linalg

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.mathematics.eigenproblems.modes import Modes, complete_modes

__all__ = [
    "ASYMMETRY",
    "DIFFERENTIATED",
    "CheckedMatrices",
    "NotLinearStructure",
    "check_mass",
    "checked_matrices",
    "coordinate_name",
]

ASYMMETRY = 1e-6  # of the largest entry: error of the numerical differentiation of connectors
DIFFERENTIATED = (
    1e-9  # of the largest damping or the fastest mode's critical one: error of the differentiation of forces
)
UNDAMPED = 1e-14  # of the same: smaller damping of a zero-frequency mode is round-off, whatever its coupling
PIVOT = 1e-8  # of the largest pivot of a Cholesky decomposition: below it the eigenvalues decide
MASSLESS = 1e-14  # of the largest eigenvalue of M: round-off of the projection of a coordinate without mass


class NotLinearStructure(MultiPhiValueError):
    """Error for matrices that some directions make unsuitable; reason: the fault of these directions, and where."""

    def __init__(self, message: str, reason: str) -> None:
        super().__init__(message)
        self.reason = reason


@dataclass(frozen=True)
class CheckedMatrices:
    """M, K, C (n, n), exactly symmetric; asymmetries: a sentence for each matrix that was not."""

    mass: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    asymmetries: tuple[str, ...]


def checked_matrices(
    mbs: Any, mass: np.ndarray, stiffness: np.ndarray, damping: np.ndarray, basis: np.ndarray, allowed: float
) -> CheckedMatrices:
    """Return the matrices, made symmetric; raise MultiPhiValueError with names of items and coordinates.

    allowed: asymmetry of stiffness and damping relative to the largest entry; of damping also as a ratio to critical
    damping.
    """
    asymmetries: list[str] = []
    for name, matrix in (("mass", mass), ("stiffness", stiffness), ("damping", damping)):
        check_finite(mbs, name, matrix, basis)
    _check_positive(mbs, mass, basis)
    mass = _symmetric(mbs, "mass", mass, basis, ASYMMETRY, asymmetries)
    stiffness = _symmetric(mbs, "stiffness", stiffness, basis, allowed, asymmetries)
    try:
        modes = complete_modes(mass, stiffness)
    except MultiPhiValueError as error:
        values, vectors = scipy.linalg.eigh(stiffness, mass, subset_by_index=[0, 0])
        where = f"(omega^2 = {values[0]:.3g} 1/s2), mainly of {_largest_coordinate_name(mbs, basis @ vectors[:, 0])}"
        raise NotLinearStructure(
            f"stiffness: got a negative eigenvalue {where}, need a stable state, or a constraint there",
            f"one of them unstable {where}",
        ) from error
    damping = _symmetric(mbs, "damping", damping, basis, allowed, asymmetries, _critical(damping, modes))
    return CheckedMatrices(mass, stiffness, _damping(damping, mass, modes), tuple(asymmetries))


def check_mass(mbs: Any, mass: np.ndarray, basis: np.ndarray) -> None:
    """Raise MultiPhiValueError for a mass M (n_full, n_full) that is not positive definite in the directions S."""
    projected = basis.T @ mass @ basis
    try:
        pivots = np.diagonal(np.linalg.cholesky(projected)) ** 2
    except np.linalg.LinAlgError:
        pivots = np.zeros(len(projected))
    if np.min(pivots, initial=np.inf) <= PIVOT * np.max(pivots, initial=0.0):
        _check_positive(mbs, projected, basis)


def _check_positive(mbs: Any, mass: np.ndarray, basis: np.ndarray) -> None:
    values, vectors = scipy.linalg.eigh(mass)
    if values[0] <= MASSLESS * values[-1]:
        where = _largest_coordinate_name(mbs, basis @ vectors[:, 0])
        share = values[0] / values[-1] if values[-1] > 0 else 0.0
        raise MultiPhiValueError(
            f"mass: got {_kind(values[0], values[-1])} mass at {where} ({share:.1g} of the largest), "
            f"need more than {MASSLESS:g} of the largest, as by a small mass there (a millionth of its neighbours' "
            "changes the motion by as little), or a constraint that holds this coordinate; matrices alone are "
            "condensed exactly by condensed_structure(M, K), M, K, C = mbs.ComputeLinearizedSystem()"
        )


def check_finite(mbs: Any, name: str, matrix: np.ndarray, basis: np.ndarray) -> None:
    """Raise MultiPhiValueError for a matrix (n, n) in the coordinates of S with an entry that is not finite."""
    bad = np.flatnonzero(~np.all(np.isfinite(matrix), axis=1))
    if len(bad):
        where = _largest_coordinate_name(mbs, basis[:, bad[0]])
        raise MultiPhiValueError(
            f"{name}: got an entry that is not a finite number, first at {where}, need finite forces and a finite "
            "tangent in this state"
        )


def _kind(lowest: float, largest: float) -> str:
    return "a negative" if lowest < -MASSLESS * largest else "no"


def _critical(damping: np.ndarray, modes: Modes) -> float:
    """Largest entry of the modal skew part, as a ratio to critical damping of the faster mode of the two."""
    forces = np.abs(modes.shapes.T @ (damping - damping.T) @ modes.shapes) / 2
    faster = 2 * np.maximum.outer(modes.omega, modes.omega)
    ratios = np.divide(forces, faster, out=np.where(forces > 0, math.inf, 0.0), where=faster > 0)
    return float(np.max(ratios, initial=0.0))


def _damping(damping: np.ndarray, mass: np.ndarray, modes: Modes) -> np.ndarray:
    """Symmetric damping matrix (n, n) without round-off of numerical differentiation.

    Round-off is negative damping, and damping of zero-frequency modes that have no other.
    """
    modal = modes.shapes.T @ damping @ modes.shapes
    largest = max(np.max(np.abs(np.linalg.eigvalsh(modal))), 2 * np.max(modes.omega))
    undamped = (modes.omega == 0) & (np.abs(np.diagonal(modal)) <= UNDAMPED * largest)
    undamped &= np.max(np.abs(modal), axis=1) <= 10 * DIFFERENTIATED * largest
    modal[undamped], modal[:, undamped] = 0.0, 0.0
    values, vectors = np.linalg.eigh(modal)
    negative = -DIFFERENTIATED * largest <= values[0] < 0
    if not negative and not np.any(undamped):
        return damping
    momenta = mass @ modes.shapes @ vectors
    cleaned: np.ndarray = (momenta * (np.maximum(values, 0.0) if negative else values)) @ momenta.T
    return (cleaned + cleaned.T) / 2


def _symmetric(
    mbs: Any,
    name: str,
    matrix: np.ndarray,
    basis: np.ndarray,
    allowed: float,
    asymmetries: list[str],
    critical: float = math.inf,
) -> np.ndarray:
    """Symmetric part of a matrix; a sentence about a skew part is added to ``asymmetries``.

    critical: of a damping matrix, its skew part as a ratio to critical damping.
    """
    skew = matrix - matrix.T
    asymmetry = float(np.max(np.abs(skew)) / (np.max(np.abs(matrix)) or 1.0))
    if asymmetry > ASYMMETRY:
        full = np.abs(basis @ skew @ basis.T)
        first, second = (int(i) for i in np.unravel_index(np.argmax(full), full.shape))
        entries = f"between {coordinate_name(mbs, first)} and {coordinate_name(mbs, second)}"
        acting = ", ".join(_objects_with(mbs, {first, second})) or "none"
        where = f"{entries}, on both of which act: {acting}"
        if min(asymmetry, critical) > allowed:
            raise NotLinearStructure(
                f"mbs: its {name} matrix is not symmetric (follower or gyroscopic forces?), got entries that differ by "
                f"{asymmetry:.2g} of the largest {where}; need a symmetric one",
                f"with them its {name} matrix is not symmetric {entries}",
            )
        ratio = f" (a ratio to critical damping of {critical:.2g})" if critical < math.inf else ""
        asymmetries.append(f"{name} matrix, of which entries differ by {asymmetry:.2g} of the largest{ratio} {where}")
    return (matrix + matrix.T) / 2


def _objects_with(mbs: Any, coordinates: set[int]) -> list[str]:
    """Names of the objects that have all of these ODE2 coordinates."""
    count = mbs.systemData.NumberOfObjects()
    indices = [i for i in range(count) if coordinates <= set(mbs.systemData.GetObjectLTGODE2(exu.ObjectIndex(i)))]
    return [_object_name(mbs.GetObject(exu.ObjectIndex(i))) for i in indices]


def _object_name(item: Any) -> str:
    return f"Object{item['objectType']} {item['name']!r}"


def _largest_coordinate_name(mbs: Any, vector: np.ndarray) -> str:
    return coordinate_name(mbs, int(np.argmax(np.abs(vector))))


def coordinate_name(mbs: Any, index: int) -> str:
    """Name of an ODE2 coordinate of the system: "coordinate 1 of node 'n' (ObjectMassPoint2D 'bob')"."""
    for i in range(mbs.systemData.NumberOfNodes()):
        node = mbs.GetNode(exu.NodeIndex(i))
        if not {"initialVelocities", "initialCoordinates_t"} & node.keys():  # no node with ODE2 coordinates
            continue
        first, count = mbs.GetNodeODE2Index(exu.NodeIndex(i)), len(node["initialCoordinates"])
        if first <= index < first + count:
            bodies = ", ".join(_bodies(mbs, i))
            return f"coordinate {index - first} of node {node['name']!r}" + (f" ({bodies})" if bodies else "")
    return f"coordinate {index} of the system"


def _bodies(mbs: Any, node: int) -> list[str]:
    items = [mbs.GetObject(exu.ObjectIndex(i)) for i in range(mbs.systemData.NumberOfObjects())]
    bodies = [item for item in items if node in [int(n) for n in item.get("nodeNumbers", [item.get("nodeNumber", -1)])]]
    return [_object_name(item) for item in bodies]
