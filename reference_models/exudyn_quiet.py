"""Exudyn without a word on the console, with a limit on its CPU time, and with a Ctrl-C that is heard."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import exudyn as exu

__all__ = ["cpu_limit", "interruptible", "quiet"]

NO_LIMIT = -1.0  # Exudyn's own value for a solver that may run for ever


@contextmanager
def quiet() -> Iterator[None]:
    """Nothing is printed inside; what the user had set is restored."""
    printed = exu.config.printToConsole
    exu.config.printToConsole = False
    try:
        yield
    finally:
        exu.config.printToConsole = printed


@contextmanager
def cpu_limit(seconds: float | None) -> Iterator[None]:
    """Exudyn's solvers stop after that much CPU time [s]; None leaves them unlimited."""
    stored = exu.special.solver.timeout
    exu.special.solver.timeout = NO_LIMIT if seconds is None else float(seconds)
    try:
        yield
    finally:
        exu.special.solver.timeout = stored


@contextmanager
def interruptible(stop: Callable[[], None]) -> Iterator[None]:
    """Ctrl-C inside calls ``stop`` and, when the solver has come back, raises KeyboardInterrupt."""
    if threading.current_thread() is not threading.main_thread():  # signals belong to the main thread
        yield
        return
    pressed = []

    def handler(*_: Any) -> None:
        pressed.append(True)
        stop()

    stored = signal.signal(signal.SIGINT, handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, stored)
    if pressed:
        raise KeyboardInterrupt
