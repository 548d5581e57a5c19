"""Residual boundary: closed contacts act through the flexibility of the modes left out, which has no inertia.

What a run gives is compared with a small model of the same law, with an integrator that knows no levels, and with
statics, which are exact with any number of modes.
"""

import dataclasses
import math

import numpy as np
import pytest
import scipy.linalg
import scipy.optimize
from scipy.integrate import solve_ivp

from multiphi_exudyn import (
    ConstantLoad,
    Friction,
    Harmonic,
    HarmonicLoad,
    LinearStructure,
    ModalDamping,
    MultiPhiError,
    MultiPhiModel,
    StopMotion,
    UnilateralContact,
    simulate,
)
from multiphi_exudyn.study.law_check import broken_laws


def bar(n, damping=None, points=None):
    """A bar of unit length, mass and stiffness of linear elements, fixed at its left end."""
    h = 1 / n
    mass = h / 6 * (4 * np.eye(n) + np.eye(n, k=1) + np.eye(n, k=-1))
    stiffness = 1 / h * (2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))
    mass[-1, -1], stiffness[-1, -1] = h / 3, 1 / h
    return LinearStructure(mass, stiffness, damping, points or {"middle": n // 2, "tip": n - 1})


class SmallModel:
    """The lowest r modes of an undamped structure, and the flexibility F (c, c) of the others at its stops (c,)."""

    def __init__(self, structure, rows, r):
        squares, shapes = scipy.linalg.eigh(structure.stiffness, structure.mass)
        self.squares, self.shapes = squares[:r], shapes[:, :r]
        self.rows = np.array(rows)
        left_out = self.rows @ shapes[:, r:]
        self.flexibility = left_out / squares[r:] @ left_out.T
        self.bending = shapes[:, r:] / squares[r:] @ left_out.T

    def forces(self, gaps, compliances):
        """f >= 0 with (1/k + F) f + gaps >= 0."""
        root = np.linalg.cholesky(self.flexibility + np.diag(compliances)).T
        return scipy.optimize.nnls(root, -np.linalg.solve(root.T, gaps))[0]


class TestAgainstSmallModels:
    @pytest.mark.parametrize("stiffness", [40.0, math.inf])
    @pytest.mark.parametrize("r", [3, 8])
    def test_one_stop_is_a_spring_on_the_modes(self, stiffness, r):
        structure = bar(40)
        small = SmallModel(structure, [structure.row({"tip": -1.0})], r)
        series = 1 / (1 / stiffness + small.flexibility[0, 0])
        modal = LinearStructure(np.eye(r), np.diag(small.squares), None, {"tip": small.rows[0] @ small.shapes})
        plain = MultiPhiModel(modal, [UnilateralContact("stop", "tip", 0.01, series)], modes="all")
        model = MultiPhiModel(
            structure, [UnilateralContact("stop", {"tip": -1.0}, 0.01, stiffness)], modes=r, boundary="residual"
        )
        x0 = structure.row("middle") @ np.linalg.inv(structure.stiffness) * 0.3
        wanted = simulate(plain, 12.0, displacement=small.shapes.T @ structure.mass @ x0)
        found = simulate(model, 12.0, displacement=x0)
        assert found.status == "ok"
        assert len(wanted.events) > 10
        assert [event.kind for event in found.events] == [event.kind for event in wanted.events]
        np.testing.assert_allclose([e.time for e in found.events], [e.time for e in wanted.events], atol=1e-8)
        times = np.linspace(0.0, 12.0, 101)
        force = wanted.contact_force("stop", times)
        x = small.shapes @ wanted.displacement(times) + small.bending * force
        np.testing.assert_allclose(found.displacement(times), x, atol=1e-7 * np.abs(x).max())
        np.testing.assert_allclose(found.contact_force("stop", times), force, atol=1e-6 * force.max())

    @pytest.mark.parametrize("stiffness", [60.0, math.inf])
    def test_several_stops_bend_each_other(self, stiffness):
        structure, r = bar(30, points={f"p{i}": i for i in (9, 11, 20, 29)}), 5
        stops = [UnilateralContact(f"s{i}", f"p{i}", 0.002 * (1 + i / 30), stiffness) for i in (9, 11, 20, 29)]
        small = SmallModel(structure, [structure.row(stop.direction) for stop in stops], r)
        initial, compliances = np.array([stop.gap for stop in stops]), np.full(4, 1 / stiffness)
        x0 = 0.1 * np.sin(np.linspace(0.05, 1.4, 30))
        seen = small.rows @ small.shapes

        def rates(_, state):
            eta, speed = np.split(state, 2)
            force = small.forces(seen @ eta + initial, compliances)
            return np.concatenate([speed, -small.squares * eta + seen.T @ force])

        start = np.concatenate([small.shapes.T @ structure.mass @ x0, np.zeros(r)])
        times = np.linspace(0.0, 3.0, 61)
        reference = solve_ivp(rates, (0.0, 3.0), start, "DOP853", times, rtol=1e-9, atol=1e-12, max_step=0.01)
        model = MultiPhiModel(structure, stops, modes=r, boundary="residual")
        found = simulate(model, 3.0, displacement=x0)
        assert found.status == "ok"
        assert len({event.contact for event in found.events}) == 4
        eta = reference.y[:r]
        forces = np.array([small.forces(seen @ each + initial, compliances) for each in eta.T]).T
        x = small.shapes @ eta + small.bending @ forces
        np.testing.assert_allclose(found.displacement(times), x, atol=1e-5 * np.abs(x).max())
        for stop, force in zip(stops, forces, strict=True):
            np.testing.assert_allclose(found.contact_force(stop.name, times), force, atol=1e-3 * forces.max())

    def test_all_modes_are_own_modes(self):
        structure = bar(20, ModalDamping(0.01))
        stop = UnilateralContact("stop", "tip", 0.01, 50.0)
        x0 = 0.1 * np.linspace(0, 1, 20)
        own, residual = (
            simulate(MultiPhiModel(structure, [stop], modes="all", boundary=boundary), 5.0, displacement=x0)
            for boundary in ("own", "residual")
        )
        np.testing.assert_allclose([e.time for e in residual.events], [e.time for e in own.events], rtol=1e-9)
        np.testing.assert_allclose(residual.displacement(5.0), own.displacement(5.0), atol=1e-9)


class TestStatics:
    @pytest.mark.parametrize("stiffness", [40.0, math.inf])
    @pytest.mark.parametrize("r", [1, 4])
    def test_rests_on_its_stops_exactly(self, stiffness, r):
        structure = bar(40, ModalDamping(0.02))
        stops = [UnilateralContact("a", "middle", 0.01, stiffness), UnilateralContact("b", "tip", 0.03, stiffness)]
        model = MultiPhiModel(structure, stops, modes=r, boundary="residual")
        rest = model.static_equilibrium({"middle": -0.2, "tip": -0.1})
        found = simulate(
            model, 20.0, loads=[ConstantLoad("middle", -0.2), ConstantLoad("tip", -0.1)], displacement=rest
        )
        assert found.status == "ok"
        assert not found.events
        whole = MultiPhiModel(structure, stops, modes="all").static_equilibrium({"middle": -0.2, "tip": -0.1})
        np.testing.assert_allclose(found.displacement(20.0), whole, atol=1e-12)

    def test_a_moved_stop_bends_the_structure_at_once(self):
        structure = bar(40, ModalDamping(0.5))
        stop = UnilateralContact("stop", "tip", 0.0)
        model = MultiPhiModel(structure, [stop], modes=3, boundary="residual")
        push = StopMotion("stop", Harmonic(0.01, 0.001))
        found = simulate(model, 300.0, loads=[ConstantLoad("tip", -1.0), push])
        assert found.status == "ok"
        assert abs(found.ledger.residual) < 1e-9 * abs(found.ledger.work_of_loads)
        np.testing.assert_allclose(found.gap("stop", np.linspace(100, 300, 11)), 0.0, atol=1e-12)


class TestEnergies:
    def test_no_contact_of_many_takes_any(self):
        structure, along = bar(100), np.arange(1, 101) / 100
        stop = UnilateralContact("stop", "tip", 0.2)
        model = MultiPhiModel(structure, [stop], modes=6, boundary="residual")
        found = simulate(model, 2000.0, displacement=0.45 * along)
        assert found.status == "ok"
        assert len(found.events) > 1000
        energies = found.energy(np.linspace(0.0, 2000.0, 401))
        assert np.abs(energies / energies[0] - 1).max() < 1e-12
        assert found.ledger.impact == 0.0

    def test_balance_with_damping_and_loads(self):
        structure = bar(30, ModalDamping(0.01))
        stops = [UnilateralContact("a", "middle", 0.01), UnilateralContact("b", "tip", 0.02, 80.0)]
        loads = [ConstantLoad("tip", -0.02), HarmonicLoad("middle", 0.1, 0.4), StopMotion("a", Harmonic(0.004, 0.7))]
        found = simulate(MultiPhiModel(structure, stops, modes=6, boundary="residual"), 30.0, loads=loads)
        assert found.status == "ok"
        assert len(found.events) > 20
        turned_over = found.ledger.damping + abs(found.ledger.work_of_loads)
        assert abs(found.ledger.residual) < 1e-9 * turned_over
        assert not any(warning.startswith("ledger") for warning in found.warnings)


class TestTheJudge:
    @pytest.mark.parametrize("stiffness", [60.0, math.inf])
    def test_finds_no_law_broken(self, stiffness):
        structure = bar(30, ModalDamping(0.01), points={f"p{i}": i for i in (9, 20, 29)})
        stops = [UnilateralContact(f"s{i}", f"p{i}", 0.01, stiffness) for i in (9, 20, 29)]
        x0 = 0.1 * np.sin(np.linspace(0.05, 1.4, 30))
        found = simulate(MultiPhiModel(structure, stops, modes=6, boundary="residual"), 3.0, displacement=x0)
        assert broken_laws(found) == []


class TestFreeBodies:
    def test_a_bar_bounces_on_a_rigid_floor(self):
        n = 60
        mass = np.zeros((n + 1, n + 1))
        stiffness = np.zeros((n + 1, n + 1))
        h = 1 / n
        for i in range(n):
            mass[i : i + 2, i : i + 2] += h / 6 * np.array([[2, 1], [1, 2]])
            stiffness[i : i + 2, i : i + 2] += 1 / h * np.array([[1, -1], [-1, 1]])
        structure = LinearStructure(mass, stiffness, None, {"foot": 0, "head": n})
        floor = UnilateralContact("floor", "foot", 0.3)
        model = MultiPhiModel(structure, [floor], modes=24, boundary="residual")
        found = simulate(model, 2.6, velocity=np.full(n + 1, -1.0))
        # the wave goes up and back, a force of one from 0.3 to 2.3 s; then the whole bar leaves with its speed
        intervals = found.contact_intervals("floor")
        assert intervals[0][0] == pytest.approx(0.3, abs=1e-9)
        assert intervals[-1][1] < 2.4
        assert found.contact_force("floor", 1.3) == pytest.approx(1.0, abs=0.1)
        assert mass.sum(axis=0) @ found.velocity(2.6) == pytest.approx(1.0, abs=0.02)
        assert found.ledger.impact == 0.0


class TestWhatIsRefused:
    @pytest.mark.parametrize(
        ("given", "named"),
        [
            ({"stiffness": 10.0, "damping": 0.1}, "damping"),
            ({"friction": 0.2, "tangential": "middle"}, "friction"),
            ({"restitution": 0.5}, "restitution"),
        ],
    )
    def test_by_name(self, given, named):
        stop = UnilateralContact("stop", "tip", 0.01, **given)
        with pytest.raises(MultiPhiError, match=f"boundary of 'stop': got 'residual' beside its {named}"):
            MultiPhiModel(bar(10), [stop], modes=3, boundary="residual")

    def test_other_elements_and_names(self):
        rub = Friction("rub", "middle", 0.1)
        with pytest.raises(MultiPhiError, match="rub"):
            MultiPhiModel(bar(10), [rub], modes=3, boundary={"rub": "residual"})
        with pytest.raises(MultiPhiError, match="need 'own', 'residual' or None"):
            MultiPhiModel(bar(10), [rub], modes=3, boundary="massless")
        with pytest.raises(MultiPhiError, match="'tap'"):
            MultiPhiModel(bar(10), [rub], modes=3, boundary={"tap": "own"})

    def test_a_rigid_stop_where_no_mode_is_left_out(self):
        model = MultiPhiModel(bar(10), [UnilateralContact("stop", "tip", 0.0)], modes="all", boundary="residual")
        with pytest.raises(MultiPhiError, match="boundary of 'stop'"):
            simulate(model, 1.0, velocity=-np.ones(10))


class TestChoice:
    def test_many_contacts_of_a_truncated_model_are_residual(self):
        structure = bar(601, points={f"p{i}": i for i in range(60)})
        stops = [UnilateralContact(f"s{i}", f"p{i}", 0.01, 100.0) for i in range(0, 60, 2)]
        assert set(MultiPhiModel(structure, stops, modes=8).boundaries.values()) == {"residual"}
        assert set(MultiPhiModel(structure, stops, modes="all").boundaries.values()) == {"own"}
        assert set(MultiPhiModel(structure, stops[:3], modes=8).boundaries.values()) == {"own"}
        small = bar(60, points={f"p{i}": i for i in range(60)})
        assert set(MultiPhiModel(small, stops, modes=8).boundaries.values()) == {"own"}
        mixed = MultiPhiModel(structure, stops[:3], modes=8, boundary={"s2": "residual"})
        assert mixed.boundaries == {"s0": "own", "s2": "residual", "s4": "own"}
        again = dataclasses.replace(mixed, boundary="own")
        assert set(again.boundaries.values()) == {"own"}

    def test_own_and_residual_stops_in_one_model(self):
        structure = bar(40, points={"a": 15, "b": 27, "tip": 39})
        stops = [UnilateralContact(name, name, 0.01, 60.0) for name in ("a", "b", "tip")]
        x0 = 0.1 * np.sin(np.linspace(0.05, 1.4, 40))
        runs = [
            simulate(MultiPhiModel(structure, stops, modes=r, boundary={"b": "residual"}), 3.0, displacement=x0)
            for r in (10, 40)
        ]
        assert [run.status for run in runs] == ["ok", "ok"]
        error = runs[0].at("tip", np.linspace(0, 3, 61)) - runs[1].at("tip", np.linspace(0, 3, 61))
        assert np.abs(error).max() < 0.02 * 0.1
