"""Loads and stops that vary in time: against integrators, closed forms, and the ledger."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from integrated import integrated
from numpy.testing import assert_allclose
from small_structures import chain, random_model

import multiphi_exudyn as mp
from multiphi_exudyn.time.excitation import Excitation
from multiphi_exudyn.time.loaded_levels import LoadedLevels

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

    def test_sweep(self, damping):
        law = "linear" if damping is None else "logarithmic"
        load = mp.SweepLoad("m1", 1.0, 0.1, 2.0, 20.0, law, tolerance=1e-9)
        self.check(damping, [load], lambda t: math.cos(load.course.phase(np.array([t]))[0]), 1e-9)


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


class TestQuasiStaticCorrection:
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
    levels = LoadedLevels.under(model, Excitation.of(model, [load], 1.0), 0.0, 1.0)
    states = [int(contact.name in closed) for contact in model.contacts]
    static, level = levels.alone.level(states), levels.level(states)
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


class TestEquivalences:
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
