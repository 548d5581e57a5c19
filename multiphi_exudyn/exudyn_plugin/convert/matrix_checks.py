"""What makes the matrices of an Exudyn system no linear structure, told by the coordinates it comes from.

M positive definite, K positive semidefinite, all symmetric, in z with q = q_0 + S z; S (n_full, n). The coordinate of
the largest part in S z names the cause: by its node, its number there and the bodies of that node.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import exudyn as exu
import numpy as np
import scipy.linalg

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.mathematics.modes import Modes, complete_modes

__all__ = ["ASYMMETRY", "Checked", "NoStructure", "checked_matrices", "coordinate_name"]

ASYMMETRY = 1e-6  # of the largest entry: what differentiating connectors numerically leaves
DIFFERENTIATED = 1e-9  # of the largest damping or the fastest mode's critical one: what differentiating forces leaves
UNDAMPED = 1e-14  # of the same: damping of a zero-frequency mode that is none, whatever couples it to others
MASSLESS = 1e-14  # of the largest eigenvalue of M: what projecting leaves of a coordinate without mass


class NoStructure(MultiPhiValueError):
    """Matrices of no linear structure, for the sake of some directions; of: what is wrong with these, and where."""

    def __init__(self, message: str, of: str) -> None:
        super().__init__(message)
        self.of = of


@dataclass(frozen=True)
class Checked:
    """M, K, C (n, n), symmetric to the bit; told: of what was not, a sentence each."""

    mass: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    told: tuple[str, ...]


def checked_matrices(
    mbs: Any, mass: np.ndarray, stiffness: np.ndarray, damping: np.ndarray, basis: np.ndarray, allowed: float
) -> Checked:
    """The matrices, made symmetric; raises MultiPhiValueError that names items and coordinates.

    allowed: of the largest entry of stiffness or damping, up to which entries may differ from their mirror images; of
    damping also a ratio to critical damping.
    """
    told: list[str] = []
    values, vectors = scipy.linalg.eigh(mass)
    if values[0] <= MASSLESS * values[-1]:
        where = _of_largest(mbs, basis @ vectors[:, 0])
        raise MultiPhiValueError(
            f"mass: got {_kind(values[0], values[-1])} mass at {where} ({values[0] / values[-1]:.1g} of the largest), "
            f"need more than {MASSLESS:g} of the largest, or a constraint that holds this coordinate"
        )
    mass = _symmetric(mbs, "mass", mass, basis, ASYMMETRY, told)
    stiffness = _symmetric(mbs, "stiffness", stiffness, basis, allowed, told)
    try:
        modes = complete_modes(mass, stiffness)
    except MultiPhiValueError as error:
        values, vectors = scipy.linalg.eigh(stiffness, mass, subset_by_index=[0, 0])
        where = f"(omega^2 = {values[0]:.3g} 1/s2), mainly of {_of_largest(mbs, basis @ vectors[:, 0])}"
        raise NoStructure(
            f"stiffness: got a negative eigenvalue {where}, need a stable state, or a constraint there",
            f"one of them unstable {where}",
        ) from error
    damping = _symmetric(mbs, "damping", damping, basis, allowed, told, _critical(damping, modes))
    return Checked(mass, stiffness, _damping(damping, mass, modes), tuple(told))


def _kind(lowest: float, largest: float) -> str:
    return "a negative" if lowest < -MASSLESS * largest else "no"


def _critical(damping: np.ndarray, modes: Modes) -> float:
    """The largest entry of the skew part in the modes, as a ratio to critical damping of the faster of the two."""
    forces = np.abs(modes.shapes.T @ (damping - damping.T) @ modes.shapes) / 2
    faster = 2 * np.maximum.outer(modes.omega, modes.omega)
    ratios = np.divide(forces, faster, out=np.where(forces > 0, math.inf, 0.0), where=faster > 0)
    return float(np.max(ratios, initial=0.0))


def _damping(damping: np.ndarray, mass: np.ndarray, modes: Modes) -> np.ndarray:
    """A symmetric damping matrix (n, n) without what is round-off of differentiation.

    That is negative damping, and that of zero-frequency modes that are damped by nothing but it.
    """
    own = modes.shapes.T @ damping @ modes.shapes
    largest = max(np.max(np.abs(np.linalg.eigvalsh(own))), 2 * np.max(modes.omega))
    undamped = (modes.omega == 0) & (np.abs(np.diagonal(own)) <= UNDAMPED * largest)
    undamped &= np.max(np.abs(own), axis=1) <= 10 * DIFFERENTIATED * largest
    own[undamped], own[:, undamped] = 0.0, 0.0
    values, vectors = np.linalg.eigh(own)
    driving = -DIFFERENTIATED * largest <= values[0] < 0
    if not driving and not np.any(undamped):
        return damping
    momenta = mass @ modes.shapes @ vectors
    found: np.ndarray = (momenta * (np.maximum(values, 0.0) if driving else values)) @ momenta.T
    return (found + found.T) / 2


def _symmetric(
    mbs: Any,
    name: str,
    matrix: np.ndarray,
    basis: np.ndarray,
    allowed: float,
    told: list[str],
    critical: float = math.inf,
) -> np.ndarray:
    """The symmetric part; told: gets a sentence of what is left out. critical: of a damping matrix, see above."""
    skew = matrix - matrix.T
    away = float(np.max(np.abs(skew)) / (np.max(np.abs(matrix)) or 1.0))
    if away > ASYMMETRY:
        full = np.abs(basis @ skew @ basis.T)
        first, second = (int(i) for i in np.unravel_index(np.argmax(full), full.shape))
        places = f"between {coordinate_name(mbs, first)} and {coordinate_name(mbs, second)}"
        acting = ", ".join(_acting_on(mbs, {first, second})) or "none"
        where = f"{places}, on both of which act: {acting}"
        if min(away, critical) > allowed:
            raise NoStructure(
                f"mbs: its {name} matrix is not symmetric (follower or gyroscopic forces?), got entries that differ by "
                f"{away:.2g} of the largest {where}; need a symmetric one",
                f"with them its {name} matrix is not symmetric {places}",
            )
        ratio = f" (a ratio to critical damping of {critical:.2g})" if critical < math.inf else ""
        told.append(f"{name} matrix, of which entries differ by {away:.2g} of the largest{ratio} {where}")
    return (matrix + matrix.T) / 2


def _acting_on(mbs: Any, coordinates: set[int]) -> list[str]:
    """Objects that have all of these ODE2 coordinates."""
    count = mbs.systemData.NumberOfObjects()
    found = [i for i in range(count) if coordinates <= set(mbs.systemData.GetObjectLTGODE2(exu.ObjectIndex(i)))]
    return [_called(mbs.GetObject(exu.ObjectIndex(i))) for i in found]


def _called(item: Any) -> str:
    return f"Object{item['objectType']} {item['name']!r}"


def _of_largest(mbs: Any, vector: np.ndarray) -> str:
    return coordinate_name(mbs, int(np.argmax(np.abs(vector))))


def coordinate_name(mbs: Any, index: int) -> str:
    """ "coordinate 1 of node 'n' (ObjectMassPoint2D 'bob')" of an ODE2 coordinate of the system."""
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
    found = [item for item in items if node in [int(n) for n in item.get("nodeNumbers", [item.get("nodeNumber", -1)])]]
    return [_called(item) for item in found]
