"""Exudyn scripts that others wrote, each reduced just before its first dynamic run and compared with that run.

    python tests/campaign/published_scripts.py FOLDER ... [--only NAME ...] [--out TABLE.csv] [--seconds 60]

A FOLDER is what a copy of Exudyn's own repository has as ``main/pythonDev/TestModels`` or ``Examples``. Every script
runs in a process of its own, without windows, and ends after the comparison. NRMSE = |q_reduced - q| / |q - q_0| over
all coordinates and instants of the run, of ``reduce(mbs)`` as it is called without further arguments; a run of more
than LONGEST steps of Exudyn's ends after so many. Beside it stands what the check of the linear range found. Verdicts:

    agrees     at most 1 %, without a warning      warned      a warning, whatever the error
    WRONG      more than 1 %, without a warning    refused     by an error of multiphi_exudyn, or no end of the run
    exception  by any other error                  no run      no dynamic run of Exudyn's own to compare with
"""

from __future__ import annotations

import argparse
import builtins
import collections
import csv
import functools
import importlib
import inspect
import json
import math
import os
import resource
import runpy
import signal
import subprocess
import sys
import tempfile
import warnings
from pathlib import Path
from typing import Any

import numpy as np

AGREEMENT = 0.01
SAMPLES = 200  # of a run
FIELDS = ("script", "verdict", "error", "checked", "named", "told")
NO_RUN = "no run"
WAITING = 20  # times the processor time that a script may take, it may wait
LONGEST = 5_000_000  # steps of a run of Exudyn: a minute of a small system
FINER = (8, 64)  # times as many steps, where an error may be that of Exudyn's own run
RENAMED = {"bodyOrNodeList": "itemNumbers", "bodyList": "bodyNumbers"}
SHAPES = ("Rectangle", "OrthoCubePoint", "OrthoCubeLines", "CheckerBoard", "Cylinder", "Sphere", "Basis")


def main(arguments: list[str]) -> int:
    """Run the scripts of folders one after the other; a line for each, and the numbers of verdicts."""
    given = _arguments(arguments)
    rows = []
    for script in sorted(script for folder in given.folders for script in Path(folder).resolve().glob("*.py")):
        if given.only and script.stem not in given.only:
            continue
        rows.append({"script": script.stem, **_judged(script, given.seconds)})
        print("{script:42} {verdict:10} {error:>9} {checked:>18} {told}".format(**rows[-1])[:200], flush=True)
    if given.out:
        with Path(given.out).open("w", newline="") as file:
            table = csv.DictWriter(file, FIELDS)
            table.writeheader()
            table.writerows(rows)
    print(dict(collections.Counter(row["verdict"] for row in rows)))
    return int(any(row["verdict"] == "WRONG" for row in rows))


def _arguments(arguments: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", metavar="FOLDER")
    parser.add_argument("--only", nargs="*", help="names of scripts, all of the folders without it")
    parser.add_argument("--out", help="table of verdicts")
    parser.add_argument("--seconds", type=float, default=60.0, help="of processor time that a script may take")
    return parser.parse_args(arguments)


def _judged(script: Path, seconds: float) -> dict[str, str]:
    """Verdict, error, whether an item is named, and what was told, by a process of its own."""
    with tempfile.TemporaryDirectory() as place:
        found = Path(place, "found.json")
        call = [sys.executable, __file__, "--one", str(script), str(found), str(seconds)]
        told = f"not done within {seconds:g} s"
        try:
            ended = subprocess.run(call, cwd=script.parent, capture_output=True, text=True, timeout=WAITING * seconds)
            if ended.returncode != -signal.SIGXCPU:
                told = (ended.stderr.strip().splitlines() or ["no dynamic run"])[-1]
        except subprocess.TimeoutExpired:
            pass
        if found.exists():
            return dict(json.loads(found.read_text()))
    return {"verdict": NO_RUN, "error": "", "checked": "", "named": "", "told": told}


# ---------------------------------------------------------------------- in the process of one script


def run_script(script: str, found: str, seconds: str) -> None:
    """Run a script with SolveDynamic replaced by the comparison, after which the process ends; so it does too late."""
    limit = math.ceil(float(seconds))
    resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 1))
    warnings.simplefilter("ignore")
    os.environ["MPLBACKEND"] = "Agg"
    import exudyn as exu

    importlib.import_module("multiphi_exudyn.exudyn_plugin")  # it replaces SolveDynamic too
    _without_windows(exu)
    _with_old_names(exu)

    def compared(mbs: Any, simulationSettings: Any = None, solverType: Any = None, **named: Any) -> None:
        settings = exu.SimulationSettings() if simulationSettings is None else simulationSettings
        kind = {} if solverType is None else {"solverType": solverType}
        Path(found).write_text(json.dumps(_compared(mbs, settings, lambda: solve(mbs, settings, **kind, **named))))
        sys.stdout.flush()
        os._exit(0)  # whatever the script would do next

    solve = exu.MainSystem.SolveDynamic
    exu.MainSystem.SolveDynamic = exu.SolveDynamic = compared
    sys.path.insert(0, str(Path(script).parent))
    sys.argv = [script]
    runpy.run_path(script, run_name="__main__")


