"""The closed forms satisfy their equations, their complementarity and their energy balance.

Independent route for the bars: the method of characteristics, which is exact on a grid with dx = c dt.
For the bilinear oscillator: scipy's integrator.
"""

import math

import numpy as np
import pytest
import scipy.linalg
from numpy.testing import assert_allclose
from scipy.integrate import quad, solve_ivp

from multiphi_exudyn.errors import MultiPhiError
from reference_models.bars import clamped_bar, free_bar, nodes
from reference_models.exact import BilinearOscillator, BouncingBar, ClampedBar, PlasticImpact

RANDOM = np.random.default_rng(7)


def by_characteristics(start, floor, *, clamped):
    """u on the grid at len(floor) instants dt = dx/c apart, from rest, over a moving floor at the first node.

    left, right: dt (u_t +- c u_x) of every cell, which one step carries on by one cell, unchanged.
    """
    left, right, bottom, history = np.diff(start), -np.diff(start), start[0], [start]
    for level in floor[1:]:
        before, bottom = bottom, max(level, bottom + left[0])
        reflected = 2 * (bottom - before) - left[0]
        left, right = np.r_[left[1:], -right[-1] if clamped else right[-1]], np.r_[reflected, right[:-1]]
        history.append(bottom + np.r_[0, np.cumsum(left - right) / 2])
    return np.array(history)


def one_sided_slope(u, x, t, h):
    return (u(x + h, t) - u(x, t)) / h


