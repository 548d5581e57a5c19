"""Whatever hands a state on hands all of it where friction holds places: pickles, joined structures, warnings."""

import pickle
import warnings

import numpy as np
import pytest
from numpy.testing import assert_allclose
from small_structures import chain

import multiphi_exudyn as mp

LOAD = mp.HarmonicLoad("m2", 1.5, 0.31)


def model(**given):
    rings = [mp.Friction("ring", "m1", 0.4, 0.6, 30.0), mp.Friction("floor", "m0", 0.2)]
    return mp.MultiPhiModel(
        chain(3, stiffness=10.0, damping=mp.ModalDamping([0.02] * 3)), rings, **{"modes": "all"} | given
    )


@pytest.mark.parametrize("modes", ["all", 2])
def test_what_is_unpickled_answers_and_goes_on_alike(modes):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        given = model(modes=modes)
        first = mp.simulate(given, 7.0, loads=[LOAD])
        copy = pickle.loads(pickle.dumps(first))
        t = np.linspace(0, 7, 71)
        for name in ("ring", "floor"):
            assert_allclose(copy.friction_force(name, t), first.friction_force(name, t), atol=1e-13)
            assert_allclose(copy.slip(name, t), first.slip(name, t), atol=1e-13)
            assert np.array_equal(copy.stick_intervals(name), first.stick_intervals(name))
        assert np.array_equal(copy.final.held, first.final.held)
        own, other = (mp.simulate(run.model, 15.0, loads=[LOAD], start=run) for run in (first, copy))
        whole = mp.simulate(model(modes=modes), 15.0, loads=[LOAD])
    assert [e.time for e in own.events] == [e.time for e in other.events]
    assert len(own.events) > 6
    t = np.linspace(7, 15, 81)
    assert_allclose(other.at("m2", t), whole.at("m2", t), rtol=0, atol=1e-9)


def test_two_bodies_that_rub_on_each_other_are_one_block_in_their_difference():
    """m 1, k 4 each, let go apart by .33: u'' + 4 u = -2 F sign(u'); their sum swings on."""
    single = mp.LinearStructure([[1.0]], [[4.0]], points={"tip": 0})
    pair = mp.assemble({"a": single, "b": single})
    ring = mp.Friction("ring", {"a.tip": 1.0, "b.tip": -1.0}, 0.05)
    run = mp.simulate(mp.MultiPhiModel(pair, [ring], modes="all"), 20.0, displacement=[0.33 + 0.1, 0.1])
    block = mp.simulate(mp.MultiPhiModel(single, [mp.Friction("ring", "tip", 0.1)]), 20.0, displacement=[0.33])
    t = np.linspace(0, 20, 201)
    assert [e.kind for e in run.events] == [e.kind for e in block.events]
    assert_allclose([e.time for e in run.events], [e.time for e in block.events], rtol=1e-12)
    assert_allclose(run.at("a.tip", t) - run.at("b.tip", t), block.at("tip", t), atol=1e-13)
    assert_allclose(run.at("a.tip", t) + run.at("b.tip", t), (0.33 + 0.2) * np.cos(2 * t), atol=1e-13)
    assert run.ledger.friction == pytest.approx(block.ledger.friction / 2, rel=1e-12)
