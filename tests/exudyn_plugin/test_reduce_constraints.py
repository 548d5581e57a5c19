"""Starts that violate constraints, motions that constraints prescribe, and constraints that no linear structure has."""

import copy
import inspect
import pickle
import re
import warnings

import exudyn as exu
import exudyn.itemInterface as eii
import numpy as np
import pytest
import scipy.integrate

import multiphi_exudyn as mp
from multiphi_exudyn.exudyn_plugin import linear_structure_from, reduce
from multiphi_exudyn.exudyn_plugin.items import has_own_coordinates, is_constraint
from multiphi_exudyn.exudyn_plugin.matrices import moved_directions

pytestmark = pytest.mark.usefixtures("quiet_exudyn")

MASSES, SPRINGS, DAMPERS = np.array([1.0, 2.0, 0.5]), (100.0, 150.0, 80.0), (0.5, 0.3, 0.2)
SIZE, RATE, END = 0.01, 6.0, 1.0  # m, rad/s, s


class Masses:
    """Masses of one coordinate each, by one object with a mass matrix, markers of them and of ground."""

    def __init__(self, masses, velocities, displacements=None):
        self.container = exu.SystemContainer()
        self.mbs = mbs = self.container.AddSystem()
        count = len(velocities)
        displacements = np.zeros(count) if displacements is None else displacements
        self.ground = self.marker(mbs.AddNode(eii.NodePointGround()), "ground")
        self.nodes = [
            mbs.AddNode(eii.Node1D(referenceCoordinates=[0.0], initialCoordinates=[x], initialVelocities=[v]))
            for x, v in zip(displacements, velocities, strict=True)
        ]
        self.markers = [self.marker(node, f"x{i}") for i, node in enumerate(self.nodes)]
        if np.any(masses):
            self.coordinates(np.diag(masses) if np.ndim(masses) == 1 else masses, np.zeros((count, count)))

    def marker(self, node, name):
        return self.mbs.AddMarker(eii.MarkerNodeCoordinate(name=name, nodeNumber=node, coordinate=0))

    def coordinates(self, mass, damping, **given):
        matrices = {"massMatrix": mass, "dampingMatrix": damping, "stiffnessMatrix": np.zeros(mass.shape)} | given
        self.mbs.AddObject(eii.ObjectGenericODE2(nodeNumbers=self.nodes, **matrices))

    def spring(self, first, second, stiffness, damping=0.0):
        ends = [self.ground if i is None else self.markers[i] for i in (first, second)]
        self.mbs.AddObject(eii.CoordinateSpringDamper(markerNumbers=ends, stiffness=stiffness, damping=damping))

    def tie(self, first, second, name="tie", **given):
        ends = [self.ground if i is None else self.markers[i] for i in (first, second)]
        self.mbs.AddObject(eii.ObjectConnectorCoordinate(name=name, markerNumbers=ends, **given))

    def own(self, end=END, step=2e-4):
        return own_run(self.mbs, end, step)


def own_run(mbs, end, step):
    """Times (k,) and coordinates (n, k) of the run of Exudyn's default solver, displacements from the initial ones."""
    times, coordinates = [], []
    start = mbs.systemData.GetODE2Coordinates(exu.ConfigurationType.Initial)
    settings = exu.SimulationSettings()
    settings.solution.file.write = False
    settings.timeIntegration.endTime, settings.timeIntegration.numberOfSteps = end, round(end / step)

    def keep(mbs, t):
        times.append(t)
        coordinates.append(mbs.systemData.GetODE2Coordinates() - start)
        return True

    mbs.SetPostStepUserFunction(keep)
    try:
        assert mbs.SolveDynamic(settings)
    finally:
        mbs.SetPostStepUserFunction(0)
    return np.array(times), np.transpose(coordinates)


def run(reduction, end=END):
    """The run, its warnings not issued."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mp.MultiPhiWarning)
        return mp.simulate(reduction.model, end, velocity=reduction.velocity, loads=reduction.loads)


def off(system, reduction, trajectory, end=END, after=0):
    """RMS distance of all coordinates from Exudyn's own run, of their own; without the first ``after`` samples."""
    times, own = system.own(end)
    away = reduction.displacement(trajectory, np.minimum(times, end)) - own
    return np.linalg.norm(away[:, after:]) / np.linalg.norm(own[:, after:])