class TestClampedBar:
    bar = ClampedBar()

    def test_wave_equation_holds_as_the_parallelogram_identity(self):
        x, t = RANDOM.uniform(0.1, 0.9, 500), RANDOM.uniform(0.2, 7, 500)
        h = np.minimum(x, 1 - x) * RANDOM.uniform(0.1, 1, 500) * 0.2
        u = self.bar.displacement
        assert_allclose(u(x + h, t) + u(x - h, t), u(x, t + h) + u(x, t - h), rtol=0, atol=1e-14)

    def test_starts_at_rest_from_the_stated_shape_and_stays_clamped(self):
        x, t = np.linspace(0, 1, 21), np.linspace(0, 6, 121)
        assert_allclose(self.bar.displacement(x, 0), (1 - x) / 2)
        assert_allclose(self.bar.velocity(x[1:], 0), 0)
        assert_allclose(self.bar.displacement(1.0, t), 0, atol=1e-15)

    def test_contact_is_complementary_and_the_reaction_is_the_slope(self):
        t = np.linspace(0.05, 5.95, 60)
        gap, reaction = self.bar.displacement(0.0, t), self.bar.reaction(t)
        assert np.all(gap >= 0)
        assert np.all(reaction >= 0)
        assert_allclose(gap * reaction, 0)
        assert_allclose(-one_sided_slope(self.bar.displacement, 0.0, t, 1e-3), reaction, atol=1e-12)
        assert np.array_equal(self.bar.closed(t), reaction > 0)

    def test_velocity_is_the_rate_of_displacement(self):
        x, t, h = RANDOM.uniform(0, 1, 2000), RANDOM.uniform(0.01, 6, 2000), 1e-6
        rate = (self.bar.displacement(x, t + h) - self.bar.displacement(x, t - h)) / (2 * h)
        wrong = np.abs(rate - self.bar.velocity(x, t)) > 1e-8
        assert np.mean(wrong) < 2e-3  # only where a kink passes within h

    def test_energy_is_conserved(self):
        x, h = (np.arange(4000) + 0.5) / 4000, 1e-7
        for t in np.linspace(0.0127, 2.9873, 23):
            u_x = (self.bar.displacement(x + h, t) - self.bar.displacement(x - h, t)) / (2 * h)
            energy = np.mean(self.bar.velocity(x, t) ** 2 + u_x**2) / 2
            assert energy == pytest.approx(self.bar.energy, rel=1e-3)

    def test_impact_velocity_and_period(self):
        x = np.linspace(0, 1, 11)
        assert self.bar.velocity(0.0, 1 - 1e-12) == -0.5
        assert_allclose(self.bar.displacement(x, 2 + 1.3), self.bar.displacement(x, 5 + 1.3), atol=1e-14)
        assert_allclose(self.bar.displacement(x, 3 - 1e-13), (1 - x) / 2, atol=1e-12)

    def test_agrees_with_the_method_of_characteristics(self):
        x, times = nodes(40, 1.0), np.arange(301)[:, None] / 40
        history = by_characteristics((1 - x) / 2, np.zeros(301), clamped=True)
        assert_allclose(history, self.bar.displacement(x, times), rtol=0, atol=1e-13)

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

    def test_wave_equation_holds_as_the_parallelogram_identity(self):
        c, g = self.bar.wave_speed, self.bar.gravity
        x, t = RANDOM.uniform(0.5, 9.5, 2000), RANDOM.uniform(0.5, 11, 2000)
        h = np.minimum(x, 10 - x) / c * RANDOM.uniform(0.1, 1, 2000)
        u = self.bar.displacement
        mean_difference = u(x, t + h) + u(x, t - h) - u(x + c * h, t) - u(x - c * h, t)
        assert_allclose(mean_difference, -g * h**2, rtol=0, atol=1e-12)

    def test_contact_is_complementary_and_the_pressure_is_the_slope(self):
        t = np.linspace(0.011, 10.6, 211)
        gap, pressure = self.bar.displacement(0.0, t), self.bar.pressure(t)
        slope = one_sided_slope(self.bar.displacement, 0.0, t, 1e-6)
        assert np.all(gap >= -1e-12)
        assert np.array_equal(self.bar.closed(t), pressure > 0)
        assert_allclose(gap * pressure, 0, atol=1e-9)
        assert_allclose(-self.bar.modulus * slope[pressure > 0], pressure[pressure > 0], atol=1e-3)

    def test_upper_end_is_free(self):
        t = np.linspace(0.011, 10.6, 211)
        slope = (self.bar.displacement(10.0, t) - self.bar.displacement(10.0 - 1e-6, t)) / 1e-6
        assert_allclose(slope, 0, atol=1e-7)

    @pytest.mark.parametrize(("time", "velocity"), [(1 - 1e-9, -10), (5 / 3 + 1e-9, 10), (11 / 3 - 1e-9, -10)])
    def test_velocity_is_uniform_at_impact_and_release(self, time, velocity):
        assert_allclose(self.bar.velocity(np.linspace(0.1, 10, 50), time), velocity, atol=1e-6)

    def test_pressure_runs_from_300_to_500_and_back(self):
        times = [1, 5 / 3 - 1e-12, 11 / 3 + 1e-12, 13 / 3 - 1e-12]
        assert_allclose(self.bar.pressure(times), [300, 500, 500, 300])

    def test_velocity_is_the_rate_of_displacement(self):
        x, t, h = RANDOM.uniform(0, 10, 2000), RANDOM.uniform(0.01, 10, 2000), 1e-6
        rate = (self.bar.displacement(x, t + h) - self.bar.displacement(x, t - h)) / (2 * h)
        wrong = np.abs(rate - self.bar.velocity(x, t)) > 1e-6
        assert np.mean(wrong) < 2e-3  # only where a kink passes within h

    def test_centre_of_mass_is_the_mean_and_obeys_newton(self):
        x = (np.arange(2000) + 0.5) / 200
        for t in np.linspace(0.1, 5.3, 27):
            assert self.bar.centre_of_mass(t) == pytest.approx(np.mean(self.bar.displacement(x, t)), abs=1e-6)
        impulse = quad(lambda t: float(self.bar.pressure(t)), 1, 5 / 3)[0]
        assert impulse == pytest.approx(self.bar.density * self.bar.length * (10 + 10 + 10 * 2 / 3))

    def test_energy_is_conserved(self):
        x, h = (np.arange(4000) + 0.5) / 400, 1e-6
        for t in np.linspace(0.0127, 5.3, 31):
            u_x = (self.bar.displacement(x + h, t) - self.bar.displacement(x - h, t)) / (2 * h)
            height = self.bar.centre_of_mass(t)
            stored = 10 * np.mean(self.bar.velocity(x, t) ** 2 + 900 * u_x**2) / 2 + 100 * height
            assert stored == pytest.approx(500, rel=1e-3)

    def test_agrees_with_the_method_of_characteristics_in_the_falling_frame(self):
        elements = 60
        times = np.arange(16 * elements + 1)[:, None] / 3 / elements  # one period is 16 passages
        fallen = 5 * times**2
        history = by_characteristics(np.zeros(elements + 1), (fallen - 5)[:, 0], clamped=False)
        exact = self.bar.displacement(nodes(elements, 10.0), times)
        assert_allclose(history - fallen + 5, exact, rtol=0, atol=1e-9)

    def test_finite_elements_fall_freely_under_a_force_at_the_centre(self):
        structure = free_bar(12)
        acceleration = np.linalg.solve(structure.mass, -100 * structure.row("centre"))
        assert_allclose(acceleration, -10, rtol=1e-12)
        assert_allclose(structure.stiffness @ np.ones(13), 0, atol=1e-9)
        assert structure.row("centre") @ np.full(13, 0.3) == pytest.approx(0.3)


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

    def test_period_is_half_of_each(self):
        expected = math.pi / math.sqrt(25) + math.pi / math.sqrt(1525)
        assert self.oscillator.period == pytest.approx(expected, rel=1e-15)

    def test_energy_is_conserved(self):
        t = np.linspace(0, 3, 301)
        x, v = self.oscillator.displacement(t), self.oscillator.velocity(t)
        energy = v**2 + 25 * x**2 + 1500 * np.minimum(x, 0) ** 2
        assert_allclose(energy, 25 * 0.01**2, rtol=1e-12)

    def test_reaction_acts_only_while_closed(self):
        closing, opening = self.oscillator.closed_interval
        t = np.linspace(0.001, self.oscillator.period, 200)
        assert np.array_equal(self.oscillator.reaction(t) > 0, (t > closing) & (t < opening))


