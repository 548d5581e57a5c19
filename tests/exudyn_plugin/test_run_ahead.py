"""A body on which nothing acts runs ahead: what Exudyn is told, when it is asked, and who interferes is found out."""

import math

import exudyn as exu
import exudyn.itemInterface as eii
import numpy as np
import pytest
from small_structures import chain

import multiphi_exudyn as mp
from multiphi_exudyn.exudyn_plugin import CreateMultiPhiBody, body_histories
from multiphi_exudyn.exudyn_plugin.alone import RunAhead, UndisturbedSteps
from multiphi_exudyn.exudyn_plugin.discretised_level import DiscretisedLevel
from multiphi_exudyn.time.loaded_levels import LoadedLevels
from multiphi_exudyn.time.state import Phase
from reference_models.solver_settings import fixed_steps

pytestmark = pytest.mark.usefixtures("quiet_exudyn")

TRAPEZOIDAL, RADIUS_ONE = exu.DynamicSolverType.TrapezoidalIndex2, exu.DynamicSolverType.GeneralizedAlpha
STEP, T_END = 1e-2, 5.0  # s
VELOCITY = np.array([0.3, -1.0, 0.7])
KINDS = {"compliant": 50.0, "rigid": math.inf}


def model_of(stiffness, modes="all"):
    structure = chain(3, damping=mp.ModalDamping([0.002, 0.001, 0.003]), stiffness=10.0)
    stops = [
        mp.UnilateralContact("below", "m2", 0.03, stiffness),
        mp.UnilateralContact("above", {"m0": -1.0}, 0.05, 30.0),
    ]
    return mp.MultiPhiModel(structure, stops, modes=modes)


class System:
    """A body alone in an Exudyn system, with what else is put there."""

    def __init__(self, model, before=None, **given):
        self.container = exu.SystemContainer()
        self.mbs = self.container.AddSystem()
        if before:
            before(self.mbs)
        self.items = CreateMultiPhiBody(self.mbs, model, "body", velocity=VELOCITY, **given)
        self.body = self.mbs.variables["multiPhi"]["body"]

    def assemble(self):
        """Only once: it takes the initial coordinates for those of the nodes."""
        if not self.mbs.systemIsConsistent:
            self.mbs.Assemble()

    def solve(self, t_end=T_END, solver=TRAPEZOIDAL, start=0.0, step=STEP, **given):
        self.assemble()
        chosen = fixed_steps(t_end, round((t_end - start) / step), write_period=step)
        chosen.timeIntegration.startTime = start
        chosen.timeIntegration.generalizedAlpha.spectralRadius = 1.0
        self.mbs.SolveDynamic(chosen, solverType=solver, **given)
        return body_histories(self.mbs, self.items)

    def solve_static(self):
        """q (s,)."""
        self.assemble()
        self.mbs.SolveStatic(fixed_steps(1.0, 1, write_period=1.0))
        return self.mbs.GetNodeOutput(self.items["nGenericODE2"], exu.OutputVariableType.Coordinates)

    def coordinates(self):
        """q, q', q'' at all samples (k, 3 s)."""
        keys = ("sCoordinates", "sCoordinates_t", "sCoordinates_tt")
        return np.hstack([self.mbs.GetSensorStoredData(self.items[key])[:, 1:] for key in keys])


def distances(found, native, point="m1"):
    """|difference| at every sample, of the largest displacement."""
    expected = native.at(point, np.minimum(found.time, native.t_end))
    return np.abs(found.points[point] - expected) / np.max(np.abs(expected))


def same_events(found, native):
    return [(e.contact, e.kind) for e in found] == [(e.contact, e.kind) for e in native]


# ---------------------------------------------------------------------- what Exudyn is told


