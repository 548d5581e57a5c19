"""Rows of a level: gaps, damping and contact forces of its modes, compiled and plain, beside NumPy's least squares."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import multiphi_exudyn as mp
from multiphi_exudyn.events.packing import level_records
from multiphi_exudyn.events.packing.level_arrays import LevelArrays
from multiphi_exudyn.events.transitions import defect_forms, exits
from multiphi_exudyn.events.transitions.loaded_levels import LoadedLevels
from multiphi_exudyn.levels.level import level_rows, static_response
from multiphi_exudyn.levels.level.build_level import build_level
from multiphi_exudyn.mathematics import orthonormal
from multiphi_exudyn.mathematics.eigenproblems import modes
from multiphi_exudyn.mathematics.response import free_response
from multiphi_exudyn.mathematics.round_off import ZERO

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
    assert_array_equal(np.flatnonzero(build_level(base, (0,), 9).following), [0, 5])
    assert_array_equal(np.flatnonzero(build_level(base, (0, 2), 9).following), [0, 2, 5])
    assert base.independent([0, 2])
    assert not base.independent([0, 5])
    assert not base.independent([0, 2, 5])


ENTRIES = [
    (level_rows, "fill_rows"),
    (orthonormal, "span"),
    (static_response, "write_gaps"),
    (static_response, "single_response"),
    (modes, "set_signs"),
    (orthonormal, "largest_error"),
    (orthonormal, "remove_from"),
    (free_response, "write_closed_form"),
    (level_records, "write_record"),
    (exits, "fill_signals"),
    (defect_forms, "write_motions"),
    (defect_forms, "copy_triangles"),
]


def packed(closed):
    """All buffers after a level, the map to it and its powers are packed."""
    made = model()
    arrays = LevelArrays(LoadedLevels.static(made, np.ones(made.base.modes.count)))
    states = [int(i in closed) for i in range(len(made.contacts))]
    new, old = arrays.level(states), arrays.level([0] * len(states))
    arrays._add_map(old, new)
    arrays.add_powers(new)
    return [each.copy() for each in arrays.buffers.all]


@pytest.mark.parametrize("closed", SETS)
def test_plain_python_packs_what_compiled_functions_do(monkeypatch, closed):
    compiled = packed(closed)
    for module, entry in ENTRIES:
        monkeypatch.setattr(module, entry, getattr(module, entry).plain)
    ints, numbers, waves = packed(closed)
    assert_array_equal(ints, compiled[0])
    for own, other in ((numbers, compiled[1]), (waves, compiled[2])):
        assert_allclose(own, other, rtol=1e-9, atol=1e-12 * np.max(np.abs(own[np.isfinite(own)])))


def test_a_struck_contact_that_closed_ones_hold_takes_no_further_motion():
    made = model()
    between = mp.UnilateralContact("between", {"p0": 0.6, "p2": 0.8}, 1e-3, math.inf)
    made = mp.MultiPhiModel(made.structure, [*made.contacts, between], modes=9)
    levels = LoadedLevels.static(made, np.ones(made.base.modes.count))
    entered = levels.transition(levels.level((0,) * 7), levels.level((1, 0, 1, *(0,) * 4)))
    alone, struck = (defect_forms.defect_form(entered, stopped).factors for stopped in ((), (6,)))
    size = 1 + sum(entered.matrix.shape)
    forms = [moving.T @ moving for moving in (f[size**2 :].reshape(size - 1, size - 1) for f in (alone, struck))]
    assert_allclose(forms[1], forms[0], rtol=0, atol=1e-12 * np.max(forms[0]))
