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
        assert closed.orthogonal.vectors.shape == directions.shape
        gone = weakref.ref(closed)
        del closed
        assert gone() is None
    finally:
        gc.enable()


@pytest.mark.parametrize("stiffness", [[np.inf, 1e6, np.inf], [2.0, np.inf, np.inf, 1e4, np.inf]])
def test_forces_along_orthogonal_directions_are_the_same_forces_along_their_own(stiffness):
    random = np.random.default_rng(2)
    directions = random.normal(size=(7, len(stiffness)))
    members = tuple((i,) for i in range(len(stiffness)))
    closed = ClosedDirections(members, directions, np.array(stiffness), random.normal(size=len(stiffness)))
    rigid = closed.orthogonal.vectors[:, closed.rigid]
    assert rigid.T @ rigid == pytest.approx(np.diag([rigid[:, 0] @ rigid[:, 0]] * rigid.shape[1]), abs=1e-13)
    forces = random.normal(size=len(stiffness))
    own = closed.from_orthogonal(forces)
    assert own[~closed.rigid] == pytest.approx(forces[~closed.rigid], rel=0)
    assert directions @ own == pytest.approx(closed.orthogonal.vectors @ forces, rel=1e-12)
