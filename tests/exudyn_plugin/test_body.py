"""The reduced model as an Exudyn object answers as ``simulate`` does, alone, in pairs and with forces on it."""

import dataclasses
import functools
import math
import runpy
from pathlib import Path

import exudyn as exu
import exudyn.itemInterface as eii
import numpy as np
import pytest
from exudyn.itemInterface import (
    CoordinateSpringDamper,
    LoadCoordinate,
    MarkerNodeCoordinate,
    NodePointGround,
)
from scipy.integrate import solve_ivp

import multiphi_exudyn as mp
from multiphi_exudyn.exudyn_plugin import CreateMultiPhiBody, body_histories
from multiphi_exudyn.exudyn_plugin.discretised_level import DiscretisedLevel
from multiphi_exudyn.exudyn_plugin.own_loads import OwnLoads
from multiphi_exudyn.exudyn_plugin.step_test import conditions
from multiphi_exudyn.levels.model import level_store
from reference_models.body_alone import solve_body_alone
from reference_models.rig import initial_displacement, rig_beam, rig_contact, rig_damping
from reference_models.solver_settings import fixed_steps

pytestmark = pytest.mark.usefixtures("quiet_exudyn")

RADIUS_ONE = exu.DynamicSolverType.GeneralizedAlpha
TRAPEZOIDAL = exu.DynamicSolverType.TrapezoidalIndex2
POINTS = ("node2", "node3")
COMPLIANT = 1e6  # N/m


@functools.cache
def rig(stiffness, damped=True):
    """The rig with r = 6, and its start."""
    structure = mp.planar_beam(rig_beam(), elements=57, damping=rig_damping() if damped else None)
    model = mp.MultiPhiModel(structure, [rig_contact(stiffness)], modes=6)
    bent = model.static_equilibrium({"node3": 1.0})
    return model, bent * initial_displacement() / float(structure.row("node3") @ bent)


def chain(contacts, masses=3, modes="all", grounded=True, damping=None):
    """Masses of 1 kg in a row, 1e4 N/m between them and to the ground."""
    stiffness = 1e4 * (2 * np.eye(masses) - np.eye(masses, k=1) - np.eye(masses, k=-1))
    if not grounded:
        stiffness[0, 0] = stiffness[-1, -1] = 1e4
    points = {f"m{i}": i for i in range(masses)}
    return mp.MultiPhiModel(mp.LinearStructure(np.eye(masses), stiffness, damping, points), contacts, modes=modes)


def settings(step, end, radius=1.0):
    chosen = fixed_steps(end, round(end / step), write_period=max(step, 1e-3))
    chosen.timeIntegration.generalizedAlpha.spectralRadius = radius
    return chosen


def new_system():
    container = exu.SystemContainer()
    return container, container.AddSystem()


def run(model, step, end, solver=TRAPEZOIDAL, add=None, **given):
    """Histories of one body; ``add(mbs, items)`` puts more into its system."""
    container, mbs = new_system()
    items = CreateMultiPhiBody(mbs, model, name="body", **given)
    if add is not None:
        add(mbs, items)
    mbs.Assemble()
    mbs.SolveDynamic(settings(step, end), solverType=solver)
    del container
    return body_histories(mbs, items)


def difference(histories, trajectory, points):
    """Relative difference, all points together."""
    times = np.minimum(histories.time, trajectory.t_end)
    expected = np.concatenate([trajectory.at(point, times) for point in points])
    return np.linalg.norm(np.concatenate([histories.points[p] for p in points]) - expected) / np.linalg.norm(expected)


def observed_orders(errors):
    return np.log2(np.array(errors[:-1]) / np.array(errors[1:]))


# ---------------------------------------------------------------------- alone: the native answer


