"""Steady state: where a run under a harmonic load settles, found on the map of one period of the load.

The state at whole periods T of the load is a sequence, q = (s y, y', F / sqrt(k)) with s = max(omega, 2 pi / T), y in
base coordinates, F the forces of springs k in series with friction,

    q_k+1 = P(q_k)

A response of order p repeats after p periods, P^p(q) = q: 1 is a periodic response, 2 and more a sub-harmonic one. The
run goes on from chunk to chunk of periods until the states repeat to a tolerance; that test decides. What decays slowly
is not waited for: between chunks Newton's method looks for the repeating state (shooting.py), and the next chunk starts
there, if the state attracts. Everything is handed on from chunk to chunk, places that friction holds too. Where a link
sticks for ever, to every such place belongs another response; found is that to which the start leads.
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
from multiphi_exudyn.levels.mode_choice import Tolerance
from multiphi_exudyn.levels.model import MultiPhiModel
from multiphi_exudyn.levels.static_equilibrium import Equilibrium
from multiphi_exudyn.mechanics.arguments import is_real
from multiphi_exudyn.mechanics.loads import HarmonicLoad
from multiphi_exudyn.mechanics.moving_supports import BaseMotion
from multiphi_exudyn.mechanics.static_loads import ConstantLoad, Gravity, StaticLoad
from multiphi_exudyn.mechanics.structure import At
from multiphi_exudyn.mechanics.time_functions import Harmonic
from multiphi_exudyn.steady.shooting import PeriodMap, Shooting
from multiphi_exudyn.time.reliability import warnings_of
from multiphi_exudyn.time.simulate import Run, holding, outside_of, started
from multiphi_exudyn.time.trajectory import Trajectory
from multiphi_exudyn.time.warning_groups import grouped, issue, kept_back

__all__ = ["PeriodicLoad", "SteadyState", "at_frequency", "settled", "steady_state"]

HIGHEST_ORDER = 8  # of a sub-harmonic response that is looked for
CHUNK = 2 * HIGHEST_ORDER  # periods run at a time: every order is seen to repeat
NEAR = 0.03  # of the size of the motion: states that repeat to this are worth Newton's method
DIFFERENCE = 1e-6  # of the size of the motion: step of the finite differences, half the digits
TIGHTEST = 1e-12  # tolerance: below it lies the round-off of a period
SAMPLES = 64  # of a period of the load, for the size of the motion; HIGHEST_ORDER times as many to look for extremes
ZOOM = 32  # samples between the neighbours of an extreme,
ZOOMS = 3  # so often: the extreme is then known to the square of (2 / ZOOM)^ZOOMS / SAMPLES

PeriodicLoad: TypeAlias = "HarmonicLoad | BaseMotion"


@dataclass(frozen=True, repr=False)
class SteadyState(Shown):
    """Result of ``steady_state``: where a run under a harmonic load has settled.

    Attributes
    ----------
    status : str
        "periodic", "not settled" or "failed".
    message : str
        The cause of the latter two.
    load : HarmonicLoad or BaseMotion
        Of the run.
    order : int
        Periods of the load in one of the response, 2 and more for a sub-harmonic one, 0 where it is not periodic.
    residual : float
        By how much states ``order`` periods apart differ, relative to the size of the motion, both in sqrt(energy);
        where it is not periodic the smallest over all orders.
    multiplier : float
        The largest modulus by which a small disturbance grows in a period of the load; NaN where the run settled by
        itself. Friction that never slips has no part in it.
    periods : int
        Of the load, run one after the other.
    trajectory : Trajectory
        One period of the response, or the last 16 periods of the load where it is not periodic; a failed run ends
        early.
    displacement, velocity : array (n,)
        x [m, rad] and x' [m/s, rad/s] at the end of the run: another one can go on from there.
    warnings : tuple of str
        What to distrust in the trajectory, and kinds that only runs before it had, which the sentence then says.

    Examples
    --------
    >>> import numpy as np
    >>> import multiphi_exudyn as mp
    >>> K = 4e4 * np.array([[2, -1, 0], [-1, 2, -1], [0, -1, 1]])  # N/m
    >>> chain = mp.LinearStructure(np.eye(3), K, mp.ModalDamping(0.01), {"tip": 2})
    >>> stop = mp.UnilateralContact("stop", "tip", gap=1e-3, stiffness=1e6)
    >>> model = mp.MultiPhiModel(chain, [stop])
    >>> state = mp.steady_state(model, mp.HarmonicLoad("tip", 20.0, 12.0))
    >>> state.status, state.order
    ('periodic', 1)
    >>> round(state.duty("stop"), 3)  # part of the time in which the stop is closed
    0.039
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
        """Half the difference between the largest and the smallest displacement [m] of a point; NaN where failed."""
        if self.status == "failed":
            return math.nan
        return _half_range(self.trajectory, point, 0.0, self.trajectory.t_end)

    def amplitudes(self, point: At) -> np.ndarray:
        """Half the range [m] of a point in every period of the load in the trajectory, (k,); NaN where failed."""
        if self.status == "failed":
            return np.array([math.nan])
        ends = np.linspace(0.0, self.trajectory.t_end, 1 + max(1, round(self.trajectory.t_end * frequency(self.load))))
        return np.array([_half_range(self.trajectory, point, *given) for given in itertools.pairwise(ends.tolist())])

    def duty(self, contact: str) -> float:
        """Part of the time that a contact is closed, 0 to 1; NaN where failed."""
        if self.status == "failed":
            return math.nan
        intervals = self.trajectory.contact_intervals(contact)
        return sum(end - start for start, end in intervals) / self.trajectory.t_end


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
    """The response that a run under a harmonic load settles to.

        q_k+1 = P(q_k),   P^p(q) = q

    q is the state at whole periods of the load, P one period of the run, p the order of the response. The run goes on
    until states repeat; what decays slowly is not waited for, but found by Newton's method from where the run is. Which
    response, where several attract, follows from the start: places that friction holds are part of it, and only
    ``start`` hands them on.

    Parameters
    ----------
    model : MultiPhiModel
        Structure and contacts; one with a ``Tolerance`` has to be decided, by a run of ``simulate``.
    load : HarmonicLoad or BaseMotion
        A base motion with a Harmonic course.
    displacement, velocity : array (n,), default None
        x [m, rad] and x' [m/s, rad/s] at t = 0, None for zero.
    other_loads : sequence of ConstantLoad and Gravity, default ()
        That act as well.
    periods : int, default 400
        Of the load, after which a run that has not settled ends.
    tolerance : float, default 1e-6
        Relative to the size of the motion, to which states repeat; 1e-12 at least.
    start : Trajectory or Equilibrium, default None
        What it starts from instead, as in ``simulate``; time begins anew.

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
        For a frequency of zero, a model with a Tolerance that has not decided, and periods or a tolerance out of range.

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
        state = settled(model, load, (displacement, velocity, start), other_loads, periods, tolerance)
    issue(state.warnings)
    return state


def settled(
    model: MultiPhiModel,
    load: PeriodicLoad,
    begin: tuple[np.ndarray | None, np.ndarray | None, Trajectory | Equilibrium | None],
    other_loads: Sequence[StaticLoad],
    periods: int,
    tolerance: float,
) -> SteadyState:
    """What ``steady_state`` gives, without its MultiPhiWarning; begin: x, x' (n,) and its ``start``."""
    _check(model, load, other_loads, periods, tolerance)
    (displacement, velocity, start), loads, period = begin, (load, *other_loads), 1.0 / frequency(load)
    model = holding(model.decided or model, loads, start)
    run = started(Run(model, CHUNK * period, displacement, velocity, loads, start=start, rewound=True))
    search = _Search(PeriodMap(model, loads, period), load, tolerance, outside_of(run, model))
    return search.settle(_warned(run.trajectory()), periods)


