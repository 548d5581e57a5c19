"""What reduce takes though it is not quite linear or symmetric, what it says of it, and where it stops."""

import warnings

import exudyn as exu
import exudyn.itemInterface as eii
import exudyn.utilities
import numpy as np
import pytest
from test_reduce import Mass

import multiphi_exudyn as mp
from multiphi_exudyn.exudyn_plugin import linear_structure_from, reduce
from multiphi_exudyn.exudyn_plugin.matrices import moved_directions
from reference_models.published_systems import OwnRun, PublishedSystem

pytestmark = pytest.mark.usefixtures("quiet_exudyn")

GRAVITY, LENGTH = 9.81, 1.0  # m/s2, m
END = 0.5  # s


def simulated(reduction, end=END):
    """The run and its warnings, none of them issued."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mp.MultiPhiWarning)
        return mp.simulate(reduction.model, end, velocity=reduction.velocity, loads=reduction.loads)


def off(system, reduction, trajectory, end=END, step=1e-4):
    """Largest distance from Exudyn's own run at the marker "m1", of its largest motion there."""
    own = OwnRun.of(PublishedSystem(system.container, system.mbs, "m1", end, step))
    theirs = own.of_row(reduction.structure.coordinates @ reduction.structure.row("m1"))
    found = trajectory.at("m1", np.minimum(own.time, end))
    return np.max(np.abs(found - theirs)) / np.max(np.abs(theirs))


def compressed(aside=0.0, sideways=0.0, load=80.0):
    """1.6 kg on a spring that is pressed by 8 cm, in space: unstable sideways, where a push may act or a speed be.

    The load pulls the spring to 2 cm, in whose tension the mass is stable; without it the spring stays pressed as long
    as it is."""
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    start = {"initialDisplacement": [-0.08, 0.0, 0.0], "initialVelocity": [1.0, sideways, 0.0]}
    mass = mbs.CreateMassPoint(name="mass", referencePosition=[0.5, 0.0, 0.0], mass=1.6, **start)
    mbs.CreateSpringDamper(itemNumbers=[mbs.CreateGround(), mass], stiffness=4000.0, damping=8.0)
    mbs.CreateForce(itemNumber=mass, loadVector=[load, 0.0, aside])
    mbs.AddMarker(eii.MarkerNodeCoordinate(name="m1", nodeNumber=0, coordinate=0))
    mbs.Assemble()
    return PublishedSystem(container, mbs, "m1", END, 1e-4)


def test_directions_in_which_nothing_moves_are_left_out():
    system = compressed()
    reduction = reduce(system.mbs)
    trajectory = simulated(reduction)
    ((item, said),) = reduction.left_out
    assert item.type == "MainSystem"
    assert said.startswith("directions in which nothing moves it, one of them unstable (omega^2 = -464 1/s2), mainly")
    assert reduction.structure.n == 1
    assert trajectory.warnings == ()
    assert off(system, reduction, trajectory) < 1e-3
    with pytest.raises(mp.MultiPhiValueError, match="need strict=False"):
        reduce(system.mbs, strict=True)


def test_directions_that_are_unstable_in_the_mean_of_the_motion_are_told():
    system = compressed(load=-320.0)
    reduction = reduce(system.mbs)
    trajectory = simulated(reduction)
    (told,) = trajectory.warnings
    assert told.startswith("left out: MainSystem 'mbs': directions in which nothing moves it, one of them unstable")
    # pressed by 8 cm on average, to 42 cm: k (1 - 50 / 42) / m
    assert reduction.check(trajectory).softest == pytest.approx(4000 * (1 - 50 / 42) / 1.6, rel=0.05)
    assert off(system, reduction, trajectory) < 1e-3


