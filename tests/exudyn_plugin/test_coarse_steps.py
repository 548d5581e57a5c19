"""Steps that are long for a body's own modes: its events beside heavy parts, and what is told."""

import functools
import math
import re
import warnings

import exudyn as exu
import numpy as np
import pytest
from exudyn.itemInterface import (
    CoordinateSpringDamper,
    LoadCoordinate,
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


# ---------------------------------------------------------------------- what is told


@functools.cache
def cantilever(modes):
    """The cantilever of the examples above its stop, pulled up, and its run under a force at the tip."""
    piece = mp.Section.rectangle(0.0, 0.5, width=0.03, height=0.006, youngs_modulus=70e9, density=2700.0)
    beam = mp.Beam([piece], points={"middle": 0.375, "tip": 0.5})
    structure = mp.planar_beam(beam, elements=20, damping=mp.ModalDamping([0.01, 0.005], beyond=0.005))
    model = mp.MultiPhiModel(structure, [mp.UnilateralContact("stop", "middle", 1.35e-3, 1e6)], modes=modes)
    start = model.static_equilibrium({"tip": 20.0})
    return model, start, mp.simulate(model, 0.1, displacement=start, loads=[mp.ConstantLoad("tip", -1.0)])


def pushed(model, start, end, steps, force=-1.0, **given):
    """Histories of a body, alone or with a force at its tip, and what the run warns of."""
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    items = CreateMultiPhiBody(mbs, model, "beam", displacement=start, interface=["tip"] if force else (), **given)
    if force:
        mbs.AddLoad(LoadCoordinate(markerNumber=coordinate(mbs, items["nInterface"]["tip"]), load=force))
    mbs.Assemble()
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always", mp.MultiPhiWarning)
        mbs.SolveDynamic(fixed_steps(end, steps, write_period=end / 400), solverType=TRAPEZOIDAL)
    return body_histories(mbs, items), [str(each.message) for each in seen if "coarse steps" in str(each.message)]


def distance(found, native):
    exact = native.at("tip", np.minimum(found.time, native.t_end))
    return np.linalg.norm(found.points["tip"] - exact) / np.linalg.norm(exact)


@pytest.mark.parametrize(("modes", "steps"), [(12, 400), (12, 1600), (6, 400), (6, 1600)])
def test_steps_that_are_long_for_the_kept_modes_are_told_and_both_remedies_hold(modes, steps):
    model, start, native = cantilever(modes)
    found, (sentence,) = pushed(model, start, 0.1, steps)
    assert distance(found, native) > 0.03
    period = 1 / max(model.level(closed).highest_frequency for closed in ((), ("stop",)))
    step = 0.1 / steps
    assert f"coarse steps: {period / step:.3g} steps of {step:g} s in the shortest kept period" in sentence
    assert "(body 'beam')" in sentence
    if 2 * step < period:
        assert f"give matchedStepSize={step:g}" in sentence
    else:
        longest = float(re.search(r"steps shorter than (\S+) s and give this length as matchedStepSize", sentence)[1])
        assert longest == pytest.approx(period / 2, rel=5e-3)
        steps = round(1.2 * 0.1 / longest)
    matched, told = pushed(model, start, 0.1, steps, matchedStepSize=0.1 / steps)
    assert not told
    assert distance(matched, native) < 1e-4
    finer = float(re.search(r"or take steps of (\S+) s", sentence)[1])
    short, told = pushed(model, start, 0.1, round(1.05 * 0.1 / finer))
    assert not told
    assert distance(short, native) < 0.015


@pytest.mark.parametrize("stop", [False, True], ids=["linear", "open stop"])
@pytest.mark.parametrize("scale", [1.0, 2.0**-10])
def test_steps_that_delay_the_slowest_mode_over_a_long_run_are_told(scale, stop):
    """scale: of time."""
    structure = mp.LinearStructure(np.eye(1), np.array([[1e4]]) / scale**2, points={"tip": 0})
    stops = [mp.UnilateralContact("stop", "tip", 2.0, 1e4)] if stop else []
    model, end = mp.MultiPhiModel(structure, stops, modes="all"), 2.0 * scale
    found, (sentence,) = pushed(model, np.ones(1), end, 1000, force=0.0)
    lag = 1000 * (0.2 - 2 * math.atan(0.1))
    assert f"delay the slowest mode by {lag:.2g} rad" in sentence
    assert distance(found, mp.simulate(model, end, displacement=np.ones(1))) > 0.2
    assert any("coarse steps" in each for each in found.warnings)
    finer = float(re.search(r"or take steps of (\S+) s", sentence)[1])
    found, told = pushed(model, np.ones(1), end, round(1.05 * end / finer), force=0.0)
    assert not told
    assert distance(found, mp.simulate(model, end, displacement=np.ones(1))) < 0.05


def test_nothing_is_told_of_steps_that_end_exactly():
    """Alone under a load that varies, every step ends in the state of ``simulate``."""
    model, start, _ = cantilever(12)
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    loads = [mp.HarmonicLoad("tip", 1.0, 10.0)]
    items = CreateMultiPhiBody(mbs, model, "beam", displacement=start, loads=loads)
    mbs.Assemble()
    mbs.SolveDynamic(fixed_steps(0.1, 400, write_period=0.1 / 400), solverType=TRAPEZOIDAL)
    found = body_histories(mbs, items)
    assert not [sentence for sentence in found.warnings if "coarse steps" in sentence]
    assert distance(found, mp.simulate(model, 0.1, displacement=start, loads=loads)) < 1e-6
