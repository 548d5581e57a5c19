"""Linearisation of an Exudyn system in equilibrium: its (M, C, K) about the current state, and its contacts.

    q = q_0 + S z,   M = S^T M_q S,  C = S^T C_q S,  K = S^T K_q S

q [m, rad, ...] are the system's ODE2 coordinates, q_0 the current ones, S a basis of the directions the constraints
leave free (orthonormal columns, from the constraint Jacobian at q_0), z the coordinates of the linear structure. The
state must be an equilibrium of all forces but those of contacts and constraints, as a linear structure has no constant
force; ``reduce`` accepts any state. Nonlinearities are not searched for beyond that: user functions and other nonlinear
forces enter by their tangent at q_0, loads only by their geometric stiffness (matrices.py).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import exudyn as exu
import numpy as np

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.exudyn_plugin.contacts import contact_distance, contacts_of, default_points, requested_points
from multiphi_exudyn.exudyn_plugin.items import has_own_coordinates, is_active, is_contact
from multiphi_exudyn.exudyn_plugin.matrices import forces, projected_matrices
from multiphi_exudyn.exudyn_plugin.start_state import violated_constraints
from multiphi_exudyn.exudyn_plugin.system import initial_is_current, without_contacts
from multiphi_exudyn.mechanics.arguments import Matrix
from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.damping import ModalDamping, RayleighDamping
from multiphi_exudyn.mechanics.dofs import Place
from multiphi_exudyn.mechanics.structure import LinearStructure

__all__ = ["LinearizedStructure", "check_system", "linear_structure_from"]

EQUILIBRIUM = 1e-6  # of the largest elastic force: residual of a static solution
LARGEST = 10_000  # ODE2 coordinates: a dense matrix of them has 0.8 GB
PICOMETRE = 1e-12  # m; a force that moves the stiffest coordinate by less than this is round-off


@dataclass(frozen=True, kw_only=True, repr=False)
class LinearizedStructure(LinearStructure):
    """A linear structure with its relation to the coordinates of an Exudyn system.

        q = q_0 + S z

    It is a LinearStructure in z, from ``linear_structure_from`` or ``reduce``. S^T S is the identity, so a matrix A
    in z acts in Exudyn's coordinates as S A S^T.

    Attributes
    ----------
    mass, stiffness : array (n, n)
        M [kg, kg m2] and K [N/m, N m] in z.
    damping : array (n, n), ModalDamping, RayleighDamping or None
        C [N s/m, N m s] in z, or its definition by ratios.
    points : mapping of str to array (n,)
        Displacements of markers and coordinates from q_0, as rows in z.
    dofs : None
        Rows in z have no nodes.
    free : array (n,)
        0 to n - 1: nothing is fixed but by the system's constraints.
    coordinates : array (n_full, n)
        S; a copy, read-only.
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
    The state must be an equilibrium of all forces but those of contacts and constraints, as a linear structure has no
    constant force (``reduce`` accepts any state). User functions and other nonlinear forces enter by their tangent at
    q_0; motions that constraints prescribe are held at q_0.

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
        For a system that is not assembled, not of second order or with joints that slide along cables, a state that is
        not an equilibrium or violates constraints, and a contact or a matrix that a linear structure cannot have.

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
    objects = _contacts(mbs)
    with initial_is_current(mbs):
        violated = violated_constraints(mbs)
        if violated:
            raise MultiPhiValueError(
                f"mbs: its state violates constraints ({', '.join(violated)}), need a state that meets them: solve the "
                "static problem first"
            )
        gaps = {i: contact_distance(mbs, i, item) for i, item in objects.items()}
        with without_contacts(mbs, objects):
            matrices, basis = projected_matrices(mbs)
            _check_equilibrium(mbs, matrices.stiffness, basis)
        rows = default_points(mbs, basis) if points is None else requested_points(mbs, points, basis)
        full = [contact for i, item in objects.items() for contact in contacts_of(mbs, i, item, gaps[i])]
        contacts = tuple(replace(contact, direction=np.asarray(contact.direction) @ basis) for contact in full)
    if damping is None and np.any(matrices.damping):
        damping = matrices.damping
    structure = LinearizedStructure(matrices.mass, matrices.stiffness, damping, rows, coordinates=basis)
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
        first = ", ".join(
            f"Object{item['objectType']} {item['name']!r}" for item in _objects(mbs) if _has_first_order(mbs, item)
        )
        raise MultiPhiValueError(f"mbs: got ODE1 coordinates ({first}), need a system of second order only")
    sliding = [f"Object{item['objectType']} {item['name']!r}" for item in _objects(mbs) if has_own_coordinates(item)]
    if sliding:
        raise MultiPhiValueError(
            f"mbs: got joints that slide along cables by a coordinate of their own ({', '.join(sliding)}), need joints "
            "at fixed places, or activeConnector=False"
        )
    if mbs.NumberOfGeneralContacts() > 0:
        raise MultiPhiValueError(
            "mbs: got a GeneralContact, whose pairs change, need contacts as items: ObjectContactCoordinate or "
            "ObjectContactSphereSphere"
        )


def _objects(mbs: Any) -> Iterator[Mapping[str, Any]]:
    return (mbs.GetObject(exu.ObjectIndex(i)) for i in range(mbs.systemData.NumberOfObjects()))


def _has_first_order(mbs: Any, item: Mapping[str, Any]) -> bool:
    """Whether a node of an object has coordinates of first order."""
    nodes = [int(n) for n in (*item.get("nodeNumbers", ()), item.get("nodeNumber", -1))]
    return any("ODE1" in mbs.GetNode(exu.NodeIndex(n))["nodeType"] for n in nodes if n >= 0)


def _contacts(mbs: Any) -> dict[int, Mapping[str, Any]]:
    """Active contacts by index; raise for one that is not a unilateral spring of one coordinate."""
    contacts = {i: item for i, item in enumerate(_objects(mbs)) if is_contact(item) and is_active(item)}
    for item in contacts.values():
        if item["objectType"] != "ContactCoordinate":
            raise MultiPhiValueError(
                f"contact {item['name']!r}: got Object{item['objectType']}, need ObjectContactCoordinate"
            )
        _check_law(item)
    return contacts


def _check_law(item: Mapping[str, Any]) -> None:
    needed = {"contactDamping": 0.0, "contactStiffnessExponent": 1.0, "impactModel": 0}
    for name, value in needed.items():
        if item[name] != value:
            raise MultiPhiValueError(
                f"contact {item['name']!r} {name}: got {item[name]!r}, need {value!r} (a linear spring)"
            )


def _check_equilibrium(mbs: Any, stiffness: np.ndarray, basis: np.ndarray) -> None:
    unbalanced = np.abs(basis @ (basis.T @ forces(mbs)))  # by constraint forces
    elastic = np.max(np.abs(stiffness) @ np.abs(basis.T @ mbs.systemData.GetODE2Coordinates()))
    if np.max(unbalanced) > EQUILIBRIUM * elastic + PICOMETRE * np.max(np.abs(stiffness)):
        raise MultiPhiValueError(
            f"mbs: its state without contacts is out of balance by {np.max(unbalanced):g} N (or N m), need "
            "an equilibrium with open contacts: take loads off, or solve the static problem first"
        )
