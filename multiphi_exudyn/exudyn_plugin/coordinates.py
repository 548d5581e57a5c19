"""Coordinates: a body's part of an Exudyn system: its q, q', q'', its matrices, and the level in its data node.

    M q'' + D q' + K q = drive + p

The level whose matrices the system has is ``stepped``; p (s,) is what the body's own varying loads add, and loads and
connectors of the system on the body's node and on its interface.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from multiphi_exudyn.exudyn_plugin.interface import Interface
from multiphi_exudyn.exudyn_plugin.stepped_level import SteppedLevel
from multiphi_exudyn.state import Phase, State

__all__ = ["Coordinates", "flags", "matrices"]

PHASES = tuple(Phase)


class Coordinates:
    """Coordinates (s,) of one body. items: its typed indices. stepped: see the module's docstring.

    interface: its interface coordinates or None. views: q, q', q'' in the system's current state, during a run.
    """

    def __init__(self, items: dict[str, Any], stepped: SteppedLevel) -> None:
        self.items = items
        self.stepped = stepped
        self.interface: Interface | None = None
        self.views: tuple[np.ndarray, ...] = ()
        self._copies: tuple[tuple[np.ndarray, ...], ...] = ()

    def attach(self, mbs: Any) -> None:
        """Take the views of the system's current state; they hold for one run."""
        state, size = mbs.systemData.GetSystemStateDict(reference=True), self.stepped.size
        first = mbs.GetNodeODE2Index(self.items["nGenericODE2"])
        self._own = slice(first, first + size)
        self.views = tuple(state[key][self._own] for key in ("ODE2Coords", "ODE2Coords_t", "ODE2Coords_tt"))
        self._copies = tuple((x, *self.split(x)) for x in np.ones((2, 3 * size + 1)))
        if self.interface is not None:
            self.interface.attach(state)
        if "nGenericData" in self.items:
            places = mbs.systemData.GetNodeLTGData(self.items["nGenericData"])
            self._data = state["dataCoords"][places[0] : places[0] + len(places)]

    def read(self) -> np.ndarray:
        """A copy x = (q, q', q'', 1) of the present state, good until the next but one."""
        self._copies = self._copies[::-1]
        x, q, q_t, q_tt = self._copies[0]
        q[:], q_t[:], q_tt[:] = self.views
        return x

    def split(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """q, q', q'' of x."""
        s = self.stepped.size
        return x[:s], x[s : 2 * s], x[2 * s : 3 * s]

    def write(self, values: Iterable[np.ndarray]) -> None:
        """Write q, q', q'' (s,), and what follows from them on the interface."""
        for view, value in zip(self.views, values, strict=True):
            view[:] = value
        if self.interface is not None:
            self.interface.write(self.stepped, self.views)

    def load(self, mbs: Any, stepped: SteppedLevel, force: np.ndarray) -> None:
        """Give the system the matrices of a level, and the force (s,) of the body's own that now acts in it."""
        self.stepped = stepped
        for parameter, value in matrices(stepped, force).items():
            mbs.SetObjectParameter(self.items["oGenericODE2"], parameter, value)
        if self.interface is not None:
            self.interface.load(stepped)

    def applied(self, mbs: Any) -> np.ndarray:
        """p (s,) in the present state of the system."""
        solver = mbs.sys["dynamicSolver"]
        solver.ComputeODE2RHS(mbs)
        unbalanced = np.array(solver.GetSystemResidual())
        force = unbalanced[self._own] + self.stepped.resisting(*self.views[:2])
        return force if self.interface is None else force + self.interface.modal(self.stepped, unbalanced)

    def carried(self, force: np.ndarray, given: SteppedLevel, wanted: SteppedLevel) -> np.ndarray:
        """A modal force (s,) of one level in another: what acts on points stays there."""
        return force if self.interface is None else self.interface.carried(force, given, wanted)

    def direct(self, stepped: SteppedLevel) -> np.ndarray:
        """L (k, s) in a level: L p is what the closed contacts carry of p beside its modes' share."""
        if self.interface is None:
            return np.zeros((len(stepped.closed), stepped.size))
        return self.interface.direct(stepped)

    def store(self, state: State) -> None:
        """Write closed contacts and phases into the data node."""
        if "nGenericData" in self.items:
            self._data[:] = flags(state)

    def stored(self) -> tuple[tuple[int, ...], tuple[Phase, ...]]:
        """Closed contacts and phases from the data node."""
        if "nGenericData" not in self.items:
            return (), ()
        closed, phases = np.split(self._data, 2)
        return tuple(np.flatnonzero(closed > 0.5).tolist()), tuple(PHASES[round(p)] for p in phases.tolist())


def flags(state: State) -> list[float]:
    """Coordinates of the data node."""
    closed = [float(contact in state.closed) for contact in range(len(state.phases))]
    return closed + [float(PHASES.index(phase)) for phase in state.phases]


def matrices(stepped: SteppedLevel, force: np.ndarray) -> dict[str, np.ndarray]:
    """Parameters of the ObjectGenericODE2."""
    return {
        "massMatrix": stepped.mass,
        "dampingMatrix": stepped.damping,
        "stiffnessMatrix": stepped.stiffness,
        "forceVector": force,
    }
