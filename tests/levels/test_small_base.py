"""The small base of a large structure: its levels are the structure's own, and it grows by what it has not seen."""

import dataclasses
import math

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse
from numpy.testing import assert_allclose
from small_structures import stop

import multiphi_exudyn as mp
from multiphi_exudyn.mathematics import lowest_modes

SIDE = 27  # of a membrane of 27 x 26 masses, none of whose frequencies are equal
MODES = 12
ACCURATE = 1e-8  # of omega^2


def membrane(held=1.0):
    """Springs between neighbours; held: to the ground at the edge, in units of theirs; two patches are points."""
    sides = [
        scipy.sparse.diags_array([2 * np.ones(n), -np.ones(n - 1), -np.ones(n - 1)], offsets=[0, 1, -1]).tolil()
        for n in (SIDE, SIDE - 1)
    ]
    for side in sides:
        side[0, 0] = side[-1, -1] = 1.0 + held
    first, second = (scipy.sparse.csr_array(side) for side in sides)
    stiffness = scipy.sparse.kron(first, scipy.sparse.eye_array(SIDE - 1)) + scipy.sparse.kron(
        scipy.sparse.eye_array(SIDE), second
    )
    points = {name: patch(*at) for name, at in (("p", (5, 7)), ("q", (18, 12)))}
    n = SIDE * (SIDE - 1)
    return mp.LinearStructure(scipy.sparse.eye_array(n).tocsr(), 1e4 * stiffness.tocsr(), points=points)


def patch(i, j):
    """The mean over 4 x 4 masses."""
    row = np.zeros((SIDE, SIDE - 1))
    row[i : i + 4, j : j + 4] = 1 / 16
    return row.ravel()


def squares(structure, rows, stiffness, count):
    """omega^2 of the full problem with rows held; the masses are one."""
    matrix = structure.stiffness.toarray()
    for row in rows:
        if math.isinf(stiffness):
            mirror = row / np.linalg.norm(row)
            projected = matrix @ mirror
            matrix = matrix - np.outer(mirror, projected) - np.outer(projected - (mirror @ projected) * mirror, mirror)
            matrix += 1e9 * np.outer(mirror, mirror)  # the motion that it prevents, far above the others
        else:
            matrix = matrix + stiffness * np.outer(row, row)
    return scipy.linalg.eigh(matrix, eigvals_only=True, subset_by_index=[0, count - 1])


@pytest.mark.parametrize("held", [1.0, 0.0], ids=["held", "free"])
@pytest.mark.parametrize("stiffness", [1e3, 1e5, math.inf])
def test_levels_are_those_of_the_full_problem(held, stiffness):
    structure = membrane(held)
    stops = [stop(name, stiffness=stiffness, name=name) for name in ("p", "q")]
    model = mp.MultiPhiModel(structure, stops, modes=MODES)
    for closed in ((), ("p",), ("q",), ("p", "q")):
        expected = squares(structure, [structure.row(name) for name in closed], stiffness, MODES)
        found = model.level(closed).squares
        assert np.max(np.abs(found - expected) / np.maximum(expected, expected[2])) < ACCURATE
    assert model.base.exact_count == MODES + 8
    assert model.base.modes.count <= 45
    assert model.base.modes.rigid == (held == 0)
    assert model.base.error < ACCURATE / 10


@pytest.mark.parametrize("k", [1e4, math.inf])
def test_its_error_is_that_of_its_levels(monkeypatch, k):
    """Without Krylov vectors beside the static shapes a level is too stiff by what the samples say."""
    monkeypatch.setattr(lowest_modes, "DEEPEST", 1)
    structure = membrane()
    model = mp.MultiPhiModel(structure, [stop("p", stiffness=k)], modes=MODES)
    exact, found = squares(structure, [structure.row("p")], k, MODES), model.level(("stop",)).squares
    error = np.max((found - exact) / exact)
    assert error > ACCURATE
    assert error / 3 < model.base.error < 3 * error
    with pytest.warns(mp.MultiPhiWarning, match="base: squares of frequencies of levels may be off by"):
        mp.simulate(model, 0.01, displacement=model.level(()).shapes[:, 0])


def test_a_cluster_larger_than_what_is_computed_beyond_the_modes_is_kept_whole():
    """Twelve equal chains side by side: every frequency twelve times."""
    one = scipy.sparse.diags_array([2 * np.ones(60), -np.ones(59), -np.ones(59)], offsets=[0, 1, -1])
    stiffness = scipy.sparse.kron(scipy.sparse.eye_array(12), one).tocsr()
    structure = mp.LinearStructure(scipy.sparse.eye_array(720).tocsr(), stiffness, points={"m": 30})
    model = mp.MultiPhiModel(structure, [stop("m", stiffness=10.0)], modes=2)
    expected = 2 * np.sin(np.pi / 122)
    assert model.base.exact_count % 12 == 0
    assert_allclose(model.level(()).omega, 12 * [expected], rtol=1e-9)
    assert_allclose(model.level(("stop",)).omega[:11], expected, rtol=1e-9)


def counted(monkeypatch):
    """How many modes Lanczos iterations have been asked for, call by call."""
    asked, lanczos = [], lowest_modes.lanczos
    monkeypatch.setattr(lowest_modes, "lanczos", lambda *given: asked.append(given[2]) or lanczos(*given))
    return asked


