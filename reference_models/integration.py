"""One dynamic run of an Exudyn system, with the cause where it stops early."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import exudyn as exu

from reference_models.drive import Drive
from reference_models.exudyn_quiet import cpu_limit, interruptible
from reference_models.recorder import Recorder

__all__ = ["Integration", "integrate"]


@dataclass(frozen=True)
class Integration:
    """cause: why the solver stopped early, or ""; cpu_s: CPU time of the solver [s]."""

    cause: str
    cpu_s: float


def integrate(
    mbs: Any, simulation_settings: Any, recorder: Recorder, cpu_limit_s: float | None, drive: Drive | None = None
) -> Integration:
    """Integrate from the initial state and record; Ctrl-C stops the solver and raises KeyboardInterrupt."""
    mbs.SetPostStepUserFunction(recorder)
    if drive is not None:
        drive(mbs, 0.0)
        mbs.SetPreStepUserFunction(drive)
    started = time.process_time()
    try:
        with cpu_limit(cpu_limit_s), interruptible(recorder.stop):
            cause = _solve(mbs, simulation_settings, cpu_limit_s)
        return Integration(cause, time.process_time() - started)
    finally:
        mbs.SetPostStepUserFunction(0)  # it refers to the system, which would keep both alive
        if drive is not None:
            mbs.SetPreStepUserFunction(0)
            drive.release(mbs)
        recorder.close()


def _solve(mbs: Any, simulation_settings: Any, cpu_limit_s: float | None) -> str:
    try:
        mbs.SolveDynamic(simulation_settings)
    except exu.SolverError as error:
        said = mbs.sys["dynamicSolver"].GetErrorString() or str(error)
        return " ".join(said.split())
    if mbs.sys["dynamicSolver"].output.simulationTimeout:
        return f"CPU limit of {cpu_limit_s:g} s reached"
    return ""
