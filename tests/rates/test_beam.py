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


class TestSteppedBeam(Convergence):
    subject = beam(rectangle(0.003, end=0.25), rectangle(0.002, start=0.25))
    rate = 3.75
    ceiling = 2e-4


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
    def test_of_a_bare_cantilever_are_the_textbook_s(self):
        section = rectangle(0.002)
        beta = np.array([1.875104068711961, 4.694091132974175, 7.854757438237613, 10.995540734875467])
        scale = math.sqrt(section.youngs_modulus * section.second_moment / (section.density * section.area))
        expected = (beta / LENGTH) ** 2 * scale / (2 * math.pi)
        assert_allclose(exact_frequencies(beam(), 4, shear=False), expected, rtol=1e-12)


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

    @pytest.mark.parametrize(("kind", "begins", "changes"), BAD_BEAMS)
    def test_beam(self, refused, kind, begins, changes):
        refused(kind, begins, Beam, **{"sections": [rectangle(0.002)]} | changes)
