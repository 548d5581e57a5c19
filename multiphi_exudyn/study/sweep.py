"""One function over many cases that lose nothing: what has finished is stored, and not computed again.

A sweep started again with the same file, after a kill or anything else, goes on with the cases that have no row.
Whatever its status, a row is a finished run; another ``name`` starts afresh. A case is looked up once more just before
it is submitted, and only few are in flight, so two processes that sweep into one file share what they know (they do not
share out the work: cases that both have in flight are computed twice, and stored once). A case whose process dies is a
failed run; any other error of an executor ends the sweep, because it says nothing about the case.

Runs are computed in this process, in processes of this machine (spawned: a script needs ``if __name__ ==
"__main__":``), or on a Dask cluster. A process has one BLAS thread, leaves Ctrl-C to its parent, and ends with its
parent: its pipe is closed then, and Linux kills it even inside compiled code.

The time limit of a run is a timer of the system that raises :class:`TimeLimitExceeded` between two bytecodes, in the
main thread of a process. Compiled code that calls no Python function ends when it ends; of this module's own processes
such a one is killed. In other threads (Dask's) and where the system has no timers (Windows) a run ends when it ends. By
the clock each of them is over its budget all the same.
"""

from __future__ import annotations

import asyncio
import contextlib
import ctypes
import functools
import itertools
import json
import math
import multiprocessing
import os
import pickle
import platform
import queue
import re
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field, replace
from datetime import datetime, timezone
from multiprocessing.connection import Connection
from typing import Any, ParamSpec, TypeVar

import numpy as np
from threadpoolctl import threadpool_limits
from tqdm import tqdm

from multiphi_exudyn.errors import MultiPhiError, MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.study.runs import machine
from multiphi_exudyn.study.store import STATUSES, Row, Store, checked, key_of, pack, plain

__all__ = ["Outcome", "Row", "Store", "TimeLimitExceeded", "call_within", "grid", "open_executor", "sweep"]

P = ParamSpec("P")
T = TypeVar("T")

IN_FLIGHT = 2  # cases per worker: one runs, one waits for it
AGAIN_S = 1.0  # s, until the limit is raised once more, in case a destructor or a bare ``except`` has swallowed it
GRACE_S = 10.0  # s beyond the limit, after which a process is killed
ANSWER_S = 10.0  # s, within which a scheduler answers and has a worker
BLAS_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")  # of libraries that are loaded later
PR_SET_PDEATHSIG = 1  # Linux, prctl(2): the signal that a process gets when its parent ends


# cases and their outcomes


@dataclass(frozen=True)
class Outcome:
    """What a run gives: values (JSON; nan and inf become None), arrays, and how it ended.

    status: "ok", "failed" or "over budget"; message: the cause where it is not "ok", one line.
    """

    values: Mapping[str, Any]
    histories: Mapping[str, np.ndarray] = field(default_factory=dict)
    status: str = "ok"
    message: str = ""

    def __post_init__(self) -> None:
        if self.status not in STATUSES:
            raise MultiPhiValueError(f"status: {self.status!r}; need one of {', '.join(STATUSES)}")


Function = Callable[[dict[str, Any]], Mapping[str, Any] | Outcome]


def grid(axes: Mapping[str, Sequence[Any]]) -> list[dict[str, Any]]:
    """Every combination of the axes' values, the last axis fastest."""
    for name, values in axes.items():
        if isinstance(values, (str, bytes, Mapping)) or not hasattr(values, "__len__"):
            raise MultiPhiTypeError(f"axes: {name!r} is {values!r}; need a sequence of values")
    return [dict(zip(axes, values, strict=True)) for values in itertools.product(*axes.values())]


def sweep(
    function: Function,
    cases: Sequence[Mapping[str, Any]],
    store: Store,
    name: str,
    *,
    executor: Executor | None = None,
    budget_s: float | None = None,
    keep_histories: bool = False,
    progress: bool = True,
) -> tuple[Row, ...]:
    """Rows of ``cases``, in their order, of which those not yet in ``store`` under ``name`` are computed now.

    function: from one case to its values or to an :class:`Outcome`; picklable where there is an executor.
    executor: None for this process and thread. budget_s: wall clock [s] of one run. keep_histories: store an outcome's
    arrays too. progress: a bar with the remaining time, on a terminal only.
    """
    if budget_s is not None and not 0 < budget_s < math.inf:
        raise MultiPhiValueError(f"budget_s: {budget_s}; need a positive time in s, or None")
    cases = [checked(case, f"cases[{index}]") for index, case in enumerate(cases)]
    missing = list({key_of(case): case for case in cases if store.find(name, case) is None}.values())
    portable = function if executor is None else _pickled(function)
    executor = executor or InProcess()
    if isinstance(executor, Workers):
        executor.limit_s = math.inf if budget_s is None else budget_s + GRACE_S
    slots = 1 if isinstance(executor, InProcess) else IN_FLIGHT * getattr(executor, "workers", os.cpu_count() or 1)
    running: dict[Future[tuple[Row, bytes | None]], Mapping[str, Any]] = {}
    bar = tqdm(
        total=len(cases), initial=len(cases) - len(missing), desc=name, unit="run", disable=None if progress else True
    )

    def store_finished() -> None:
        for future in wait(running, return_when=FIRST_COMPLETED).done:
            store.add(name, running[future], *_landed(future, running[future], budget_s))
            del running[future]
            bar.update()

    with bar:
        try:
            for case in missing:
                if store.find(name, case) is not None:  # another process was quicker
                    bar.update()
                    continue
                running[executor.submit(_run, portable, json.dumps(case), budget_s, keep_histories)] = case
                if len(running) >= slots:
                    store_finished()
            while running:
                store_finished()
        finally:  # left early, what has finished is stored all the same
            for future, case in running.items():
                if not future.cancel() and future.done() and future.exception() is None:
                    store.add(name, case, *future.result())
    return tuple(row for case in cases if (row := store.find(name, case)) is not None)


