"""Reduction of an Exudyn system: the model, its start and loads, and the items it contains and leaves out."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from multiphi_exudyn.display import Shown, names, per_cent
from multiphi_exudyn.errors import MultiPhiTypeError
from multiphi_exudyn.exudyn_plugin.convert.items.item_fates import grouped
from multiphi_exudyn.exudyn_plugin.convert.items.items import Item
from multiphi_exudyn.exudyn_plugin.convert.linear_range.linear_range import LinearLimits, LinearRange
from multiphi_exudyn.exudyn_plugin.convert.linear_range.range_check import RangeCheck
from multiphi_exudyn.exudyn_plugin.convert.structure.linearized_structure import LinearizedStructure
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mechanics.loads.loads import Load
from multiphi_exudyn.time.trajectory.trajectory import Trajectory

__all__ = ["Reduction"]


@dataclass(frozen=True, repr=False)
class Reduction(Shown):
    """Result of ``reduce`` for an Exudyn system.

    Attributes
    ----------
    model : MultiPhiModel
        Structure, contacts, modes.
    velocity : array (n,)
        z'(0) [m/s, rad/s] of the current state; the displacement z(0) is zero.
    loads : tuple of loads
        The constant load of a state out of balance, none if it is zero, and those by functions of time.
    taken : tuple of Item
        Every item of the system that is part of the model.
    left_out : tuple of (Item, str)
        Items that are not part of it, with the reason.
    symmetrised : tuple of str
        Matrices that were not symmetric, by how much and between which coordinates. The model has their symmetric part;
        ``check`` determines the effect of the skew part.
    shift : array (n_full,)
        Distance of q_0 from the system's current coordinates where these violate constraints, else zero.
    prescribed : callable
        s(t) (n_full,), the motion that constraints prescribe by functions of time; zero without any.

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
    >>> print(reduce(mbs).report)
    1 degrees of freedom, contacts: 1, frictions: 0, modes: all
    taken
      ObjectMass1D 'mass': its matrices
      ObjectConnectorCoordinateSpringDamper 'spring': its matrices
      ObjectContactCoordinate 'stop': contact, 1e+06 N/m
    left out
      nothing
    """

    model: MultiPhiModel
    velocity: np.ndarray
    loads: tuple[Load, ...]
    taken: tuple[Item, ...]
    left_out: tuple[tuple[Item, str], ...]
    symmetrised: tuple[str, ...]
    shift: np.ndarray
    prescribed: Callable[[float], np.ndarray]

    def _facts(self) -> Iterator[tuple[str, str]]:
        yield "degrees of freedom", str(self.structure.n)
        yield "contacts", names([contact.name for contact in self.model.contacts])
        yield "modes", str(self.model.modes)
        yield "taken", str(len(self.taken))
        yield "left out", names([str(item) for item, _ in self.left_out])

    @property
    def structure(self) -> LinearizedStructure:
        """M, C, K, the points and S."""
        structure = self.model.structure
        assert isinstance(structure, LinearizedStructure)
        return structure

    def displacement(self, trajectory: Trajectory, times: Any) -> np.ndarray:
        """Displacement of all coordinates of the system from its current ones, q - q_now = shift + S z + s(t).

        Parameters
        ----------
        trajectory : Trajectory
            Of ``simulate`` with this model.
        times : float or array (k,)
            [s], from the start of the trajectory.

        Returns
        -------
        array (n_full,) or (n_full, k)
            [m, rad], in the order of ``mbs.systemData.GetODE2Coordinates()``.

        Raises
        ------
        MultiPhiTypeError
            For something else than a trajectory, and times that are not numbers.
        MultiPhiValueError
            For times outside the trajectory.
        """
        if not isinstance(trajectory, Trajectory):
            raise MultiPhiTypeError(f"trajectory: got {trajectory!r}, need a Trajectory of this model")
        z = trajectory.displacement(times)
        moved = np.transpose([self.prescribed(t) for t in np.atleast_1d(times)]) + self.shift[:, None]
        moved = moved if np.ndim(times) else moved[:, 0]
        return np.asarray(self.structure.coordinates @ z + moved)

    @property
    def report(self) -> str:
        """Text with the items taken and left out, one line for items of one type and one fate."""
        frictions = sum(contact.held for contact in self.model.contacts)
        elements = f"contacts: {len(self.model.contacts) - frictions}, frictions: {frictions}"
        size = f"{self.structure.n} degrees of freedom, {elements}, modes: {self.model.modes}"
        taken = [f"  {line}" for line in grouped((item, item.became) for item in self.taken)]
        left = [f"  {line}" for line in grouped(self.left_out)]
        symmetrised = (
            ["made symmetric", *(f"  {sentence}" for sentence in self.symmetrised)] if self.symmetrised else []
        )
        return "\n".join([size, "taken", *taken, *symmetrised, "left out", *(left or ["  nothing"])])

    def check(self, trajectory: Trajectory) -> RangeCheck:
        """Error of the linearisation in a trajectory of this model; the trajectory's warnings contain it too."""
        validity = self.model.validity
        assert isinstance(validity, (LinearRange, LinearLimits))
        return validity.check(trajectory)

    def report_of(self, trajectory: Trajectory, tolerance: float = 0.01) -> str:
        """Text about the accuracy of a trajectory of this model, a line each for linear range, horizon and warnings.

        Parameters
        ----------
        trajectory : Trajectory
            Of ``simulate`` with this model.
        tolerance : float, default 0.01
            Of the horizon, see ``Trajectory.horizon``.
        """
        check = self.check(trajectory)
        error = f"what the model leaves out moves it by {per_cent(check.error)} of its largest displacement"
        verdict, horizon = "holds" if check.holds else "does not hold", trajectory.horizon(tolerance)
        lines = [
            f"linear range ({verdict}): {f'not checked, {check.reason}' if check.reason else error}",
            f"horizon: determined within {100 * tolerance:g} % until {horizon:.6g} s of {trajectory.t_end:g} s",
        ]
        return "\n".join([*lines, *(f"warning: {sentence}" for sentence in trajectory.warnings)])
