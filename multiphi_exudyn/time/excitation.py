"""Excitation: the time-varying loads and moving supports of one run (eqs. 38.1, 38.4).

Each varying quantity is a channel w_k(t), k = 1 ... q, with a history:

    load          f = ... + b_k w_k                 b_k a pattern (m,) in base coordinates
    moving stop   g_i = h_i.x + gap_i - s_ik w_k    s_k (c,); for rigid and viscous contacts w_k' is a channel too

The response of a level to the channels is in core/channels.hpp. Motions that no channel can represent are refused here:
jumps of a rigid contact's stop, and motions of a force law.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import multiphi_exudyn._core as core
from multiphi_exudyn.errors import MultiPhiError, MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mathematics.piecewise_exponential import PiecewiseExponential, differentiated, translated
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

__all__ = ["Drive", "Excitation", "static_load"]

CARRIER_EFFORT = 10  # cost of a piece of a sweep, with its own exponentials, relative to a polynomial piece
MOST_EFFORT = 2**21  # pieces in a run, of half a kB and ten microseconds or more each


@dataclass(frozen=True)
class Drive:
    """The channels from an instant on: w(time + t) = Re sum_j exp(mu_j t) sum_d a_jd t^d up to ``until`` [s].

    terms: (mu_j, a_j (D + 1, q)).
    """

    time: float
    until: float
    terms: tuple[tuple[complex, np.ndarray], ...]

    @property
    def channels(self) -> int:
        """Number of channels q."""
        return self.terms[0][1].shape[1] if self.terms else 0

    def beside(self, held: np.ndarray) -> Drive:
        """Return this drive with constant channels (h,) appended."""
        if not len(held):
            return self
        terms = [(rate, np.pad(coefficients, ((0, 0), (0, len(held))))) for rate, coefficients in self.terms]
        constant = np.concatenate([np.zeros(self.channels), held])[None, :].astype(complex)
        return replace(self, terms=(*terms, (0j, constant)))

    @functools.cached_property
    def values(self) -> np.ndarray:
        """w, w', w'' (3, q) at the instant."""
        result = np.zeros((3, self.channels))
        for rate, coefficients in self.terms:
            first = differentiated(rate, coefficients)
            result += np.array([coefficients[0], first[0], differentiated(rate, first)[0]]).real
        return result

    @functools.cached_property
    def sizes(self) -> np.ndarray:
        """Sums of the absolute terms of w, w', w'' (3, q) at the instant."""
        result = np.zeros((3, self.channels))
        for rate, coefficients in self.terms:
            first = differentiated(rate, coefficients)
            result += np.abs([coefficients[0], first[0], differentiated(rate, first)[0]])
        return result

    def after(self, t: float) -> Drive:
        """Return this drive from a time t [s] later."""
        return Drive(self.time + t, self.until, tuple((rate, translated(rate, a, t)) for rate, a in self.terms))


