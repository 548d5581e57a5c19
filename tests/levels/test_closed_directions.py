"""What closed contacts are along their directions is let go with the last that asks for it."""

import gc
import weakref

import numpy as np
import pytest

from multiphi_exudyn.levels.base.closed_directions import ClosedDirections


@pytest.mark.parametrize("stiffness", [[1e6], [np.inf], [1e6, np.inf], [np.inf, np.inf]])
def test_nothing_waits_for_a_search_of_garbage(stiffness):
    """Arrays of every level would stay until then, and new ones take new memory."""
    directions = np.random.default_rng(0).normal(size=(5, len(stiffness)))
    members = tuple((i,) for i in range(len(stiffness)))
    gc.disable()
    try:
        closed = ClosedDirections(members, directions, np.array(stiffness), np.zeros(len(stiffness)))
        forces = np.random.default_rng(1).normal(size=len(stiffness))
        along = closed.orthogonal.vectors @ forces
        assert closed.vectors @ closed.from_orthogonal(forces) == pytest.approx(along, rel=1e-12)
        gone = weakref.ref(closed)
        del closed
        assert gone() is None
    finally:
        gc.enable()
