"""Chatter is too many events in too short a time; what a load is made of does not count."""

import numpy as np
import pytest
from small_structures import chain, stop

from multiphi_exudyn import Friction, HarmonicLoad, LinearStructure, MultiPhiModel, SampledLoad, simulate


def test_samples_of_a_load_are_no_events():
    """A slow force presses two masses on a stop again and again; every sample begins a piece of its own."""
    t = np.linspace(0.0, 4.0, 260)
    load = SampledLoad("m1", t, 5 * np.sin(2 * np.pi * t))
    model = MultiPhiModel(chain(2, damping=0.5 * np.eye(2), stiffness=30.0), [stop("m1", 0.05, 1e3)], modes="all")
    run = simulate(model, 4.0, loads=[load])
    assert run.status == "ok", run.message
    assert len(run.segments) > 260
    assert 5 < len(run.events) < 50


SWINGS = 100  # of a load of 1 N and 5 Hz


def saw():
    """The same as samples."""
    times = np.arange(2 * SWINGS + 1) / 10
    return SampledLoad("m", times, np.where(np.arange(len(times)) % 2, -1.0, 1.0))


@pytest.mark.parametrize("load", [HarmonicLoad("m", 1.0, 5.0), saw()], ids=["harmonic", "sampled"])
def test_friction_may_follow_a_load_that_is_faster_than_every_mode(load):
    """A block of 1 kg on a spring of 0.1 N/m slips and sticks twice in every swing of the load."""
    block = LinearStructure([[1.0]], [[0.1]], points={"m": 0})
    model = MultiPhiModel(block, [Friction("pad", "m", 0.5)])
    run = simulate(model, SWINGS / 5, loads=[load])
    assert run.status == "ok", run.message
    assert len(run.events) >= 3.9 * SWINGS
