"""The rig and small scenes: accuracy of truncated levels, energy, equivalences, adversarial starts."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import multiphi_exudyn as mp
from reference_models.rig import rig_beam, rig_contact, rig_damping

TIP = 0.020


def rig_model(stiffness, modes, elements=57, damping=None):
    structure = mp.planar_beam(rig_beam(), elements=elements, damping=damping)
    return mp.MultiPhiModel(structure, [rig_contact(stiffness)], modes=modes)


def pulled(model, tip=TIP):
    unit = model.static_equilibrium({"node3": 1e-3})
    return unit * tip / float(model.structure.row("node3") @ unit)


def nrmse(run, reference, point, end):
    t = np.linspace(0, end, 3001)
    return np.linalg.norm(run.at(point, t) - reference.at(point, t)) / np.linalg.norm(reference.at(point, t))


def chain(contacts, modes="all", damping=None, scale=(1.0, 1.0)):
    """Four masses in a row, fixed at one side; scale: units of (mass, stiffness)."""
    mass = np.diag([1.0, 0.7, 1.3, 0.5]) * scale[0]
    stiffness = (np.diag([2200.0, 1900.0, 1700.0, 800.0]) - np.diag([900.0] * 3, 1) - np.diag([900.0] * 3, -1)) * scale[
        1
    ]
    structure = mp.LinearStructure(mass, stiffness, damping, {f"m{i}": i for i in range(4)})
    return mp.MultiPhiModel(structure, contacts, modes=modes)


class TestTruncationOnTheRig:
    END = 0.3

    @pytest.fixture(scope="class")
    @classmethod
    def rigid(cls):
        model = rig_model(math.inf, "all")
        return mp.simulate(model, cls.END, displacement=pulled(model))

    @pytest.fixture(scope="class")
    @classmethod
    def compliant(cls):
        model = rig_model(1e6, "all")
        return mp.simulate(model, cls.END, displacement=pulled(model))

    @pytest.mark.parametrize("modes", [6, 8, 12, 24])
    def test_rigid_levels_stay_near_all_modes(self, rigid, modes):
        model = dataclasses.replace(rigid.model, modes=modes)
        run = mp.simulate(model, self.END, displacement=pulled(model))
        assert max(nrmse(run, rigid, point, self.END) for point in ("node2", "node3")) < 0.03

    def test_rigid_levels_are_the_limit_of_stiffness(self, rigid):
        errors = []
        for stiffness in (1e6, 1e7, 1e8):
            model = rig_model(stiffness, "all")
            run = mp.simulate(model, 0.1, displacement=pulled(model))
            errors.append(nrmse(run, rigid, "node3", 0.1))
        assert errors[0] > errors[1] > errors[2]

    @pytest.mark.parametrize("modes", [4, 6, 8, 12, 24])
    def test_a_rigid_support_never_pulls(self, modes):
        model = rig_model(math.inf, modes, damping=rig_damping())
        run = mp.simulate(model, self.END, displacement=pulled(model))
        forces = [
            run.contact_force("support", np.linspace(a, b, 40)[1:-1]) for a, b in run.contact_intervals("support")
        ]
        assert min(np.min(force) for force in forces) > -1e-9 * max(np.max(force) for force in forces)
        assert run.deepest_gap("support") > -2e-5
        t = np.linspace(0, self.END, 20001)
        assert np.min(run.gap("support", t)) > -2e-5


class TestEnergy:
    @pytest.mark.parametrize("damping", [None, rig_damping(), mp.RayleighDamping(0.5, 1e-6)])
    @pytest.mark.parametrize("stiffness", [math.inf, 1e6])
    @pytest.mark.parametrize("modes", [4, 9])
    def test_ledger_closes_on_the_rig(self, damping, stiffness, modes):
        model = rig_model(stiffness, modes, elements=20, damping=damping)
        ledger = mp.simulate(model, 0.5, displacement=pulled(model)).ledger
        assert abs(ledger.residual) < 1e-10 * ledger.initial
        assert min(ledger.impact, ledger.truncation_kinetic, ledger.truncation_strain, ledger.damping) > -1e-12

    def test_energy_agrees_with_the_full_matrices(self):
        model = chain([mp.UnilateralContact("stop", "m3", 0.01, 5e3)])
        run = mp.simulate(model, 1.0, displacement=[0.0, 0.02, 0.03, 0.05])
        t = np.linspace(0, 1, 301)
        x, v, s = run.displacement(t), run.velocity(t), model.structure
        spring = 0.5 * 5e3 * np.minimum(run.gap("stop", t), 0.0) ** 2
        expected = 0.5 * np.sum(v * (s.mass @ v), axis=0) + 0.5 * np.sum(x * (s.stiffness @ x), axis=0) + spring
        assert np.allclose(run.energy(t), expected, rtol=1e-12)


class TestEquivalences:
    CONTACTS = (mp.UnilateralContact("low", "m3", 0.004, 2e4), mp.UnilateralContact("high", {"m1": -1.0}, 0.006, 1e4))
    START = np.array([0.0, 0.01, 0.02, 0.04])

    def run(self, t_end=2.0, start=START, velocity=None):
        return mp.simulate(chain(self.CONTACTS), t_end, displacement=start, velocity=velocity)

    def test_two_half_runs_are_one_run(self):
        whole = self.run()
        half = self.run(0.77)
        rest = self.run(2.0 - 0.77, half.displacement(0.77), half.velocity(0.77))
        assert rest.displacement(2.0 - 0.77) == pytest.approx(whole.displacement(2.0), abs=1e-10)


class TestStarts:
    @pytest.mark.parametrize(("speed", "kinds"), [(-1.0, ["close", "open"]), (1.0, []), (0.0, [])])
    def test_start_exactly_on_a_rigid_stop(self, speed, kinds):
        model = chain([mp.UnilateralContact("stop", "m0", 0.0)])
        run = mp.simulate(model, 1e-3, velocity=[speed, 0, 0, 0])
        assert [event.kind for event in run.events][:2] == kinds
        assert np.min(run.gap("stop", np.linspace(0, 1e-3, 50))) >= -1e-15

    def test_preload_rests(self):
        model = chain([mp.UnilateralContact("stop", "m3", -0.01, 1e4)])
        rest = model.static_equilibrium({})
        run = mp.simulate(model, 1.0, displacement=rest)
        assert run.displacement(1.0) == pytest.approx(rest, abs=1e-13)
        assert run.contact_intervals("stop") == [(0.0, 1.0)]

    def test_other_bad_starts_are_refused(self, refused):
        model = chain([mp.UnilateralContact("stop", "m0", 0.01)])
        refused(TypeError, "t_end: got", mp.simulate, model, "1")
        refused(ValueError, "displacement: got shape", mp.simulate, model, 1.0, displacement=[0.0])
        refused(ValueError, "velocity: got a value that is NaN", mp.simulate, model, 1.0, velocity=[0, 0, 0, math.nan])
        refused(ValueError, "displacement: lies", mp.simulate, model, 1.0, displacement=[-0.02, 0, 0, 0])
        refused(TypeError, "loads: got", mp.simulate, model, 1.0, loads=[3.0])


@st.composite
def scenes(draw):
    """Small random structures with one to three contacts, each rigid or compliant, truncated or not."""
    n = draw(st.integers(2, 5))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    a, b = rng.standard_normal((2, n, n))
    mass, stiffness = a @ a.T + n * np.eye(n), 100 * (b @ b.T + 0.1 * np.eye(n))
    count = draw(st.integers(1, min(3, n - 1)))
    stiff = draw(st.lists(st.sampled_from([math.inf, 1e3, 1e5]), min_size=count, max_size=count))
    contacts = [
        mp.UnilateralContact(f"c{i}", rng.standard_normal(n), float(rng.uniform(0, 0.02)), k)
        for i, k in enumerate(stiff)
    ]
    modes = draw(st.one_of(st.just("all"), st.integers(1, n - count)))
    model = mp.MultiPhiModel(mp.LinearStructure(mass, stiffness), contacts, modes=modes)
    return model, rng.standard_normal(n) * draw(st.sampled_from([0.1, 1.0, 5.0]))


@settings(max_examples=30)
@given(scenes())
def test_whatever_the_scene_energy_falls_the_ledger_closes_and_nothing_penetrates(scene):
    model, velocity = scene
    run = mp.simulate(model, 3.0, velocity=velocity)
    assert run.status == "ok" or run.message
    initial = run.ledger.initial
    assert abs(run.ledger.residual) < 1e-10 * initial
    assert run.ledger.impact >= -1e-12 * initial
    assert run.ledger.truncation_kinetic >= -1e-9 * initial
    if model.modes != "all":
        return
    assert run.status == "ok"
    assert run.ledger.truncation_strain == pytest.approx(0.0, abs=1e-9 * initial)
    t = np.linspace(0, run.t_end, 4000)
    size = np.max(np.abs(run.displacement(t)))
    for contact in model.contacts:
        if contact.rigid:
            assert np.min(run.gap(contact.name, t)) > -1e-9 * size
        assert np.min(run.contact_force(contact.name, t)) > -1e-7 * np.max(np.abs(run.acceleration(t)))
