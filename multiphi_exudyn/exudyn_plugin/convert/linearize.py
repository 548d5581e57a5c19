"""Linearisation of an Exudyn system: its (M, C, K) about the current state, and its contacts.

    q = q_0 + S z,   M = S^T M_q S,  C = S^T C_q S,  K = S^T K_q S

q [m, rad, ...] are the system's ODE2 coordinates, q_0 the current ones, S a basis of the directions the
constraints leave free (orthonormal columns, from the constraint Jacobian at q_0), z the coordinates of
the linear structure. The state must be an equilibrium of everything but the contacts and the constraint
forces: a linear structure has no constant force. What a linear structure cannot hold is not looked for
beyond that: user functions and other nonlinear forces enter by their tangent at q_0, loads only by
their geometric stiffness (geometric_stiffness.py).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import exudyn as exu
import numpy as np

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.exudyn_plugin.convert.full_system import initial_is_current
from multiphi_exudyn.exudyn_plugin.convert.geometric_stiffness import (
    generalised_forces,
    geometric_stiffness,
    static_solver,
)
from multiphi_exudyn.exudyn_plugin.convert.linearisation import Linearisation
from multiphi_exudyn.exudyn_plugin.convert.matrix_checks import ASYMMETRY, Checked, UnstableState, checked_matrices
from multiphi_exudyn.exudyn_plugin.convert.point_rows import coordinate_row, default_points, given_points
from multiphi_exudyn.exudyn_plugin.convert.unstable import stable_directions
from multiphi_exudyn.mathematics.round_off import drop_round_off
from multiphi_exudyn.mechanics.arguments import Matrix
from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.damping import ModalDamping, RayleighDamping
from multiphi_exudyn.mechanics.dofs import Place
from multiphi_exudyn.mechanics.structure import LinearStructure

__all__ = ["LinearizedStructure", "linear_structure_from"]

EQUILIBRIUM = 1e-6  # of the largest elastic force: what a static solution leaves unbalanced
SYMMETRISED = 0.005  # of the largest entry: asymmetry that is left out, its forces being looked at after every run
LARGEST = 10_000  # ODE2 coordinates: a dense matrix of them has 0.8 GB
PICOMETRE = 1e-12  # m; a force that moves the stiffest coordinate by less than this is round-off


@dataclass(frozen=True, kw_only=True, repr=False)
class LinearizedStructure(LinearStructure):
    """A linear structure that knows the Exudyn coordinates it came from.

        q = q_0 + S z

    It is a LinearStructure in z, made by ``linear_structure_from`` and ``reduce``. S^T S is the identity, so a matrix A
    in z acts in Exudyn's coordinates as S A S^T.

    Attributes
    ----------
    mass, stiffness : array (n, n)
        M [kg, kg m2] and K [N/m, N m] in z.
    damping : array (n, n), ModalDamping, RayleighDamping or None
        C [N s/m, N m s] in z, or how it is made.
    points : mapping of str to array (n,)
        Displacements of markers and coordinates from q_0, as rows in z.
    dofs : None
        Rows in z have no nodes.
    free : array (n,)
        0 to n - 1: nothing is fixed beside the system's constraints.
    coordinates : array (n_full, n)
        S; a copy, read-only.

    Examples
    --------
    >>> import exudyn as exu
    >>> import exudyn.itemInterface as eii
    >>> import multiphi_exudyn as mp
    >>> from multiphi_exudyn.exudyn_plugin import linear_structure_from, reduce
    >>> container = exu.SystemContainer()
    >>> mbs = container.AddSystem()  # 1 kg on a spring of 4e4 N/m, a stop 1 mm below
    >>> ground = mbs.AddNode(eii.NodePointGround())
    >>> node = mbs.AddNode(eii.Node1D(initialVelocities=[-0.5]))
    >>> mass = mbs.AddObject(eii.ObjectMass1D(name="mass", mass=1.0, nodeNumber=node))
    >>> ends = [
    ...     mbs.AddMarker(eii.MarkerNodeCoordinate(nodeNumber=n, coordinate=0))
    ...     for n in (ground, node)
    ... ]
    >>> spring = mbs.AddObject(
    ...     eii.CoordinateSpringDamper(name="spring", markerNumbers=ends, stiffness=4e4)
    ... )
    >>> data = mbs.AddNode(
    ...     eii.NodeGenericData(initialCoordinates=[1.0], numberOfDataCoordinates=1)
    ... )
    >>> law = {"contactStiffness": 1e6, "offset": -1e-3, "nodeNumber": data}
    >>> stop = mbs.AddObject(
    ...     eii.ObjectContactCoordinate(name="stop", markerNumbers=ends, **law)
    ... )
    >>> mbs.Assemble()
    >>> structure = reduce(mbs).structure
    >>> structure.n, structure.coordinates.shape
    (1, (1, 1))
    """

    coordinates: np.ndarray

    def __post_init__(self, fixed: Iterable[Place]) -> None:
        super().__post_init__(fixed)
        coordinates = np.array(self.coordinates, dtype=float)
        if coordinates.ndim != 2 or coordinates.shape[1] != self.n:
            raise MultiPhiValueError(f"coordinates: got shape {coordinates.shape}, need (n_full, {self.n})")
        coordinates.flags.writeable = False
        object.__setattr__(self, "coordinates", coordinates)


def linear_structure_from(
    mbs: Any,
    points: Mapping[str, Any] | None = None,
    damping: Matrix | ModalDamping | RayleighDamping | None = None,
) -> tuple[LinearizedStructure, tuple[UnilateralContact, ...]]:
    """Linearise an assembled Exudyn system about its current state; the system is left as it was.

        q = q_0 + S z,   M = S^T M_q S,  C = S^T C_q S,  K = S^T K_q S

    q are the system's ODE2 coordinates, q_0 the current ones, S a basis of the directions that constraints leave free.
    The state must be an equilibrium of everything but the contacts and the constraint forces: a linear structure has no
    constant force (``reduce`` takes any state). User functions and other nonlinear forces enter by their tangent at
    q_0.

    Parameters
    ----------
    mbs : exudyn.MainSystem
        Assembled.
    points : mapping, default None
        Name to marker index, or to (node index, coordinate number). A marker of one coordinate gives the point
        ``name``; a marker with a position gives ``name.x``, ``name.y``, ``name.z``, a marker of several coordinates
        ``name.0``, ``name.1``, ... None: every marker by its own name, and every node coordinate as ``<node
        name>.<coordinate number>``; those that cannot move are left out.
    damping : array (n, n), ModalDamping, RayleighDamping or None, default None
        In the coordinates z, or by ratios; None takes what the system's own dampers give.

    Returns
    -------
    structure : LinearizedStructure
        M, C, K, the points and S.
    contacts : tuple of UnilateralContact
        One for every active ObjectContactCoordinate, with its name, row, gap [m] in the current state and stiffness
        [N/m]; none of them is part of K.

    Raises
    ------
    MultiPhiTypeError
        For points of another kind.
    MultiPhiValueError
        For a system that is not assembled or not of second order, a state that is no equilibrium, and a contact or a
        matrix that a linear structure cannot hold.

    Examples
    --------
    >>> import exudyn as exu
    >>> import exudyn.itemInterface as eii
    >>> import multiphi_exudyn as mp
    >>> from multiphi_exudyn.exudyn_plugin import linear_structure_from, reduce
    >>> container = exu.SystemContainer()
    >>> mbs = container.AddSystem()  # 1 kg on a spring of 4e4 N/m, a stop 1 mm below
    >>> ground = mbs.AddNode(eii.NodePointGround())
    >>> node = mbs.AddNode(eii.Node1D(initialVelocities=[-0.5]))
    >>> mass = mbs.AddObject(eii.ObjectMass1D(name="mass", mass=1.0, nodeNumber=node))
    >>> ends = [
    ...     mbs.AddMarker(eii.MarkerNodeCoordinate(nodeNumber=n, coordinate=0))
    ...     for n in (ground, node)
    ... ]
    >>> spring = mbs.AddObject(
    ...     eii.CoordinateSpringDamper(name="spring", markerNumbers=ends, stiffness=4e4)
    ... )
    >>> data = mbs.AddNode(
    ...     eii.NodeGenericData(initialCoordinates=[1.0], numberOfDataCoordinates=1)
    ... )
    >>> law = {"contactStiffness": 1e6, "offset": -1e-3, "nodeNumber": data}
    >>> stop = mbs.AddObject(
    ...     eii.ObjectContactCoordinate(name="stop", markerNumbers=ends, **law)
    ... )
    >>> mbs.Assemble()
    >>> structure, contacts = linear_structure_from(mbs, points={"mass": (node, 0)})
    >>> contacts[0].name, contacts[0].gap
    ('stop', 0.001)
    """
    check_system(mbs)
    objects = _contact_objects(mbs)
    with initial_is_current(mbs):
        gaps = [_gap(mbs, index) for index in objects]
        with _inactive(mbs, objects):
            found, basis, _ = projected_matrices(mbs)
            _check_equilibrium(mbs, found.stiffness, basis)
        rows = default_points(mbs, basis) if points is None else given_points(mbs, points, basis)
        contacts = tuple(_contact(mbs, index, gap, basis) for index, gap in zip(objects, gaps, strict=True))
    if damping is None and np.any(found.damping):
        damping = found.damping
    structure = LinearizedStructure(found.mass, found.stiffness, damping, rows, coordinates=basis)
    return structure, contacts


def check_system(mbs: Any) -> None:
    if not isinstance(mbs, exu.MainSystem):
        raise MultiPhiTypeError(f"mbs: got {type(mbs).__name__}, need an exudyn.MainSystem")
    if not mbs.systemIsConsistent:
        raise MultiPhiValueError("mbs: got a system that is not assembled, need mbs.Assemble() before")
    count = len(mbs.systemData.GetODE2Coordinates())
    if not 0 < count <= LARGEST:
        raise MultiPhiValueError(
            f"mbs: got {count} ODE2 coordinates, need 1 to {LARGEST} (its matrices are dense; give larger ones of a "
            "finite element program to mp.LinearStructure)"
        )
    if len(mbs.systemData.GetODE1Coordinates()) > 0:
        items = (mbs.GetObject(exu.ObjectIndex(i)) for i in range(mbs.systemData.NumberOfObjects()))
        first = ", ".join(
            f"Object{item['objectType']} {item['name']!r}" for item in items if _has_first_order(mbs, item)
        )
        raise MultiPhiValueError(f"mbs: got ODE1 coordinates ({first}), need a system of second order only")
    if mbs.NumberOfGeneralContacts() > 0:
        raise MultiPhiValueError(
            "mbs: got a GeneralContact, whose pairs change, need contacts as items: ObjectContactCoordinate or "
            "ObjectContactSphereSphere"
        )


def _has_first_order(mbs: Any, item: Mapping[str, Any]) -> bool:
    """Whether a node of an object has coordinates of first order."""
    nodes = [int(n) for n in (*item.get("nodeNumbers", ()), item.get("nodeNumber", -1))]
    return any("ODE1" in mbs.GetNode(exu.NodeIndex(n))["nodeType"] for n in nodes if n >= 0)


def _contact_objects(mbs: Any) -> list[Any]:
    """Indices of the active contacts; raises for one that is not a unilateral spring of one coordinate."""
    found = []
    for i in range(mbs.systemData.NumberOfObjects()):
        index = exu.ObjectIndex(i)
        item = mbs.GetObject(index)
        if not item["objectType"].startswith("Contact") or not item["activeConnector"]:
            continue
        if item["objectType"] != "ContactCoordinate":
            raise MultiPhiValueError(
                f"contact {item['name']!r}: got Object{item['objectType']}, need ObjectContactCoordinate"
            )
        _check_law(item)
        found.append(index)
    return found


def _check_law(item: Mapping[str, Any]) -> None:
    needed = {"contactDamping": 0.0, "contactStiffnessExponent": 1.0, "impactModel": 0}
    for name, value in needed.items():
        if item[name] != value:
            raise MultiPhiValueError(
                f"contact {item['name']!r} {name}: got {item[name]!r}, need {value!r} (a linear spring)"
            )


@contextmanager
def _inactive(mbs: Any, objects: list[Any]) -> Iterator[None]:
    """Switch the contacts off and, whatever happens, on again."""
    try:
        for index in objects:
            mbs.SetObjectParameter(index, "activeConnector", False)
        yield
    finally:
        for index in objects:
            mbs.SetObjectParameter(index, "activeConnector", True)


def projected_matrices(
    mbs: Any, allowed: float = ASYMMETRY, pushes: np.ndarray | None = None
) -> tuple[Checked, np.ndarray, str]:
    """M, K, C in z, (n, n), the basis S, (n_full, n), and an instability that is held; allowed: ``checked_matrices``.

    pushes (k, n_full): what may move the system, where an unstable direction is held if none of them does.

    What is round-off of the stiffness that forces give, or of a force over the system's size, is none: it would be a
    frequency, or an instability.
    """
    geared, geometric = _geared_springs(mbs), geometric_stiffness(mbs)
    with _slack(mbs, geared):
        result = mbs.ComputeLinearizedSystem(
            projectIntoConstraintNullspace=True, returnConstraintJacobian=True, returnConstraintNullspace=True
        )
        sizes = np.abs(geometric) + np.max(np.abs(forces(mbs))) / (_largest_coordinate(mbs) or math.inf)
    mass, stiffness, damping = (np.array(matrix) for matrix in result[:3])
    basis = np.asarray(result[4]).T if len(result) > 3 else np.eye(len(mass))
    if basis.shape[1] == 0:
        raise MultiPhiValueError("mbs: got constraints that hold every coordinate, need one that can move")
    stiffness += basis.T @ geometric @ basis
    stiffness = drop_round_off(stiffness, np.abs(basis).T @ sizes @ np.abs(basis))
    for item in geared.values():
        first, second = (coordinate_row(mbs, exu.MarkerIndex(m)) for m in item["markerNumbers"])
        row = (item["factor1"] * second - item["factor0"] * first) @ basis
        stiffness += item["stiffness"] * np.outer(row, row)
        damping += item["damping"] * np.outer(row, row)
    try:
        return checked_matrices(mbs, mass, stiffness, damping, basis, allowed), basis, ""
    except UnstableState as unstable:
        if pushes is None:
            raise
        momentum = mass @ (basis.T @ mbs.systemData.GetODE2Coordinates_t(exu.ConfigurationType.Initial))
        kept = stable_directions(mass, stiffness, damping, np.vstack([momentum, pushes @ basis]))
        if kept is None:
            raise
        mass, stiffness, damping = (kept.T @ matrix @ kept for matrix in (mass, stiffness, damping))
        basis = basis @ kept
        return checked_matrices(mbs, mass, stiffness, damping, basis, allowed), basis, unstable.where


def linearised(mbs: Any, time: float, pushes: Sequence[np.ndarray]) -> Linearisation:
    """The system about its initial state, at a time [s], without contacts and loads by functions of time.

    pushes: rows (n_full,) of these contacts and loads.
    """
    data, initial = mbs.systemData, exu.ConfigurationType.Initial
    displacement, velocity = data.GetODE2Coordinates(initial), data.GetODE2Coordinates_t(initial)
    found, basis, held = projected_matrices(mbs, SYMMETRISED, np.vstack([forces(mbs, time), *pushes]))
    mass, stiffness, damping = found.mass, found.stiffness, found.damping
    static = basis.T @ forces(mbs, time) + damping @ (basis.T @ velocity)
    largest = _largest_coordinate(mbs)
    return Linearisation(
        mass, damping, stiffness, static, basis, displacement, velocity, time, largest, found.told, held
    )


def _largest_coordinate(mbs: Any) -> float:
    """Of the system at its initial state, where it stands [m, rad]."""
    kinds = exu.ConfigurationType
    places = (mbs.systemData.GetODE2Coordinates(kind) for kind in (kinds.Reference, kinds.Initial))
    return float(np.max(np.abs(sum(places))))


def _geared_springs(mbs: Any) -> dict[int, dict[str, Any]]:
    """Springs of coordinates with factors, of which Exudyn's tangent does not hold the factors."""
    items = {i: mbs.GetObject(exu.ObjectIndex(i)) for i in range(mbs.systemData.NumberOfObjects())}
    geared = {i: item for i, item in items.items() if (item.get("factor0", 1.0), item.get("factor1", 1.0)) != (1, 1)}
    geared = {
        i: item for i, item in geared.items() if item.get("activeConnector") and "springForceUserFunction" in item
    }
    for item in geared.values():
        if item["springForceUserFunction"]:
            raise MultiPhiValueError(f"spring {item['name']!r}: got a user function and factors, need one of both")
    return geared


