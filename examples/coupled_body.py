"""A reduced beam inside a larger Exudyn system, beside the full nonlinear beam with the same items attached.

Five systems, each with the paper's beam and a compliant stop at a thousandth of its distance, all at rest until
something acts: a mass pulled down on a spring at the tip; a pendulum that swings from a carriage at the tip; a base
without clamp on a slider that is pushed to and fro; the same base moved as prescribed; a pulse on the tip from a user
function. What is attached acts on a marker of one coordinate, a deflection of the full beam or an interface coordinate
of the reduced one.

Full beam and all modes are each compared with their own converged answer, and these with each other. All modes are
those of the beam's length too, up to 240 kHz: they cannot be matched to such steps, the few can.

Run: python examples/coupled_body.py [FIGURE.png]
"""

from __future__ import annotations

import math
import statistics
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import exudyn as exu
import exudyn.itemInterface as eii
import matplotlib.figure
import numpy as np

import multiphi_exudyn as mp
from multiphi_exudyn.exudyn_plugin import CreateMultiPhiBody, LinearizedStructure, body_histories, linear_structure_from
from multiphi_exudyn.mechanics.beam import Beam, Clamp
from reference_models.beam_system import BeamSystem, build_beam_system
from reference_models.beams import as_beams
from reference_models.exudyn_quiet import quiet
from reference_models.full_beam_settings import FullBeamSettings
from reference_models.laid_beam import DEFLECTION
from reference_models.point_contact import point_contacts
from reference_models.rig import rig_beam
from reference_models.solver_settings import simulation_settings

T_END, SAMPLES = 0.3, 1e-3  # s: the run, and the period of what is compared
STEPS, FINE = (
    tuple(SAMPLES / k for k in (5, 7, 10, 14, 20, 28, 40)),
    5e-6,
)  # s: the steps compared, that of converged answers
ELEMENTS, MODES, SMALL_STEP = 10, 6, 2.5e-4  # of the full beam; of the small reduced one, and its step [s]
REPEATS = 5  # runs of which the median CPU time counts
STOP = mp.UnilateralContact("support", "node2", 1.35e-6, 1e5)  # m, N/m: small enough for a linear beam
DAMPING = mp.RayleighDamping(0.5, 1e-5)
NEWTON = 1e-6  # tolerance: differences between steps are to be seen, not those of the iteration
TIP = "node3"
Modes = int | Literal["all"]


@dataclass(frozen=True)
class Case:
    """A system: the beam, the point that something is attached to, and what attaches it to a marker there."""

    name: str
    clamp: Clamp
    point: str
    attach: Callable[[Any, Any], None]

    @property
    def beam(self) -> Beam:
        """The paper's beam with its measured points and its base."""
        beam = rig_beam(clamp=self.clamp)
        return Beam(beam.sections, {**beam.points, "base": beam.start}, beam.masses, beam.clamp)


@dataclass(frozen=True)
class Run:
    """time (k,) [s], deflection of the tip (k,) [m], CPU time of the solver [s], events of a reduced beam."""

    time: np.ndarray
    tip: np.ndarray
    cpu: float
    events: int = 0


def coordinate(mbs: Any, node: Any, component: int = 0) -> Any:
    """A marker of one coordinate of a node."""
    return mbs.AddMarker(eii.MarkerNodeCoordinate(nodeNumber=node, coordinate=component))


def mass_on_spring(mbs: Any, tip: Any) -> None:
    """0.3 kg on 500 N/m and 0.5 N s/m, pulled down by 0.04 mm."""
    node = mbs.AddNode(eii.Node1D(referenceCoordinates=[0.0], initialCoordinates=[-4e-5]))
    mbs.AddObject(eii.Mass1D(nodeNumber=node, mass=0.3))
    mbs.AddObject(eii.CoordinateSpringDamper(markerNumbers=[coordinate(mbs, node), tip], stiffness=500.0, damping=0.5))


