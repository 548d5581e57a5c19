"""Loads and stops that vary in time: against integrators, closed forms, and the ledger."""

import math
from dataclasses import replace

import numpy as np
import pytest
import scipy.interpolate
from hypothesis import example, given, settings
from hypothesis import strategies as st
from integrated import integrated
from numpy.testing import assert_allclose
from small_structures import chain, random_model

import multiphi_exudyn as mp
from multiphi_exudyn.events.excitation.excitation import Excitation
from multiphi_exudyn.events.excitation.loaded_level import LoadedLevel

TIMES = np.linspace(0.0, 20.0, 101)
PLACE = np.eye(3)[1]
DAMPING = np.diag([0.1, 0.05, 0.2])
STOPS = (mp.UnilateralContact("below", "m2", 0.1, 50.0), mp.UnilateralContact("above", {"m0": -1.0}, 0.15, 30.0))


def relative(found, expected):
    return np.max(np.abs(found - expected)) / np.max(np.abs(expected))


def closes(run):
    ledger = run.ledger
    return abs(ledger.residual) <= 1e-10 * max(abs(ledger.work_of_loads), ledger.initial, ledger.final)


@pytest.mark.parametrize("damping", [None, DAMPING], ids=["undamped", "coupled"])
class TestAgainstAnIntegratorAt1e12:
    def structure(self, damping):
        return chain(3, damping=damping, stiffness=10.0)

    def check(self, damping, loads, force, tolerance, t_end=10.0, **given):
        structure, times = self.structure(damping), TIMES[t_end >= TIMES]
        run = mp.simulate(mp.MultiPhiModel(structure, [], modes="all"), t_end, loads=loads)
        expected, _ = integrated(structure, times, lambda t: PLACE * force(t), **given)
        assert run.status == "ok"
        assert not run.message
        assert relative(run.displacement(times), expected) < tolerance
        assert closes(run)
        return run

    def test_harmonic(self, damping):
        load = mp.HarmonicLoad("m1", 2.0, 0.3, 0.4)
        run = self.check(damping, [load], lambda t: 2 * math.cos(2 * math.pi * 0.3 * t + 0.4), 1e-10)
        assert len(run.segments) == 1

    def test_resonance(self, damping):
        omega = float(mp.MultiPhiModel(self.structure(damping), [], modes="all").level(()).omega[1])
        load = mp.HarmonicLoad("m1", 2.0, omega / (2 * math.pi))
        self.check(damping, [load], lambda t: 2 * math.cos(omega * t), 1e-10)

    def test_sum_of_harmonics_and_a_constant(self, damping):
        loads = [mp.HarmonicLoad("m1", 2.0, 0.3), mp.HarmonicLoad("m1", 1.0, 0.5, 1.0), mp.ConstantLoad("m1", 1.5)]
        self.check(damping, loads, lambda t: 2 * math.cos(0.6 * math.pi * t) + math.cos(math.pi * t + 1) + 1.5, 1e-10)

    def test_sampled(self, damping):
        times, forces = np.linspace(0.0, 7.5, 31), np.random.default_rng(0).normal(size=31)
        load = mp.SampledLoad("m1", times, forces)
        self.check(damping, [load], lambda t: np.interp(t, times, forces, right=0.0), 1e-10, breaks=times, longest=0.25)

    def test_sweep(self, damping):
        law = "linear" if damping is None else "logarithmic"
        load = mp.SweepLoad("m1", 1.0, 0.1, 2.0, 20.0, law, tolerance=1e-9)
        self.check(damping, [load], lambda t: math.cos(load.course.phase(np.array([t]))[0]), 1e-9)

    def test_smooth_function(self, damping):
        load = mp.FunctionLoad("m1", lambda t: np.exp(-t) * np.sin(7 * t), tolerance=1e-9)
        self.check(damping, [load], lambda t: math.exp(-t) * math.sin(7 * t), 1e-9, t_end=20.0)


