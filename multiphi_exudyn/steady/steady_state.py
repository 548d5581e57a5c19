"""Steady state: the response to which a run under a harmonic load settles, from the map of one period of the load.

The state at whole periods T of the load is a sequence, q = (s y, y', F / sqrt(k)) with s = max(omega, 2 pi / T), y in
base coordinates, F the forces of springs k in series with friction,

    q_k+1 = P(q_k)

A response of order p repeats after p periods, P^p(q) = q: p = 1 is a periodic response, p > 1 a sub-harmonic one. The
run continues in chunks of periods until the states repeat to a tolerance. To save time with slowly decaying motions,
Newton's method searches for the repeating state between chunks (shooting.py), and if it is an attractor the next chunk
starts there. A chunk takes over the whole final state of the previous one, stick positions included. If a link sticks
for ever, every stick position belongs to another response; the result is the one to which the start leads.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeAlias

import numpy as np

from multiphi_exudyn.display import Shown, kinds
from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.levels.equilibrium.static_equilibrium import Equilibrium
from multiphi_exudyn.levels.model.mode_choice import Tolerance
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mechanics.arguments import is_real
from multiphi_exudyn.mechanics.loads import BaseMotion, ConstantLoad, Gravity, HarmonicLoad, StaticLoad
from multiphi_exudyn.mechanics.structure import At
from multiphi_exudyn.mechanics.time_functions import Harmonic
from multiphi_exudyn.steady.shooting import PeriodMap, Shooting
from multiphi_exudyn.time.model_warnings import grouped, issue, kept_back
from multiphi_exudyn.time.run_warnings import warnings_of
from multiphi_exudyn.time.simulate import Run, base_warnings_of, check_start, holding
from multiphi_exudyn.time.trajectory import Trajectory

__all__ = [
    "CHUNK",
    "HIGHEST_ORDER",
    "SAMPLES",
    "PeriodicLoad",
    "Search",
    "SteadyState",
    "at_frequency",
    "course_of",
    "frequency",
    "settle_run",
    "steady_state",
    "with_warnings",
]

HIGHEST_ORDER = 8  # highest order of a sub-harmonic response
SAMPLES = 64  # per period of the load, for the size of the motion; HIGHEST_ORDER times as many for extremes
ZOOM_SAMPLES = 32  # samples between the neighbours of an extreme, in every step of the refinement
ZOOM_STEPS = 3  # of the refinement: the error of an extreme is of the order ((2 / ZOOM_SAMPLES)^ZOOM_STEPS / SAMPLES)^2
PeriodicLoad: TypeAlias = "HarmonicLoad | BaseMotion"
TIGHTEST = 1e-12  # smallest tolerance, above the round-off of a period
CHUNK = 2 * HIGHEST_ORDER  # periods of a chunk, enough for a repetition of every order
CANDIDATE = 0.03  # of the size of the motion: if states repeat to this, Newton's method is tried
DIFFERENCE = 1e-6  # of the size of the motion: step of the finite differences, the root of round-off


@dataclass(frozen=True, repr=False)
class SteadyState(Shown):
    """Result of ``steady_state``: the steady state of a run under a harmonic load.

    Attributes
    ----------
    status : str
        "periodic", "not settled" or "failed".
    message : str
        Cause if the state is not periodic, else empty.
    load : HarmonicLoad or BaseMotion
        Load of the run.
    order : int
        Periods of the load in one period of the response, 2 and more for a sub-harmonic one, 0 if it is not periodic.
    residual : float
        Difference of states ``order`` periods apart, relative to the size of the motion, both in sqrt(energy); if it is
        not periodic, the smallest of all orders.
    multiplier : float
        Largest growth factor of a small disturbance in a period of the load; NaN if the run settled without Newton's
        method. Stick positions of friction that never slips are left out.
    periods : int
        Number of periods of the load in the run.
    trajectory : Trajectory
        One period of the response, or the last 16 periods of the load if it is not periodic; a failed run ends early.
    displacement, velocity : array (n,)
        x [m, rad] and x' [m/s, rad/s] at the end of the run, from which another run can continue.
    warnings : tuple of str
        Warnings about the accuracy of the trajectory, and of earlier chunks of the run.
    """

    status: str
    message: str
    load: PeriodicLoad
    order: int
    residual: float
    multiplier: float
    periods: int
    trajectory: Trajectory
    displacement: np.ndarray
    velocity: np.ndarray
    warnings: tuple[str, ...] = ()

    def _facts(self) -> Iterator[tuple[str, str]]:
        yield "status", f"{self.status}{f', {self.message}' if self.message else ''}"
        yield "load", str(self.load)
        yield "order", str(self.order)
        yield "residual", f"{self.residual:.2g}"
        yield "largest multiplier", f"{self.multiplier:.4g}"
        yield "warnings", kinds(self.warnings)

    def amplitude(self, point: At) -> float:
        """Half the range of the displacement [m] of a point; NaN if failed."""
        if self.status == "failed":
            return math.nan
        return _half_range(self.trajectory, point, 0.0, self.trajectory.t_end)

    def amplitudes(self, point: At) -> np.ndarray:
        """Half the range (k,) of the displacement [m] of a point in every period of the trajectory; NaN if failed."""
        if self.status == "failed":
            return np.array([math.nan])
        ends = np.linspace(0.0, self.trajectory.t_end, 1 + max(1, round(self.trajectory.t_end * frequency(self.load))))
        return np.array([_half_range(self.trajectory, point, *period) for period in itertools.pairwise(ends.tolist())])

    def duty(self, contact: str) -> float:
        """Part of the time in which a contact is closed, 0 to 1; NaN if failed."""
        if self.status == "failed":
            return math.nan
        intervals = self.trajectory.contact_intervals(contact)
        return sum(end - start for start, end in intervals) / self.trajectory.t_end


def _half_range(trajectory: Trajectory, point: At, start: float, end: float) -> float:
    """Half the range of a point's displacement, with refined sampling around the largest and the smallest sample."""
    return sum(_largest(trajectory, point, sign, start, end) for sign in (1.0, -1.0)) / 2


