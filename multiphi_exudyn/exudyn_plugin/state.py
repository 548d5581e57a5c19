"""State of a body in an Exudyn system: its coordinates and matrices, its data node, and what it keeps of a run.

    M q'' + D q' + K q = drive + p

The system has the matrices of the level ``discretised``. p (s,) is the modal force of the body's own varying loads and
of the system's loads and connectors: those on the body's node, and those on its interface as forces f (m,) on points.
The data node describes the level:

    (c,)      number of every element's state: of a contact 0 open, 1 closed
    (e,)      phase of every guard: 0 armed, 1 recovering, 2 refused, 3 held back; zeros beyond those of the level
    (h,) [m]  stick positions of the links that have one

The trapezoidal rule changes the motion of modes that are not matched to its step h: it lowers the frequency of a mode,
so after a time t its phase lags by

    phi = (omega - (2/h) arctan(omega h/2)) t,   about omega t (omega h)^2 / 12

From the state at the start of a run and at every event on, and with that at its end for the whole run, as others may
have excited the body on the way, the error of a displacement is estimated as

    sqrt(sum a^2 min(phi, 2)^2 / max sum (eta^2 + eta'^2/omega^2)),   a^2 = (eta''/omega^2)^2 + (eta'/omega)^2

summed over the modes, whose vibration has the amplitude a: what follows a slow force has none, and fast modes that do
not vibrate do not count. On the cantilever of the examples the error is .4 to 4.4 times the estimate. It is kept for
halved steps too, to name steps that are short enough.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import exudyn as exu
import numpy as np

from multiphi_exudyn.display import per_cent
from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.exudyn_plugin.discretised_level import DiscretisedLevel
from multiphi_exudyn.exudyn_plugin.interface import Interface
from multiphi_exudyn.exudyn_plugin.own_loads import OwnLoads
from multiphi_exudyn.levels.level.level import Level
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mathematics.bounded_cache import BoundedCache
from multiphi_exudyn.mechanics.force_law import ForceLaw
from multiphi_exudyn.time.law_warnings import LawPlaces
from multiphi_exudyn.time.loaded_level import LoadedLevel
from multiphi_exudyn.time.run_warnings import RunSummary
from multiphi_exudyn.time.state import Loss, Phase, State

__all__ = ["SAME_STEP", "BodyParts", "RunRecord", "StepErrors", "matrices"]

PHASES = tuple(Phase)
ONE = np.ones(1)  # the entry 1 of x = (q, q', q'', 1, f)
SAME_STEP = 1e-6  # relative: a smaller change of the step size is rounding of the times
TOLERATED = 0.005  # of the largest displacement: a smaller estimate is not told
OPPOSITE = 2.0  # largest difference of two vibrations of amplitude one
HALVED = 0.5 ** np.arange(16)  # steps in units of the solver's


class LevelData:
    """Layout of a model's level data; width: c + e + h, e the largest number of exits of a level; held_count: h."""

    def __init__(self, model: MultiPhiModel) -> None:
        self._exits = [[len(state.exits) for state in contact.states] for contact in model.contacts]
        self._count, exit_count = len(self._exits), sum(max(exits) for exits in self._exits)
        self._held_slice = slice(self._count + exit_count, self._count + exit_count + len(model.held))
        self.width, self.held_count = self._held_slice.stop, len(model.held)

    def from_state(self, state: State) -> np.ndarray:
        """Data (width,) of a state."""
        phases = np.array([[PHASES.index(phase) for phase in state.phases]])
        return self.rows(state.states, phases, state.held[None])[0]

    def rows(self, states: Sequence[int], phases: np.ndarray, held: np.ndarray) -> np.ndarray:
        """Data (n, width) of n states of one level, with phase numbers (n, k) and stick positions (n, h)."""
        data = np.zeros((len(held), self.width))
        data[:, : self._count], data[:, self._held_slice] = states, held
        data[:, self._count : self._count + phases.shape[1]] = phases
        return data

    def states(self, data: np.ndarray) -> np.ndarray:
        """Numbers (.., c) of the elements' states in data (.., width)."""
        return np.rint(data[..., : self._count]).astype(int)

    def held(self, data: np.ndarray) -> np.ndarray:
        """Stick positions (.., h) [m] in data (.., width)."""
        return np.asarray(data[..., self._held_slice])

    def read(self, data: np.ndarray) -> tuple[tuple[int, ...], tuple[Phase, ...], np.ndarray]:
        """States, phases and stick positions in data (width,)."""
        states = tuple(self.states(data).tolist())
        exits = sum(self._exits[i][state] for i, state in enumerate(states))
        phases = data[self._count : self._count + exits].tolist()
        return states, tuple(PHASES[round(phase)] for phase in phases), self.held(data).copy()