@pytest.mark.parametrize("e", [0.5, 0.9])
def test_with_restitution_it_bounces_and_comes_to_rest_as_natively(e):
    """A mass that its spring presses to its stop: two hundred bounces, the last of them in one step."""
    structure = mp.LinearStructure([[1.0]], [[400.0]], points={"m": 0})
    model = mp.MultiPhiModel(structure, [mp.UnilateralContact("stop", "m", -0.02, restitution=e)], modes="all")
    native = mp.simulate(model, 2.0, displacement=[0.1])
    body = run(model, 1e-3, 2.0, displacement=[0.1], matchedStepSize=1e-3)
    assert [(x.contact, x.kind) for x in body.events] == [(x.contact, x.kind) for x in native.events]
    np.testing.assert_allclose([x.time for x in body.events], [x.time for x in native.events], rtol=1e-9)


@pytest.mark.parametrize("damped", [True, False], ids=["damped", "undamped"])
@pytest.mark.parametrize("stiffness", [COMPLIANT, math.inf], ids=["compliant", "rigid"])
def test_matched_to_a_coarse_step_is_native(stiffness, damped):
    model, start = rig(stiffness, damped)
    native = mp.simulate(model, 1.0, displacement=start)
    body = run(model, 5e-4, 1.0, displacement=start, matchedStepSize=5e-4)
    assert len(native.events) > 40
    assert [(e.contact, e.kind) for e in body.events] == [(e.contact, e.kind) for e in native.events]
    assert difference(body, native, POINTS) < 1e-7


def test_levels_with_numbers_of_modes_of_their_own():
    model, start = rig(COMPLIANT)
    model = dataclasses.replace(model, modes=mp.UpTo(240.0))
    assert (model.level(()).modes, model.level(("support",)).modes) == (4, 3)
    native = mp.simulate(model, 0.2, displacement=start)
    body = run(model, 5e-4, 0.2, displacement=start, matchedStepSize=5e-4)
    assert difference(body, native, POINTS) < 1e-8


def test_matched_events_lie_inside_steps_at_native_times():
    model, start = rig(COMPLIANT)
    native = mp.simulate(model, 0.2, displacement=start)
    body = run(model, 5e-4, 0.2, displacement=start, matchedStepSize=5e-4)
    assert np.allclose([e.time for e in body.events], [e.time for e in native.events], rtol=0, atol=1e-9)
    assert np.allclose([e.energy_loss for e in body.events], [e.energy_loss for e in native.events], rtol=1e-6)
    assert np.allclose(body.contact_intervals["support"], native.contact_intervals("support"), rtol=0, atol=1e-9)


@pytest.mark.parametrize("solver", [RADIUS_ONE, TRAPEZOIDAL])
@pytest.mark.parametrize("stiffness", [COMPLIANT, math.inf], ids=["compliant", "rigid"])
def test_plain_modes_converge_to_native_with_second_order(stiffness, solver):
    model, start = rig(stiffness)
    native = mp.simulate(model, 0.1, displacement=start)
    steps = [4e-5, 2e-5, 1e-5, 5e-6]
    errors = [difference(run(model, h, 0.1, solver, displacement=start), native, POINTS) for h in steps]
    assert np.all(observed_orders(errors) >= 1.8)
    assert errors[-1] < 1e-5


def test_histories_hold_gap_force_and_velocity_of_native():
    model, start = rig(math.inf)
    native = mp.simulate(model, 0.1, displacement=start)
    body = run(model, 5e-4, 0.1, displacement=start, matchedStepSize=5e-4)
    times = np.minimum(body.time, native.t_end)
    velocity = np.array([model.structure.row("node3") @ native.velocity(t) for t in times])
    assert np.any(body.closed["support"])
    for ours, theirs in (
        (body.gaps["support"], native.gap("support", times)),
        (body.contact_force["support"], native.contact_force("support", times)),
        (body.velocities["node3"], velocity),
    ):
        assert np.max(np.abs(ours - theirs)) < 1e-7 * np.max(np.abs(theirs))


