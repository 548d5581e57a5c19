"""Functions on flat buffers compiled by numba, each by itself.

numba links and optimises a function again in every one that calls it: 60 functions of 20 lines that call one another
take minutes. Each by itself, calling the others by their symbols, they take 0.03 s each, most of it numba's reading of
Python; and as none needs another one to be compiled before, processes can share them out. Of numba's work that is done
which such a function needs (translation.py), and LLVM optimises it once: a third of the time of a cfunc.
"""

from __future__ import annotations

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

from multiphi_exudyn.mathematics.compiling.buffer_function import check, digest, lines
from multiphi_exudyn.mathematics.compiling.translation import translated

__all__ = ["answer", "compile_elsewhere", "compile_functions", "expected_seconds", "shares"]

START, EACH_FUNCTION, EACH_LINE = 2.0, 0.012, 0.0024  # s, on one core of 2020 that has nothing else to do
WORTH_A_PROCESS = 4.0  # s of work; a process takes 1 to 2 s to start
MOST_PROCESSES = 4  # of some 250 MB each
ANSWER = "from multiphi_exudyn.mathematics.compiling.compilation import answer; answer()"


def compile_functions(functions: Sequence[FunctionType]) -> list[bytes]:
    """The object files of functions, in their order, shared out to processes, with a bar on a terminal."""
    own, *others = shares(functions)
    with ThreadPoolExecutor() as pool, tqdm(total=len(functions), disable=None, leave=False, unit="function") as bar:
        answers = [pool.submit(compile_elsewhere, share) for share in others]
        codes = _compile_all(own, bar.update)
        for each in answers:
            codes |= each.result()
            bar.update(len(each.result()))
    return [codes.get(function) or _compile(function) for function in functions]


def expected_seconds(functions: Sequence[FunctionType]) -> float:
    """About how long it will take to compile functions."""
    return START + max(sum(map(_seconds, share)) for share in shares(functions))


def _seconds(function: FunctionType) -> float:
    return EACH_FUNCTION + EACH_LINE * lines(function)


def _most_processes() -> int:
    """As many as this process has cores for; one in a frozen program, which is no interpreter that could be started."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return 1 if getattr(sys, "frozen", False) else min(MOST_PROCESSES, cores)


def shares(functions: Sequence[FunctionType]) -> list[list[FunctionType]]:
    """Functions in shares of about as much work, as many shares as are worth a process."""
    count = max(1, min(_most_processes(), int(sum(map(_seconds, functions)) / WORTH_A_PROCESS)))
    found: list[list[FunctionType]] = [[] for _ in range(count)]
    for function in sorted(functions, key=_seconds, reverse=True):
        min(found, key=lambda share: sum(map(_seconds, share))).append(function)
    return found


def compile_elsewhere(functions: Sequence[FunctionType]) -> dict[FunctionType, bytes]:
    """The object files of functions, made by another process; of those that it could import and that are the same."""
    try:
        answered = subprocess.run(
            [sys.executable, "-c", ANSWER],
            input=pickle.dumps(functions),
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
            check=True,
        )
    except (pickle.PicklingError, OSError, subprocess.SubprocessError):
        return {}
    codes = pickle.loads(answered.stdout)
    return {function: codes[digest(function)] for function in functions if digest(function) in codes}


def answer() -> None:
    """What another process does: read functions, give {digest: object file}."""
    codes = _compile_all(pickle.load(sys.stdin.buffer), lambda: None)
    pickle.dump({digest(function): code for function, code in codes.items()}, sys.stdout.buffer)


def _compile_all(functions: Sequence[FunctionType], tell: Callable[[], Any]) -> dict[FunctionType, bytes]:
    """The object files of functions; Python looks for no garbage meanwhile, a tenth of the time."""
    codes, collects = {}, gc.isenabled()
    gc.disable()
    try:
        for function in functions:
            codes[function] = _compile(function)
            tell()
    finally:
        if collects:
            gc.enable()
    return codes


def _compile(function: FunctionType) -> bytes:
    check(function)
    return translated(function)
