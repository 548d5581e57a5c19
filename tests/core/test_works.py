"""Works of damping, of varying loads and of friction: against quadrature of the exact motion, and in the balance."""

import math

import numpy as np
import pytest
from scipy.integrate import quad_vec
from scipy.linalg import expm
from small_structures import chain, oscillator

import multiphi_exudyn as mp
from multiphi_exudyn import _core as core
from multiphi_exudyn.time.motion import limits
from multiphi_exudyn.time.simulate import Run

EXACT = 1e-12  # of the energies turned over: what round-off leaves of works in closed form
QUADRATURE = 1e-11  # relative
DAMPED, CRITICAL = [[0.4]], [[8.0]]  # of the oscillator of 2 kg and 8 N/m, omega = 2 rad/s
CHAIN = np.diag([0.1, 0.05, 0.2])
ABOVE = mp.UnilateralContact("above", {"m0": -1.0}, 0.15, 30.0)
ELEMENTS = {
    "compliant": (mp.UnilateralContact("below", "m2", 0.1, 50.0), ABOVE),
    "rigid": (mp.UnilateralContact("below", "m2", 0.1), mp.UnilateralContact("above", {"m0": -1.0}, 0.15)),
    "viscous": (mp.UnilateralContact("below", "m2", 0.1, 50.0, damping=1.0),),
    "friction": (
        mp.Friction("below", "m2", 0.1, stiffness=60.0, static_limit=0.15, velocity=0.02),
        mp.Friction("ring", {"m0": 1.0, "m1": -1.0}, 0.05, velocity=-0.01),
    ),
    "spring that follows a force": (
        mp.UnilateralContact(
            "rough", "m2", 0.05, 40.0, friction=0.4, tangential="m0", tangential_stiffness=25.0, tangential_velocity=0.3
        ),
    ),
    "sliding contact": (
        mp.UnilateralContact("rough", "m2", 0.05, 40.0, friction=0.4, tangential="m0", tangential_velocity=0.3),
    ),
}
LOADS = {
    "none": [],
    "harmonic": [mp.HarmonicLoad("m1", 2.0, 0.3, 0.4)],
    "samples": [mp.SampledLoad("m1", np.linspace(0.0, 4.0, 81), np.cos(np.linspace(0.0, 9.0, 81)))],
    "two carriers": [mp.HarmonicLoad("m1", 2.0, 0.3, 0.4), mp.HarmonicLoad("m0", 1.0, 3.0)],
    "moving base": [mp.BaseMotion({"m0": 1.0, "m1": 1.0, "m2": 1.0}, mp.Harmonic(0.05, 0.7))],
}


def run_of(model, t_end, displacement=None, velocity=None, loads=()):
    """The core's levels and the trajectory of its run."""
    motion = Run(model, t_end, displacement, velocity, loads)._motion()
    start, levels = motion.start, motion.levels.in_core
    run = core.Run(levels, *limits(motion.model), start.time)
    run.begin(core.Start(start.displacement, start.velocity, start.held, list(start.states), 0.0))
    assert run.advance(t_end) is None
    return levels, run.trajectory


def works_of(levels, trajectory):
    """Works [J] of damping, of loads and of friction, those of the segments left out included."""
    summed, further = trajectory.ledger.works, core.works_of_segments(levels, trajectory, trajectory.left_out)
    return (
        summed.damping + further.damping,
        summed.varying + further.varying + trajectory.ledger.load_work,
        summed.friction + further.friction,
    )


def exact_velocity(damping, frequency, amplitude, displacement, velocity):
    """v(t) of the oscillator under amplitude cos(2 pi frequency t): the matrix exponential of it with its load."""
    turning = 2 * math.pi * frequency
    system = np.zeros((4, 4))
    system[0, 1] = 1.0
    system[1] = -8.0 / 2.0, -damping / 2.0, amplitude / 2.0, 0.0
    system[2, 3], system[3, 2] = -turning, turning
    start = np.array([displacement, velocity, 1.0, 0.0])
    return lambda t: float((expm(system * t) @ start)[1])


def integral(function, end):
    value, _ = quad_vec(function, 0.0, end, epsrel=1e-13, epsabs=1e-14)
    return float(value)


