"""A body on a soft spring in Exudyn: it moves as alone, whatever its modes do in the time that creates it."""

import numpy as np
import pytest

import multiphi_exudyn as mp
from reference_models.body_alone import solve_body_alone


@pytest.mark.parametrize("ground", [1e-6, 1e-3, 1.0])
def test_under_its_weight_it_moves_as_alone(ground):
    stiffness = np.array([[3.5 + ground, -3.5], [-3.5, 3.5]])
    body = mp.LinearStructure(np.diag([1.0, 0.6]), stiffness, points={"a": 0, "b": 1})
    model, loads, end = mp.MultiPhiModel(body, modes="all"), [mp.ConstantLoad("b", 2.0)], 90.0
    run = mp.simulate(model, end, velocity=[0.1, -0.3], loads=loads)
    histories, _ = solve_body_alone(model, [0.0, 0.0], end, 400, ["a", "b"], velocity=[0.1, -0.3], loads=loads)
    for point in ("a", "b"):
        expected = run.at(point, histories.time)
        np.testing.assert_allclose(histories.points[point], expected, rtol=0, atol=1e-7 * np.max(np.abs(expected)))
