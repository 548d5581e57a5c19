"""Ledger warnings: a run whose energy balance is open, or in which friction, damping or impacts gave energy.

    |residual| > OPEN (|initial| + |work of loads| + |final| + sum of |losses|)

In a right run both sides agree to round-off, 1e-12 of these energies in the worst of some thousand random runs, more only
where they are small differences of large potentials, of which OPEN_ROUND_OFF is allowed. A wrong force or a wrong
impulse opens the ledger by its whole work. OPEN lies far from both.
"""

from __future__ import annotations

from collections.abc import Iterator

from multiphi_exudyn.display import per_cent
from multiphi_exudyn.time.trajectory.ledger import Ledger
from multiphi_exudyn.time.trajectory.trajectory import Trajectory

__all__ = ["OPEN", "ledger_warnings"]

OPEN = 1e-6  # of the energies turned over
OPEN_ROUND_OFF = 1e-9  # of the largest potential and energy of the run
GIVES = "friction", "damping", "impact"  # rows that can only take energy
REMEDY = (
    "this result is not to be trusted: run it again with a small stiffness where there is none, or a finite one where "
    "it is infinite, and report the case"
)


def ledger_warnings(trajectory: Trajectory) -> Iterator[str]:
    """At most one warning of a run with motion."""
    ledger = trajectory.ledger
    limit = OPEN * ledger.turned_over
    if abs(ledger.residual) <= limit and min(ledger.friction, ledger.damping, ledger.impact) >= -limit:
        return
    yield from _judged(trajectory, ledger, max(limit, OPEN_ROUND_OFF * _largest(trajectory)))


def _judged(trajectory: Trajectory, ledger: Ledger, limit: float) -> Iterator[str]:
    """Warning of a ledger in which more than a limit [J] is open, or given by a row that only takes."""
    if abs(ledger.residual) > limit:
        share = per_cent(abs(ledger.residual) / ledger.turned_over)
        yield f"open ledger: {share} of the energies turned over is not accounted for; {REMEDY}"
        return
    name = min(GIVES, key=lambda row: getattr(ledger, row))
    if (given := -getattr(ledger, name)) > limit:
        share = per_cent(given / ledger.turned_over)
        yield f"open ledger: {name} gave {share} of the energies turned over, and can only take; {REMEDY}"


def _largest(trajectory: Trajectory) -> float:
    """Largest energy [J] of a run, and the largest potential of its levels at rest."""
    segments = trajectory.segments
    potentials = [abs(level.asymptotic.potential) for level in segments.levels]
    return max(segments.sizes(trajectory.t_end)[1], *potentials)