def imbalance(levels, trajectory):
    """What the ledger leaves open [J], and the energies turned over."""
    ledger = trajectory.ledger
    damping, varying, friction = works_of(levels, trajectory)
    lost = np.array(ledger.at_start) + np.array(ledger.at_events)
    impact, kinetic, strain, stopped, relaxed, dropped = lost
    entries = [ledger.start_energy, varying + stopped, -impact, -kinetic - strain, -damping - relaxed]
    entries += [-friction - dropped, -ledger.end_energy]
    return sum(entries), sum(map(abs, entries))


@pytest.mark.parametrize("damping", [DAMPED, CRITICAL], ids=["damped", "critical"])
def test_damping_takes_what_quadrature_of_its_power_says(damping):
    """At critical damping the motion has powers of time, and its work is left to integrals of products."""
    levels, trajectory = run_of(oscillator(damping=damping), 3.0, [0.3], [-2.0])
    velocity = exact_velocity(damping[0][0], 1.0, 0.0, 0.3, -2.0)
    expected = integral(lambda t: damping[0][0] * velocity(t) ** 2, 3.0)
    assert works_of(levels, trajectory)[0] == pytest.approx(expected, rel=QUADRATURE)
    assert len(trajectory.left_out) == (damping is CRITICAL)


@pytest.mark.parametrize("damping", [[[0.0]], DAMPED, CRITICAL], ids=["undamped", "damped", "critical"])
@pytest.mark.parametrize("frequency", [0.3, 1 / math.pi], ids=["off", "resonance"])
def test_a_harmonic_load_works_as_quadrature_says(damping, frequency):
    amplitude = 1.5
    load = mp.HarmonicLoad("m0", amplitude, frequency)
    levels, trajectory = run_of(oscillator(gap=100.0, damping=damping), 3.0, [0.3], [-2.0], [load])
    velocity = exact_velocity(damping[0][0], frequency, amplitude, 0.3, -2.0)
    damped, loaded, _ = works_of(levels, trajectory)
    turning = 2 * math.pi * frequency
    expected = integral(lambda t: amplitude * math.cos(turning * t) * velocity(t), 3.0)
    assert loaded == pytest.approx(expected, rel=QUADRATURE)
    expected = integral(lambda t: damping[0][0] * velocity(t) ** 2, 3.0)
    assert damped == pytest.approx(expected, rel=QUADRATURE)


def test_friction_takes_its_limit_times_the_slip():
    """A block that slides to rest: all of 1/2 m v^2 = limit times way."""
    block = mp.LinearStructure([[2.0]], [[0.0]], points={"m": 0})
    model = mp.MultiPhiModel(block, [mp.Friction("ground", "m", 3.0)], modes="all")
    for t_end, way in ((0.5, 2.0 * 0.5 - 0.75 * 0.5**2), (4.0, 4.0 / 3.0)):
        levels, trajectory = run_of(model, t_end, velocity=[2.0])
        assert works_of(levels, trajectory)[2] == pytest.approx(3.0 * way, rel=EXACT)


@pytest.mark.parametrize("loads", LOADS.values(), ids=LOADS)
@pytest.mark.parametrize("elements", ELEMENTS.values(), ids=ELEMENTS)
def test_works_close_the_energy_balance(elements, loads):
    """Summed as segments end, and all integrated afterwards."""
    model = mp.MultiPhiModel(chain(3, damping=CHAIN, stiffness=10.0), elements, modes="all")
    levels, trajectory = run_of(model, 5.0, (0.03, 0.06, -0.09), loads=loads)
    left, turned_over = imbalance(levels, trajectory)
    assert abs(left) <= EXACT * turned_over
    summed = works_of(levels, trajectory)
    integrated = core.works_of_segments(levels, trajectory, range(len(trajectory.levels)))
    got = integrated.damping, integrated.varying + trajectory.ledger.load_work, integrated.friction
    np.testing.assert_allclose(got, summed, rtol=0, atol=EXACT * turned_over)


def test_works_of_short_segments_are_no_differences_of_large_energies():
    """Of samples that follow each other faster than modes can, the few terms would be large."""
    force = np.random.default_rng(1).normal(size=201)
    for step in (0.1, 1e-2, 1e-3):
        noise = mp.SampledLoad("m1", step * np.arange(201), force)
        model = mp.MultiPhiModel(chain(3, damping=CHAIN, stiffness=10.0), ELEMENTS["compliant"], modes="all")
        levels, trajectory = run_of(model, 200 * step, (0.03, 0.06, -0.09), loads=[noise])
        left, turned_over = imbalance(levels, trajectory)
        assert abs(left) <= EXACT * turned_over