class TestPlasticImpact:
    gap, preload = (PlasticImpact(mass=2.0, stiffness=50.0, gap=gap, start=0.01) for gap in (4e-3, -4e-3))

    @pytest.mark.parametrize("case", [gap, preload])
    def test_strikes_at_the_gap_and_loses_its_kinetic_energy(self, case):
        before, after = case.impact_time - 1e-12, case.impact_time + 1e-12
        assert case.displacement(before) == pytest.approx(-case.gap, abs=1e-12)
        assert case.displacement(after) == pytest.approx(-case.gap, abs=1e-12)
        assert case.velocity(after) == pytest.approx(0, abs=1e-10)
        assert case.energy_loss == pytest.approx(float(case.velocity(before)) ** 2, rel=1e-9)

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

    def test_a_preloaded_mass_stays_and_a_free_one_leaves(self):
        assert self.preload.reaction(100.0) == pytest.approx(0.2)
        assert self.gap.displacement(self.gap.impact_time + math.pi / self.gap.omega) == pytest.approx(4e-3)

    @pytest.mark.parametrize("changes", [{"gap": 0.0}, {"gap": 0.02}, {"mass": -1.0}, {"start": math.nan}])
    def test_refuses_data_outside_the_closed_form(self, changes):
        with pytest.raises(MultiPhiError, match=f"{next(iter(changes))}: got .*, need"):
            PlasticImpact(**{"mass": 1.0, "stiffness": 1.0, "gap": 1e-3, "start": 0.01} | changes)