def test_constant_load_and_start_on_the_stop():
    model, _ = rig(COMPLIANT)
    load = mp.ConstantLoad("node3", -2.0)
    start = model.static_equilibrium({"node3": -20.0})
    native = mp.simulate(model, 0.2, displacement=start, loads=[load])
    body = run(model, 5e-4, 0.2, displacement=start, loads=[load], matchedStepSize=5e-4)
    assert body.closed["support"][0]
    assert native.events
    assert difference(body, native, POINTS) < 1e-7


def test_two_contacts_rigid_and_compliant_with_levels_of_unequal_size():
    contacts = [mp.UnilateralContact("below", "m0", 2e-3), mp.UnilateralContact("above", {"m2": -1.0}, 3e-3, 1e5)]
    damping = np.diag([0.3, 0.0, 1.0])  # couples the modes
    model = chain(contacts, damping=damping)
    start = {"displacement": np.array([0.0, 4e-3, 0.0]), "velocity": np.array([-1.0, 0.0, 1.0])}
    native = mp.simulate(model, 0.5, **start)
    body = run(model, 1e-3, 0.5, matchedStepSize=1e-3, **start)
    assert {e.contact for e in native.events} == {"below", "above"}
    assert [(e.contact, e.kind) for e in body.events] == [(e.contact, e.kind) for e in native.events]
    assert difference(body, native, ["m0", "m1", "m2"]) < 1e-8


def test_free_structure_falls_on_a_stop():
    model = chain([mp.UnilateralContact("floor", "m0", 5e-3, 1e5)], grounded=False)
    weight = mp.ConstantLoad({"m0": 1.0, "m1": 1.0, "m2": 1.0}, -9.81)
    native = mp.simulate(model, 0.5, loads=[weight])
    body = run(model, 1e-3, 0.5, loads=[weight], matchedStepSize=1e-3)
    assert len(native.events) > 2
    assert difference(body, native, ["m0", "m2"]) < 1e-8


def test_without_contacts_nothing_is_switched():
    model = chain([])
    container, mbs = new_system()
    items = mbs.CreateMultiPhiBody(model, displacement=np.array([1e-3, 0.0, 0.0]))
    del container
    assert "nGenericData" not in items
    assert not mbs.GetPostStepUserFunction()


@pytest.mark.parametrize("loads", [(), (mp.HarmonicLoad("m0", 40.0, 9.0),)], ids=["free", "driven"])
def test_a_tiny_bound_on_what_is_kept_of_levels_changes_nothing(monkeypatch, loads):
    """Between steps and after events everything is made again."""
    contacts = [mp.UnilateralContact(f"c{i}", f"m{i}", 2e-3 * (i + 1), 1e5) for i in range(3)]
    given = {"velocity": [0.0, -1.0, 0.7], "loads": loads}
    histories = []
    for most in (None, 1):
        if most is not None:
            monkeypatch.setattr(level_store, "CACHE_BYTES", 0)
            monkeypatch.setattr(level_store, "FEWEST_LEVELS", most)
        model = chain(contacts)
        histories.append(run(model, 1e-3, 0.4, **given))
        assert (model.levels_kept == 1) is (most == 1)
    usual, tight = histories
    assert len({event.contact for event in usual.events}) == 3
    assert [(e.contact, e.kind) for e in usual.events] == [(e.contact, e.kind) for e in tight.events]
    assert [e.time for e in usual.events] == pytest.approx([e.time for e in tight.events], rel=1e-13)
    for point in ("m0", "m1", "m2"):
        assert np.allclose(usual.points[point], tight.points[point], rtol=0, atol=1e-13)


# ---------------------------------------------------------------------- with forces of the system


def pushed_and_held(mbs, items):
    """A harmonic force on coordinate 0, a spring-damper from the ground to coordinate 1."""
    first, second = (
        mbs.AddMarker(MarkerNodeCoordinate(nodeNumber=items["nGenericODE2"], coordinate=c)) for c in (0, 1)
    )
    ground = mbs.AddMarker(MarkerNodeCoordinate(nodeNumber=mbs.AddNode(NodePointGround()), coordinate=0))
    mbs.AddLoad(
        LoadCoordinate(markerNumber=first, load=1.0, loadUserFunction=lambda mbs, t, load: 20 * math.cos(90 * t))
    )
    mbs.AddObject(CoordinateSpringDamper(markerNumbers=[ground, second], stiffness=3e3, damping=5.0))


