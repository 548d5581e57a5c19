"""What the body costs alone in Exudyn: beside Exudyn's own Craig-Bampton component, and beside a bare object.

The paper's rig for a second. All runs alternate in one process; CPU time of SolveDynamic, median. The error is that of
the tip up to 0.3 s against the model with all its modes, of a Craig-Bampton component (contacts of 1e6 N/m) the worst
of three nearby steps: one step alone may be right by luck. Of 6 to 12 modes and steps from 2e-4 to 2.8e-5 s these
components are the cheapest within 2, 0.5 and 0.05 %, and so are these bodies of 5 to 12 modes.

Run: python examples/body_speed.py
"""

from __future__ import annotations

import functools
import math
import statistics
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import exudyn as exu
import exudyn.itemInterface as eii
import numpy as np

import multiphi_exudyn as mp
from multiphi_exudyn.exudyn_plugin import CreateMultiPhiBody, body_histories
from reference_models.craig_bampton import craig_bampton
from reference_models.craig_bampton_run import CraigBamptonSettings, interface_contacts, solve_craig_bampton
from reference_models.exudyn_quiet import quiet
from reference_models.rig import initial_displacement, rig_beam, rig_contact, rig_damping
from reference_models.solver_settings import fixed_steps

END, WINDOW, ROUNDS = 1.0, 0.3, 15  # s, s, times that every run is made
COMPLIANT = 1e6  # N/m
NEARBY = (1.0, 0.93, 0.87)  # of the step: an error is that of the worst
NEWTON = 1e-6  # tolerance of the component
TRAPEZOIDAL = exu.DynamicSolverType.TrapezoidalIndex2


@dataclass(frozen=True)
class Row:
    """One kind of run. error: of the tip, or nan. cpu: of every run [s]."""

    name: str
    error: float
    cpu: list[float]

    @property
    def median(self) -> float:
        """[s]."""
        return statistics.median(self.cpu)


@functools.cache
def rig(stiffness: float, modes: int | str) -> tuple[mp.MultiPhiModel, np.ndarray]:
    """The model, and the start (n,) [m]: bent by a force at the tip."""
    structure = mp.planar_beam(rig_beam(), elements=57, damping=rig_damping())
    model = mp.MultiPhiModel(structure, [rig_contact(stiffness)], modes=modes)
    bent = model.static_equilibrium({"node3": 1.0})
    return model, bent * initial_displacement() / float(structure.row("node3") @ bent)


@functools.cache
def reference() -> mp.Trajectory:
    """All modes."""
    model, start = rig(COMPLIANT, "all")
    return mp.simulate(model, WINDOW, displacement=start)


def error_of(times: np.ndarray, tip: np.ndarray) -> float:
    """Of the tip (k,) [m] at times (k,) [s], relative, up to the end of the window."""
    early = times <= WINDOW
    expected = reference().at("node3", times[early])
    return float(np.linalg.norm(tip[early] - expected) / np.linalg.norm(expected))


def solved(mbs: Any, steps: int) -> float:
    """CPU time [s] of so many equal steps."""
    mbs.Assemble()
    settings = fixed_steps(END, steps, write_period=END / steps)
    settings.timeIntegration.newton.useModifiedNewton = True
    settings.timeIntegration.reuseConstantMassMatrix = True
    began = time.process_time()
    mbs.SolveDynamic(settings, solverType=TRAPEZOIDAL)
    return time.process_time() - began


def body(stiffness: float, modes: int, steps: int) -> tuple[float, float]:
    """Error and CPU time [s] of the body, its modes matched to the step."""
    model, start = rig(stiffness, modes)
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    items = CreateMultiPhiBody(mbs, model, "beam", displacement=start, matchedStepSize=END / steps)
    cpu = solved(mbs, steps)
    found = body_histories(mbs, items, ["node3"])
    return (error_of(found.time, found.points["node3"]) if stiffness == COMPLIANT else math.nan), cpu


