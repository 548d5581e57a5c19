"""Load channels: the channels of the loads and moving supports of a run, added one load after the other.

    load          f = ... + b w        moving stop   g = h.x + gap - s w        moving base   both

(excitation.py). Motions that no channel can represent are refused here: jumps of a rigid contact's stop, and motions of
a force law.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from multiphi_exudyn.errors import MultiPhiError, MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mathematics.piecewise_exponential import PiecewiseExponential
from multiphi_exudyn.mechanics.force_law import ForceLaw
from multiphi_exudyn.mechanics.loads import (
    BaseMotion,
    ConstantLoad,
    Gravity,
    Load,
    StopMotion,
    StopsMotion,
    VaryingLoad,
)
from multiphi_exudyn.mechanics.time_functions import Sampled, TimeFunction

__all__ = ["LoadChannels", "columns", "load_label", "static_load"]


class LoadChannels:
    """The channels of loads, added one load after the other."""

    def __init__(self, model: MultiPhiModel, end: float, finer: float) -> None:
        self._model, self._end, self._finer = model, end, finer
        self.patterns: list[np.ndarray] = []
        self.stops: list[np.ndarray] = []
        self.histories: list[PiecewiseExponential] = []
        self.rate_of: list[int] = []
        self.label = ""  # name of the present load in messages
        self.steady = -1  # the channel that is always one

    def add(self, load: Load) -> None:
        """Add the channels of a load; static loads have none."""
        if isinstance(load, VaryingLoad):
            self._append(self._row(load.at), self._no_stop(), self._history(load.course))
        elif isinstance(load, StopMotion):
            self._check_stop(load.contact)
            stop = self._no_stop()
            stop[self._model.pressing_links(self._model.index(load.contact))] = 1.0
            self._check_smooth(stop, load.course)
            self._add_stop_motion(stop, self._history(load.course))
        elif isinstance(load, StopsMotion):
            stop = self._no_stop()
            for name, amount in load.amounts.items():
                stop[self._model.pressing_links(self._model.index(name))] = amount
            self._add_stop_motion(stop, self._history(load.course))
        elif isinstance(load, BaseMotion):
            self._add_base_motion(load)
        elif not isinstance(load, (ConstantLoad, Gravity)):
            raise MultiPhiTypeError(
                f"loads: got {type(load).__name__}, need ConstantLoad, Gravity, HarmonicLoad, SampledLoad, "
                "FunctionLoad, SweepLoad, StopMotion or BaseMotion"
            )

    def add_surfaces(self) -> None:
        """Add one channel, the time, for counter-surfaces that move with constant speeds."""
        speeds = np.array([link.velocity for link in self._model.links])
        if np.any(speeds):
            self._add_stop_motion(speeds, PiecewiseExponential.line(1.0))

    def add_static(self, load: np.ndarray) -> None:
        """Set the constant loads (m,), as a channel if they act on damped rigid-body modes or friction forces may.

        The free response reads p t / d - p (1 - exp(-d t)) / d^2, which loses round-off / (d t)^2 for small damping d;
        the response to a channel does not.
        """
        base, self.static = self._model.base, load
        rigid = base.modes.rigid
        if np.any(base.damping[:rigid]) and (np.any(load[:rigid]) or self._model.held):
            self.steady = len(self.histories)
            self._append(load, self._no_stop(), PiecewiseExponential.constant(1.0))
            self.static = np.zeros_like(load)

    def _add_base_motion(self, load: BaseMotion) -> None:
        """Add the inertia forces of the moving frame, and the stops that do not move with it."""
        structure = self._model.structure
        direction = structure.row(load.direction)
        inertia = -self._model.base.modal_load(structure.mass @ direction)
        self._check_continuous(self._history(load.course), "of the base", speed=True)
        self._append(inertia, self._no_stop(), load.course.acceleration(self._end, self._finer))
        fixed = self._no_stop()
        for name in load.fixed_stops:
            self._check_stop(name)
            for k in self._model.link_indices[self._model.index(name)]:
                fixed[k] = -float(structure.row(self._model.links[k].direction) @ direction)
        if np.any(fixed):
            self._check_smooth(fixed, load.course)
            self._add_stop_motion(fixed, self._history(load.course))

    def _check_stop(self, name: str) -> None:
        if isinstance(self._model.contacts[self._model.index(name)], ForceLaw):
            raise MultiPhiTypeError(f"stop motion of {name!r}: got a force law, need a contact")

    def _check_smooth(self, stop: np.ndarray, course: TimeFunction) -> None:
        """Refuse samples as the motion of a rigid contact's stop."""
        rigid = [link.name for link, moves in zip(self._model.links, stop, strict=True) if moves and link.rigid]
        if rigid and isinstance(course, Sampled):
            raise MultiPhiTypeError(
                f"stop motion of the rigid contact {rigid[0]!r}: got Sampled, whose speed jumps, need Harmonic, Smooth "
                "or Sweep"
            )

    def _add_stop_motion(self, stop: np.ndarray, history: PiecewiseExponential) -> None:
        """Add the motion of stops: their entries of (c,) times a history."""
        nothing = np.zeros(self._model.base.modes.count)
        self._append(nothing, stop, history)
        moving = [link for link, moves in zip(self._model.links, stop, strict=True) if moves]
        rigid = [contact.name for contact in moving if contact.rigid]
        viscous = [contact.name for contact in moving if contact.damping]
        if rigid or viscous:
            self._check_continuous(history, f"of the stop of {(rigid + viscous)[0]!r}", speed=bool(rigid))
            self.rate_of[-1] = len(self.histories)
            self._append(nothing, self._no_stop(), history.derivative)

    def _check_continuous(self, history: PiecewiseExponential, owner: str, speed: bool) -> None:
        """Refuse a motion with jumps of its position, or of its speed."""
        rate = history.derivative.jump_times(history.error) if speed else np.zeros(0)
        for what, times in (("position", history.jump_times()), ("speed", rate)):
            jumps = times[(times > 0) & (times < self._end)]
            if len(jumps):
                raise MultiPhiValueError(
                    f"{self.label}: got a motion {owner} whose {what} jumps at t = {jumps[0]:.9g} s, need a {what} "
                    "without jumps"
                )

    def _append(self, pattern: np.ndarray, stop: np.ndarray, history: PiecewiseExponential) -> None:
        self.patterns.append(pattern)
        self.stops.append(stop)
        self.histories.append(history)
        self.rate_of.append(-1)

    def _row(self, at: Any) -> np.ndarray:
        return self._model.base.modal_load(self._model.structure.row(at))

    def _no_stop(self) -> np.ndarray:
        return np.zeros(len(self._model.links))

    def _history(self, course: TimeFunction) -> PiecewiseExponential:
        """Return the history of the present load's time function; errors name the load."""
        try:
            return course.history(self._end, self._finer)
        except MultiPhiError as error:
            raise type(error)(f"{self.label}: {error}") from error


def load_label(number: int, load: Load) -> str:
    """Return the name of a load in error messages."""
    place = getattr(load, "at", getattr(load, "contact", None))
    at = f" at {place!r}" if isinstance(place, (str, dict)) else ""
    return f"loads[{number}] ({type(load).__name__}{at})"


def static_load(model: MultiPhiModel, loads: Sequence[Load]) -> np.ndarray:
    """Return the sum of the constant loads among ``loads``, (m,) in base coordinates."""
    rows = [load.row(model.structure) for load in loads if isinstance(load, (ConstantLoad, Gravity))]
    if not rows:
        return np.zeros(model.base.modes.count)
    return model.base.modal_load(np.sum(rows, axis=0))


def columns(vectors: list[np.ndarray], length: int) -> np.ndarray:
    """Return vectors (length,) side by side, (length, 0) if there are none."""
    return np.array(vectors).reshape(len(vectors), length).T