def _without_windows(exu: Any) -> None:
    def nothing(*given: Any, **named: Any) -> bool:
        return False

    renderer = type(exu.SystemContainer().renderer)
    for name in ("Start", "Stop", "DoIdleTasks", "SendRedrawSignal", "ZoomAll", "SetState"):
        setattr(renderer, name, nothing)
    for name in ("StartRenderer", "StopRenderer", "DoRendererIdleTasks"):
        setattr(exu, name, nothing)
    exu.SystemContainer.WaitForRenderEngineStopFlag = nothing
    for name in ("WaitForUserToContinue", "SolutionViewer", "PlotSensor", "DrawSystemGraph"):
        setattr(exu.MainSystem, name, nothing)
    exu.config.printToConsole = False


def _with_old_names(exu: Any) -> None:
    """What older scripts take for granted: names that are elsewhere since, and parameters that have other names.

    Parameters that items no longer have are left out, from both runs.
    """
    elsewhere: dict[str, Any] = {"exudyn": exu, "np": np, "NormL2": np.linalg.norm}
    elsewhere["VAdd"], elsewhere["VSub"] = (lambda a, b: np.add(a, b)), (lambda a, b: np.subtract(a, b))
    elsewhere["ScalarMult"] = lambda factor, vector: factor * np.asarray(vector)
    elsewhere["graphics"] = importlib.import_module("exudyn.graphics")
    beams, utilities = (importlib.import_module(f"exudyn.{name}") for name in ("beams", "basicUtilities"))
    utilities.NormL2 = np.linalg.norm
    elsewhere.update({name: getattr(beams, name) for name in dir(beams) if name.startswith(("Generate", "Points"))})
    elsewhere.update({name: getattr(math, name) for name in ("sin", "cos", "tan", "sqrt", "pi")})
    drawn = {f"GraphicsData{shape}": lambda *given, **named: {"type": "Line", "data": [0.0] * 6} for shape in SHAPES}
    vars(builtins).update({**elsewhere, **drawn})
    items = importlib.import_module("exudyn.itemInterface")
    for item in vars(items).values():
        if isinstance(item, type):
            item.__init__ = _lenient(item.__init__)
    for name in dir(exu.MainSystem):
        if name.startswith("Create"):
            setattr(exu.MainSystem, name, _renamed(getattr(exu.MainSystem, name)))


def _lenient(init: Any) -> Any:
    known = inspect.signature(init).parameters

    @functools.wraps(init)
    def lenient(self: Any, *given: Any, **named: Any) -> None:
        init(self, *given, **{key: value for key, value in named.items() if key in known})

    return lenient


def _renamed(create: Any) -> Any:
    @functools.wraps(create)
    def renamed(*given: Any, **named: Any) -> Any:
        return create(*given, **{RENAMED.get(key, key): value for key, value in named.items()})

    return renamed


