"""Multi-Phi body under loads and stops that vary in time: alone it is ``simulate``, beside others of second order."""

import dataclasses
import math

import exudyn as exu
import numpy as np
import pytest
from exudyn.itemInterface import CoordinateSpringDamper, LoadCoordinate, MarkerNodeCoordinate, NodePointGround
from small_structures import chain

import multiphi_exudyn as mp
from multiphi_exudyn.exudyn_plugin import CreateMultiPhiBody, body_histories
from multiphi_exudyn.exudyn_plugin.own_loads import jump_times
from multiphi_exudyn.time.state import Phase
from reference_models.exudyn_quiet import quiet
from reference_models.solver_settings import fixed_steps

T_END = 5.0
ITERATED = 1e-9  # relative: what Newton's iterations leave of an answer that has no error of the step
SOFT = (mp.UnilateralContact("below", "m2", 0.1, 50.0), mp.UnilateralContact("above", {"m0": -1.0}, 0.15, 30.0))
RIGID = (mp.UnilateralContact("below", "m2", 0.1),)
SHAKEN = mp.StopMotion("below", mp.Harmonic(0.1, 0.7, -math.pi / 2))
DRIVEN = mp.HarmonicLoad("m1", 2.0, 0.3, 0.4)
SAMPLES = np.random.default_rng(0).normal(size=26)
CASES = {
    "harmonic": (SOFT, "all", [DRIVEN]),
    "no contact": ((), "all", [DRIVEN]),
    "sampled": (SOFT, "all", [mp.SampledLoad("m1", np.linspace(0, T_END, 26), SAMPLES)]),
    "moving stop": (SOFT, "all", [SHAKEN, DRIVEN]),
    "rigid moving stop": (RIGID, "all", [SHAKEN, mp.ConstantLoad("m2", -1.0), mp.HarmonicLoad("m1", 0.5, 0.3, 0.4)]),
    "moving base": (SOFT, "all", [mp.BaseMotion(np.ones(3), mp.Harmonic(0.1, 0.7, -math.pi / 2), ("below",))]),
    "swept base": (SOFT, "all", [mp.BaseMotion(np.ones(3), mp.Sweep(0.1, 0.3, 1.0, T_END))]),
    "one mode": (SOFT, 1, [DRIVEN]),
    "sweep": (SOFT, "all", [mp.SweepLoad("m1", 1.0, 0.1, 2.0, T_END)]),
    "step": (SOFT, "all", [mp.FunctionLoad("m1", lambda t: 5 if t < 0.1 else -1)]),
    "one-sided law": ((mp.ForceLaw("m2", ([0.0, 0.1, 0.3], [0.0, 2.0, 9.0])),), "all", [DRIVEN]),
}


def model_of(contacts, modes):
    structure = chain(3, damping=mp.ModalDamping([0.02, 0.01, 0.03]), stiffness=10.0)
    return mp.MultiPhiModel(structure, contacts, modes=modes)


def solved(model, loads, steps, *, matched=False, beside=False, prepare=None, attach=None):
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    with quiet():
        if beside:  # a function that might do anything
            mbs.SetPostStepUserFunction(lambda mbs, t: True)
        items = CreateMultiPhiBody(mbs, model, loads=loads, matchedStepSize=T_END / steps if matched else None)
        if attach:
            attach(mbs, items["nGenericODE2"])
        mbs.Assemble()
        if prepare:
            prepare(mbs)
        settings = fixed_steps(T_END, steps, write_period=T_END / steps)
        mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.TrapezoidalIndex2)
    return body_histories(mbs, items)


PLAIN = ("harmonic", "one mode", "rigid moving stop", "sampled")  # modes that are not matched to the step
EITHER = [*((case, True) for case in CASES), *((case, False) for case in PLAIN)]


@pytest.mark.parametrize(("case", "matched"), EITHER)
def test_alone_every_step_ends_where_the_native_run_is(case, matched):
    contacts, modes, loads = CASES[case]
    model = model_of(contacts, modes)
    native, found = mp.simulate(model, T_END, loads=loads), solved(model, loads, 500, matched=matched)
    times = np.minimum(found.time, T_END)
    assert [(e.contact, e.kind) for e in found.events] == [(e.contact, e.kind) for e in native.events]
    assert [e.time for e in found.events] == pytest.approx([e.time for e in native.events], rel=1e-12)
    velocity = native.model.structure.row("m1") @ native.velocity(times)
    for ours, theirs in ((found.points["m1"], native.at("m1", times)), (found.velocities["m1"], velocity)):
        assert np.max(np.abs(ours - theirs)) < 1e-11 * np.max(np.abs(theirs))


