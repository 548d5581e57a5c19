"""The planar beam against its transcendental equation and exact statics; supports and units as must be."""

import dataclasses
import math

import numpy as np
import pytest
import scipy.linalg
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from multiphi_exudyn.mechanics.beam import Beam, Clamp, PointMass, Section, beam_nodes, planar_beam
from reference_models import rig
from reference_models.exact_beam import exact_frequencies

LENGTH = 0.5


def rectangle(height, start=0.0, end=LENGTH, **changes):
    material = {"width": 0.02, "youngs_modulus": 70e9, "density": 2700.0}
    return Section.rectangle(start, end, height=height, **material | changes)


def beam(*sections, **changes):
    points = {"mid": LENGTH / 2, "tip": LENGTH}
    return Beam(sections or (rectangle(0.002),), **{"points": points} | changes)


def frequencies(structure, count, pinned=()):
    """Lowest ``count`` frequencies [Hz]; pins by leaving out their degrees of freedom.

    M against K + s M: the low modes are its largest eigenvalues, which round-off leaves alone; the shift s
    [1/s2] lets a free body in.
    """
    held = [np.flatnonzero(structure.row(point))[0] for point in pinned]
    free = np.setdiff1d(np.arange(structure.n), held)
    mass, stiffness = (matrix[np.ix_(free, free)] for matrix in (structure.mass, structure.stiffness))
    shift = 1e3
    inverse = scipy.linalg.eigh(mass, stiffness + shift * mass, eigvals_only=True)[::-1][:count]
    return np.sqrt(np.maximum(1 / inverse - shift, 0)) / (2 * math.pi)


class Convergence:
    """Errors of the lowest four frequencies fall at ``rate`` as the elements are halved, below ``ceiling``.

    The element's statics are exact, so its inertia alone is in error: (l/L)^4 in bending, and (h/L)^2 (l/L)^2
    in shear, which takes over once an element is shorter than the section is high.
    """

    subject = beam()
    pinned = ()
    elements = (4, 8, 16)
    rate = 3.85
    ceiling = 6e-5

    def errors(self):
        positions = [self.subject.points[point] for point in self.pinned]
        exact = exact_frequencies(self.subject, 4, positions)
        runs = [frequencies(planar_beam(self.subject, n), 8, self.pinned) for n in self.elements]
        return np.array([np.abs(run[run > 1.0][:4] / exact - 1) for run in runs])

    def test_rate(self):
        errors = self.errors()
        assert np.all(np.log2(errors[-2] / errors[-1]) > self.rate)

    def test_ceiling(self):
        assert np.all(self.errors()[-1] < self.ceiling)


class TestSlenderCantilever(Convergence):
    subject = beam(masses=[PointMass(LENGTH, 0.05, 2e-5)])


class TestSlenderPinnedCantilever(Convergence):
    subject = beam(masses=[PointMass(LENGTH, 0.05, 2e-5)])
    pinned = ("mid",)
    ceiling = 1e-4


class TestMassBeforeTheEnd(Convergence):
    subject = beam(masses=[PointMass(0.75 * LENGTH, 0.05, 2e-5)])
    rate = 3.7
    ceiling = 1e-4
    elements = (8, 16, 32)


class TestSteppedBeam(Convergence):
    subject = beam(rectangle(0.003, end=0.25), rectangle(0.002, start=0.25))
    rate = 3.75
    ceiling = 2e-4


class TestElasticClamp(Convergence):
    subject = beam(masses=[PointMass(LENGTH, 0.05, 2e-5)], clamp=Clamp(2e4, 30.0))


class TestFreeFree(Convergence):
    subject = beam(clamp=Clamp(0.0, 0.0))
    elements = (8, 16, 32)
    rate = 3.68
    ceiling = 4e-5


class TestStockyCantilever(Convergence):
    subject = beam(rectangle(0.1), masses=[PointMass(LENGTH, 0.05, 2e-5)])
    rate = 1.97
    ceiling = 8e-3

    def test_shear_and_rotary_inertia_matter_here(self):
        with_shear, without = (exact_frequencies(self.subject, 4, shear=shear) for shear in (True, False))
        assert np.all(with_shear < without * [0.98, 0.85, 0.75, 0.65])


