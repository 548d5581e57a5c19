"""What is to be said of a body in Exudyn in a static solution, with steps that its modes are not matched to, and of a
reduced system with a joint that its start violates.
"""

import warnings

import brute_force
import exudyn as exu
import exudyn.itemInterface as eii
import numpy as np
from campaign_scenes.parts import NEAR
from exudyn.itemInterface import LoadCoordinate, MarkerNodeCoordinate

import multiphi_exudyn as mp
from multiphi_exudyn.exudyn_plugin import CreateMultiPhiBody, reduce
from reference_models.body_alone import solve_body_alone
from reference_models.solver_settings import fixed_steps

STATIC = 1e-6  # of the largest displacement
TIMES = 40  # at which a reduced motion is compared
KEPT = []  # the container of the system that is being reduced: without it Exudyn frees the system
COARSE = 0.05  # of the norm of the motion: more has to be told


def static(scene):
    """Where SolveStatic ends, against the equilibrium, which the laws of the contacts hold to."""
    (load,) = scene.loads
    x = scene.model.static_equilibrium({load.at: load.force})
    rest = scene.model.structure.stiffness @ x - load.row(scene.model.structure)
    for contact in scene.model.contacts:
        rest = rest - contact.direction * contact.stiffness * max(0.0, -float(contact.direction @ x) - contact.gap)
    if np.max(np.abs(rest)) > STATIC * abs(load.force):
        return [("failure: equilibrium", f"off by {np.max(np.abs(rest)):.3g} N")]
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    node = CreateMultiPhiBody(mbs, scene.model, "body", interface=[load.at])["nInterface"][load.at]
    marker = mbs.AddMarker(MarkerNodeCoordinate(nodeNumber=node, coordinate=0))
    mbs.AddLoad(LoadCoordinate(markerNumber=marker, load=load.force))
    mbs.Assemble()
    settings = fixed_steps(1.0, 1, write_period=1.0)
    settings.staticSolver.verboseMode = 0
    try:
        mbs.SolveStatic(settings, updateInitialValues=True)
    except Exception as error:
        if isinstance(error.__cause__, mp.MultiPhiError):
            return [("refused", str(error.__cause__))]
        raise
    found = float(np.atleast_1d(mbs.GetNodeOutput(node, exu.OutputVariableType.Coordinates))[0])
    off = abs(found - float(scene.model.structure.row(load.at) @ x)) / np.max(np.abs(x))
    return [("ok", "")] if off <= STATIC else [("failure: static", f"off by {off:.3g} of the largest displacement")]


def unmatched(scene):
    """The body with its own modes against the run: near it, or told that the steps are long."""
    points = list(scene.model.structure.points)
    run = mp.simulate(scene.model, scene.t_end, scene.displacement, scene.velocity, scene.loads)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        histories, _ = solve_body_alone(
            scene.model, scene.displacement, scene.t_end, scene.steps, points, velocity=scene.velocity, matched=False
        )
    times = np.minimum(histories.time, run.t_end)
    expected = np.array([run.at(point, times) for point in points])
    found = np.array([histories.points[point] for point in points])
    off = float(np.linalg.norm(found - expected) / np.linalg.norm(expected))
    if off <= COARSE:
        return [("ok", "")]
    if any(issubclass(each.category, mp.MultiPhiWarning) and "step" in str(each.message) for each in told):
        return [("told", f"off by {off:.3g} of the motion")]
    return [("failure: unmatched", f"off by {off:.3g} of the motion in {scene.steps} steps, without a warning")]


def jointed(scene):
    """The reduced system of masses with a joint against brute force in the motions that the joint leaves."""
    joint = scene.joint
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of Exudyn's own conversions
        reduction = reduce(_joined(joint))
    run = mp.simulate(reduction.model, scene.t_end, velocity=reduction.velocity, loads=reduction.loads)
    times = np.linspace(0.0, scene.t_end, TIMES)
    answer = brute_force.solved(scene.system, scene.displacement, scene.velocity, times)
    expected, found = joint.tied @ answer.displacement, reduction.structure.coordinates @ run.displacement(times)
    off = float(np.max(np.abs(found - expected)) / np.max(np.abs(expected)))
    return [("ok", "")] if off <= NEAR else [("failure: joint", f"off by {off:.3g} of the largest displacement")]


def _joined(joint):
    """An Exudyn system of masses of one coordinate each, with the joint and the stop."""
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    nodes = [
        mbs.AddNode(eii.Node1D(referenceCoordinates=[0.0], initialCoordinates=[0.0], initialVelocities=[v]))
        for v in joint.velocity.tolist()
    ]
    matrices = {"massMatrix": joint.mass, "stiffnessMatrix": joint.stiffness, "dampingMatrix": 0 * joint.mass}
    mbs.AddObject(eii.ObjectGenericODE2(nodeNumbers=nodes, **matrices))
    markers = [mbs.AddMarker(MarkerNodeCoordinate(nodeNumber=node, coordinate=0)) for node in nodes]
    ends = [markers[joint.one], markers[joint.other]]
    mbs.AddObject(eii.ObjectConnectorCoordinate(markerNumbers=ends, factorValue1=1 / joint.ratio))
    at, gap, stiffness = joint.stop
    ground = mbs.AddMarker(MarkerNodeCoordinate(nodeNumber=mbs.AddNode(eii.NodePointGround()), coordinate=0))
    data = mbs.AddNode(eii.NodeGenericData(initialCoordinates=[0.0], numberOfDataCoordinates=1))
    stop = {"markerNumbers": [ground, markers[at]], "nodeNumber": data, "contactStiffness": stiffness, "offset": -gap}
    mbs.AddObject(eii.ObjectContactCoordinate(**stop))
    mbs.Assemble()
    KEPT[:] = [container]
    return mbs


JUDGES = {"static": static, "unmatched": unmatched, "jointed": jointed}