def at_frequency(load: PeriodicLoad, frequency_hz: float) -> PeriodicLoad:
    """The same load at another frequency."""
    if isinstance(load, HarmonicLoad):
        return replace(load, frequency_hz=frequency_hz)
    return replace(load, course=replace(_course(load), frequency_hz=frequency_hz))


@dataclass(frozen=True)
class _Chunk:
    """Some periods of a run: q (2 m + e, k + 1) at whole periods, size of the motion, trajectory."""

    states: np.ndarray
    size: float
    trajectory: Trajectory

    @property
    def drifts(self) -> np.ndarray:
        """By how much states 1 to HIGHEST_ORDER periods apart differ at most over the last HIGHEST_ORDER periods."""
        tail, q = self.states[:, -HIGHEST_ORDER:], self.states
        return np.array(
            [
                np.max(np.linalg.norm(tail - q[:, -HIGHEST_ORDER - p : q.shape[1] - p], axis=0))
                for p in range(1, HIGHEST_ORDER + 1)
            ]
        )

    @property
    def candidate(self) -> int:
        """The order that Newton's method is tried for: 1 where no contact changed, the map being linear; 0 for none."""
        if len(self.trajectory.segments) == 1:
            return 1
        near = np.flatnonzero(self.drifts <= NEAR * self.size)
        return int(near[0]) + 1 if len(near) else 0

    @property
    def reach(self) -> float:
        """How far from the last state the run has been in these periods."""
        return self.size + float(np.max(np.linalg.norm(self.states.T - self.states[:, -1], axis=1)))


