"""Excitation: the time-varying loads and moving supports of one run (eqs. 38.1, 38.4).

Each varying quantity is a channel w_k(t), k = 1 ... q, with a history:

    load          f = ... + b_k w_k                 b_k a pattern (m,) in base coordinates
    moving stop   g_i = h_i.x + gap_i - s_ik w_k    s_k (c,); for rigid and viscous contacts w_k' is a channel too

The response of a level to the channels is in channels.py.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.events.excitation.load_channels import LoadChannels, columns, load_label, static_load
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mathematics.piecewise_exponential import PiecewiseExponential, differentiated, translated
from multiphi_exudyn.mechanics.loads import Load

__all__ = ["Drive", "Excitation"]


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

    @functools.cached_property
    def shape(self) -> tuple[bytes | tuple[int, ...], ...]:
        """Key of all that the channels of a level depend on."""
        return self.static.tobytes(), self.patterns.tobytes(), self.stops.tobytes(), (*self.rate_of, self.steady)

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
