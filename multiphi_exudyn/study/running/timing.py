"""Wall-clock times of a run and of its repeats."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeVar

__all__ = ["repeated", "timed"]

T = TypeVar("T")

REPEAT_BUDGET_S = 2.0  # s; a run that takes longer is timed once
STEADY_S = 0.1  # s, over which runs of milliseconds are repeated: a machine is now faster, now slower


def timed(run: Callable[[], T]) -> tuple[T, float]:
    """What ``run`` gives, and the seconds it took."""
    started = time.perf_counter()
    result = run()
    return result, time.perf_counter() - started


def repeated(run: Callable[[], float], first: float, fewest: int) -> tuple[float, ...]:
    """Times [s] of the repeats of a run that took ``first`` [s] and gives the time it takes.

    There are ``fewest`` of them as far as they fit into REPEAT_BUDGET_S, none for 0; more of short runs, for STEADY_S.
    """
    repeats: list[float] = []
    spent = 0.0
    while fewest and (len(repeats) < fewest or spent < STEADY_S) and first + spent < REPEAT_BUDGET_S:
        repeats.append(run())
        spent += repeats[-1]
    return tuple(repeats)