@dataclass(frozen=True)
class _Search:
    """A search under way; see the module's docstring. outside: warnings of its base and start; warned: of chunks."""

    map: PeriodMap
    load: PeriodicLoad
    tolerance: float
    outside: tuple[str, ...]
    warned: list[tuple[str, ...]] = field(default_factory=list)

    def settle(self, trajectory: Trajectory, periods: int) -> SteadyState:
        """Chunks until states repeat, of which this is the first, Newton's method in between."""
        done, multiplier = 0, math.nan
        while True:
            self.warned.append(trajectory.warnings)
            if trajectory.status != "ok":
                return self._failed(trajectory, done)
            chunk, done = self._chunk(trajectory), done + CHUNK
            repeating = np.flatnonzero(chunk.drifts <= self.tolerance * chunk.size)
            if len(repeating):
                return self._found(chunk, int(repeating[0]) + 1, done, multiplier)
            if done >= periods:
                return self._lost(chunk, done)
            start, multiplier = self._shot(chunk)
            trajectory = self.run(start, CHUNK)

    def run(self, start: Trajectory, periods: int) -> Trajectory:
        """Periods from the end of a run on."""
        return _warned(self.map.run(start, periods))

    def _chunk(self, trajectory: Trajectory) -> _Chunk:
        whole = np.minimum(np.arange(CHUNK + 1) * self.map.period, trajectory.t_end)
        moving = self.map.states(trajectory, np.linspace(whole[-2], whole[-1], SAMPLES))
        size = float(np.max(np.linalg.norm(moving - np.mean(moving, axis=1, keepdims=True), axis=0)))
        return _Chunk(self.map.states(trajectory, whole), size, trajectory)

    def _shot(self, chunk: _Chunk) -> tuple[Trajectory, float]:
        """A run at whose end the next chunk starts, and the largest multiplier there."""
        order = chunk.candidate
        if not order:
            return chunk.trajectory, math.nan
        shooting = Shooting(self.map, order, chunk.trajectory, DIFFERENCE * chunk.size)
        return shooting.attracting(self.tolerance * chunk.size, chunk.reach) or (chunk.trajectory, math.nan)

    # ------------------------------------------------------------------ results

    def _found(self, chunk: _Chunk, order: int, done: int, multiplier: float) -> SteadyState:
        residual = chunk.drifts[order - 1] / chunk.size if chunk.size else 0.0
        shown = self.run(chunk.trajectory, order)
        (x, v), told = _reached(chunk.trajectory), self._told(shown)
        return SteadyState("periodic", "", self.load, order, float(residual), multiplier, done, shown, x, v, told)

    def _lost(self, chunk: _Chunk, done: int) -> SteadyState:
        order, residual = int(np.argmin(chunk.drifts)) + 1, float(np.min(chunk.drifts) / chunk.size)
        message = f"states {order} periods apart still differ by {residual:.2g} of the motion after {done} periods"
        x, v = _reached(chunk.trajectory)
        run, told = chunk.trajectory, self._told(chunk.trajectory)
        return SteadyState("not settled", message, self.load, 0, residual, math.nan, done, run, x, v, told)

    def _failed(self, trajectory: Trajectory, done: int) -> SteadyState:
        reached = done + int(trajectory.t_end / self.map.period)
        message = f"after {reached} periods: {trajectory.message}"
        shapes, start = self.map.model.base.modes.shapes, trajectory.start
        x, v = shapes @ start.displacement, shapes @ start.velocity
        told = self._told(trajectory)
        return SteadyState("failed", message, self.load, 0, math.nan, math.nan, reached, trajectory, x, v, told)

    def _told(self, shown: Trajectory) -> tuple[str, ...]:
        """Warnings of the trajectory that is shown, and kinds that only runs before it had."""
        own = {sentence.partition(": ")[0] for sentence in shown.warnings}
        before = grouped(("", sentences) for sentences in self.warned)
        earlier = [f"{group.kind}: before it settled, {group.example}" for group in before if group.kind not in own]
        return (*shown.warnings, *self.outside, *earlier)


