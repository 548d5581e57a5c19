"""Where the runs of a sweep are computed: in this process, in processes of this machine, on a Dask cluster.

Each is a :class:`concurrent.futures.Executor` with the number of its ``workers``. A worker process has one BLAS thread,
leaves Ctrl-C to its parent, and ends with its parent however that ends: it holds the reading end of a pipe whose
writing end only the parent has. When that is closed, a thread that waits for it ends the worker, and on Linux the
signal SIGIO does, also inside compiled code that keeps the interpreter's lock, as Exudyn's solvers do.

Why not a library's pool: workers of pebble, loky and concurrent.futures outlive a parent that is killed while they
compute in compiled code, and only pebble limits the time of one call, neither in this process nor on a cluster.

Worker processes are spawned: a script that opens them needs ``if __name__ == "__main__":``.
"""

from __future__ import annotations

import asyncio
import multiprocessing
import os
import re
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor
from contextlib import AbstractContextManager, contextmanager
from multiprocessing.connection import Connection
from typing import ParamSpec, TypeVar

from threadpoolctl import threadpool_limits

from multiphi_exudyn.errors import MultiPhiError, MultiPhiValueError

if sys.platform == "linux":
    import fcntl

__all__ = ["InProcess", "WorkerPool", "open_executor", "worker_died", "workers_of"]

P = ParamSpec("P")
T = TypeVar("T")

ANSWER_S = 10.0  # s, within which a scheduler answers and has a worker
BLAS_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")  # of libraries that are loaded later


def open_executor(where: str, workers: int | None = None) -> AbstractContextManager[Executor]:
    """Executor for ``with``: "serial", "processes", or a Dask scheduler's address "tcp://host:port".

    workers: number of processes, None for one per core; the others have the workers they have. Left by an exception,
    processes are ended at once and a cluster's waiting runs are cancelled.
    """
    if workers is not None and workers < 1:
        raise MultiPhiValueError(f"workers: {workers}; need a number of at least 1")
    if where == "serial":
        return InProcess()
    if where == "processes":
        return _processes(workers or os.cpu_count() or 1)
    if re.fullmatch(r"tcp://[^\s/]+:\d+", where):
        return _cluster(where)
    raise MultiPhiValueError(f"where: {where!r}; need 'serial', 'processes' or a scheduler's address 'tcp://host:port'")


def workers_of(executor: Executor) -> int:
    """How many calls ``executor`` runs at once; one per core is assumed of executors that are not from here."""
    return getattr(executor, "workers", os.cpu_count() or 1)


def worker_died(error: BaseException) -> bool:
    """Whether a future's error says that the process of its call has died."""
    distributed = sys.modules.get("distributed")
    return isinstance(error, BrokenExecutor) or (
        distributed is not None and isinstance(error, distributed.KilledWorker)
    )


class InProcess(Executor):
    """Runs every call when it is submitted, in the submitting thread."""

    workers = 1

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """The future of a call that has already ended."""
        future: Future[T] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


class WorkerPool(Executor):
    """Pool of processes; when one dies, the calls in flight have a BrokenExecutor and the next call a fresh pool."""

    def __init__(self, workers: int) -> None:
        self.workers = workers
        self._context = multiprocessing.get_context("spawn")
        self._end, self._lifeline = self._context.Pipe(duplex=False)
        self._pool = self._fresh()

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """The future of the call."""
        try:
            return self._pool.submit(fn, *args, **kwargs)
        except BrokenExecutor:
            self._renew()
            return self._pool.submit(fn, *args, **kwargs)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the workers, after the calls in flight."""
        self._pool.shutdown(wait, cancel_futures=cancel_futures)
        self._end.close()
        self._lifeline.close()

    def abandon(self) -> None:
        """End the workers at once, whatever they do."""
        self._lifeline.close()

    def _fresh(self) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(self.workers, self._context, _start_worker, (self._end,))

    def _renew(self) -> None:
        self._pool.shutdown()
        self._pool = self._fresh()
        try:
            self._pool.submit(os.getpid).result()
        except BrokenExecutor:
            cause = "their processes die at the start; a script needs `if __name__ == '__main__':`"
            raise MultiPhiError(f"workers: {cause}") from None


def _start_worker(end: Connection) -> None:
    """What a worker process does first; ``end``: of the pipe that its parent holds open."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.environ.update(dict.fromkeys(BLAS_THREADS, "1"))
    threadpool_limits(1)
    threading.Thread(target=_end_with, args=(end,), name="parent", daemon=True).start()
    if sys.platform == "linux":
        own = os.open(f"/proc/self/fd/{end.fileno()}", os.O_RDONLY)  # opened anew: its owner and flags are not shared
        signal.signal(signal.SIGIO, signal.SIG_DFL)
        fcntl.fcntl(own, fcntl.F_SETOWN, os.getpid())
        fcntl.fcntl(own, fcntl.F_SETFL, os.O_ASYNC)


def _end_with(end: Connection) -> None:
    """End this process when the other end of the pipe is closed; no data are sent through it."""
    end.poll(None)
    os._exit(1)


@contextmanager
def _processes(workers: int) -> Iterator[Executor]:
    with WorkerPool(workers) as pool:
        try:
            yield pool
        except BaseException:
            pool.abandon()
            raise


@contextmanager
def _cluster(address: str) -> Iterator[Executor]:
    """A Dask cluster's executor; its workers are those it has now."""
    try:
        import distributed
    except ImportError:
        needed = "need the package distributed: pip install 'multiphi-exudyn[distributed]'"
        raise MultiPhiValueError(f"where: {address}; {needed}") from None
    try:
        client = distributed.Client(address, timeout=ANSWER_S, set_as_default=False)
    except OSError:
        raise MultiPhiValueError(f"where: no answer at {address}; need a running Dask scheduler") from None
    with client:
        try:
            client.wait_for_workers(1, timeout=ANSWER_S)
        except (TimeoutError, asyncio.TimeoutError):  # one and the same only from Python 3.11 on
            raise MultiPhiValueError(f"where: {address} has no workers; need at least one Dask worker") from None
        executor = client.get_executor(pure=False)
        executor.workers = sum(client.nthreads().values())
        try:
            yield executor
        except BaseException:
            executor.shutdown(wait=False)
            raise
        executor.shutdown()