def pushed_and_held_by_rk(model, times):
    """The same, compliant contact, by scipy: an explicit integrator with its own event location."""
    levels = {closed: model.level(("stop",) if closed else ()) for closed in (False, True)}
    base, load = model.base, np.zeros(model.base.modes.count)
    rests = {closed: level.asymptotic(load) for closed, level in levels.items()}

    def rate(closed, t, z):
        level, r = levels[closed], len(z) // 2
        force = -(level.omega**2) * z[:r] - level.damping @ z[r:]
        force[0] += 20 * math.cos(90 * t)
        force[1] -= 3e3 * z[1] + 5.0 * z[r + 1]
        return np.concatenate([z[r:], force])

    def gap(closed, z):
        level = levels[closed]
        constant = base.directions.T @ rests[closed].configuration + base.gaps
        return float((level.gap_rows @ z[: level.modes] + constant)[0])

    def crossing(closed):
        def event(t, z):
            return gap(closed, z)

        event.terminal, event.direction = True, (1 if closed else -1)
        return event

    closed, t, z, values, events = False, 0.0, np.zeros(2 * levels[False].modes), [], 0
    while t < times[-1]:
        wanted = times[times >= t]
        part = solve_ivp(
            functools.partial(rate, closed),
            (t, times[-1]),
            z,
            "DOP853",
            wanted,
            events=crossing(closed),
            rtol=1e-12,
            atol=1e-14,
        )
        level, y = levels[closed], part.y[: levels[closed].modes]
        values.append(base.modes.shapes @ (level.vectors @ y + rests[closed].configuration[:, None]))
        t = times[-1]
        if part.status == 1:
            t, z = part.t_events[0][0], part.y_events[0][0]
            source, target, r = levels[closed], levels[not closed], level.modes
            move = target.vectors.T @ source.vectors
            jump = target.vectors.T @ (rests[closed].configuration - rests[not closed].configuration)
            z = np.concatenate([move @ z[:r] + jump, move @ z[r:]])
            closed, events = not closed, events + 1
    return np.hstack(values), events


def test_forces_and_springs_on_the_coordinates_converge_to_another_integrator():
    model = chain([mp.UnilateralContact("stop", "m2", 2e-3, 5e4)], damping=mp.RayleighDamping(1.0, 1e-4))
    times = np.linspace(0, 0.4, 401)
    expected, events = pushed_and_held_by_rk(model, times)
    errors = []
    for step in (1e-4, 5e-5, 2.5e-5, 1.25e-5):
        body = run(model, step, 0.4, add=pushed_and_held)
        errors.append(np.linalg.norm(body.points["m2"] - expected[2]) / np.linalg.norm(expected[2]))
        assert len(body.events) == events
    assert events >= 4
    assert np.all(observed_orders(errors) >= 1.8)
    assert errors[-1] < 2e-5


def test_later_bodies_of_a_model_answer_as_the_first_one_of_another_to_the_bit(monkeypatch):
    """What a solver needs of a level is kept with the model, by the step and by what it is matched to."""
    built, of = [], DiscretisedLevel.of

    def counted(*given):
        built.append(given[1:])
        return of(*given)

    monkeypatch.setattr(DiscretisedLevel, "of", counted)
    contacts = [mp.UnilateralContact("stop", "m2", 2e-3, 1e5)]
    kept = chain(contacts)
    for step, matched in ((1e-3, 1e-3), (2e-3, None), (1e-3, None), (2e-3, 2e-3)) * 2:
        given = {"velocity": [0.0, -1.0, 0.7], "matchedStepSize": matched, "add": pushed_and_held}
        later, alone = run(kept, step, 0.2, **given), run(chain(contacts), step, 0.2, **given)
        assert later.events == alone.events != []
        assert np.array_equal(later.points["m2"], alone.points["m2"])
    of_new_models = 8
    assert len(built) == 2 * (of_new_models + 3)  # open and closed: matched to two steps, and plain


