"""Craig-Bampton component: exact at its interface and with all its modes, and its run in Exudyn."""

import numpy as np
import pytest
from small_structures import chain, stop

from multiphi_exudyn import ModalDamping, MultiPhiModel, planar_beam, simulate
from multiphi_exudyn.mathematics.modes import complete_modes
from reference_models.craig_bampton import craig_bampton
from reference_models.craig_bampton_run import CraigBamptonSettings, interface_contacts, solve_craig_bampton
from reference_models.rig import rig_beam, rig_damping


@pytest.fixture(scope="module")
def beam():
    return planar_beam(rig_beam(), 10, rig_damping())


def frequencies(component):
    return complete_modes(component.mass, component.stiffness).omega / (2 * np.pi)


def test_with_all_modes_inside_the_frequencies_are_those_of_the_structure(beam):
    component = craig_bampton(beam, ("node2", "node3"), beam.n - 2)
    exact = MultiPhiModel(beam, modes="all").level(()).frequencies
    np.testing.assert_allclose(frequencies(component), exact, rtol=1e-7)
    np.testing.assert_allclose(frequencies(component)[:10], exact[:10], rtol=1e-10)


def released(structure, contacts, force, modes, t_end, step, **settings):
    """Largest difference to the model without time steps, of all DoFs and recorded times, and the recorded run."""
    model = MultiPhiModel(structure, contacts, modes="all")
    x = model.static_equilibrium(force)
    points = interface_contacts(contacts)
    component = craig_bampton(structure, tuple(dict.fromkeys(contact.point for contact in points)), modes)
    given = CraigBamptonSettings(step, **{"newton_tolerance": 1e-9} | settings)
    run = solve_craig_bampton(component, points, component.coordinates(x), t_end, given)
    trajectory = simulate(model, t_end, displacement=x)
    time = np.minimum(run.time, t_end)
    error = np.max(np.abs(run.coordinates @ component.shapes.T - trajectory.displacement(time).T))
    return error, run, trajectory


STOPS = {
    "below": [stop("m1", 0.2, 30.0)],
    "above, with a coefficient": [stop({"m1": -2.0}, 0.4, 8.0)],
    "two on one point": [stop("m1", 0.2, 30.0, "low"), stop({"m1": -1.0}, 0.3, 20.0, "high")],
    "closed at the start": [stop("m3", 0.2, 30.0)],
}


UNDAMPED, DAMPED = None, ModalDamping([0.02], beyond=0.02)


@pytest.mark.parametrize(("place", "damping"), [*((place, DAMPED) for place in STOPS), ("below", UNDAMPED)])
def test_with_all_modes_inside_the_run_converges_to_the_exact_one_with_order_two(place, damping):
    structure, contacts = chain(4, damping=damping), STOPS[place]
    steps, errors = (16e-3, 8e-3, 4e-3, 2e-3, 1e-3), []
    for step in steps:
        error, run, trajectory = released(structure, contacts, {"m3": -0.4}, 3, 24.0, step)
        assert run.cause == ""
        errors.append(error)
    assert len(trajectory.events) >= 1
    assert errors[-1] < 1e-5
    assert np.polyfit(np.log(steps), np.log(errors), 1)[0] > 1.7
