"""Pieces: the times between which every channel of a run stays on one piece of its history, and what it is there.

    w(t_i + s) = Re sum_j exp(mu_j s) sum_d a_jd s^d        from t_i to t_i+1, w (q,)

mu_j are the rates that the channels' histories have there, each once.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TypeAlias

import numpy as np

from multiphi_exudyn.mathematics.functions.piecewise_exponential import PiecewiseExponential

__all__ = ["Pieces"]

_Term: TypeAlias = tuple[np.ndarray, np.ndarray]  # of k pieces: mu (k,), a (k, D + 1, q)


class Pieces:
    """From ``start`` to ``until`` [s]; starts, ends (k,) [s]: the last one ends where a history does, or never."""

    def __init__(self, histories: Sequence[PiecewiseExponential], start: float, until: float) -> None:
        self._histories = histories
        breaks = np.unique(np.concatenate([np.empty(0), *(history.breaks for history in histories)]))
        inner = breaks[(breaks > start) & (breaks < until)]
        beyond = breaks[(breaks > start) & (breaks >= until)]
        self.starts = np.append(start, inner)
        self.ends = np.append(inner, np.min(beyond, initial=math.inf))

    def __len__(self) -> int:
        return len(self.starts)

    def terms(self, first: int, last: int) -> Iterator[tuple[np.ndarray, list[_Term]]]:
        """Of the pieces from ``first`` before ``last`` those, by their places (k,), whose terms are alike."""
        found = [_local(history, self.starts[first:last]) for history in self._histories]
        rates, lasting = np.array([rate for rate, _, _ in found]), np.array([inside for _, _, inside in found])
        leaders = np.argmax(rates[:, None] == rates, axis=0)  # (q, k): the first channel with a channel's rate
        alike, kinds = np.unique(np.vstack([leaders, lasting]), axis=1, return_inverse=True)
        for kind, (leading, inside) in enumerate(zip(*np.split(alike.T, 2, axis=1), strict=True)):
            own = np.flatnonzero(kinds.ravel() == kind)
            terms = []
            for lead in np.unique(leading):
                given = {
                    k: found[k][1][own, : None if inside[k] else 1] for k in np.flatnonzero(leading == lead).tolist()
                }
                terms.append((rates[lead, own], _together(given, len(found))))
            yield first + own, terms


def _together(given: dict[int, np.ndarray], q: int) -> np.ndarray:
    """Coefficients (k, D + 1, q) of those (k, d + 1) of some of q channels."""
    degrees = [coefficients.shape[1] for coefficients in given.values()]
    result = np.zeros((len(next(iter(given.values()))), max(degrees), q), complex)
    for channel, coefficients in given.items():
        result[:, : coefficients.shape[1], channel] = coefficients
    return result


def _local(history: PiecewiseExponential, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What holds of a history from times (k,) on: mu (k,), a (k, D + 1), zero before it begins and after it ends.

    And (k,) where it holds.
    """
    i = np.searchsorted(history.breaks, times, side="right") - 1
    inside = (i >= 0) & (i < history.pieces)
    i = np.clip(i, 0, history.pieces - 1)
    delay = np.where(inside, times - history.breaks[i], 0.0)
    rates = np.where(inside, history.rates[i], 0.0)
    given = np.where(inside[:, None], history.coefficients[i], 0.0)
    moved = given * np.exp(rates * delay)[:, None]
    for lowest in range(moved.shape[1] - 1):
        for d in range(moved.shape[1] - 2, lowest - 1, -1):
            moved[:, d] += delay * moved[:, d + 1]
    return rates, moved, inside
