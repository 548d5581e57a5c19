"""Exits of a level from the table of its model: those of its elements in their states, one by one."""

import itertools
import math

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import multiphi_exudyn as mp
from multiphi_exudyn.events.transitions.exit_table import ExitTable
from multiphi_exudyn.events.transitions.exits import ExitShares
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
    kept = table.of(states)
    found, expected = table.shares(kept), ExitShares.of(places, given)
    assert_array_equal(found.constants, expected.constants)
    assert_array_equal(found.links, expected.links)
    assert_array_equal(found.shares, expected.shares)
    for own, other in zip(found.further, expected.further, strict=True):
        assert_array_equal(own, other)
    asked = [ELEMENTS[i].states[table.described[kept][k, 1]].name for k, (i, _) in enumerate(given)]
    assert asked == [exit_.asked for _, exit_ in given]
    assert_array_equal(table.described[kept][:, 2], [exit_.firmness for _, exit_ in given])
    assert_array_equal(np.diff(table.firsts(kept)), [len(ELEMENTS[i].states[s].exits) for i, s in enumerate(states)])
    assert table.turning(kept) == [(k, exit_) for k, (_, exit_) in enumerate(given) if exit_.turn is not None]
