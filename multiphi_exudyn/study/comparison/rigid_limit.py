"""Rigid levels beside the scene's own stop and beside stiff ones, whose limit they are, in words."""

from __future__ import annotations

from collections.abc import Iterable

from multiphi_exudyn.study.comparison.compare import Comparison
from multiphi_exudyn.study.comparison.wording import engineering, listed, percent

__all__ = ["from_stiff_stops", "rigid_limit"]


def from_stiff_stops(comparison: Comparison, name: str) -> str:
    """How far a model with rigid levels is from stiff stops: "1.48 %"; "" of other models."""
    run = comparison.rigid.get(name)
    return "" if run is None else percent(comparison.stiff_error(run, comparison.headline_window))


def rigid_limit(comparison: Comparison) -> Iterable[str]:
    """What rigid levels are the limit of, and how far they are from it and from the reference."""
    stiff = comparison.stiff
    if stiff is None:
        return
    told = "Rigid levels are the limit of stiff stops"
    if not stiff.ok:
        yield f"{told}, but nothing with stiff stops ran: {stiff.message}."
        return
    if not comparison.rigid:
        return
    until = comparison.headline_window
    own = percent(stiff.uncertainty(comparison.bench.time, comparison.bench.judged_points, until))
    errors = [
        f"{name} {from_stiff_stops(comparison, name)}{_from_reference(comparison, name)}" for name in comparison.rigid
    ]
    yield (
        f"{told}, so they are measured against some too: to {until:g} s {listed(errors)} from all linear modes on "
        f"stops of {engineering(stiff.stiffness[0])}N/m and more, which themselves differ by up to {own}."
    )
    if not all(contact.rigid for contact in comparison.bench.mechanics.contacts):
        yield (
            "What rigid levels differ from the reference beyond that is the softness of its stop: more modes do not "
            "remove it, levels of the stop's own stiffness do not have it."
        )


def _from_reference(comparison: Comparison, name: str) -> str:
    if name not in comparison.measured:
        return ""
    error = percent(comparison.worst_error(comparison.runs[name], comparison.headline_window))
    return f" (from the reference {error})"