def test_conditions_of_a_step_are_kept_by_all_that_they_depend_on():
    """By the step, by the step that modes are matched to, and by what points carry of forces."""
    contacts = [mp.UnilateralContact("stop", "m2", 2e-3)]
    kept, found = OwnLoads(chain(contacts), (), 3, 0.0, 1.0), []
    for matched, step, carried in ((None, 1e-3, 0.0), (1e-3, 1e-3, 0.0), (None, 2e-3, 0.0), (None, 1e-3, 1.0)):
        loads = kept, OwnLoads(chain(contacts), (), 3, 0.0, 1.0)
        direct = np.full((1, 1), carried)
        ours, anew = (conditions(each, each.discretised_level((1,), matched), step, direct) for each in loads)
        assert np.array_equal(ours.ahead, anew.ahead)
        assert not any(np.array_equal(ours.ahead, other) for other in found)
        found.append(ours.ahead)


def test_a_constant_force_on_a_matched_body_is_exact():
    model = chain([mp.UnilateralContact("stop", "m2", 2e-3, 5e4)], damping=mp.RayleighDamping(1.0, 1e-4))

    def push(mbs, items):
        marker = mbs.AddMarker(MarkerNodeCoordinate(nodeNumber=items["nGenericODE2"], coordinate=0))
        mbs.AddLoad(LoadCoordinate(markerNumber=marker, load=-30.0))

    coarse, fine = (run(model, h, 0.3, add=push, matchedStepSize=h) for h in (1e-3, 1e-4))
    assert len(fine.events) > 3
    assert all(abs(event.energy_loss) < 1e-12 for event in fine.events)
    same = fine.points["m2"][np.searchsorted(fine.time, coarse.time - 1e-6)]
    assert np.linalg.norm(coarse.points["m2"] - same) < 1e-8 * np.linalg.norm(same)


# ---------------------------------------------------------------------- beside others in one system


def test_two_bodies_and_the_users_function_in_one_system():
    (one, x1), (two, x2) = rig(COMPLIANT), rig(math.inf)
    container, mbs = new_system()
    seen = []
    mbs.SetPostStepUserFunction(lambda mbs, t: seen.append(t) or True)
    items = [
        CreateMultiPhiBody(mbs, model, displacement=x, matchedStepSize=1e-4) for model, x in ((one, x1), (two, x2))
    ]
    mbs.Assemble()
    mbs.SolveDynamic(settings(1e-4, 0.1), solverType=TRAPEZOIDAL)
    del container
    assert len(seen) == 1001
    assert list(mbs.variables["multiPhi"]) == ["multiPhi0", "multiPhi1"]
    for item, model, x in zip(items, (one, two), (x1, x2), strict=True):
        alone = run(model, 1e-4, 0.1, displacement=x, matchedStepSize=1e-4)
        together = body_histories(mbs, item)
        assert len(together.events) == len(alone.events) > 5
        assert np.allclose(together.points["node3"], alone.points["node3"], rtol=0, atol=1e-9)


def test_a_function_set_later_is_found_out():
    model, start = rig(COMPLIANT)
    container, mbs = new_system()
    CreateMultiPhiBody(mbs, model, displacement=start)
    mbs.SetPostStepUserFunction(lambda mbs, t: True)
    mbs.Assemble()
    with pytest.raises(ValueError, match="replaced the one of 'multiPhi0'"):
        mbs.SolveDynamic(settings(1e-3, 0.01), solverType=TRAPEZOIDAL)
    del container


def closed_at(model, start):
    """A time in the middle of the first contact."""
    begin, end = mp.simulate(model, 0.2, displacement=start).contact_intervals("support")[0]
    return round((begin + end) / 2, 4)