class TestTranscendentalFrequencies:
    def test_of_the_printed_pinned_rig_as_a_euler_bernoulli_beam(self):
        free = exact_frequencies(rig.rig_beam("printed-pinned"), 4, shear=False)
        pinned = exact_frequencies(rig.rig_beam("printed-pinned"), 4, [0.4], shear=False)
        assert_allclose(free, [3.080953, 39.092678, 119.236867, 228.974849], rtol=0, atol=6e-7)
        assert_allclose(pinned, [14.433174, 85.671959, 228.027525, 288.353679], rtol=0, atol=6e-7)

    def test_of_a_bare_cantilever_are_the_textbook_s(self):
        section = rectangle(0.002)
        beta = np.array([1.875104068711961, 4.694091132974175, 7.854757438237613, 10.995540734875467])
        scale = math.sqrt(section.youngs_modulus * section.second_moment / (section.density * section.area))
        expected = (beta / LENGTH) ** 2 * scale / (2 * math.pi)
        assert_allclose(exact_frequencies(beam(), 4, shear=False), expected, rtol=1e-12)

    def test_a_pin_outside_the_beam_is_refused(self, refused):
        refused(ValueError, "pins: got x = 0.6", exact_frequencies, beam(), 4, [0.6])


class TestStatics:
    @pytest.mark.parametrize("height", [0.002, 0.1])
    @pytest.mark.parametrize("elements", [1, 7])
    def test_tip_deflection_is_exact_on_any_mesh(self, height, elements):
        section = rectangle(height)
        structure = planar_beam(beam(section, points={"tip": LENGTH}), elements)
        tip = structure.row("tip")
        bending = LENGTH**3 / (3 * section.youngs_modulus * section.second_moment)
        shear = LENGTH / (section.shear_factor * section.shear_modulus * section.area)
        assert tip @ np.linalg.solve(structure.stiffness, tip) == pytest.approx(bending + shear, rel=1e-9)

    def test_deflection_inside_follows_the_cubic(self):
        section = rectangle(0.002)
        structure = planar_beam(beam(), 6)
        flexibility = structure.row("mid") @ np.linalg.solve(structure.stiffness, structure.row("tip"))
        a = LENGTH / 2
        bending = a**2 * (3 * LENGTH - a) / (6 * section.youngs_modulus * section.second_moment)
        shear = a / (section.shear_factor * section.shear_modulus * section.area)
        assert flexibility == pytest.approx(bending + shear, rel=1e-9)

    def test_of_two_sections_each_counts_over_its_own_length(self):
        near, far = rectangle(0.003, end=0.2), rectangle(0.002, start=0.2)
        structure = planar_beam(Beam([near, far], {"tip": LENGTH}), 5)
        bending_near, bending_far = (s.youngs_modulus * s.second_moment for s in (near, far))
        bending = (LENGTH**3 - 0.3**3) / (3 * bending_near) + 0.3**3 / (3 * bending_far)
        shear = sum((s.end - s.start) / (s.shear_factor * s.shear_modulus * s.area) for s in (near, far))
        tip = structure.row("tip")
        assert tip @ np.linalg.solve(structure.stiffness, tip) == pytest.approx(bending + shear, rel=1e-9)

    def test_elastic_clamp_adds_its_own_flexibility(self):
        rigid, soft = (planar_beam(beam(clamp=clamp), 6) for clamp in (Clamp(), Clamp(2e4, 30.0)))
        rigid_tip, soft_tip = (s.row("tip") @ np.linalg.solve(s.stiffness, s.row("tip")) for s in (rigid, soft))
        assert soft_tip - rigid_tip == pytest.approx(1 / 2e4 + LENGTH**2 / 30.0, rel=1e-9)


class TestInertia:
    def test_rigid_motions_cost_no_strain_energy_and_have_the_exact_kinetic_energy(self):
        section = rectangle(0.05)
        tip = PointMass(LENGTH, 0.3, 4e-4)
        structure = planar_beam(beam(section, masses=[tip], clamp=Clamp(0.0, 0.0)), 9)
        nodes = beam_nodes(beam(section, masses=[tip]), 9)
        lift, turn = np.zeros((2, structure.n))
        lift[::2], turn[::2], turn[1::2] = 1.0, nodes, 1.0
        line = section.density * section.area
        about_the_end = line * LENGTH**3 / 3 + section.density * section.second_moment * LENGTH
        expected = [
            [line * LENGTH + 0.3, line * LENGTH**2 / 2 + 0.3 * LENGTH],
            [line * LENGTH**2 / 2 + 0.3 * LENGTH, about_the_end + 0.3 * LENGTH**2 + 4e-4],
        ]
        motions = np.array([lift, turn])
        assert_allclose(motions @ structure.mass @ motions.T, expected, rtol=1e-12)
        strain = motions @ structure.stiffness @ motions.T
        assert_allclose(strain, 0, atol=1e-13 * np.max(np.abs(structure.stiffness)))

    def test_a_free_beam_has_two_rigid_body_modes(self):
        found = frequencies(planar_beam(beam(clamp=Clamp(0.0, 0.0)), 8), 4)
        assert np.all(found[:2] < 1e-3)
        assert np.all(found[2:] > 40)


