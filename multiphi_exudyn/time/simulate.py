"""Simulation: exact modal motion from event to event (eqs. 38.3, 38.6). There is no time step.

Within a level the motion is a sum of exponentials; the next event is the certified first root of a few of them
(first_descent.py); the event rule (events/rule.py) gives the state that follows. What comes out is a Trajectory of
analytic segments. A failure on the way ends the trajectory early, with a status and its cause.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from multiphi_exudyn.errors import MultiPhiError, MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.events.level_arrays import LevelArrays
from multiphi_exudyn.events.rule import EventRule
from multiphi_exudyn.levels.mode_choice import Tolerance
from multiphi_exudyn.levels.model import MultiPhiModel
from multiphi_exudyn.mathematics.compiled import available
from multiphi_exudyn.mechanics.arguments import is_real
from multiphi_exudyn.mechanics.force_law import Contact
from multiphi_exudyn.mechanics.loads import Load
from multiphi_exudyn.time.driven.arrays import DrivenArrays
from multiphi_exudyn.time.driven.excitation import Excitation
from multiphi_exudyn.time.driven.motion import DrivenMotion
from multiphi_exudyn.time.driven.refinement import to_tolerance
from multiphi_exudyn.time.driven.rule import DrivenRule
from multiphi_exudyn.time.loop_motion import DrivenLoopMotion, LoopMotion
from multiphi_exudyn.time.motion import Motion
from multiphi_exudyn.time.reliability import warnings_of
from multiphi_exudyn.time.trajectory import Start, Trajectory
from multiphi_exudyn.time.truncation import adapted
from multiphi_exudyn.time.warning_groups import issue

__all__ = ["motion_of", "quiet", "simulate", "started"]

TOUCHING = 1e-9  # of the gap and of the displacements that make it: closer than this is in touch
UNSEEN = 1e-12  # of what the motion may make of a gap: nearer is round-off, where a run goes on from another's end


def simulate(
    model: MultiPhiModel,
    t_end: float,
    displacement: np.ndarray | None = None,
    velocity: np.ndarray | None = None,
    loads: Sequence[Load] = (),
    compiled: bool | None = None,
) -> Trajectory:
    """Motion of ``model`` from 0 to t_end [s].

    displacement, velocity: x, x' (n,) at t = 0, None for zero; not modified. loads: see loads.py.
    compiled: False for the loop of NumPy; True, or None, for the compiled one, plain Python where numba is not
    installed and None is given; the answer is the same to round-off.
    The first run of a model with a Tolerance is repeated until its modes suffice; they are those of the trajectory's
    model, and of every later run of the same model.
    The trajectory's status is "ok", or "failed" with the cause in its message; it then ends early. The message of a run
    that is ok says where the tolerance of a smooth load could not be reached. What else to distrust is in its warnings,
    each of which is issued as a MultiPhiWarning too.
    Raises MultiPhiValueError or MultiPhiTypeError for bad input, and for a start inside a rigid stop.
    """
    if not isinstance(model, MultiPhiModel):
        raise MultiPhiTypeError(f"model: got {type(model).__name__}, need a MultiPhiModel")
    if compiled is not None and not isinstance(compiled, bool):
        raise MultiPhiTypeError(f"compiled: got {compiled!r}, need True, False or None")
    trajectory = quiet(model, t_end, displacement, velocity, loads, compiled)
    tolerance = model.modes if isinstance(model.modes, Tolerance) else None
    trajectory = replace(trajectory, warnings=warnings_of(trajectory, tolerance))
    issue(trajectory.warnings)
    return trajectory


def quiet(
    model: MultiPhiModel,
    t_end: float,
    displacement: np.ndarray | None = None,
    velocity: np.ndarray | None = None,
    loads: Sequence[Load] = (),
    compiled: bool | None = None,
) -> Trajectory:
    """``simulate`` without warnings: for runs that are one of many of an answer."""
    end = _time("t_end", t_end)
    if isinstance(model.modes, Tolerance):
        if model.decided is not None:
            return quiet(model.decided, end, displacement, velocity, loads, compiled)
        trajectory = adapted(model, lambda chosen: quiet(chosen, end, displacement, velocity, loads, compiled))
        if trajectory.status == "ok":
            model.decide(trajectory.model)
        return trajectory

    def run(finer: float) -> Trajectory:
        motion = started(model, end, displacement, velocity, loads, compiled, finer)
        motion.advance(end)
        return motion.trajectory(end)

    return replace(to_tolerance(run, loads), again=functools.partial(_again, model, end, loads, compiled))


def _again(
    model: MultiPhiModel, end: float, loads: Sequence[Load], compiled: bool | None, y: np.ndarray, v: np.ndarray
) -> Trajectory:
    """The run from y, y' (m,) in base coordinates."""
    shapes = model.base.modes.shapes
    return quiet(model, end, shapes @ y, shapes @ v, loads, compiled)


