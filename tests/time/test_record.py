"""What a run keeps: few bytes of an event."""

import numpy as np
import pytest
from small_structures import chain, stop

import multiphi_exudyn as mp


@pytest.mark.parametrize(
    ("modes", "driven", "asked"),
    [(6, False, 241), (6, True, 257), (12, False, 337), (12, True, 353)],
)
def test_bytes_of_an_event(modes, driven, asked):
    """Whatever has been asked of the run."""
    model = mp.MultiPhiModel(chain(modes), [stop(f"m{modes - 1}", 0.0, 4.0)], modes="all")
    loads = [mp.HarmonicLoad(f"m{modes - 1}", 0.3, 0.11)] if driven else []
    run = mp.simulate(model, 1e5, velocity=np.linspace(0.0, 1.0, modes), loads=loads)
    events = len(run.events)
    assert events > 15_000
    assert run.stats.record_bytes <= asked * events
    run.ledger, run.events.table(), run.at("m0", 50.0)
    assert run.segments.trajectory.memory == run.stats.record_bytes
