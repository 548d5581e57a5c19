"""Many contacts: only the levels visited are built, each with the few modes asked for, and symmetry stays."""

import dataclasses
import math

import numpy as np
import pytest
from base_levels import build_level
from lawful import complaints
from numpy.testing import assert_allclose
from small_structures import bed

from multiphi_exudyn import LinearStructure, MultiPhiModel, UnilateralContact, simulate
from multiphi_exudyn.mechanics.beam import Beam, Section, planar_beam

FREQUENCIES = 1e-12  # relative, between two routes to the same modes
SUBSPACES = 1e-9  # sine of the angle between them: what 1e-16 of the softest compliance is to the stiffest mode kept
EVALUATIONS = 500  # samples of event signals that an event may take
SYMMETRIC = 1e-12  # of the largest displacement


SETS = [(), (3,), (3, 4), (3, 4, 20, 33), tuple(range(10, 30))]


class TestFewModesOfALevel:
    @pytest.mark.parametrize("stiffness", [10.0, 1e6, 1e12, math.inf])
    @pytest.mark.parametrize("twins", [False, True])
    @pytest.mark.parametrize("apart", [1e-10, 0.3])
    def test_equal_the_lowest_of_all_its_modes(self, stiffness, twins, apart):
        base = bed(stiffness, n=80 if twins else 160, twins=twins, apart=apart).base
        for indices in SETS:
            few, full = build_level(base, indices, 12), build_level(base, indices)
            assert few.modes == 12
            assert_allclose(few.omega, full.omega[:12], rtol=FREQUENCIES)
            wanted = full.vectors[:, :12]
            assert np.linalg.norm(few.vectors - wanted @ (wanted.T @ few.vectors), 2) < SUBSPACES
            shown = few.force_rows @ few.vectors.T - full.force_rows[:, :12] @ wanted.T
            assert np.abs(shown).max(initial=0) <= SUBSPACES * np.abs(full.force_rows).max(initial=0)

    @pytest.mark.parametrize("stiffness", [10.0, 1e6, math.inf])
    @pytest.mark.parametrize("twins", [False, True])
    @pytest.mark.parametrize("closed", [(7,), (3, 4, 5), (0, 9, 20, 39)])
    def test_of_a_few_contacts_equal_the_lowest_of_all_closely(self, stiffness, twins, closed):
        base = bed(stiffness, n=80 if twins else 160, twins=twins).base
        full = build_level(base, closed)
        few = build_level(base, closed, 12)
        assert_allclose(few.omega, full.omega[:12], rtol=FREQUENCIES)
        wanted = full.vectors[:, :12]
        assert np.linalg.norm(few.vectors - wanted @ (wanted.T @ few.vectors), 2) < 1e-10

    @pytest.mark.parametrize("stiffness", [10.0, 1e6, math.inf])
    @pytest.mark.parametrize("aside", [0.0, 1e-15, 1e-11, 1e-7, 1e-3])
    def test_one_contact_in_the_middle_of_a_symmetric_structure(self, stiffness, aside):
        """Of a string held there every mode of one half is a pair; a little aside round-off would mix the two."""
        middle = np.zeros(159)
        middle[79], middle[80] = 1.0, aside
        stiff = 4e4 * (2 * np.eye(159) - np.eye(159, k=1) - np.eye(159, k=-1))
        stop = UnilateralContact("stop", middle, 1e-3, stiffness)
        base = MultiPhiModel(LinearStructure(np.eye(159), stiff), [stop], modes=12).base
        few, full = build_level(base, (0,), 13), build_level(base, (0,))
        assert_allclose(few.omega[:12], full.omega[:12], rtol=1e-11)
        assert_allclose(few.vectors.T @ few.vectors, np.eye(few.modes), rtol=0, atol=1e-12)
        wanted = full.vectors[:, :12]
        assert np.linalg.norm(few.vectors[:, :12] - wanted @ (wanted.T @ few.vectors[:, :12]), 2) < 1e-10
        stiff = few.vectors.T @ (base.squares[:, None] * few.vectors) + (few.gap_rows.T * base.springs) @ few.gap_rows
        assert_allclose(stiff, np.diag(few.squares), rtol=0, atol=1e-9 * few.squares[-1])

    def test_end_with_a_cluster(self):
        """Of a string held in its middle every mode of one half is a pair, of which none is parted."""
        middle = np.eye(159)[79]
        stiff = 4e4 * (2 * np.eye(159) - np.eye(159, k=1) - np.eye(159, k=-1))
        structure = LinearStructure(np.eye(159), stiff)
        base = MultiPhiModel(structure, [UnilateralContact("stop", middle, 1e-3, math.inf)], modes=12).base
        for modes, kept in ((11, 12), (12, 12), (13, 14)):
            few = build_level(base, (0,), modes)
            assert few.modes == kept
            assert few.kept_beyond == kept - modes

    def test_rigid_contacts_do_not_move_in_them(self):
        level = bed(math.inf).level(("c3", "c20"))
        assert np.abs(level.base.directions[:, level.indices].T @ level.vectors).max() < 1e-14

    def test_fewer_and_more_are_the_lowest_of_the_same(self):
        some = bed(math.inf)
        held = some.level(("c3",))
        fewer = dataclasses.replace(some, modes=3)
        assert_allclose(fewer.level(("c3",)).vectors, held.vectors[:, :3], atol=SUBSPACES)
        more = dataclasses.replace(some, modes="all")
        assert more.level(("c3",)).modes == some.base.modes.count - 1
        assert_allclose(more.level(("c3",)).omega[:12], held.omega, rtol=FREQUENCIES)