def started(
    model: MultiPhiModel,
    end: float,
    displacement: np.ndarray | None,
    velocity: np.ndarray | None,
    loads: Sequence[Load],
    compiled: bool | None,
    finer: float = 1.0,
) -> Motion:
    """A motion at its start, for a run to ``end`` [s]; arguments as in ``simulate``.

    finer: smooth courses of loads are taken to their tolerance / finer.
    """
    excitation = Excitation.of(model, loads, end, finer)
    start = _start(model, displacement, velocity, excitation, end)
    if compiled and not available():
        raise MultiPhiError("compiled: got True without numba, need it: pip install numba")
    if excitation.channels:
        driven = DrivenRule(EventRule(model, excitation.static), excitation, 0.0, end)
        return motion_of(model, driven, start, compiled)
    return motion_of(model, _rule(model, excitation.static), start, compiled)


def motion_of(model: MultiPhiModel, rule: EventRule, start: Start, compiled: bool | None) -> Motion:
    """The run under a rule, in the loop that is wanted."""
    if isinstance(rule, DrivenRule):
        if compiled is False:
            return DrivenMotion(model, rule, start)
        return DrivenLoopMotion(model, rule, start, arrays=DrivenArrays(rule))
    if compiled is False:
        return Motion(model, rule, start)
    rule.arrays = rule.arrays or LevelArrays(rule)
    return LoopMotion(model, rule, start, arrays=rule.arrays)


def _rule(model: MultiPhiModel, load: np.ndarray) -> EventRule:
    """The model's event rule under this load, kept by the model: its maps between levels serve every run."""
    key = load.tobytes()
    rule: EventRule = model.rules.get_or_build(key, lambda: EventRule(model, load))
    return rule


def _start(
    model: MultiPhiModel,
    displacement: np.ndarray | None,
    velocity: np.ndarray | None,
    excitation: Excitation,
    end: float,
) -> Start:
    """The start as the contacts see it."""
    base = model.base
    y, v = _base_vector("displacement", displacement, model), _base_vector("velocity", velocity, model)
    moved = excitation.stops @ excitation.drive(0.0).values[0] if excitation.channels else 0.0
    gaps = (y @ base.directions + base.gaps - moved).tolist()
    directions, initial = base.magnitudes
    ways = initial + excitation.stop_ways
    unseen = UNSEEN * _lengths(model, y, v, excitation.largest_load, ways, end)
    scales = (TOUCHING * (ways + np.abs(y) @ directions) + unseen).tolist()
    penetrating, touching = list[int](), list[int]()
    for i, (contact, gap, scale) in enumerate(zip(model.contacts, gaps, scales, strict=True)):
        if contact.rigid and gap < -scale:
            raise MultiPhiValueError(
                f"displacement: lies {-gap:g} m inside the rigid contact {contact.name!r}, need a gap >= 0 "
                "(static_equilibrium gives an admissible start)"
            )
        if contact.rigid and gap <= scale:
            touching.append(i)
        elif gap < -scale and not _pulls(contact, gap, float(v @ base.directions[:, i])):
            penetrating.append(i)
    return Start(y, v, tuple(penetrating), tuple(touching), base.gaps - moved)


def _lengths(
    model: MultiPhiModel, y: np.ndarray, v: np.ndarray, load: np.ndarray, ways: np.ndarray, end: float
) -> np.ndarray:
    """What gaps (c,) [m] could become: by y, by where v and a load (m,) take the modes, by ways (c,) of all gaps."""
    omega = model.base.modes.omega
    times = np.minimum(np.divide(1.0, omega, out=np.full(len(omega), end), where=omega > 0), end)
    sizes = np.linalg.norm(model.base.directions, axis=0)
    gaps = np.divide(ways, sizes, out=np.zeros(len(ways)), where=sizes > 0)
    motion = np.linalg.norm(y) + np.linalg.norm(v * times) + np.linalg.norm(load * times**2)
    return np.asarray(sizes * (motion + np.max(gaps, initial=0.0)))


def _pulls(contact: Contact, gap: float, rate: float) -> bool:
    """Whether a contact inside its stop is viscous and would pull."""
    return contact.damping > 0 and contact.stiffness * gap + contact.damping * rate > 0


def _base_vector(name: str, given: np.ndarray | None, model: MultiPhiModel) -> np.ndarray:
    """A given vector (n,) in base coordinates."""
    if given is None:
        return np.zeros(model.base.modes.count)
    return model.base.coordinates(model.structure.vector(name, given))


def _time(name: str, value: float) -> float:
    if not is_real(value):
        raise MultiPhiTypeError(f"{name}: got {value!r}, need a time in s")
    if not (math.isfinite(value) and value > 0):
        raise MultiPhiValueError(f"{name}: got {value!r}, need a finite time > 0 s")
    return float(value)