def _warned(trajectory: Trajectory) -> Trajectory:
    """With its warnings."""
    return replace(trajectory, warnings=warnings_of(trajectory))


def _reached(trajectory: Trajectory) -> tuple[np.ndarray, np.ndarray]:
    """x, x' (n,) at its end."""
    return trajectory.displacement(trajectory.t_end), trajectory.velocity(trajectory.t_end)


def _half_range(trajectory: Trajectory, point: At, start: float, end: float) -> float:
    """Half the range of a point's displacement, sampled ever closer around the largest and the smallest sample."""
    return sum(_largest(trajectory, point, sign, start, end) for sign in (1.0, -1.0)) / 2


def _largest(trajectory: Trajectory, point: At, sign: float, start: float, end: float) -> float:
    """The largest value, times ``sign``: of a periodic motion it may lie just inside either end as well."""
    times = np.linspace(start, end, SAMPLES * HIGHEST_ORDER + 1)
    highest = int(np.argmax(sign * np.asarray(trajectory.at(point, times))))
    return max(_peak(trajectory, point, sign, times, k) for k in {0, highest, len(times) - 1})


def _peak(trajectory: Trajectory, point: At, sign: float, times: np.ndarray, k: int) -> float:
    """The largest value between the neighbours of the k-th of these times."""
    for _ in range(ZOOMS):
        times = np.linspace(times[max(k - 1, 0)], times[min(k + 1, len(times) - 1)], ZOOM + 1)
        values = sign * np.asarray(trajectory.at(point, times))
        k = int(np.argmax(values))
    return float(values[k])


def frequency(load: PeriodicLoad) -> float:
    """Of the load [Hz]."""
    return _course(load).frequency_hz


def _course(load: PeriodicLoad) -> Harmonic:
    if not isinstance(load, (HarmonicLoad, BaseMotion)):
        raise MultiPhiTypeError(f"load: got {type(load).__name__}, need HarmonicLoad or BaseMotion")
    course = load.course
    if not isinstance(course, Harmonic):
        raise MultiPhiTypeError(f"load course: got {type(course).__name__}, need Harmonic")
    return course


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
