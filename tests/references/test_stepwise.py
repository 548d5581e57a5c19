"""solve_ivp on the levels: it converges to the model without time steps, events included."""

import math

import numpy as np
import pytest
from small_structures import chain, oscillator, random_model, stop

from multiphi_exudyn import LinearStructure, ModalDamping, MultiPhiModel, UnilateralContact, simulate
from reference_models.stepwise import solve_stepwise

METHODS = ("RK45", "DOP853", "Radau", "BDF", "LSODA")


def worst(run, trajectory, t_end):
    """Largest difference of any point, relative to the largest displacement."""
    time = np.linspace(0.0, t_end, 501)
    points = tuple(run.model.structure.points)
    found = run.histories(points, time).points
    exact = {name: trajectory.at(name, time) for name in points}
    scale = max(np.max(np.abs(values)) for values in exact.values())
    return max(float(np.max(np.abs(found[name] - exact[name]))) for name in points) / scale


@pytest.mark.parametrize("damping", [None, ModalDamping([0.02], beyond=0.02)], ids=["undamped", "damped"])
@pytest.mark.parametrize("modes", [3, "all"])
def test_the_error_falls_with_the_tolerance(damping, modes):
    model = MultiPhiModel(chain(5, damping=damping), [stop("m1", 0.2, 30.0)], modes=modes)
    x = model.static_equilibrium({"m4": -0.4})
    trajectory = simulate(model, 40.0, displacement=x)
    assert len(trajectory.events) >= 2
    errors = []
    for rtol in (1e-4, 1e-7, 1e-10):
        run = solve_stepwise(model, 40.0, x, method="DOP853", rtol=rtol)
        assert run.message == ""
        errors.append(worst(run, trajectory, 40.0))
    assert errors[1] < 1e-2 * errors[0]
    assert errors[2] < 1e-2 * errors[1]
    assert errors[2] < 1e-8


@pytest.mark.parametrize("method", METHODS)
def test_every_method_finds_every_contact(method):
    model = oscillator(contact=200.0, damping=[[0.1]])
    trajectory = simulate(model, 10.0, displacement=np.array([-2.0]))
    run = solve_stepwise(model, 10.0, np.array([-2.0]), method=method, rtol=1e-6)
    assert run.message == ""
    assert worst(run, trajectory, 10.0) < 1e-3
    found, exact = run.contact_intervals("stop"), trajectory.contact_intervals("stop")
    assert len(exact) > 2
    np.testing.assert_allclose(found, exact, atol=1e-3)
    assert 0 < run.steps <= run.evaluations


ALL = [(seed, damping, False) for seed in range(4) for damping in ("none", "given")]
TRUNCATED = [(seed, "none", True) for seed in (0, 7, 9, 19, 45)]  # contacts recover and are refused
TOGETHER = [(36, "none", True), (51, "given", True), (56, "none", True)]  # one mode brings several contacts to zero


@pytest.mark.parametrize(("seed", "damping", "truncated"), ALL + TRUNCATED + TOGETHER)
def test_contacts_anywhere_obey_the_same_rule(seed, damping, truncated):
    model, random = random_model(seed, kind="compliant", damping=damping, truncated=truncated)
    x = 0.5 * random.normal(size=model.structure.n)
    trajectory = simulate(model, 3.0, displacement=x)
    run = solve_stepwise(model, 3.0, x, method="DOP853", rtol=1e-10)
    assert run.message == trajectory.message == ""
    assert worst(run, trajectory, 3.0) < 1e-7


def test_symmetric_contacts_close_together():
    structure = LinearStructure(np.eye(2), np.diag([4.0, 4.0]), points={"left": 0, "right": 1})
    contacts = [stop(name, 1.0, 50.0, name) for name in ("left", "right")]
    model = MultiPhiModel(structure, contacts, modes="all")
    run = solve_stepwise(model, 6.0, np.full(2, -2.0), method="RK45", rtol=1e-8)
    assert {segment.level.level.indices for segment in run.segments} == {(), (0, 1)}


def test_gaps_forces_and_energy_are_those_of_the_exact_run():
    model = MultiPhiModel(chain(4, damping=ModalDamping([0.02])), [stop("m1", 0.2, 30.0)], modes="all")
    x = model.static_equilibrium({"m3": -0.4})
    time = np.linspace(0.0, 40.0, 301)
    trajectory = simulate(model, 40.0, displacement=x)
    found = solve_stepwise(model, 40.0, x, method="DOP853", rtol=1e-11).histories((), time)
    assert found.points == {}
    np.testing.assert_allclose(found.gaps["stop"], trajectory.gap("stop", time), atol=1e-8)
    np.testing.assert_allclose(found.contact_force["stop"], trajectory.contact_force("stop", time), atol=1e-6)
    np.testing.assert_allclose(found.energy, trajectory.energy(time), rtol=1e-7)
    assert np.max(found.contact_force["stop"]) > 0.1


def test_a_start_inside_a_contact_leaves_it_once():
    model = oscillator(contact=200.0)
    x = model.static_equilibrium({"m0": -40.0})
    run = solve_stepwise(model, 3.0, x, method="RK45", rtol=1e-8)
    (first, *_) = run.contact_intervals("stop")
    assert first[0] == 0.0
    assert first[1] == pytest.approx(simulate(model, 3.0, displacement=x).contact_intervals("stop")[0][1], abs=1e-6)


def test_contacts_that_stay_closed_give_one_interval_through_the_events_of_others():
    structure = LinearStructure(np.eye(2), np.diag([1.0, 9.0]), points={"slow": 0, "fast": 1})
    contacts = [stop("slow", -3.0, 5.0, "always"), stop("fast", 0.5, 50.0, "often")]
    model = MultiPhiModel(structure, contacts, modes="all")
    run = solve_stepwise(model, 4.0, np.array([2.3, -0.4]), method="DOP853", rtol=1e-8)
    run_more = solve_stepwise(model, 4.0, np.array([2.3, -1.4]), method="DOP853", rtol=1e-8)
    assert run.contact_intervals("always") == [(0.0, 4.0)]
    assert run.contact_intervals("often") == []
    assert run_more.contact_intervals("always") == [(0.0, 4.0)]
    assert len(run_more.contact_intervals("often")) > 1


def test_a_rigid_contact_is_refused(refused):
    refused(
        ValueError,
        "contact 'stop' stiffness: got inf",
        lambda: solve_stepwise(oscillator(contact=math.inf), 1.0, np.zeros(1), method="RK45", rtol=1e-6),
    )


def test_a_damper_is_refused(refused):
    contact = UnilateralContact("stop", "m0", 1.0, 50.0, damping=0.1)
    model = MultiPhiModel(chain(2), [contact], modes="all")
    refused(
        ValueError,
        "contact 'stop' damping: got 0.1",
        lambda: solve_stepwise(model, 1.0, np.zeros(2), method="RK45", rtol=1e-6),
    )
