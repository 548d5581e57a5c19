"""Pieces: the time intervals in which every channel of a run stays on one piece of its history.

    w(t_i + s) = Re sum_j exp(mu_j s) sum_d a_jd s^d        from t_i to t_i+1, w (q,)

mu_j are the distinct rates of the channels' histories in the interval.
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
    """Pieces from ``start`` to ``until`` [s]; starts, ends (k,) [s]: the last one ends with a history, or never."""

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
        """Yield groups of the pieces from ``first`` before ``last`` with alike terms: their indices (k,) and terms."""
        local = [_local_pieces(history, self.starts[first:last]) for history in self._histories]
        rates, lasting = np.array([rate for rate, _, _ in local]), np.array([inside for _, _, inside in local])
        leaders = np.argmax(rates[:, None] == rates, axis=0)  # (q, k): the first channel with a channel's rate
        alike, kinds = np.unique(np.vstack([leaders, lasting]), axis=1, return_inverse=True)
        for kind, (leading, inside) in enumerate(zip(*np.split(alike.T, 2, axis=1), strict=True)):
            own = np.flatnonzero(kinds.ravel() == kind)
            terms = []
            for lead in np.unique(leading):
                coefficients = {
                    k: local[k][1][own, : None if inside[k] else 1] for k in np.flatnonzero(leading == lead).tolist()
                }
                terms.append((rates[lead, own], _stack(coefficients, len(local))))
            yield first + own, terms


def _stack(by_channel: dict[int, np.ndarray], q: int) -> np.ndarray:
    """Return coefficients (k, D + 1, q) of q channels from those (k, d + 1) of some of them, by channel."""
    degrees = [coefficients.shape[1] for coefficients in by_channel.values()]
    result = np.zeros((len(next(iter(by_channel.values()))), max(degrees), q), complex)
    for channel, coefficients in by_channel.items():
        result[:, : coefficients.shape[1], channel] = coefficients
    return result


def _local_pieces(history: PiecewiseExponential, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a history from times (k,) on: mu (k,), a (k, D + 1), and whether the times (k,) lie inside it.

    Outside, before it begins or after it ends, it is zero.
    """
    i = np.searchsorted(history.breaks, times, side="right") - 1
    inside = (i >= 0) & (i < history.pieces)
    i = np.clip(i, 0, history.pieces - 1)
    delay = np.where(inside, times - history.breaks[i], 0.0)
    rates = np.where(inside, history.rates[i], 0.0)
    coefficients = np.where(inside[:, None], history.coefficients[i], 0.0)
    moved = coefficients * np.exp(rates * delay)[:, None]
    for lowest in range(moved.shape[1] - 1):
        for d in range(moved.shape[1] - 2, lowest - 1, -1):
            moved[:, d] += delay * moved[:, d + 1]
    return rates, moved, inside
