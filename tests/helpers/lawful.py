"""A run without truncation in which every law holds to round-off, and whose energies are balanced."""

from multiphi_exudyn.study.stability.law_check import broken_laws

__all__ = ["EXACT", "assert_lawful"]

EXACT = 1e-11  # of the terms of a force or a velocity, and of displacements about 1
INTERVALS = 60  # within segments, where the laws are checked


def assert_lawful(run, loads=(), round_off=1e-12, start=None):
    """The run and its laws; round_off: of energies about 1; start: x, x' that it was given, None: not checked."""
    assert run.status == "ok", run.message
    assert broken_laws(run, loads, start, intervals=INTERVALS, exact=EXACT) == []
    assert run.ledger.friction >= 0
    assert abs(run.ledger.residual) < round_off * max(1.0, run.ledger.initial)