def _largest(trajectory: Trajectory, point: At, sign: float, start: float, end: float) -> float:
    """Largest value of sign times the displacement; in a periodic motion it may also lie next to either end."""
    times = np.linspace(start, end, SAMPLES * HIGHEST_ORDER + 1)
    highest = int(np.argmax(sign * np.asarray(trajectory.at(point, times))))
    return max(_peak(trajectory, point, sign, times, k) for k in {0, highest, len(times) - 1})


def _peak(trajectory: Trajectory, point: At, sign: float, times: np.ndarray, k: int) -> float:
    """Largest value between the neighbours of the k-th of these times."""
    for _ in range(ZOOM_STEPS):
        times = np.linspace(times[max(k - 1, 0)], times[min(k + 1, len(times) - 1)], ZOOM_SAMPLES + 1)
        values = sign * np.asarray(trajectory.at(point, times))
        k = int(np.argmax(values))
    return float(values[k])


def frequency(load: PeriodicLoad) -> float:
    """Frequency of a load [Hz]."""
    return course_of(load).frequency_hz


def course_of(load: PeriodicLoad) -> Harmonic:
    if not isinstance(load, (HarmonicLoad, BaseMotion)):
        raise MultiPhiTypeError(f"load: got {type(load).__name__}, need HarmonicLoad or BaseMotion")
    course = load.course
    if not isinstance(course, Harmonic):
        raise MultiPhiTypeError(f"load course: got {type(course).__name__}, need Harmonic")
    return course


def steady_state(
    model: MultiPhiModel,
    load: PeriodicLoad,
    *,
    displacement: np.ndarray | None = None,
    velocity: np.ndarray | None = None,
    other_loads: Sequence[StaticLoad] = (),
    periods: int = 400,
    tolerance: float = 1e-6,
    start: Trajectory | Equilibrium | None = None,
) -> SteadyState:
    """Steady state of a run under a harmonic load.

        q_k+1 = P(q_k),   P^p(q) = q

    q is the state at whole periods of the load, P one period of the run, p the order of the response. The run continues
    until the states repeat; for slowly decaying motions Newton's method finds the repeating state from the present one.
    If there are several attractors, the start determines the response; the start includes stick positions of friction,
    which only ``start`` can give.

    Parameters
    ----------
    model : MultiPhiModel
        Structure and contacts; a ``Tolerance`` needs a run of ``simulate`` before, which determines the modes.
    load : HarmonicLoad or BaseMotion
        The harmonic load; a base motion needs a Harmonic course.
    displacement, velocity : array (n,), default None
        x [m, rad] and x' [m/s, rad/s] at t = 0, None for zero.
    other_loads : sequence of ConstantLoad and Gravity, default ()
        Static loads that act as well.
    periods : int, default 400
        Number of periods of the load after which a run that has not settled ends.
    tolerance : float, default 1e-6
        Tolerance to which states repeat, relative to the size of the motion; at least 1e-12.
    start : Trajectory or Equilibrium, default None
        Start of the run instead of a displacement, as in ``simulate``; time begins anew.

    Returns
    -------
    SteadyState
        "periodic", "not settled" or "failed", with its cause. A MultiPhiWarning is issued for each kind of its
        warnings.

    Raises
    ------
    MultiPhiTypeError
        For arguments of another kind, and a BaseMotion that is not Harmonic.
    MultiPhiValueError
        For a frequency of zero, a model with an undecided Tolerance, and periods or a tolerance out of range.

    Examples
    --------
    >>> import numpy as np
    >>> import multiphi_exudyn as mp
    >>> K = 4e4 * np.array([[2, -1, 0], [-1, 2, -1], [0, -1, 1]])  # N/m
    >>> chain = mp.LinearStructure(np.eye(3), K, mp.ModalDamping(0.01), {"tip": 2})
    >>> stop = mp.UnilateralContact("stop", "tip", gap=1e-3, stiffness=1e6)
    >>> model = mp.MultiPhiModel(chain, [stop])
    >>> state = mp.steady_state(model, mp.HarmonicLoad("tip", 20.0, 12.0))
    >>> state.status, round(1e3 * state.amplitude("tip"), 2)  # mm
    ('periodic', 1.76)
    """
    with kept_back():
        state = settle_run(model, load, (displacement, velocity, start), other_loads, periods, tolerance)
    issue(state.warnings)
    return state


