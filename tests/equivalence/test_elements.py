"""Dry friction in the loop: an element given by its states alone.

Exact answers: a block's free decay and the hysteresis loop of a Jenkins element; others in test_friction_exact.py.
"""

import itertools
import math

import numpy as np
import pytest
import scipy.integrate
from numpy.testing import assert_allclose
from small_structures import chain, random_structure, stop

import multiphi_exudyn as mp
from multiphi_exudyn.mechanics.time_functions import Harmonic


def block(*elements, stiffness=4.0):
    structure = mp.LinearStructure([[1.0]], [[stiffness]], points={"m": 0})
    return mp.MultiPhiModel(structure, elements, modes="all")


def kinds(run):
    return [event.kind for event in run.events]


class TestFreeDecay:
    """m 1, k 4, F .1 from x0 .33: 2 F/k are lost in each of 7 half cycles of pi/2, then it rests at .02."""

    def test_of_a_block_with_a_coulomb_limit_is_exact(self):
        run = mp.simulate(block(mp.Friction("floor", "m", 0.1)), 20.0, displacement=[0.33])
        assert run.status == "ok"
        assert_allclose([e.time for e in run.events], math.pi / 2 * np.repeat(range(8), 2)[1:-1], rtol=0, atol=1e-13)
        assert kinds(run) == [*itertools.islice(itertools.cycle(["slip", "stick"]), 14)]
        turns = [0.33 - 0.05 * n for n in range(8)] * np.array([1, -1] * 4)
        assert_allclose(run.at("m", math.pi / 2 * np.arange(8)), turns, rtol=0, atol=1e-14)
        assert run.at("m", 20.0) == run.at("m", 11.0) == pytest.approx(0.02, abs=1e-15)
        assert run.velocity(20.0) == 0.0


class TestJenkinsElement:
    """Moved to and fro by a rigid shaker, to which a load presses the block: x = X cos(W t)."""

    reach, limit, stiffness, hertz = 0.3, 2.0, 25.0, 0.7

    def run(self, periods):
        element = mp.Friction("ring", "m", self.limit, stiffness=self.stiffness)
        loads = [mp.ConstantLoad("m", -100.0), mp.StopMotion("shaker", Harmonic(self.reach, self.hertz))]
        model = block(stop("m", 0.0, name="shaker"), element)
        return mp.simulate(model, periods / self.hertz, displacement=[self.reach], loads=loads)

    def test_has_the_exact_loop(self):
        run, period, (nodes, weights) = self.run(3), 1 / self.hertz, np.polynomial.legendre.leggauss(20)
        assert run.status == "ok"
        assert kinds(run)[-4:] == ["stick", "slip", "stick", "slip"]
        area = 0.0
        for part in (s for s in run.segments if s.start >= 2 * period - 1e-9 and s.end > s.start):
            t = part.start + (part.end - part.start) * (nodes + 1) / 2
            assert_allclose(run.at("m", t), self.reach * np.cos(2 * math.pi * self.hertz * t), rtol=0, atol=1e-13)
            power = run.friction_force("ring", t) * np.array([run.velocity(time)[0] for time in t])
            area += float(weights @ power) * (part.end - part.start) / 2
        assert area == pytest.approx(4 * self.limit * (self.reach - self.limit / self.stiffness), rel=1e-12)


class TestChain:
    """Five masses, two Jenkins elements, a harmonic load: against an integrator that knows the law only."""

    sliders = (
        mp.Friction("left", "m1", 0.4, stiffness=30.0),
        mp.Friction("right", {"m3": 1.0, "m2": -1.0}, 0.25, stiffness=12.0),
    )

    def model(self, modes="all"):
        return mp.MultiPhiModel(chain(5, stiffness=9.0), self.sliders, modes=modes)

    def test_moves_as_an_integrator_says(self):
        load = mp.HarmonicLoad("m4", 1.3, 0.31)
        run = mp.simulate(self.model(), 30.0, loads=[load])
        assert run.status == "ok"
        expected, turns = integrated(self.model(), self.sliders, lambda t: 1.3 * math.cos(2 * math.pi * 0.31 * t), 30.0)
        assert len(run.events) == len(turns) > 20
        assert_allclose([e.time for e in run.events], turns, rtol=0, atol=1e-9)
        assert_allclose(run.displacement(30.0), expected[:5], rtol=0, atol=1e-10)


class TestStiffSprings:
    """Stick and slip are told apart by more than round-off, however stiff the spring beside the structure's."""

    def run(self, seed, stiffness, t_end=5.0):
        n, mass, springs, _, random = random_structure(seed)
        structure = mp.LinearStructure(mass, springs, points={f"m{i}": i for i in range(n)})
        places = random.permutation(n)
        sliders = [
            mp.Friction("one", {f"m{places[0]}": 1.0}, 0.3, stiffness=stiffness),
            mp.Friction("two", {f"m{places[1]}": 1.0, f"m{places[2]}": -1.0}, 0.1, stiffness=stiffness),
        ]
        load = mp.HarmonicLoad(f"m{n - 1}", 2.0, 0.3)
        return mp.simulate(mp.MultiPhiModel(structure, sliders, modes="all"), t_end, loads=[load])

    @pytest.mark.parametrize("seed", range(6))
    def test_tend_to_rigid_stick(self, seed):
        t = np.linspace(0, 5, 201)
        rigid, *sprung = (self.run(seed, k) for k in (math.inf, 1e5, 1e7, 1e9))
        assert len(rigid.events) > 2
        size = np.max(np.abs(rigid.displacement(t)))
        errors = [np.max(np.abs(run.displacement(t) - rigid.displacement(t))) / size for run in sprung]
        assert all(run.status == "ok" for run in (rigid, *sprung))
        assert errors[0] < 1e-2
        assert errors[2] < 0.02 * errors[0]


def integrated(model, sliders, force, t_end):
    """State (x, x', T) at the end and the times of all changes, by DOP853 from event to event."""
    structure = model.structure
    mass, stiffness = np.asarray(structure.mass), np.asarray(structure.stiffness)
    rows = np.array([structure.row(slider.direction) for slider in sliders])
    n, slips, t = len(mass), [0] * len(sliders), 0.0
    state, changes = np.zeros(2 * n + len(sliders)), []

    def slope(t, z):
        x, v, tension = z[:n], z[n : 2 * n], z[2 * n :]
        load = np.zeros(n)
        load[-1] = force(t)
        rates = [0.0 if slip else s.stiffness * (row @ v) for s, slip, row in zip(sliders, slips, rows, strict=True)]
        return np.concatenate([v, np.linalg.solve(mass, load - stiffness @ x - rows.T @ tension), rates])

    def signal(e, slip, sign):
        if slip:
            return lambda t, z: slip * (rows[e] @ z[n : 2 * n])
        return lambda t, z: sliders[e].limit - sign * z[2 * n + e]

    while True:
        watched = [(e, slip, sign) for e, slip in enumerate(slips) for sign in ((1,) if slip else (1, -1))]
        events = [signal(*given) for given in watched]
        for event in events:
            event.terminal, event.direction = True, -1.0
        found = scipy.integrate.solve_ivp(
            slope, (t, t_end), state, "DOP853", events=events, rtol=1e-12, atol=1e-13, max_step=0.05
        )
        t, state = found.t[-1], found.y[:, -1]
        if found.status == 0:
            return state, changes
        k = next(k for k, times in enumerate(found.t_events) if len(times))
        e, slip, sign = watched[k]
        slips[e] = 0 if slip else sign
        state[2 * n + e] = slip * sliders[e].limit if slip else sign * sliders[e].limit
        changes.append(t)