def _landed(
    future: Future[tuple[Row, bytes | None]], case: Mapping[str, Any], budget_s: float | None
) -> tuple[Row, bytes | None]:
    """Row and histories of a run that has ended, also where its process has died."""
    error = future.exception()
    if error is None:
        return future.result()
    distributed = sys.modules.get("distributed")
    if not isinstance(error, _Died) and (distributed is None or not isinstance(error, distributed.KilledWorker)):
        raise error
    died = Outcome({}, status="failed", message="worker process died")
    return _ended(case, died, getattr(error, "elapsed_s", 0.0), budget_s), None


# one run, where it is computed


def _run(
    function: Function | bytes, parameters: str, budget_s: float | None, keep_histories: bool
) -> tuple[Row, bytes | None]:
    """The row of one run, and its packed histories.

    function: itself, or pickled: a process that cannot load it says so and does not die of it. parameters: JSON.
    """
    call = _loaded(function) if isinstance(function, bytes) else function
    started = time.perf_counter()
    packed = None
    try:
        outcome = _outcome(call_within(budget_s, lambda: call(json.loads(parameters))))
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        outcome = Outcome({}, status="failed", message=_cause(error))
    elapsed = time.perf_counter() - started
    if keep_histories and outcome.histories:
        try:
            packed = pack(outcome.histories)
        except Exception as error:
            outcome = Outcome({}, status="failed", message=f"histories: {_cause(error)}")
    return _ended(json.loads(parameters), outcome, elapsed, budget_s), packed


def _outcome(given: Mapping[str, Any] | Outcome) -> Outcome:
    """What the function gave, its values as JSON has them."""
    if not isinstance(given, (Mapping, Outcome)):
        raise MultiPhiTypeError(f"function: it gave {type(given).__name__}; need a mapping of values or an Outcome")
    outcome = given if isinstance(given, Outcome) else Outcome(given)
    return replace(outcome, values=plain(outcome.values, "values"), message=_line(str(outcome.message)))


def _ended(parameters: Mapping[str, Any], outcome: Outcome, elapsed_s: float, budget_s: float | None) -> Row:
    """The row of a run that ends now, here: over budget by the clock, whatever came out of it."""
    if budget_s is not None and elapsed_s > budget_s:
        outcome = Outcome({}, status="over budget", message=f"{elapsed_s:.3g} s, the budget is {budget_s:g} s")
    now = datetime.now(timezone.utc).isoformat(timespec="milliseconds")
    return Row(parameters, outcome.status, outcome.message, outcome.values, elapsed_s, _environment(), now)


@functools.cache
def _environment() -> dict[str, Any]:
    """Machine and versions of the process that computes."""
    here = machine()
    return {"host": platform.node(), "blas_threads": here["threads"]["BLAS threads"], **here}


def _pickled(function: Function) -> bytes:
    try:
        return pickle.dumps(function)
    except Exception as error:
        raise MultiPhiValueError(f"function: {error}; need one that can be pickled, as those of a module are") from None


@functools.lru_cache(maxsize=8)
def _loaded(pickled: bytes) -> Function:
    try:
        return pickle.loads(pickled)
    except Exception as error:
        raise MultiPhiValueError(f"function: {_cause(error)}; need one that a worker can import") from None


def _cause(error: BaseException) -> str:
    """Type and message of an error, one line."""
    try:
        message = str(error)
    except Exception:
        message = "its message cannot be written"
    return _line(f"{type(error).__name__}: {message}" if message else type(error).__name__)


def _line(text: str) -> str:
    """``text`` in one line, with what no file can hold replaced."""
    return " ".join(text.encode("utf-8", "replace").decode().split())


