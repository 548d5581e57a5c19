"""Wall-clock limit of one call, in whatever thread it runs.

A timer thread raises :class:`TimeLimitExceeded` in the calling thread (``PyThreadState_SetAsyncExc``) when the time is
over, and again every second in case a destructor or a bare ``except`` has swallowed it. The interpreter raises between
two bytecodes, so a call that never returns to it cannot be stopped: a long sleep, or a solver of compiled code that
calls no Python function. Such a call ends when it ends, and its caller sees by the clock that it was too long.

After the call nothing late can arrive: ``over`` is set before any other bytecode, the timer looks at it under the lock,
and what was raised but may not have arrived is made to arrive where it is expected. Taken back with NULL it would leave
the interpreter believing that an exception is under way: slower from then on, and version 3.11 never gets past a
function that is traced (ceval.c, DO_TRACING).
"""

from __future__ import annotations

import ctypes
import queue
import threading
import time
from collections.abc import Callable
from typing import TypeVar

__all__ = ["TimeLimitExceeded", "call_within"]

T = TypeVar("T")

AGAIN_S = 1.0  # s, from one attempt to stop the call to the next
SOON_S = 1e-4  # s, until the next look at a timer that has not started yet


class TimeLimitExceeded(BaseException):
    """The time of a call is over. Not an Exception, so that ``except Exception`` inside the call does not end it."""


def call_within(seconds: float | None, call: Callable[[], T]) -> T:
    """What ``call`` gives or raises; TimeLimitExceeded is raised inside it after ``seconds`` [s], None: never."""
    if seconds is None:
        return call()
    watch = _Watch(seconds)
    try:
        try:
            watch.start()
            return call()
        finally:
            watch.over = True
            watch.call_off()
    except TimeLimitExceeded as late:
        watch.call_off()  # the exception may have cut the first one short
        if isinstance(late.__context__, KeyboardInterrupt):  # which it met on its way out
            raise late.__context__ from None
        raise


class _Watch:
    """Timer of the thread that makes it; ``over``: nothing is raised any more."""

    def __init__(self, seconds: float) -> None:
        self.over = self._raised = self._started = False
        self._deadline = time.perf_counter() + seconds
        self._thread = ctypes.c_ulong(threading.get_ident())
        self._left: queue.SimpleQueue[None] = queue.SimpleQueue()  # an Event cut short in ``set`` stays locked
        self._lock = threading.Lock()

    def start(self) -> None:
        """Nothing is raised before this is through: it waits with a lock that an exception would leave unbalanced."""
        threading.Thread(target=self._watch, name="time limit", daemon=True).start()
        self._started = True

    def call_off(self) -> None:
        """Wait for an attempt that is under way, and let arrive here what has not arrived."""
        self._left.put(None)
        with self._lock:
            self.over = True
            raised, self._raised = self._raised, False
        if not raised:
            return
        try:
            while True:
                self._interrupt()  # in place of the one that has not arrived, or alone
        except TimeLimitExceeded:
            pass

    def _watch(self) -> None:
        while not self.over:
            while (rest := self._deadline - time.perf_counter()) > 0:
                try:
                    return self._left.get(timeout=rest)
                except queue.Empty:
                    pass
            self._raise()
            self._deadline = time.perf_counter() + (AGAIN_S if self._raised else SOON_S)

    def _raise(self) -> None:
        with self._lock:
            if self._started and not self.over:
                self._raised = True
                self._interrupt()

    def _interrupt(self) -> None:
        ctypes.pythonapi.PyThreadState_SetAsyncExc(self._thread, ctypes.py_object(TimeLimitExceeded))
