"""What the body costs beside others in Exudyn: against Exudyn alone with the same items, for cases of coupled_body.py.

Exudyn alone: the same six modes of the beam without contacts, with the stop as Exudyn's own contact element. The body:
the stop is one of its contacts, and its modes are matched to the step. Runs alternate in one process; CPU time of
SolveDynamic, median. Models are kept, as in a study; bodies and systems are made anew for every run.

Run: python examples/coupled_speed.py
"""

from __future__ import annotations

import statistics
from dataclasses import dataclass
from typing import Any

import coupled_body as shown
import exudyn as exu
import exudyn.itemInterface as eii
import numpy as np

import multiphi_exudyn as mp
from multiphi_exudyn.exudyn_plugin import CreateMultiPhiBody, body_histories
from reference_models.exudyn_quiet import quiet

CASES = tuple(case for case in shown.CASES if case.point == shown.TIP)
ROUNDS = 15  # times that every run is made


@dataclass(frozen=True)
class Row:
    """One case. alone, body: median CPU time [s]. events: of the body. apart: of the tips, relative."""

    name: str
    alone: float
    body: float
    events: int
    apart: float

    @property
    def ratio(self) -> float:
        """What the body takes of Exudyn's time."""
        return self.body / self.alone


def solved(mbs: Any) -> float:
    """CPU time [s] of a run."""
    return shown.solve(mbs, shown.SMALL_STEP, exu.LinearSolverType.EXUdense)


def alone(case: shown.Case, model: mp.MultiPhiModel) -> tuple[float, np.ndarray]:
    """CPU time [s] and tip (k,) of the beam with Exudyn's contact element; model: without contacts."""
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    points = ("node2", case.point)
    items = CreateMultiPhiBody(mbs, model, "beam", interface=points, matchedStepSize=None)
    nodes = items["nInterface"]
    case.attach(mbs, shown.coordinate(mbs, nodes[case.point]))
    stop = shown.STOP
    gap = mbs.AddNode(eii.NodeGenericData(initialCoordinates=[stop.gap], numberOfDataCoordinates=1))
    ground = shown.coordinate(mbs, mbs.AddNode(eii.NodePointGround()))
    markers = [ground, shown.coordinate(mbs, nodes["node2"])]
    mbs.AddObject(
        eii.ObjectContactCoordinate(
            markerNumbers=markers, nodeNumber=gap, contactStiffness=stop.stiffness, contactDamping=0.0, offset=-stop.gap
        )
    )
    kind = exu.OutputVariableType.Coordinates
    sensor = mbs.AddSensor(
        eii.SensorNode(nodeNumber=nodes[case.point], outputVariableType=kind, storeInternal=True, writeToFile=False)
    )
    mbs.Assemble()
    mbs.SetPostStepUserFunction(0)
    del mbs.variables["multiPhi"]  # what is left is Exudyn's alone
    return solved(mbs), mbs.GetSensorStoredData(sensor)[:, 1]


def coupled(case: shown.Case, model: mp.MultiPhiModel) -> tuple[float, np.ndarray, int]:
    """CPU time [s], tip (k,) and number of events of the body."""
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    items = CreateMultiPhiBody(mbs, model, "beam", interface=(case.point,), matchedStepSize=shown.SMALL_STEP)
    case.attach(mbs, shown.coordinate(mbs, items["nInterface"][case.point]))
    mbs.Assemble()
    cpu = solved(mbs)
    found = body_histories(mbs, items)
    return cpu, found.points[case.point], len(found.events)


def compare(case: shown.Case, rounds: int) -> Row:
    """Both runs of one case, by turns."""
    with quiet():
        structure = shown.structure_of(case)
        free, model = (mp.MultiPhiModel(structure, contacts, modes=shown.MODES) for contacts in ([], [shown.STOP]))
        coupled(case, model)
        runs = [(alone(case, free), coupled(case, model)) for _ in range(rounds)]
    (_, theirs), (_, ours, events) = runs[-1]
    medians = (statistics.median(run[k][0] for run in runs) for k in range(2))
    return Row(case.name, *medians, events, float(np.linalg.norm(ours - theirs) / np.linalg.norm(theirs)))


def main(rounds: int = ROUNDS) -> list[Row]:
    """The cases, told line by line."""
    rows = [compare(case, rounds) for case in CASES]
    for row in rows:
        times = f"Exudyn alone {1e3 * row.alone:.1f} ms, body {1e3 * row.body:.1f} ms, {row.ratio:.2f} times"
        print(f"{row.name}: {times}, {row.events} events, tips {row.apart:.1e} apart")
    return rows


if __name__ == "__main__":
    main()
