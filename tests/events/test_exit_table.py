"""Exits of a level from the table of its model: those of its elements in their states, one by one."""

import itertools
import math

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import multiphi_exudyn as mp
from multiphi_exudyn.events.transitions.exit_table import ExitTable
from multiphi_exudyn.events.transitions.exits import exits_of, signal_table
from multiphi_exudyn.events.transitions.loaded_levels import LoadedLevels
from multiphi_exudyn.mechanics.elements.element import link_indices

ELEMENTS = [
    mp.UnilateralContact("soft", "p", 1e-3, 1e4),
    mp.UnilateralContact("rough", "p", 1e-3, math.inf, friction=0.3, tangential="q"),
    mp.Friction("ring", "q", 2.0, static_limit=3.0, stiffness=1e5),
    mp.UnilateralContact("viscous", "q", 0.0, 1e4, damping=3.0),
]


@pytest.mark.parametrize("states", list(itertools.product(*(range(len(each.states)) for each in ELEMENTS))))
def test_is_what_the_elements_say_in_every_level(states):
    table, places = ExitTable(ELEMENTS), link_indices(ELEMENTS)
    given = [(i, exit_) for i, state in enumerate(states) for exit_ in ELEMENTS[i].states[state].exits]
    kept = np.flatnonzero(table.described[:, 1] == np.array(states)[table.described[:, 0]])
    described = table.described[kept]
    assert len(kept) == table.count(states) == len(given)
    assert_array_equal(described[:, 0], [i for i, _ in given])
    asked = [ELEMENTS[i].states[number].name for i, number in described[:, [0, 2]].tolist()]
    assert asked == [exit_.asked for _, exit_ in given]
    assert_array_equal(described[:, 3], [exit_.firmness for _, exit_ in given])
    assert [shares_of(table.shares, k, len(table.described)) for k in kept.tolist()] == [
        (exit_.constant, [(places[i][share.link], *share[1:]) for share in exit_.shares]) for i, exit_ in given
    ]
    turning = [(k, i, exit_) for k, (i, exit_) in enumerate(given) if exit_.turn is not None]
    assert table.turning(states) == turning


def shares_of(shares, number, count):
    """The constant of an exit, and the link, and parts of q, q' and lambda, of every share."""
    listed = range(*shares.links[number : number + 2].tolist())
    parts = shares.numbers[count:].reshape(-1, 3).tolist()
    return shares.numbers[number], [(shares.links[count + 1 + k], *parts[k]) for k in listed]


def test_a_limit_that_equals_the_load_but_for_round_off_is_reached():
    structure = mp.LinearStructure(np.eye(2), 4e4 * np.array([[2, -1], [-1, 1]]), points={"tip": 1, "mid": 0})
    model = mp.MultiPhiModel(structure, [mp.Friction("ring", "tip", 0.3)], modes="all")
    level = LoadedLevels.static(model, model.base_load({"tip": 0.1 + 0.2})).level((0,))
    signals = signal_table(level, exits_of(level))
    assert signals[0, -1] == 0.0
    assert_allclose(signals[1, -1], 0.6, rtol=1e-15)
