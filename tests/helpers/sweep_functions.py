"""Functions that worker processes can import, and programs that a test starts and kills."""

import ctypes
import os
import sys
import time
from pathlib import Path

import numpy as np

from multiphi_exudyn.study.sweep import Outcome, Store, grid, open_executor, sweep


def square(case):
    return {"square": case["x"] ** 2, "root": case["x"] ** 0.5, "list": [case["x"], None, "text"]}


def wave(case):
    time_grid = np.linspace(0.0, 1.0, 50)
    return Outcome({"mean": 0.0}, {"time": time_grid, "file": np.sin(case["x"] * time_grid)})


def odd_fails(case):
    if case["x"] % 2:
        raise ValueError(f"{case['x']} is\nodd")
    return Outcome({"x": case["x"]}, status="failed" if case["x"] == 2 else "ok", message="two is told, not raised")


def busy(case):
    """Ends after ``seconds``, looking at the clock all the time."""
    end = time.perf_counter() + case["seconds"]
    while time.perf_counter() < end:
        pass
    return {"seconds": case["seconds"]}


def adds(case):
    """In compiled code all the time, which no signal leaves."""
    return {"sum": sum(range(case["numbers"]))}


def converts(case):
    """An own error from whatever comes, as a solver of compiled code does with errors of its user functions."""
    try:
        return busy(case)
    except BaseException:
        raise RuntimeError("a user function has failed") from None


def tells_no_raise(case):
    try:
        return busy(case)
    except BaseException:
        return Outcome({}, status="failed", message="a user function has failed")


def swallows_once(case):
    try:
        busy(case)
    except BaseException:
        busy(case)
    return {}


def exudyn_steps(case):
    """A unit mass under a unit force for 1 s, with a user function in each of the steps."""
    import exudyn  # not what every worker of every test should load

    from reference_models.exudyn_quiet import quiet

    mbs = exudyn.SystemContainer().AddSystem()
    mass = mbs.CreateMassPoint(mass=1.0)
    mbs.CreateForce(itemNumber=mass, loadVector=[1.0, 0.0, 0.0])
    mbs.SetPreStepUserFunction(lambda mbs, t: True)
    mbs.Assemble()
    settings = exudyn.SimulationSettings()
    settings.timeIntegration.numberOfSteps = case["steps"]
    settings.timeIntegration.endTime = 1.0
    settings.timeIntegration.verboseMode = 0
    settings.solution.file.write = False
    with quiet():
        mbs.SolveDynamic(settings)
    return {"position": mbs.GetObjectOutputBody(mass, exudyn.OutputVariableType.Position)[0]}


def dies(case):
    """Takes its process with it where x is among ``fatal``."""
    time.sleep(0.01)
    if case["x"] in case["fatal"]:
        os._exit(3)
    return {"x": case["x"]}


def unloadable():
    raise ImportError("not on this machine")


class Unloadable:
    """Pickles, and cannot be loaded."""

    def __call__(self, case):
        return {}

    def __reduce__(self):
        return unloadable, ()


def logged(case):
    """Leaves a line in the file ``log`` when it starts, and takes 10 ms."""
    with Path(case["log"]).open("a") as file:
        file.write(f"{case['x']}\n")
    time.sleep(0.01)
    return {"square": case["x"] ** 2}


def holds(case):
    """Says that it runs, and then does so for a minute; in compiled code that keeps the interpreter's lock, or not."""
    if case["x"] < case.get("short", 0):
        return {}
    os.write(sys.stdout.fileno(), b"runs\n")  # in one piece: others write there too
    if case["locked"]:
        ctypes.PyDLL(None).sleep(60)
    return busy({"seconds": 60.0})


def many(log, count=60):
    return grid({"log": [str(log)], "x": range(count)})


def sweep_logged(path, log, workers):
    """The sweep of the kill test."""
    with Store(path) as store, open_executor("processes", workers) as executor:
        sweep(logged, many(log), store, "kill", executor=executor)


def nursery(path, log):
    """For each number of workers in the input: the kill test's sweep in a fork; prints its number, -1 at its end."""
    for workers in sys.stdin:
        child = os.fork()
        if child == 0:
            sweep_logged(path, log, int(workers))
            os._exit(0)
        print(child, flush=True)
        os.waitpid(child, 0)
        print(-1, flush=True)


def sweep_here(path, log, reverse):
    with Store(path) as store:
        cases = many(log)
        sweep(logged, cases[::-1] if reverse else cases, store, "shared")


def sweep_held(path, cases):
    with Store(path) as store, open_executor("processes", 2) as executor:
        sweep(holds, cases, store, "held", executor=executor)
