"""Contacts that touch at zero velocity: the first derivative of a gap or force that is not round-off decides.

It may be the third. The lower ones are round-off of the map from the level before, of the sum of exponentials, or of
the products of a load with the modes.
"""

import numpy as np
import pytest
from campaign_scenes.plain import built, recipe_of
from numpy.testing import assert_allclose
from scipy.linalg import expm
from scipy.optimize import brentq
from small_structures import chain, stop

from multiphi_exudyn import ConstantLoad, LinearStructure, MultiPhiModel, UnilateralContact, simulate


def check_contact_laws(run):
    """No rigid stop is penetrated, no contact force is tensile, and no energy is gained."""
    assert run.status == "ok", run.message
    t = np.linspace(0, run.t_end, 501)
    for contact in run.model.contacts:
        gap, force = run.gap(contact.name, t), run.contact_force(contact.name, t)
        assert np.min(force) > -1e-8 * max(np.max(force), 1.0)
        assert not contact.rigid or np.min(gap) > -1e-12
    assert abs(run.ledger.residual) < 1e-10 * run.ledger.initial


@pytest.mark.parametrize("seed", [14, 19, 39, 40, 42, 52, 59, 104])
def test_between_a_rigid_and_a_stiff_stop_without_clearance_a_body_changes_from_one_to_the_other(seed):
    """It leaves the rigid stop at zero acceleration, or strikes it from the spring.

    The mode of the spring is stiff: its displacement and velocity after the map are round-off of the soft modes.
    """
    random = np.random.default_rng(seed)
    structure = LinearStructure([[1, 0.3], [0.3, 1]], [[200, -100], [-100, 100]], points={"m0": 0, "m1": 1})
    spring = UnilateralContact("spring", {"m0": -1.0}, 0.0, stiffness=10.0 ** random.uniform(4, 9))
    run = simulate(MultiPhiModel(structure, [stop("m0", 0.0), spring], "all"), 2.0, velocity=random.normal(size=2))
    check_contact_laws(run)
    assert len(run.contact_intervals("stop")) >= 3


@pytest.mark.parametrize("seed", [6, 12, 19, 33, 46, 84])
def test_it_does_so_beside_a_stiffer_stop_at_another_point(seed):
    random = np.random.default_rng(seed)
    structure = LinearStructure(np.eye(2), [[200, -100], [-100, 100]], points={"m0": 0, "m1": 1})
    spring = UnilateralContact("spring", {"m0": -1.0}, 0.0, stiffness=10.0 ** random.uniform(4, 9))
    stops = [stop("m0", 0.0), spring, stop("m1", 0.0, 1e8, name="hard")]
    check_contact_laws(simulate(MultiPhiModel(structure, stops, "all"), 2.0, velocity=random.normal(size=2)))


def light_mass(seed, struck):
    """Return a model, its initial velocity and an end time: a mass at its stop, coupled with two others by damping."""
    random = np.random.default_rng(seed)
    mass, stiffness = 10.0 ** random.uniform(-2, 2, 3), 10.0 ** random.uniform(0, 10, 3)
    root = 0.3 * random.normal(size=(3, 3))
    damping, points = root @ root.T + 0.1 * np.eye(3), {f"m{i}": i for i in range(3)}
    structure = LinearStructure(np.diag(mass), np.diag(stiffness), damping, points)
    model = MultiPhiModel(structure, [UnilateralContact("stop", {"m0": -1.0}, 0.0)], "all")
    velocity = 2 * random.normal(size=3)
    velocity[0] = abs(velocity[0]) if struck else 0.0
    return model, velocity, 50 / np.sqrt(np.max(stiffness / mass))


@pytest.mark.parametrize("struck", [False, True])
@pytest.mark.parametrize("seed", [14, 21, 41, 42, 44, 45, 70])
def test_a_light_mass_leaves_its_stop_as_damping_pulls_it_away(seed, struck):
    """Its gap and the rate of its gap start at zero. Their sums of exponentials are zero to round-off only."""
    model, velocity, t_end = light_mass(seed, struck)
    check_contact_laws(simulate(model, t_end, velocity=velocity))


