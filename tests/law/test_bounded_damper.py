"""Bounded dampers of stops, |f_d| <= |f_c|: the force is continuous, and what the damper takes is damping."""

import numpy as np
import pytest
from lawful import assert_lawful
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp
from small_structures import chain

import multiphi_exudyn as mp
from multiphi_exudyn import MultiPhiValueError

SEEDS = range(8)


def force(contact, gap, rate):
    """f_c + f_d in the stop, as the equation states it."""
    spring = max(0.0, -contact.stiffness * gap)
    return spring + np.clip(-contact.damping * rate, -spring, spring)


def integrated(structure, contacts, times, displacement, velocity, longest):
    """x (n, k) of M x'' + K x = sum h (f_c + f_d), by small steps of high order."""
    n, stiffness = structure.n, np.asarray(structure.stiffness)
    inverse, rows = np.linalg.inv(np.asarray(structure.mass)), [structure.row(c.direction) for c in contacts]

    def rate(t, y):
        x, v = y[:n], y[n:]
        pressed = sum(h * force(c, h @ x + c.gap, h @ v) for c, h in zip(contacts, rows, strict=True))
        return np.concatenate([v, inverse @ (pressed - stiffness @ x)])

    start = np.concatenate([displacement, velocity])
    given = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-13, "max_step": longest, "t_eval": times}
    return solve_ivp(rate, (0, times[-1]), start, **given).y[:n]


def scene(seed):
    random = np.random.default_rng(seed)
    n = int(random.integers(2, 5))
    at, stiffness, damping = f"m{random.integers(n)}", 10 ** random.uniform(0, 2), 10 ** random.uniform(-1.5, 1)
    contact = mp.UnilateralContact("stop", at, random.uniform(-0.2, 0.5), stiffness, damping, damper="bounded")
    return chain(n), contact, 1.5 * random.normal(size=n)


class TestModelicaLibrary:
    def test_a_mass_between_two_elastic_gaps(self):
        structure = mp.LinearStructure(np.eye(1), np.zeros((1, 1)), points={"s": 0})
        contacts = [
            mp.UnilateralContact("right", {"s": -1.0}, 0.5, 10.0, 1.5, damper="bounded"),
            mp.UnilateralContact("left", "s", 0.5, 10.0, 1.5, damper="bounded"),
        ]
        times, start = np.linspace(0, 5, 501), np.array([2.0])
        run = mp.simulate(mp.MultiPhiModel(structure, contacts), 5.0, displacement=start)
        true = integrated(structure, contacts, times, start, np.zeros(1), 2e-3)
        assert run.status == "ok"
        assert_allclose(run.displacement(times), true, rtol=0, atol=1e-7)

    def test_two_rotors_with_backlash(self):
        structure = mp.LinearStructure(np.diag([1.0, 3.0]), np.array([[4.0, 0.0], [0.0, 0.0]]), points={"a": 0, "b": 1})
        contacts = [
            mp.UnilateralContact("ahead", {"a": -1.0, "b": 1.0}, 0.1, 60.0, 2.0, damper="bounded"),
            mp.UnilateralContact("behind", {"a": 1.0, "b": -1.0}, 0.1, 60.0, 2.0, damper="bounded"),
        ]
        times, start, velocity = np.linspace(0, 8, 401), np.array([0.05, 0.0]), np.array([1.0, -0.4])
        run = mp.simulate(
            mp.MultiPhiModel(structure, contacts), 8.0, displacement=start, velocity=np.array([1.0, -0.4])
        )
        true = integrated(structure, contacts, times, start, velocity, 1e-3)
        assert run.status == "ok"
        assert_allclose(run.displacement(times), true, rtol=0, atol=1e-7)


@pytest.mark.parametrize("seed", SEEDS)
def test_motion_force_and_ledger(seed):
    structure, contact, velocity = scene(seed)
    model, times = mp.MultiPhiModel(structure, [contact], modes="all"), np.linspace(0, 6, 121)
    run = mp.simulate(model, 6.0, velocity=velocity)
    true = integrated(structure, [contact], times, np.zeros(structure.n), velocity, 2e-3)
    assert run.status == "ok"
    assert_allclose(run.displacement(times), true, rtol=0, atol=1e-7)
    rates = structure.row(contact.direction) @ run.velocity(times)
    expected = [force(contact, g, rate) for g, rate in zip(run.gap("stop", times), rates, strict=True)]
    size = max(1.0, max(expected))
    assert_allclose(run.contact_force("stop", times), expected, rtol=0, atol=1e-9 * size)
    for event in run.events:  # the force is continuous
        sides = [run.contact_force("stop", event.time, side) for side in ("left", "right")]
        assert_allclose(*sides, rtol=0, atol=1e-7 * size)
    ledger = run.ledger
    assert abs(ledger.residual) < 1e-11 * ledger.initial
    assert abs(ledger.truncation_kinetic) + abs(ledger.truncation_strain) < 1e-11 * ledger.initial
    assert 0 <= ledger.damping < ledger.initial
    assert_lawful(run)


def test_equilibrium_is_that_of_the_spring():
    plain, bounded = (
        mp.MultiPhiModel(chain(3), [mp.UnilateralContact("stop", "m1", 0.1, 20.0, damping, damper=damper)], modes="all")
        for damping, damper in ((0.0, "linear"), (2.0, "bounded"))
    )
    load = {"m1": -5.0}
    assert_allclose(bounded.static_equilibrium(load), plain.static_equilibrium(load), rtol=1e-12)


def test_a_stop_that_moves():
    contact, velocity = mp.UnilateralContact("stop", "m0", 0.1, 20.0, 1.0, damper="bounded"), np.array([-1.0, 0.5])
    run = mp.simulate(
        mp.MultiPhiModel(chain(2), [contact], modes="all"),
        6.0,
        velocity=velocity,
        loads=[mp.StopMotion("stop", mp.Harmonic(0.3, 0.4, -np.pi / 2))],
    )
    times = np.linspace(0, 6, 241)
    rate = run.velocity(times)[0] - 0.3 * 0.8 * np.pi * np.cos(0.8 * np.pi * times)
    expected = [force(contact, g, v) for g, v in zip(run.gap("stop", times), rate, strict=True)]
    assert run.status == "ok"
    assert_allclose(run.contact_force("stop", times), expected, rtol=0, atol=1e-8)


@pytest.mark.parametrize(
    "given",
    [
        {"damper": "quadratic"},
        {"damper": "bounded"},
        {"damper": "bounded", "damping": 1.0, "friction": 0.2, "tangential": "m1"},
        {"damper": "bounded", "damping": 1.0, "stiffness": np.inf},
    ],
)
def test_what_it_cannot_have_is_refused(given):
    with pytest.raises(MultiPhiValueError, match="stop"):
        mp.UnilateralContact("stop", "m0", 0.1, **({"stiffness": 20.0} | given))


def test_a_residual_boundary_is_refused():
    contact = mp.UnilateralContact("stop", "m0", 0.1, 20.0, 1.0, damper="bounded")
    with pytest.raises(MultiPhiValueError, match="stop"):
        mp.MultiPhiModel(chain(3), [contact], modes=2, boundary="residual")
