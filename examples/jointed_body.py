"""A reduced frame with rigid bodies on joints, beside the full frame in Exudyn with the same bodies and joints.

A cantilever in space, nodes of six coordinates, comes down on a compliant stop. A block hangs at its tip: on a hinge
about the beam's axis, which takes a rigid interface (three displacements and three rotations); on a spherical joint,
and on a spring-damper, for which a position does. The block swings as far as any rigid body of Exudyn may.

Full frame and all modes are each compared with their own converged answer, and these with each other.

Run: python examples/jointed_body.py [FIGURE.png]
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import exudyn as exu
import exudyn.itemInterface as eii
import matplotlib.figure
import numpy as np
from exudyn.rigidBodyUtilities import RotationMatrixY
from exudyn.utilities import InertiaCuboid

import multiphi_exudyn as mp
from multiphi_exudyn.exudyn_plugin import (
    BodyHistories,
    CreateMultiPhiBody,
    LinearizedStructure,
    PositionInterface,
    RigidInterface,
    body_histories,
    linear_structure_from,
)
from reference_models.exudyn_quiet import quiet
from reference_models.solver_settings import fixed_steps

T_END, SAMPLES = 0.4, 1e-3  # s: the run, and the period of what is compared
STEPS, FINE = tuple(SAMPLES / k for k in (5, 7, 10, 14, 20)), 2e-5  # s: steps compared, that of converged answers
MODES, SMALL_STEP = 8, 2e-4  # of the small reduced frame, and its step [s]
ELEMENTS, LENGTH, WIDTH, HEIGHT = 5, 1.0, 0.02, 0.01  # of the frame; m
STEEL, SHEAR, DENSITY = 2.1e11, 8e10, 7800.0  # Pa, Pa, kg/m3
STOP_AT, GAP, STIFFNESS = 3, 5e-4, 1e5  # number of a node from the clamp, m, N/m
BLOCK, BLOCK_DENSITY = (0.1, 0.05, 0.04), 1000.0  # m, kg/m3
TIP = (LENGTH, 0.0, 0.0)
WEIGHT = [0.0, 0.0, -9.81]  # m/s2


def element_matrices(length: float) -> tuple[np.ndarray, np.ndarray]:
    """M, K (12, 12) of a beam element in space; a node has u_x, u_y, u_z, and angles about x, y, z."""
    area, about_y, about_z = WIDTH * HEIGHT, WIDTH * HEIGHT**3 / 12, HEIGHT * WIDTH**3 / 12
    polar, torsion = about_y + about_z, 0.229 * WIDTH * HEIGHT**3  # m4, of sides 2 : 1
    mass, stiffness = np.zeros((12, 12)), np.zeros((12, 12))
    line, shared = np.array([[1, -1], [-1, 1]]) / length, length / 6 * np.array([[2, 1], [1, 2]])
    for place, inertia, rigidity in ((0, DENSITY * area, STEEL * area), (3, DENSITY * polar, SHEAR * torsion)):
        at = np.ix_([place, place + 6], [place, place + 6])
        mass[at], stiffness[at] = inertia * shared, rigidity * line
    h = length
    bent = np.array([[12, 6 * h, -12, 6 * h], [6 * h, 4 * h * h, -6 * h, 2 * h * h]]) / h**3
    bent = np.vstack([bent, -bent[0], [6 / h**2, 2 / h, -6 / h**2, 4 / h]])
    heavy = np.array([[156, 22 * h, 54, -13 * h], [22 * h, 4 * h * h, 13 * h, -3 * h * h]])
    heavy = np.vstack([heavy, [54, 13 * h, 156, -22 * h], [-13 * h, -3 * h * h, -22 * h, 4 * h * h]]) * h / 420
    for places, sign, rigidity in (([1, 5, 7, 11], 1, STEEL * about_z), ([2, 4, 8, 10], -1, STEEL * about_y)):
        turned = np.outer([1, sign, 1, sign], [1, sign, 1, sign])
        mass[np.ix_(places, places)] = DENSITY * area * turned * heavy
        stiffness[np.ix_(places, places)] = rigidity * turned * bent
    return mass, stiffness


def add_frame(mbs: Any) -> list[Any]:
    """The clamped frame's nodes, from the clamp to the tip, with its matrices and proportional damping."""
    mass, stiffness = np.zeros((2, 6 * ELEMENTS + 6, 6 * ELEMENTS + 6))
    for i in range(ELEMENTS):
        own = slice(6 * i, 6 * i + 12)
        for whole, part in zip((mass, stiffness), element_matrices(LENGTH / ELEMENTS), strict=True):
            whole[own, own] += part
    mass, stiffness = mass[6:, 6:], stiffness[6:, 6:]
    places = [[LENGTH / ELEMENTS * (i + 1), 0, 0, 0, 0, 0] for i in range(ELEMENTS)]
    nodes = [
        mbs.AddNode(eii.NodeRigidBodyRxyz(name=f"n{i + 1}", referenceCoordinates=place))
        for i, place in enumerate(places)
    ]
    mbs.AddObject(
        eii.ObjectGenericODE2(
            nodeNumbers=nodes,
            massMatrix=mass,
            stiffnessMatrix=stiffness,
            dampingMatrix=0.5 * mass + 2e-5 * stiffness,
        )
    )
    return nodes