def spinning(about=(30.0, 0.0, 0.0), bent=0.0):
    """A ball of 1 kg m2 that spins about x against a torsional spring: gyroscopic forces about y and z.

    bent: a force [N] in z for each rad about x, which the linearisation has, or each rad2, which it does not."""
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    node = mbs.AddNode(eii.NodeRigidBodyRxyz(initialVelocities=[0.0, 0.0, 0.0, *about]))
    ball = mbs.AddObject(eii.ObjectRigidBody(name="ball", mass=1.0, inertia=[1, 1, 1, 0, 0, 0], nodeNumber=node))
    ends = [
        mbs.AddMarker(eii.MarkerBodyRigid(bodyNumber=body, localPosition=[0.0] * 3))
        for body in (mbs.AddObject(eii.ObjectGround()), ball)
    ]

    def force(mbs, t, i, u, turned, v, w, stiffness, damping, rotation0, rotation1, offset):
        return [*(1e3 * np.array(u) + [0, 0, bent * turned[0] ** 2]), *(5e3 * np.array(turned))]

    law = {"stiffness": np.diag([1e3] * 3 + [5e3] * 3), "springForceTorqueUserFunction": force if bent else 0}
    mbs.AddObject(eii.ObjectConnectorRigidBodySpringDamper(name="spring", markerNumbers=ends, **law))
    mbs.AddMarker(eii.MarkerNodeCoordinate(name="m1", nodeNumber=node, coordinate=3))
    mbs.Assemble()
    return PublishedSystem(container, mbs, "m1", END, 1e-4)


def test_gyroscopic_forces_in_directions_in_which_nothing_moves_are_left_out():
    system = spinning()
    reduction = reduce(system.mbs)
    trajectory = simulated(reduction)
    ((_, said),) = reduction.left_out
    assert said.startswith("directions in which nothing moves it, with them its ")
    assert "matrix is not symmetric between coordinate 4 of node" in said
    assert reduction.structure.n == 1
    assert trajectory.warnings == ()
    assert off(system, reduction, trajectory) < 1e-3


@pytest.mark.parametrize(("pushed", "count"), [([0], 1), ([0, 2], 2), ([3], 2), ([1], 1)])
def test_the_directions_that_pushes_reach_are_found_in_any_coordinates(pushed, count):
    """Of a free, an unstable, a stiff and two coupled directions; what round-off carries elsewhere is nothing."""
    turned = np.linalg.qr(np.random.default_rng(7).normal(size=(5, 5)))[0]
    stiffness = np.diag([0.0, -3.0, 1e6, 4.0, 5.0])
    stiffness[3, 4] = stiffness[4, 3] = 1.0
    given = (turned @ matrix @ turned.T for matrix in (np.diag([1.0, 2.0, 1.0, 3.0, 1.0]), stiffness, 0 * stiffness))
    mass, stiffness, damping = given
    kept, others = moved_directions(mass, stiffness, damping, np.eye(5)[pushed] @ turned.T)
    assert kept.shape == (5, count)
    assert kept.T @ mass @ others == pytest.approx(np.zeros((count, 5 - count)), abs=1e-8)
    assert kept.T @ stiffness @ others == pytest.approx(np.zeros((count, 5 - count)), abs=1e-3)  # of 1e6
    assert others.T @ mass @ others == pytest.approx(np.eye(5 - count), abs=1e-12)


def test_where_every_direction_is_moved_the_search_ends():
    random = np.random.default_rng(3)
    shapes = np.linalg.qr(random.normal(size=(80, 80)))[0]
    stiffness, damping = ((shapes * np.geomspace(1.0, size, 80)) @ shapes.T for size in (1e10, 1e3))
    damping += random.normal(size=(80, 80))
    assert moved_directions(np.eye(80), stiffness, damping, random.normal(size=(3, 80))) is None
    assert moved_directions(np.eye(80), stiffness, damping, np.zeros((3, 80))) is None


def test_a_spin_about_every_axis_is_refused_with_the_items():
    with pytest.raises(mp.MultiPhiValueError, match=r"not symmetric .* ObjectRigidBody 'ball'.*; need a symmetric one"):
        reduce(spinning(about=(30.0, 20.0, 0.0)).mbs)


def test_a_push_out_of_the_directions_that_were_moved_at_first_is_told():
    reduction = reduce(spinning(bent=1e4).mbs)
    told = simulated(reduction).warnings
    assert reduction.structure.n == 1
    assert any(said.startswith("linear range: left by") for said in told)


@pytest.mark.parametrize("pushed", [{"aside": 1e-3}, {"sideways": 1e-3}])
def test_an_unstable_direction_in_which_something_moves_is_refused(pushed, refused):
    refused(ValueError, "stiffness: got a negative eigenvalue (omega^2 = -464 1/s2)", reduce, compressed(**pushed).mbs)