@pytest.mark.parametrize("solver", [TRAPEZOIDAL, RADIUS_ONE])
@pytest.mark.parametrize("matched", [None, STEP], ids=["plain", "matched"])
def test_undisturbed_steps_are_those_of_exudyn(solver, matched):
    model = mp.MultiPhiModel(model_of(50.0).structure, [], modes="all")
    system = System(model, matchedStepSize=matched)
    system.solve(solver=solver)
    states = system.coordinates().reshape(501, 3, 3)
    stepped = DiscretisedLevel.of(LoadedLevels.static(model, np.zeros(3)).level((0,) * len(model.contacts)), 3, matched)
    first, counts = np.array([5, 5, 17, 40]), np.array([1, 20, 483, 0])
    reached = UndisturbedSteps(stepped, STEP).after(states[first], counts)
    assert np.allclose(reached, states[first + counts], rtol=0, atol=1e-9 * np.max(np.abs(states)))


@pytest.mark.parametrize("kind", KINDS)
def test_matched_it_is_native_at_every_step_and_unmatched_at_the_ends_of_steps_with_events(kind):
    model = model_of(KINDS[kind])
    native = mp.simulate(model, T_END, velocity=VELOCITY)
    matched, plain = System(model, matchedStepSize=STEP).solve(), System(model).solve()
    assert len(native.events) > 10
    for found in (matched, plain):
        assert same_events(found.events, native.events)
        assert [e.time for e in found.events] == pytest.approx([e.time for e in native.events], rel=1e-12)
    assert np.max(distances(matched, native)) < 1e-9
    ends = sorted({math.ceil(event.time / STEP) for event in native.events})
    assert np.max(distances(plain, native)[ends]) < 1e-12
    assert np.max(distances(plain, native)) > 1e-6


@pytest.mark.parametrize("kind", KINDS)
def test_a_function_of_the_user_changes_the_way_and_not_the_answer(kind):
    def observed(mbs):
        mbs.SetPreStepUserFunction(lambda mbs, t: True)

    model = model_of(KINDS[kind])
    alone, asked = (System(model, before, matchedStepSize=STEP) for before in (None, observed))
    first, second = alone.solve(), asked.solve()
    assert (alone.body.next_time, asked.body.next_time) == (pytest.approx(T_END), math.inf)
    assert same_events(first.events, second.events)
    assert np.max(np.abs(first.points["m1"] - second.points["m1"])) < 1e-7


def test_it_is_asked_at_events_only(monkeypatch):
    asked, arrive = [], RunAhead.after_step

    def counted(self, mbs, t, index):
        asked.append(t)
        arrive(self, mbs, t, index)

    monkeypatch.setattr(RunAhead, "after_step", counted)
    found = System(model_of(50.0), matchedStepSize=STEP).solve()
    ends = {math.ceil(event.time / STEP) for event in found.events}
    assert {round(t / STEP) for t in asked} == ends | {500}


def test_the_level_is_in_the_data_node_and_the_sensor_of_it_costs_no_python():
    system = System(model_of(50.0), matchedStepSize=STEP)
    found = system.solve()
    sensor = system.mbs.GetSensor(system.items["sLevel"])
    assert sensor["sensorType"] == "Node"
    native = mp.simulate(model_of(50.0), T_END, velocity=VELOCITY)
    times = found.time[1:-1]
    for contact in ("below", "above"):
        closed = np.zeros(len(times), bool)
        for a, b in native.contact_intervals(contact):
            closed |= (a <= times) & (times < b)
        assert np.array_equal(found.closed[contact][1:-1], closed)


def test_a_failure_on_the_way_is_told_when_exudyn_gets_there(monkeypatch):
    """What is known ends there: steps and events before are as ever."""
    model = model_of(50.0)
    native = mp.simulate(model, T_END, velocity=VELOCITY)
    system = System(model, matchedStepSize=STEP)
    monkeypatch.setattr("multiphi_exudyn.time.motion.CHATTER_WINDOW", 4)
    monkeypatch.setattr("multiphi_exudyn.time.motion.EVENTS_PER_PERIOD", 0.01)
    model.entries.clear()  # what it has kept of the check
    with pytest.raises(mp.MultiPhiError, match=r"body 'body': at t = .* chatter"):
        system.solve()
    reached = system.mbs.sys["dynamicSolver"].it.currentTime
    assert 0 < reached < T_END
    happened = [event for event in native.events if event.time <= reached]
    assert same_events(system.body.events, happened)


