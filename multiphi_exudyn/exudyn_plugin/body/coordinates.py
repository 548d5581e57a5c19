"""Coordinates: a body's part of an Exudyn system: its q, q', q'', its matrices, and the level in its data node.

    M q'' + D q' + K q = drive + p

The level whose matrices the system has is ``stepped``; p (s,) is what the body's own varying loads add, and loads and
connectors of the system on the body's node and, as forces f (m,) on points, on its interface.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import exudyn as exu
import numpy as np

from multiphi_exudyn.events.state import Phase
from multiphi_exudyn.exudyn_plugin.body.level_data import LevelData
from multiphi_exudyn.exudyn_plugin.coupling.interface import Interface
from multiphi_exudyn.exudyn_plugin.coupling.stepped_level import SteppedLevel
from multiphi_exudyn.exudyn_plugin.coupling.system_matrices import SystemMatrices
from multiphi_exudyn.mathematics.bounded_cache import BoundedCache

__all__ = ["SAME_STEP", "Coordinates", "matrices"]

ONE = np.ones(1)  # the entry of x that its constants belong to
SAME_STEP = 1e-6  # relative change of the step size that is rounding of the times


@dataclass(frozen=True)
class Felt:
    """acting: (p, f) (s + m,). whole: of which forces or accelerations (n,) of the whole system it was found."""

    acting: np.ndarray
    whole: np.ndarray


class Coordinates:
    """Coordinates (s,) of one body. items: its typed indices. stepped: see the module's docstring.

    interface: its interface coordinates or None. surroundings: the system around them, views: q, q', q'' in the
    system's current state, multipliers: all those of the system, during a run. held: places (h,) that links hold, as
    the interface has them. layout: of the data node. most: levels of which Exudyn's own matrices are kept. matched:
    whether M differs among levels. rigid: whether links of the body become rigid. slips: whether links have held
    places. foreseen: whether what happens at an event depends on the forces that follow it, as reactions do, and
    accelerations that say which way something slips.
    """

    def __init__(
        self,
        items: dict[str, Any],
        stepped: SteppedLevel,
        held: np.ndarray,
        layout: LevelData,
        most: int,
        matched: bool,
    ) -> None:
        self.items = items
        self.stepped, self.held, self.layout = stepped, held, layout
        self.rigid = bool(np.any(np.isinf(stepped.loaded.level.base.stiffnesses)))
        self.slips = layout.places > 0
        self.foreseen = self.rigid or self.slips
        self._matched = matched
        self._prepared = BoundedCache[tuple[int, ...], dict[str, Any]](most)
        self.interface: Interface | None = None
        self.surroundings: SystemMatrices | None = None
        self.views: tuple[np.ndarray, ...] = ()
        self.multipliers = np.zeros(0)

    @property
    def points(self) -> int:
        """m, the number of interface coordinates."""
        return 0 if self.interface is None else self.interface.count

    def attach(self, mbs: Any) -> None:
        """Take the views of the system's current state; they hold for one run."""
        state, size = mbs.systemData.GetSystemStateDict(reference=True), self.stepped.size
        first = mbs.GetNodeODE2Index(self.items["nGenericODE2"])
        self._own, self._count = slice(first, first + size), len(state["ODE2Coords"])
        self.views = tuple(state[key][self._own] for key in ("ODE2Coords", "ODE2Coords_t", "ODE2Coords_tt"))
        self.multipliers = state["AECoords"]
        if self.interface is not None:
            self.interface.attach(state)
            self.surroundings = self.beside(mbs)
        if "nGenericData" in self.items:
            places = mbs.systemData.GetNodeLTGData(self.items["nGenericData"])
            self._data = state["dataCoords"][places[0] : places[0] + len(places)]

    def beside(self, mbs: Any) -> SystemMatrices:
        """The system around the body."""
        own, interface = range(self._own.start, self._own.stop), self.interface
        return SystemMatrices(mbs, own, interface.places if interface else (), interface.ties if interface else ())

    def read(self) -> np.ndarray:
        """A copy x = (q, q', q'', 1, f) of the present state."""
        if self.interface is None:
            return np.concatenate([*self.views, ONE])
        return np.concatenate([*self.views, ONE, self.interface.forces])

    def force(self, x: np.ndarray) -> np.ndarray:
        """(p, f) of x."""
        known = 3 * self.stepped.size + 1
        return np.concatenate([self.stepped.outside.dot(x[:known]), x[known:]])

    def split(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """q, q', q'' of x."""
        s = self.stepped.size
        return x[:s], x[s : 2 * s], x[2 * s : 3 * s]

    def write(self, stepped: SteppedLevel, held: np.ndarray, values: Iterable[np.ndarray]) -> None:
        """Write q, q', q'' (s,) in a level with places that links hold (h,), and what follows on the interface."""
        q, q_t, q_tt = self.views
        q[:], q_t[:], q_tt[:] = values
        if self.interface is not None:
            self.interface.write(stepped, held, self.views)

    def load(self, mbs: Any, stepped: SteppedLevel, force: np.ndarray) -> None:
        """Give the system the matrices of a level, and the force (s,) of the body's own that now acts in it."""
        self.stepped = stepped
        links = stepped.loaded.level.indices
        prepared = self._prepared.get_or_build(links, lambda: _containers(stepped))
        for parameter, value in prepared.items():
            mbs.SetObjectParameter(self.items["oGenericODE2"], parameter, value)
        mbs.SetObjectParameter(self.items["oGenericODE2"], "forceVector", force)
        if self.interface is not None:
            self.interface.load(stepped, self.held)

    def enter(self, mbs: Any, stepped: SteppedLevel, force: np.ndarray) -> None:
        """``load`` within a run of the dynamic solver."""
        self.load(mbs, stepped, force)
        if self._matched:  # a solver may take the mass matrix for constant and keep it
            mbs.sys["dynamicSolver"].ComputeMassMatrix(mbs)
        mbs.solverSignalJacobianUpdate = True

    def enter_with(self, mbs: Any, stepped: SteppedLevel, held: np.ndarray, force: np.ndarray) -> None:
        """``enter`` a level with places that links hold (h,), where either is another than now."""
        if stepped.states != self.stepped.states or np.any(held != self.held):
            self.held = held
            self.enter(mbs, stepped, force)

    def applied(self, mbs: Any) -> np.ndarray:
        """p (s,) in the present state of the system, of a body without interface."""
        return self.felt(mbs, self.stepped).acting

    def felt(self, mbs: Any, shown: SteppedLevel) -> Felt:
        """(p, f) of loads and connectors in the present state of the system, with coordinates of the level ``shown``.

        Beside it the forces (n,) on the whole system. The level need not be that of the system's matrices.
        """
        solver = mbs.sys["dynamicSolver"]
        solver.ComputeODE2RHS(mbs)
        whole = np.array(solver.GetSystemResidual())[: self._count]
        modal = whole[self._own] + self.stepped.resisting(*self.views[:2])
        if self.interface is None:
            return Felt(modal, whole)
        points = whole[self.interface.places]
        return Felt(np.concatenate([modal + points @ self.interface.of(shown).rows, points]), whole)

    def seen(self, accelerations: np.ndarray) -> Felt:
        """(p, f) that belong to accelerations (n,) of the whole system in its present state, and to its multipliers."""
        assert self.interface is not None
        q, q_t, _ = self.views
        x = np.concatenate([q, q_t, accelerations[self._own], ONE, self.interface.forces])
        return Felt(self.force(x), accelerations)

    def put_forces(self, forces: np.ndarray) -> None:
        """Make f (m,) what the ties hold."""
        assert self.interface is not None
        self.multipliers[self.interface.multipliers] = forces

    def carried(self, force: np.ndarray, given: SteppedLevel, wanted: SteppedLevel) -> np.ndarray:
        """(p, f) of one level in another: what acts on points stays there."""
        return force if self.interface is None else self.interface.carried(force, given, wanted)

    def direct(self, stepped: SteppedLevel) -> np.ndarray:
        """L (k, m) in a level: L f is what the closed contacts carry of f beside its modes' share."""
        if self.interface is None:
            return np.zeros((len(stepped.loaded.level.indices), 0))
        return self.interface.of(stepped).direct

    def store(self, data: np.ndarray) -> None:
        """Write the level data of a state into the data node."""
        if "nGenericData" in self.items:
            self._data[:] = data

    def stored(self) -> tuple[tuple[int, ...], tuple[Phase, ...], np.ndarray]:
        """States, phases and held places from the data node."""
        return self.layout.read(self._data if "nGenericData" in self.items else np.zeros(0))


def matrices(stepped: SteppedLevel, force: np.ndarray) -> dict[str, np.ndarray]:
    """Parameters of the ObjectGenericODE2."""
    return {
        "massMatrix": stepped.mass,
        "dampingMatrix": stepped.damping,
        "stiffnessMatrix": stepped.stiffness,
        "forceVector": force,
    }


def _containers(stepped: SteppedLevel) -> dict[str, Any]:
    """Mass, damping and stiffness as Exudyn's own matrices, which it takes over without looking at every number."""
    given = matrices(stepped, stepped.drive)
    del given["forceVector"]
    return {parameter: exu.MatrixContainer(value) for parameter, value in given.items()}