def pendulum(mbs: Any, tip: Any) -> None:
    """5 g that swing by 0.6 rad on 20 mm below a carriage of 1 g, which rolls across and moves with the tip.

    Weight acts along the beam, so that the pendulum swings as the beam bends; the carriage's guide carries it.
    """
    carriage = mbs.AddNode(eii.NodePoint2D())
    start = [0.02 * math.cos(0.6), 0.02 * math.sin(0.6)]
    bob = mbs.AddNode(eii.NodePoint2D(referenceCoordinates=start))
    for node, mass in ((carriage, 1e-3), (bob, 5e-3)):
        mbs.AddObject(eii.MassPoint2D(nodeNumber=node, mass=mass))
    ground, (along, across) = (
        coordinate(mbs, mbs.AddNode(eii.NodePointGround())),
        (coordinate(mbs, carriage, component) for component in (0, 1)),
    )
    mbs.AddObject(eii.ObjectConnectorCoordinate(markerNumbers=[ground, along]))
    mbs.AddObject(eii.ObjectConnectorCoordinate(markerNumbers=[tip, across]))
    ends = [mbs.AddMarker(eii.MarkerNodePosition(nodeNumber=node)) for node in (carriage, bob)]
    mbs.AddObject(eii.ObjectConnectorDistance(markerNumbers=ends, distance=0.02))
    mbs.AddLoad(eii.LoadForceVector(markerNumber=ends[1], loadVector=[5e-3 * 9.81, 0.0, 0.0]))


def slider(mbs: Any, base: Any) -> None:
    """2 kg that slide along z, carry the base, are held by 2000 N/m and pushed with 0.08 N at 9 Hz."""
    node = mbs.AddNode(eii.Node1D(referenceCoordinates=[0.0]))
    ground, own = coordinate(mbs, mbs.AddNode(eii.NodePointGround())), coordinate(mbs, node)
    mbs.AddObject(eii.Mass1D(nodeNumber=node, mass=2.0))
    mbs.AddObject(eii.CoordinateSpringDamper(markerNumbers=[ground, own], stiffness=2000.0, damping=5.0))
    mbs.AddObject(eii.ObjectConnectorCoordinate(markerNumbers=[own, base]))

    def force(mbs: Any, t: float, load: float) -> float:
        return load * math.sin(2 * math.pi * 9.0 * t)

    mbs.AddLoad(eii.LoadCoordinate(markerNumber=own, load=0.08, loadUserFunction=force))


def prescribed(mbs: Any, base: Any) -> None:
    """The base goes up and down by 0.04 mm at 5 Hz, whatever force that takes."""
    ground, omega = coordinate(mbs, mbs.AddNode(eii.NodePointGround())), 2 * math.pi * 5.0

    def way(mbs: Any, t: float, item: int, offset: float) -> float:
        return offset * (1 - math.cos(omega * t))

    def speed(mbs: Any, t: float, item: int, offset: float) -> float:
        return offset * omega * math.sin(omega * t)

    mbs.AddObject(
        eii.ObjectConnectorCoordinate(
            markerNumbers=[ground, base], offset=2e-5, offsetUserFunction=way, offsetUserFunction_t=speed
        )
    )


def pulse(mbs: Any, tip: Any) -> None:
    """A squared half sine of 0.03 N downward within 50 ms."""

    def force(mbs: Any, t: float, load: float) -> float:
        return load * math.sin(math.pi * t / 0.05) ** 2 if t < 0.05 else 0.0

    mbs.AddLoad(eii.LoadCoordinate(markerNumber=tip, load=-0.03, loadUserFunction=force))


CASES = (
    Case("mass on a spring at the tip", Clamp(), TIP, mass_on_spring),
    Case("pendulum at the tip", Clamp(), TIP, pendulum),
    Case("base on a driven slider", Clamp(translation=0.0), "base", slider),
    Case("base moved as prescribed", Clamp(translation=0.0), "base", prescribed),
    Case("pulse by a user function", Clamp(), TIP, pulse),
)


