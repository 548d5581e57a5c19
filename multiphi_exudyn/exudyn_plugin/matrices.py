"""M, C, K of an Exudyn system at its initial state, checked to be those of a linear structure.

    q = q_0 + S z,   M = S^T M_q S,  C = S^T C_q S,  K = S^T (K_q + K_g) S
    K_g = d(C(q)^T mu)/dq - d(f_loads(q))/dq   at constant mu and constant loads

S (n_full, n) is a basis of the directions that constraints leave free, K_q, C_q are Exudyn's tangents. They do not
contain the factors of a spring of coordinates, so its matrices are computed from its row; nor the geometric stiffness
K_g of constant forces whose lever arms change with the coordinates: of the forces of joints, by the multipliers mu, and
of a weight that acts at another point than a body's reference point. A pendulum has no other stiffness. Constraints of
coordinates and loads on them have none; a load that turns with its body is taken in its present direction.

M is positive definite, K positive semidefinite, and all are symmetric; errors name the coordinate with the largest part
in S z. Directions in which no force can move the system may be left out,

    span Q = span (P, A P, A A P, ...) for A = K and A = C, in coordinates of unit mass

P (n, k) [N, N m] all possible forces: present ones, momenta, contacts and loads. A mass on a compressed spring is
unstable sideways, and a body that spins about one axis has gyroscopic forces about the others. Neither moves in these
directions without a force there, in Exudyn's own run too. The Krylov space is computed in the modes of the symmetric
part of K, where round-off of a stiff mode does not affect a soft one.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import exudyn as exu
import numpy as np
import scipy.linalg
from exudyn.advancedUtilities import NumericalJacobian

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.exudyn_plugin.contacts import coordinate_row
from multiphi_exudyn.exudyn_plugin.items import is_nonlinear_constraint
from multiphi_exudyn.exudyn_plugin.system import (
    Change,
    Directions,
    changed,
    constraint_jacobian,
    coordinate_name,
    generalised_forces,
    largest_coordinate_name,
    mass_matrix,
    object_name,
    static_solver,
)
from multiphi_exudyn.mathematics.modes import Modes, complete_modes
from multiphi_exudyn.mathematics.round_off import drop_round_off

__all__ = [
    "DIFFERENTIATED",
    "UnmovedDirections",
    "check_finite",
    "check_mass",
    "forces",
    "geometric_stiffness",
    "largest_coordinate",
    "matrices_of_moved_directions",
    "moved_directions",
    "projected_matrices",
    "rounded_product",
    "spring_row",
    "springs_with_factors",
    "without_stiffness",
]

FORCE_ROUND_OFF = 1e-12  # of the largest force: a smaller constraint force is round-off
STRAIGHT = ("MassPoint", "Mass1D", "ANCF", "Ground")  # bodies whose points move linearly with the coordinates
ASYMMETRY = 1e-6  # of the largest entry: error of the numerical differentiation of connectors
DIFFERENTIATED = (
    1e-9  # of the largest damping or the fastest mode's critical one: error of the differentiation of forces
)
UNDAMPED = 1e-14  # of the same: smaller damping of a zero-frequency mode is round-off, whatever its coupling
PIVOT = 1e-8  # of the largest pivot of a Cholesky decomposition: below it the eigenvalues decide
MASSLESS = 1e-14  # of the largest eigenvalue of M: round-off of the projection of a coordinate without mass
NEGLIGIBLE = 1e-7  # of a vector, or of the largest of C or omega^2: error of numerical differentiation
RIGID = 1e-12  # of the largest omega^2: a smaller one is round-off
ROUND_OFF = 1e-12  # of a unit direction
SYMMETRISED = 0.005  # of the largest entry: a skew part that is left out; its forces are checked after every run


def geometric_stiffness(mbs: Any) -> np.ndarray:
    """K_g (n_full, n_full) at the initial state, of the constraints and loads that can have one."""
    with static_solver(mbs) as solver:
        stiffness = np.zeros((solver.GetODE2size(), solver.GetODE2size()))
        if any(
            is_nonlinear_constraint(mbs.GetObject(exu.ObjectIndex(i))) for i in range(mbs.systemData.NumberOfObjects())
        ):
            stiffness += _of_constraints(mbs, solver)
        loads = {i: mbs.GetLoad(exu.LoadIndex(i)) for i in range(mbs.systemData.NumberOfLoads())}
        vectors = {i: load["loadVector"] for i, load in loads.items() if _may_turn(mbs, load)}
        return stiffness + _of_loads(mbs, solver, vectors) if vectors else stiffness


def _may_turn(mbs: Any, load: Mapping[str, Any]) -> bool:
    """Whether the generalised force of a load can depend on the coordinates."""
    if load.get("bodyFixed") or not np.any(load.get("loadVector", 0.0)):
        return False
    marker = mbs.GetMarker(exu.MarkerIndex(load["markerNumber"]))
    if "bodyNumber" not in marker or load["loadType"] == "TorqueVector":
        return bool(marker["markerType"] != "NodePosition")
    return not mbs.GetObject(marker["bodyNumber"])["objectType"].startswith(STRAIGHT)


def _of_constraints(mbs: Any, solver: Any) -> np.ndarray:
    mass = mass_matrix(mbs, solver)
    multipliers = _multipliers(mass, constraint_jacobian(mbs, solver), generalised_forces(mbs, solver))
    coordinates = range(len(mass))
    return np.asarray(NumericalJacobian(mbs, lambda: multipliers @ constraint_jacobian(mbs, solver), coordinates))


def _multipliers(mass: np.ndarray, jacobian: np.ndarray, forces: np.ndarray) -> np.ndarray:
    """mu (m,); round-off is set to zero, so that it gives no stiffness."""
    multipliers = Directions(jacobian, mass).multipliers(forces)
    sizes = np.max(np.abs(multipliers[:, None] * jacobian), axis=1, initial=0.0)
    return np.where(sizes > FORCE_ROUND_OFF * np.max(np.abs(forces), initial=0.0), multipliers, 0.0)


def _of_loads(mbs: Any, solver: Any, vectors: Mapping[int, Any]) -> np.ndarray:
    count = range(solver.GetODE2size())
    with_loads = NumericalJacobian(mbs, lambda: generalised_forces(mbs, solver), count)
    changes = [(exu.LoadIndex(i), "loadVector", 0 * np.array(vector), vector) for i, vector in vectors.items()]
    with changed(mbs, changes):
        return np.asarray(NumericalJacobian(mbs, lambda: generalised_forces(mbs, solver), count) - with_loads)


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
        where = f"(omega^2 = {values[0]:.3g} 1/s2), mainly of {largest_coordinate_name(mbs, basis @ vectors[:, 0])}"
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
        where = largest_coordinate_name(mbs, basis @ vectors[:, 0])
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
        where = largest_coordinate_name(mbs, basis[:, bad[0]])
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
    return [object_name(mbs.GetObject(exu.ObjectIndex(i))) for i in indices]


def moved_directions(
    mass: np.ndarray, stiffness: np.ndarray, damping: np.ndarray, forces: np.ndarray
) -> tuple[np.ndarray, np.ndarray] | None:
    """Q (n, m), orthonormal, and U (n, n - m) of unit mass, Q.M U = 0; None if all directions are moved, or none.

    forces (k, n): P^T.
    """
    squares, shapes = scipy.linalg.eigh((stiffness + stiffness.T) / 2, mass)
    fastest = float(np.max(np.abs(squares)))
    squares = np.where(np.abs(squares) <= RIGID * fastest, 0.0, squares)
    skew, modal_damping = shapes.T @ (stiffness - stiffness.T) @ shapes / 2, shapes.T @ damping @ shapes
    systems = [
        np.diag(squares) + _drop_small(skew, NEGLIGIBLE * fastest),
        _drop_small(modal_damping, NEGLIGIBLE * float(np.max(np.abs(modal_damping), initial=0.0))),
    ]
    moved, candidates = np.zeros((len(mass), 0)), shapes.T @ forces.T
    while candidates.shape[1] and moved.shape[1] < len(mass):
        new = _new_directions(moved, candidates)
        moved, candidates = np.hstack([moved, new]), np.hstack([system @ new for system in systems])
    if moved.shape[1] in (0, len(mass)):
        return None
    others = shapes @ scipy.linalg.null_space(moved.T)
    return _drop_small(scipy.linalg.null_space((mass @ others).T), ROUND_OFF), others


def _drop_small(values: np.ndarray, smallest: float) -> np.ndarray:
    return np.where(np.abs(values) > smallest, values, 0.0)


def _new_directions(basis: np.ndarray, candidates: np.ndarray) -> np.ndarray:
    """Orthonormal directions (n, k) of the candidates' columns that are independent of an orthonormal basis."""
    new = basis[:, :0]
    for candidate in candidates.T:
        present, size = np.hstack([basis, new]), float(np.linalg.norm(candidate))
        column = _drop_small(candidate, NEGLIGIBLE * size)
        independent = column - present @ (present.T @ column)
        independent -= present @ (present.T @ independent)
        length = float(np.linalg.norm(independent))
        if length > NEGLIGIBLE * size:
            new = np.hstack([new, _drop_small(independent / length, ROUND_OFF)[:, None]])
    return new