@pytest.mark.parametrize("kind", ["RotationEulerParameters", "RotationRxyz"])
def test_a_pendulum_let_go_where_it_is_level_falls(kind):
    """Its stiffness is zero there, and round-off of a joint's forces of 20 N is neither a frequency nor instability."""
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    inertia = exu.utilities.InertiaCuboid(2000, (LENGTH, 0.1, 0.1))
    place = [LENGTH / 2, 0.0, 0.0]
    bar = mbs.CreateRigidBody(
        referencePosition=place, inertia=inertia, gravity=[0, -GRAVITY, 0], nodeType=getattr(exu.NodeType, kind)
    )
    ground = mbs.CreateGround()
    ends = (ground, [0.0] * 3), (bar, [-LENGTH / 2, 0.0, 0.0])
    markers = [mbs.AddMarker(eii.MarkerBodyRigid(bodyNumber=body, localPosition=at)) for body, at in ends]
    mbs.AddObject(eii.GenericJoint(markerNumbers=markers, constrainedAxes=[1, 1, 1, 1, 1, 0]))
    mbs.AddMarker(eii.MarkerBodyPosition(name="tip", bodyNumber=bar, localPosition=[LENGTH / 2, 0.0, 0.0]))
    mbs.Assemble()
    reduction = reduce(mbs)
    assert np.all(reduction.structure.stiffness == 0)
    fallen = simulated(reduction, 0.1).at("tip.y", 0.1)
    mass, about = inertia.Mass(), inertia.Translated([-LENGTH / 2, 0, 0]).Inertia()[2, 2]
    turning = mass * GRAVITY * LENGTH / 2 / about
    assert fallen == pytest.approx(-0.5 * turning * LENGTH * 0.1**2, rel=1e-6)


def coupled(part, spin):
    """Two coordinates by matrices, one of which is not symmetric."""
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    start = {"initialCoordinates": [1e-3, 0.0], "initialCoordinates_t": [0.0, 0.0]}
    node = mbs.AddNode(
        eii.NodeGenericODE2(name="pair", referenceCoordinates=[0.0, 0.0], numberOfODE2Coordinates=2, **start)
    )
    given = {"stiffnessMatrix": 100 * np.eye(2), "dampingMatrix": 0.4 * np.eye(2)}  # 20 N s/m is critical
    largest = 20.0 if part == "dampingMatrix" else 100.0
    given[part] = given[part] + spin * largest * np.array([[0.0, 1.0], [-1.0, 0.0]])
    mbs.AddObject(eii.ObjectGenericODE2(name="own", nodeNumbers=[node], massMatrix=np.eye(2), **given))
    mbs.AddMarker(eii.MarkerNodeCoordinate(name="m1", nodeNumber=node, coordinate=0))
    mbs.Assemble()
    system = Mass.__new__(Mass)
    system.container, system.mbs = container, mbs
    return system


@pytest.mark.parametrize(
    ("part", "said"),
    [
        ("stiffnessMatrix", "stiffness matrix, of which entries differ by 0.004 of the largest between"),
        (
            "dampingMatrix",
            "damping matrix, of which entries differ by 0.2 of the largest (a ratio to critical damping of ",
        ),
    ],
)
def test_a_matrix_that_is_nearly_symmetric_is_taken_and_told(part, said):
    system = coupled(part, 0.002)
    reduction = reduce(system.mbs)
    (sentence,) = reduction.symmetrised
    assert said in sentence
    assert "ObjectGenericODE2 'own'" in sentence
    assert sentence in reduction.report
    trajectory = simulated(reduction)
    assert trajectory.warnings == ()
    assert off(system, reduction, trajectory) < 1e-3
    with pytest.raises(mp.MultiPhiValueError, match=r"not symmetric .* ObjectGenericODE2 'own'"):
        linear_structure_from(system.mbs)


@pytest.mark.parametrize("part", ["stiffnessMatrix", "dampingMatrix"])
def test_a_matrix_that_is_not_symmetric_is_refused_with_the_item(part):
    with pytest.raises(mp.MultiPhiValueError, match=r"differ by [\d.]+ of the largest .*ObjectGenericODE2 'own'; need"):
        reduce(coupled(part, 0.05).mbs)


def damped(least):
    """Two coordinates by matrices with a damping of 0.4 N s/m and another one."""
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    zero = {"referenceCoordinates": [0.0, 0.0], "initialCoordinates": [1e-3, 0.0], "initialCoordinates_t": [0.0, 0.0]}
    node = mbs.AddNode(eii.NodeGenericODE2(numberOfODE2Coordinates=2, **zero))
    given = {"stiffnessMatrix": 100 * np.eye(2), "dampingMatrix": np.diag([0.4, least])}
    mbs.AddObject(eii.ObjectGenericODE2(nodeNumbers=[node], massMatrix=np.eye(2), **given))
    mbs.Assemble()
    return container, mbs


