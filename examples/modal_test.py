"""The paper's modal test (Table 38.1) by simulation: a sweep at node1 without the support, and what it tells.

A shaker sweeps from 2 to 250 Hz, then the beam rings down; accelerometers at node1 to node3 are sampled. Frequencies
and damping ratios are identified from the force and these records alone. The third mode, 0.009 % of the critical
damping, decays by a factor of e in 16 s: its peak is 0.02 Hz wide, and a record that ends before it has died away
widens it. After 60 s of decay 2 % of it are left, and its ratio comes out to half a per cent.

The frequency response functions of a record that begins at rest and ends when the response has died away are

    H_p(f) = A_p(f) / F(f)

A, F the discrete Fourier transforms of responses and force. Near a mode, in a band around the peak f_0, they are

    H_p = (b_p0 + b_p1 s + b_p2 s^2) / (s - lambda),   s = 2 pi i (f - f_0)

with one pole lambda for all responses; the polynomial holds the residue and what the other modes add. Multiplied by
s - lambda the equations are linear in lambda and b (E. C. Levy, IRE Trans. Automatic Control 4, 1959). The band
follows from the pole by iteration: it ends half way to the next peak, or at WIDTHS half widths of the peak.

Run: python examples/modal_test.py [FIGURE.png]
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass

import matplotlib.axes
import matplotlib.figure
import numpy as np
import scipy.signal

import multiphi_exudyn as mp
from reference_models.rig import published_frequencies, rig_beam, rig_damping

POINTS = ("node1", "node2", "node3")
BAND = (2.0, 250.0)  # Hz
SWEEP, DECAY = 20.0, 60.0  # s
RATE = 1024  # Hz
FILTER = 500.0  # Hz: modes above it move quasi-statically, as if behind an accelerometer's filter
NOISE = 0.02  # m/s2, standard deviation of what an accelerometer adds
SHARE = 4096  # samples evaluated at a time
PROMINENCE = 10.0  # dB by which a peak of all responses together stands out of its surroundings
FIRST_BAND = 0.1  # half band at most, as a fraction of the peak's frequency
WIDTHS = 4.0  # half band in units of zeta f, the half width of the peak
FEWEST_LINES = 8  # spectral lines in a half band at least
ROUNDS = 4  # iterations: the band follows from the pole, the pole from the band
DEGREE = 2  # of b_p, in the last band
HIGHEST_RATIO = 0.2  # damping ratio above which a peak is no resonance


@dataclass(frozen=True)
class ResponseModes:
    """Frequencies (m,) [Hz], ascending, and damping ratios (m,) of the modes that a response shows."""

    frequencies: np.ndarray
    ratios: np.ndarray


def frequency_response_functions(
    force: np.ndarray, responses: np.ndarray, step: float
) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies (k,) [Hz] and H (points, k) of a force (n,) and responses (points, n), sampled every ``step`` [s]."""
    if responses.ndim != 2 or force.shape != responses.shape[1:]:
        raise mp.MultiPhiValueError(f"responses: got shape {responses.shape}, need (points, {len(force)})")
    spectrum = np.fft.rfft(force)
    if not np.all(spectrum):
        raise mp.MultiPhiValueError("force: got a spectrum with zeros, need one that reaches every frequency")
    return np.fft.rfftfreq(len(force), step), np.fft.rfft(responses) / spectrum


def identified_modes(frequencies: np.ndarray, functions: np.ndarray, lowest: float, highest: float) -> ResponseModes:
    """Modes that stand out between two frequencies [Hz] of frequency response functions H (points, k)."""
    band = (frequencies >= lowest) & (frequencies <= highest)
    if np.sum(band) <= 2 * FEWEST_LINES:
        raise mp.MultiPhiValueError(
            f"frequencies: got {np.sum(band)} between the limits, need more than {2 * FEWEST_LINES}"
        )
    f, h = frequencies[band], functions[:, band]
    level = 10 * np.log10(np.sum(np.abs(h) ** 2, axis=0))
    peaks = scipy.signal.find_peaks(level, prominence=PROMINENCE)[0]
    poles = [_pole(f, h, float(f[peak]), _half_band(f[peaks], float(f[peak]))) for peak in peaks]
    modes = sorted((abs(pole) / (2 * math.pi), -pole.real / abs(pole)) for pole in poles)
    kept = [(hz, ratio) for hz, ratio in modes if lowest <= hz <= highest and 0 < ratio < HIGHEST_RATIO]
    return ResponseModes(np.array([hz for hz, _ in kept]), np.array([ratio for _, ratio in kept]))


