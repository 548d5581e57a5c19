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


class TestPublishedTables:
    def test_columns_of_table_38_2_contradict_interlacing(self):
        free, pinned = published("clamped_free"), published("clamped_pinned")
        assert pinned[2] > free[3]
        assert "228.10" in the_rig.rig().contradiction
        assert "205.29" in the_rig.rig().contradiction

    def test_free_column_of_the_simulation_is_the_measured_one(self):
        assert np.array_equal(published("clamped_free"), published("measured"))

    def test_measured_ratios_are_fractions(self):
        ratios = the_rig.published_frequencies()["measured"].ratios
        assert_allclose(np.multiply(ratios, 100), [4.340, 1.670, 0.009, 0.240], rtol=1e-14)

    def test_no_ratios_are_published_for_the_closed_level(self):
        assert the_rig.published_frequencies()["clamped_pinned"].ratios == ()


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

    def test_density_and_modulus_are_the_papers(self):
        section = the_rig.rig_beam().sections[0]
        assert (section.youngs_modulus, section.density) == (43.5e9, 2700.0)

    def test_support_is_rigid_below_node2(self):
        contact = the_rig.rig_contact()
        assert (contact.name, contact.direction, contact.gap) == ("support", "node2", 1.35e-3)
        assert contact.rigid
        assert the_rig.rig_contact(1e6).stiffness == 1e6

    def test_modes_beyond_the_fourth_are_damped_as_the_fourth(self):
        assert_allclose(the_rig.rig_damping().of(6), [0.0434, 0.0167, 0.00009, 0.0024, 0.0024, 0.0024])

    def test_pulled_up_it_starts_clear_of_the_support(self):
        structure = planar_beam(the_rig.rig_beam())
        shape = np.linalg.solve(structure.stiffness, structure.row("hole3"))
        shape *= the_rig.initial_displacement() / (structure.row("node3") @ shape)
        assert structure.row("node2") @ shape > 5 * the_rig.rig_contact().gap


class TestAsPublished:
    def test_overrides_both_levels_with_the_printed_frequencies(self):
        override = the_rig.published_override()
        assert set(override) == {(), ("support",)}
        assert override[()].frequencies == (3.99, 37.00, 108.09, 205.29)
        assert override[("support",)].frequencies == (14.43, 85.56, 228.10, 287.90)

    def test_damps_the_closed_level_by_assumption_only(self):
        override = the_rig.published_override()
        assert override[("support",)].ratios == override[()].ratios
        assert "damping of the closed level: the measured" in "\n".join(the_rig.assumptions("as-published"))

    def test_has_the_shapes_of_the_measured_set_and_says_so(self):
        assert the_rig.rig_beam("as-published") == the_rig.rig_beam("measured-free")
        assert "mixes two systems" in the_rig.assumptions("as-published")[0]

    @pytest.mark.parametrize("parameter_set", SETS)
    def test_other_sets_override_nothing(self, parameter_set):
        assert not the_rig.published_override(parameter_set)


class TestAssumptions:
    EXPECTED = (
        "cross-section",
        "total length",
        "tip inertia",
        "Poisson ratio",
        "hole positions",
        "initial displacement",
        "gravity",
        "clamp",
        "damping above the fourth mode",
        "damping of the closed level",
    )

    @pytest.mark.parametrize("parameter_set", the_rig.PARAMETER_SETS)
    def test_each_is_listed_once_with_its_reason(self, parameter_set):
        lines = the_rig.assumptions(parameter_set)
        for quantity in self.EXPECTED:
            (line,) = [line for line in lines if line.startswith(f"{quantity}: ")]
            assert "(assumed: " in line
        assert lines[-1] == the_rig.rig().contradiction
        assert len(lines) == len(self.EXPECTED) + 2
        assert not any("\n" in line or "{" in line for line in lines)

    @pytest.mark.parametrize(("parameter_set", "width"), [(SETS[0], "60.7 mm"), (SETS[1], "22.61 mm")])
    def test_the_numbers_are_the_sets_own(self, parameter_set, width):
        assert width in the_rig.assumptions(parameter_set)[1]

    def test_texts_state_the_values_the_models_read(self):
        text = " ".join(the_rig.assumptions())
        points = the_rig.rig_beam().points
        assert f"hole3 (nearest the tip) {points['hole3']:.3f} m" in text
        assert f"{1e3 * the_rig.initial_displacement():g} mm at node3" in text
        assert f"ratio {100 * the_rig.rig_damping().beyond:g} %" in text
        structure = planar_beam(the_rig.rig_beam(), 57)
        down = np.zeros(structure.n)
        down[::2] = 9.81
        sag = structure.row("node2") @ np.linalg.solve(structure.stiffness, structure.mass @ down)
        assert f"sag by {1e3 * sag:.1f} mm at node2" in text

    @pytest.mark.parametrize("function", ["rig_beam", "assumptions", "published_override", "identified_set"])
    def test_an_unknown_set_is_refused(self, refused, function):
        refused(ValueError, "parameter_set: got 'measured'", getattr(the_rig, function), "measured")
