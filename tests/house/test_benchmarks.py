"""Published exact answers: the bar on a rigid stop, the bouncing bar, oscillators with one contact."""

import itertools
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import multiphi_exudyn as mp
from reference_models.bars import clamped_bar, free_bar
from reference_models.bars import nodes as bar_nodes
from reference_models.exact import BilinearOscillator, BouncingBar, ClampedBar, PlasticImpact


def observed_rates(errors, ratio):
    return np.log(np.array(errors)[:-1] / np.array(errors)[1:]) / math.log(ratio)


class TestBarOnAStop:
    """u_tt = u_xx, u(1) = 0, u(0) >= 0: open for 1, closed for 1, period 3 (Dabaghi, Petrov, Pousin, Renard)."""

    ELEMENTS = (10, 40, 160)
    exact = ClampedBar()

    @pytest.fixture(scope="class")
    @classmethod
    def runs(cls):
        return [cls.run(elements) for elements in cls.ELEMENTS]

    @classmethod
    def run(cls, elements):
        model = mp.MultiPhiModel(clamped_bar(elements), [mp.UnilateralContact("stop", "contact", 0.0)], modes="all")
        start = cls.exact.displacement(bar_nodes(elements, 1.0)[:-1], 0.0)
        return mp.simulate(model, 3.0, displacement=start)

    def l2_error(self, trajectory, elements):
        x = bar_nodes(elements, 1.0)
        error = np.append(trajectory.displacement(3.0), 0.0) - self.exact.displacement(x, 3.0)
        return math.sqrt(np.trapezoid(error**2, x))

    def test_displacement_converges_after_one_period(self, runs):
        errors = [self.l2_error(run, n) for run, n in zip(runs, self.ELEMENTS, strict=True)]
        assert np.all(np.array(errors) <= [0.031, 0.0125, 0.0050])
        assert np.all(observed_rates(errors, 4) > 0.6)

    def test_release_converges_to_2(self, runs):
        releases = [run.contact_intervals("stop")[-1][1] for run in runs]
        errors = np.abs(np.array(releases) - 2.0)
        assert np.all(errors <= [0.075, 0.025, 0.0095])
        assert np.all(observed_rates(errors, 4) > 0.6)

    def test_impact_is_at_1_and_loses_one_element(self, runs):
        firsts = [run.events[0] for run in runs]
        assert [first.time for first in firsts] == pytest.approx([1.0] * 3, abs=0.02)
        losses = np.array([first.loss.impact for first in firsts]) / self.exact.energy
        assert np.all(losses <= [0.035, 0.0070, 0.0019])
        assert np.all(observed_rates(losses, 4) > 0.9)

    def test_reaction_is_one_half(self, runs):
        finest = runs[-1]
        impulse = finest.contact_impulse("stop", 0.9, 2.1)
        assert impulse == pytest.approx(0.5, rel=0.01)

    def test_one_contact_phase_on_fine_meshes(self, runs):
        for run in runs[1:]:
            assert len(run.contact_intervals("stop")) == 1


class TestBouncingBar:
    """A free bar under gravity over a rigid floor (Doyen, Ern, Piperno 2011): a rigid-body mode and a load."""

    ELEMENTS = (20, 80, 320)
    exact = BouncingBar()

    @pytest.fixture(scope="class")
    @classmethod
    def runs(cls):
        return [cls.run(elements) for elements in cls.ELEMENTS]

    @classmethod
    def run(cls, elements, t_end=4.5):
        structure = free_bar(elements)
        floor = mp.UnilateralContact("floor", "bottom", gap=5.0)
        weight = mp.ConstantLoad("centre", -100.0)
        return mp.simulate(mp.MultiPhiModel(structure, [floor], modes="all"), t_end, loads=[weight])

    def phase(self, run, start):
        """First closing and last opening of the contact phase that begins near ``start``."""
        intervals = [i for i in run.contact_intervals("floor") if start - 0.2 < i[0] < start + 1.2]
        return intervals[0][0], intervals[-1][1]

    def test_first_contact_is_exact_and_release_converges(self, runs):
        phases = [self.phase(run, 1.0) for run in runs]
        assert [phase[0] for phase in phases] == pytest.approx([1.0] * 3, abs=1e-12)
        errors = np.abs(np.array([phase[1] for phase in phases]) - 5 / 3)
        assert np.all(errors <= [0.05, 0.02, 0.008])
        assert np.all(observed_rates(errors, 4) > 0.5)

    def test_second_contact_converges(self, runs):
        errors = np.abs(np.array([self.phase(run, 11 / 3)[0] for run in runs]) - 11 / 3)
        assert np.all(errors <= [0.17, 0.075, 0.03])
        assert np.all(observed_rates(errors, 4) > 0.5)

    def test_mean_contact_pressure_rises_from_300_to_500(self, runs):
        windows = np.linspace(1.1, 1.6, 6)
        found = [runs[-1].contact_impulse("floor", a, b) / (b - a) for a, b in itertools.pairwise(windows)]
        expected = self.exact.pressure((windows[:-1] + windows[1:]) / 2)
        assert np.allclose(found, expected, rtol=0.03)

    def test_momentum_after_release_is_that_of_plus_10(self, runs):
        centre = [float(run.model.structure.row("centre") @ run.velocity(2.0)) for run in runs]
        expected = 10 - 10 * (2.0 - 5 / 3)
        assert np.abs(np.array(centre) - expected)[-1] < 0.1
        assert np.all(np.diff(np.abs(np.array(centre) - expected)) < 0)

    def test_ledger_closes(self, runs):
        for run in runs:
            assert abs(run.ledger.residual) < 1e-10 * 500  # of the potential energy m g h0