def full_system(case: Case, step: float, damping: np.ndarray | None = None) -> BeamSystem:
    """The full beam with its stop, without anything attached."""
    settings = FullBeamSettings(elements=ELEMENTS, step=step)
    beams = as_beams(case.beam)
    return build_beam_system(beams, settings, point_contacts(beams, [STOP]), damping)


def structure_of(case: Case) -> LinearizedStructure:
    """The full beam, linearised where it is straight, with proportional damping."""
    system = full_system(case, FINE)
    points = {at: (system.nodes[system.points[at]], DEFLECTION) for at in {"node2", TIP, case.point}}
    return linear_structure_from(system.mbs, points, DAMPING)[0]


def solve(mbs: Any, step: float, linear: Any) -> float:
    """CPU time [s] of a run with fixed steps and a linear solver."""
    settings = simulation_settings(FullBeamSettings(step=step, newton_tolerance=NEWTON), T_END)
    settings.solution.sensors.writePeriod = SAMPLES
    settings.linearSolver.solverType = linear
    started = time.process_time()
    mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.TrapezoidalIndex2)
    return time.process_time() - started


def run_full(case: Case, structure: LinearizedStructure, step: float) -> Run:
    """All coordinates of the nonlinear beam, and what is attached."""
    proportional = DAMPING.alpha * structure.mass + DAMPING.beta * structure.stiffness
    system = full_system(case, step, structure.coordinates @ proportional @ structure.coordinates.T)
    mbs = system.mbs
    at, tip = (system.nodes[system.points[point]] for point in (case.point, TIP))
    case.attach(mbs, coordinate(mbs, at, DEFLECTION))
    kind = exu.OutputVariableType.Coordinates
    sensor = mbs.AddSensor(
        eii.SensorNode(nodeNumber=tip, outputVariableType=kind, storeInternal=True, writeToFile=False)
    )
    mbs.Assemble()
    cpu = solve(mbs, step, exu.LinearSolverType.EigenSparse)
    stored = mbs.GetSensorStoredData(sensor)
    return Run(stored[:, 0], stored[:, 1 + DEFLECTION], cpu)


def run_reduced(case: Case, structure: LinearizedStructure, step: float, modes: Modes, matched: bool) -> Run:
    """A Multi-Phi body with an interface coordinate, and what is attached. matched: whether its modes are."""
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    model = mp.MultiPhiModel(structure, [STOP], modes=modes)
    items = CreateMultiPhiBody(mbs, model, "beam", interface=(case.point,), matchedStepSize=step if matched else None)
    case.attach(mbs, coordinate(mbs, items["nInterface"][case.point]))
    mbs.Assemble()
    cpu = solve(mbs, step, exu.LinearSolverType.EXUdense)
    found = body_histories(mbs, items)
    return Run(found.time, found.points[TIP], cpu, len(found.events))


def relative(run: Run, reference: Run) -> float:
    """|tip - reference| / |reference| over the run."""
    return float(np.linalg.norm(run.tip - reference.tip) / np.linalg.norm(reference.tip))


def timed(run: Callable[..., Run], *given: Any) -> Run:
    """A run with the median CPU time of several alike."""
    runs = [run(*given) for _ in range(REPEATS)]
    return replace(runs[0], cpu=statistics.median(each.cpu for each in runs))