def _compared(mbs: Any, settings: Any, solve: Any) -> dict[str, str]:
    """The verdict on one dynamic run, which ``solve`` does."""
    import exudyn as exu

    from multiphi_exudyn.errors import MultiPhiError

    data, kinds = mbs.systemData, exu.ConfigurationType
    data.SetSystemState(data.GetSystemState(kinds.Initial), kinds.Current)
    start = data.GetODE2Coordinates()
    integration = settings.timeIntegration
    began = integration.startTime
    part = min(1.0, LONGEST / integration.numberOfSteps)
    integration.numberOfSteps = round(part * integration.numberOfSteps)
    integration.endTime = began + part * (integration.endTime - began)
    data.SetTime(began, kinds.Current)
    try:
        displacement, trajectory, checked = _reduced(mbs, integration.endTime - began)
    except MultiPhiError as refusal:
        return _verdict("refused", "", mbs, str(refusal))
    except Exception as failure:
        return _verdict("exception", "", mbs, f"{type(failure).__name__}: {failure}")
    if trajectory.status != "ok":
        return _verdict("refused", "", mbs, f"{trajectory.status}: {trajectory.message}")
    told = "".join(f"{sentence}; " for sentence in trajectory.warnings)
    told += f"of its run {part:.2g}; " if part < 1 else ""
    try:
        error = _error(settings, solve, start, displacement, trajectory)
        for finer in () if trajectory.warnings else FINER:  # is it the error of Exudyn's own steps?
            if error > AGREEMENT:
                settings.timeIntegration.numberOfSteps *= FINER[0]
                error, coarse = _error(settings, solve, start, displacement, trajectory), error
                told += f"{coarse:.2g}, with {finer} times as many steps of Exudyn's own run {error:.2g}; "
    except Exception as failure:  # whatever the script's own run raises
        return _verdict(NO_RUN, "", mbs, f"{type(failure).__name__}: {failure}")
    verdict = "warned" if trajectory.warnings else "agrees" if error <= AGREEMENT else "WRONG"
    return _verdict(verdict, f"{error:.2g}", mbs, told, checked)


def _error(settings: Any, solve: Any, start: np.ndarray, displacement: Any, trajectory: Any) -> float:
    """NRMSE of a reduced run beside Exudyn's own."""
    times, own = _own_run(settings, solve, len(start))
    since = np.clip(times - settings.timeIntegration.startTime, 0.0, trajectory.t_end)
    away = start + displacement(since).T - own
    size = float(np.linalg.norm(own - start))
    return float(np.linalg.norm(away)) / size if size else float(np.any(away))


def _reduced(mbs: Any, t_end: float) -> tuple[Any, Any, str]:
    """The displacement (n_full, k) at times (k,) and run of ``t_end`` [s], error and lag that its check found."""
    import multiphi_exudyn as mp
    from multiphi_exudyn.exudyn_plugin import reduce

    found = reduce(mbs)
    run = mp.simulate(found.model, t_end, velocity=found.velocity, loads=found.loads)
    check = found.check(run) if run.status == "ok" else None
    return functools.partial(found.displacement, run), run, f"{check.error:.2g}, {check.lag:.2g} rad" if check else ""


def _own_run(settings: Any, solve: Any, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Times (k,) and coordinates (k, count) of Exudyn's run; raises if it has no end."""
    from exudyn.utilities import LoadSolutionFile

    until, period = settings.timeIntegration.endTime, settings.timeIntegration.endTime / SAMPLES
    with tempfile.TemporaryDirectory() as place:
        settings.solution.file.write, settings.solution.file.writePeriod = True, period
        settings.solution.file.binary = settings.solution.file.append = False
        settings.solution.file.export.accelerations = settings.solution.file.export.velocities = False
        settings.solution.file.name = f"{place}/coordinates.txt"
        solve()
        table = LoadSolutionFile(settings.solution.file.name, verbose=False)["data"]
    if abs(table[-1, 0] - until) > 2 * period or not np.all(np.isfinite(table)):
        raise ValueError("its own run has no end")
    return table[:, 0], table[:, 1 : 1 + count]


def _verdict(verdict: str, error: str, mbs: Any, told: str, checked: str = "") -> dict[str, str]:
    named = str(_names_an_item(mbs, told))
    return {"verdict": verdict, "error": error, "checked": checked, "named": named, "told": " ".join(told.split())}


def _names_an_item(mbs: Any, told: str) -> bool:
    import exudyn as exu

    data, kinds = mbs.systemData, ("Node", "Object", "Marker", "Load")
    items = (
        getattr(mbs, f"Get{kind}")(getattr(exu, f"{kind}Index")(i))
        for kind in kinds
        for i in range(getattr(data, f"NumberOf{kind}s")())
    )
    return any(item["name"] in told for item in items if item["name"])


if __name__ == "__main__":
    if sys.argv[1:2] == ["--one"]:
        run_script(*sys.argv[2:])
    else:
        sys.exit(main(sys.argv[1:]))