# ---------------------------------------------------------------------- steps of other lengths, other runs


def beside_a_ball(mbs):
    """A mass that falls on a contact of Exudyn, whose solver then shortens its steps."""
    node = mbs.AddNode(eii.Node1D(referenceCoordinates=[0.0], initialCoordinates=[0.3]))
    mbs.AddObject(eii.Mass1D(nodeNumber=node, mass=1.0))
    own = mbs.AddMarker(eii.MarkerNodeCoordinate(nodeNumber=node, coordinate=0))
    mbs.AddLoad(eii.LoadCoordinate(markerNumber=own, load=-9.81))
    ground = mbs.AddMarker(eii.MarkerNodeCoordinate(nodeNumber=mbs.AddNode(eii.NodePointGround()), coordinate=0))
    state = mbs.AddNode(eii.NodeGenericData(initialCoordinates=[0.3], numberOfDataCoordinates=1))
    contact = eii.ObjectContactCoordinate(markerNumbers=[ground, own], nodeNumber=state, contactStiffness=1e5)
    mbs.AddObject(contact)


@pytest.mark.parametrize("loads", [(), (mp.HarmonicLoad("m1", 2.0, 0.3),)], ids=["free", "driven"])
def test_steps_that_others_shorten_leave_it_exact_at_events(loads):
    model = model_of(50.0)
    native = mp.simulate(model, 2.0, velocity=VELOCITY, loads=loads)
    found = System(model, beside_a_ball, loads=loads).solve(2.0)
    assert np.ptp(np.diff(found.time)) > 0.1 * STEP
    assert same_events(found.events, native.events)
    ends = [np.flatnonzero(found.time >= event.time)[0] for event in native.events]
    assert np.max(distances(found, native)[ends]) < 1e-11
    assert np.max(distances(found, native)) < (1e-11 if loads else 1e-2)


def test_steps_that_others_shorten_are_refused_by_matched_modes(refused):
    system = System(model_of(50.0), beside_a_ball, matchedStepSize=STEP)
    refused(ValueError, "matchedStepSize of 'body': got 0.01 s", system.solve)


@pytest.mark.parametrize("modes", ["all", 2])
@pytest.mark.parametrize("kind", KINDS)
def test_a_run_in_parts_is_the_run(kind, modes):
    """Also where a part ends while a contact of a truncated model is not armed."""
    model = model_of(KINDS[kind], modes)
    whole, system = System(model, matchedStepSize=STEP).solve(), System(model, matchedStepSize=STEP)
    events, last, phases = [], [], set()
    for start in np.arange(50) / 10:
        part = system.solve(start + 0.1, start=start, updateInitialValues=True)
        events += part.events
        last.append(part.points["m1"][-1])
        phases.update(system.body.coordinates.read_level_data()[1])
    assert same_events(events, whole.events)
    assert modes == "all" or phases > {Phase.ARMED}
    assert np.allclose(last, whole.points["m1"][10::10], rtol=0, atol=1e-9)


def test_a_run_that_the_user_stops_has_the_events_until_then_and_the_next_begins_anew():
    system = System(model_of(50.0), matchedStepSize=STEP)
    sensor = eii.SensorUserFunction(sensorUserFunction=lambda *given: stop(given[1]), writeToFile=False)

    def stop(t):
        if t > 2.0:
            raise RuntimeError("enough")
        return [0.0]

    system.mbs.AddSensor(sensor)
    native = mp.simulate(model_of(50.0), T_END, velocity=VELOCITY)
    for _ in range(2):
        with pytest.raises(Exception, match="enough"):
            system.solve()
        assert same_events(system.body.events, [event for event in native.events if event.time <= 2.01])
    assert np.max(distances(system_histories(system), native)) < 1e-9


