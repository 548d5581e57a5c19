"""What a run does: its numbers are its own, its record has an end, its calls of Python do not grow with its events."""

import sys

import pytest
from small_structures import chain, oscillator, stop

import multiphi_exudyn as mp
from multiphi_exudyn.time.simulate import Run


def test_statistics_of_a_run_are_its_own():
    """A later run in the same levels builds more of them."""
    model = mp.MultiPhiModel(chain(4), [stop("m3", 0.1), stop("m0", 0.2, name="other")], modes="all")
    early = mp.simulate(model, 1.0, velocity=[0.0, 0.0, 0.0, -0.01])
    before = early.stats
    late = mp.simulate(model, 40.0, velocity=[-1.0, 0.3, 0.0, -2.0])
    assert late.stats.array_bytes > before.array_bytes
    assert late.stats.levels_built > before.levels_built
    assert early.stats == before


def test_a_record_that_would_fill_the_memory_ends_the_run():
    motion = Run(oscillator(gap=0.0, contact=8.0), 1e5, displacement=[1.0]).begun()
    motion._run.limit_record(100_000)
    motion.advance(1e5)
    found = motion.trajectory(1e5)
    assert found.status == "failed"
    assert "record: got" in found.message
    assert 100 < len(found.segments) < 1000
    assert found.stats.record_bytes == pytest.approx(100_000, rel=0.01)
    assert abs(found.ledger.residual) < 1e-10 * found.ledger.initial


def test_a_run_of_known_levels_calls_python_a_fixed_number_of_times():
    """However many events it has."""
    model = mp.MultiPhiModel(chain(3), [stop("m2", 0.1, 30.0)], modes="all")
    _, few, many = (calls_of(model, t_end) for t_end in (400.0, 40.0, 400.0))
    assert few[0] < many[0] / 5
    assert max(few[1], many[1]) <= 250


def calls_of(model, t_end):
    """Number of events of a run, and of its calls of Python functions."""
    calls = 0

    def count(frame, event, argument):
        nonlocal calls
        calls += event == "call"

    sys.setprofile(count)
    try:
        run = mp.simulate(model, t_end, velocity=[0.0, 0.0, -1.0])
    finally:
        sys.setprofile(None)
    return len(run.events), calls