class TimeLimitExceeded(BaseException):
    """The time of a call is over. Not an Exception, so that ``except Exception`` inside the call does not end it."""


def call_within(seconds: float | None, call: Callable[[], T]) -> T:
    """What ``call`` gives or raises; TimeLimitExceeded is raised inside it after ``seconds`` [s], None: never."""
    timers = hasattr(signal, "setitimer") and threading.current_thread() is threading.main_thread()
    if seconds is None or not timers:
        return call()

    def stop(number: int, frame: object) -> None:
        raise TimeLimitExceeded

    before = signal.signal(signal.SIGALRM, stop)
    try:
        try:
            signal.setitimer(signal.ITIMER_REAL, seconds, AGAIN_S)
            return call()
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0)
    finally:
        signal.signal(signal.SIGALRM, before)


# where runs are computed


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
        return Workers(workers or os.cpu_count() or 1)
    if re.fullmatch(r"tcp://[^\s/]+:\d+", where):
        return _cluster(where)
    raise MultiPhiValueError(f"where: {where!r}; need 'serial', 'processes' or a scheduler's address 'tcp://host:port'")


class InProcess(Executor):
    """Runs every call when it is submitted, in the submitting thread."""

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """The future of a call that has already ended."""
        future: Future[T] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


class _Died(BrokenExecutor):
    """The process of a call has died, so long after the call began [s]."""

    def __init__(self, elapsed_s: float) -> None:
        super().__init__("worker process died")
        self.elapsed_s = elapsed_s


class Workers(Executor):
    """Processes with a pipe each, and a thread each that sends calls and waits for what they give.

    A process that dies, or is killed ``limit_s`` [s] after it was given a call, is replaced; its call alone has failed.
    """

    def __init__(self, workers: int) -> None:
        self.workers = workers
        self.limit_s = math.inf
        self._calls: queue.SimpleQueue[tuple[Future[Any], Any] | None] = queue.SimpleQueue()
        self._processes: set[multiprocessing.process.BaseProcess] = set()
        self._threads = [threading.Thread(target=self._serve, daemon=True) for _ in range(workers)]
        for thread in self._threads:
            thread.start()

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """The future of the call."""
        future: Future[T] = Future()
        self._calls.put((future, (fn, args, kwargs)))
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the processes, after the calls that were submitted, or at once."""
        with contextlib.suppress(queue.Empty):
            while cancel_futures and (call := self._calls.get_nowait()) is not None:
                call[0].cancel()
        for _ in self._threads:
            self._calls.put(None)
        for thread in self._threads if wait else ():
            thread.join()

    def __exit__(self, kind: type[BaseException] | None, *details: object) -> None:
        if kind is not None:
            self.limit_s = 0.0
            self.shutdown(wait=False, cancel_futures=True)
            for process in tuple(self._processes):
                process.kill()
        self.shutdown()

    def _serve(self) -> None:
        """Have the calls computed by a process, one after the other."""
        process: multiprocessing.process.BaseProcess | None = None
        while (given := self._calls.get()) is not None:
            future, call = given
            if not future.set_running_or_notify_cancel():
                continue
            started = time.perf_counter()
            try:
                if process is None:
                    process, pipe = self._started()
                    started = time.perf_counter()
                pipe.send(call)
                if not pipe.poll(None if math.isinf(self.limit_s) else self.limit_s):
                    process.kill()
                result, raised = pipe.recv()
            except (EOFError, OSError):
                future.set_exception(_Died(time.perf_counter() - started))
                self._end(process)
                process = None
            except Exception as error:
                future.set_exception(error)
            else:
                future.set_exception(raised) if raised else future.set_result(result)
        if process is not None:
            pipe.close()
            self._end(process)

    def _started(self) -> tuple[multiprocessing.process.BaseProcess, Connection]:
        context = multiprocessing.get_context("spawn")
        pipe, other = context.Pipe()
        process = context.Process(target=_work, args=(other,), daemon=True)
        process.start()
        self._processes.add(process)
        other.close()
        try:
            pipe.recv()
        except EOFError:
            cause = "their processes die at the start; a script needs `if __name__ == '__main__':`"
            raise MultiPhiError(f"workers: {cause}") from None
        return process, pipe

    def _end(self, process: multiprocessing.process.BaseProcess | None) -> None:
        if process is not None:
            process.join()
            self._processes.discard(process)


def _work(pipe: Connection) -> None:
    """A worker process: calls come through the pipe, until its other end is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    os.environ.update(dict.fromkeys(BLAS_THREADS, "1"))
    threadpool_limits(1)
    with contextlib.suppress(EOFError, OSError):
        pipe.send(None)  # after a parent that ended before prctl, this is an error
        while True:
            fn, args, kwargs = pipe.recv()
            try:
                result, raised = fn(*args, **kwargs), None
            except Exception as error:
                result, raised = None, error
            pipe.send((result, raised))


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