class TestContactsUnderLoads:
    def check(self, loads, force, moved=lambda t, i: 0.0):
        structure, times = chain(3, damping=DAMPING, stiffness=10.0), TIMES[:51]
        run = mp.simulate(mp.MultiPhiModel(structure, STOPS, modes="all"), 10.0, loads=loads)
        expected, events = integrated(structure, times, force, contacts=STOPS, moved=moved)
        assert relative(run.displacement(times), expected) < 1e-10
        assert_allclose([event.time for event in run.events], events, atol=1e-10)
        assert len(events) > 10
        assert closes(run)

    def test_harmonic(self):
        self.check([mp.HarmonicLoad("m1", 2.0, 0.3)], lambda t: PLACE * 2 * math.cos(0.6 * math.pi * t))

    def test_moving_stop(self):
        loads = [mp.StopMotion("below", mp.Harmonic(0.1, 0.7, -math.pi / 2)), mp.HarmonicLoad("m1", 2.0, 0.3)]
        self.check(
            loads,
            lambda t: PLACE * 2 * math.cos(0.6 * math.pi * t),
            lambda t, i: 0.1 * math.sin(1.4 * math.pi * t) if i == 0 else 0.0,
        )

    def test_moving_base_with_a_stop_that_stays(self):
        rate = 1.4 * math.pi
        base = mp.BaseMotion(np.ones(3), mp.Harmonic(0.1, 0.7, -math.pi / 2), fixed_stops=("below",))
        self.check(
            [base],
            lambda t: np.ones(3) * 0.1 * rate**2 * math.sin(rate * t),
            lambda t, i: -0.1 * math.sin(rate * t) if i == 0 else 0.0,
        )

    @pytest.mark.parametrize("stays", [False, True])
    def test_base_with_an_accelerogram(self, stays):
        """A record in g from before the run until its middle; the base then moves on, and a stop may not follow it."""
        time = np.linspace(-0.5, 6.0, 27)
        values = 0.3 * np.sin(3 * time)
        course = mp.Accelerogram(time, values, factor=9.81)
        moved = scipy.interpolate.make_interp_spline(time, 9.81 * values, k=1).antiderivative(2)
        rate = moved.derivative()

        def way(t):
            return float(moved(min(t, 6.0)) + max(t - 6.0, 0.0) * rate(6.0))

        assert_allclose(course.displacement(TIMES), [way(t) for t in TIMES], rtol=1e-12, atol=1e-14)
        self.check(
            [mp.BaseMotion(np.ones(3), course, fixed_stops=("below",) if stays else ())],
            lambda t: -np.ones(3) * np.interp(t, time, 9.81 * values, 0.0, 0.0),
            lambda t, i: -way(t) if i == 0 and stays else 0.0,
        )

    def test_an_accelerogram_is_a_force_on_every_mass(self):
        time, values = np.linspace(0.3, 4.0, 40), np.random.default_rng(3).normal(size=40)
        structure = chain(3, damping=DAMPING, stiffness=10.0)
        model = mp.MultiPhiModel(structure, [mp.UnilateralContact("below", "m2", 0.05, 300.0)], modes="all")
        base = mp.BaseMotion(np.ones(3), mp.Accelerogram(time, values, factor=0.01))
        force = mp.SampledLoad(-structure.mass @ np.ones(3), time, 0.01 * values)
        first, second = (mp.simulate(model, 8.0, loads=[load]) for load in (base, force))
        assert_allclose(first.displacement(TIMES[:41]), second.displacement(TIMES[:41]), rtol=1e-12, atol=1e-14)

    @pytest.mark.parametrize("law", ["linear", "logarithmic"])
    def test_base_that_sweeps(self, law):
        course = mp.Sweep(0.05, 0.2, 1.5, 10.5, law)

        def acceleration(t):
            step = 1e-4
            near = np.cos(course.phase(np.array([t - step, t, t + step])))
            return 0.05 * (near[0] - 2 * near[1] + near[2]) / step**2

        structure, times = chain(3, damping=DAMPING, stiffness=10.0), TIMES[:51]
        run = mp.simulate(mp.MultiPhiModel(structure, [], modes="all"), 10.0, loads=[mp.BaseMotion(np.ones(3), course)])
        exact = course.acceleration(10.5)
        assert_allclose(exact.at(times), [acceleration(t) for t in times], rtol=1e-5, atol=1e-5)
        expected, _ = integrated(structure, times, lambda t: -np.ones(3) * exact.at(np.array([t]))[0])
        assert not run.message
        assert relative(run.displacement(times), expected) < 1e-9

    def test_a_load_that_jumps_lets_a_contact_open_at_once(self):
        """A rigid contact pressed by 5 N on it alone opens at the instant at which that load ends."""
        structure = chain(2, stiffness=10.0)
        model = mp.MultiPhiModel(structure, [mp.UnilateralContact("stop", "m1", 0.0)], modes="all")
        loads = [mp.SampledLoad("m1", [0.0, 1.5], [-5.0, -5.0]), mp.ConstantLoad("m1", 1.0)]
        run = mp.simulate(model, 1.7, loads=loads)
        assert [(event.kind, event.time) for event in run.events] == [("close", 0.0), ("open", 1.5)]
        assert_allclose(run.contact_force("stop", np.linspace(0, 1.49, 20)), 4.0)
        assert closes(run)


