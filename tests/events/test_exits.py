"""Exits of a level: their signals are what gaps, their rates and forces of links say, but for round-off of limits."""

import itertools
import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

import multiphi_exudyn as mp
from multiphi_exudyn.time.loaded_levels import LoadedLevels

K = 4e4 * np.array([[2, -1, 0], [-1, 2, -1], [0, -1, 1]])
ELEMENTS = [
    mp.UnilateralContact("soft", "p", 1e-3, 1e4),
    mp.UnilateralContact("rough", "p", 1e-3, math.inf, friction=0.3, tangential="q"),
    mp.Friction("ring", "q", 2.0, static_limit=3.0, stiffness=1e5),
    mp.UnilateralContact("viscous", "q", 0.0, 1e4, damping=3.0),
]


@pytest.mark.parametrize("states", list(itertools.product(*(range(len(each.states)) for each in ELEMENTS))))
def test_signals_are_made_of_gaps_their_rates_and_forces(states):
    chain = mp.LinearStructure(np.eye(3), K, mp.RayleighDamping(0.1, 1e-4), {"p": 2, "q": 1})
    model = mp.MultiPhiModel(chain, ELEMENTS, modes="all")
    level = LoadedLevels.static(model, model.base_load({"p": 5.0})).level(states)
    own, links = level.level, model.base.link_indices
    xi, xi_t = np.random.default_rng(1).normal(size=(2, level.width))
    gaps, rates = own.gap_rows @ xi + level.gap_constants, own.gap_rows @ xi_t
    forces = dict(
        zip(own.indices, own.force_rows @ xi + own.force_rate_rows @ xi_t + level.asymptotic.forces, strict=True)
    )
    exits = level.exits
    assert [(i, exit_.asked) for i, exit_ in exits] == [
        (i, exit_.asked) for i, state in enumerate(states) for exit_ in ELEMENTS[i].states[state].exits
    ]
    for (i, exit_), (place, rate, constant) in zip(exits, level.signals, strict=True):
        parts = [(links[i][share.link], share) for share in exit_.shares]
        terms = [exit_.constant, *(share.gap * gaps[k] + share.rate * rates[k] for k, share in parts)]
        terms += [share.force * forces[k] for k, share in parts if share.force]
        found = place @ xi + rate @ xi_t + constant
        assert_allclose(found, sum(terms), rtol=0, atol=1e-12 * sum(map(abs, terms)))


def test_a_limit_that_equals_the_load_but_for_round_off_is_reached():
    structure = mp.LinearStructure(np.eye(2), 4e4 * np.array([[2, -1], [-1, 1]]), points={"tip": 1, "mid": 0})
    model = mp.MultiPhiModel(structure, [mp.Friction("ring", "tip", 0.3)], modes="all")
    level = LoadedLevels.static(model, model.base_load({"tip": 0.1 + 0.2})).level((0,))
    (*_, lower), (*_, upper) = level.signals
    assert lower == 0.0
    assert_allclose(upper, 0.6, rtol=1e-15)