# ---------------------------------------------------------------------- starts


def tied(masses, factor, velocities, displacements=None, offset=0.0):
    """Two masses on springs, the second one tied to the first: factor x1 - x0 = offset."""
    system = Masses(np.array(masses), velocities, displacements)
    system.spring(None, 0, 100.0)
    system.spring(None, 1, 150.0)
    system.tie(0, 1, factor1=factor, offset=offset)
    system.mbs.Assemble()
    return system


@pytest.mark.parametrize(
    ("masses", "factor", "velocities"),
    [((1.0, 2.0), 1.0, (0.03, 0.0)), ((5.0, 0.2), 2.0, (0.0, -0.4)), ((1e-3, 1e3), -0.5, (1.0, 0.01))],
)
def test_velocities_that_violate_a_constraint_keep_the_momentum_along_it(masses, factor, velocities):
    system = tied(masses, factor, velocities)
    reduction = reduce(system.mbs)
    shape = np.array([factor, 1.0])  # of the motion that the constraint leaves free
    speed = shape @ (masses * np.array(velocities)) / (shape @ (masses * shape))
    assert reduction.structure.coordinates @ reduction.velocity == pytest.approx(speed * shape, rel=1e-12)
    trajectory = run(reduction)
    assert trajectory.warnings == ()
    assert off(system, reduction, trajectory) < 1e-4


@pytest.mark.parametrize(
    ("masses", "factor", "displacements", "offset"),
    [
        ((1.0, 2.0), 1.0, (0.01, 0.0), 0.0),
        ((1.0, 2.0), 1.0, (0.0, 0.0), 0.01),
        ((5.0, 0.2), 2.0, (0.0, -0.3), 0.1),
    ],
)
def test_a_violated_constraint_is_met_by_the_shortest_way_in_the_mass_metric_and_told(
    masses, factor, displacements, offset
):
    system = tied(masses, factor, (0.0, 0.0), displacements, offset)
    before = system.mbs.systemData.GetODE2Coordinates()
    reduction = reduce(system.mbs)
    trajectory = run(reduction)
    assert np.array_equal(system.mbs.systemData.GetODE2Coordinates(), before)
    pull = np.array([-1.0, factor]) / masses
    violation = factor * displacements[1] - displacements[0] - offset
    assert reduction.shift == pytest.approx(-violation * pull / (pull @ (masses * pull)), rel=1e-9)
    (told,) = trajectory.warnings
    assert told.startswith("left out: the violation of ObjectConnectorCoordinate 'tie' at the start")
    assert f"{np.max(np.abs(reduction.shift)):.3g} m" in told
    assert off(system, reduction, trajectory, after=1) < 1e-3
    (kept,) = run(reduction_from_pickle(reduction)).warnings
    assert kept == told


def reduction_from_pickle(reduction):
    class Kept:
        model, velocity, loads = pickle.loads(pickle.dumps((reduction.model, reduction.velocity, reduction.loads)))

    return Kept


def test_a_violation_that_is_small_beside_the_motion_is_met_and_not_told():
    system = tied((1.0, 2.0), 1.0, (0.5, 0.5), (1e-6, 0.0))
    reduction = reduce(system.mbs)
    assert np.any(reduction.shift)
    assert run(reduction).warnings == ()


