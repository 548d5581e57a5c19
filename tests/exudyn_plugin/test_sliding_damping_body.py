"""A body in Exudyn that slides on a rough rigid floor with a dashpot that couples along and across, one mode left."""

import math

import numpy as np
import pytest
from body_runs import run

import multiphi_exudyn as mp


@pytest.mark.parametrize("load", ["constant", "harmonic"])
def test_moves_as_alone_and_as_the_closed_form(load):
    mu, weight, push, coupling = 0.3, 9.81, 10.0, 0.5
    structure = mp.LinearStructure(np.eye(2), np.zeros((2, 2)), [[1.0, coupling], [coupling, 1.0]], {"x": 0, "y": 1})
    floor = mp.UnilateralContact("floor", "y", 0.0, friction=mu, tangential="x")
    model, loads = mp.MultiPhiModel(structure, [floor]), [mp.ConstantLoad("y", -weight)]
    loads.append(mp.ConstantLoad("x", push) if load == "constant" else mp.HarmonicLoad("x", push, 0.2))
    found, _ = run(model, 0.01, 1.0, loads=loads)
    native = mp.simulate(model, 1.0, loads=loads)
    assert np.max(np.abs(found.points["x"] - native.at("x", found.time))) < 1e-11
    if load == "constant":
        decay = 1.0 + mu * coupling
        exact = (push - mu * weight) / decay * (1.0 - (1.0 - math.exp(-decay)) / decay)
        assert found.points["x"][-1] == pytest.approx(exact, rel=1e-9)
