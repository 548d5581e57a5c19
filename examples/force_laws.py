"""A hardening and a Hertz law at the tip of a beam, followed by chains of levels: error against their segments.

Run: python examples/force_laws.py [FIGURE.png]
"""

from __future__ import annotations

import sys

import exudyn as exu
import matplotlib.figure
import numpy as np
from scipy.integrate import solve_ivp

import multiphi_exudyn as mp
from multiphi_exudyn.exudyn_plugin import CreateMultiPhiBody, body_histories
from multiphi_exudyn.mechanics.force_law import Function
from reference_models.rig import rig_beam
from reference_models.solver_settings import fixed_steps

MODES, TIP, SPAN = 4, 0.020, (-0.025, 0.025)  # modes of the beam, start [m], where the laws are followed [m]
T_END, STEP = 0.2, 1e-4  # s, of the run and of Exudyn's solver
SEGMENTS = (8, 16, 32, 64, 128)
Errors = dict[str, dict[str, list[float]]]


def beam() -> tuple[mp.LinearStructure, np.ndarray, float]:
    """The lowest modes of the paper's cantilever as a structure, its bent start, and its stiffness at the tip [N/m]."""
    structure = mp.planar_beam(rig_beam(), elements=8)
    linear = mp.MultiPhiModel(structure, modes=MODES)
    bent = linear.static_equilibrium({"node3": 1.0})
    level, stiffness = linear.level(()), 1 / float(structure.row("node3") @ bent)
    tip = level.shapes.T @ structure.row("node3")
    modal = mp.LinearStructure(np.eye(MODES), np.diag(level.squares), points={"tip": tip})
    return modal, level.shapes.T @ structure.mass @ (TIP * stiffness * bent), stiffness


def laws(stiffness: float) -> dict[str, Function]:
    """F(q) [N]: a spring that hardens with q^3, and a Hertz contact 5 mm below the tip at rest."""
    return {
        "hardening": lambda q: stiffness * (q + 4 * q * (q / TIP) ** 2),
        "Hertz": lambda q: -20 * stiffness * TIP * (np.maximum(-q - 5e-3, 0) / TIP) ** 1.5,
    }


def true_motion(structure: mp.LinearStructure, law: Function, start: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Tip displacement (k,) [m] with the law itself, integrated to 1e-11."""
    row, squares = structure.row("tip"), np.diagonal(structure.stiffness)

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        return np.concatenate([y[MODES:], -squares * y[:MODES] - row * law(row @ y[:MODES])])

    y0 = np.concatenate([start, np.zeros(MODES)])
    found = solve_ivp(rate, (0, times[-1]), y0, method="DOP853", rtol=1e-11, atol=1e-13, t_eval=times)
    return np.asarray(row @ found.y[:MODES])


def inside_exudyn(model: mp.MultiPhiModel, start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Times and tip displacement (k,) of the model as a user object, with modes matched to the solver's step."""
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    items = CreateMultiPhiBody(mbs, model, name="beam", displacement=start, matchedStepSize=STEP)
    mbs.Assemble()
    settings = fixed_steps(T_END, round(T_END / STEP), write_period=1e-3)
    mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.TrapezoidalIndex2)
    histories = body_histories(mbs, items)
    return histories.time, histories.points["tip"]


def study() -> Errors:
    """Relative errors of the tip's motion, by law and by how it is run, one for each number of segments."""
    structure, start, stiffness = beam()
    times, errors = np.linspace(0, T_END, 201), Errors()
    for name, law in laws(stiffness).items():
        true = true_motion(structure, law, start, times)
        errors[name] = {"native": [], "user object": []}
        for segments in SEGMENTS:
            followed = mp.ForceLaw("tip", law, segments=segments, span=SPAN)
            model = mp.MultiPhiModel(structure, [followed], modes="all")
            native = np.asarray(mp.simulate(model, T_END, displacement=start).at("tip", times))
            at, found = inside_exudyn(model, start)
            errors[name]["native"].append(relative(native, true))
            errors[name]["user object"].append(relative(found, np.interp(at, times, true)))
    return errors


def relative(found: np.ndarray, true: np.ndarray) -> float:
    """|found - true| / |true|."""
    return float(np.linalg.norm(found - true) / np.linalg.norm(true))


def draw(errors: Errors, path: str) -> None:
    """Errors against segments on logarithmic axes, with a line of second order."""
    figure = matplotlib.figure.Figure(figsize=(7, 5), layout="constrained")
    axes = figure.subplots()
    for (name, runs), colour in zip(errors.items(), ("#0072B2", "#D55E00"), strict=True):
        axes.loglog(SEGMENTS, runs["native"], "o-", color=colour, label=f"{name}, native")
        axes.loglog(SEGMENTS, runs["user object"], "x", color=colour, markersize=10, label=f"{name}, user object")
    ends = np.array([SEGMENTS[0], SEGMENTS[-1]])
    axes.loglog(ends, 12 / ends**2.0, "--", color="0.5", label="second order")
    axes.axhline(0.01, color="0.8", linewidth=1, zorder=0)
    axes.text(SEGMENTS[0], 0.0105, "1 %", color="0.5", va="bottom", ha="center")
    axes.set_xticks(SEGMENTS, [str(n) for n in SEGMENTS])
    axes.minorticks_off()
    axes.set_title("Force laws as straight segments, against the smooth law integrated")
    axes.set_xlabel("segments of the law")
    axes.set_ylabel(f"relative error of the tip's motion to {T_END:g} s")
    axes.legend()
    figure.savefig(path, dpi=120)


def main() -> Errors:
    """The study, its orders, and the figure where a path is given."""
    errors = study()
    for name, runs in errors.items():
        for label, values in runs.items():
            order = np.log2(values[1] / values[-1]) / np.log2(SEGMENTS[-1] / SEGMENTS[1])
            shown = ", ".join(f"{n}: {100 * e:.2g} %" for n, e in zip(SEGMENTS, values, strict=True))
            print(f"{name}, {label}: order {order:.2f}; {shown}")
    if len(sys.argv) > 1:
        draw(errors, sys.argv[1])
    return errors


if __name__ == "__main__":
    main()