def strikes_by_stepping(structure, velocity, t_end, step):
    """Return the times at which the first mass strikes its stop, by steps with the exact matrix exponential.

    For a diagonal mass matrix, and only if the stop never holds the mass: each impact sets its velocity to zero.
    """
    mass, stiffness, damping = structure.mass, structure.stiffness, structure.damping
    n, frequency = len(mass), np.sqrt(stiffness[0, 0] / mass[0, 0])
    held_back = -np.linalg.solve(mass, np.hstack([stiffness / frequency, damping]))
    rates = np.vstack([frequency * np.eye(n, 2 * n, n), held_back])  # of (frequency u, u')
    one_step, state, t, strikes = expm(rates * step), np.concatenate([np.zeros(n), velocity]), 0.0, [0.0]
    state[n] = 0.0
    while t < t_end:
        assert rates[n] @ state < 0 or state[0] < 0
        after = one_step @ state
        if after[0] > 0:
            until = brentq(lambda s, state=state: (expm(rates * s) @ state)[0], 1e-9 * step, step, xtol=1e-9 * step)
            after = expm(rates * until) @ state
            after[0], after[n] = 0.0, 0.0
            strikes.append(t + until)
            t += until - step
        state, t = after, t + step
    return np.array([t for t in strikes if t <= t_end])


@pytest.mark.parametrize("struck", [False, True])
@pytest.mark.parametrize("seed", [44, 70, 107, 129])
def test_a_light_mass_strikes_its_stop_when_small_steps_say_so(seed, struck):
    model, velocity, t_end = light_mass(seed, struck)
    run = simulate(model, t_end, velocity=velocity)
    strikes = strikes_by_stepping(model.structure, velocity, t_end, t_end / 20000)
    assert len(strikes) >= 5
    closed = [event.time for event in run.events if event.kind == "close"]
    assert_allclose(closed, strikes[0 if struck else 1 :], atol=1e-7 * t_end)


def test_a_mass_that_damping_pulls_away_strikes_its_stop_again_and_again():
    """Its amplitude decreases, always below 1e-9 of the others': every impact counts, none is round-off."""
    case = built(recipe_of(1394956))
    run = simulate(case.model, case.t_end, velocity=case.velocity)
    check_contact_laws(run)
    strikes = strikes_by_stepping(case.model.structure, case.velocity, case.t_end, 5e-7)
    assert len(strikes) == 50
    assert_allclose([event.time for event in run.events if event.kind == "close"], strikes, atol=1e-9)
    assert [event.kind for event in run.events] == ["close", "open"] * 50


@pytest.mark.parametrize("seed", [21, 39, 44, 59])
def test_falling_masses_with_different_damping_press_on_each_other(seed):
    """Two masses that touch fall with equal acceleration; the third derivative closes the contact.

    All modes are kept, so the load has no quasi-static part but round-off.
    """
    random = np.random.default_rng(seed)
    mass, damping, springs = random.uniform(0.5, 2, 3), random.uniform(0, 1, 3), 10 * chain(3, ends=0).stiffness
    assert damping[1] / mass[1] < damping[2] / mass[2]
    points = {f"m{i}": i for i in range(3)}
    structure = LinearStructure(np.diag(mass), springs, np.diag(damping), points)
    model = MultiPhiModel(structure, [UnilateralContact("stop", {"m1": 1.0, "m2": -1.0}, 0.0)], "all")
    run = simulate(model, 0.2, loads=[ConstantLoad(mass, -9.81)])
    assert run.status == "ok", run.message
    assert [event.kind for event in run.events] == ["close"]
    joined = np.array([[1.0, 0, 0], [0, 1, 1]])
    parts = (joined @ matrix @ joined.T for matrix in (np.diag(mass), springs, np.diag(damping)))
    one = simulate(MultiPhiModel(LinearStructure(*parts), [], "all"), 0.2, loads=[ConstantLoad(joined @ mass, -9.81)])
    t = np.linspace(0, 0.2, 41)
    assert_allclose(run.displacement(t), joined.T @ one.displacement(t), atol=1e-13)
    jerk = 9.81 * (damping[2] / mass[2] - damping[1] / mass[1])  # relative, without the contact
    assert_allclose(run.contact_force("stop", 1e-6), jerk / (1 / mass[1] + 1 / mass[2]) * 1e-6, rtol=1e-3)
