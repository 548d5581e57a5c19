"""What must hold of every run: its status and the laws of mechanics and contact (study/law_check.py)."""

from multiphi_exudyn.study.law_check import broken_laws

__all__ = ["EXACT", "assert_lawful", "complaints"]

EXACT = 1e-11  # of the terms of a force or a velocity, and of displacements about 1
INTERVALS = 60  # within segments, where the laws are checked
EXPECTED_FAILURES = ("not independent of each other",)  # causes that are the scene's own


def complaints(run, loads=(), start=None, **how):
    """Failures whose cause is not the scene's own, and laws that are broken; start: x, x' that the run was given."""
    named = run.message.startswith("at t = ") and any(cause in run.message for cause in EXPECTED_FAILURES)
    failed = [] if run.status == "ok" or named else [f"status: {run.message}"]
    return [*failed, *broken_laws(run, loads, start, **how)]


def assert_lawful(run, loads=(), round_off=1e-12, start=None):
    """A run without truncation in which every law holds to round-off; round_off: of energies about 1."""
    assert run.status == "ok", run.message
    assert broken_laws(run, loads, start, intervals=INTERVALS, exact=EXACT) == []
    assert run.ledger.friction >= 0
    assert abs(run.ledger.residual) < round_off * max(1.0, run.ledger.initial)