def test_a_run_that_ended_closed_can_be_repeated_and_continued(refused):
    model, start = rig(COMPLIANT)
    half = closed_at(model, start)
    whole = run(model, 5e-5, 2 * half, displacement=start, matchedStepSize=5e-5)
    container, mbs = new_system()
    items = CreateMultiPhiBody(mbs, model, displacement=start, matchedStepSize=5e-5)
    mbs.Assemble()
    chosen = settings(5e-5, half)
    mbs.SolveDynamic(chosen, solverType=TRAPEZOIDAL)
    first = body_histories(mbs, items)
    refused(TypeError, "items: got 'beam', need the dict", body_histories, mbs, "beam")
    refused(TypeError, "points: got 'node3', need a sequence", body_histories, mbs, items, "node3")
    assert first.closed["support"][-1]
    mbs.SolveDynamic(chosen, solverType=TRAPEZOIDAL, updateInitialValues=True)
    again = body_histories(mbs, items)
    assert np.array_equal(first.points["node3"], again.points["node3"])
    chosen.timeIntegration.startTime, chosen.timeIntegration.endTime = half, 2 * half
    mbs.SolveDynamic(chosen, solverType=TRAPEZOIDAL)
    rest = body_histories(mbs, items)
    del container
    assert rest.contact_intervals["support"][0][0] == pytest.approx(half)
    assert rest.points["node3"][-1] == pytest.approx(whole.points["node3"][-1], abs=1e-9)


def test_a_static_solution_keeps_the_level():
    model, start = rig(COMPLIANT)
    container, mbs = new_system()
    items = CreateMultiPhiBody(mbs, model, displacement=start)
    mbs.Assemble()
    mbs.SolveStatic(settings(1.0, 1.0))
    coordinates = mbs.GetNodeOutput(items["nGenericODE2"], exu.OutputVariableType.Coordinates)
    flags = mbs.GetNodeOutput(items["nGenericData"], exu.OutputVariableType.Coordinates)
    del container
    assert np.max(np.abs(coordinates)) < 1e-8
    assert np.array_equal(flags, [0.0, 0.0])


# ---------------------------------------------------------------------- what is refused


def solve(model, start, chosen, store=True, solver=RADIUS_ONE, **given):
    container, mbs = new_system()
    CreateMultiPhiBody(mbs, model, displacement=start, **given)
    mbs.Assemble()
    mbs.SolveDynamic(chosen, solverType=solver, storeSolver=store)
    del container


@pytest.mark.parametrize(
    ("said", "radius", "given"),
    [
        ("spectralRadius 0.9", 0.9, {}),
        ("matchedStepSize of 'multiPhi0': got 0.0002 s", 1.0, {"matchedStepSize": 2e-4}),
        ("need storeSolver=True", 1.0, {"store": False}),
        ("got RK44, which is explicit", 1.0, {"solver": exu.DynamicSolverType.RK44}),
    ],
)
def test_settings_under_which_it_would_be_wrong_are_refused(said, radius, given):
    model, start = rig(COMPLIANT)
    with pytest.raises(ValueError, match=said):
        solve(model, start, settings(1e-3, 0.01, radius), **given)


@pytest.mark.parametrize(
    ("interface", "needed"),
    [((), "need TrapezoidalIndex2 (or spectralRadius = 1): mbs"), (("tip",), "need TrapezoidalIndex2: mbs")],
)
def test_the_default_solver_is_refused_with_one_that_fits_the_body(interface, needed):
    model, start = rig(COMPLIANT)
    point = next(iter(model.structure.points))
    with pytest.raises(ValueError, match="GeneralizedAlpha") as refusal:
        solve(model, start, settings(1e-3, 0.01, 0.9), interface=[point] if interface else ())
    assert needed in str(refusal.value)


