"""How many modes: the choice without a run, a Tolerance that decides once, and numbers larger than a structure has."""

import dataclasses
import math

import numpy as np
import pytest
import scipy.sparse
from small_structures import chain, stop

import multiphi_exudyn as mp
from multiphi_exudyn.levels.model import level_store
from reference_models.rig import rig_beam, rig_contact, rig_damping


def rig(stiffness, modes=None):
    structure = mp.planar_beam(rig_beam(), elements=57, damping=rig_damping())
    return mp.MultiPhiModel(structure, [rig_contact(stiffness)], modes=modes)


def large_chain(n=700):
    matrix = scipy.sparse.diags_array([-np.ones(n - 1), 2 * np.ones(n), -np.ones(n - 1)], offsets=[-1, 0, 1])
    return mp.LinearStructure(scipy.sparse.eye_array(n), matrix.tocsr(), points={"m": n // 2})


def point_residual(model, name, modes):
    structure = model.structure
    row = structure.row(name)
    level = dataclasses.replace(model, modes="all").level(())
    kept = np.sum((row @ level.shapes[:, :modes] / level.omega[:modes]) ** 2)
    return 1 - kept / (row @ np.linalg.solve(structure.stiffness, row))


@pytest.mark.parametrize(("stiffness", "modes"), [(math.inf, 12), (1e8, 12), (1e6, 10), (1e3, 7)])
def test_friction_takes_no_more_modes_than_a_rigid_contact(stiffness, modes):
    structure = mp.planar_beam(rig_beam(), elements=57, damping=rig_damping())
    model = mp.MultiPhiModel(structure, [mp.Friction("ring", "node2", 0.6, stiffness=stiffness)])
    assert model.most_modes == modes


class TestDefault:
    def test_is_shown_once_it_is_chosen(self):
        model = rig(1e6)
        assert "modes chosen at first use" in repr(model)
        model.level(())
        assert f"modes {model.most_modes}, chosen" in repr(model)

    @pytest.mark.parametrize("n", [4, 30])
    def test_all_modes_of_a_small_structure(self, n):
        model = mp.MultiPhiModel(chain(n), [stop(stiffness=1e3)])
        assert (model.modes, model.most_modes) == (None, None)
        assert [model.level(closed).modes for closed in ((), ("stop",))] == [n, n]

    @pytest.mark.parametrize(("stiffness", "modes"), [(1e6, 10), (1e7, 22)])
    def test_the_fewest_that_hold_the_flexibility_of_a_compliant_contact(self, stiffness, modes):
        model = rig(stiffness)
        assert model.most_modes == model.level(("support",)).modes == modes
        assert model.level(("support",)).static_shares["support"] < 0.1
        fewer = dataclasses.replace(model, modes=modes - 1)
        assert fewer.level(("support",)).static_shares["support"] >= 0.1

    def test_the_fewest_that_hold_the_flexibility_of_points(self):
        model = rig(1e3)
        worst = [max(point_residual(model, name, r) for name in model.structure.points) for r in (6, 7)]
        assert worst[0] > 0.01 >= worst[1]
        assert model.most_modes == 7

    def test_twelve_with_a_rigid_stop(self):
        assert rig(math.inf).most_modes == 12

    def test_a_limit_where_a_contact_is_too_stiff_and_a_warning_then(self):
        model = mp.MultiPhiModel(chain(90), [stop("m89", 0.0, 1e4)])
        assert model.most_modes == 60
        with pytest.warns(mp.MultiPhiWarning, match="truncated contact: at 'stop' 60 modes"):
            mp.simulate(model, 5.0, velocity=-np.eye(90)[89])

    def test_a_force_law_is_judged_where_it_is_stiffest(self):
        model = rig(1e6)
        table = [-1.0, -1.35e-3, 0.0, 1.0], [-1e6 * (1 - 1.35e-3), 0.0, 0.0, 0.0]
        law = dataclasses.replace(model, contacts=[mp.ForceLaw("node2", table)])
        assert law.most_modes == model.most_modes

    def test_rigid_body_modes_are_counted_and_say_nothing(self):
        model = mp.MultiPhiModel(chain(40, ends=0), [stop("m0", 0.1, 0.1)])
        assert model.most_modes >= 7
        assert model.level(()).omega[0] == 0

    def test_another_number_of_modes_shares_what_was_built(self):
        model = rig(1e6)
        assert model.base is dataclasses.replace(model, modes=5).base

    def test_a_large_base_is_extended_once_at_most(self, monkeypatch):
        built = []
        build = level_store.build_base
        monkeypatch.setattr(level_store, "build_base", lambda *given: built.append(given[2]) or build(*given))
        soft = mp.MultiPhiModel(large_chain(), [stop("m", 0.1, 1e-3)])
        assert soft.level(("stop",)).modes == soft.most_modes <= 22
        assert built == [22]
        stiff = mp.MultiPhiModel(large_chain(), [stop("m", 0.1, 1.0)])
        x = stiff.static_equilibrium({"m": -1.0})
        assert stiff.level(("stop",)).modes == 60
        assert built == [22, 22, 44, 60]
        assert x == pytest.approx(
            mp.MultiPhiModel(large_chain(), [stop("m", 0.1, 1.0)], 6).static_equilibrium({"m": -1})
        )

    def test_the_choice_of_a_large_structure_is_that_of_all_its_modes(self):
        soft = mp.MultiPhiModel(large_chain(), [stop("m", 0.1, 1e-2)])
        complete = dataclasses.replace(soft, modes="all")
        share = dataclasses.replace(complete, modes=soft.most_modes).level(("stop",)).static_shares["stop"]
        assert soft.level(("stop",)).static_shares["stop"] == pytest.approx(share, abs=1e-6)


class TestTolerance:
    def test_it_reaches_all_modes_of_a_small_structure(self):
        structure = chain(18, mass=0.5, stiffness=2e4)
        model = mp.MultiPhiModel(structure, [stop("m17", 5e-3, 1e6)], modes=mp.Tolerance(0.01))
        run = mp.simulate(model, 0.5, displacement=3e-3 * np.arange(18.0))
        assert run.model.modes == "all"
        assert run.warnings == ()
        assert len(run.events) > 10

    def test_it_decides_once_for_a_model(self, monkeypatch):
        model = rig(1e6, mp.Tolerance(0.01))
        start = model.static_equilibrium({"node3": 1.0})
        start *= 0.02 / float(model.structure.row("node3") @ start)
        assert model.decided is None
        first = mp.simulate(model, 0.2, displacement=start)
        assert model.decided is first.model
        second = mp.simulate(model, 0.1, displacement=0.5 * start)
        assert second.model is first.model
        assert model.most_modes == first.model.most_modes

    def test_a_later_run_that_its_modes_do_not_hold_is_said(self):
        model = mp.MultiPhiModel(chain(40), modes=mp.Tolerance(0.01))
        calm = mp.simulate(model, 1.0, displacement=model.level(()).shapes[:, 0])
        wild = mp.simulate(model, 1.0, displacement=np.eye(40)[20])
        assert calm.warnings == ()
        assert wild.model is calm.model
        assert any(sentence.startswith("truncation: the indicator is") for sentence in wild.warnings)

    def test_a_run_that_fails_decides_nothing(self):
        model = mp.MultiPhiModel(chain(2), [stop()], mp.Tolerance(0.1), {(): mp.LevelOverride([math.nan])})
        assert mp.simulate(model, 1.0, velocity=np.ones(2)).status == "failed"
        assert model.decided is None

    def test_its_base_is_extended_to_twice_as_many_modes_when_they_are_needed(self, monkeypatch):
        built = []
        build = level_store.build_base
        monkeypatch.setattr(level_store, "build_base", lambda *given: built.append(given[2]) or build(*given))
        model = mp.MultiPhiModel(large_chain(), [stop("m", 0.1, 1e-3)], modes=mp.Tolerance(1e-6))
        start = model.static_equilibrium({"m": -1e-3})
        mp.simulate(model, 5.0, displacement=start)
        assert built == [12, 24, 48, 60]