@dataclass(frozen=True)
class Comparison:
    """The runs of one system: full beam and all modes by step and converged, and the few modes."""

    full: list[Run]
    full_converged: Run
    complete: list[Run]
    complete_converged: Run
    small: Run

    @property
    def full_errors(self) -> list[float]:
        """Of the full beam by step, against its own converged answer."""
        return [relative(run, self.full_converged) for run in self.full]

    @property
    def errors(self) -> list[float]:
        """Of all modes by step, against their own converged answer."""
        return [relative(run, self.complete_converged) for run in self.complete]

    @property
    def apart(self) -> float:
        """What is left between the two converged answers."""
        return relative(self.complete_converged, self.full_converged)

    @property
    def small_error(self) -> float:
        """Of the few modes against the converged full beam."""
        return relative(self.small, self.full_converged)

    @property
    def speedup(self) -> float:
        """CPU time of the coarsest full run as accurate as the few modes, else of the finest, over theirs."""
        accurate = [run for run, error in zip(self.full, self.full_errors, strict=True) if error <= self.small_error]
        return (accurate or self.full[-1:])[0].cpu / self.small.cpu


def order(errors: Sequence[float]) -> float:
    """The power of the step by which errors fall, fitted to all STEPS."""
    return float(np.polyfit(np.log(STEPS), np.log(errors), 1)[0])


def compare(case: Case) -> Comparison:
    """All runs of one system."""
    with quiet():
        structure = structure_of(case)
        return Comparison(
            [timed(run_full, case, structure, step) for step in STEPS],
            run_full(case, structure, FINE),
            [run_reduced(case, structure, step, "all", False) for step in STEPS],
            run_reduced(case, structure, FINE, "all", False),
            timed(run_reduced, case, structure, SMALL_STEP, MODES, True),
        )


def draw(found: dict[str, Comparison], path: str) -> None:
    """Left the tip, full beam and few modes; right the errors by step."""
    figure = matplotlib.figure.Figure(figsize=(11, 14), layout="constrained")
    for (left, right), (name, runs) in zip(
        figure.subplots(len(found), 2, width_ratios=(2, 1)), found.items(), strict=True
    ):
        full = runs.full_converged
        left.plot(full.time, 1e6 * full.tip, color="0.6", linewidth=3, label="full beam, converged")
        left.plot(runs.small.time, 1e6 * runs.small.tip, "--", color="#0072B2", label=f"{MODES} modes")
        left.axhline(0, color="0.9", zorder=0)
        left.set(title=name, ylabel="tip [\N{MICRO SIGN}m]", xlim=(0, T_END))
        right.loglog(
            STEPS, runs.full_errors, "s-", color="0.5", label=f"full beam, order {order(runs.full_errors):.2f}"
        )
        right.loglog(STEPS, runs.errors, "o-", color="#D55E00", label=f"all modes, order {order(runs.errors):.2f}")
        right.loglog(SMALL_STEP, runs.small_error, "*", color="#0072B2", markersize=12, label=f"{MODES} modes, matched")
        shown = (*STEPS[2::2], SMALL_STEP)
        right.set_xticks(shown, [f"{1e3 * step:g}" for step in shown])
        right.minorticks_off()
        right.set(title="relative error of the tip", xlabel="step [ms]", xlim=(2e-5, 3.2e-4), ylim=(1e-6, 5e-2))
        right.legend(fontsize="small", loc="upper left")
        left.legend(loc="upper left", fontsize="small")
        left.set_xlabel("time [s]")
    figure.savefig(path, dpi=120)


def tell(name: str, runs: Comparison) -> None:
    """A few lines of figures."""
    print(f"{name}: {runs.small.events} events")
    for label, errors, by_step in (
        ("full beam", runs.full_errors, runs.full),
        ("all modes", runs.errors, runs.complete),
    ):
        shown = (
            f"{1e3 * h:.2g} ms {e:.1e} ({run.cpu:.2f} s)" for h, e, run in zip(STEPS, errors, by_step, strict=True)
        )
        print(f"  {label}, order {order(errors):.2f}: {', '.join(shown)}")
    print(f"  converged, apart {runs.apart:.1e}; {MODES} modes, {1e3 * SMALL_STEP:g} ms: {runs.small_error:.1e} "
          f"({runs.small.cpu:.2f} s), {runs.speedup:.1f} times faster than the full beam as accurate")  # fmt: skip


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