def test_bad_arguments_are_refused(refused):
    model, start = rig(COMPLIANT)
    container, mbs = new_system()
    refused(TypeError, "model:", CreateMultiPhiBody, mbs, "rig")
    adaptive = dataclasses.replace(model, modes=mp.Tolerance(0.01))
    refused(ValueError, "model: got modes=Tolerance", CreateMultiPhiBody, mbs, adaptive)
    refused(ValueError, "displacement:", CreateMultiPhiBody, mbs, model, displacement=start[:-1])
    refused(ValueError, "matchedStepSize:", CreateMultiPhiBody, mbs, model, matchedStepSize=1e-2)
    refused(ValueError, "matchedStepSize:", CreateMultiPhiBody, mbs, model, matchedStepSize=-1e-4)
    refused(TypeError, "matchedStepSize:", CreateMultiPhiBody, mbs, model, matchedStepSize="h")
    CreateMultiPhiBody(mbs, model, name="beam")
    refused(ValueError, "name:", CreateMultiPhiBody, mbs, model, name="beam")
    refused(ValueError, "items:", body_histories, mbs, {})
    del container


# ---------------------------------------------------------------------- the example


def test_the_example_inside_exudyn_agrees_with_the_model_on_its_own(capsys):
    path = Path(__file__).parents[2] / "examples" / "inside_exudyn.py"
    body, distance = runpy.run_path(str(path))["main"]()
    assert len(body.events) > 40
    assert distance < 1e-7
    assert f"{len(body.events)} events" in capsys.readouterr().out


LAWS = {
    "hardening": (lambda q: 1e4 * (q + 2 * q**3), [0.3, 0.8, 1.5]),
    "two wells": (lambda q: 1e4 * (-3 * q + q**3), [0.3, 0.8, 1.9]),
}


class TestForceLawsAndViscousContacts:
    """Chains of levels, levels of negative stiffness and viscous contacts in the solver, against ``simulate``."""

    @pytest.mark.parametrize("name", LAWS)
    def test_a_law_is_exact_at_the_matched_step_and_second_order_at_others(self, name):
        function, start = LAWS[name]
        model = chain([mp.ForceLaw("m2", function, segments=32, span=(-2, 2))])
        native = mp.simulate(model, 0.06, displacement=start)
        assert native.stats.levels_built > 12
        lowest = min(np.min(segment.level.level.squares) for segment in native.segments)
        assert (lowest < 0) == (name == "two wells")
        errors = []
        for step, matched in ((1e-4, 1e-4), (1e-4, None), (5e-5, None)):
            found = run(model, step, 0.06, displacement=start, matchedStepSize=matched)
            errors.append(np.max(np.abs(found.points["m2"] - native.at("m2", np.minimum(found.time, 0.06)))))
            assert [e.contact for e in found.events] == [e.contact for e in native.events]
        assert errors[0] < 1e-10
        assert 3.5 < errors[1] / errors[2] < 4.5

    def test_a_viscous_contact_is_exact_at_the_matched_step(self):
        model = chain([mp.UnilateralContact("stop", "m0", 0.1, 3e4, 200.0)])
        native = mp.simulate(model, 0.1, displacement=[0.3, 0.8, 1.5])
        found = run(model, 1e-4, 0.1, displacement=[0.3, 0.8, 1.5], matchedStepSize=1e-4)
        assert len(native.events) == 4
        times = [e.time for e in found.events]
        assert times == pytest.approx([e.time for e in native.events], abs=1e-11)
        np.testing.assert_allclose(found.points["m2"], native.at("m2", np.minimum(found.time, 0.1)), atol=1e-9)
        force = native.contact_force("stop", np.minimum(found.time, 0.1))
        np.testing.assert_allclose(found.contact_force["stop"], force, atol=1e-6 * np.max(force))

    def test_a_law_beside_a_contact_under_a_harmonic_load(self):
        law = mp.ForceLaw("m2", LAWS["two wells"][0], segments=16, span=(-2, 2))
        model = chain([law, mp.UnilateralContact("stop", "m0", 0.1, 3e4, 200.0)])
        given = {"displacement": [0.3, 0.8, 1.5], "loads": [mp.HarmonicLoad("m1", 2e3, 20.0)]}
        native, found = mp.simulate(model, 0.06, **given), run(model, 1e-4, 0.06, **given)
        assert len(found.events) == len(native.events) > 4
        assert np.max(np.abs(found.points["m2"] - native.at("m2", np.minimum(found.time, 0.06)))) < 1e-12