def settle_run(
    model: MultiPhiModel,
    load: PeriodicLoad,
    begin: tuple[np.ndarray | None, np.ndarray | None, Trajectory | Equilibrium | None],
    other_loads: Sequence[StaticLoad],
    periods: int,
    tolerance: float,
) -> SteadyState:
    """Result of ``steady_state`` without its MultiPhiWarning; begin: x, x' (n,) and ``start``."""
    _check(model, load, other_loads, periods, tolerance)
    (displacement, velocity, start), loads, period = begin, (load, *other_loads), 1.0 / frequency(load)
    model = holding(model.decided or model, loads, start)
    run = Run(model, CHUNK * period, displacement, velocity, loads, start=start, rewound=True)
    check_start(run)
    search = Search(PeriodMap(model, loads, period), load, tolerance, base_warnings_of(run, model))
    return search.settle(with_warnings(run.trajectory()), periods)


def at_frequency(load: PeriodicLoad, frequency_hz: float) -> PeriodicLoad:
    """The load with another frequency [Hz]."""
    if isinstance(load, HarmonicLoad):
        return replace(load, frequency_hz=frequency_hz)
    return replace(load, course=replace(course_of(load), frequency_hz=frequency_hz))


def _check(
    model: MultiPhiModel, load: PeriodicLoad, other_loads: Sequence[StaticLoad], periods: int, tolerance: float
) -> None:
    if isinstance(model.modes, Tolerance) and model.decided is None:
        raise MultiPhiValueError(
            "model modes: got a Tolerance that has not decided yet, need a run of simulate first, a number or 'all'"
        )
    if frequency(load) == 0:
        raise MultiPhiValueError("load frequency_hz: got 0, need a frequency > 0 Hz")
    for other in other_loads:
        if not isinstance(other, (ConstantLoad, Gravity)):
            raise MultiPhiTypeError(f"other_loads: got {type(other).__name__}, need ConstantLoad or Gravity")
    if not isinstance(periods, (int, np.integer)) or periods < 1:
        raise MultiPhiValueError(f"periods: got {periods!r}, need an integer >= 1")
    if not is_real(tolerance) or not TIGHTEST <= tolerance < 1:
        raise MultiPhiValueError(f"tolerance: got {tolerance!r}, need {TIGHTEST:g} <= tolerance < 1")


@dataclass(frozen=True)
class _Chunk:
    """Some periods of a run: q (2 m + e, k + 1) at whole periods, size of the motion, trajectory."""

    states: np.ndarray
    size: float
    trajectory: Trajectory

    @property
    def drifts(self) -> np.ndarray:
        """Largest differences of states 1 to HIGHEST_ORDER periods apart, over the last HIGHEST_ORDER periods."""
        tail, q = self.states[:, -HIGHEST_ORDER:], self.states
        return np.array(
            [
                np.max(np.linalg.norm(tail - q[:, -HIGHEST_ORDER - p : q.shape[1] - p], axis=0))
                for p in range(1, HIGHEST_ORDER + 1)
            ]
        )

    @property
    def candidate(self) -> int:
        """Order for Newton's method: 1 without an event, as the map is then linear; 0 if no order is near."""
        if len(self.trajectory.segments) == 1:
            return 1
        near = np.flatnonzero(self.drifts <= CANDIDATE * self.size)
        return int(near[0]) + 1 if len(near) else 0

    @property
    def largest_distance(self) -> float:
        """Largest distance of the states in these periods from the last one, plus the size of the motion."""
        return self.size + float(np.max(np.linalg.norm(self.states.T - self.states[:, -1], axis=1)))


