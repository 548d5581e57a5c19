"""Frequency response of the paper's cantilever with its support, frequencies going up and down: contact hardens.

A harmonic force at node1; where the tip strikes the support the curve bends to higher frequencies, and what the
structure does depends on where it comes from. Most responses with contact never repeat; their amplitude is the mean
over the last periods. Beside them: the full nonlinear Exudyn beam, run until its amplitude is that of a steady state.

Run: python examples/frequency_response.py [--full] [FIGURE.png]      --full: all frequencies and the full beam, 5 min
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace

import matplotlib.figure
import numpy as np

import multiphi_exudyn as mp
from multiphi_exudyn.mechanics.structure import damping_matrix
from reference_models.full_beam import FullBeam, FullBeamSettings
from reference_models.rig import rig_beam, rig_contact, rig_damping

LOAD = mp.HarmonicLoad("node1", 10.0, 4.0)  # N
STIFFNESS = 1e6  # N/m
POINTS = ("node2", "node3")
QUICK = np.array([5.0, 6.0, 7.0, 10.0])  # Hz
FINE = np.r_[np.arange(2.0, 5.5, 0.25), np.arange(5.5, 6.75, 0.0625), np.arange(7.0, 25.1, 1.0)]
FULL = (3.0, 4.0, 5.0, 6.0, 8.0, 12.0, 20.0)  # Hz, the force growing slowly,
SUDDEN = (6.0,)  # Hz, and at once, which leads to the other branch
FULL_PERIODS, FULL_KEPT = 40, 16  # of the full beam's run, and those at its end that are looked at
RAMP = 1.0  # s in which the force on the full beam grows, so that the third mode, which rings for minutes, hardly does


@dataclass(frozen=True)
class Curves:
    """Frequencies going up, then down; the beam they are of, without contact."""

    up: mp.FrequencyResponse
    down: mp.FrequencyResponse
    beam: mp.LinearStructure

    def linear(self, point: str, frequencies: np.ndarray) -> np.ndarray:
        """Amplitude (k,) [m] without contact, from the matrices."""
        damping, pull = damping_matrix(self.beam), LOAD.amplitude * self.beam.row(LOAD.at)
        omegas = 2 * np.pi * frequencies
        systems = (self.beam.stiffness - w**2 * self.beam.mass + 1j * w * damping for w in omegas)
        return np.array([abs(self.beam.row(point) @ np.linalg.solve(system, pull)) for system in systems])


@dataclass(frozen=True)
class FullPoint:
    """The full beam at one frequency [Hz]: amplitude of every period kept [m], point -> (k,)."""

    frequency: float
    amplitudes: dict[str, np.ndarray]


def curves(frequencies: np.ndarray, periods: int) -> Curves:
    """Both directions, each frequency from the one before; at most ``periods`` of the load at each."""
    structure = mp.planar_beam(rig_beam(), elements=57, damping=rig_damping())
    model = mp.MultiPhiModel(structure, [rig_contact(STIFFNESS)], modes=12)
    up = mp.frequency_response(model, LOAD, frequencies, periods=periods)
    back = {"displacement": up.last.displacement, "velocity": up.last.velocity}
    down = mp.frequency_response(model, LOAD, frequencies[::-1], periods=periods, **back)
    return Curves(up, down, structure)


def full_point(frequency: float, sudden: bool = False) -> FullPoint:
    """The full nonlinear beam from rest: 20 ANCF elements, the same stiffness and damping."""
    settings = FullBeamSettings(elements=20, step=5e-5, output_step=2e-4)
    beam = FullBeam(rig_beam(), [rig_contact(STIFFNESS)], settings)
    damping = damping_matrix(replace(beam.structure, damping=rig_damping()))

    def force(t: np.ndarray) -> np.ndarray:
        grown = np.sin(np.pi / 2 * np.minimum(t / RAMP, 1.0)) ** 2
        return LOAD.amplitude * grown * np.cos(2 * np.pi * frequency * t)

    load = mp.HarmonicLoad(LOAD.at, LOAD.amplitude, frequency) if sudden else mp.FunctionLoad(LOAD.at, force)
    run = beam.run(FULL_PERIODS / frequency, damping=damping, loads=[load], progress=False)
    if run.status != "ok":
        print(f"full beam at {frequency:g} Hz: {run.message}")
    period = np.floor(run.time * frequency + 1e-9).astype(int)
    kept = range(FULL_PERIODS - FULL_KEPT, FULL_PERIODS)
    amplitudes = {name: np.array([np.ptp(run.points[name][period == k]) / 2 for k in kept]) for name in POINTS}
    return FullPoint(frequency, amplitudes)


def compared(found: Curves, points: list[FullPoint]) -> list[str]:
    """Native and full amplitudes of node2 and node3 in lines, at the frequencies of the full beam."""
    lines = []
    for point in points:
        at = int(np.argmin(np.abs(found.up.frequencies - point.frequency)))
        for name in POINTS:
            full = float(np.mean(point.amplitudes[name]))
            ways = [found.up.amplitude(name)[at], found.down.amplitude(name)[::-1][at]]
            told = ", ".join(f"{1e3 * own:.3f} mm ({100 * (own / full - 1):+.2f} %)" for own in ways)
            lines.append(f"{point.frequency:5.2f} Hz {name}: full {1e3 * full:.3f} mm; native up, down: {told}")
    return lines


def draw(found: Curves, points: list[FullPoint], path: str) -> None:
    """Amplitudes of node2 and node3 against frequency."""
    figure = matplotlib.figure.Figure(figsize=(9, 7), layout="constrained")
    axes = figure.subplots(2, 1, sharex=True)
    for axis, name in zip(axes, POINTS, strict=True):
        _curve(axis, found, name)
        _full(axis, points, name)
        axis.set(xscale="log", yscale="log", ylabel=f"amplitude of {name} [mm]")
        axis.spines[["top", "right"]].set_visible(False)
        axis.grid(color="#EEEEEE")
    gap = 1e3 * rig_contact(STIFFNESS).gap
    axes[0].axhline(gap, color="0.5", lw=0.8, ls=":")
    axes[0].text(0.99, gap, "gap", transform=axes[0].get_yaxis_transform(), ha="right", va="bottom")
    axes[0].set_title(f"{LOAD.amplitude:g} N at {LOAD.at}, support below node2: 1e6 N/m, gap {gap:g} mm")
    ticks = [hz for hz in (2, 3, 4, 5, 6, 8, 10, 12, 16, 20, 25) if axes[0].get_xlim()[0] < hz < axes[0].get_xlim()[1]]
    axes[-1].set_xticks(ticks, [str(hz) for hz in ticks])
    axes[-1].set_xticks([], minor=True)
    axes[-1].set_xlabel("frequency of the force [Hz]")
    axes[1].legend(frameon=False, fontsize=9)
    figure.savefig(path, dpi=100)


def _curve(axis: matplotlib.axes.Axes, found: Curves, name: str) -> None:
    dense = np.geomspace(found.up.frequencies[0], found.up.frequencies[-1], 400)
    axis.plot(dense, 1e3 * found.linear(name, dense), color="0.7", label="without contact")
    ways = (("going up", found.up, "#0072B2", "^"), ("going down", found.down, "#D55E00", "v"))
    for label, response, colour, marker in ways:
        values, orders = 1e3 * response.amplitude(name), response.orders
        axis.plot(response.frequencies, values, color=colour, lw=1.2, label=f"Multi-Phi, r = 12, {label}")
        open_marks = {"marker": marker, "ls": "", "color": colour, "mfc": "white", "ms": 4.5}
        axis.plot(response.frequencies[orders == 0], values[orders == 0], **open_marks)
        higher = orders > 1
        axis.plot(response.frequencies[higher], values[higher], **open_marks | {"mfc": colour})
        for hz, value, order in zip(response.frequencies[higher], values[higher], orders[higher], strict=True):
            axis.annotate(f"1/{order}", (hz, value), xytext=(0, 7), textcoords="offset points", fontsize=8)
    axis.plot([], [], "^", color="0.4", mfc="white", label="does not repeat: mean over its periods")


def _full(axis: matplotlib.axes.Axes, points: list[FullPoint], name: str) -> None:
    if not points:
        return
    values = np.array([1e3 * point.amplitudes[name] for point in points])
    mean = np.mean(values, axis=1)
    spread = np.abs(np.array([np.min(values, axis=1), np.max(values, axis=1)]) - mean)
    at = [point.frequency for point in points]
    look = {"color": "black", "ms": 5, "lw": 1, "capsize": 2, "zorder": 5}
    axis.errorbar(at, mean, spread, fmt="s", label="full Exudyn beam from rest, range of its periods", **look)


def main(arguments: list[str]) -> Curves:
    """Both curves, and with --full the points of the full beam."""
    whole = "--full" in arguments
    paths = [given for given in arguments if not given.startswith("--")]
    found = curves(FINE, periods=64) if whole else curves(QUICK, periods=32)
    for label, response in (("up", found.up), ("down", found.down)):
        for hz, state, amplitude in zip(
            response.frequencies, response.states, response.amplitude("node2"), strict=True
        ):
            order = f"order {state.order}" if state.order else f"{state.residual:.1e}"
            print(f"{label:4} {hz:6.3f} Hz  node2 {1e3 * amplitude:.3f} mm  {state.status}, {order}")
    points = [*map(full_point, FULL), *(full_point(hz, sudden=True) for hz in SUDDEN)] if whole else []
    print(*compared(found, points), sep="\n")
    if paths:
        draw(found, points, paths[0])
    return found


if __name__ == "__main__":
    main(sys.argv[1:])
