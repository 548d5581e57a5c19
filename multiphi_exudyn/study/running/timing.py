"""CPU times of a run, of its repeats, and of several runs in turns: waiting for other programs does not count."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np

__all__ = ["in_turns", "repeated", "timed", "undisturbed"]

T = TypeVar("T")

REPEAT_BUDGET_S = 2.0  # s; a run that takes longer is timed once
STEADY_S = 0.3  # s, over which short runs are repeated: a machine's speed varies
ROUNDS = 200  # of runs in turns
TURNS_BUDGET_S = 20.0  # s, of all rounds of a study but the first at every point
FEWEST_ROUNDS = 8  # whose lower quartile says more than repeats in one stretch do
UNDISTURBED = 0.25  # share of the shortest times: a machine may be slow for three quarters of the rounds


def timed(run: Callable[[], T]) -> tuple[T, float]:
    """Result of ``run``, and its CPU time [s]."""
    started = time.process_time()
    result = run()
    return result, time.process_time() - started


def repeated(run: Callable[[], float], first: float, fewest: int) -> tuple[float, ...]:
    """Times [s] of the repeats of a run, which returns its time.

    first: what it took before [s], 0 where that says nothing of a repeat. At least ``fewest`` repeats (0: none), fewer
    where REPEAT_BUDGET_S ends, more for short runs until STEADY_S.
    """
    repeats: list[float] = []
    spent = 0.0
    while fewest and (len(repeats) < fewest or spent < STEADY_S) and first + spent < REPEAT_BUDGET_S:
        repeats.append(run())
        spent += repeats[-1]
    return tuple(repeats)


def in_turns(runs: Sequence[Callable[[], float]], budget_s: float) -> list[tuple[float, ...]]:
    """Times [s] of several runs, each of which returns its time, as they take turns, forwards and backwards.

    A change of the machine's speed then changes all of them alike. budget_s: after which no further round begins.
    """
    times: list[list[float]] = [[] for _ in runs]
    order, started = list(zip(runs, times, strict=True)), time.perf_counter()
    for number in range(ROUNDS):
        if number and time.perf_counter() - started > budget_s:
            break
        for run, found in order:
            found.append(run())
        order.reverse()
    return [tuple(found) for found in times]


def undisturbed(times: Sequence[float]) -> float:
    """Lower quartile of times in turns: that of a machine which something else slows down now and then.

    The median of such times lies at random among the fast or the slow ones.
    """
    return float(np.quantile(times, UNDISTURBED))
