"""One run of a sweep, where it is computed: the function called within its budget, and how that ended."""

from __future__ import annotations

import functools
import json
import pickle
import platform
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from datetime import datetime, timezone
from typing import Any

import numpy as np

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.study.running.environment import machine
from multiphi_exudyn.study.sweep.row import STATUSES, Row, pack, plain
from multiphi_exudyn.study.sweep.time_limit import call_within

__all__ = ["Function", "Outcome", "ended", "run_case"]


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


def run_case(
    function: Function | bytes, parameters: str, budget_s: float | None, keep_histories: bool
) -> tuple[Row, bytes | None]:
    """The row of one run, and its packed histories.

    function: itself, or pickled: a worker that cannot load it says so and does not die of it. parameters: JSON.
    A run that took longer than ``budget_s`` [s] is over budget, whatever came out of it.
    """
    call = _loaded(function) if isinstance(function, bytes) else function
    started = time.perf_counter()
    outcome = _attempt(lambda: _outcome(call_within(budget_s, lambda: call(json.loads(parameters)))))
    elapsed = time.perf_counter() - started
    if budget_s is not None and elapsed > budget_s:
        outcome = Outcome({}, status="over budget", message=f"{elapsed:.3g} s, the budget is {budget_s:g} s")
    packed = None
    if keep_histories and outcome.histories:
        packed, outcome = _packed(outcome)
    return ended(json.loads(parameters), outcome, elapsed), packed


def ended(parameters: Mapping[str, Any], outcome: Outcome, elapsed_s: float) -> Row:
    """The row of a run that ends now, here."""
    now = datetime.now(timezone.utc).isoformat(timespec="milliseconds")
    return Row(parameters, outcome.status, outcome.message, outcome.values, elapsed_s, _environment(), now)


@functools.lru_cache(maxsize=8)
def _loaded(pickled: bytes) -> Function:
    try:
        return pickle.loads(pickled)
    except Exception as error:
        raise MultiPhiValueError(f"function: {_cause(error)}; need one that a worker can import") from None


def _attempt(run: Callable[[], Outcome]) -> Outcome:
    """What ``run`` gives; a failed outcome with its cause where it raises, Ctrl-C excepted."""
    try:
        return run()
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        return Outcome({}, status="failed", message=_cause(error))


def _outcome(given: Mapping[str, Any] | Outcome) -> Outcome:
    """What the function gave, its values as JSON has them."""
    if not isinstance(given, (Mapping, Outcome)):
        raise MultiPhiTypeError(f"function: it gave {type(given).__name__}; need a mapping of values or an Outcome")
    outcome = given if isinstance(given, Outcome) else Outcome(given)
    return replace(outcome, values=plain(outcome.values, "values"), message=_line(str(outcome.message)))


def _packed(outcome: Outcome) -> tuple[bytes | None, Outcome]:
    try:
        return pack(outcome.histories), outcome
    except Exception as error:
        return None, Outcome({}, status="failed", message=f"histories: {_cause(error)}")


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


@functools.cache
def _environment() -> dict[str, Any]:
    """Machine and versions of the process that computes."""
    here = machine()
    return {"host": platform.node(), "blas_threads": here["threads"]["BLAS threads"], **here}
