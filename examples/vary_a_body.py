"""A Multi-Phi body in Exudyn's own studies: a run that is taken up again, a parameter variation, an optimisation.

A cantilever with a stop near its middle is let go. On its tip sits a small mass on a spring and damper, which is to
take the beam's energy: how stiff has that spring to be? The reduced model is built once and shared by all runs; a run
of 0.4 s takes some hundredths of a second.

Run: python examples/vary_a_body.py [FIGURE.png]
"""

from __future__ import annotations

import functools
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import exudyn as exu
import exudyn.itemInterface as eii
import matplotlib.figure
import numpy as np
from exudyn.processing import GeneticOptimization, ParameterVariation

import multiphi_exudyn as mp
from multiphi_exudyn.exudyn_plugin import CreateMultiPhiBody
from reference_models.exudyn_quiet import quiet
from reference_models.rig import initial_displacement, rig_beam, rig_contact, rig_damping
from reference_models.solver_settings import fixed_steps

T_END, STEP = 0.4, 2e-4  # s
MASS, DAMPER = 0.05, 0.1  # kg, N s/m, of the absorber
RANGE, TRIED = (5.0, 200.0), 14  # N/m of its spring, and how many of them the variation tries
GENERATIONS, POPULATION = 3, 8  # of the optimisation


@functools.cache
def beam() -> tuple[mp.MultiPhiModel, np.ndarray]:
    """The paper's beam with its stop by 10 modes, and the shape (n,) it is let go from."""
    model = mp.MultiPhiModel(mp.planar_beam(rig_beam(), 20, rig_damping()), [rig_contact(1e5)], modes=10)
    bent = model.static_equilibrium({"node3": 1.0})
    return model, bent * initial_displacement() / float(model.structure.row("node3") @ bent)


def system(stiffness: float) -> tuple[Any, Any, Any]:
    """Container, system and a sensor of the tip [m]; stiffness [N/m] of the absorber's spring."""
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    model, start = beam()
    items = CreateMultiPhiBody(mbs, model, "beam", displacement=start, interface=["node3"], matchedStepSize=STEP)
    tip = items["nInterface"]["node3"]
    node = mbs.AddNode(eii.Node1D(referenceCoordinates=[0.0], initialCoordinates=[initial_displacement()]))
    mbs.AddObject(eii.Mass1D(nodeNumber=node, mass=MASS))
    ends = [mbs.AddMarker(eii.MarkerNodeCoordinate(nodeNumber=n, coordinate=0)) for n in (node, tip)]
    mbs.AddObject(eii.CoordinateSpringDamper(markerNumbers=ends, stiffness=stiffness, damping=DAMPER))
    kind = exu.OutputVariableType.Coordinates
    sensor = mbs.AddSensor(eii.SensorNode(nodeNumber=tip, outputVariableType=kind, storeInternal=True))
    mbs.Assemble()
    return container, mbs, sensor


def solve(mbs: Any, start: float, end: float) -> None:
    """From one time [s] to another, in steps to which the body's modes are matched."""
    settings = fixed_steps(end, round((end - start) / STEP), 1e-3)
    settings.timeIntegration.startTime = start
    mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.TrapezoidalIndex2)


def tip_of(stiffness: float) -> np.ndarray:
    """Time and displacement of the tip (k, 2)."""
    container, mbs, sensor = system(stiffness)
    solve(mbs, 0.0, T_END)
    found = mbs.GetSensorStoredData(sensor)
    del container
    return np.array(found)


def taken_up(stiffness: float) -> np.ndarray:
    """The second half of the same run, from a state that the first half has left in another system."""
    _kept, mbs, _ = system(stiffness)
    solve(mbs, 0.0, T_END / 2)
    left = mbs.systemData.GetSystemState(exu.ConfigurationType.Current)
    container, mbs, sensor = system(stiffness)
    mbs.systemData.SetSystemState(left, exu.ConfigurationType.Initial)
    solve(mbs, T_END / 2, T_END)
    found = mbs.GetSensorStoredData(sensor)
    del container
    return np.array(found)


def motion(parameters: dict[str, Any]) -> float:
    """What is left [m] of the tip's motion in the last quarter of a run: what the studies vary and make small."""
    last = tip_of(parameters["stiffness"])
    return float(np.sqrt(np.mean(last[last[:, 0] > 0.75 * T_END, 1] ** 2)))


@dataclass(frozen=True)
class Study:
    """stiffness (k,) [N/m] and motion (k,) [m] of the variation; best: of the optimisation; again: largest difference
    [m] of a run taken up again."""

    stiffness: np.ndarray
    motion: np.ndarray
    best: float
    best_motion: float
    again: float


def study() -> Study:
    """The three of them."""
    with quiet():
        once = tip_of(50.0)
        again = taken_up(50.0)
        both = np.interp(again[:, 0], once[:, 0], once[:, 1]) - again[:, 1]
        varied, found = ParameterVariation(motion, {"stiffness": (*RANGE, TRIED)}, showProgress=False)
        best, motion_left, *_ = GeneticOptimization(
            motion,
            {"stiffness": RANGE},
            numberOfGenerations=GENERATIONS,
            populationSize=POPULATION,
            randomizerInitialization=1,
            showProgress=False,
        )
    return Study(
        np.array(varied["stiffness"]),
        np.array(found),
        float(best["stiffness"]),
        float(motion_left),
        float(np.max(np.abs(both))),
    )


def main(arguments: Sequence[str] = ()) -> Study:
    """The studies, and the figure where a path is given."""
    found = study()
    print(f"taken up at half time: within {1e6 * found.again:.2g} um of the whole run")
    least = np.argmin(found.motion)
    print(f"variation: least motion {1e3 * found.motion[least]:.3f} mm with {found.stiffness[least]:.1f} N/m")
    print(f"optimisation: {1e3 * found.best_motion:.3f} mm with {found.best:.1f} N/m")
    if arguments:
        figure = matplotlib.figure.Figure(figsize=(8, 4), layout="constrained")
        axis = figure.subplots()
        axis.plot(found.stiffness, 1e3 * found.motion, "o-", color="0.5", label="parameter variation")
        axis.plot(found.best, 1e3 * found.best_motion, "*", color="#D55E00", markersize=14, label="optimisation")
        axis.set(xlabel="spring [N/m]", ylabel="tip, last quarter [mm rms]", title="An absorber on the tip")
        axis.legend()
        figure.savefig(arguments[0], dpi=120)
    return found


if __name__ == "__main__":
    main(sys.argv[1:])
