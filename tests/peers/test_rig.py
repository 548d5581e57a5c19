"""The rig's data: the paper's numbers as printed, the identified sets as close as they claim, no closer."""

import math

import numpy as np
import pytest
import scipy.linalg
from numpy.testing import assert_allclose

from multiphi_exudyn.mechanics.beam import planar_beam
from reference_models import rig as the_rig
from reference_models.exact_beam import exact_frequencies

FREE = {"measured-free": [4.00, 36.84, 108.68, 204.60], "printed-pinned": [3.08, 39.09, 119.24, 228.97]}
PINNED = {"measured-free": [19.23, 79.33, 204.59, 253.64], "printed-pinned": [14.43, 85.67, 228.03, 288.35]}
SETS = list(FREE)


def frequencies(parameter_set, pinned=False, count=4):
    """Lowest frequencies [Hz] of the finite elements; the pin by leaving its degree of freedom out."""
    structure = planar_beam(the_rig.rig_beam(parameter_set))
    held = np.flatnonzero(structure.row("node2")) if pinned else []
    free = np.setdiff1d(np.arange(structure.n), held)
    block = np.ix_(free, free)
    # M against K: the largest eigenvalues are the low modes, untouched by the round-off of the stiff ones
    inverse_squares = scipy.linalg.eigh(structure.mass[block], structure.stiffness[block], eigvals_only=True)
    return 1 / np.sqrt(inverse_squares[::-1][:count]) / (2 * math.pi)


def published(column):
    return np.array(the_rig.published_frequencies()[column].frequencies)


class TestIdentifiedSets:
    @pytest.mark.parametrize("parameter_set", SETS)
    def test_clamped_free_frequencies(self, parameter_set):
        assert_allclose(frequencies(parameter_set), FREE[parameter_set], rtol=1.5e-3)

    @pytest.mark.parametrize("parameter_set", SETS)
    def test_clamped_pinned_frequencies(self, parameter_set):
        assert_allclose(frequencies(parameter_set, pinned=True), PINNED[parameter_set], rtol=1.5e-3)

    @pytest.mark.parametrize(
        ("parameter_set", "column", "claimed"),
        [("measured-free", "measured", 0.0043), ("printed-pinned", "clamped_pinned", 0.0010)],
    )
    def test_fits_its_column_as_closely_as_it_says(self, parameter_set, column, claimed):
        fitted = frequencies(parameter_set, pinned=column == "clamped_pinned")
        assert np.sqrt(np.mean((fitted / published(column) - 1) ** 2)) < claimed

    @pytest.mark.parametrize("pins", [(), (0.4,)])
    @pytest.mark.parametrize("parameter_set", SETS)
    def test_agrees_with_the_transcendental_equation(self, parameter_set, pins):
        exact = exact_frequencies(the_rig.rig_beam(parameter_set), 4, pins)
        assert_allclose(frequencies(parameter_set, pinned=bool(pins)), exact, rtol=3e-6)

    @pytest.mark.parametrize("parameter_set", SETS)
    def test_one_pin_interlaces(self, parameter_set):
        free, pinned = frequencies(parameter_set, count=5), frequencies(parameter_set, pinned=True)
        assert np.all(free[:4] <= pinned)
        assert np.all(pinned <= free[1:])


class TestScene:
    @pytest.mark.parametrize("parameter_set", the_rig.PARAMETER_SETS)
    def test_points_of_the_beam(self, parameter_set):
        beam = the_rig.rig_beam(parameter_set)
        assert {name: beam.points[name] for name in ("node1", "node2", "node3")} == {
            "node1": 0.095,
            "node2": 0.400,
            "node3": 0.529,
        }
        holes = [beam.points[f"hole{i}"] for i in (1, 2, 3)]
        assert sorted(holes) == holes
        assert not set(holes) & {0.095, 0.400, 0.529}
        assert beam.masses[0].at == beam.points["node3"]
        assert beam.masses[0].mass == 0.213

    def test_support_is_rigid_below_node2(self):
        contact = the_rig.rig_contact()
        assert (contact.name, contact.direction, contact.gap) == ("support", "node2", 1.35e-3)
        assert contact.rigid
        assert the_rig.rig_contact(1e6).stiffness == 1e6