def test_a_pendulum_of_the_wrong_length_starts_where_its_link_holds():
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    node = mbs.AddNode(eii.NodePoint2D(referenceCoordinates=[0.3, -1.1], initialVelocities=[0.0, -0.2]))
    body = mbs.AddObject(eii.ObjectMassPoint2D(mass=2.0, nodeNumber=node))
    ends = [mbs.AddMarker(eii.MarkerBodyPosition(bodyNumber=b)) for b in (mbs.AddObject(eii.ObjectGround()), body)]
    mbs.AddObject(eii.ObjectConnectorDistance(name="link", markerNumbers=ends, distance=1.0))
    mbs.AddLoad(eii.LoadForceVector(markerNumber=ends[1], loadVector=[0.0, -20.0, 0.0]))
    mbs.Assemble()
    reduction = reduce(mbs)
    place = np.array([0.3, -1.1]) + reduction.shift
    assert place == pytest.approx(np.array([0.3, -1.1]) / np.hypot(0.3, 1.1), rel=1e-12)
    velocity = reduction.structure.coordinates @ reduction.velocity
    along = np.array([-place[1], place[0]])  # of unit length
    assert velocity == pytest.approx(-0.2 * along[1] * along, rel=1e-9)


def test_constraints_that_cannot_all_be_met_are_refused_by_name():
    system = Masses(np.ones(2), (0.0, 0.0))
    system.spring(0, 1, 100.0)
    system.tie(None, 0, "first", offset=0.01)
    system.tie(None, 0, "second", offset=0.02)
    system.mbs.Assemble()
    with pytest.raises(
        mp.MultiPhiValueError, match=r"contradict others \(ObjectConnectorCoordinate '(first|second)'\)"
    ):
        reduce(system.mbs)


def test_a_linear_structure_is_not_made_of_a_state_that_violates_constraints():
    system = tied((1.0, 2.0), 1.0, (0.0, 0.0), (0.01, 0.0))
    with pytest.raises(mp.MultiPhiValueError, match="violates constraints \\(ObjectConnectorCoordinate 'tie'\\)"):
        linear_structure_from(system.mbs)


# ---------------------------------------------------------------------- joints with coordinates of their own


def cable_with(joint, active=True):
    """A body on a joint at a cable of two elements; the joint moves along it."""
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    nodes = [mbs.AddNode(eii.NodePoint2DSlope1(referenceCoordinates=[0.5 * i, 0.0, 1.0, 0.0])) for i in range(3)]
    law = {"length": 0.5, "massPerLength": 0.5, "bendingStiffness": 40.0, "axialStiffness": 1e6}
    if joint is eii.ObjectJointALEMoving2D:
        flow = mbs.AddNode(
            eii.NodeGenericODE2(
                referenceCoordinates=[0], initialCoordinates=[0], initialCoordinates_t=[0.1], numberOfODE2Coordinates=1
            )
        )
        kind, also = eii.ObjectALEANCFCable2D, [flow]
    else:
        kind, also = eii.ObjectANCFCable2D, []
    cables = [mbs.AddObject(kind(nodeNumbers=[*nodes[i : i + 2], *also], **law)) for i in range(2)]
    node = mbs.AddNode(eii.NodeRigidBody2D(referenceCoordinates=[0.3, 0.0, 0.0], initialVelocities=[0.05, 0.0, 0.0]))
    body = mbs.AddObject(eii.ObjectRigidBody2D(nodeNumber=node, mass=0.5, inertia=1e-3))
    marker = mbs.AddMarker(eii.MarkerBodyRigid(bodyNumber=body))
    along = [mbs.AddMarker(eii.MarkerBodyCable2DCoordinates(bodyNumber=cable)) for cable in cables]
    data = mbs.AddNode(eii.NodeGenericData(initialCoordinates=[0, 0.3], numberOfDataCoordinates=2))
    places = {"slidingMarkerNumbers": along, "slidingMarkerOffsets": [0.0, 0.5], "markerNumbers": [marker, along[0]]}
    if joint is eii.ObjectJointALEMoving2D:
        data = mbs.AddNode(eii.NodeGenericData(initialCoordinates=[0], numberOfDataCoordinates=1))
        places |= {"nodeNumbers": [data, flow]}
    else:
        places |= {"nodeNumber": data}
    mbs.AddObject(joint(name="slider", activeConnector=active, **places))
    mbs.Assemble()
    return mbs


