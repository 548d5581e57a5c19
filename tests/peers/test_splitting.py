"""Free motion exact and contact forces by splitting: its order, its energy, and where it meets the exact answer."""

import math

import numpy as np
import pytest
from small_structures import chain

from multiphi_exudyn import LinearStructure, MultiPhiModel, UnilateralContact, simulate
from reference_models.pod_basis import pod_basis
from reference_models.splitting import splitting

STIFF = 400.0


def bilinear():
    """A mass of 1 kg on a spring of 1 N/m beside a stop of STIFF N/m at its place of rest."""
    structure = LinearStructure([[1.0]], [[1.0]], points={"m": 0})
    return splitting(structure, [UnilateralContact("stop", "m", 0.0, STIFF)], ("m",), 0)


def test_a_bilinear_oscillator_comes_back_with_the_second_order_of_the_step():
    period = math.pi * (1 + 1 / math.sqrt(1 + STIFF))
    found = [bilinear().run(np.array([1.0]), period, period / steps).record[-1] for steps in (4000, 8000)]
    errors = [float(np.hypot(z - 1, v)) for z, v in found]
    assert errors[1] < 1e-4
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.35)


def test_without_damping_it_neither_gains_nor_loses_energy():
    structure = LinearStructure([[1.0]], [[1.0]], points={"m": 0})
    run = bilinear().run(np.array([1.0]), 200.0, 0.002)
    late = run.histories(structure, ["m"], np.linspace(150, 200, 5001))
    assert np.max(np.abs(late.energy - 0.5)) < 1e-3 * 0.5  # after some forty contacts


def test_a_chain_with_damping_comes_to_the_exact_answer():
    structure = chain(5, damping=0.02 * np.eye(5))
    contacts = [UnilateralContact("stop", "m4", 0.3, 50.0)]
    start, time = np.linspace(0, -1.0, 5), np.linspace(0, 15, 1501)
    exact = simulate(MultiPhiModel(structure, contacts, "all"), 15.0, displacement=-start)
    run = splitting(structure, contacts, ("m4",), 4).run(-start, 15.0, 2e-4)
    found = run.histories(structure, ["m4"], time)
    np.testing.assert_allclose(found.points["m4"], exact.at("m4", time), atol=2e-6)
    np.testing.assert_allclose(found.energy, exact.energy(time), rtol=2e-5)
    np.testing.assert_allclose(run.contact_intervals("stop"), exact.contact_intervals("stop"), atol=1e-4)
    assert found.contact_force["stop"].max() > 1.0


def test_a_pod_basis_holds_its_own_training_run():
    structure, contacts = chain(6, damping=0.01 * np.eye(6)), [UnilateralContact("stop", "m5", 0.2, 20.0)]
    start, time = np.linspace(0, 1.0, 6), np.linspace(0, 8, 401)
    training = simulate(MultiPhiModel(structure, contacts, "all"), 8.0, displacement=start)
    errors = []
    for modes in (3, 6):
        small = pod_basis(training, modes)
        assert small.n == modes
        across = np.array([small.points[f"m{k}"] for k in range(6)])
        model = MultiPhiModel(small, contacts, "all")
        run = simulate(model, 8.0, displacement=across.T @ structure.mass @ start)
        errors.append(float(np.max(np.abs(run.at("m5", time) - training.at("m5", time)))))
    assert errors[1] < 1e-9 < errors[0]