def system_histories(system):
    return body_histories(system.mbs, system.items)


def test_a_static_solution_after_a_run_has_the_level_of_the_system_and_not_that_in_which_the_run_ended():
    system, native = System(model_of(50.0), matchedStepSize=STEP), mp.simulate(model_of(50.0), T_END, velocity=VELOCITY)
    begun, ended = native.contact_intervals("above")[0]
    at_rest = System(model_of(50.0), matchedStepSize=STEP).solve_static()
    first = system.solve(round((begun + ended) / 2, 2))
    assert first.closed["above"][-1]
    events = system.body.events
    assert np.array_equal(system.solve_static(), at_rest)
    assert system.body.events == events != []
    level = system.mbs.GetNodeOutput(system.items["nGenericData"], exu.OutputVariableType.Coordinates)
    assert not np.any(level)
    again = system.solve(round((begun + ended) / 2, 2))
    assert np.max(np.abs(first.points["m1"] - again.points["m1"])) < 1e-12


def test_one_body_alone_and_one_that_is_held_in_one_system():
    """The one follows its known motion, while the other is looked at after every step."""
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    model = model_of(50.0)
    given = {"velocity": VELOCITY, "matchedStepSize": STEP}
    alone, held = CreateMultiPhiBody(mbs, model, "alone", **given), CreateMultiPhiBody(mbs, model, "held", **given)
    own = mbs.AddMarker(eii.MarkerNodeCoordinate(nodeNumber=held["nGenericODE2"], coordinate=0))
    ground = mbs.AddMarker(eii.MarkerNodeCoordinate(nodeNumber=mbs.AddNode(eii.NodePointGround()), coordinate=0))
    mbs.AddObject(eii.CoordinateSpringDamper(markerNumbers=[ground, own], stiffness=1e-9))
    mbs.Assemble()
    mbs.SolveDynamic(fixed_steps(T_END, 500, write_period=STEP), solverType=TRAPEZOIDAL)
    bodies, native = mbs.variables["multiPhi"], mp.simulate(model, T_END, velocity=VELOCITY)
    assert (bodies["alone"].next_time, bodies["held"].next_time) == (pytest.approx(T_END), math.inf)
    assert np.max(distances(body_histories(mbs, alone), native)) < 1e-9
    assert np.max(distances(body_histories(mbs, held), native)) < 1e-6
    del container


def test_more_steps_than_are_planned_at_once_and_events_in_every_part(monkeypatch):
    model = model_of(50.0)
    native = mp.simulate(model, T_END, velocity=VELOCITY)
    whole = System(model, matchedStepSize=STEP).solve()
    monkeypatch.setattr("multiphi_exudyn.exudyn_plugin.alone.STEPS_AHEAD", 16)
    system = System(model, matchedStepSize=STEP)
    found = system.solve()
    assert [event.contact for event in found.events] == [event.contact for event in native.events]
    assert np.max(distances(found, native)) < 1e-9
    assert found.warnings == whole.warnings


# ---------------------------------------------------------------------- who interferes


def pushed(system, at, key, by):
    """Let a sensor, of which nobody expects it, change a coordinate of the body once."""

    done = []

    def push(mbs, t, *rest):
        if t > at - STEP / 4 and not done:
            done.append(t)
            first = mbs.GetNodeODE2Index(system.items["nGenericODE2"])
            mbs.systemData.GetSystemStateDict(reference=True)[key][first] += by
        return [0.0]

    system.mbs.AddSensor(eii.SensorUserFunction(sensorUserFunction=push, writeToFile=False))


