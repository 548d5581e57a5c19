"""What the many contacts of a model did together."""

from __future__ import annotations

from dataclasses import dataclass

from multiphi_exudyn.study.measures import metrics
from multiphi_exudyn.study.running.runs import ModelRun

__all__ = ["LISTED", "ContactTotals", "contact_totals"]

LISTED = 4  # contacts that are told of one by one; of more, what they did together


@dataclass(frozen=True)
class ContactTotals:
    """touched: contacts that closed at all; intervals: how often any did; most_at_once: closed together.

    levels: sets of closed contacts that occurred. first_contact [s], or None. contact_time: some contact is closed [s].
    impulse: sum of all [N s]; None where the model keeps none.
    """

    touched: int
    intervals: int
    most_at_once: int
    levels: int
    first_contact: float | None
    contact_time: float
    impulse: float | None


def contact_totals(run: ModelRun, t_end: float) -> ContactTotals:
    """Of a run to t_end [s]."""
    counts = [len(given) for given in run.contact_intervals.values()]
    held = metrics.held_levels(run.contact_intervals, t_end)
    together = metrics.union(run.contact_intervals.values())
    return ContactTotals(
        touched=sum(count > 0 for count in counts),
        intervals=sum(counts),
        most_at_once=max(map(len, held)),
        levels=len(held),
        first_contact=metrics.first_contact(together),
        contact_time=metrics.closed_time(together),
        impulse=sum(run.impulse.values()) if run.impulse else None,
    )
