"""Linearized structure: a linear structure with its relation to the coordinates of an Exudyn system.

    q = q_0 + S z

q [m, rad, ...] are the system's ODE2 coordinates, q_0 those of the linearised state, S a basis of the directions that
its constraints leave free (orthonormal columns), z the coordinates of the structure. Where constraints prescribe a
motion s(t), q = q_0 + S z + s(t) (Reduction.displacement).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.mechanics.structures.dofs import Place
from multiphi_exudyn.mechanics.structures.structure import LinearStructure

__all__ = ["LinearizedStructure"]


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