@pytest.mark.parametrize("loads", [(), (mp.HarmonicLoad("m1", 2.0, 0.3),)], ids=["free", "driven"])
@pytest.mark.parametrize("matched", [None, STEP], ids=["plain", "matched"])
@pytest.mark.parametrize(("key", "by"), [("ODE2Coords", 1e-4), ("ODE2Coords_t", -1e-2)])
def test_whoever_changes_its_coordinates_on_the_way_is_found_out(refused, key, by, matched, loads):
    system = System(model_of(50.0), matchedStepSize=matched, loads=loads)
    pushed(system, 2.0, key, by)
    refused(ValueError, "coordinates of 'body': got values at t = 2", system.solve)


def test_so_is_he_where_others_shorten_steps(refused):
    """From the first of its events on every step is looked at."""
    system = System(model_of(50.0), beside_a_ball)
    pushed(system, 2.0, "ODE2Coords", 1e-4)
    refused(ValueError, "coordinates of 'body': got values at t = 2", system.solve)


def test_a_prestep_function_may_change_its_coordinates():
    """It is called before the body looks at every step, which goes on from what it finds."""

    def push(mbs, t):
        if abs(t - 2.0) < STEP / 4:
            mbs.systemData.GetSystemStateDict(reference=True)["ODE2Coords_t"][:3] += 0.1
        return True

    free, stepped = (System(model_of(50.0), before) for before in (None, lambda mbs: mbs.SetPreStepUserFunction(push)))
    first, second = free.solve(), stepped.solve()
    apart = np.abs(first.points["m1"] - second.points["m1"])
    assert np.max(apart[: round(1.9 / STEP)]) < 1e-3 < 1e-2 < np.max(apart[round(2.2 / STEP) :])
    assert np.min(second.gaps["below"]) > -0.2


def replaced_at_once(system):
    system.mbs.SetPostStepUserFunction(lambda mbs, t: True)


def replaced_on_the_way(system):
    def replace(mbs, t, *rest):
        if t > 2.0:
            mbs.SetPostStepUserFunction(lambda mbs, t: True)
        return [0.0]

    system.mbs.AddSensor(eii.SensorUserFunction(sensorUserFunction=replace, writeToFile=False))


def removed(system):
    system.mbs.SetPostStepUserFunction(0)


@pytest.mark.parametrize("spoil", [replaced_at_once, replaced_on_the_way, removed])
def test_a_run_without_the_function_that_switches_ends_in_an_error(refused, spoil):
    system = System(model_of(50.0))
    spoil(system)
    refused(ValueError, "PostStepUserFunction: got a function that replaced the one of 'body'", system.solve)


@pytest.mark.parametrize("by_steps", [False, True])
def test_so_does_one_by_the_solver_itself_and_its_histories_are_refused(refused, by_steps):
    system = System(model_of(50.0))
    system.mbs.Assemble()
    replaced_at_once(system)
    chosen, solver = fixed_steps(1.0, 100, write_period=STEP), exu.MainSolverImplicitSecondOrder()
    chosen.timeIntegration.generalizedAlpha.spectralRadius = 1.0
    system.mbs.sys["dynamicSolver"], system.mbs.sys["simulationSettings"] = solver, chosen
    if by_steps:
        solver.InitializeSolver(system.mbs, chosen)
        solver.SolveSteps(system.mbs, chosen)
        solver.FinalizeSolver(system.mbs, chosen)
    else:
        refused(ValueError, "PostStepUserFunction:", solver.SolveSystem, system.mbs, chosen)
    refused(ValueError, "PostStepUserFunction:", body_histories, system.mbs, system.items)


def test_a_function_that_calls_the_one_it_replaces_is_let_pass():
    system, seen = System(model_of(50.0), matchedStepSize=STEP), []
    inner = system.mbs.GetPostStepUserFunction()["function"]
    system.mbs.SetPostStepUserFunction(lambda mbs, t: seen.append(t) or inner(mbs, t))
    found = system.solve()
    assert len(seen) == 501
    assert np.max(distances(found, mp.simulate(model_of(50.0), T_END, velocity=VELOCITY))) < 1e-7