def test_negative_damping_that_is_round_off_is_none_and_more_is_refused():
    _kept, mbs = damped(-1e-9)
    assert reduce(mbs).structure.damping == pytest.approx(np.diag([0.4, 0.0]), abs=1e-7)
    _kept, mbs = damped(-1e-3)
    with pytest.raises(mp.MultiPhiValueError, match="damping"):
        reduce(mbs)


def test_damping_of_a_zero_frequency_mode_that_is_round_off_is_none():
    """A rotor spins freely; differentiating its dampers leaves 1e-17 of them there, and more between it and others."""
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    zero = {"referenceCoordinates": [0.0, 0.0], "initialCoordinates": [0.0, 0.0], "initialCoordinates_t": [1.0, 0.0]}
    node = mbs.AddNode(eii.NodeGenericODE2(numberOfODE2Coordinates=2, **zero))
    given = {"stiffnessMatrix": np.diag([0.0, 1e6]), "dampingMatrix": np.array([[0.0, 1e-7], [1e-7, 100.0]])}
    mbs.AddObject(eii.ObjectGenericODE2(nodeNumbers=[node], massMatrix=np.eye(2), **given))
    mbs.AddMarker(eii.MarkerNodeCoordinate(name="m1", nodeNumber=node, coordinate=0))
    mbs.Assemble()
    reduction = reduce(mbs)
    assert np.max(np.abs(reduction.structure.damping - np.diag([0.0, 100.0]))) < 1e-12
    run = simulated(reduction)
    assert run.status == "ok"
    assert run.at("m1", END) == pytest.approx(END)


def stepped(mbs, t, load):
    return load if t < 0.1 else -2 * load if t < 0.3 else 0.0


def test_a_load_that_steps_in_its_user_function_moves_the_model_as_it_does_the_system():
    system = spring_mass()
    marker = system.markers[1]
    system.mbs.AddLoad(eii.LoadCoordinate(name="push", markerNumber=marker, load=3.0, loadUserFunction=stepped))
    system.mbs.Assemble()
    reduction = reduce(system.mbs)
    assert reduction.left_out == ()
    assert off(system, reduction, simulated(reduction)) < 1e-3


def test_a_load_may_read_the_variables_of_the_system():
    system = spring_mass()
    system.mbs.variables["strength"] = 2.0

    def push(mbs, t, load):
        return load * mbs.variables["strength"] * t

    marker = system.markers[1]
    system.mbs.AddLoad(eii.LoadCoordinate(name="push", markerNumber=marker, load=3.0, loadUserFunction=push))
    system.mbs.Assemble()
    reduction = reduce(system.mbs)
    system.mbs.variables["strength"] = 7.0  # later: the model is that of the reduction
    load = reduction.loads[-1]
    assert load.function(0.1) == pytest.approx(0.6)


def spring_mass(**given):
    """0.5 kg on 200 N/m; with a user function for its force if given."""
    system = Mass(displacement=0.01, data=1)
    system.mbs.AddObject(
        eii.CoordinateSpringDamper(name="spring", markerNumbers=system.markers, stiffness=200.0, **given)
    )
    return system


def test_a_user_function_that_is_linear_in_the_motion_is_not_warned_of():
    system = spring_mass(springForceUserFunction=lambda mbs, t, i, u, v, k, d, offset: k * u + 0.3 * v)
    system.mbs.Assemble()
    reduction = reduce(system.mbs)
    trajectory = simulated(reduction)
    assert [item.name for item, _ in reduction.left_out] == ["spring"]
    assert trajectory.warnings == ()
    assert off(system, reduction, trajectory) < 1e-3


@pytest.mark.parametrize(
    "force",
    [
        lambda mbs, t, i, u, v, k, d, offset: k * u + 1e5 * u**3,
        lambda mbs, t, i, u, v, k, d, offset: k * u + (1e4 * (u + 0.006) if u < -0.006 else 0.0),
        lambda mbs, t, i, u, v, k, d, offset: k * u + (1.0 if 0.2 < t < 0.25 else 0.0),
    ],
    ids=["cubic", "stop", "in time"],
)
def test_a_user_function_that_does_more_is_warned_of_by_name(force):
    system = spring_mass(springForceUserFunction=force)
    system.mbs.Assemble()
    told = simulated(reduce(system.mbs)).warnings
    assert any(
        said.startswith("left out: ObjectConnectorCoordinateSpringDamper 'spring': the difference") for said in told
    )
    assert any(said.startswith("linear range: left by") for said in told)