def _half_band(peaks: np.ndarray, peak: float) -> float:
    """Half band [Hz] around a peak that ends half way to the next peak."""
    others = np.abs(peaks[peaks != peak] - peak)
    return float(np.min(others / 2, initial=FIRST_BAND * peak))


def _pole(f: np.ndarray, h: np.ndarray, peak: float, most: float) -> complex:
    """The pole [1/s] near a peak [Hz], from a half band of ``most`` [Hz] or less."""
    fewest = FEWEST_LINES * float(f[1] - f[0])
    half, centre, pole = max(most, fewest), peak, 0j
    for _ in range(ROUNDS):
        use = np.abs(f - centre) <= half
        pole = 2j * math.pi * centre + 2 * math.pi * half * _fitted_pole((f[use] - centre) / half, h[:, use])
        centre = pole.imag / (2 * math.pi)
        half = max(min(WIDTHS * abs(pole.real) / (2 * math.pi), most), fewest)
    return pole


def _fitted_pole(positions: np.ndarray, h: np.ndarray) -> complex:
    """The pole of H (points, k) at s = 1j times positions (k,) in -1 ... 1."""
    s = 1j * positions
    polynomials = np.kron(np.eye(len(h)), np.vander(s, DEGREE + 1))
    matrix = np.column_stack([h.ravel(), polynomials])
    return complex(np.linalg.lstsq(matrix, (h * s).ravel())[0][0])


@dataclass(frozen=True)
class Record:
    """time (n,) [s], force (n,) [N] at node1, acceleration (3, n) [m/s2] of the three points; the model's own modes."""

    time: np.ndarray
    force: np.ndarray
    acceleration: np.ndarray
    own: ResponseModes


def measured() -> Record:
    """The test: a logarithmic sweep that ends where its force is zero, then free decay."""
    structure = mp.planar_beam(rig_beam(), elements=57, damping=rig_damping())
    model = mp.MultiPhiModel(structure, modes=mp.UpTo(FILTER))
    cycles = (BAND[1] - BAND[0]) / math.log(BAND[1] / BAND[0])  # a second
    duration = (round(cycles * SWEEP) + 0.25) / cycles
    load = mp.SweepLoad("node1", 1.0, *BAND, duration, "logarithmic", tolerance=1e-6)
    run = mp.simulate(model, SWEEP + DECAY, loads=[load])
    time = np.arange(round(RATE * (SWEEP + DECAY))) / RATE
    rows = np.array([structure.row(point) for point in POINTS])
    shares = np.array_split(time, len(time) // SHARE)
    acceleration = np.concatenate([rows @ run.acceleration(share) for share in shares], axis=1)
    noise = NOISE * np.random.default_rng(0).normal(size=acceleration.shape)
    force = np.where(time < duration, np.cos(load.course.phase(time)), 0.0)
    inside = model.level(()).frequencies <= BAND[1]
    own = ResponseModes(model.level(()).frequencies[inside], model.level(()).ratios[inside])
    return Record(time, force, acceleration + noise, own)


def table(own: ResponseModes, found: ResponseModes) -> list[str]:
    """Model, identified, difference; the paper's measured values beside them."""
    paper = published_frequencies()["measured"]
    lines = ["mode  model [Hz]  identified  diff [%]   model [%]  identified  diff [%]   paper: Hz, %"]
    for k, (f, g, z, y) in enumerate(zip(own.frequencies, found.frequencies, own.ratios, found.ratios, strict=True)):
        frequency = f"{f:10.4f}  {g:10.4f}  {100 * (g / f - 1):+8.4f}"
        ratio = f"{100 * z:9.4f}  {100 * y:10.4f}  {100 * (y / z - 1):+8.2f}"
        printed = f"{paper.frequencies[k]:g}, {100 * paper.ratios[k]:g}"
        lines.append(f"{k + 1:4}  {frequency}   {ratio}   {printed}")
    return lines


def draw(record: Record, found: ResponseModes, path: str) -> None:
    """Acceleration in time; frequency response functions as measured, and made of the identified modes."""
    figure = matplotlib.figure.Figure(figsize=(9, 7.5), layout="constrained")
    upper, lower = figure.subplots(2, 1, height_ratios=(1, 1.6))
    upper.plot(record.time[::3], record.acceleration[1, ::3], lw=0.3, color="#0072B2", rasterized=True)
    upper.axvline(SWEEP, color="0.5", lw=0.8, ls=":")
    upper.text(
        SWEEP + 0.8, 0.93, "end of the sweep, free decay", fontsize=9, va="top", transform=upper.get_xaxis_transform()
    )
    upper.set(xlabel="time [s]", ylabel="node2 [m/s²]", xlim=(0, record.time[-1]))
    upper.set_title(
        "1 N at node1 swept from 2 to 250 Hz, support removed; in brackets: identified less the model's", fontsize=11
    )
    _functions(lower, record, found)
    for axis in (upper, lower):
        axis.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=100)