class TestRigidStopThatMoves:
    def test_a_mass_rides_on_it_and_leaves_it_where_its_acceleration_is_that_of_gravity(self):
        ball = mp.LinearStructure([[2.0]], [[0.0]], points={"m": 0})
        model, rate = mp.MultiPhiModel(ball, [mp.UnilateralContact("table", "m", 0.0)], modes="all"), 2 * math.pi
        weight = mp.Gravity({"m": 1.0}, -9.81)
        t = np.linspace(0, 3, 301)

        gentle = mp.StopMotion("table", mp.Harmonic(0.1, 1.0, -math.pi / 2))
        run = mp.simulate(model, 3.0, velocity=[0.1 * rate], loads=[weight, gentle])
        assert [event.kind for event in run.events] == ["close"]
        assert_allclose(run.at("m", t), 0.1 * np.sin(rate * t), atol=1e-14)
        assert_allclose(run.contact_force("table", t), 2 * (9.81 - 0.1 * rate**2 * np.sin(rate * t)), atol=1e-12)
        assert closes(run)

        hard = mp.StopMotion("table", mp.Harmonic(0.4, 1.0, -math.pi / 2))
        run = mp.simulate(model, 3.0, velocity=[0.4 * rate], loads=[weight, hard])
        assert_allclose(run.events[1].time, math.asin(9.81 / 0.4 / rate**2) / rate, rtol=1e-12)
        assert np.min(run.gap("table", t)) > -1e-13
        assert run.ledger.impact > 10.0  # the table feeds every impact
        assert closes(run)

    @pytest.mark.parametrize("damping", [None, DAMPING], ids=["undamped", "coupled"])
    def test_closed_it_prescribes_a_boundary_value(self, damping):
        """x_k(t) of eq. (38.4): the other masses move as under a prescribed displacement of the last one."""
        structure, rate = chain(3, damping=damping, stiffness=10.0), math.pi
        model = mp.MultiPhiModel(structure, [mp.UnilateralContact("stop", "m2", 0.0)], modes="all")
        shaken = mp.StopMotion("stop", mp.Harmonic(0.05, 0.5, -math.pi / 2))
        run = mp.simulate(model, 4.0, velocity=[0, 0, 0.05 * rate], loads=[mp.ConstantLoad("m2", -5.0), shaken])
        inner = mp.LinearStructure(
            np.eye(2), structure.stiffness[:2, :2], damping=None if damping is None else DAMPING[:2, :2]
        )
        times = TIMES[:21]
        expected, _ = integrated(inner, times, lambda t: np.array([0.0, 10 * 0.05 * math.sin(rate * t)]))
        assert_allclose(run.displacement(times)[:2], expected, atol=1e-11)
        assert_allclose(run.displacement(times)[2], 0.05 * np.sin(rate * times), atol=1e-14)
        x, v, a = run.displacement(times), run.velocity(times), run.acceleration(times)
        held = a[2] + (0.0 if damping is None else DAMPING[2, 2]) * v[2] + structure.stiffness[2] @ x + 5.0
        assert_allclose(run.contact_force("stop", times), held, atol=1e-12)
        assert closes(run)

    def test_sampled_motion_is_refused_for_a_rigid_stop(self):
        model = mp.MultiPhiModel(chain(2), [mp.UnilateralContact("stop", "m1", 0.0)], modes="all")
        with pytest.raises(mp.MultiPhiTypeError, match=r"rigid contact 'stop'.*Smooth"):
            mp.simulate(model, 1.0, loads=[mp.StopMotion("stop", mp.Sampled([0, 1], [0, 1]))])