def test_small_errors_that_add_up_to_a_shift_are_told():
    """Duffing's oscillator: omega^2 grows by 3/4 e for a force k u (1 + e (u / a)^2) at the amplitude a."""
    e, amplitude, end = 0.004, 0.01, 60.0

    def force(mbs, t, i, u, v, k, d, offset):
        return k * u * (1 + e * (u / amplitude) ** 2)

    system = Mass(velocity=amplitude * 20.0, data=1)
    given = {"markerNumbers": system.markers, "stiffness": 200.0, "springForceUserFunction": force}
    system.mbs.AddObject(eii.CoordinateSpringDamper(name="spring", **given))
    system.mbs.Assemble()
    reduction = reduce(system.mbs)
    found = reduction.check(simulated(reduction, end))
    assert found.error < 0.01
    assert found.lag == pytest.approx(3 / 8 * e * 20.0 * end, rel=0.3)
    assert not found.holds
    assert "the phase is off by some" in found.sentences[0]
    assert reduction.check(simulated(reduction, 0.5)).holds


def test_a_motion_that_has_come_to_rest_is_not_said_to_be_shifted():
    """A step load: at the end the mass stands where it should, off by 8e-4 of the way."""

    def force(mbs, t, i, u, v, k, d, offset):
        return k * u * (1 + 8e-4 * (u / 0.01) ** 2) + d * v

    system = Mass(data=1)
    given = {"markerNumbers": system.markers, "stiffness": 200.0, "damping": 10.0, "springForceUserFunction": force}
    system.mbs.AddObject(eii.CoordinateSpringDamper(name="spring", **given))
    system.mbs.AddLoad(eii.LoadCoordinate(markerNumber=system.markers[1], load=2.0))
    system.mbs.Assemble()
    reduction = reduce(system.mbs)
    found = reduction.check(simulated(reduction, 300.0))
    assert found.error == pytest.approx(8e-4, rel=0.05)
    assert found.lag == 0.0
    assert found.holds


def test_a_damped_contact_that_opens_is_warned_of():
    system = spring_mass()
    law = {"contactStiffness": 1e5, "contactDamping": 5.0, "offset": -0.005}
    contact = eii.ObjectContactCoordinate(name="stop", markerNumbers=system.markers, nodeNumber=system.data, **law)
    system.mbs.AddObject(contact)
    system.mbs.Assemble()
    reduction = reduce(system.mbs)
    (sentence,) = simulated(reduction).warnings
    assert sentence.startswith("contact damper: that of 'stop' never pulls")
    assert simulated(reduction, 0.05).warnings == ()


def test_a_motion_that_only_stands_is_checked_too():
    """The one mode that is kept is that of a mass which nothing acts on; the other answers its load at once."""
    system = Mass()
    ends = [system.markers[0], free_mass(system)]
    system.mbs.AddObject(eii.CoordinateSpringDamper(markerNumbers=ends, stiffness=100.0))
    system.mbs.AddLoad(eii.LoadCoordinate(markerNumber=ends[1], load=1.0))
    system.mbs.Assemble()
    reduction = reduce(system.mbs, modes=1)
    assert reduction.check(simulated(reduction)).reason == ""


def free_mass(system):
    node = system.mbs.AddNode(eii.Node1D(referenceCoordinates=[0.0]))
    system.mbs.AddObject(eii.ObjectMass1D(mass=1.0, nodeNumber=node))
    return system.mbs.AddMarker(eii.MarkerNodeCoordinate(name="other", nodeNumber=node, coordinate=0))


def test_an_object_of_first_order_is_refused_by_name():
    system = spring_mass()
    start = {"referenceCoordinates": [0.0], "initialCoordinates": [0.0]}
    node = system.mbs.AddNode(eii.NodeGenericODE1(numberOfODE1Coordinates=1, **start))
    system.mbs.AddObject(eii.ObjectGenericODE1(name="tank", nodeNumbers=[node], systemMatrix=[[-1.0]]))
    system.mbs.Assemble()
    with pytest.raises(mp.MultiPhiValueError, match=r"got ODE1 coordinates \(ObjectGenericODE1 'tank'\)"):
        reduce(system.mbs)
