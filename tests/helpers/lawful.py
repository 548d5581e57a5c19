"""A run without truncation in which every law holds to round-off, and whose energies are balanced."""

from multiphi_exudyn.study.stability.law_check import broken_laws

__all__ = ["EXACT", "assert_lawful"]

EXACT = 1e-11  # of the terms of a force or a velocity, and of displacements about 1
INTERVALS = 60  # within segments, where the laws are checked


def assert_lawful(run, loads=(), start=None, round_off=1e-12):
    """The run and its laws; start: x, x' that it was given, None: not checked; round_off: of energies about 1."""
    assert run.status == "ok", run.message
    assert broken_laws(run, loads, start, intervals=INTERVALS, exact=EXACT) == []
    assert run.ledger.friction >= 0
    assert abs(run.ledger.residual) < round_off * max(1.0, run.ledger.initial)
