"""Wall-clock times of a run and of its repeats."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeVar

__all__ = ["repeated", "timed"]

T = TypeVar("T")

REPEAT_BUDGET_S = 2.0  # s; a run that takes longer is timed once
STEADY_S = 0.3  # s, over which short runs are repeated: a machine's speed varies


def timed(run: Callable[[], T]) -> tuple[T, float]:
    """Result of ``run``, and its wall-clock time [s]."""
    started = time.perf_counter()
    result = run()
    return result, time.perf_counter() - started


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