class TestUnits:
    def test_millimetres_and_tonnes_change_nothing(self):
        metres = beam(masses=[PointMass(LENGTH, 0.05, 2e-5)], clamp=Clamp(2e4, 30.0))
        section = Section.rectangle(0.0, 500.0, width=20.0, height=2.0, youngs_modulus=70e3, density=2700e-12)
        millimetres = Beam(  # mm, t, s: N, N/mm, MPa
            [section],
            {"mid": 250.0, "tip": 500.0},
            [PointMass(500.0, 0.05e-3, 2e-5 * 1e3)],
            Clamp(2e4 * 1e-3, 30.0 * 1e3),
        )
        for pinned in ((), ("mid",)):
            si, other = (frequencies(planar_beam(b, 12), 4, pinned) for b in (metres, millimetres))
            assert_allclose(si, other, rtol=1e-9)
            exact_si, exact_other = (
                exact_frequencies(b, 4, [b.points[p] for p in pinned]) for b in (metres, millimetres)
            )
            assert_allclose(exact_si, exact_other, rtol=1e-11)


def test_a_section_takes_its_properties_by_name_alone():
    with pytest.raises(TypeError, match="positional"):
        Section(0.0, 1.0, 2.1e11, 7850.0, 1e-4, 1e-9, 8e10)


class TestClampLimits:
    def test_a_stiff_clamp_tends_to_the_rigid_one_and_a_soft_one_to_none(self):
        rigid, stiff = (frequencies(planar_beam(beam(clamp=c), 12), 3) for c in (Clamp(), Clamp(1e11, 1e8)))
        assert_allclose(stiff, rigid, rtol=1e-6)
        free, soft = (frequencies(planar_beam(beam(clamp=c), 12), 4) for c in (Clamp(0.0, 0.0), Clamp(1e-6, 1e-8)))
        assert_allclose(soft[2:], free[2:], rtol=1e-6)

    def test_holding_only_the_deflection_leaves_a_hinge(self):
        found = frequencies(planar_beam(beam(clamp=Clamp(math.inf, 0.0)), 12), 2)
        assert found[0] < 1e-3
        assert found[1] > 10

    def test_a_point_at_a_rigid_clamp_does_not_move(self):
        structure = planar_beam(beam(points={"root": 0.0}), 4)
        assert not structure.row("root").any()


POSITION = st.floats(0.0, LENGTH)


class TestNodes:
    @given(st.lists(POSITION, max_size=6), st.lists(POSITION, max_size=3), st.integers(1, 60))
    def test_stand_exactly_at_points_and_masses(self, points, masses, elements):
        subject = beam(points={f"p{i}": x for i, x in enumerate(points)}, masses=[PointMass(x, 0.1) for x in masses])
        nodes = beam_nodes(subject, elements)
        for x in (*points, *masses, 0.0, LENGTH):
            assert np.min(np.abs(nodes - x)) <= 1e-9 * LENGTH
        assert np.all(np.diff(nodes) > 0)
        assert np.max(np.diff(nodes)) <= LENGTH / elements * (1 + 1e-6)
        assert len(nodes) <= elements + 2 + len(points) + len(masses)

    @pytest.mark.parametrize("elements", [1, 7, 57])
    def test_named_points_of_the_rig_lie_on_nodes_bit_for_bit(self, elements):
        subject = rig.rig_beam()
        assert set(subject.points.values()) <= set(beam_nodes(subject, elements))

    def test_without_points_the_elements_are_equal_and_as_many_as_asked_for(self):
        assert_allclose(beam_nodes(beam(points={}), 7), np.linspace(0, LENGTH, 8), rtol=1e-15)

    def test_section_ends_are_nodes(self):
        assert 0.1 in beam_nodes(beam(rectangle(0.003, end=0.1), rectangle(0.002, start=0.1)), 3)

    def test_a_point_is_the_deflection_of_its_node(self):
        structure = planar_beam(beam(), 4)
        assert np.flatnonzero(structure.row("mid")).tolist() == [2]
        assert np.flatnonzero(structure.row("tip")).tolist() == [6]
        assert structure.n == 8


BAD_SECTIONS = [
    (ValueError, "section: got start 0.5, end 0.5", {"start": LENGTH}),
    (ValueError, "section: got start nan", {"start": math.nan}),
    (ValueError, "section: got start 0.0, end inf", {"end": math.inf}),
    (TypeError, "section start: got 'a'", {"start": "a"}),
    (TypeError, "section end: got None", {"end": None}),
    (ValueError, "width: got 0", {"width": 0}),
    (ValueError, "height: got -0.002", {"height": -0.002}),
    (ValueError, "height: got nan", {"height": math.nan}),
    (TypeError, "height: got 'thin'", {"height": "thin"}),
    (TypeError, "height: got True", {"height": True}),
    (TypeError, "width: got (1+0j)", {"width": 1 + 0j}),
    (ValueError, "youngs_modulus: got -1", {"youngs_modulus": -1}),
    (TypeError, "youngs_modulus: got None", {"youngs_modulus": None}),
    (ValueError, "section density: got inf", {"density": math.inf}),
    (ValueError, "poisson_ratio: got -1", {"poisson_ratio": -1}),
    (ValueError, "poisson_ratio: got 0.6", {"poisson_ratio": 0.6}),
    (ValueError, "poisson_ratio: got nan", {"poisson_ratio": math.nan}),
    (TypeError, "rectangle poisson_ratio: got 'steel'", {"poisson_ratio": "steel"}),
]