class Coordinates:
    """Coordinates (s,) of one body in an Exudyn system.

    items: typed indices of the body's items. discretised: level whose matrices the system has. held: stick positions
    (h,) [m] in the interface. layout: of the data node. interface: its interface coordinates, or None.
    max_levels: number of levels of which Exudyn's own matrices are kept. matched: whether M differs among levels.
    During a run, first: index of its first coordinate in the system; views: of q, q', q'' in the system's current
    state; multipliers: view of all multipliers.
    rigid: whether the body has rigid links. has_friction: whether links have stick positions.
    """

    def __init__(
        self,
        items: dict[str, Any],
        discretised: DiscretisedLevel,
        held: np.ndarray,
        layout: LevelData,
        max_levels: int,
        matched: bool,
    ) -> None:
        self.items = items
        self.discretised, self.held, self.layout = discretised, held, layout
        self.rigid = bool(np.any(np.isinf(discretised.loaded.level.base.stiffnesses)))
        self.has_friction = layout.held_count > 0
        self._matched = matched
        self._prepared = BoundedCache[tuple[int, ...], dict[str, Any]](max_levels)
        self.interface: Interface | None = None
        self.first = 0
        self.views: tuple[np.ndarray, ...] = ()
        self.multipliers = np.zeros(0)

    @property
    def point_count(self) -> int:
        """m, the number of interface coordinates."""
        return 0 if self.interface is None else self.interface.count

    def attach(self, mbs: Any) -> None:
        """Take the views of the system's current state; they are valid for one run."""
        state, size = mbs.systemData.GetSystemStateDict(reference=True), self.discretised.size
        self.first = mbs.GetNodeODE2Index(self.items["nGenericODE2"])
        own = slice(self.first, self.first + size)
        self.views = tuple(state[key][own] for key in ("ODE2Coords", "ODE2Coords_t", "ODE2Coords_tt"))
        self.multipliers = state["AECoords"]
        if self.interface is not None:
            self.interface.attach(state)
        if "nGenericData" in self.items:
            indices = mbs.systemData.GetNodeLTGData(self.items["nGenericData"])
            self._data = state["dataCoords"][indices[0] : indices[0] + len(indices)]

    def copy_state(self) -> np.ndarray:
        """A copy x = (q, q', q'', 1, f) of the present state."""
        if self.interface is None:
            return np.concatenate([*self.views, ONE])
        return np.concatenate([*self.views, ONE, self.interface.forces])

    def write(self, discretised: DiscretisedLevel, held: np.ndarray, values: Iterable[np.ndarray]) -> None:
        """Write q, q', q'' (s,) of a level with stick positions (h,) [m], and the interface coordinates they give."""
        q, q_t, q_tt = self.views
        q[:], q_t[:], q_tt[:] = values
        if self.interface is not None:
            self.interface.write(discretised, held, self.views)

    def set_level(self, mbs: Any, discretised: DiscretisedLevel, force: np.ndarray) -> None:
        """Give the system the matrices of a level and the force vector (s,) of the body."""
        self.discretised = discretised
        links = discretised.loaded.level.indices
        prepared = self._prepared.get_or_build(links, lambda: _containers(discretised))
        for parameter, value in prepared.items():
            mbs.SetObjectParameter(self.items["oGenericODE2"], parameter, value)
        mbs.SetObjectParameter(self.items["oGenericODE2"], "forceVector", force)
        if self.interface is not None:
            self.interface.set_level(discretised, self.held)

    def set_level_in_run(self, mbs: Any, discretised: DiscretisedLevel, force: np.ndarray) -> None:
        """``set_level`` within a run of the dynamic solver."""
        self.set_level(mbs, discretised, force)
        if self._matched:  # a solver may keep a mass matrix that it takes for constant
            mbs.sys["dynamicSolver"].ComputeMassMatrix(mbs)
        mbs.solverSignalJacobianUpdate = True

    def set_level_if_changed(
        self, mbs: Any, discretised: DiscretisedLevel, held: np.ndarray, force: np.ndarray
    ) -> None:
        """Set a level with stick positions (h,) [m] within a run, if either differs from the present one."""
        if discretised.states != self.discretised.states or np.any(held != self.held):
            self.held = held
            self.set_level_in_run(mbs, discretised, force)

    def direct_reactions(self, discretised: DiscretisedLevel) -> np.ndarray:
        """L (k, m) in a level: L f [N] are reactions of the closed contacts to f that its modes do not contain."""
        if self.interface is None:
            return np.zeros((len(discretised.loaded.level.indices), 0))
        return self.interface.map_in(discretised).direct_reactions

    def write_level_data(self, data: np.ndarray) -> None:
        """Write level data (width,) into the data node."""
        if "nGenericData" in self.items:
            self._data[:] = data

    def read_level_data(self) -> tuple[tuple[int, ...], tuple[Phase, ...], np.ndarray]:
        """States, phases and stick positions from the data node."""
        return self.layout.read(self._data if "nGenericData" in self.items else np.zeros(0))


