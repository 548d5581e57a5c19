"""A study drawn by hand: errors and times are known functions of the settings, so every answer is known."""

import itertools
import json

import numpy as np

from multiphi_exudyn.study.accuracy import StudyResult
from multiphi_exudyn.study.details import MapPair
from multiphi_exudyn.study.measures import wavelet_map
from multiphi_exudyn.study.store import Row
from multiphi_exudyn.study.study_file import StudyFile

ENVIRONMENT = {
    "date": "2026-01-02T03:04:05+00:00",
    "python": "3",
    "processor": "a processor",
    "cores": 2,
    "threads": {"OMP_NUM_THREADS": "1"},
    "versions": {"numpy": "2", "exudyn": "1"},
}
METHODS = [
    {
        "name": "Multi-Phi",
        "model": {"kind": "reduced"},
        "axes": {"modes": [3, 4, 6, 8, 12, 16]},
    },
    {
        "name": "Multi-Phi, rigid",
        "model": {"kind": "reduced", "contact": "rigid"},
        "axes": {"modes": [3, 4, 6, 8, 12]},
    },
    {
        "name": "Craig-Bampton",
        "model": {"kind": "craig-bampton"},
        "axes": {"modes": [2, 4, 8], "step": [1e-5, 2e-5, 4e-5, 8e-5]},
        "nearby": {"step": [0.93, 0.87]},
    },
    {
        "name": "full ANCF",
        "model": {"kind": "full", "beam": "ancf"},
        "axes": {"elements": [4, 8, 16], "step": [2e-5, 4e-5, 8e-5, 1.6e-4]},
        "nearby": {"step": [0.93, 0.87]},
    },
]
POINTS = ("node2", "node3")
INTERVALS = [[0.03, 0.032], [0.034, 0.05], [0.2, 0.21]]


def error_and_time(method, at, setting, factor=1.0):
    """Second order in the step and the modes, fourth in the elements, with a floor for the rigid law."""
    h, r = factor * setting.get("step", 0.0), setting.get("modes", np.inf)
    grown = 1 + 40 * abs(at.get("start.displacement", 0.0))
    if method == "Multi-Phi":
        return 1.2 * r**-2.5 * grown, 2e-4 * (1 + r / 8)
    if method == "Multi-Phi, rigid":
        return (0.06 + r**-2.0) * grown, 3e-4 * (1 + r / 8)
    if method == "Craig-Bampton":
        return (4e7 * h**2 + 0.4 * (r + 2) ** -2.0) * grown, 2e-6 / h * (1 + r / 20)
    return (1.5e7 * h**2 + 4.0 * setting["elements"] ** -4.0) * grown, 8e-6 * setting["elements"] / h


def row(method, error=None, at=None, setting=None, nearby=None, status="ok", message="", **values):
    """A row of the error pass; node2 is half as wrong as node3."""
    parameters = {"scene": "small", "content": "0", "at": at or {}, "method": method}
    parameters |= {"setting": setting or {}, "nearby": nearby or {}}
    nrmse = {} if error is None else {w: {"node2": error / 2, "node3": error} for w in ("0.1", "0.3")}
    measured = {"label": f"{method}, in words", "nrmse": nrmse} | values if status == "ok" else {}
    return Row(parameters, status, message, json.loads(json.dumps(measured)), 1.0, ENVIRONMENT, "2026-01-02T03:04:05Z")


def timing(method, online_s, at=None, setting=None):
    """A row of the timing pass."""
    values = {"first_s": 2 * online_s, "repeats_s": [online_s, 0.9 * online_s, 1.3 * online_s], "online_s": online_s}
    values |= {"offline_s": 0.3, "sampling_s": 1e-3, "load_average": 0.5}
    return Row(
        row(method, at=at, setting=setting).parameters, "ok", "", values, 1.0, ENVIRONMENT, "2026-01-02T04:00:00Z"
    )


def in_turns(times, at=None):
    """A row of settings timed in turns; times: (method, setting, times [s]) of each."""
    cases = [row(method, at=at, setting=setting).parameters for method, setting, _ in times]
    parameters = row("in turns", at=at).parameters | {"cases": cases}
    values = {"repeats_s": [repeats for *_, repeats in times]}
    return Row(parameters, "ok", "", values, 1.0, ENVIRONMENT, "2026-01-02T04:00:00Z")


def result_of(rows, timings=(), methods=METHODS, **changes):
    """A result of given rows."""
    study = StudyFile.model_validate({"title": "A <small> study", "scene": "small", "methods": methods}, strict=False)
    given = {"study": study, "name": "small", "judged_points": POINTS, "window": 0.3, "rows": tuple(rows)}
    given |= {"timings": tuple(timings), "turns": (), "maps": (), "environment": ENVIRONMENT}
    return StudyResult(**given | {"assumptions": ("The support is <stiff>.",), "quick": False} | changes)


def small_study(axes=None, methods=METHODS, **changes):
    """All methods over all settings at all points of the scene's axes, with one gap and failures."""
    rows, timings = [], []
    for at in combinations(axes or {}):
        rows += [row("reference", at=at, **contact(0)), coarser(at)]
        timings.append(timing("reference", 30.0, at))
        for method in methods:
            for setting in combinations(method["axes"]):
                rows += [one_run(method["name"], at, setting, near) for near in nearby(method)]
                timings.append(timing(method["name"], error_and_time(method["name"], at, setting)[1], at, setting))
    return result_of(rows, **{"timings": timings, "methods": methods} | changes)


def coarser(at):
    """The reference's coarser copy: 0.1 % off, pointwise for 0.25 s to 1 %."""
    return row("coarser", 0.001, at, horizon={"0.01": 0.25, "0.05": 0.3}, **contact(0))


def combinations(axes):
    return [dict(zip(axes, values, strict=True)) for values in itertools.product(*axes.values())]


def nearby(method):
    return [{}, *({field: factor} for field, factors in method.get("nearby", {}).items() for factor in factors)]


def one_run(method, at, setting, near):
    if method == "full ANCF" and setting == {"elements": 16, "step": 1.6e-4} and near:
        return row(method, None, at, setting, near, "failed", "Newton <did not> converge")
    error, _ = error_and_time(method, at, setting, *near.values())
    indicator = {"indicator": error**1.2} if method.startswith("Multi-Phi") else {}
    return row(method, error, at, setting, near, dofs=12, steps=100, **indicator, **contact(round(40 * error)))


def contact(losses):
    measured = {"first_contact": {"stop": 0.03}, "inner_losses": {"stop": losses}, "impulse": {"stop": 0.4 + losses}}
    return measured | {"intervals": {"stop": INTERVALS}}


def map_pairs(label="Multi-Phi, r = 6"):
    """Two decaying tones, the reduced model without the higher one."""
    time = np.arange(0, 1, 1e-3)
    low = np.exp(-2 * time) * np.sin(2 * np.pi * 4 * time)
    frequencies = np.geomspace(2, 200, 60)
    full = wavelet_map(low + 0.2 * np.exp(-5 * time) * np.sin(2 * np.pi * 37 * time), time, frequencies)
    reduced = wavelet_map(low, time, frequencies)
    levels = {"open": [4.0, 37.0, 109.0], "stop": [17.0, 80.0]}
    return tuple(MapPair(p, label, full, reduced, INTERVALS, INTERVALS, levels) for p in ("node1", *POINTS))