@pytest.mark.parametrize(("case", "matched"), EITHER)
def test_beside_others_the_difference_to_the_native_run_falls_with_the_square_of_the_step(case, matched):
    contacts, modes, loads = CASES[case]
    model = model_of(contacts, modes)
    native = mp.simulate(model, T_END, loads=loads)
    errors = []
    for steps in (500, 1000):
        found = solved(model, loads, steps, matched=matched, beside=True)
        expected = native.at("m1", np.minimum(found.time, T_END))
        errors.append(np.max(np.abs(found.points["m1"] - expected)) / np.max(np.abs(expected)))
        assert [(e.contact, e.kind) for e in found.events] == [(e.contact, e.kind) for e in native.events]
    assert errors[1] < 5e-4
    assert errors[1] < ITERATED or math.log2(errors[0] / errors[1]) > 1.7


@pytest.mark.parametrize("contacts", [SOFT, RIGID], ids=["compliant", "rigid"])
def test_under_forces_of_the_system_and_a_vanishing_load_a_driven_body_moves_as_a_plain_one(contacts):
    def attach(mbs, node):
        own = mbs.AddMarker(MarkerNodeCoordinate(nodeNumber=node, coordinate=0))
        ground = mbs.AddMarker(MarkerNodeCoordinate(nodeNumber=mbs.AddNode(NodePointGround()), coordinate=0))
        mbs.AddObject(CoordinateSpringDamper(markerNumbers=[ground, own], damping=0.3))
        mbs.AddLoad(
            LoadCoordinate(markerNumber=own, load=3.0, loadUserFunction=lambda mbs, t, load: load * math.cos(2 * t))
        )

    model = model_of(contacts, "all")
    plain, driven = (
        solved(model, loads, 500, matched=True, attach=attach) for loads in ([], [mp.HarmonicLoad("m1", 1e-13, 0.3)])
    )
    assert [(e.contact, e.kind) for e in plain.events] == [(e.contact, e.kind) for e in driven.events]
    assert len(plain.events) >= 4
    assert np.max(np.abs(plain.points["m1"] - driven.points["m1"])) < 1e-9 * np.max(np.abs(plain.points["m1"]))


def test_gaps_and_forces_see_the_moving_stop():
    contacts, modes, loads = CASES["rigid moving stop"]
    model = model_of(contacts, modes)
    native, found = mp.simulate(model, T_END, loads=loads), solved(model, loads, 4000)
    t = np.minimum(found.time, T_END)
    closed = found.closed["below"]
    assert np.max(np.abs(found.gaps["below"][closed])) < 1e-12
    away = np.min(np.abs(t[:, None] - [event.time for event in native.events]), axis=1) > 0.02
    difference = np.abs(found.contact_force["below"] - native.contact_force("below", t))[away]
    assert np.max(difference) < 1e-3 * np.max(native.contact_force("below", t))


def test_a_function_that_replaces_the_loads_is_found_out():
    def replace(mbs):
        mbs.SetPreStepUserFunction(lambda mbs, t: True)

    with pytest.raises(Exception, match="PreStepUserFunction"):
        solved(model_of(SOFT, "all"), [DRIVEN], 100, prepare=replace)


def test_a_step_in_which_a_load_jumps_is_never_taken_for_clear():
    model = model_of(SOFT, "all")
    load = mp.SampledLoad("m2", [0.5, 2.5], [-4.0, -4.0])
    native, found = mp.simulate(model, T_END, loads=[load]), solved(model, [load], 2000)
    assert jump_times(native.segments[0].level.excitation).tolist() == [0.5, 2.5]
    assert [(e.contact, e.kind) for e in found.events] == [(e.contact, e.kind) for e in native.events]


@pytest.mark.parametrize("loads", [(), (mp.HarmonicLoad("ball", 0.01, 1.0),)], ids=["weight", "own loads"])
def test_a_ball_on_its_last_bounce_lands_for_good(loads):
    """The phase is handed on by a start, under loads that vary too: taken for armed, the ball rebounded."""
    structure = mp.LinearStructure([[1.0]], [[0.0]], points={"ball": 0})
    model = mp.MultiPhiModel(structure, [mp.UnilateralContact("floor", "ball", 0.0, restitution=0.5)], modes="all")
    weight = mp.ConstantLoad("ball", -9.81)
    first = mp.simulate(model, 0.6, displacement=[1.0], loads=[weight])
    last = first.ending_in(dataclasses.replace(first.final, phases=(Phase.LANDING,)))
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    items = CreateMultiPhiBody(mbs, model, start=last, loads=[weight, *loads])
    mbs.Assemble()
    with quiet():
        mbs.SolveDynamic(fixed_steps(1.0, 100), solverType=exu.DynamicSolverType.TrapezoidalIndex2)
    found = body_histories(mbs, items)
    assert [event.kind for event in found.events] == ["close"]
    assert found.points["ball"][-1] == pytest.approx(0.0, abs=1e-12)