@pytest.mark.parametrize("joint", [eii.ObjectJointSliding2D, eii.ObjectJointALEMoving2D])
@pytest.mark.parametrize("convert", [reduce, linear_structure_from])
def test_a_joint_that_slides_along_cables_is_refused_by_name(joint, convert):
    with pytest.raises(mp.MultiPhiValueError, match=f"{joint.__name__} 'slider'"):
        convert(cable_with(joint))


def test_a_sliding_joint_that_is_not_active_is_none():
    assert reduce(cable_with(eii.ObjectJointSliding2D, active=False)).structure.n == 15


def test_every_constraint_of_exudyn_with_a_node_of_its_own_is_one_of_those():
    kinds = [kind for name, kind in vars(eii).items() if name.startswith("Object") and inspect.isclass(kind)]
    items = [dict(kind()) for kind in kinds if hasattr(kind, "__iter__")]
    constraints = [item for item in items if is_constraint(item)]
    assert len(constraints) > 10
    own = {item["objectType"] for item in constraints if {"nodeNumber", "nodeNumbers"} & item.keys()}
    assert own == {item["objectType"] for item in constraints if has_own_coordinates(item)} != set()


# ---------------------------------------------------------------------- prescribed motions


def driven(coupling=0.0, dampers=DAMPERS, stop=False, start=0.0, factor=1.0, **drive):
    """Ground, three masses in a row on springs, the first one driven; masses coupled by a mass matrix."""
    coupled = coupling * (np.eye(3, k=1) + np.eye(3, k=-1))
    system = Masses(np.diag(MASSES) + coupled, (start, 0.02, 0.04))
    for i, (stiffness, damping) in enumerate(zip(SPRINGS, dampers, strict=True)):
        system.spring(i - 1 if i else None, i, stiffness, damping)
    system.tie(None, 0, "drive", factor1=factor, **drive)
    if stop:
        data = system.mbs.AddNode(eii.NodeGenericData(initialCoordinates=[1.0], numberOfDataCoordinates=1))
        law = {"offset": -0.004, "contactStiffness": 5e3, "nodeNumber": data}
        system.mbs.AddObject(eii.ObjectContactCoordinate(name="stop", markerNumbers=system.markers[:2], **law))
    system.mbs.Assemble()
    return system


def exact(motion, coupling=0.0, factor=1.0, dampers=DAMPERS):
    """Coordinates (3, k) at 50 times by scipy; motion: the offset and its derivatives."""
    mass = np.diag(MASSES) + coupling * (np.eye(3, k=1) + np.eye(3, k=-1))
    chain = np.eye(3) - np.eye(3, k=-1)  # stretches of the springs
    stiffness, damping = (chain.T @ np.diag(values) @ chain for values in (SPRINGS, dampers))
    times = np.linspace(0.0, END, 50)

    def rate(t, state):
        x, v = (np.append(motion(t)[i] / factor, state[2 * i : 2 * i + 2]) for i in (0, 1))
        force = -(stiffness @ x + damping @ v)[1:] - mass[1:, 0] * motion(t)[2] / factor
        return np.concatenate([state[2:], np.linalg.solve(mass[1:, 1:], force)])

    # the masses that are free take the momentum of the first one's velocity that is not the prescribed one
    change = -np.linalg.solve(mass[1:, 1:], mass[1:, 0]) * (motion(0.0)[1] / factor)
    start = np.concatenate([np.zeros(2), np.array([0.02, 0.04]) + change])
    found = scipy.integrate.solve_ivp(rate, (0.0, END), start, t_eval=times, rtol=1e-11, atol=1e-14)
    return times, np.vstack([[motion(t)[0] / factor for t in times], found.y[:2]])


def sine(t):
    return (SIZE * np.sin(RATE * t), SIZE * RATE * np.cos(RATE * t), -SIZE * RATE**2 * np.sin(RATE * t))


def rise(t):
    return (SIZE * (1 - np.cos(RATE * t)), SIZE * RATE * np.sin(RATE * t), SIZE * RATE**2 * np.cos(RATE * t))


def going(t):
    return (SIZE * t, SIZE, 0.0)


