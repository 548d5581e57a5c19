"""Coordinates: a body's part of an Exudyn system: its q, q', q'', its matrices, and the level in its data node.

    M q'' + D q' + K q = drive + p

The level whose matrices the system has is ``stepped``; p (s,) is what the body's own varying loads add, and loads and
connectors of the system on the body's node and, as forces f (m,) on points, on its interface.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import exudyn as exu
import numpy as np

from multiphi_exudyn.events.state import Phase
from multiphi_exudyn.exudyn_plugin.coupling.attached_inertia import AttachedInertia, Reactions
from multiphi_exudyn.exudyn_plugin.coupling.interface import Interface
from multiphi_exudyn.exudyn_plugin.coupling.stepped_level import SteppedLevel
from multiphi_exudyn.exudyn_plugin.coupling.system_matrices import SystemMatrices
from multiphi_exudyn.mathematics.bounded_cache import BoundedCache

__all__ = ["SAME_STEP", "Coordinates", "flags_of", "matrices"]

PHASES = tuple(Phase)
SAME_STEP = 1e-6  # relative change of the step size that is rounding of the times


class Coordinates:
    """Coordinates (s,) of one body. items: its typed indices. stepped: see the module's docstring.

    interface: its interface coordinates or None. surroundings: the system around them, attached: what hangs on them,
    views: q, q', q'' in the system's current state, all three during a run. most: levels of which Exudyn's own matrices
    are kept. matched: whether M differs among levels.
    """

    def __init__(self, items: dict[str, Any], stepped: SteppedLevel, most: int, matched: bool) -> None:
        self.items = items
        self.stepped = stepped
        self._matched = matched
        self._prepared = BoundedCache[tuple[int, ...], dict[str, Any]](most)
        self.interface: Interface | None = None
        self.surroundings: SystemMatrices | None = None
        self.attached: AttachedInertia | None = None
        self._reactions: Reactions | None = None
        self.views: tuple[np.ndarray, ...] = ()
        self._copies: tuple[tuple[np.ndarray, ...], ...] = ()

    @property
    def rigid(self) -> bool:
        """Whether the body has contacts that strike."""
        return bool(np.any(np.isinf(self.stepped.loaded.level.base.stiffnesses)))

    @property
    def points(self) -> int:
        """m, the number of interface coordinates."""
        return 0 if self.interface is None else len(self.interface.nodes)

    def attach(self, mbs: Any) -> None:
        """Take the views of the system's current state; they hold for one run."""
        state, size = mbs.systemData.GetSystemStateDict(reference=True), self.stepped.size
        first = mbs.GetNodeODE2Index(self.items["nGenericODE2"])
        self._own = slice(first, first + size)
        self.views = tuple(state[key][self._own] for key in ("ODE2Coords", "ODE2Coords_t", "ODE2Coords_tt"))
        self._copies = tuple((x, *self.split(x)) for x in np.ones((2, 3 * size + 1 + self.points)))
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
        """A copy x = (q, q', q'', 1, f) of the present state, good until the next but one."""
        self._copies = self._copies[::-1]
        x, q, q_t, q_tt = self._copies[0]
        q[:], q_t[:], q_tt[:] = self.views
        if self.interface is not None:
            x[3 * self.stepped.size + 1 :] = self.interface.forces
        return x

    def force(self, x: np.ndarray) -> np.ndarray:
        """(p, f) of x."""
        known = 3 * self.stepped.size + 1
        return np.concatenate([self.stepped.outside.dot(x[:known]), x[known:]])

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
        prepared = self._prepared.get_or_build(stepped.closed, lambda: _containers(stepped))
        for parameter, value in prepared.items():
            mbs.SetObjectParameter(self.items["oGenericODE2"], parameter, value)
        mbs.SetObjectParameter(self.items["oGenericODE2"], "forceVector", force)
        if self.interface is not None:
            self.interface.load(stepped)

    def enter(self, mbs: Any, stepped: SteppedLevel, force: np.ndarray) -> None:
        """``load`` within a run of the dynamic solver."""
        self.load(mbs, stepped, force)
        if self._matched:  # a solver may take the mass matrix for constant and keep it
            mbs.sys["dynamicSolver"].ComputeMassMatrix(mbs)
        mbs.solverSignalJacobianUpdate = True

    def applied(self, mbs: Any) -> np.ndarray:
        """p (s,) in the present state of the system, of a body without interface."""
        solver = mbs.sys["dynamicSolver"]
        solver.ComputeODE2RHS(mbs)
        return np.array(solver.GetSystemResidual())[self._own] + self.stepped.resisting(*self.views[:2])

    def mark(self, x: np.ndarray) -> None:
        """Take the present state, of which x is a copy, as that without an event; find what hangs on the interface."""
        self.attached = self._reactions = None
        if self.interface is None or self.surroundings is None:
            return
        self.attached = self.surroundings.mark()
        if not self.rigid:
            return
        level, closed = self.stepped.loaded.level, self.stepped.closed
        physical = self.stepped.physical @ np.concatenate(self.split(x))
        eta, eta_t, eta_tt = (part[: level.modes] for part in np.split(physical, 3))
        carried = self.stepped.loaded.asymptotic.forces + self.direct(self.stepped) @ self.interface.forces
        reactions = carried + level.force_rows @ eta + level.force_rate_rows @ eta_t
        given = self.interface.in_base(level.base), level.vectors @ eta_tt, closed, reactions
        self._reactions = Reactions(self.attached, level.base, *given)

    def look_back(self, ago: float) -> None:
        """Find what hung on the interface some time [s] before the state that was marked: joints may have turned."""
        if self.surroundings is not None and self.rigid:
            self.attached = self.surroundings.hanging(ago)

    def acting(self, mbs: Any, step: float) -> np.ndarray:
        """(p, f) in the present state of the system, with what constraints and inertia make of it on an interface.

        step: of the solver [s].
        """
        if self.surroundings is None:
            return self.applied(mbs)
        return self._force_of(self.surroundings.leave(step))

    def changed(self, mbs: Any, step: float) -> np.ndarray:
        """The same, of the state that an event gives the body after the one for which ``acting`` was called."""
        if self.surroundings is None:
            return self.applied(mbs)
        return self._force_of(self.surroundings.arrive(step))

    def settled(self, elapsed: float, step: float) -> np.ndarray:
        """The same at the end of the step, where all has followed the body; elapsed: time since the event [s]."""
        assert self.surroundings is not None
        return self._force_of(self.surroundings.settle(elapsed, step))

    def _force_of(self, accelerations: np.ndarray) -> np.ndarray:
        """(p, f) from the accelerations (n,) of the whole system in its present state, and its multipliers."""
        assert self.interface is not None
        q, q_t, _ = self.views
        return self.force(np.concatenate([q, q_t, accelerations[self._own], [1.0], self.interface.forces]))

    def told(self, force: np.ndarray, given: SteppedLevel, wanted: SteppedLevel) -> np.ndarray:
        """``carried``, with the forces that follow from other reactions of rigid contacts."""
        carried = self.carried(force, given, wanted)
        if self.interface is None or self._reactions is None:
            return carried
        change = self._reactions.at(wanted.closed) - self._reactions.at(given.closed)
        return carried + np.concatenate([change @ self.interface.of(wanted).rows, change])

    def carried(self, force: np.ndarray, given: SteppedLevel, wanted: SteppedLevel) -> np.ndarray:
        """(p, f) of one level in another: what acts on points stays there."""
        return force if self.interface is None else self.interface.carried(force, given, wanted)

    def direct(self, stepped: SteppedLevel) -> np.ndarray:
        """L (k, m) in a level: L f is what the closed contacts carry of f beside its modes' share."""
        if self.interface is None:
            return np.zeros((len(stepped.closed), 0))
        return self.interface.of(stepped).direct

    def store(self, flags: Sequence[float]) -> None:
        """Write closed contacts and phases into the data node."""
        if "nGenericData" in self.items:
            self._data[:] = flags

    def stored(self) -> tuple[tuple[int, ...], tuple[Phase, ...]]:
        """Closed contacts and phases from the data node."""
        if "nGenericData" not in self.items:
            return (), ()
        closed, phases = np.split(self._data, 2)
        return tuple(np.flatnonzero(closed > 0.5).tolist()), tuple(PHASES[round(p)] for p in phases.tolist())


def flags_of(closed: tuple[int, ...], phases: Sequence[Phase]) -> list[float]:
    """Coordinates of the data node."""
    flags = [0.0] * len(phases) + [float(PHASES.index(phase)) for phase in phases]
    for contact in closed:
        flags[contact] = 1.0
    return flags


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