def add_block(mbs: Any, below: float = 0.0) -> tuple[Any, np.ndarray]:
    """A block under its weight, and the place [m] on it of the middle of its near end, ``below`` the tip [m]."""
    inertia = InertiaCuboid(BLOCK_DENSITY, BLOCK)
    place = [LENGTH + BLOCK[0] / 2, 0.0, -below]
    body = mbs.CreateRigidBody(name="block", referencePosition=place, inertia=inertia, gravity=WEIGHT)
    return body, np.array([-BLOCK[0] / 2, 0.0, 0.0])


def hinge(mbs: Any, tip: Any) -> None:
    """The block's upper edge on a hinge about the beam's axis; it is let go where it stands out to the side."""
    body, _ = add_block(mbs)
    along, edge = RotationMatrixY(math.pi / 2), np.array([-BLOCK[0] / 2, BLOCK[1] / 2, 0.0])
    mbs.SetNodeParameter(mbs.GetObject(body)["nodeNumber"], "initialCoordinates", [0, -BLOCK[1] / 2, 0, 0, 0, 0, 0])
    first = mbs.AddMarker(eii.MarkerNodeRigid(nodeNumber=tip, localHT=exu.HT(along, [0.0, 0.0, 0.0])))
    second = mbs.AddMarker(eii.MarkerBodyRigid(bodyNumber=body, localHT=exu.HT(along, edge)))
    mbs.AddObject(eii.ObjectJointRevoluteZ(markerNumbers=[first, second]))


def spherical(mbs: Any, tip: Any) -> None:
    """The block's end on a spherical joint."""
    body, end = add_block(mbs)
    first = mbs.AddMarker(eii.MarkerNodePosition(nodeNumber=tip))
    second = mbs.AddMarker(eii.MarkerBodyPosition(bodyNumber=body, localPosition=end))
    mbs.AddObject(eii.SphericalJoint(markerNumbers=[first, second]))


def spring(mbs: Any, tip: Any) -> None:
    """The block's end on a spring-damper of 10 cm, 2000 N/m and 1 N s/m."""
    body, end = add_block(mbs, below=0.1)
    first = mbs.AddMarker(eii.MarkerNodePosition(nodeNumber=tip))
    second = mbs.AddMarker(eii.MarkerBodyPosition(bodyNumber=body, localPosition=end))
    mbs.AddObject(eii.SpringDamper(markerNumbers=[first, second], referenceLength=0.1, stiffness=2000, damping=1))


@dataclass(frozen=True)
class Case:
    """name; attach: adds what hangs on a node; rigid: whether that takes the node's rotations."""

    name: str
    attach: Callable[[Any, Any], None]
    rigid: bool


CASES = (
    Case("block on a hinge, rigid interface", hinge, True),
    Case("block on a spherical joint, position", spherical, False),
    Case("block on a spring-damper, position", spring, False),
)


@dataclass(frozen=True)
class Run:
    """tip: its deflection (k,) [m] every SAMPLES; histories of a reduced frame."""

    tip: np.ndarray
    histories: BodyHistories | None = None


def solve(mbs: Any, step: float) -> None:
    """A run with fixed steps."""
    settings = fixed_steps(T_END, round(T_END / step), SAMPLES)
    settings.timeIntegration.newton.relativeTolerance = 1e-10
    settings.timeIntegration.newton.absoluteTolerance = 1e-12
    discontinuous = settings.timeIntegration.discontinuous
    discontinuous.useRecommendedStepSize, discontinuous.ignoreMaxIterations = False, True
    mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.TrapezoidalIndex2)


def run_full(case: Case, step: float) -> Run:
    """All coordinates of the frame, and what hangs on it."""
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    nodes = add_frame(mbs)
    ground = mbs.AddMarker(eii.MarkerNodeCoordinate(nodeNumber=mbs.AddNode(eii.NodePointGround()), coordinate=0))
    middle = mbs.AddMarker(eii.MarkerNodeCoordinate(nodeNumber=nodes[STOP_AT - 1], coordinate=2))
    state = mbs.AddNode(eii.NodeGenericData(initialCoordinates=[1.0], numberOfDataCoordinates=1))
    mbs.AddObject(
        eii.ObjectContactCoordinate(
            markerNumbers=[ground, middle], nodeNumber=state, offset=-GAP, contactStiffness=STIFFNESS
        )
    )
    case.attach(mbs, nodes[-1])
    kind = exu.OutputVariableType.Coordinates
    sensor = mbs.AddSensor(
        eii.SensorNode(nodeNumber=nodes[-1], outputVariableType=kind, storeInternal=True, writeToFile=False)
    )
    mbs.Assemble()
    solve(mbs, step)
    return Run(mbs.GetSensorStoredData(sensor)[:, 3])