class TestQuasiStaticCorrection:
    def test_a_slow_load_is_answered_statically_with_one_mode(self):
        structure = chain(6, stiffness=100.0)
        model = mp.MultiPhiModel(structure, [], modes=1)
        run = mp.simulate(model, 1000.0, loads=[mp.HarmonicLoad("m2", 1.0, 1e-3, -math.pi / 2)])
        exact = np.linalg.solve(structure.stiffness, np.eye(6)[2])
        assert_allclose(run.displacement(250.0), exact, rtol=2e-3)  # 1.5e-3 is what the start leaves ringing

    def test_it_converges_with_the_modes_where_the_load_is_below_the_cut_off(self):
        structure = chain(8, stiffness=100.0)
        load = mp.HarmonicLoad("m2", 1.0, 0.1)
        exact = mp.simulate(mp.MultiPhiModel(structure, [], modes="all"), 10.0, loads=[load]).displacement(TIMES[:40])
        errors = [
            relative(
                mp.simulate(mp.MultiPhiModel(structure, [], modes=r), 10.0, loads=[load]).displacement(TIMES[:40]),
                exact,
            )
            for r in (2, 4, 6)
        ]
        assert errors[0] < 0.15
        assert errors[2] < errors[1] < errors[0]


def driven(model, closed, load):
    """A level under a load that varies, and what of xi = (eta, w) it is at rest in while w = 1."""
    static = LoadedLevel.of(model.level(closed), np.zeros(model.base.modes.count))
    level = static.under(Excitation.of(model, [load], 1.0))
    return level, np.concatenate(
        [level.channels.force[:, 0] / static.level.squares, np.eye(level.excitation.channels)[0]]
    )


class TestAtRestUnderWhatVaries:
    @pytest.mark.parametrize("stiffness", [1.0, 1e6, 1e9, 1e12])
    @pytest.mark.parametrize("modes", [2, "all"])
    def test_a_stop_that_has_moved_pushes_as_hard_as_its_spring_says(self, stiffness, modes):
        structure = chain(6, stiffness=100.0)
        model = mp.MultiPhiModel(structure, [mp.UnilateralContact("stop", "m2", 0.0, stiffness)], modes)
        level, xi = driven(model, ("stop",), mp.StopMotion("stop", mp.Harmonic(1.0, 1.0)))
        bent = np.linalg.solve(structure.stiffness, np.eye(6)[2])
        force = 1 / (1 / stiffness + bent[2])
        assert_allclose(model.base.modes.shapes @ level.configuration(xi), force * bent, rtol=1e-13)
        assert_allclose(level.level.force_rows @ xi, [force], rtol=max(1e-13, 1e-16 * stiffness))

    @pytest.mark.parametrize("stiffness", [0.1, 1e-3, 1e-6, 1e-10])
    def test_a_closed_rigid_contact_does_not_move_however_soft_the_level_is(self, stiffness):
        """Nor does its twin: three masses hang on the one that is held by a soft spring."""
        strain = np.diff(np.eye(5), axis=0)
        springs = strain.T @ np.diag([7.0, stiffness, 7.0, 7.0]) @ strain + 7.0 * np.diag([1, 0, 0, 0, 0])
        structure = mp.LinearStructure(np.eye(5), springs, points={f"m{i}": i for i in range(5)})
        stops = [mp.UnilateralContact("one", "m1", 0.0), mp.UnilateralContact("twin", {"m1": -1.0}, 0.0)]
        model = mp.MultiPhiModel(structure, stops, "all")
        for at, force in (("m0", -0.5), ("m2", -1.0), ("m4", -1.0)):
            level, xi = driven(model, ("one",), mp.HarmonicLoad(at, 1.0, 0.0))
            assert not np.any(level.level.gap_rows)
            assert np.max(np.abs(level.level.vectors[:, -1])) < 1e-14  # every mode is kept: nothing is left to statics
            assert_allclose(level.level.force_rows @ xi, [force], rtol=max(1e-12, 1e-14 / stiffness))

    def test_overridden_frequencies_leave_the_static_deflection_as_it_is(self):
        """A load that is constant is one load, static or varying."""
        override = {(): mp.LevelOverride([0.05, 0.1])}
        model = mp.MultiPhiModel(chain(3, stiffness=10.0), [], "all", override)
        constant, varying = (
            mp.simulate(model, 20.0, loads=[load])
            for load in (mp.ConstantLoad("m1", 2.0), mp.HarmonicLoad("m1", 2.0, 0.0))
        )
        assert_allclose(varying.displacement(TIMES), constant.displacement(TIMES), atol=1e-12)