@pytest.mark.parametrize(
    ("motion", "given", "drive"),
    [
        (sine, {}, {"offsetUserFunction": lambda mbs, t, i, offset: sine(t)[0]}),
        (rise, {"coupling": 0.3}, {"offsetUserFunction": lambda mbs, t, i, offset: rise(t)[0] + offset}),
        (rise, {"factor": -2.0}, {"offsetUserFunction": lambda mbs, t, i, offset: offset * rise(t)[0], "offset": 1.0}),
        (sine, {"coupling": 0.2}, {"velocityLevel": True, "offsetUserFunction_t": lambda mbs, t, i, o: sine(t)[1]}),
        (going, {"coupling": 0.2}, {"velocityLevel": True, "offset": SIZE}),
        (sine, {"dampers": (0.0, 0.0, 0.0)}, {"offsetUserFunction": lambda mbs, t, i, offset: sine(t)[0]}),
    ],
)
def test_a_prescribed_motion_moves_the_rest_as_an_integration_has_it(motion, given, drive):
    reduction = reduce(driven(**given, **drive).mbs)
    trajectory = run(reduction)
    times, there = exact(motion, **given)
    assert trajectory.warnings == ()
    assert reduction.left_out == ()
    assert reduction.displacement(trajectory, times) == pytest.approx(there, abs=1e-6 * np.max(np.abs(there)))
    assert reduction.displacement(trajectory, times[7]) == pytest.approx(there[:, 7], abs=1e-6 * np.max(np.abs(there)))
    assert "constraint, its directions taken out; the motion that it prescribes" in reduction.report


@pytest.mark.parametrize("coupling", [0.0, 0.3])
@pytest.mark.parametrize("stop", [False, True])
def test_a_prescribed_motion_whose_speed_jumps_moves_as_in_exudyn_with_a_stop_too(coupling, stop):
    def ramp(mbs, t, index, offset):
        return SIZE * min(max(t - 0.5, 0.0) / 0.3, 1.0)

    system = driven(coupling, stop=stop, offsetUserFunction=ramp)
    reduction = reduce(system.mbs)
    trajectory = run(reduction)
    assert trajectory.warnings == ()
    assert bool(len(trajectory.events)) == stop
    assert off(system, reduction, trajectory) < 2e-4


@pytest.mark.parametrize(("size", "time"), [(0.01, 0.5), (-2e-4, 0.87)])
def test_a_prescribed_motion_that_jumps_is_refused_where_dampers_answer_with_an_impulse(size, time):
    def step(mbs, t, index, offset):
        return size * (t > time)

    reduction = reduce(driven(offsetUserFunction=step).mbs)
    told = f"'drive': got a motion that jumps by {abs(size):g} m or rad at t = {time:g} s, to which its dampers"
    with pytest.raises(mp.MultiPhiValueError, match=re.escape(told)):
        run(reduction)
    assert run(reduction, 0.9 * time).status == "ok"
    undamped = reduce(driven(dampers=(0.0, 0.0, 0.0), offsetUserFunction=step).mbs)
    assert run(undamped).warnings == ()


