"""One basis for all levels: with the whole span it is the structure, with less it loses nothing at transitions."""

import math

import numpy as np
import pytest
from small_structures import chain, random_structure, stop

from multiphi_exudyn import LinearStructure, ModalDamping, MultiPhiModel, planar_beam, simulate
from reference_models.global_basis import global_basis
from reference_models.rig import rig_beam, rig_contact, rig_damping

TIME = np.linspace(0.0, 30.0, 301)


def released(structure, contacts, modes):
    model = MultiPhiModel(structure, contacts, modes=modes)
    return simulate(model, 30.0, displacement=model.static_equilibrium({"m4": -0.4}))


@pytest.mark.parametrize("stiffness", [30.0, math.inf])
@pytest.mark.parametrize("damping", [None, ModalDamping([0.02], beyond=0.01)], ids=["undamped", "damped"])
def test_with_the_whole_span_it_is_the_structure_with_all_modes(stiffness, damping):
    structure, contacts = chain(5, damping=damping), [stop("m1", 0.2, stiffness)]
    exact = released(structure, contacts, "all")
    found = released(global_basis(structure, contacts, 4), contacts, "all")
    assert len(exact.events) >= 2
    for point in structure.points:
        np.testing.assert_allclose(found.at(point, TIME), exact.at(point, TIME), atol=1e-8)


@pytest.mark.parametrize("seed", range(4))
def test_frequencies_of_the_open_and_of_the_closed_level_are_exact(seed):
    n, mass, stiffness, damping, _ = random_structure(seed)
    points = {f"m{i}": i for i in range(n)}
    structure = LinearStructure(mass, stiffness, damping=damping["given"], points=points)
    contacts = [stop("m0", 0.1, 40.0)]
    given, projected = MultiPhiModel(structure, contacts, modes=1), global_basis(structure, contacts, 1)
    found = MultiPhiModel(projected, contacts, modes=1)
    assert projected.n == 2
    for closed in ((), ("stop",)):
        np.testing.assert_allclose(found.level(closed).frequencies, given.level(closed).frequencies, rtol=1e-9)
        np.testing.assert_allclose(found.level(closed).damping, given.level(closed).damping, rtol=1e-8)


def test_no_transition_loses_anything_where_levels_of_the_same_modes_do():
    structure, contacts = planar_beam(rig_beam(), 12, rig_damping()), [rig_contact(1e6)]
    start = MultiPhiModel(structure, contacts, modes="all").static_equilibrium({"hole3": 10.0})
    reduced = simulate(MultiPhiModel(structure, contacts, modes=4), 0.2, displacement=start)
    projected = global_basis(structure, contacts, 4)
    model = MultiPhiModel(projected, contacts, modes="all")
    found = simulate(model, 0.2, displacement=model.static_equilibrium({"hole3": 10.0}))
    assert projected.n == 8 or projected.n == 7
    assert len(found.events) >= 2
    assert found.ledger.truncation_kinetic < 1e-12 * found.ledger.initial
    assert reduced.ledger.truncation_kinetic > 1e-4 * reduced.ledger.initial