class TestStopsStruckAtOnce:
    @pytest.mark.parametrize("stiffness", [1e4, math.inf])
    @pytest.mark.parametrize("order", [(0, 1, 2, 3, 4), (3, 0, 4, 2, 1)])
    def test_in_a_mirror_symmetric_scene_close_together_and_keep_it_symmetric(self, stiffness, order):
        n, places = 21, [2, 6, 10, 14, 18]
        chain = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
        chain[0, 0] = chain[-1, -1] = 1.0
        structure = LinearStructure(np.eye(n), 1e3 * chain @ chain, points={f"p{k}": k for k in places})
        stops = [UnilateralContact(f"c{places[i]}", f"p{places[i]}", 0.1, stiffness) for i in order]
        run = simulate(MultiPhiModel(structure, stops, modes="all"), 0.13, velocity=-np.ones(n))
        assert run.status == "ok", run.message
        first = [event.time for event in run.events if event.kind == "close"][:5]
        assert len(first) == 5
        assert_allclose(first, 0.1, rtol=1e-12)
        if math.isinf(stiffness):  # the beam bends over its stops and presses on them: no event beside these
            assert len(run.events) == 5
        x = run.displacement(np.linspace(0, 0.13, 200))
        assert np.abs(x - x[::-1]).max() < SYMMETRIC * np.abs(x).max()


def test_forty_stops_build_the_levels_visited_only():
    model = bed(1e7, stops=40)
    mode = model.level(()).shapes[:, 0]
    run = simulate(model, 0.02, velocity=-3.0 * mode / np.abs(mode).max() * np.sign(mode[len(mode) // 2]))
    assert run.status == "ok", run.message
    assert len(run.events) > 10
    assert model.levels_possible == 2**40
    assert model.levels_built <= 2 * len(run.events) + 1


def test_a_hundred_stops_run_to_the_end_with_certified_events():
    """A beam over its bed: the work of an event does not grow with the contacts that rest."""
    steel = Section.rectangle(0.0, 2.0, width=0.03, height=0.01, youngs_modulus=2.1e11, density=7850.0)
    places = {f"p{i}": 0.02 * (i + 1) for i in range(100)}
    structure = planar_beam(Beam([steel], places), 100)
    stops = [UnilateralContact(f"c{i}", f"p{i}", 1e-3, 1e4) for i in range(100)]
    model = MultiPhiModel(structure, stops, modes=24)
    mode = model.level(()).shapes[:, 0]
    run = simulate(model, 0.008, velocity=-mode / (structure.row("p99") @ mode))
    assert complaints(run, samples=2_000) == []
    assert len(run.events) > 15
    assert run.stats.levels_built <= 2 * len(run.events) + 1
    assert run.stats.function_evaluations < EVALUATIONS * len(run.events)


def test_a_bed_struck_all_at_once_is_no_chatter(monkeypatch):
    """One change of every stop within a small part of a period of the highest kept mode."""
    monkeypatch.setattr("multiphi_exudyn.time.motion.CHATTER_WINDOW", 10)
    model = bed(1e7, n=200, stops=60)
    mode = model.level(()).shapes[:, 0]
    fall = -3.0 * mode / np.abs(mode).max() * np.sign(mode[len(mode) // 2])
    run = simulate(model, 4e-4, velocity=fall)
    assert run.status == "ok", run.message
    assert len(run.events) > 20
    assert (run.events[-1].time - run.events[0].time) * model.level(()).highest_frequency < 10 / 20
