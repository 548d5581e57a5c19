"""Coordinates: the part of an Exudyn system that belongs to a body: q, q', q'', matrices, and its data node.

    M q'' + D q' + K q = drive + p

The system has the matrices of the level ``stepped``. p (s,) is the modal force of the body's own varying loads and of
the system's loads and connectors: those on the body's node, and those on its interface as forces f (m,) on points.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import exudyn as exu
import numpy as np

from multiphi_exudyn.events.transitions.state import Phase
from multiphi_exudyn.exudyn_plugin.body.state.level_data import LevelData
from multiphi_exudyn.exudyn_plugin.coupling.interface import Interface
from multiphi_exudyn.exudyn_plugin.coupling.stepped_level import SteppedLevel
from multiphi_exudyn.exudyn_plugin.coupling.system_matrices import SystemMatrices
from multiphi_exudyn.mathematics.bounded_cache import BoundedCache

__all__ = ["SAME_STEP", "Coordinates", "matrices"]

ONE = np.ones(1)  # the entry 1 of x = (q, q', q'', 1, f)
SAME_STEP = 1e-6  # relative: a smaller change of the step size is rounding of the times


@dataclass(frozen=True)
class ExternalForces:
    """External forces (p, f) (s + m,) on a body, and the forces or accelerations (n,) of the system they come from."""

    forces: np.ndarray
    system_values: np.ndarray


class Coordinates:
    """Coordinates (s,) of one body in an Exudyn system.

    items: typed indices of the body's items. stepped: level whose matrices the system has. held: stick positions (h,)
    [m] in the interface. layout: of the data node. interface: its interface coordinates, or None.
    max_levels: number of levels of which Exudyn's own matrices are kept. matched: whether M differs among levels.
    During a run, system: the system around the body, if it has an interface; views: of q, q', q'' in the system's
    current state; multipliers: view of all multipliers.
    rigid: whether the body has rigid links. has_friction: whether links have stick positions. depends_on_later_forces:
    whether an event depends on the forces right after it, as reactions do, and the direction in which friction slips.
    """

    def __init__(
        self,
        items: dict[str, Any],
        stepped: SteppedLevel,
        held: np.ndarray,
        layout: LevelData,
        max_levels: int,
        matched: bool,
    ) -> None:
        self.items = items
        self.stepped, self.held, self.layout = stepped, held, layout
        self.rigid = bool(np.any(np.isinf(stepped.loaded.level.base.stiffnesses)))
        self.has_friction = layout.held_count > 0
        self.depends_on_later_forces = self.rigid or self.has_friction
        self._matched = matched
        self._prepared = BoundedCache[tuple[int, ...], dict[str, Any]](max_levels)
        self.interface: Interface | None = None
        self.system: SystemMatrices | None = None
        self.views: tuple[np.ndarray, ...] = ()
        self.multipliers = np.zeros(0)

    @property
    def point_count(self) -> int:
        """m, the number of interface coordinates."""
        return 0 if self.interface is None else self.interface.count

    def attach(self, mbs: Any) -> None:
        """Take the views of the system's current state; they are valid for one run."""
        state, size = mbs.systemData.GetSystemStateDict(reference=True), self.stepped.size
        first = mbs.GetNodeODE2Index(self.items["nGenericODE2"])
        self._indices, self._count = slice(first, first + size), len(state["ODE2Coords"])
        self.views = tuple(state[key][self._indices] for key in ("ODE2Coords", "ODE2Coords_t", "ODE2Coords_tt"))
        self.multipliers = state["AECoords"]
        if self.interface is not None:
            self.interface.attach(state)
            self.system = self.system_around(mbs)
        if "nGenericData" in self.items:
            indices = mbs.systemData.GetNodeLTGData(self.items["nGenericData"])
            self._data = state["dataCoords"][indices[0] : indices[0] + len(indices)]

    def system_around(self, mbs: Any) -> SystemMatrices:
        """The system around the body."""
        body, interface = range(self._indices.start, self._indices.stop), self.interface
        return SystemMatrices(mbs, body, interface.indices if interface else (), interface.ties if interface else ())

    def copy_state(self) -> np.ndarray:
        """A copy x = (q, q', q'', 1, f) of the present state."""
        if self.interface is None:
            return np.concatenate([*self.views, ONE])
        return np.concatenate([*self.views, ONE, self.interface.forces])

    def external_force(self, x: np.ndarray) -> np.ndarray:
        """External forces (p, f) of a state x, by the equation of motion."""
        count = 3 * self.stepped.size + 1
        return np.concatenate([self.stepped.external_force_matrix.dot(x[:count]), x[count:]])

    def split(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """q, q', q'' of x."""
        s = self.stepped.size
        return x[:s], x[s : 2 * s], x[2 * s : 3 * s]

    def write(self, stepped: SteppedLevel, held: np.ndarray, values: Iterable[np.ndarray]) -> None:
        """Write q, q', q'' (s,) of a level with stick positions (h,) [m], and the interface coordinates they give."""
        q, q_t, q_tt = self.views
        q[:], q_t[:], q_tt[:] = values
        if self.interface is not None:
            self.interface.write(stepped, held, self.views)

    def set_level(self, mbs: Any, stepped: SteppedLevel, force: np.ndarray) -> None:
        """Give the system the matrices of a level and the force vector (s,) of the body."""
        self.stepped = stepped
        links = stepped.loaded.level.indices
        prepared = self._prepared.get_or_build(links, lambda: _containers(stepped))
        for parameter, value in prepared.items():
            mbs.SetObjectParameter(self.items["oGenericODE2"], parameter, value)
        mbs.SetObjectParameter(self.items["oGenericODE2"], "forceVector", force)
        if self.interface is not None:
            self.interface.set_level(stepped, self.held)

    def set_level_in_run(self, mbs: Any, stepped: SteppedLevel, force: np.ndarray) -> None:
        """``set_level`` within a run of the dynamic solver."""
        self.set_level(mbs, stepped, force)
        if self._matched:  # a solver may keep a mass matrix that it takes for constant
            mbs.sys["dynamicSolver"].ComputeMassMatrix(mbs)
        mbs.solverSignalJacobianUpdate = True

    def set_level_if_changed(self, mbs: Any, stepped: SteppedLevel, held: np.ndarray, force: np.ndarray) -> None:
        """Set a level with stick positions (h,) [m] within a run, if either differs from the present one."""
        if stepped.states != self.stepped.states or np.any(held != self.held):
            self.held = held
            self.set_level_in_run(mbs, stepped, force)

    def external_modal_force(self, mbs: Any) -> np.ndarray:
        """Modal force p (s,) in the present state of the system, for a body without interface."""
        return self.external_forces(mbs, self.stepped).forces

    def external_forces(self, mbs: Any, written: SteppedLevel) -> ExternalForces:
        """Forces (p, f) of loads and connectors in the present state of the system, and the forces (n,) of the system.

        written: the level whose coordinates are in the system; its matrices may be those of another one.
        """
        solver = mbs.sys["dynamicSolver"]
        solver.ComputeODE2RHS(mbs)
        system_forces = np.array(solver.GetSystemResidual())[: self._count]
        modal = system_forces[self._indices] + self.stepped.internal_force(*self.views[:2])
        if self.interface is None:
            return ExternalForces(modal, system_forces)
        points = system_forces[self.interface.indices]
        rows = self.interface.map_in(written).rows
        return ExternalForces(np.concatenate([modal + points @ rows, points]), system_forces)

    def forces_from_accelerations(self, accelerations: np.ndarray) -> ExternalForces:
        """External forces (p, f) in the present state, for accelerations (n,) of the system and its multipliers."""
        assert self.interface is not None
        q, q_t, _ = self.views
        x = np.concatenate([q, q_t, accelerations[self._indices], ONE, self.interface.forces])
        return ExternalForces(self.external_force(x), accelerations)

    def set_tie_forces(self, forces: np.ndarray) -> None:
        """Write f (m,) as the multipliers of the ties."""
        assert self.interface is not None
        self.multipliers[self.interface.multipliers] = forces

    def transform_force(self, force: np.ndarray, source: SteppedLevel, target: SteppedLevel) -> np.ndarray:
        """Forces (p, f) of one level in another: forces on points stay the same."""
        return force if self.interface is None else self.interface.transform_force(force, source, target)

    def direct_reactions(self, stepped: SteppedLevel) -> np.ndarray:
        """L (k, m) in a level: L f [N] are reactions of the closed contacts to f that its modes do not contain."""
        if self.interface is None:
            return np.zeros((len(stepped.loaded.level.indices), 0))
        return self.interface.map_in(stepped).direct_reactions

    def write_level_data(self, data: np.ndarray) -> None:
        """Write level data (width,) into the data node."""
        if "nGenericData" in self.items:
            self._data[:] = data

    def read_level_data(self) -> tuple[tuple[int, ...], tuple[Phase, ...], np.ndarray]:
        """States, phases and stick positions from the data node."""
        return self.layout.read(self._data if "nGenericData" in self.items else np.zeros(0))


def matrices(stepped: SteppedLevel, force: np.ndarray) -> dict[str, np.ndarray]:
    """Parameters of the ObjectGenericODE2 in a level."""
    return {
        "massMatrix": stepped.mass,
        "dampingMatrix": stepped.damping,
        "stiffnessMatrix": stepped.stiffness,
        "forceVector": force,
    }


def _containers(stepped: SteppedLevel) -> dict[str, Any]:
    """Mass, damping and stiffness as Exudyn's own matrices, which are set without a conversion entry by entry."""
    parameters = matrices(stepped, stepped.drive)
    del parameters["forceVector"]
    return {parameter: exu.MatrixContainer(value) for parameter, value in parameters.items()}