def projected_matrices(mbs: Any) -> tuple[CheckedMatrices, np.ndarray]:
    """M, K, C in z, (n, n), and the basis S, (n_full, n)."""
    mass, stiffness, damping, basis = _tangent_matrices(mbs)
    return checked_matrices(mbs, mass, stiffness, damping, basis, ASYMMETRY), basis


def _tangent_matrices(mbs: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """M, K, C (n, n), and S (n_full, n).

    Entries of K that are round-off of the geometric stiffness, or of a force over the system's size, are set to zero:
    they would be a frequency, or an instability. So are entries of C that are round-off beside the fastest rate.
    """
    springs, geometric = springs_with_factors(mbs), geometric_stiffness(mbs)
    with changed(mbs, without_stiffness(springs)):
        result = mbs.ComputeLinearizedSystem(
            projectIntoConstraintNullspace=True, returnConstraintJacobian=True, returnConstraintNullspace=True
        )
        sizes = np.abs(geometric) + np.max(np.abs(forces(mbs))) / (largest_coordinate(mbs) or math.inf)
    mass, stiffness, damping = (np.array(matrix) for matrix in result[:3])
    basis = np.asarray(result[4]).T if len(result) > 3 else np.eye(len(mass))
    if basis.shape[1] == 0:
        raise MultiPhiValueError("mbs: got constraints that hold every coordinate, need one that can move")
    stiffness += basis.T @ geometric @ basis
    stiffness = drop_round_off(stiffness, np.abs(basis).T @ sizes @ np.abs(basis))
    for item in springs.values():
        row = spring_row(mbs, item) @ basis
        stiffness += item["stiffness"] * np.outer(row, row)
        damping += item["damping"] * np.outer(row, row)
    return mass, stiffness, drop_round_off(damping, _fastest(mass, stiffness) * _masses(mass)), basis


def _masses(mass: np.ndarray) -> np.ndarray:
    """sqrt(m_i m_j) (n, n), the sizes of entries of M."""
    roots = np.sqrt(np.maximum(np.diagonal(mass), 0.0))
    return np.outer(roots, roots)


def _fastest(mass: np.ndarray, stiffness: np.ndarray) -> float:
    """Largest rate sqrt(|k| / m) [1/s] of a coordinate by itself."""
    masses, springs = np.diagonal(mass), np.abs(np.diagonal(stiffness))
    return math.sqrt(float(np.max(springs[masses > 0.0] / masses[masses > 0.0], initial=0.0)))


def spring_row(mbs: Any, spring: Mapping[str, Any]) -> np.ndarray:
    first, second = (coordinate_row(mbs, exu.MarkerIndex(m)) for m in spring["markerNumbers"])
    return np.asarray(spring["factor1"] * second - spring["factor0"] * first)


def rounded_product(matrix: np.ndarray, columns: np.ndarray) -> np.ndarray:
    return drop_round_off(matrix @ columns, np.abs(matrix) @ np.abs(columns))


def matrices_of_moved_directions(
    mbs: Any, velocity: np.ndarray, forces_on_system: np.ndarray
) -> tuple[CheckedMatrices, np.ndarray, UnmovedDirections | None]:
    """M, K, C in z, S, and the directions that are left out.

    velocity (n_full,): at the start, without that of prescribed motions. forces_on_system (k, n_full): all forces that
    may act. If the matrices are not those of a linear structure because
    of directions in which none of these forces moves the system, these directions are left out.
    """
    mass, stiffness, damping, basis = _tangent_matrices(mbs)
    try:
        return checked_matrices(mbs, mass, stiffness, damping, basis, SYMMETRISED), basis, None
    except NotLinearStructure as fault:
        momentum = mass @ (basis.T @ velocity)
        directions = moved_directions(mass, stiffness, damping, np.vstack([momentum, forces_on_system @ basis]))
        if directions is None:
            raise
        moved, others = directions
        unmoved = UnmovedDirections(basis @ others, basis @ mass @ others, fault.reason)
    sizes = np.abs(moved).T @ np.abs(stiffness) @ np.abs(moved)
    mass, stiffness, damping = (moved.T @ matrix @ moved for matrix in (mass, stiffness, damping))
    stiffness, basis = drop_round_off(stiffness, sizes), basis @ moved
    return checked_matrices(mbs, mass, stiffness, damping, basis, SYMMETRISED), basis, unmoved


def largest_coordinate(mbs: Any) -> float:
    """Largest coordinate of the initial state, the reference included [m, rad]."""
    kinds = exu.ConfigurationType
    coordinates = (mbs.systemData.GetODE2Coordinates(kind) for kind in (kinds.Reference, kinds.Initial))
    return float(np.max(np.abs(sum(coordinates))))


def springs_with_factors(mbs: Any) -> dict[int, dict[str, Any]]:
    """Springs of coordinates with factors, which Exudyn's tangent does not contain."""
    items = {i: mbs.GetObject(exu.ObjectIndex(i)) for i in range(mbs.systemData.NumberOfObjects())}
    springs = {i: item for i, item in items.items() if (item.get("factor0", 1.0), item.get("factor1", 1.0)) != (1, 1)}
    springs = {
        i: item for i, item in springs.items() if item.get("activeConnector") and "springForceUserFunction" in item
    }
    for item in springs.values():
        if item["springForceUserFunction"]:
            raise MultiPhiValueError(f"spring {item['name']!r}: got a user function and factors, need one of them")
    return springs


def without_stiffness(springs: Mapping[int, Mapping[str, Any]]) -> list[Change]:
    """Changes that set stiffness and damping of springs to zero."""
    keys = ("stiffness", "damping")
    return [(exu.ObjectIndex(i), key, 0.0, item[key]) for i, item in springs.items() for key in keys]


def forces(mbs: Any, time: float = 0.0) -> np.ndarray:
    """Generalised forces (n_full,) at the initial state and a time [s], without constraint forces."""
    with static_solver(mbs) as solver:
        mbs.systemData.SetTime(time)
        return generalised_forces(mbs, solver)


@dataclass(frozen=True, eq=False)
class UnmovedDirections:
    """Directions that a linearisation leaves out, because no force or motion of the system has a part in them.

    shapes U (n_full, k) of unit mass, momenta M U (n_full, k), reason: why the structure cannot contain them.
    """

    shapes: np.ndarray
    momenta: np.ndarray
    reason: str