def matrices(discretised: DiscretisedLevel, force: np.ndarray) -> dict[str, np.ndarray]:
    """Parameters of the ObjectGenericODE2 in a level."""
    return {
        "massMatrix": discretised.mass,
        "dampingMatrix": discretised.damping,
        "stiffnessMatrix": discretised.stiffness,
        "forceVector": force,
    }


def _containers(discretised: DiscretisedLevel) -> dict[str, Any]:
    """Mass, damping and stiffness as Exudyn's own matrices, which are set without a conversion entry by entry."""
    parameters = matrices(discretised, discretised.drive)
    del parameters["forceVector"]
    return {parameter: exu.MatrixContainer(value) for parameter, value in parameters.items()}


class RunRecord:
    """Levels of a run, the energy lost at its start, and its largest energy [J] there and after events."""

    def __init__(self, start: State, lost: Loss) -> None:
        self._levels: dict[tuple[int, ...], Level] = {}
        self._truncated = _truncated(lost)
        self._energy = 0.0
        self._places = LawPlaces()
        self.include_state(start, lost.total)

    def include_state(self, state: State, lost: float = 0.0) -> None:
        """Include the level and the energy of a state; lost: energy [J] lost right before, which is added."""
        self.include_level(state.level.level)
        self.include_energy(state.kinetic + float(state.level.strain(state.displacement)) + lost)

    def include_level(self, level: Level) -> None:
        """Include a level."""
        self._levels.setdefault(level.indices, level)

    def include_places(self, level: LoadedLevel, xi: np.ndarray, times: np.ndarray) -> None:
        """Include the places of force laws in a last segment, at coordinates (r, k) of a level at times (k,) [s]."""
        for i, law in enumerate(level.level.base.contacts):
            if isinstance(law, ForceLaw) and law.is_last(level.states[i]):
                gaps = level.level.gap_rows[i] @ xi + level.gap_constants[i]
                self._places.include(law, times, law.centre + gaps)

    def include_energy(self, energy: float) -> None:
        """Include an energy [J] in the largest one."""
        self._energy = max(self._energy, energy)

    def summary(self, lost: Loss, truncated: float) -> RunSummary:
        """Summary of the run; lost: at events, truncated: at events that ``lost`` does not contain [J]."""
        return RunSummary(
            tuple(self._levels.values()), self._truncated + _truncated(lost) + truncated, self._energy, self._places
        )


def _truncated(loss: Loss) -> float:
    return loss.truncation_kinetic + loss.truncation_strain