def test_what_the_body_raises_inside_a_step_comes_out_as_it_is(refused):
    """Its matched modes allow the step in the open level, and not in the closed one, which the run enters."""
    model = chain([mp.UnilateralContact("stop", "m0", 0.01, 5e4)])
    start = np.array([0.5, 0.4, 0.2])
    refused(ValueError, "matchedStepSize: got 0.016 s", solve_body_alone, model, start, 0.32, 20, ())


@pytest.mark.parametrize(
    ("said", "given"),
    [
        ("solver: got GeneralizedAlpha with spectralRadius 0.9 (Exudyn's default is 0.9)", {}),
        ("solver: got RK44, which is explicit; need an impl", {"solverType": exu.DynamicSolverType.RK44}),
    ],
)
def test_the_first_line_of_a_wrong_solver_is_what_to_set(refused, said, given):
    model, start = rig(COMPLIANT)
    chosen = exu.SimulationSettings()
    chosen.solution.file.write = False
    for solve_dynamic in (exu.MainSystem.SolveDynamic, exu.SolveDynamic, exu.solver.SolveDynamic):
        container, mbs = new_system()
        CreateMultiPhiBody(mbs, model, displacement=start)
        mbs.Assemble()
        refused(ValueError, said, solve_dynamic, mbs, chosen, **given)
        del container


def test_a_solver_that_is_called_itself_is_refused_as_plainly(refused):
    model, start = rig(COMPLIANT)
    chosen = exu.SimulationSettings()
    chosen.solution.file.write = False
    implicit, explicit = exu.MainSolverImplicitSecondOrder(), exu.MainSolverExplicit()
    for solver, said in (
        (implicit, "SolveDynamic: got a solver that is not stored"),
        (explicit, "solver: got MainSolverExplicit, which is explicit"),
    ):
        container, mbs = new_system()
        CreateMultiPhiBody(mbs, model, displacement=start)
        mbs.Assemble()
        refused(ValueError, said, solver.SolveSystem, mbs, chosen)
        del container


def test_a_system_without_bodies_is_solved_as_before():
    container, mbs = new_system()
    node = mbs.AddNode(eii.NodePoint(initialVelocities=[1.0, 0.0, 0.0]))
    mbs.AddObject(eii.ObjectMassPoint(mass=1.0, nodeNumber=node))
    mbs.Assemble()
    chosen = fixed_steps(0.1, 10, write_period=0.1)
    mbs.SolveDynamic(chosen, solverType=exu.DynamicSolverType.RK44)
    assert mbs.GetNodeOutput(node, exu.OutputVariableType.Displacement)[0] == pytest.approx(0.1, rel=1e-12)
    assert "multiPhi" not in mbs.variables
    del container


@pytest.mark.parametrize("matched", [False, True], ids=["plain", "matched"])
@pytest.mark.parametrize("stiffness", [COMPLIANT, math.inf], ids=["compliant", "rigid"])
@pytest.mark.parametrize("masses", [1, 2])
def test_a_body_without_an_oscillating_mode_falls_on_its_stop(masses, stiffness, matched):
    structure = mp.LinearStructure(np.eye(masses), np.zeros((masses, masses)), points={"x": 0})
    model = mp.MultiPhiModel(structure, [mp.UnilateralContact("stop", "x", 0.1, stiffness)], modes="all")
    step, velocity = 1e-3, -np.ones(masses)
    native = mp.simulate(model, 0.5, velocity=velocity)
    body = run(model, step, 0.5, velocity=velocity, **({"matchedStepSize": step} if matched else {}))
    assert [(e.contact, e.kind) for e in body.events] == [(e.contact, e.kind) for e in native.events]
    assert abs(body.events[0].time - 0.1) < 1e-12
    assert difference(body, native, ["x"]) < (1e-12 if matched or math.isinf(stiffness) else 2e-3)