@contextmanager
def _slack(mbs: Any, springs: Mapping[int, Mapping[str, Any]]) -> Iterator[None]:
    """Take stiffness and damping from springs and, whatever happens, give them back."""
    try:
        for i in springs:
            for name in ("stiffness", "damping"):
                mbs.SetObjectParameter(exu.ObjectIndex(i), name, 0.0)
        yield
    finally:
        for i, item in springs.items():
            for name in ("stiffness", "damping"):
                mbs.SetObjectParameter(exu.ObjectIndex(i), name, item[name])


def _check_equilibrium(mbs: Any, stiffness: np.ndarray, basis: np.ndarray) -> None:
    unbalanced = np.abs(basis @ (basis.T @ forces(mbs)))  # what constraint forces cannot balance
    elastic = np.max(np.abs(stiffness) @ np.abs(basis.T @ mbs.systemData.GetODE2Coordinates()))
    if np.max(unbalanced) > EQUILIBRIUM * elastic + PICOMETRE * np.max(np.abs(stiffness)):
        raise MultiPhiValueError(
            f"mbs: its state without contacts is out of balance by {np.max(unbalanced):g} N (or N m), need "
            "an equilibrium with open contacts: take loads off, or solve the static problem first"
        )


def forces(mbs: Any, time: float = 0.0) -> np.ndarray:
    """Generalised forces at the initial state and a time [s], constraint forces left out, (n_full,)."""
    with static_solver(mbs) as solver:
        mbs.systemData.SetTime(time)
        return generalised_forces(mbs, solver)


def _contact(mbs: Any, index: Any, gap: float, basis: np.ndarray) -> UnilateralContact:
    item = mbs.GetObject(index)
    first, second = (coordinate_row(mbs, exu.MarkerIndex(m)) @ basis for m in item["markerNumbers"])
    return UnilateralContact(item["name"], second - first, gap, float(item["contactStiffness"]))


def _gap(mbs: Any, index: Any) -> float:
    return float(mbs.GetObjectOutput(index, exu.OutputVariableType.Distance))
