"""Chatter is too many events in too short a time; what a load is made of does not count."""

import numpy as np
from small_structures import chain, stop

from multiphi_exudyn import MultiPhiModel, SampledLoad, simulate


def test_samples_of_a_load_are_no_events():
    """A slow force presses two masses on a stop again and again; every sample begins a piece of its own."""
    t = np.linspace(0.0, 4.0, 260)
    load = SampledLoad("m1", t, 5 * np.sin(2 * np.pi * t))
    model = MultiPhiModel(chain(2, damping=0.5 * np.eye(2), stiffness=30.0), [stop("m1", 0.05, 1e3)], modes="all")
    run = simulate(model, 4.0, loads=[load])
    assert run.status == "ok", run.message
    assert len(run.segments) > 260
    assert 5 < len(run.events) < 50