class TestSmoothLoadsHoldTheirToleranceInTheResponse:
    def test_a_loose_tolerance_costs_fewer_pieces_and_still_holds(self):
        structure = chain(3, damping=DAMPING, stiffness=10.0)
        model = mp.MultiPhiModel(structure, [], modes="all")
        exact, _ = integrated(structure, TIMES, lambda t: PLACE * math.sin(t**2 / 4))
        pieces = []
        for tolerance in (1e-3, 1e-6, 1e-9):
            run = mp.simulate(model, 20.0, loads=[mp.FunctionLoad("m1", lambda t: np.sin(t**2 / 4), tolerance)])
            assert relative(run.displacement(TIMES), exact) < tolerance
            pieces.append(len(run.segments))
        assert pieces[0] <= pieces[1] < pieces[2]

    def test_what_cannot_be_certified_is_said(self):
        """A response far smaller than the load's size: round-off of the load is all that can be promised."""
        structure = mp.LinearStructure([[1.0]], [[1.0]], points={"m": 0})
        load = mp.FunctionLoad("m", lambda t: np.cos(300 * t), tolerance=1e-12)
        run = mp.simulate(mp.MultiPhiModel(structure, [], modes="all"), 0.5, loads=[load])
        assert run.status == "ok"
        assert "accurate to" in run.message

    @pytest.mark.parametrize("load", [mp.FunctionLoad("m", np.sin), mp.SweepLoad("m", 1.0, 1.0, 5.0, 1.0)])
    def test_a_run_that_fails_at_its_start_tells_why_and_has_no_ledger(self, load):
        """A spring of negative stiffness cancels that of a mode beside a rigid contact that is pressed on."""
        structure = mp.LinearStructure(np.eye(2), np.eye(2), points={"m": 0, "n": 1})
        contacts = [mp.ForceLaw("m", ([-1.0, 0.0, 1.0], [1.0, 0.0, -1.0])), mp.UnilateralContact("stop", "n", 0.0)]
        given = [load, mp.ConstantLoad("n", -1.0)]
        run = mp.simulate(mp.MultiPhiModel(structure, contacts, modes="all"), 1.0, displacement=[0.1, 0.0], loads=given)
        assert run.status == "failed"
        assert run.message.startswith("at t = 0 s: level stop: negative stiffness cancels that of a mode")
        assert (run.t_end, len(run.segments), run.final) == (0.0, 0, None)
        with pytest.raises(mp.NumericalFailure, match=r"ledger: got a run without motion .*cancels"):
            _ = run.ledger


class TestEquivalences:
    @given(seed=st.integers(0, 10**6), kind=st.sampled_from(["mixed", "rigid"]))
    @settings(max_examples=25)
    @example(seed=4593, kind="rigid")  # comes to rest at its stop where no force presses it
    @example(seed=471909, kind="rigid")  # two instants at which a contact without force may open and close
    def test_a_harmonic_of_frequency_zero_is_a_constant_load(self, seed, kind):
        """With all modes: those left out follow a load that varies statically, and a constant one is part of x_inf."""
        model, random = random_model(seed, damping="modal", kind=kind)
        model = replace(model, modes="all")
        amplitude, x0 = float(random.normal()), np.zeros(model.structure.n)
        constant = mp.simulate(model, 3.0, x0, loads=[mp.ConstantLoad("m0", amplitude)])
        varying = mp.simulate(model, 3.0, x0, loads=[mp.HarmonicLoad("m0", amplitude, 0.0)])
        assert constant.status == varying.status == "ok"
        t = np.linspace(0, 3.0, 50)
        assert_allclose(varying.displacement(t), constant.displacement(t), atol=1e-8)
        for contact in model.contacts:
            pushed = [run.contact_impulse(contact.name, 0.0, 3.0) for run in (varying, constant)]
            assert pushed[0] == pytest.approx(pushed[1], abs=1e-8)

    @given(seed=st.integers(0, 10**6))
    @settings(max_examples=25)
    def test_the_ledger_closes_in_truncated_models_with_every_kind_of_load(self, seed):
        model, random = random_model(seed, damping="modal")
        name = model.contacts[0].name
        loads = [
            mp.HarmonicLoad("m0", float(random.normal()), 0.7),
            mp.SampledLoad("m1", np.linspace(0, 2, 9), random.normal(size=9)),
            mp.StopMotion(name, mp.Harmonic(0.05, 0.4, -math.pi / 2)),
            mp.ConstantLoad("m2", float(random.normal())),
        ]
        run = mp.simulate(model, 3.0, loads=loads)
        if run.segments:
            largest = max(run.ledger.initial, abs(run.ledger.work_of_loads), run.ledger.final, run.ledger.impact)
            assert abs(run.ledger.residual) <= 1e-9 * largest + 1e-15
            assert run.ledger.impact >= -1e-12 * largest

    def test_a_restart_goes_on(self):
        """Two halves are one run: the second one's load starts with the phase that the first one's ended with."""
        model = mp.MultiPhiModel(chain(3, damping=DAMPING, stiffness=10.0), STOPS, modes="all")
        whole = mp.simulate(model, 8.0, loads=[mp.HarmonicLoad("m1", 2.0, 0.3)])
        first = mp.simulate(model, 4.0, loads=[mp.HarmonicLoad("m1", 2.0, 0.3)])
        later = mp.HarmonicLoad("m1", 2.0, 0.3, 2 * math.pi * 0.3 * 4.0)
        second = mp.simulate(model, 4.0, first.displacement(4.0), first.velocity(4.0), [later])
        t = np.linspace(0, 4, 41)
        assert_allclose(second.displacement(t), whole.displacement(t + 4.0), atol=1e-11)


