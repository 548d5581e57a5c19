"""What a run keeps: few bytes of an event, and all that was told of it."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from small_structures import chain, stop

import multiphi_exudyn as mp
from multiphi_exudyn.events.packing import level_arrays
from multiphi_exudyn.time.record.growing_array import FILLED


def record_of(run):
    return run.segments._record


@pytest.mark.parametrize(
    ("modes", "driven", "asked"),
    [(6, False, 161), (6, True, 201), (12, False, 257), (12, True, 297)],
)
def test_bytes_of_an_event(modes, driven, asked):
    """As the record grows, whose last block may be empty, and once ledger, events and motion were asked for."""
    model = mp.MultiPhiModel(chain(modes), [stop(f"m{modes - 1}", 0.0, 4.0)], modes="all")
    loads = [mp.HarmonicLoad(f"m{modes - 1}", 0.3, 0.11)] if driven else []
    run = mp.simulate(model, 1e5, velocity=np.linspace(0.0, 1.0, modes), loads=loads)
    events, record = len(run.events), record_of(run)
    assert events > 15_000
    assert record.bytes <= asked * (1 + 1 / FILLED) * events
    run.ledger, run.events.table(), run.at("m0", 50.0)
    assert record.bytes + record.event_rows.nbytes <= asked * events


@pytest.mark.parametrize("driven", [False, True])
@pytest.mark.parametrize("contact", [{"stiffness": 4.0}, {"restitution": 0.6}])
def test_a_record_in_many_parts_is_that_in_one(contact, driven, monkeypatch):
    """Places in a part become those in the record; a segment ends where the next one of another part begins."""
    stops = [mp.UnilateralContact("one", "m3", 0.1, **contact), mp.UnilateralContact("two", "m5", 0.15, **contact)]
    loads = [mp.HarmonicLoad("m2", 0.3, 0.11)] if driven else []
    runs = []
    for room in (1024, 3):
        monkeypatch.setattr(level_arrays, "ROOM", room)
        model = mp.MultiPhiModel(chain(6), stops, modes=4)
        runs.append(mp.simulate(model, 100.0, velocity=np.linspace(0.0, 0.4, 6), loads=loads))
    whole, parts = runs
    assert 10 < len(whole.events) == len(parts.events) < 1024
    assert whole.events == parts.events
    assert parts.ledger == whole.ledger
    for name in ("rows", "instants", "coordinates", "phases", "left_out", "kinds", "amounts", "struck", "impacts"):
        assert_array_equal(getattr(record_of(parts), name), getattr(record_of(whole), name))
    assert [s.end for s in parts.segments][:-1] == [s.start for s in parts.segments][1:]


def test_impacts_are_kept_of_what_is_struck_alone():
    """All others have no impulse, and lose energy to truncation alone."""
    stops = [mp.UnilateralContact("hard", "m3", 0.1), mp.UnilateralContact("soft", "m5", 0.15, stiffness=4.0)]
    run = mp.simulate(mp.MultiPhiModel(chain(6), stops, modes=4), 60.0, velocity=np.linspace(0.0, 0.4, 6))
    record = record_of(run)
    kept = [
        any((event.impulse, event.loss.impact, event.loss.stop_work, event.loss.damping, event.loss.friction))
        for event in run.events
    ]
    assert 0 < sum(kept) < len(kept)
    assert_array_equal(record.struck, record.event_rows[kept])
    assert all(event.contact == "hard" for event, one in zip(run.events, kept, strict=True) if one)
    assert_array_equal(record.losses[record.event_rows], [event.loss for event in run.events])
    assert run.events.table()[:, 2].tolist() == [event.impulse for event in run.events]