@pytest.mark.parametrize("held", [1.0, 0.0], ids=["held", "free"])
def test_more_modes_and_other_contacts_take_the_modes_that_are_there(monkeypatch, held):
    structure = membrane(held)
    few = mp.MultiPhiModel(structure, [stop("p")], modes=MODES)
    assert few.base.most_level_modes == MODES
    asked = counted(monkeypatch)
    more = dataclasses.replace(few, modes=2 * MODES)
    other = dataclasses.replace(few, contacts=[stop("q", stiffness=1e4)])
    assert more.base.most_level_modes == 2 * MODES
    assert other.base.most_level_modes == MODES
    assert asked == [MODES]
    anew = mp.MultiPhiModel(structure, [stop("p")], modes=2 * MODES)
    for closed in ((), ("stop",)):
        assert_allclose(more.level(closed).omega[1:], anew.level(closed).omega[1:], rtol=1e-9)
        assert_allclose(more.level(closed).shapes[:, 1:], anew.level(closed).shapes[:, 1:], atol=1e-7)


class TestRowsFirstSeenInARun:
    ROW = patch(10, 3)

    def run(self, model, **given):
        load = mp.HarmonicLoad(self.ROW, 1.0, 1.0)
        return mp.simulate(model, 0.5, displacement=0.01 * model.level(()).shapes[:, 0], loads=[load], **given)

    def test_loads_extend_the_base_once(self, monkeypatch):
        model = mp.MultiPhiModel(membrane(), [stop("p")], modes=MODES)
        assert model.outside(self.ROW) > 1e-3
        asked = counted(monkeypatch)
        run = self.run(model)
        assert run.model.outside(self.ROW) < 1e-12
        assert run.warnings == ()
        assert asked == []
        assert self.run(model).model is run.model
        assert mp.simulate(model, 0.5, displacement=run.displacement(0.0)).model is model
        on = mp.simulate(model, 0.7, start=run)
        assert on.model is run.model

    def test_steady_states_and_frequency_responses_extend_it_too(self):
        """An eighth of what the load bends lies outside the base of the contacts; all of it is in the amplitude."""
        structure = dataclasses.replace(membrane(), damping=mp.RayleighDamping(20.0, 0.0))
        model = mp.MultiPhiModel(structure, [stop("p", gap=1.0)], modes=MODES)
        load, frequencies = mp.HarmonicLoad(self.ROW, 1.0, 1.0), [1.0, 1.5]
        response = mp.frequency_response(model, load, frequencies)
        alone = mp.steady_state(model, load)
        wider = alone.trajectory.model
        assert wider.outside(self.ROW) < 1e-12
        assert {id(state.trajectory.model) for state in response.states} == {id(wider)}
        assert not any(sentence.startswith("base") for sentence in response.warnings)
        for hz, amplitude in zip(frequencies, response.amplitude(self.ROW), strict=True):
            square = (2 * math.pi * hz) ** 2
            matrix = structure.stiffness.astype(complex) - (square - 40j * math.pi * hz) * structure.mass
            expected = abs(self.ROW @ scipy.sparse.linalg.spsolve(matrix.tocsc(), self.ROW))
            assert_allclose(amplitude, expected, rtol=1e-2)  # the modes left out have no inertia

    def test_a_load_outside_the_base_of_a_run_that_goes_on_is_told(self):
        model = mp.MultiPhiModel(membrane(), modes=MODES)
        start = mp.simulate(model, 0.01, displacement=model.level(()).shapes[:, 0])
        with pytest.warns(mp.MultiPhiWarning, match="base: .* % of the static flexibility at a load lies outside"):
            on = mp.simulate(model, 0.02, start=start, loads=[mp.ConstantLoad(self.ROW, 1.0)])
        assert on.model is model

    def test_a_tolerance_decides_for_the_base_that_holds_them(self):
        model = mp.MultiPhiModel(membrane(), [stop("p", gap=0.001, stiffness=1e3)], modes=mp.Tolerance(0.05))
        run = self.run(model)
        assert run.model.outside(self.ROW) < 1e-12
        assert model.decided is None
        assert self.run(model).model is run.model
        on = mp.simulate(model, 0.7, start=run)
        assert on.model is run.model

    def test_few_bases_are_kept_however_many_loads_there_are(self):
        model = mp.MultiPhiModel(membrane(), modes=MODES)
        loads = [mp.ConstantLoad(patch(i, i), 1.0) for i in range(1, 6)]
        runs = [mp.simulate(model, 0.01, loads=[load]) for load in loads]
        assert len({id(run.model) for run in runs}) == 5
        assert len(model._wider) <= 2
        assert mp.simulate(model, 0.02, start=runs[0]).model is runs[0].model

    def test_weight_bends_the_structure_as_much_as_it_does(self):
        structure = membrane()
        model = mp.MultiPhiModel(structure, modes=MODES)
        rest = mp.simulate(model, 0.1, loads=[mp.Gravity(np.ones(structure.n))])
        expected = scipy.sparse.linalg.spsolve(structure.stiffness.tocsc(), 9.81 * np.ones(structure.n))
        level = rest.model.level(())
        assert_allclose(rest.model.base.modes.shapes @ level.asymptotic(rest.load).configuration, expected, rtol=1e-9)

    def test_a_start_and_a_row_that_lie_outside_are_told(self):
        model = mp.MultiPhiModel(membrane(), [stop("p")], modes=MODES)
        with pytest.warns(mp.MultiPhiWarning, match="base: .* % of the start's velocity lies outside"):
            mp.simulate(model, 0.01, velocity=np.eye(model.structure.n)[300])
        run = mp.simulate(model, 0.01, displacement=model.level(()).shapes[:, 0])
        assert run.warnings == ()
        with pytest.warns(mp.MultiPhiWarning, match="base: .* % of the static flexibility at a row lies outside"):
            run.at(self.ROW, 0.0)
        run.at({"p": 1.0, "q": -1.0}, 0.0)
