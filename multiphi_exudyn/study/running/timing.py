"""Wall-clock times of a run and of its repeats."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeVar

__all__ = ["repeated", "timed"]

T = TypeVar("T")

REPEAT_BUDGET_S = 2.0  # s; a run that takes longer is timed once


def timed(run: Callable[[], T]) -> tuple[T, float]:
    """What ``run`` gives, and the seconds it took."""
    started = time.perf_counter()
    result = run()
    return result, time.perf_counter() - started


def repeated(run: Callable[[], tuple[T, float]], most: int) -> tuple[T, float, tuple[float, ...]]:
    """Of a run that gives (result, seconds): the first result, its time, and the times of the repeats.

    There are ``most`` of them, as far as they fit into REPEAT_BUDGET_S.
    """
    result, first = run()
    repeats: list[float] = []
    while len(repeats) < most and first + sum(repeats) < REPEAT_BUDGET_S:
        repeats.append(run()[1])
    return result, first, tuple(repeats)
