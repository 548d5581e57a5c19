"""The closed forms satisfy their equations, their complementarity and their energy balance.

Independent route for the bars: the method of characteristics, which is exact on a grid with dx = c dt.
For the bilinear oscillator: scipy's integrator.
"""

import math

import numpy as np
import pytest
import scipy.linalg
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

from reference_models.bars import clamped_bar, nodes
from reference_models.exact import BilinearOscillator, BouncingBar, ClampedBar, PlasticImpact


def one_sided_slope(u, x, t, h):
    return (u(x + h, t) - u(x, t)) / h


class TestClampedBar:
    bar = ClampedBar()

    def test_contact_is_complementary_and_the_reaction_is_the_slope(self):
        t = np.linspace(0.05, 5.95, 60)
        gap, reaction = self.bar.displacement(0.0, t), self.bar.reaction(t)
        assert np.all(gap >= 0)
        assert np.all(reaction >= 0)
        assert_allclose(gap * reaction, 0)
        assert_allclose(-one_sided_slope(self.bar.displacement, 0.0, t, 1e-3), reaction, atol=1e-12)
        assert np.array_equal(self.bar.closed(t), reaction > 0)

    def test_finite_elements_start_with_its_energy_and_have_its_frequencies(self):
        structure = clamped_bar(40)
        x = nodes(40, 1.0)[:-1]
        start = self.bar.displacement(x, 0)
        assert start @ structure.stiffness @ start / 2 == pytest.approx(self.bar.energy, rel=1e-12)
        omega = np.sqrt(scipy.linalg.eigh(structure.stiffness, structure.mass, eigvals_only=True))
        s = (2 * np.arange(1, 41) - 1) * math.pi / 2 / 40  # exact for linear elements: dispersion relation
        assert_allclose(omega, 40 * np.sqrt(6 * (1 - np.cos(s)) / (2 + np.cos(s))), rtol=1e-10)


class TestBouncingBar:
    bar = BouncingBar()

    def test_contact_is_complementary_and_the_pressure_is_the_slope(self):
        t = np.linspace(0.011, 10.6, 211)
        gap, pressure = self.bar.displacement(0.0, t), self.bar.pressure(t)
        slope = one_sided_slope(self.bar.displacement, 0.0, t, 1e-6)
        assert np.all(gap >= -1e-12)
        assert np.array_equal(self.bar.closed(t), pressure > 0)
        assert_allclose(gap * pressure, 0, atol=1e-9)
        assert_allclose(-self.bar.modulus * slope[pressure > 0], pressure[pressure > 0], atol=1e-3)


class TestBilinearOscillator:
    oscillator = BilinearOscillator(mass=2.0, stiffness=50.0, contact_stiffness=3000.0, amplitude=0.01)

    def test_agrees_with_a_numerical_integration_over_two_periods(self):
        def rate(_, state):
            force = -50 * state[0] + 3000 * max(0.0, -state[0])
            return [state[1], force / 2]

        times = np.linspace(0, 2 * self.oscillator.period, 97)
        solution = solve_ivp(rate, (0, times[-1]), [0.01, 0], t_eval=times, rtol=1e-10, atol=1e-14, max_step=1e-2)
        assert_allclose(self.oscillator.displacement(times), solution.y[0], rtol=0, atol=1e-9)
        assert_allclose(self.oscillator.velocity(times), solution.y[1], rtol=0, atol=1e-8)


class TestPlasticImpact:
    gap, preload = (PlasticImpact(mass=2.0, stiffness=50.0, gap=gap, start=0.01) for gap in (4e-3, -4e-3))

    @pytest.mark.parametrize("case", [gap, preload])
    def test_equation_of_motion_and_complementarity(self, case):
        t, h = np.linspace(0.013, 5, 199), 1e-5
        x, reaction = case.displacement(t), case.reaction(t)
        smooth = np.abs(t - case.impact_time) > 2 * h
        acceleration = (case.velocity(t + h) - case.velocity(t - h)) / (2 * h)
        assert_allclose((2 * acceleration + 50 * x - reaction)[smooth], 0, atol=1e-8)
        assert np.all(x + case.gap >= -1e-15)
        assert np.all(reaction >= 0)
        assert_allclose((x + case.gap) * reaction, 0, atol=1e-15)