def structure_of_frame() -> LinearizedStructure:
    """The frame alone; coordinate c of node i is its point "ni.c"."""
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    add_frame(mbs)
    mbs.Assemble()
    return linear_structure_from(mbs)[0]


def run_reduced(case: Case, structure: LinearizedStructure, step: float, modes: int | str, matched: bool) -> Run:
    """A Multi-Phi body with a position or a rigid interface at its tip, and what hangs there."""
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    stop = mp.UnilateralContact("stop", f"n{STOP_AT}.2", GAP, STIFFNESS)
    moved, turned = ([f"n{ELEMENTS}.{c}" for c in which] for which in ((0, 1, 2), (3, 4, 5)))
    items = CreateMultiPhiBody(
        mbs,
        mp.MultiPhiModel(structure, [stop], modes=modes),
        "frame",
        interface={"tip": RigidInterface(TIP, moved, turned) if case.rigid else PositionInterface(TIP, moved)},
        matchedStepSize=step if matched else None,
    )
    case.attach(mbs, items["nInterface"]["tip"])
    mbs.Assemble()
    solve(mbs, step)
    histories = body_histories(mbs, items, [moved[2]])
    return Run(histories.points[moved[2]], histories)


def relative(run: Run, reference: Run) -> float:
    """|tip - reference| / |reference| over the run."""
    return float(np.linalg.norm(run.tip - reference.tip) / np.linalg.norm(reference.tip))


def order(errors: Sequence[float]) -> float:
    """The power of the step by which errors fall, fitted to all STEPS."""
    return float(np.polyfit(np.log(STEPS), np.log(errors), 1)[0])


@dataclass(frozen=True)
class Comparison:
    """The runs of one system: converged, and errors by step against them; the few modes."""

    full: Run
    full_errors: list[float]
    complete: Run
    errors: list[float]
    small: Run

    @property
    def apart(self) -> float:
        """What is left between the two converged answers."""
        return relative(self.complete, self.full)

    @property
    def small_error(self) -> float:
        """Of the few modes against the converged full frame."""
        return relative(self.small, self.full)


def compare(case: Case) -> Comparison:
    """All runs of one system."""
    with quiet():
        structure = structure_of_frame()
        full, complete = run_full(case, FINE), run_reduced(case, structure, FINE, "all", False)
        return Comparison(
            full,
            [relative(run_full(case, step), full) for step in STEPS],
            complete,
            [relative(run_reduced(case, structure, step, "all", False), complete) for step in STEPS],
            run_reduced(case, structure, SMALL_STEP, MODES, True),
        )


def draw(found: dict[str, Comparison], path: str) -> None:
    """Left the tip, full frame and few modes; right the errors by step."""
    figure = matplotlib.figure.Figure(figsize=(11, 3.2 * len(found)), layout="constrained")
    for (left, right), (name, runs) in zip(
        figure.subplots(len(found), 2, width_ratios=(2, 1), squeeze=False), found.items(), strict=True
    ):
        times = SAMPLES * np.arange(len(runs.full.tip))
        left.plot(times, 1e3 * runs.full.tip, color="0.6", linewidth=3, label="full frame, converged")
        left.plot(times, 1e3 * runs.small.tip, "--", color="#0072B2", label=f"{MODES} modes")
        left.set(title=name, xlabel="time [s]", ylabel="tip [mm]", xlim=(0, T_END))
        left.legend(loc="upper right", fontsize="small")
        right.loglog(STEPS, runs.full_errors, "s-", color="0.5", label=f"full, order {order(runs.full_errors):.2f}")
        right.loglog(STEPS, runs.errors, "o-", color="#D55E00", label=f"all modes, order {order(runs.errors):.2f}")
        right.loglog(SMALL_STEP, runs.small_error, "*", color="#0072B2", markersize=12, label=f"{MODES} modes, matched")
        right.set_xticks(STEPS[::2], [f"{1e3 * step:g}" for step in STEPS[::2]])
        right.minorticks_off()
        right.set(title="relative error of the tip", xlabel="step [ms]")
        right.legend(fontsize="small", loc="upper left")
    figure.savefig(path, dpi=120)


def tell(name: str, runs: Comparison) -> None:
    """A few lines of figures."""
    assert runs.small.histories is not None
    print(f"{name}: {len(runs.small.histories.events)} events")
    for label, errors in (("full frame", runs.full_errors), ("all modes", runs.errors)):
        shown = (f"{1e3 * step:.2g} ms {error:.1e}" for step, error in zip(STEPS, errors, strict=True))
        print(f"  {label}, order {order(errors):.2f}: {', '.join(shown)}")
    print(f"  converged, apart {runs.apart:.1e}; {MODES} modes, {1e3 * SMALL_STEP:g} ms: {runs.small_error:.1e}")


def main(arguments: Sequence[str] = ()) -> dict[str, Comparison]:
    """The systems, and the figure where a path is given."""
    found = {case.name: compare(case) for case in CASES}
    for name, runs in found.items():
        tell(name, runs)
    if arguments:
        draw(found, arguments[0])
    return found


if __name__ == "__main__":
    main(sys.argv[1:])