def one_dof(stiffness, gap, contact=math.inf, mass=2.0):
    structure = mp.LinearStructure([[mass]], [[stiffness]], points={"x": 0})
    return mp.MultiPhiModel(structure, [mp.UnilateralContact("stop", "x", gap, contact)], modes="all")


class TestOneDegreeOfFreedom:
    def test_bilinear_oscillator_has_its_closed_form(self):
        exact = BilinearOscillator(mass=2.0, stiffness=50.0, contact_stiffness=800.0, amplitude=0.1)
        run = mp.simulate(one_dof(50.0, 0.0, 800.0), 5 * exact.period, displacement=[0.1])
        t = np.linspace(0, 5 * exact.period, 2001)
        assert np.max(np.abs(run.at("x", t) - exact.displacement(t))) < 1e-12
        closings = [event.time for event in run.events if event.kind == "close"]
        assert np.diff(closings) == pytest.approx([exact.period] * 4, rel=1e-12)

    def test_plastic_impact_has_its_closed_form(self):
        exact = PlasticImpact(mass=2.0, stiffness=50.0, gap=0.03, start=0.1)
        run = mp.simulate(one_dof(50.0, 0.03), 3.0, displacement=[0.1])
        t = np.linspace(0, 3, 2001)
        assert np.max(np.abs(run.at("x", t) - exact.displacement(t))) < 1e-13
        assert run.ledger.impact == pytest.approx(exact.energy_loss, rel=1e-12)
        assert run.events[0].time == pytest.approx(exact.impact_time, rel=1e-13)


class TestTwoMassesOverAStop:
    """A chain of two masses, the second over a stop, against an event-driven integrator at 1e-12."""

    MASS, STIFFNESS = np.diag([1.0, 0.4]), np.array([[300.0, -100.0], [-100.0, 100.0]])
    START, GAP, END = np.array([0.02, 0.08]), 0.01, 2.0

    def model(self, contact_stiffness):
        structure = mp.LinearStructure(self.MASS, self.STIFFNESS, points={"upper": 0, "lower": 1})
        return mp.MultiPhiModel(
            structure, [mp.UnilateralContact("stop", "lower", self.GAP, contact_stiffness)], modes="all"
        )

    def acceleration(self, x):
        return -self.STIFFNESS @ x / np.diag(self.MASS)

    def integrate_rigid(self):
        """x at END by DOP853 between events: plastic impact, release where the reaction falls through zero."""

        def free(_, z):
            return [*z[2:], *self.acceleration(z[:2])]

        def held(_, z):
            return [z[2], 0.0, self.acceleration(z[:2])[0], 0.0]

        def gap(_, z):
            return z[1] + self.GAP

        def reaction(_, z):
            return -self.MASS[1, 1] * self.acceleration(z[:2])[1]

        for event in (gap, reaction):
            event.terminal, event.direction = True, -1
        t, z, closed, closings = 0.0, [*self.START, 0.0, 0.0], False, []
        while t < self.END:
            step = solve_ivp(
                held if closed else free,
                (t, self.END),
                z,
                method="DOP853",
                rtol=1e-12,
                atol=1e-14,
                events=reaction if closed else gap,
            )
            t, z = step.t[-1], step.y[:, -1].copy()
            if t < self.END and not closed:
                closings.append(t)
                z[1], z[3] = -self.GAP, 0.0
            closed = not closed and reaction(t, z) > 0
        return z[:2], closings

    def test_rigid_stop(self):
        expected, closings = self.integrate_rigid()
        run = mp.simulate(self.model(math.inf), self.END, displacement=self.START)
        assert [event.time for event in run.events if event.kind == "close"] == pytest.approx(closings, abs=1e-9)
        assert run.displacement(self.END) == pytest.approx(expected, abs=1e-9)
        assert len(closings) >= 3

    def test_compliant_stop(self):
        stiffness = 1e4

        def motion(_, z):
            force = stiffness * max(0.0, -(z[1] + self.GAP))
            return [*z[2:], *(self.acceleration(z[:2]) + np.array([0.0, force / self.MASS[1, 1]]))]

        start = [*self.START, 0.0, 0.0]
        expected = solve_ivp(motion, (0, self.END), start, method="DOP853", rtol=1e-12, atol=1e-14, max_step=1e-3)
        run = mp.simulate(self.model(stiffness), self.END, displacement=self.START)
        assert run.displacement(self.END) == pytest.approx(expected.y[:2, -1], abs=1e-8)
        assert run.stats.events >= 6
