"""Compilation of functions on flat buffers by numba, each separately.

numba links and optimises a function again in each of its callers: 60 functions of 20 lines that call one another take
minutes. Compiled separately, with calls by symbol, they take 0.03 s each, most of it numba's reading of Python. No
function has to be compiled before another one, so processes can share the work. Only the passes of numba that such a
function needs are run (translation.py), and LLVM optimises it once: a third of the time of a cfunc.
"""

from __future__ import annotations

import functools
import gc
import os
import pickle
import subprocess
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from types import FunctionType
from typing import Any

from tqdm import tqdm

from multiphi_exudyn.mathematics.compiling.buffer_function import check_globals, digest, line_count
from multiphi_exudyn.mathematics.compiling.translation import object_file_of

__all__ = ["compile_functions", "compile_in_process", "expected_seconds", "run_worker", "work_shares"]

START, EACH_FUNCTION, EACH_LINE = 2.0, 0.012, 0.0024  # s, on one core of 2020 that has nothing else to do
PROCESS_START = 1.0  # s
WORTH_A_PROCESS = 4.0  # s of work
MOST_PROCESSES = 4  # of some 250 MB each
WORKER = "from multiphi_exudyn.mathematics.compiling.compilation import run_worker; run_worker()"


def compile_functions(functions: Sequence[FunctionType]) -> list[bytes]:
    """Return the object files of functions, in their order, compiled by several processes, with a bar on a terminal."""
    own_share, *other_shares = work_shares(functions)
    with ThreadPoolExecutor() as pool, tqdm(total=len(functions), disable=None, leave=False, unit="function") as bar:
        results = [pool.submit(compile_in_process, share) for share in other_shares]
        codes = _compile_all(own_share, bar.update)
        for result in results:
            codes |= result.result()
            bar.update(len(result.result()))
    return [codes.get(function) or _compile(function) for function in functions]


def expected_seconds(functions: Sequence[FunctionType]) -> float:
    """Return about how long [s] it takes to compile functions."""
    own_share, *_ = work_shares(functions)
    return START + sum(map(_seconds, own_share))


@functools.cache
def _seconds(function: FunctionType) -> float:
    return EACH_FUNCTION + EACH_LINE * line_count(function)


def _most_processes() -> int:
    """Return one process for each core; one in a frozen program, which cannot start an interpreter."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return 1 if getattr(sys, "frozen", False) else min(MOST_PROCESSES, cores)


def work_shares(functions: Sequence[FunctionType]) -> list[list[FunctionType]]:
    """Return functions in shares of about equal work, one for each process that is worth its start."""
    count = max(1, min(_most_processes(), int(sum(map(_seconds, functions)) / WORTH_A_PROCESS)))
    shares: list[list[FunctionType]] = [[] for _ in range(count)]
    seconds = [0.0] + [PROCESS_START] * (count - 1)
    for function in sorted(functions, key=_seconds, reverse=True):
        least = seconds.index(min(seconds))
        shares[least].append(function)
        seconds[least] += _seconds(function)
    return shares


def compile_in_process(functions: Sequence[FunctionType]) -> dict[FunctionType, bytes]:
    """Return the object files of functions from another process, for those that it can import unchanged."""
    try:
        completed = subprocess.run(
            [sys.executable, "-c", WORKER],
            input=pickle.dumps(functions),
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
            check=True,
        )
    except (pickle.PicklingError, OSError, subprocess.SubprocessError):
        return {}
    codes = pickle.loads(completed.stdout)
    return {function: codes[digest(function)] for function in functions if digest(function) in codes}


def run_worker() -> None:
    """Work of another process: read functions, write {digest: object file}."""
    codes = _compile_all(pickle.load(sys.stdin.buffer), lambda: None)
    pickle.dump({digest(function): code for function, code in codes.items()}, sys.stdout.buffer)


def _compile_all(functions: Sequence[FunctionType], report: Callable[[], Any]) -> dict[FunctionType, bytes]:
    """Return the object files of functions; garbage collection is off, which saves a tenth of the time."""
    codes, was_enabled = {}, gc.isenabled()
    gc.disable()
    try:
        for function in functions:
            codes[function] = _compile(function)
            report()
    finally:
        if was_enabled:
            gc.enable()
    return codes


def _compile(function: FunctionType) -> bytes:
    check_globals(function)
    return object_file_of(function)
