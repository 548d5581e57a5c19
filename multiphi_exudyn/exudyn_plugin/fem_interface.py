"""A finite element model in Exudyn's FEMinterface (from Abaqus, Ansys, NGsolve) as a linear structure.

    M_free x'' + C x' + K_free x = f,   x the displacements [m] of the nodes that are not fixed

The matrices of a FEMinterface have no supports; degree of freedom 3 i + c is component c (0, 1, 2 for x, y, z) of
node i, nodes counted from 0; "ux", "uy", "uz" are names of the components. The structure has no fixed nodes; its
matrices are sparse.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, TypeAlias

import numpy as np
import scipy.sparse

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.mechanics.arguments import Matrix, one_of
from multiphi_exudyn.mechanics.damping import ModalDamping, RayleighDamping
from multiphi_exudyn.mechanics.dofs import COMPONENTS as NAMES
from multiphi_exudyn.mechanics.dofs import DofTable
from multiphi_exudyn.mechanics.structure import LinearStructure

__all__ = ["linear_structure_from_fem"]

COMPONENTS = 3  # of the displacement of a node
IN_LINE = 1e-9  # of the largest moment of inertia: with a smaller one about an axis, all nodes lie on it

Nodes: TypeAlias = "int | str"  # a node, or the name of a node set


def linear_structure_from_fem(
    fem: Any,
    fixed: Iterable[int] | str = (),
    points: Mapping[str, tuple[Nodes, int | str]] | None = None,
    damping: Matrix | ModalDamping | RayleighDamping | None = None,
) -> LinearStructure:
    """A finite element model in Exudyn's FEMinterface (from Abaqus, Ansys, NGsolve) as a linear structure.

        M_free x'' + C x' + K_free x = f,   x the displacements [m] of the nodes that are not fixed

    The mean rotation of a node set, for a RigidInterface, is theta = (sum w (r.r 1 - r r^T))^-1 sum w r x u by least
    squares, r from the mean of the nodes.

    Degree of freedom 3 i + c is component c (0, 1, 2 for x, y, z) of node i, nodes counted from 0. The matrices stay
    sparse; the FEMinterface is left as it was.

    Parameters
    ----------
    fem : exudyn.FEM.FEMinterface
        With nodes, massMatrix and stiffnessMatrix.
    fixed : iterable of int, or str, default ()
        Node numbers, or the name of a node set.
    points : mapping of str to (int or str, int or str), default None
        Name to (node number, component), 0 to 2 or "ux", "uy" and "uz"; with the name of a node set the mean of its
        nodes by their weights, for a contact or a load over a face; 3 to 5, or "rx", "ry" and "rz", of a
        node set its mean rotation.
    damping : array (n, n), ModalDamping, RayleighDamping or None, default None
        In the free degrees of freedom.

    Returns
    -------
    LinearStructure
        Sparse, without the fixed nodes; its ``dofs`` are the remaining degrees of freedom.

    Raises
    ------
    MultiPhiTypeError
        For an argument that is not a FEMinterface, matrices that are missing, and nodes or points of another kind.
    MultiPhiValueError
        For matrices that do not fit the nodes, nodes, sets and components that do not exist, and a point that is
        fixed.

    Examples
    --------
    Two nodes with a spring along x between them, the first one fixed:

    >>> import numpy as np
    >>> import scipy.sparse
    >>> from exudyn.FEM import FEMinterface
    >>> from multiphi_exudyn.exudyn_plugin import linear_structure_from_fem
    >>> fem = FEMinterface()
    >>> fem.nodes = {"Position": np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]])}
    >>> fem.massMatrix = scipy.sparse.eye_array(6, format="csr")
    >>> K = 4e4 * np.kron([[1, -1], [-1, 1]], np.diag([1, 0, 0]))
    >>> fem.stiffnessMatrix = scipy.sparse.csr_array(K)
    >>> linear_structure_from_fem(fem, fixed=[0], points={"tip": (1, 0)})
    <LinearStructure: degrees of freedom 3; matrices sparse; damping none; points tip>
    """
    mass, stiffness = _matrices(fem)
    fixed_nodes = _fixed_nodes(fem, fixed, mass.shape[0] // COMPONENTS)
    moving = np.ones((mass.shape[0] // COMPONENTS, COMPONENTS), bool)
    moving[fixed_nodes] = False
    free = np.flatnonzero(moving)
    rows = {name: _row(fem, name, point, moving) for name, point in ({} if points is None else points).items()}
    dofs = DofTable(tuple((int(dof) // COMPONENTS, NAMES[dof % COMPONENTS]) for dof in free))
    return LinearStructure(mass[free][:, free], stiffness[free][:, free], damping, rows, dofs=dofs)


def _matrices(fem: Any) -> tuple[Any, Any]:
    nodes = getattr(fem, "nodes", None)
    if not isinstance(nodes, Mapping):
        raise MultiPhiTypeError(f"fem: got {type(fem).__name__}, need an exudyn.FEM.FEMinterface")
    if list(nodes) != ["Position"]:
        raise MultiPhiValueError(f"fem: got nodes of the types {list(nodes)}, need ['Position']")
    size = COMPONENTS * len(nodes["Position"])
    for name in ("massMatrix", "stiffnessMatrix"):
        matrix: Any = getattr(fem, name, None)
        if not scipy.sparse.issparse(matrix):
            raise MultiPhiTypeError(f"fem.{name}: got {type(matrix).__name__}, need a scipy.sparse matrix")
        if matrix.shape != (size, size):
            raise MultiPhiValueError(f"fem.{name}: got shape {matrix.shape}, need {(size, size)} for its nodes")
    return scipy.sparse.csr_array(fem.massMatrix), scipy.sparse.csr_array(fem.stiffnessMatrix)


def _fixed_nodes(fem: Any, fixed: Iterable[int] | str, count: int) -> np.ndarray:
    if isinstance(fixed, str):
        return _node_set(fem, "fixed", fixed)[0]
    if not isinstance(fixed, Iterable):
        raise MultiPhiTypeError(f"fixed: got {type(fixed).__name__}, need node numbers or the name of a node set")
    return np.array([_number("fixed", node, count) for node in fixed], int)


def _node_set(fem: Any, name: str, set_name: str) -> tuple[np.ndarray, np.ndarray]:
    """Node numbers (k,) and weights (k,), their sum 1, of a node set."""
    for node_set in fem.nodeSets:
        if node_set["Name"] == set_name:
            nodes = [
                _number(f"node set {set_name!r}", node, len(fem.nodes["Position"])) for node in node_set["NodeNumbers"]
            ]
            weights = np.asarray(node_set["NodeWeights"], float)
            if weights.shape != (len(nodes),) or not np.sum(weights) > 0:
                raise MultiPhiValueError(f"node set {set_name!r}: got weights {weights}, need {len(nodes)} of sum > 0")
            return np.array(nodes, int), weights / np.sum(weights)
    choices = one_of(set_name, [node_set["Name"] for node_set in fem.nodeSets])
    raise MultiPhiValueError(f"{name}: got node set {set_name!r}, need {choices}")


def _row(fem: Any, name: str, point: Any, moving: np.ndarray) -> np.ndarray:
    """Row (n,) of (node or node set, component); moving: (nodes, 3) bool, n of them true."""
    label = f"points[{name!r}]"
    if not (isinstance(point, tuple) and len(point) == 2):
        raise MultiPhiTypeError(f"{label}: got {point!r}, need (node number or node set, component)")
    named = isinstance(point[1], str) and point[1] in NAMES
    count = (2 if isinstance(point[0], str) else 1) * COMPONENTS
    component = _number(f"{label} component", NAMES.index(point[1]) if named else point[1], count)
    row = np.zeros(moving.shape)
    if isinstance(point[0], str):
        nodes, weights = _node_set(fem, label, point[0])
        if component < COMPONENTS:
            np.add.at(row[:, component], nodes, weights)
        else:
            np.add.at(row, nodes, _rotation(label, fem.nodes["Position"][nodes], weights)[component - COMPONENTS])
    else:
        row[_number(label, point[0], len(moving)), component] = 1.0
    if not np.any(row[moving]):
        raise MultiPhiValueError(f"{label}: got {point!r}, which is fixed, need a point that can move")
    return row[moving]


def _rotation(name: str, positions: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Mean rotation (3, k, 3) of nodes at positions (k, 3) with weights (k,), by the displacements of each node."""
    arms = positions - weights @ positions
    inertia = np.sum(weights * np.sum(arms**2, axis=1)) * np.eye(3) - (weights * arms.T) @ arms
    values = np.linalg.eigvalsh(inertia)
    if not values[0] > IN_LINE * values[-1]:
        raise MultiPhiValueError(f"{name}: got nodes on one line, which have no rotation about it, need others")
    cross_products = np.cross(arms[:, None, :], np.eye(3))  # r x e_c, (k, c, 3)
    rotations: np.ndarray = np.einsum("ij,k,kcj->ikc", np.linalg.inv(inertia), weights, cross_products)
    return rotations


def _number(name: str, number: Any, count: int) -> int:
    if isinstance(number, bool) or not isinstance(number, (int, np.integer)):
        raise MultiPhiTypeError(f"{name}: got {number!r}, need a number from 0 to {count - 1}")
    if not 0 <= number < count:
        raise MultiPhiValueError(f"{name}: got {number}, need 0 <= number < {count}")
    return int(number)