class StepErrors:
    """Estimate for a run from ``start`` to ``end`` [s] in steps of length ``step`` [s].

    corrected: whether events correct the motion, which then lags from one to the next only.
    """

    def __init__(self, step: float, start: float, end: float, corrected: bool) -> None:
        self.step, self._start, self._end, self._corrected = step, start, end, corrected
        self._last: tuple[float, np.ndarray, np.ndarray] = end, np.zeros(0), np.zeros(0)
        self._squares, self._size, self._fastest = np.zeros(len(HALVED)), 0.0, 0.0

    def include(self, coordinates: Coordinates, time: float) -> None:
        """Include the present state of a body, at the start of the run or after an event at a time [s]."""
        if self._corrected:
            self._squares = self._squares_until(time)
        discretised = coordinates.discretised
        r, s = discretised.modes, discretised.size
        eta, eta_t, eta_tt = np.split(discretised.to_physical @ np.concatenate(coordinates.views), 3)
        vibrates = np.flatnonzero(discretised.squares[:r] > 0)
        squares = discretised.squares[vibrates]
        omega, moved = np.sqrt(squares), eta_t[vibrates] ** 2 / squares
        self._size = max(self._size, float(np.sum(eta[:s] ** 2) + np.sum(moved)))
        self._last = time, omega, (eta_tt[vibrates] / squares) ** 2 + moved
        self._fastest = max(self._fastest, float(np.max(omega, initial=0.0)))
        if not self._corrected:
            self._squares = self._squares_until(self._end)

    def finish(self, coordinates: Coordinates) -> None:
        """Include the state at the end of the run."""
        if not self._corrected:
            self.include(coordinates, self._start)

    def _squares_until(self, time: float) -> np.ndarray:
        """Largest squares of the errors until a time [s], for all steps (k,)."""
        start, omega, amplitudes = self._last
        steps = self.step * HALVED[:, None]
        lag = (omega - 2 / steps * np.arctan(omega * steps / 2)) * (time - start)
        return np.maximum(self._squares, np.minimum(lag, OPPOSITE) ** 2 @ amplitudes)

    @property
    def warnings(self) -> Iterator[str]:
        """Warning of steps that are too long."""
        squares = self._squares_until(self._end)
        errors = np.sqrt(squares / self._size) if self._size > 0 else squares
        if errors[0] <= TOLERATED:
            return
        step, longest = self.step, math.pi / self._fastest
        enough = step * float(np.max(HALVED[errors <= TOLERATED], initial=HALVED[-1]))
        shorter = f"take steps of {enough:.2g} s"
        remedy = f"give matchedStepSize={step:g}, or {shorter}"
        if step >= longest:
            remedy = f"{shorter}, or steps below {longest:.3g} s with the same matchedStepSize, or keep fewer modes"
        count = 2 * longest / step
        yield (
            f"coarse steps: the modes are not matched to steps of {step:g} s, {count:.3g} in the shortest kept period, "
            f"which delay the motion by an estimated {per_cent(float(errors[0]))} of it; {remedy}"
        )


class BodyParts:
    """What a body has whatever runs it: name, model, items, loads, levels, coordinates, and a record of its last run.

    matched_step: step size [s] that its modes are matched to, or None. own_loads: in the present run.
    """

    def __init__(self, name: str, loads: OwnLoads, start: State, lost: Loss, matched_step: float | None) -> None:
        self.name, self.model, self.matched_step = name, loads.loaded_levels.model, matched_step
        self.items: dict[str, Any] = {}
        self.own_loads, self.record = loads, RunRecord(start, lost)
        self._step_errors: StepErrors | None = None
        most = self.model.most_levels
        self._discretised_levels = BoundedCache[tuple[int, ...], DiscretisedLevel](most)
        layout, discretised = LevelData(self.model), self.discretised_level(start.states)
        self.coordinates = Coordinates(self.items, discretised, start.held, layout, most, matched_step is not None)

    @property
    def varies(self) -> bool:
        """Whether the body's loads vary in time."""
        return self.own_loads.varies

    def discretised_level(self, states: Sequence[int]) -> DiscretisedLevel:
        """The solver's level in which the elements are in these states."""
        key = tuple(states)
        return self._discretised_levels.get_or_build(
            key, lambda: self.own_loads.discretised_level(key, self.matched_step)
        )

    def check_step(self, step: float) -> None:
        """Raise where modes are matched to another step size than this one [s]."""
        if self.matched_step is not None and abs(step - self.matched_step) > SAME_STEP * step:
            raise MultiPhiValueError(
                f"matchedStepSize of {self.name!r}: got {self.matched_step:g} s and a solver's step of {step:g} s, "
                "need the same (beside Exudyn's own contacts set discontinuous.useRecommendedStepSize=False)"
            )

    def include_step_error(self, time: float) -> None:
        """Take notice of the present state, after an event at a time [s], for the estimate of the steps' error."""
        if self._step_errors is not None:
            self._step_errors.include(self.coordinates, time)
