"""Runs of one function over many cases that lose nothing: what has finished is stored, and not computed again.

A sweep started again with the same file, after a kill or anything else, goes on with the cases that have no row.
Whatever its status, a row is a finished run; another ``name`` starts afresh. A case is looked up once more just before
it is submitted, and only few are in flight, so two processes that sweep into one file share what they know (they do not
share out the work: cases that both have in flight are computed twice, and stored once).

When a worker process dies, any of the cases in flight may have been the cause. They are run again one at a time; the
one that takes its worker with it once more, alone, is a failed run. Any other error of the executor ends the sweep,
because it says nothing about the case. Executors made by ``open_executor`` go on after a death; others may not.
"""

from __future__ import annotations

import itertools
import json
import math
import pickle
import queue
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from tqdm import tqdm

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.study.sweep.executors import InProcess, worker_died, workers_of
from multiphi_exudyn.study.sweep.row import Row, checked, key_of
from multiphi_exudyn.study.sweep.run import Function, Outcome, ended, run_case
from multiphi_exudyn.study.sweep.store import Store

__all__ = ["grid", "sweep"]

IN_FLIGHT = 2  # cases per worker: one runs, one waits for it

Finished = tuple[Row, bytes | None]


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
    run = partial(run_case, portable, budget_s=budget_s, keep_histories=keep_histories)
    executor = executor or InProcess()
    known, slots = len(cases) - len(missing), IN_FLIGHT * workers_of(executor)
    with tqdm(total=len(cases), initial=known, desc=name, unit="run", disable=None if progress else True) as bar:
        flight = _Flight(partial(_submitted, executor, run), store, name, bar.update)
        flight.all(missing, slots)
    return tuple(row for case in cases if (row := store.find(name, case)) is not None)


def _pickled(function: Function) -> bytes:
    try:
        return pickle.dumps(function)
    except Exception as error:
        raise MultiPhiValueError(f"function: {error}; need one that can be pickled, as those of a module are") from None


def _submitted(executor: Executor, run: Callable[[str], Finished], case: Mapping[str, Any]) -> Future[Finished]:
    return executor.submit(run, json.dumps(case))


@dataclass
class _Flight:
    """Cases submitted and not yet stored. ``count``: called for each stored case."""

    submit: Callable[[Mapping[str, Any]], Future[Finished]]
    store: Store
    name: str
    count: Callable[[], Any]
    running: dict[Future[Finished], Mapping[str, Any]] = field(default_factory=dict)
    done: queue.SimpleQueue[Future[Finished]] = field(default_factory=queue.SimpleQueue)
    suspects: list[Mapping[str, Any]] = field(default_factory=list)

    def all(self, cases: Iterable[Mapping[str, Any]], slots: int) -> None:
        """Run ``cases``, at most ``slots`` at once; left early, what has finished is stored all the same."""
        try:
            for case in cases:
                self._start(case)
                while len(self.running) >= slots or not self.done.empty():
                    self._land()
                self._clear_suspects()
            while self.running:
                self._land()
                self._clear_suspects()
        finally:
            self._salvage()

    def _start(self, case: Mapping[str, Any]) -> None:
        """Submit a case, unless another process has stored it meanwhile."""
        if self.store.find(self.name, case) is not None:
            self.count()
            return
        future = self.submit(case)
        self.running[future] = case
        future.add_done_callback(self.done.put)

    def _land(self) -> None:
        """Wait for a case to end, and store it."""
        future = self.done.get()
        error = future.exception()
        if error is None:
            self._keep(self.running[future], *future.result())
        elif worker_died(error):
            self.suspects.append(self.running[future])
        else:
            raise error
        del self.running[future]

    def _keep(self, case: Mapping[str, Any], row: Row, histories: bytes | None = None) -> None:
        self.store.add(self.name, case, row, histories)
        self.count()

    def _clear_suspects(self) -> None:
        """Find the case in flight that ended its worker."""
        if not self.suspects:
            return
        while self.running:
            self._land()
        suspects, self.suspects = self.suspects, []
        for case in suspects:
            self._run_alone(case)

    def _run_alone(self, case: Mapping[str, Any]) -> None:
        """Run a case with no other beside it: if its worker dies again, it is the cause."""
        started = time.perf_counter()
        self._start(case)
        while self.running:
            self._land()
        if self.suspects:
            self.suspects.clear()
            died = Outcome({}, status="failed", message="worker process died")
            self._keep(case, ended(case, died, time.perf_counter() - started))

    def _salvage(self) -> None:
        """Store the finished cases in flight, and cancel the others."""
        for future, case in self.running.items():
            if future.done() and not future.cancelled() and future.exception() is None:
                self._keep(case, *future.result())
            else:
                future.cancel()