BAD_BEAMS = [
    (ValueError, "sections: got none", {"sections": []}),
    (TypeError, "sections: got Section", {"sections": rectangle(0.002)}),
    (TypeError, "sections[0]: got str", {"sections": ["thin"]}),
    (ValueError, "sections: one ends at 0.5 m", {"sections": [rectangle(0.002), rectangle(0.002, 0.6, 0.7)]}),
    (ValueError, "points['tip']: got x = 0.6 m", {"points": {"tip": 0.6}}),
    (ValueError, "points['tip']: got x = nan m", {"points": {"tip": math.nan}}),
    (TypeError, "points['tip']: got 'end'", {"points": {"tip": "end"}}),
    (TypeError, "points: got the name 3", {"points": {3: 0.1}}),
    (TypeError, "points: got list", {"points": ["tip"]}),
    (ValueError, "point mass 1: got x = -0.1 m", {"masses": [PointMass(0.1, 1.0), PointMass(-0.1, 1.0)]}),
    (TypeError, "masses: got PointMass", {"masses": PointMass(0.1, 1.0)}),
    (TypeError, "masses[0]: got float", {"masses": [0.2]}),
    (TypeError, "clamp: got float", {"clamp": 1e6}),
]


class TestBadInput:
    @pytest.mark.parametrize(("kind", "begins", "changes"), BAD_SECTIONS)
    def test_rectangle(self, refused, kind, begins, changes):
        refused(kind, begins, rectangle, **{"height": 0.002} | changes)

    @pytest.mark.parametrize(
        "name", ["youngs_modulus", "density", "area", "second_moment", "shear_modulus", "shear_factor"]
    )
    def test_section(self, refused, name):
        section = rectangle(0.002)
        refused(ValueError, f"section {name}: got 0.0", dataclasses.replace, section, **{name: 0.0})
        refused(TypeError, f"section {name}: got 'x'", dataclasses.replace, section, **{name: "x"})

    @pytest.mark.parametrize(
        ("kind", "begins", "changes"),
        [
            (ValueError, "point mass: got mass -1.0", {"mass": -1.0}),
            (ValueError, "point mass: got mass nan", {"mass": math.nan}),
            (ValueError, "point mass: got mass 1.0, inertia -1.0", {"inertia": -1.0}),
            (TypeError, "point mass mass: got 'heavy'", {"mass": "heavy"}),
            (TypeError, "point mass inertia: got None", {"inertia": None}),
            (TypeError, "point mass at: got 'tip'", {"at": "tip"}),
        ],
    )
    def test_point_mass(self, refused, kind, begins, changes):
        refused(kind, begins, PointMass, **{"at": 0.1, "mass": 1.0} | changes)

    @pytest.mark.parametrize(
        ("kind", "begins", "arguments"),
        [
            (ValueError, "clamp: got translation -1.0", (-1.0, 0.0)),
            (ValueError, "clamp: got translation inf, rotation nan", (math.inf, math.nan)),
            (TypeError, "clamp translation: got 'rigid'", ("rigid", 0.0)),
            (TypeError, "clamp rotation: got None", (0.0, None)),
        ],
    )
    def test_clamp(self, refused, kind, begins, arguments):
        refused(kind, begins, Clamp, *arguments)

    @pytest.mark.parametrize(("kind", "begins", "changes"), BAD_BEAMS)
    def test_beam(self, refused, kind, begins, changes):
        refused(kind, begins, Beam, **{"sections": [rectangle(0.002)]} | changes)

    @pytest.mark.parametrize(
        ("kind", "elements"), [(ValueError, 0), (ValueError, -3), (TypeError, 2.0), (TypeError, True)]
    )
    def test_elements(self, refused, kind, elements):
        refused(kind, f"elements: got {elements}", planar_beam, beam(), elements)

    def test_something_that_is_no_beam(self, refused):
        refused(TypeError, "beam: got str", planar_beam, "beam")

    def test_inputs_are_neither_modified_nor_shared(self):
        sections, points, masses = [rectangle(0.002)], {"tip": LENGTH}, [PointMass(LENGTH, 0.1)]
        subject = Beam(sections, points, masses)
        sections.clear()
        points.clear()
        masses.clear()
        assert len(subject.sections) == len(subject.points) == len(subject.masses) == 1