def bare(steps: int) -> tuple[float, float]:
    """An object of six coordinates without contact, with the same sensors and an empty PostStep function."""
    omega = rig(COMPLIANT, 6)[0].level(()).omega
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    still = {"referenceCoordinates": np.zeros(6), "initialCoordinates_t": np.zeros(6)}
    node = mbs.AddNode(eii.NodeGenericODE2(numberOfODE2Coordinates=6, initialCoordinates=np.full(6, 1e-3), **still))
    matrices = {"massMatrix": np.eye(6), "stiffnessMatrix": np.diag(omega**2), "dampingMatrix": np.diag(0.01 * omega)}
    mbs.AddObject(eii.ObjectGenericODE2(nodeNumbers=[node], **matrices))
    kinds = exu.OutputVariableType
    for kind in (kinds.Coordinates, kinds.Coordinates_t, kinds.Coordinates_tt):
        mbs.AddSensor(eii.SensorNode(nodeNumber=node, outputVariableType=kind, storeInternal=True, writeToFile=False))
    mbs.SetPostStepUserFunction(lambda mbs, t: True)
    return math.nan, solved(mbs, steps)


def component(modes: int, step: float) -> tuple[float, float]:
    """Error and CPU time [s] of the Craig-Bampton component with so many modes beside its contact point."""
    model, start = rig(COMPLIANT, 6)
    reduced = craig_bampton(model.structure, ["node2"], modes)
    contacts, settings = interface_contacts(model.contacts), CraigBamptonSettings(step, NEWTON)
    run = solve_craig_bampton(reduced, contacts, reduced.coordinates(start), END, settings)
    tip = run.coordinates @ (reduced.shapes.T @ model.structure.row("node3"))
    return error_of(run.time, tip), run.cpu_s


RUNS: dict[str, Callable[[], tuple[float, float]]] = {
    "bare object, empty PostStep, 10000 steps": lambda: bare(10000),
    "body, 6 modes, 10000 steps": lambda: body(COMPLIANT, 6, 10000),
    "body, 6 modes, 2857 steps": lambda: body(COMPLIANT, 6, 2857),
    "body, 6 modes, 1500 steps": lambda: body(COMPLIANT, 6, 1500),
    "body, 6 modes, 2000 steps": lambda: body(COMPLIANT, 6, 2000),
    "body, 6 modes, 2000 steps, rigid": lambda: body(math.inf, 6, 2000),
    "body, 9 modes, 2810 steps": lambda: body(COMPLIANT, 9, 2810),
    "body, 10 modes, 3430 steps": lambda: body(COMPLIANT, 10, 3430),
    "component, 10 modes, 1.5e-4 s": lambda: component(10, 1.5e-4),
    "component, 11 modes, 3.3e-5 s": lambda: component(11, 3.3e-5),
    "component, 12 modes, 3e-5 s": lambda: component(12, 3e-5),
}
NEAR = {
    "component, 10 modes, 1.5e-4 s": (10, 1.5e-4),
    "component, 11 modes, 3.3e-5 s": (11, 3.3e-5),
    "component, 12 modes, 3e-5 s": (12, 3e-5),
}
RATIOS = (
    ("at 2 %", "body, 6 modes, 1500 steps", "component, 10 modes, 1.5e-4 s", 0.6),
    ("at 0.5 %", "body, 9 modes, 2810 steps", "component, 11 modes, 3.3e-5 s", 1 / 3),
    ("at 0.05 %", "body, 10 modes, 3430 steps", "component, 12 modes, 3e-5 s", 1 / 3),
    ("a step, events included", "body, 6 modes, 10000 steps", "bare object, empty PostStep, 10000 steps", 2.5),
    ("rigid to compliant", "body, 6 modes, 2000 steps, rigid", "body, 6 modes, 2000 steps", 1.3),
)


def main(rounds: int = ROUNDS) -> dict[str, Row]:
    """Rows by the names of runs."""
    rows = {name: Row(name, math.nan, []) for name in RUNS}
    with quiet(), warnings.catch_warnings():
        warnings.simplefilter("ignore", mp.MultiPhiWarning)
        for _ in range(rounds + 1):
            for name, run in RUNS.items():
                error, cpu = run()
                rows[name] = Row(name, error, [*rows[name].cpu, cpu])
        for name, (modes, step) in NEAR.items():
            rows[name] = Row(name, max(component(modes, near * step)[0] for near in NEARBY), rows[name].cpu)
    for row in rows.values():
        row.cpu.pop(0)  # the first builds levels
        print(f"{row.name:42s} {1e3 * row.median:8.2f} ms {100 * row.error:8.3f} %")
    for what, ours, theirs, most in RATIOS:
        ratios = [a / b for a, b in zip(rows[ours].cpu, rows[theirs].cpu, strict=True)]
        print(f"{what:26s} {statistics.median(ratios):6.3f}, at most {most:.3g}")
    return rows


if __name__ == "__main__":
    main()
