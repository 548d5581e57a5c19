"""Steps that are long for a body's own modes: its events beside heavy parts."""

import exudyn as exu
import numpy as np
import pytest
from exudyn.itemInterface import (
    CoordinateSpringDamper,
    Mass1D,
    Node1D,
    NodeGenericData,
    NodePointGround,
    ObjectConnectorCoordinate,
    ObjectContactCoordinate,
)
from helpers.body_runs import TRAPEZOIDAL, coordinate

import multiphi_exudyn as mp
from multiphi_exudyn.exudyn_plugin import CreateMultiPhiBody, body_histories
from reference_models.solver_settings import fixed_steps

pytestmark = pytest.mark.usefixtures("quiet_exudyn")

END, GAP, STOP, SPEED = 0.04, 1e-3, 1e6, -0.5  # s, m, N/m, m/s
SPRING, DAMPING = 2e3, 2e-5  # N/m, s: of the heavy part, and of the rod in proportion to its stiffness


def rod(masses, stiffness, heavy=0.0, spring=0.0):
    """Masses in a row without support, the last one with a heavy part and its spring; points are their numbers."""
    n = masses
    K = stiffness * (2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))
    K[0, 0] = K[-1, -1] = stiffness
    last = np.diag([0.0] * (n - 1) + [1.0])
    points = {str(i): i for i in range(n)}
    return mp.LinearStructure(0.5 / n * np.eye(n) + heavy * last, K + spring * last, DAMPING * K, points)


def struck(structure, own_stop, heavy, step):
    """Displacement of the first mass of a rod that strikes a stop, with a heavy part tied to its other end."""
    stop = mp.UnilateralContact("stop", "0", GAP, STOP)
    model = mp.MultiPhiModel(structure, [stop] if own_stop else [], modes="all")
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    last, start = str(structure.n - 1), np.full(structure.n, SPEED)
    items = CreateMultiPhiBody(mbs, model, "rod", velocity=start, interface=["0", last])
    node = mbs.AddNode(Node1D(referenceCoordinates=[0.0], initialVelocities=[SPEED]))
    mbs.AddObject(Mass1D(nodeNumber=node, mass=heavy))
    ends = [coordinate(mbs, node), coordinate(mbs, items["nInterface"][last])]
    mbs.AddObject(ObjectConnectorCoordinate(markerNumbers=ends))
    ground = coordinate(mbs, mbs.AddNode(NodePointGround()))
    mbs.AddObject(CoordinateSpringDamper(markerNumbers=[ground, coordinate(mbs, node)], stiffness=SPRING))
    if not own_stop:
        data = mbs.AddNode(NodeGenericData(initialCoordinates=[1.0], numberOfDataCoordinates=1))
        ends = [ground, coordinate(mbs, items["nInterface"]["0"])]
        contact = {"contactStiffness": STOP, "contactDamping": 0.0, "offset": -GAP}
        mbs.AddObject(ObjectContactCoordinate(markerNumbers=ends, nodeNumber=data, **contact))
    mbs.Assemble()
    chosen = fixed_steps(END, round(END / step), write_period=step)
    chosen.timeIntegration.discontinuous.useRecommendedStepSize = False
    chosen.timeIntegration.newton.relativeTolerance = 1e-10
    mbs.SolveDynamic(chosen, solverType=TRAPEZOIDAL)
    found = body_histories(mbs, items)
    return found.time, found.points["0"]


@pytest.mark.parametrize(("masses", "stiffness", "heavy"), [(6, 2e7, 20.0), (3, 1e8, 1.0), (8, 1e8, 50.0)])
def test_beside_a_heavy_part_an_event_of_the_body_errs_no_more_than_a_contact_of_exudyn(masses, stiffness, heavy):
    """The heavy part does not take over the vibrations of the light body."""
    stop = mp.UnilateralContact("stop", "0", GAP, STOP)
    model = mp.MultiPhiModel(rod(masses, stiffness, heavy, SPRING), [stop], modes="all")
    native = mp.simulate(model, END, velocity=np.full(masses, SPEED))
    assert [event.kind for event in native.events] == ["close", "open"]
    for steps in (200, 400, 800):
        errors = []
        for own_stop in (True, False):
            time, y = struck(rod(masses, stiffness), own_stop, heavy, END / steps)
            exact = native.at("0", np.minimum(time, END))
            errors.append(np.linalg.norm(y - exact) / np.linalg.norm(exact))
        assert errors[0] < 1.5 * errors[1]
