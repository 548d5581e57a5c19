"""Simulation: exact modal motion from event to event (eqs. 38.3, 38.6). There is no time step.

The core advances the start from event to event. The result is a Trajectory of analytic segments. A failure ends the
trajectory early, with a status and its cause.

Smooth courses of loads are interpolated finely enough for their tolerance of the response: an error dp of a modal force
changes z = (omega eta, eta') by no more than the integral of |dp|, in every level. The error of the interpolated
courses, times |P| and the length of the run, is compared with the largest |z|. The bound does not include the
sensitivity to events, which separates any two motions that differ.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.levels.equilibrium.static_equilibrium import Equilibrium
from multiphi_exudyn.levels.model.mode_choice import Tolerance
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mathematics.bounded_cache import BoundedCache
from multiphi_exudyn.mechanics.arguments import is_real
from multiphi_exudyn.mechanics.loads import Load, StopsMotion, patterns, unchanging
from multiphi_exudyn.mechanics.time_functions import Harmonic, Smooth, Sweep
from multiphi_exudyn.time.continuation import continued_start, with_final_velocity
from multiphi_exudyn.time.excitation import Excitation
from multiphi_exudyn.time.loaded_levels import LoadedLevels
from multiphi_exudyn.time.model_warnings import base_warnings, issue
from multiphi_exudyn.time.motion import Motion
from multiphi_exudyn.time.run_warnings import warnings_of
from multiphi_exudyn.time.segments import Segment
from multiphi_exudyn.time.start import Starts
from multiphi_exudyn.time.trajectory import Trajectory
from multiphi_exudyn.time.truncation import run_with_enough_modes

__all__ = [
    "Run",
    "base_warnings_of",
    "check_start",
    "checked_end",
    "holding",
    "refined",
    "run_with_warnings",
    "simulate",
    "to_tolerance",
]


REFINEMENTS = 2  # of smooth courses; the second corrects for the changes by the first
SAFETY = 1.5  # on the factor by which they are refined
SAMPLES = 257  # of the energy, for its largest value


def simulate(
    model: MultiPhiModel,
    t_end: float,
    displacement: np.ndarray | None = None,
    velocity: np.ndarray | None = None,
    loads: Sequence[Load] = (),
    start: Trajectory | Equilibrium | None = None,
) -> Trajectory:
    """Motion of a model from 0 to ``t_end``, or from the end of another trajectory; exact between contact events.

        M x'' + C x' + K x = f(t) + sum_i h_i lambda_i

    Within a level the modes move in closed form; an event ends it where a gap closes, a contact force vanishes, or
    friction changes between stick and slip. There is no time step.

    Parameters
    ----------
    model : MultiPhiModel
        Structure, contacts and modes. The first run of a model with a ``Tolerance`` is repeated until its modes
        suffice; they are those of the trajectory's model, and of every later run of the same model.
    t_end : float
        End of the run [s].
    displacement, velocity : array (n,), default None
        x [m, rad] and x' [m/s, rad/s] at t = 0, None for zero; not modified.
    loads : sequence of loads, default ()
        ConstantLoad, Gravity, HarmonicLoad, SampledLoad, FunctionLoad, SweepLoad, StopMotion, BaseMotion.
    start : Trajectory or Equilibrium, default None
        A trajectory of the same model: the run continues from its complete final state, held places of friction and
        phases of contacts included, so that a truncated model too moves as it would have without the break. Time and
        the time of the loads go on from its t_end; the loads are not part of it: give them again, or others, which then
        begin with a jump. Or a ``MultiPhiModel.equilibrium``: the run starts at rest there, with the springs of
        friction stretched; its forces are not part of it.

    Returns
    -------
    Trajectory
        With status "ok", or "failed" with the cause in ``message``; it then ends early. Of a large structure its model
        has a base that holds the loads as well. What to distrust is in its ``warnings``, each of which is issued as a
        MultiPhiWarning too. Of a run that is ok the message says where the tolerance of a smooth load could not be
        reached.

    Raises
    ------
    MultiPhiTypeError
        For arguments of another kind.
    MultiPhiValueError
        For vectors that are not (n,) finite numbers, a time that is not > 0, a start inside a rigid stop, a ``start``
        that failed, is of another model or stands beside a displacement, and points and contacts that there are not.

    Examples
    --------
    Pulled with 100 N, let go, and striking a stop 1 mm below its rest:

    >>> import numpy as np
    >>> import multiphi_exudyn as mp
    >>> K = 4e4 * np.array([[2, -1, 0], [-1, 2, -1], [0, -1, 1]])  # N/m
    >>> chain = mp.LinearStructure(np.eye(3), K, mp.ModalDamping(0.01), {"tip": 2})
    >>> stop = mp.UnilateralContact("stop", "tip", gap=1e-3, stiffness=1e6)
    >>> model = mp.MultiPhiModel(chain, [stop])
    >>> pulled = model.static_equilibrium({"tip": 100.0})
    >>> tr = mp.simulate(model, 0.5, displacement=pulled)
    >>> tr.status, len(tr.contact_intervals("stop"))
    ('ok', 13)
    """
    end = checked_end(model, t_end)
    run = Run(holding(model, loads, start), end, displacement, velocity, loads, start)
    trajectory = run_with_warnings(run)
    issue(trajectory.warnings)
    return trajectory


def checked_end(model: MultiPhiModel, t_end: float) -> float:
    """Check a model and the end [s] of its run, and return the end."""
    if not isinstance(model, MultiPhiModel):
        raise MultiPhiTypeError(f"model: got {type(model).__name__}, need a MultiPhiModel")
    return _time("t_end", t_end)


def run_with_warnings(run: Run) -> Trajectory:
    """Trajectory of a run with its warnings, none of them issued."""
    modes = run.model.modes
    check_start(run)
    trajectory = run.trajectory()
    sentences = warnings_of(trajectory, modes if isinstance(modes, Tolerance) else None)
    if not trajectory.model.base.complete:
        sentences += base_warnings_of(run, trajectory.model)
    if sentences:
        object.__setattr__(trajectory, "warnings", sentences)  # it is new: no other reference to it exists
    return trajectory


def base_warnings_of(run: Run, model: MultiPhiModel, rows: Sequence[np.ndarray] = ()) -> tuple[str, ...]:
    """Sentences on what a base leaves out of a run and of further rows (k, n) on which forces act."""
    if model.base.complete:
        return ()
    acting = np.vstack([patterns(model.structure, run.loads), *rows])
    x = run.displacement if run.rest is None else run.rest.displacement
    return tuple(base_warnings(model, acting, displacement=x, velocity=run.velocity))


def holding(
    model: MultiPhiModel,
    loads: Sequence[Load],
    start: Trajectory | Equilibrium | None = None,
    rows: Sequence[np.ndarray] = (),
) -> MultiPhiModel:
    """Model whose base includes the rows on which the loads act; a continued run keeps the base of its start.

    rows: (k, n) of further places at which forces act.
    """
    at_rest = start is None or isinstance(start, Equilibrium)  # asked first, as it is ten times cheaper
    if not at_rest and isinstance(start, Trajectory):
        return start.model if model.widened_to(start.model) else model
    if model.base.complete:
        return model
    return model.holding(np.vstack([patterns(model.structure, loads), *rows]))


@dataclass
class Run:
    """Arguments of ``simulate``, which documents them; t_end [s].

    rewound: whether time begins anew at the end of ``start``, for periodic loads over whole periods. shared: levels
    under the loads that it shares with other runs. ahead: its motion, where it is already at the end.
    """

    model: MultiPhiModel
    t_end: float
    displacement: np.ndarray | None = None
    velocity: np.ndarray | None = None
    loads: Sequence[Load] = ()
    start: Trajectory | Equilibrium | None = None
    rewound: bool = False
    shared: BoundedCache[object, LoadedLevels] | None = None
    ahead: Motion | None = None

    def trajectory(self) -> Trajectory:
        """Trajectory without warnings, for runs that are parts of another result."""
        if isinstance(self.model.modes, Tolerance):
            return self._with_decided_modes()

        return to_tolerance(self._to_end, self.loads)

    def _to_end(self, finer: float) -> Trajectory:
        """Trajectory with smooth courses of loads interpolated to their tolerance / finer."""
        motion = self._motion(finer)
        motion.advance(self.t_end)
        return motion.trajectory(self.t_end, self._rerun)

    def begun(self) -> Motion:
        """Motion at its start, the events there included."""
        return self._motion().process_start()

    def _motion(self, finer: float = 1.0) -> Motion:
        """Motion before its start, with smooth courses of loads interpolated to their tolerance / finer."""
        if self.ahead is not None and finer == 1.0:
            return self.ahead
        before, levels = self._before, self.levels(finer)
        if before is None:
            start = Starts(levels, self.t_end).first(self.displacement, self.velocity, self.rest)
        else:
            start = continued_start(before, levels, self.rewound)
        return Motion(levels, start)

    @property
    def _before(self) -> Trajectory | None:
        """Trajectory that this run continues, None for a new one."""
        return None if isinstance(self.start, Equilibrium) else self.start

    @property
    def rest(self) -> Equilibrium | None:
        """Equilibrium in which this run starts, None for a run that starts from elsewhere."""
        return self.start if isinstance(self.start, Equilibrium) else None

    def levels(self, finer: float = 1.0) -> LoadedLevels:
        """Levels under the loads, which the model keeps where the loads are immutable.

        finer: factor by which the tolerance of smooth courses of loads is divided.
        """
        model, loads, before = self.model, unchanging(self.loads), self._before
        time = 0.0 if before is None or self.rewound else before.t_end

        def build() -> LoadedLevels:
            excitation = Excitation.of(model, self.loads, self.t_end, finer)
            return LoadedLevels.under(model, excitation, time, self.t_end, lasting=self.t_end)

        if self.shared is not None:
            return self.shared.get_or_build((id(model), finer), build)
        return build() if loads is None else model.loaded.get_or_build((loads, time, self.t_end, finer), build)

    def _with_decided_modes(self) -> Trajectory:
        """Trajectory of a model whose number of modes the first run decides."""
        if self.model.decided is not None:
            return replace(self, model=self.model.decided).trajectory()
        trajectory = run_with_enough_modes(self.model, lambda chosen: replace(self, model=chosen).trajectory())
        if trajectory.status == "ok":
            self.model.decide(trajectory.model)
        return trajectory

    def _rerun(self, y: np.ndarray, v: np.ndarray, gaps: Mapping[str, float]) -> Trajectory:
        """Trajectory of the same run from y, y' (m,) in base coordinates, its gaps smaller at the end.

        gaps: by how much [m], by contacts, of a run that continues no other; they change from the start on, where a
        contact may touch.
        """
        if self._before is not None:
            return replace(self, start=with_final_velocity(self._before, v), ahead=None).trajectory()
        if gaps:
            drift = StopsMotion(gaps, Harmonic(1.0, 0.25 / self.t_end, -0.5 * math.pi))
            return replace(self, loads=(*self.loads, drift))._rerun(y, v, {})
        x, x_t = self.model.base.modes.shapes @ y, self.model.base.modes.shapes @ v
        if self.rest is not None:
            return replace(self, start=Equilibrium(x, self.rest.stretches), velocity=x_t, ahead=None).trajectory()
        return replace(self, displacement=x, velocity=x_t, ahead=None).trajectory()


def check_start(run: Run) -> None:
    """Refuse a trajectory from whose end a run cannot go on, and an equilibrium of another model."""
    start = run.start
    if start is None:
        return
    if not isinstance(start, (Equilibrium, Trajectory)):
        raise MultiPhiTypeError(f"start: got {type(start).__name__}, need a Trajectory or an Equilibrium")
    if run.displacement is not None or run.velocity is not None:
        raise MultiPhiValueError("start: got a displacement or velocity as well, need one of them")
    if isinstance(start, Equilibrium):
        held, links = run.model.held, run.model.links
        if (start.stretches or held) and set(start.stretches) != (names := {links[k].name for k in held}):
            raise MultiPhiValueError(
                f"start: got an equilibrium with the friction {', '.join(start.stretches) or 'none'}, need that of the "
                f"model, {', '.join(sorted(names)) or 'none'}"
            )
        return
    if start.model is not (run.model.decided or run.model):
        raise MultiPhiValueError("start: got a trajectory of another model, need one of the same object")
    if start.status != "ok":
        raise MultiPhiValueError(f"start: got a run that failed ({start.message}), need one that is ok")
    if not run.rewound and not run.t_end > start.t_end:
        raise MultiPhiValueError(f"t_end: got {run.t_end:g} s, need a time after {start.t_end:g} s, the start's end")


def _time(name: str, value: float) -> float:
    if not is_real(value):
        raise MultiPhiTypeError(f"{name}: got {value!r}, need a time in s")
    if not (math.isfinite(value) and value > 0):
        raise MultiPhiValueError(f"{name}: got {value!r}, need a finite time > 0 s")
    return float(value)


def to_tolerance(run: Callable[[float], Trajectory], loads: Sequence[Load]) -> Trajectory:
    """Run with smooth courses that are fine enough; ``run`` takes the factor by which they are refined."""
    trajectory, finer = run(1.0), 1.0
    if not loads:
        return trajectory
    tolerances = [course.tolerance for course in refined(loads)]
    for _ in range(REFINEMENTS if tolerances else 0):
        if trajectory.status != "ok" or (error := _interpolation_error(trajectory)) <= min(tolerances):
            return trajectory
        finer *= SAFETY * error / min(tolerances)
        trajectory = run(finer)
    if tolerances and trajectory.status == "ok" and (error := _interpolation_error(trajectory)) > min(tolerances):
        reached = f"smooth loads: the response is accurate to {error:.2g} of its largest value"
        return replace(trajectory, message=f"{reached}, not to {min(tolerances):g}")
    return trajectory


def refined(loads: Sequence[Load]) -> list[Smooth | Sweep]:
    """The smooth courses of loads."""
    courses = [getattr(load, "course", None) for load in loads]
    return [course for course in courses if isinstance(course, (Smooth, Sweep))]


def _interpolation_error(trajectory: Trajectory) -> float:
    """Bound of the error of z due to interpolated courses, relative to the largest |z|."""
    level = trajectory.segments[0].level
    errors = np.array([history.error for history in level.excitation.histories])
    error_bound = trajectory.t_end * float(np.linalg.norm(np.abs(level.channels.force[:, : len(errors)]) @ errors))
    if error_bound == 0:
        return 0.0
    times = np.linspace(trajectory.start.time, trajectory.t_end, SAMPLES)
    energies = trajectory.segments.evaluated(times, "right", _size_of_energy)
    return error_bound / max(math.sqrt(2 * float(np.max(energies))), np.finfo(float).tiny)


def _size_of_energy(segment: Segment, times: np.ndarray) -> np.ndarray:
    """Kinetic energy and the size of strain energy (k,) [J], which force laws may make negative."""
    level = segment.level
    return np.asarray(level.kinetic(segment.modal(times, 1)) + np.abs(level.strain(segment.modal(times))))