@dataclass(frozen=True)
class Search:
    """Search for a steady state, see the module's docstring.

    base_warnings: of the modal base and the start. chunk_warnings: of every chunk so far.
    """

    map: PeriodMap
    load: PeriodicLoad
    tolerance: float
    base_warnings: tuple[str, ...]
    chunk_warnings: list[tuple[str, ...]] = field(default_factory=list)

    def settle(self, trajectory: Trajectory, periods: int) -> SteadyState:
        """Run chunks until states repeat, ``trajectory`` being the first, with Newton's method between them."""
        done, multiplier = 0, math.nan
        while True:
            self.chunk_warnings.append(trajectory.warnings)
            if trajectory.status != "ok":
                return self._failed(trajectory, done)
            chunk, done = self._chunk(trajectory), done + CHUNK
            repeating = np.flatnonzero(chunk.drifts <= self.tolerance * chunk.size)
            if len(repeating):
                return self._periodic(chunk, int(repeating[0]) + 1, done, multiplier)
            if done >= periods:
                return self._not_settled(chunk, done)
            start, multiplier = self._next_start(chunk)
            trajectory = self.run(start, CHUNK)

    def run(self, start: Trajectory, periods: int) -> Trajectory:
        """Run over some periods from the end of another run, with its warnings."""
        return with_warnings(self.map.run(start, periods))

    def _chunk(self, trajectory: Trajectory) -> _Chunk:
        whole = np.minimum(np.arange(CHUNK + 1) * self.map.period, trajectory.t_end)
        moving = self.map.states(trajectory, np.linspace(whole[-2], whole[-1], SAMPLES))
        size = float(np.max(np.linalg.norm(moving - np.mean(moving, axis=1, keepdims=True), axis=0)))
        return _Chunk(self.map.states(trajectory, whole), size, trajectory)

    def _next_start(self, chunk: _Chunk) -> tuple[Trajectory, float]:
        """A run at whose end the next chunk starts, and the largest multiplier there, NaN without Newton's method."""
        order = chunk.candidate
        if not order:
            return chunk.trajectory, math.nan
        shooting = Shooting(self.map, order, chunk.trajectory, DIFFERENCE * chunk.size)
        return shooting.attractor(self.tolerance * chunk.size, chunk.largest_distance) or (chunk.trajectory, math.nan)

    # ------------------------------------------------------------------ results

    def _periodic(self, chunk: _Chunk, order: int, done: int, multiplier: float) -> SteadyState:
        residual = chunk.drifts[order - 1] / chunk.size if chunk.size else 0.0
        run = self.run(chunk.trajectory, order)
        (x, v), warnings = _final_state(chunk.trajectory), self._warnings(run)
        return SteadyState("periodic", "", self.load, order, float(residual), multiplier, done, run, x, v, warnings)

    def _not_settled(self, chunk: _Chunk, done: int) -> SteadyState:
        order, residual = int(np.argmin(chunk.drifts)) + 1, float(np.min(chunk.drifts) / chunk.size)
        message = f"states {order} periods apart still differ by {residual:.2g} of the motion after {done} periods"
        x, v = _final_state(chunk.trajectory)
        run, warnings = chunk.trajectory, self._warnings(chunk.trajectory)
        return SteadyState("not settled", message, self.load, 0, residual, math.nan, done, run, x, v, warnings)

    def _failed(self, trajectory: Trajectory, done: int) -> SteadyState:
        reached = done + int(trajectory.t_end / self.map.period)
        message = f"after {reached} periods: {trajectory.message}"
        shapes, start = self.map.model.base.modes.shapes, trajectory.start
        x, v = shapes @ start.displacement, shapes @ start.velocity
        warnings = self._warnings(trajectory)
        return SteadyState("failed", message, self.load, 0, math.nan, math.nan, reached, trajectory, x, v, warnings)

    def _warnings(self, run: Trajectory) -> tuple[str, ...]:
        """Warnings of a trajectory, and one sentence for every further kind that earlier chunks had."""
        shown_kinds = {sentence.partition(": ")[0] for sentence in run.warnings}
        before = grouped(("", sentences) for sentences in self.chunk_warnings)
        earlier = [
            f"{group.kind}: before it settled, {group.example}" for group in before if group.kind not in shown_kinds
        ]
        return (*run.warnings, *self.base_warnings, *earlier)


def with_warnings(trajectory: Trajectory) -> Trajectory:
    """The trajectory with its warnings."""
    return replace(trajectory, warnings=warnings_of(trajectory))


def _final_state(trajectory: Trajectory) -> tuple[np.ndarray, np.ndarray]:
    """x, x' (n,) at the end of a trajectory."""
    return trajectory.displacement(trajectory.t_end), trajectory.velocity(trajectory.t_end)
