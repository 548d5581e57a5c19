"""Rows of a level: gaps, damping and contact forces of its modes, beside NumPy's least squares."""

import math

import numpy as np
import pytest
from base_levels import build_level
from numpy.testing import assert_allclose

import multiphi_exudyn as mp
import multiphi_exudyn._core as core
from multiphi_exudyn.mathematics.round_off import ZERO
from multiphi_exudyn.time.loaded_levels import LoadedLevels

DAMPINGS = [mp.RayleighDamping(0.5, 1e-5), mp.ModalDamping(0.01)]
SETS = [(0,), (1,), (0, 1), (0, 1, 2), (0, 1, 3), (0, 2, 3, 4), (1, 2, 3), (3, 4)]


def model(damping=DAMPINGS[0], modes=9):
    """A chain with rigid contacts 0 and 2, springs 1 and 3, and a viscous one 4; 5 is at the place of 0."""
    n = 14
    stiffness = 4e4 * (2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))
    places = {f"p{i}": (3 * i + 1) % n for i in range(5)}
    chain = mp.LinearStructure(np.diag(np.linspace(1.0, 2.0, n)), stiffness, damping, places)
    given = [(math.inf, 0.0), (1e6, 0.0), (math.inf, 0.0), (3e5, 0.0), (2e5, 8.0)]
    contacts = [mp.UnilateralContact(f"c{i}", f"p{i}", 1e-3 * (i + 1), k, damping=d) for i, (k, d) in enumerate(given)]
    return mp.MultiPhiModel(chain, [*contacts, mp.UnilateralContact("twin", "p0", 1e-3, math.inf)], modes=modes)


@pytest.mark.parametrize("damping", DAMPINGS)
@pytest.mark.parametrize("closed", SETS)
def test_reactions_are_the_weighted_least_squares_solution(damping, closed):
    base = model(damping).base
    level = build_level(base, closed, 9)
    directions = base.directions[:, closed]
    rigid = np.isinf(base.stiffnesses[list(closed)])
    springs = np.where(rigid, 0.0, base.stiffnesses[list(closed)])
    pressed = -springs[:, None] * (directions.T @ level.vectors)
    lengths = springs * np.linalg.norm(directions, axis=0)  # of the sums k h^T psi; psi is a unit vector
    assert np.all(np.abs(level.force_rows - pressed)[~rigid] <= ZERO * lengths[~rigid, None])
    damped = base.damping_matrix(closed) @ level.vectors
    for j, square in enumerate(level.squares):
        weights = 1 / np.sqrt(base.squares + abs(square))
        residual = (base.squares - square) * level.vectors[:, j] - directions @ pressed[:, j]
        reaction = np.linalg.lstsq(weights[:, None] * directions[:, rigid], weights * residual, rcond=None)[0]
        rate = np.linalg.lstsq(directions[:, rigid], damped[:, j], rcond=None)[0]
        assert_allclose(level.force_rows[rigid, j], reaction, rtol=1e-9, atol=1e-9 * np.abs(level.force_rows).max())
        assert_allclose(level.force_rate_rows[rigid, j], rate, rtol=1e-9, atol=1e-12)
    assert_allclose(level.damping, level.vectors.T @ damped, rtol=0, atol=1e-13 * np.max(level.damping))


def test_a_rigid_contact_holds_the_gap_of_its_twin_and_of_what_others_span():
    base = model().base
    for closed, held in ((0,), {0, 5}), ((0, 2), {0, 2, 5}):
        rows = build_level(base, closed, 9).gap_rows
        assert {i for i, row in enumerate(rows) if not row.any()} == held
    assert base.independent([0, 2])
    assert not base.independent([0, 5])
    assert not base.independent([0, 2, 5])


def test_a_struck_contact_that_closed_ones_hold_takes_no_further_motion():
    made = model()
    between = mp.UnilateralContact("between", {"p0": 0.6, "p2": 0.8}, 1e-3, math.inf)
    made = mp.MultiPhiModel(made.structure, [*made.contacts, between], modes=9)
    levels = LoadedLevels.static(made, np.ones(made.base.modes.count))
    entered = core.Transition(levels.level((0,) * 7).of_core, levels.level((1, 0, 1, *(0,) * 4)).of_core)
    alone, struck = (core.DefectForm(entered, stopped).moving for stopped in ([], [6]))
    assert_allclose(struck.T @ struck, alone.T @ alone, rtol=0, atol=1e-12 * np.max(alone.T @ alone))
