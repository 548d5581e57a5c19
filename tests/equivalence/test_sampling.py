"""States of many segments of a run at once: those that each segment has in closed form."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from small_structures import chain

import multiphi_exudyn as mp
import multiphi_exudyn._core as core

STOPS = (mp.UnilateralContact("below", "m2", 0.1, 50.0), mp.UnilateralContact("above", {"m0": -1.0}, 0.15, 30.0))
START = np.array([0.1, 0.2, -0.3])
LOADS = {
    "no load": [],
    "constant": [mp.ConstantLoad("m1", 0.5)],
    "harmonic": [mp.HarmonicLoad("m1", 2.0, 0.3, 0.4)],
    "samples": [mp.SampledLoad("m1", np.linspace(0.0, 4.0, 81), np.cos(np.linspace(0.0, 9.0, 81)))],
    "moving stop": [mp.StopMotion("below", mp.Harmonic(0.05, 0.7))],
    "two carriers": [mp.HarmonicLoad("m1", 2.0, 0.3, 0.4), mp.HarmonicLoad("m0", 1.0, 3.0)],
}


def model(damping=None, contacts=STOPS):
    return mp.MultiPhiModel(chain(3, damping=damping, stiffness=10.0), contacts, modes="all")


def each(run, places, after, derivative):
    """xi or xi' (k, n) of single segments, by their closed form in NumPy."""
    own = [run.segments[i] for i in places]
    return [s.modal(s.start + t[None], derivative)[:, 0] for s, t in zip(own, after, strict=True)]


def assert_states_of_segments(run):
    """At the start, the end and five times between of every segment, segments in no order."""
    own = run.segments
    places = np.random.default_rng(1).permutation(np.repeat(np.arange(len(own)), 7))
    after = (own.ends - own.starts)[places] * np.random.default_rng(2).choice(np.linspace(0, 1, 7), len(places))
    found = own.states(places, after)
    for derivative in range(2):
        for have, expected in zip(found[derivative], each(run, places, after, derivative), strict=True):
            assert_allclose(have[: len(expected)], expected, rtol=0, atol=1e-12)
            assert not np.any(have[len(expected) :])


COUPLED = np.diag([0.1, 0.05, 0.2])
PLAIN = [
    (loads, damping) for loads in ("no load", "harmonic") for damping in (None, mp.ModalDamping([0.02, 0.01, 0.03]))
]


@pytest.mark.parametrize(("loads", "damping"), [*((loads, COUPLED) for loads in LOADS), *PLAIN])
def test_states_of_many_segments_together_are_those_of_each(loads, damping):
    run = mp.simulate(model(damping), 5.0, displacement=START, loads=LOADS[loads])
    assert run.status == "ok"
    assert len(run.events) > 2
    assert_states_of_segments(run)


@pytest.mark.parametrize("loads", LOADS.values(), ids=LOADS)
def test_the_sizes_of_a_motion_are_those_of_its_displacements_and_energies(loads):
    """By the core, by single segments, and by the displacements of the structure in the norm of its mass."""
    run = mp.simulate(model(mp.ModalDamping([0.02, 0.01, 0.03])), 5.0, displacement=START, loads=loads)
    found = run.segments.sizes(4.9)
    times = np.linspace(0.0, 4.9, core.MOTION_SAMPLES)
    x = run.displacement(times)
    squares = np.sum(x * (run.model.structure.mass @ x), axis=0)
    expected = np.mean(squares[1:] + squares[:-1]) / 2, np.max(np.abs(run.energy(times)))
    assert found == pytest.approx(expected, rel=1e-12)


GRIDS = {
    "even": np.linspace(0.0, 5.0, 1001),
    "even, coarse": np.linspace(0.2, 4.9, 23),
    "any": np.sort(np.random.default_rng(3).uniform(0.0, 5.0, 300)),
    "in no order": np.random.default_rng(4).uniform(0.0, 5.0, 300),
    "descending": np.linspace(5.0, 0.0, 301),
    "one": np.array([2.5]),
}


@pytest.mark.parametrize("loads", LOADS.values(), ids=LOADS, scope="class")
class TestPlacesGapsAndForces:
    @pytest.fixture(scope="class")
    @staticmethod
    def run(loads):
        return mp.simulate(model(COUPLED), 5.0, displacement=START, loads=loads)

    @pytest.mark.parametrize("times", GRIDS.values(), ids=GRIDS)
    def test_are_those_of_each_segment(self, run, times):
        own = run.segments
        places = own.owners(times)
        expected = [(run.segments[i], np.array([t])) for i, t in zip(places, times, strict=True)]
        vector = run.model.base.modes.shapes.T @ run.model.structure.row("m1")
        for i, name in enumerate(("below", "above")):
            assert_allclose(run.gap(name, times), [s.gaps(i, t)[0] for s, t in expected], rtol=0, atol=1e-12)
            forces = [s.force(i, t)[0] for s, t in expected]
            assert_allclose(run.contact_force(name, times), forces, rtol=0, atol=50 * 1e-12)
        found = [vector @ s.level.configuration(s.modal(t))[:, 0] for s, t in expected]
        assert_allclose(run.at("m1", times), found, rtol=0, atol=1e-12)
