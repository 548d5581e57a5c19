"""solve_ivp on the levels: it converges to the model without time steps, events included."""

import numpy as np
import pytest
from small_structures import chain, oscillator, stop

from multiphi_exudyn import ModalDamping, MultiPhiModel, simulate
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
