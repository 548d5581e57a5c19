"""BLAS threads: one while many small matrices are computed, for which threads cost far more than they save.

On a busy machine each call of BLAS waits for its slowest thread. To set their number takes some 0.1 ms, a level
several: it is set around whole levels, by the outermost of nested uses, and in the main thread alone, as OpenBLAS
does not restore it from others.
"""

from __future__ import annotations

import functools
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from threadpoolctl import ThreadpoolController

__all__ = ["one_blas_thread"]

_uses: list[None] = []  # one for each use inside of which the program is


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Use one BLAS thread inside, in the main thread of a program; the number before is then restored."""
    if _uses or threading.current_thread() is not threading.main_thread():
        yield
        return
    with _libraries().limit(limits=1, user_api="blas"):
        _uses.append(None)
        try:
            yield
        finally:
            _uses.pop()


@functools.cache
def _libraries() -> Any:
    """BLAS libraries of the process, which takes 10 ms to find."""
    return ThreadpoolController().select(user_api="blas")
