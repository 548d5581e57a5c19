"""Ledger warnings: a run whose energy balance is open, or in which friction, damping or impacts gave energy.

    |residual| > OPEN (|initial| + |work of loads| + |final| + sum of |losses|)

In a right run both sides agree to round-off, 1e-12 of these energies in the worst of some thousand random runs. It is
more only where they are small beside what the loads could give, of which ROUND_OFF is allowed: p t of every mode, t no
longer than the run and than the mode moves one way. A wrong force or a wrong impulse opens the ledger by its whole
work. OPEN lies far from both.

The loop balances its sums when a run ends (verdict.py); only where it finds them open, or has left works out, the
ledger is made.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from multiphi_exudyn._core import OPEN_LEDGER as OPEN
from multiphi_exudyn.display import per_cent
from multiphi_exudyn.time.trajectory.ledger import Ledger
from multiphi_exudyn.time.trajectory.trajectory import Trajectory

__all__ = ["ledger_warnings"]

SAMPLES = 257  # of the speed, for its largest value
ROUND_OFF = 1e-9  # of the largest energy of a run, and of what its loads could give
REMEDY = (
    "this result is not to be trusted: run it again with a small stiffness where there is none, or a finite one where "
    "it is infinite, and report the case"
)


def ledger_warnings(trajectory: Trajectory) -> Iterator[str]:
    """At most one warning of a run with motion."""
    ledger = trajectory.ledger
    taken = {"friction": ledger.friction, "impact": ledger.impact}
    if trajectory.model.whole and not trajectory.model.overrides:  # dampers give back what truncation lets them
        taken["damping"] = ledger.damping
    name = min(taken, key=taken.__getitem__)
    given, limit = -taken[name], OPEN * ledger.turned_over
    if max(abs(ledger.residual), given) <= limit:
        return
    limit = max(limit, ROUND_OFF * _largest(trajectory))
    if abs(ledger.residual) > limit:
        yield f"open ledger: {_share(ledger.residual, ledger)} is not accounted for; {REMEDY}"
    elif given > limit:
        yield f"open ledger: {name} gave {_share(given, ledger)}, and can only take; {REMEDY}"


def _share(energy: float, ledger: Ledger) -> str:
    """An energy [J] as a share of those turned over."""
    return f"{per_cent(abs(energy) / ledger.turned_over)} of the energies turned over"


@np.errstate(over="ignore", invalid="ignore")  # of a run that grew without end
def _largest(trajectory: Trajectory) -> float:
    """Largest total and kinetic energy [J] of a run, or that which its loads could give the structure."""
    speeds = trajectory.model.base.coordinates(
        trajectory.velocity(np.linspace(trajectory.t_start, trajectory.t_end, SAMPLES))
    )
    kinetic = 0.5 * float(np.max(np.sum(speeds**2, axis=0)))
    omega, span = trajectory.model.base.modes.omega, trajectory.t_end - trajectory.start.time
    times = np.minimum(np.divide(1.0, omega, out=np.full(len(omega), span), where=omega > 0), span)
    loads = trajectory.segments.levels[0].excitation.largest_load
    return max(trajectory.segments.sizes(trajectory.t_end)[1], kinetic, 0.5 * float(np.sum((loads * times) ** 2)))