@dataclass(frozen=True, eq=False)
class Excitation:
    """See the module's docstring.

    static: constant loads (m,) in base coordinates. patterns: b (m, q). stops: s (c, q). histories: w (q,).
    rate_of: for every channel the channel that is its derivative, -1 where none is needed. end: of the run [s].
    steady: the channel that is always one, -1 for none.
    """

    static: np.ndarray
    patterns: np.ndarray
    stops: np.ndarray
    histories: tuple[PiecewiseExponential, ...]
    rate_of: tuple[int, ...]
    end: float
    steady: int = -1

    @classmethod
    def of(cls, model: MultiPhiModel, loads: Sequence[Load], end: float, finer: float = 1.0) -> Excitation:
        """Return the loads of a run of ``model`` until ``end`` [s]; functions are fitted to their tolerance / finer."""
        if isinstance(loads, (str, Mapping)) or not isinstance(loads, Iterable):
            raise MultiPhiTypeError(f"loads: got {type(loads).__name__}, need a sequence of loads")
        base, channels = model.base, LoadChannels(model, end, finer)
        for number, load in enumerate(loads):
            channels.label = load_label(number, load)
            channels.add(load)
        channels.add_surfaces()
        channels.add_static(static_load(model, loads))
        patterns = columns(channels.patterns, base.modes.count)
        stops = columns(channels.stops, len(model.links))
        if model.held:
            patterns = np.hstack([patterns, np.zeros((base.modes.count, len(model.held)))])
            stops = np.hstack([stops, np.eye(len(model.links))[:, list(model.held)]])
        rate_of = *channels.rate_of, *(-1 for _ in model.held)
        excitation = cls(channels.static, patterns, stops, tuple(channels.histories), rate_of, end, channels.steady)
        if excitation.most_effort > MOST_EFFORT:
            raise MultiPhiValueError(
                f"loads: got {excitation.pieces(end)} pieces in {end:g} s, need at most {MOST_EFFORT}, or of sweeps "
                f"{MOST_EFFORT // CARRIER_EFFORT}: fewer samples, a larger tolerance or a shorter run"
            )
        return excitation

    @classmethod
    def constant(cls, load: np.ndarray, contacts: int, held: Sequence[int] = ()) -> Excitation:
        """Return a static load (m,) alone, with so many contacts; held: links whose displacements are channels."""
        stops = np.eye(contacts)[:, list(held)]
        return cls(load, np.zeros((len(load), len(held))), stops, (), (-1,) * len(held), math.inf)

    def in_core(self, start: float, until: float, is_isolated: bool) -> core.Excitation:
        """Return the excitation of motions between two instants as the core takes it."""
        return core.Excitation(
            static_load=self.static,
            patterns=self.patterns,
            stops=self.stops,
            functions=[(history.breaks, history.rates, history.coefficients) for history in self.histories],
            start=start,
            until=until,
            highest_frequency=self.highest_frequency,
            is_isolated=is_isolated,
            rate_of=self.rate_of,
            steady=self.steady,
        )

    @property
    def channels(self) -> int:
        """Number of channels q."""
        return len(self.rate_of)

    @property
    def prescribed(self) -> int:
        """Number of channels that are functions of time, the first ones; the others are displacements held by links."""
        return len(self.histories)

    def pieces(self, end: float) -> int:
        """Number of pieces of all channels together up to ``end`` [s]."""
        inner = [history.breaks[(history.breaks > 0) & (history.breaks < end)] for history in self.histories]
        return 1 + len(np.unique(np.concatenate(inner))) if inner else 0

    def effort(self, end: float) -> int:
        """Number of pieces up to ``end`` [s], weighted by their cost if carriers change from piece to piece."""
        carriers = max((len(np.unique(history.rates)) for history in self.histories), default=0)
        return self.pieces(end) * (CARRIER_EFFORT if carriers > 1 else 1)

    @functools.cached_property
    def nothing(self) -> bool:
        """Whether there is no static load and no channel that varies."""
        return not (self.histories or self.pushes)

    @functools.cached_property
    def pushes(self) -> bool:
        """Whether there is a static load."""
        return bool(np.any(self.static))

    @functools.cached_property
    def most_effort(self) -> int:
        """The effort up to the end of the run."""
        return self.effort(self.end)

    @functools.cached_property
    def highest_frequency(self) -> float:
        """Highest frequency of the channels [Hz], zero without any."""
        return max((history.highest_frequency for history in self.histories), default=0.0)

    def drive(self, time: float) -> Drive:
        """Return the channels from a time on, until the first of their pieces ends."""
        pieces = [history.local(time) for history in self.histories]
        terms = {}
        for rate in dict.fromkeys(piece.rate for piece in pieces):
            degree = max(len(piece.coefficients) for piece in pieces if piece.rate == rate)
            terms[rate] = np.zeros((degree, len(pieces)), complex)
        for channel, piece in enumerate(pieces):
            terms[piece.rate][: len(piece.coefficients), channel] = piece.coefficients
        return Drive(time, min((piece.until for piece in pieces), default=math.inf), tuple(terms.items()))

    @property
    def stop_travel(self) -> np.ndarray:
        """Bound (c,) [m] of the displacement of every stop."""
        largest = np.array([history.largest for history in self.histories])
        return np.asarray(np.abs(self.stops[:, : self.prescribed]) @ largest)

    @property
    def largest_load(self) -> np.ndarray:
        """Bound (m,) of the sum of all loads."""
        largest = np.array([history.largest for history in self.histories])
        return np.asarray(np.abs(self.static) + np.abs(self.patterns[:, : self.prescribed]) @ largest)

    def values(self, times: np.ndarray) -> np.ndarray:
        """Return w, w' (k, 2, q) at times (k,); after the end of the run the values at its end."""
        times = np.minimum(times, np.nextafter(self.end, 0.0))  # histories end there
        pairs = [(history.at(times), history.derivative.at(times)) for history in self.histories]
        return np.array(pairs).reshape(self.prescribed, 2, len(times)).transpose(2, 1, 0)

    def load(self, values: np.ndarray) -> np.ndarray:
        """Return the sum of all loads (m,) for channels w (q,)."""
        return np.asarray(self.static + self.patterns[:, : len(values)] @ values)

    def moved(self, values: np.ndarray) -> np.ndarray:
        """Return the displacements (c,) [m] of the stops for prescribed channels w."""
        return np.asarray(self.stops[:, : len(values)] @ values)


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
