"""Why are the frequencies of the first second higher? How often the rig's tip comes round, window by window.

The paper leaves the question open, beside three points of the rig: clamp, support, amplitude. The shipped studies of
these points give the runs, the full nonlinear beam at every value of their axis. The repetition rate counts the cycles
of the tip, low-passed, between its passages through zero. A closed contact turns the motion round sooner, so the rate
lies above the free frequency f_open while there is contact; half cycles of the open and of the closed level in turn
make 2 f_open f_closed / (f_open + f_closed), the limit of large motion (S. W. Shaw, P. J. Holmes, J. Sound Vib. 90
(1983) 129).

Run: python examples/first_second_frequencies.py [FIGURE.png]   (some minutes; --quick: few values, one second)
"""

from __future__ import annotations

import sys
from typing import Any

import matplotlib
import matplotlib.figure
import numpy as np
import scipy.interpolate
import scipy.signal

import multiphi_exudyn as mp
from multiphi_exudyn.study.runners import run_model
from multiphi_exudyn.study.setup import Setup, prepare
from multiphi_exudyn.study.study_file import load_study

STUDIES = {  # and what their values are
    "clamp": "rotation [N m/rad]",
    "clamp-translation": "translation [N/m]",
    "support": "stiffness [N/m]",
    "amplitude": "pulled up [m]",
    "clamp-play": "pulled up [m], clamp with play",
}
WINDOWS = (0.0, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0)  # s
LOW_PASS = 15.0  # Hz: between the rate, at most 6.6 Hz, and the second mode, 37 Hz


def rates(time: np.ndarray, tip: np.ndarray) -> np.ndarray:
    """Cycles a second in every window that the run reaches: 1 / T of a cycle, weighted by the time both share."""
    low = scipy.signal.butter(4, LOW_PASS, fs=1 / (time[1] - time[0]), output="sos")
    zeros = scipy.interpolate.CubicSpline(time, scipy.signal.sosfiltfilt(low, tip)).roots(extrapolate=False)
    begin, end = zeros[:-2], zeros[2:]
    reached = [edge for edge in WINDOWS if edge <= time[-1] + 1e-9]
    shares = np.diff([np.clip(edge, begin, end) for edge in reached], axis=0)
    return np.array([np.average(1 / (end - begin), weights=share) for share in shares])


def natural(setup: Setup) -> tuple[float, float]:
    """First natural frequency [Hz] of the open level, and the limit of large motion, one contact closed in turn."""
    model = mp.MultiPhiModel(setup.structure, setup.mechanics.contacts, modes=2)
    free, closed = (float(model.level(names).frequencies[0]) for names in ((), (model.contacts[0].name,)))
    return free, 2 * free * closed / (free + closed)


def shown(name: str, quick: bool) -> dict[Any, tuple[float, float, np.ndarray]]:
    """Value of the study's axis -> free frequency [Hz], the limit and the rates over it, less one."""
    study, found = load_study(name, quick=quick), {}
    for at in study.points:
        case = study.reference(at)
        scene = study.scene_for(case)
        setup = prepare(scene)
        run = run_model(setup, study.model_name(case), progress=False)
        free, limit = natural(setup)
        (value,) = at.values()
        found[value] = free, limit / free - 1, rates(run.time, run.points["node3"]) / free - 1
        told = ", ".join(f"{100 * rise:+.1f}" for rise in found[value][2])
        print(f"{name} {value}: free {free:.3f} Hz; rate above it {told} %; at most {100 * (limit / free - 1):+.1f} %")
    return found


def draw(everything: dict[str, dict[Any, tuple[float, float, np.ndarray]]], path: str) -> None:
    """A panel for each study: the rise window by window, one line for each value of its axis."""
    figure = matplotlib.figure.Figure(figsize=(9, 9.5), layout="constrained")
    for axes, (name, found) in zip(figure.subplots(3, 2, sharey=True).flat, everything.items(), strict=False):
        for k, (value, (_, _, rise)) in enumerate(found.items()):
            shade = matplotlib.colormaps["viridis"](0.85 * k / max(1, len(found) - 1))
            label = value if isinstance(value, str) else f"{value:g}"
            axes.stairs(100 * rise, WINDOWS[: len(rise) + 1], baseline=None, color=shade, lw=2, label=label)
        axes.axhline(0.0, color="0.7", lw=1)
        axes.set(title=name, xlabel="time [s]", ylabel="rate above the free frequency [%]")
        axes.legend(frameon=False, fontsize=8, title=STUDIES[name], title_fontsize=8)
        axes.label_outer()
    figure.savefig(path, dpi=100)


def main(arguments: list[str]) -> dict[str, dict[Any, tuple[float, float, np.ndarray]]]:
    """All studies."""
    everything = {name: shown(name, "--quick" in arguments) for name in STUDIES}
    for path in arguments:
        if path.endswith(".png"):
            draw(everything, path)
    return everything


if __name__ == "__main__":
    main(sys.argv[1:])