def _functions(axis: matplotlib.axes.Axes, record: Record, found: ResponseModes) -> None:
    f, functions = frequency_response_functions(record.force, record.acceleration, 1 / RATE)
    band = (f >= BAND[0]) & (f <= BAND[1])
    fitted = synthesised(f[band], functions[:, band], found)
    for k, (point, colour) in enumerate(zip(POINTS, ("#009E73", "#0072B2", "#D55E00"), strict=True)):
        label = f"{point}, from the samples"
        axis.loglog(f[band], np.abs(functions[k, band]), color=colour, lw=2.5, alpha=0.35, label=label)
        axis.loglog(f[band], np.abs(fitted[k]), color=colour, lw=0.9)
    axis.plot([], [], color="0.3", lw=0.9, label="made of the identified modes")
    axis.set_ylim(top=axis.get_ylim()[1] * 60)
    values = zip(record.own.frequencies, found.frequencies, record.own.ratios, found.ratios, strict=True)
    for k, (true, hz, own, ratio) in enumerate(values):
        off, ratio_off = round(100 * (hz / true - 1), 3) + 0.0, round(100 * (ratio / own - 1), 1) + 0.0  # no -0
        told = f"{hz:.2f} Hz ({off:+.3f} %)\nζ {100 * ratio:.3g} % ({ratio_off:+.1f} %)"
        axis.text(
            hz, 0.995 - 0.09 * (k % 2), told, transform=axis.get_xaxis_transform(), ha="center", va="top", fontsize=8
        )
        axis.axvline(hz, ymax=0.82, color="0.8", lw=0.8, zorder=0)
    axis.set(xlabel="frequency [Hz]", ylabel="acceleration / force [1/kg]", xlim=(BAND[0], 330))
    axis.set_xticks([2, 5, 10, 20, 50, 100, 200], ["2", "5", "10", "20", "50", "100", "200"])
    axis.legend(frameon=False, fontsize=9, loc=(0.2, 0.55))


def synthesised(f: np.ndarray, functions: np.ndarray, found: ResponseModes) -> np.ndarray:
    """Accelerances (points, k) of the identified modes: residues and what lies outside the band, to relative errors."""
    s = 2j * math.pi * f
    w, z = 2 * math.pi * found.frequencies, found.ratios
    modes = np.array([s**2 / (s**2 + 2 * ratio * own * s + own**2) for own, ratio in zip(w, z, strict=True)])
    columns = np.vstack([modes, np.ones_like(s), s**2 / np.abs(s[-1]) ** 2]).T  # the rest: inertia and flexibility
    fitted = []
    for function in functions:
        weights = 1 / np.abs(function)
        system, wanted = columns * weights[:, None], function * weights
        real = np.linalg.lstsq(np.vstack([system.real, system.imag]), np.r_[wanted.real, wanted.imag])[0]
        fitted.append(columns @ real)
    return np.array(fitted)


def main(arguments: list[str]) -> tuple[ResponseModes, ResponseModes]:
    """The model's modes, and those identified."""
    record = measured()
    f, functions = frequency_response_functions(record.force, record.acceleration, 1 / RATE)
    found = identified_modes(f, functions, *BAND)
    print(*table(record.own, found), sep="\n")
    if arguments:
        draw(record, found, arguments[0])
    return record.own, found


if __name__ == "__main__":
    main(sys.argv[1:])
