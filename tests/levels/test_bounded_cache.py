"""What is kept of levels is bounded, and a bound changes no result."""

import gc
import math
import tracemalloc

import numpy as np
import pytest
from small_structures import bed, chain, stop

from multiphi_exudyn import ConstantLoad, HarmonicLoad, MultiPhiModel, simulate
from multiphi_exudyn.levels.model import level_store
from multiphi_exudyn.mathematics.bounded_cache import BoundedCache
from multiphi_exudyn.time import loaded_levels

TIMES = np.linspace(0.0, 0.04, 40)


class TestRecent:
    def test_lets_the_least_recently_used_go(self):
        gone = []
        recent = BoundedCache(2, lambda key, value: gone.append((key, value)))
        recent.keep("a", 1)
        recent.keep("b", 2)
        assert recent.find("a") == 1
        recent.keep("c", 3)
        assert gone == [("b", 2)]
        assert (recent.find("b"), len(recent), recent.kept) == (None, 2, 3)

    def test_an_entry_in_place_of_another_drops_none(self):
        recent = BoundedCache(1, lambda key, value: pytest.fail("dropped"))
        recent.keep("a", 1)
        assert recent.keep("a", 2) == recent.find("a") == 2


def run(monkeypatch, most, stiffness, loads):
    """A model that keeps so many levels, None for the usual bound, and its run."""
    if most is not None:
        monkeypatch.setattr(level_store, "CACHE_BYTES", 0)
        monkeypatch.setattr(level_store, "FEWEST_LEVELS", most)
    model = bed(stiffness, n=60, stops=8, modes=8)
    velocity = model.level(()).shapes[:, :4] @ [-6.0, 5.0, -9.0, 4.0]
    return model, simulate(model, float(TIMES[-1]), velocity=velocity, loads=loads)


def told(trajectory):
    """All of a run that can be compared to the bit."""
    events = [(e.time, e.contact, e.kind, e.loss, e.impulse) for e in trajectory.events]
    stats = trajectory.stats
    work = stats.transitions, stats.segments, stats.function_evaluations
    return events, work, trajectory.displacement(TIMES).tobytes(), trajectory.ledger


@pytest.mark.parametrize("loads", [(), (HarmonicLoad("p3", 1e4, 200.0),)], ids=["free", "driven"])
@pytest.mark.parametrize("stiffness", [1e7, math.inf])
@pytest.mark.parametrize("most", [1, 2])
def test_a_tiny_bound_gives_the_same_run_to_the_bit_and_is_kept(monkeypatch, most, stiffness, loads):
    plenty, usual = run(monkeypatch, None, stiffness, loads)
    assert usual.status == "ok", usual.message
    assert len(usual.events) > 10
    assert len({segment.level.level.indices for segment in usual.segments}) > most
    tight, same = run(monkeypatch, most, stiffness, loads)
    assert told(same) == told(usual)
    assert plenty.levels_built == plenty.levels_kept > most
    assert tight.levels_kept == most
    assert tight.levels_built > plenty.levels_built
    assert all(loaded.levels_kept <= most for _, loaded in tight.loaded.items())


def test_levels_of_the_core_are_kept_up_to_a_bound(monkeypatch):
    """Beyond it they are built anew, and the run is the same to the bit."""
    model, runs, cores = bed(1e7, n=60, stops=8, modes=8), [], []
    velocity = model.level(()).shapes[:, :4] @ [-6.0, 5.0, -9.0, 4.0]
    for bound in (2**29, 2**29, 0):
        monkeypatch.setattr(loaded_levels, "MOST_BYTES", bound)
        runs.append(simulate(model, float(TIMES[-1]), velocity=velocity, loads=[ConstantLoad("p3", 1.0)]))
        cores.append(runs[-1].ending.record.core_levels)
    assert cores[0] is cores[1]
    assert cores[2] is not cores[1]
    assert told(runs[0]) == told(runs[1]) == told(runs[2])
    assert all(1e5 < run.stats.array_bytes < 1e7 for run in runs)


def test_a_record_tells_its_bytes():
    model = MultiPhiModel(chain(2), [stop("m1", 0.0, 50.0)], modes="all")
    run = simulate(model, 1e3, velocity=[1.0, 0.3])
    assert 8 * 2 * 2 * len(run.segments) < run.stats.record_bytes < 400 * len(run.segments)


def test_what_is_kept_takes_no_more_bytes_than_the_bound(monkeypatch):
    """Of Python; a trajectory that is let go takes its own along."""
    bound = 400_000
    monkeypatch.setattr(level_store, "CACHE_BYTES", bound)
    monkeypatch.setattr(level_store, "FEWEST_LEVELS", 1)
    model = bed(1e7, n=100, stops=30, modes=8)
    velocity = model.level(()).shapes[:, :4] @ [-6.0, 5.0, -9.0, 4.0]
    gc.collect()
    tracemalloc.start()
    try:
        built = simulate(model, 0.04, velocity=velocity).stats.levels_built
        gc.collect()
        taken = tracemalloc.get_traced_memory()[0]
    finally:
        tracemalloc.stop()
    assert built > 2 * model.levels_kept == 2 * model.most_levels > 2
    assert taken < 3 * bound  # levels, and levels under their loads