@pytest.mark.parametrize("of_velocity", [False, True])
def test_pulses_of_the_speed_are_as_accurate_as_they_are_said_to_be(of_velocity):
    def pulse(t):
        return SIZE * (int(t / 0.2) % 2)

    def steps(t):
        n = int(t / 0.2)
        return SIZE * (0.2 * (n // 2) + (t - 0.2 * n if n % 2 else 0.0))

    drive = (
        {"velocityLevel": True, "offsetUserFunction_t": lambda mbs, t, i, offset: pulse(t)}
        if of_velocity
        else {"offsetUserFunction": lambda mbs, t, i, offset: steps(t)}
    )
    system = driven(coupling=0.3, **drive)
    reduction = reduce(system.mbs)
    trajectory = run(reduction)
    assert (trajectory.status, trajectory.message, trajectory.warnings) == ("ok", "", ())
    assert off(system, reduction, trajectory) < 1e-3


@pytest.mark.parametrize("given", [np.inf, "1 mm", [0.001], 1j, None])
def test_an_offset_that_is_no_number_is_refused_by_its_item(given):
    needed = re.escape(f"'drive' offset: got {given!r} at t = 0 s, need a finite number")
    with pytest.raises(mp.MultiPhiValueError, match=needed):
        reduce(driven(offsetUserFunction=lambda mbs, t, i, offset: given).mbs)


@pytest.mark.parametrize("first", [0.0, 0.7])
def test_an_offset_that_fails_is_refused_by_its_item_when_it_is_needed(first):
    def drive(mbs, t, index, offset):
        return 1 / 0 if t >= first else 0.0

    with pytest.raises(mp.MultiPhiValueError, match=r"'drive' offset: got ZeroDivisionError .* at t = .* s, need"):
        run(reduce(driven(offsetUserFunction=drive).mbs))


def test_a_run_with_a_prescribed_motion_says_that_it_cannot_be_pickled(tmp_path):
    reduction = reduce(driven(offsetUserFunction=lambda mbs, t, i, offset: sine(t)[0]).mbs)
    trajectory = run(reduction)
    for whole in (trajectory, reduction):
        with pytest.raises(mp.MultiPhiTypeError, match=r"'drive' prescribes, .* keep a run with Trajectory\.save"):
            pickle.dumps(whole)
    trajectory.save(tmp_path / "run")
    assert copy.deepcopy(reduction.loads[-1]).function(0.1) == reduction.loads[-1].function(0.1)


@pytest.mark.parametrize(
    ("times", "told"),
    [("a", "t: got str"), ([[0.1, 0.2]], r"t: got shape \(1, 2\)"), (None, "t: got nan"), (np.nan, "t: got nan")],
)
def test_displacements_at_what_is_no_time_are_refused(times, told):
    reduction = reduce(driven(offsetUserFunction=lambda mbs, t, i, offset: sine(t)[0]).mbs)
    with pytest.raises(mp.MultiPhiError, match=told):
        reduction.displacement(run(reduction), times)


def test_displacements_of_what_is_no_run_are_refused():
    reduction = reduce(driven().mbs)
    with pytest.raises(mp.MultiPhiTypeError, match="trajectory: got None, need a Trajectory of this model"):
        reduction.displacement(None, 0.1)


@pytest.mark.parametrize("drive", [{"offsetUserFunction": lambda mbs, t, i, offset: sine(t)[0]}, {}])
def test_a_run_goes_on_from_another_one(drive):
    reduction = reduce(driven(stop=True, **drive).mbs)
    whole, half = run(reduction), run(reduction, END / 2)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        rest = mp.simulate(reduction.model, END, start=half, loads=reduction.loads)
    times = np.linspace(END / 2, END, 20)
    there = reduction.displacement(whole, times)
    assert reduction.displacement(rest, times) == pytest.approx(there, abs=1e-9 * np.max(np.abs(there)))
    check = reduction.check(rest)
    assert check.holds
    assert check.times[0] > END / 2
    assert check.times[-1] == END


def test_a_prescribed_motion_begins_at_the_current_time_and_state():
    system = driven(start=SIZE * RATE, offsetUserFunction=lambda mbs, t, i, offset: sine(t)[0])
    _, own = system.own(1.0)
    system.own(0.4)
    data = system.mbs.systemData
    data.SetODE2Coordinates_t(np.append(sine(0.4)[1], data.GetODE2Coordinates_t()[1:]))
    before = data.GetODE2Coordinates()
    reduction = reduce(system.mbs)
    later = before + reduction.displacement(run(reduction, 0.6), 0.6)
    assert later == pytest.approx(own[:, -1], abs=1e-4 * SIZE)
    assert later[0] == pytest.approx(sine(1.0)[0], rel=1e-9)


def on_a_moving_support(size, rate, up, degrees=0.5):
    """A pendulum of 1 m whose support is driven along x, or upwards."""
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    angle = np.radians(degrees)
    support = mbs.AddNode(eii.NodePoint2D(name="support", referenceCoordinates=[0.0, 0.0]))
    bob = mbs.AddNode(eii.NodePoint2D(name="bob", referenceCoordinates=[np.sin(angle), -np.cos(angle)]))
    bodies = [mbs.AddObject(eii.ObjectMassPoint2D(mass=1.0, nodeNumber=node)) for node in (support, bob)]
    ends = [mbs.AddMarker(eii.MarkerBodyPosition(bodyNumber=body)) for body in bodies]
    mbs.AddObject(eii.ObjectConnectorDistance(markerNumbers=ends, distance=1.0))
    mbs.AddLoad(eii.LoadForceVector(markerNumber=ends[1], loadVector=[0.0, -9.81, 0.0]))
    ground = mbs.AddMarker(eii.MarkerNodeCoordinate(nodeNumber=mbs.AddNode(eii.NodePointGround()), coordinate=0))

    def motion(mbs, t, index, offset):
        return size * (1 - np.cos(rate * t))

    for c in range(2):
        drive = {"offsetUserFunction": motion} if c == up else {}
        held = [ground, mbs.AddMarker(eii.MarkerNodeCoordinate(nodeNumber=support, coordinate=c))]
        mbs.AddObject(eii.ObjectConnectorCoordinate(markerNumbers=held, **drive))
    mbs.Assemble()
    return mbs


def test_a_pendulum_on_a_support_that_moves_sideways_swings_as_in_exudyn():
    mbs = on_a_moving_support(2e-4, 5.0, up=False, degrees=0.0)
    reduction = reduce(mbs)
    trajectory = run(reduction)
    times, own = own_run(mbs, END, 2e-4)
    assert trajectory.warnings == ()
    away = reduction.displacement(trajectory, np.minimum(times, END)) - own
    assert np.linalg.norm(away) < 1e-3 * np.linalg.norm(own)


def test_a_support_that_shakes_upwards_changes_the_stiffness_and_is_told():
    """The weight is g + u'': with u'' of a fifth of g the frequency changes by a tenth, though all angles are small."""
    slow, fast = (run(reduce(on_a_moving_support(size, 7.0, up=True)), 3.0) for size in (1e-5, 0.2 * 9.81 / 49))
    assert slow.warnings == ()
    (told,) = fast.warnings
    assert told.startswith("linear range: ")


def test_a_pickled_model_with_a_prescribed_motion_says_that_it_checks_nothing():
    reduction = reduce(driven(velocityLevel=True, offset=SIZE).mbs)
    model = pickle.loads(pickle.dumps(reduction.model))
    with pytest.warns(mp.MultiPhiWarning, match="not checked, constraints of its Exudyn system prescribe a motion"):
        mp.simulate(model, 0.5, velocity=reduction.velocity, loads=reduction.loads)


def test_what_a_prescribed_motion_moves_is_no_point_and_no_place_of_friction():
    system = driven(offsetUserFunction=lambda mbs, t, i, offset: sine(t)[0])
    data = system.mbs.AddNode(eii.NodeGenericData(initialCoordinates=[0.0] * 3, numberOfDataCoordinates=3))
    law = {"dynamicFrictionForce": 0.1, "stickingStiffness": 1e3, "nodeNumber": data}
    system.mbs.AddObject(
        eii.ObjectConnectorCoordinateSpringDamperExt(name="rubs", markerNumbers=system.markers[:2], **law)
    )
    system.mbs.Assemble()
    reduction = reduce(system.mbs)
    assert sorted(reduction.structure.points) == sorted(["x1", "x2", *(f"node{n}.0" for n in (2, 3))])
    ((item, reason),) = reduction.left_out
    assert (item.name, reason) == ("rubs", "friction on a coordinate that a prescribed motion moves")
    with pytest.raises(mp.MultiPhiValueError, match=r"points\['first'\]: got a place that a prescribed motion moves"):
        reduce(system.mbs, points={"first": system.markers[0]})


def test_a_prescribed_motion_that_reads_the_system_is_left_out_and_told():
    system = driven(offsetUserFunction=lambda mbs, t, i, offset: 0.0 * mbs.systemData.GetTime())
    reduction = reduce(system.mbs)
    ((item, reason),) = reduction.left_out
    assert item.name == "drive"
    assert reason == (
        "the motion it prescribes, its user function depends on more than time (it reads mbs.systemData); its "
        "coordinate is held where it is"
    )
    assert any("left out: ObjectConnectorCoordinate 'drive'" in told for told in run(reduction).warnings)


# ---------------------------------------------------------------------- matrices that are singular or round-off


def test_a_point_without_mass_on_a_joint_is_refused_by_its_node():
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    nodes = [mbs.AddNode(eii.NodePoint2D(name=f"n{x}", referenceCoordinates=[float(x), 0.0])) for x in range(2)]
    for node, mass in zip(nodes, (1.0, 0.0), strict=True):
        mbs.AddObject(eii.ObjectMassPoint2D(mass=mass, nodeNumber=node))
    ends = [mbs.AddMarker(eii.MarkerNodePosition(nodeNumber=node)) for node in nodes]
    mbs.AddObject(eii.ObjectConnectorDistance(markerNumbers=ends, distance=1.0))
    mbs.Assemble()
    for convert in (reduce, linear_structure_from):
        with pytest.raises(mp.MultiPhiValueError, match="mass: got no mass at coordinate 1 of node 'n1'"):
            convert(mbs)


@pytest.mark.parametrize("lost", ["force", "mass"])
def test_a_state_without_accelerations_is_outside_the_linear_range(lost):
    """Half a millimetre away the force is not a number, or the mass is singular."""
    system = Masses(np.zeros(2), (0.1, 0.0))
    functions = {
        "force": lambda mbs, t, i, q, v: [0.0 if q[0] < 5e-4 else np.nan, 0.0],
        "mass": lambda mbs, t, i, q, v: np.diag([1.0 if q[0] < 5e-4 else 0.0, 1.0]),
    }
    name = {"force": "forceUserFunction", "mass": "massMatrixUserFunction"}[lost]
    system.coordinates(np.eye(2), np.zeros((2, 2)), stiffnessMatrix=100.0 * np.eye(2), **{name: functions[lost]})
    system.mbs.Assemble()
    trajectory = run(reduce(system.mbs), 1.0)
    assert any("by more than 100 % of the largest displacement" in told for told in trajectory.warnings)


@pytest.mark.parametrize("scale", [2.0**-30, 1.0, 2.0**40])
@pytest.mark.parametrize("damping", [-2.8e-44, 3e-17])
def test_damping_that_is_round_off_is_none(scale, damping):
    system = Masses(scale * np.ones(2), (0.1, 0.2))
    system.coordinates(np.zeros((2, 2)), damping * scale * np.eye(2))
    system.spring(0, 1, 100.0 * scale)
    system.mbs.Assemble()
    assert reduce(system.mbs).structure.damping is None


@pytest.mark.parametrize("scale", [2.0**-30, 1.0, 2.0**40])
def test_negative_damping_that_is_round_off_is_none_in_the_only_direction_that_moves(scale):
    """Two masses that nothing moves, on a spring that would drive them apart, and one that flies."""
    system = Masses(scale * np.ones(3), (0.0, 0.0, 0.3))
    system.coordinates(np.zeros((3, 3)), -2.8e-44 * scale * np.eye(3))
    system.spring(0, 1, -100.0 * scale)
    system.mbs.Assemble()
    reduction = reduce(system.mbs)
    assert (reduction.structure.n, reduction.structure.damping) == (1, None)
    assert run(reduction).displacement(END) == pytest.approx(0.3 * END)


def test_directions_that_are_moved_have_no_round_off_of_the_others():
    rng = np.random.default_rng(3)
    mass, stiffness, push = np.eye(8), np.zeros((8, 8)), np.zeros((1, 8))
    mass[3:, 3:] += 0.1 * (lambda a: a @ a.T)(rng.normal(size=(5, 5)))
    stiffness[0, 1] = stiffness[1, 0] = -400.0
    push[0, 5:] = rng.normal(size=3)
    moved, _ = moved_directions(mass, stiffness, 0 * mass, push)
    assert np.all(moved[:3] == 0.0)