@pytest.mark.parametrize("resistance", [1e-9, 1e-6, 1e-4, 1.0])
def test_little_damping_of_a_rigid_body_under_a_constant_load_costs_no_accuracy(resistance):
    ball = mp.LinearStructure([[2.0]], [[0.0]], damping=[[2.0 * resistance]], points={"m": 0})
    run = mp.simulate(mp.MultiPhiModel(ball, [], modes="all"), 3.0, loads=[mp.Gravity({"m": 1.0}, -10.0)])
    for t in (1e-3, 0.1, 3.0):
        x = resistance * t
        fallen = -10 * t**2 * (0.5 - x / 6 + x**2 / 24 - x**3 / 120) if x < 1e-3 else None
        exact = fallen if fallen is not None else -10 * (t + np.expm1(-x) / resistance) / resistance
        assert_allclose(run.at("m", t), exact, rtol=1e-11, atol=1e-15)  # of terms of some 10 m
    assert abs(run.ledger.residual) < 1e-12 * run.ledger.work_of_loads


def test_a_sweep_of_thousands_of_cycles_is_no_failure_though_its_phase_is_known_to_round_off_only():
    """2 to 250 Hz in 60 s: 47500 rad."""
    structure = chain(2, damping=mp.ModalDamping([0.1, 0.1]), stiffness=1e4)
    run = mp.simulate(mp.MultiPhiModel(structure, modes="all"), 61.0, loads=[mp.SweepLoad("m1", 1.0, 2, 250, 60.0)])
    assert run.status == "ok"
    assert "smooth loads: the response is accurate to" in run.message
    assert len(run.segments) < 2000


def test_displacements_of_an_accelerogram_are_those_of_their_times():
    record = mp.Accelerogram([0.0, 0.1, 0.2, 0.3], [0.0, 0.8, -0.8, 0.0], factor=9.81)
    assert float(record.displacement(0.1)) == pytest.approx(9.81 * 0.8 * 0.1**2 / 6)
    assert np.shape(record.displacement(0.1)) == ()
    assert record.displacement([0.2, 0.1]) == pytest.approx([float(record.displacement(t)) for t in (0.2, 0.1)])


@pytest.mark.parametrize("times", ["x", None, 1j, [np.nan], [[0.1]], ["a"]])
def test_displacements_of_an_accelerogram_at_what_is_no_time_are_refused(times):
    with pytest.raises(mp.MultiPhiError, match=r"^t: got "):
        mp.Accelerogram([0.0, 1.0], [0.0, 1.0]).displacement(times)


@pytest.mark.parametrize(("largest", "factor"), [(1e308, 9.81), (1e300, 10**300), (-1e300, -1e300)])
def test_accelerations_that_overflow_are_refused_with_the_factor(largest, factor):
    with pytest.raises(mp.MultiPhiValueError, match=r"accelerogram factor: got .* need finite accelerations"):
        mp.Accelerogram([0.0, 1.0], [largest, -largest], factor=factor)


def test_a_base_motion_names_the_courses_that_it_takes():
    with pytest.raises(mp.MultiPhiTypeError, match=r"got NoneType, need Harmonic, Smooth, Sweep or Accelerogram$"):
        mp.BaseMotion([1.0], None)
