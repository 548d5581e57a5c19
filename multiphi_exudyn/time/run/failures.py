"""Failures: the cause that has stopped a run, as a sentence that names the contacts and what is needed."""

from __future__ import annotations

import math
from collections.abc import Sequence

import multiphi_exudyn._core as core
from multiphi_exudyn.errors import NumericalFailure
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mechanics.elements.force_law import ForceLaw
from multiphi_exudyn.time.run.chatter import limits

__all__ = ["failure"]

ACCUMULATED = 1e-6  # of the time so far: a window of events within it is chatter (core/run.cpp)


def failure(model: MultiPhiModel, told: core.Failure, states: Sequence[int]) -> NumericalFailure:
    """Return the error of a run that the core has ended; states: of the elements in the level where it failed."""
    facts, names = told.details, ", ".join(model.contacts[i].name for i in sorted(set(told.elements)))
    complete = model.level_at(()).modes == model.base.modes.count
    window, limit = limits(model)
    sentences = {
        core.Cause.not_finite: "the motion is not finite" + _laws_at_an_end(model, states),
        core.Cause.search_too_long: "search for the next event: got motion of up to "
        f"{facts[0] / (2 * math.pi):g} Hz, whose samples every {facts[1]:g} s until the end, in {facts[2]:g} s, would "
        "take too long; need fewer modes or a shorter run",
        core.Cause.chatter: f"chatter: {window} events in {facts[0]:g} s, more than {limit} in a period of the "
        f"highest kept mode or load ({facts[1]:g} Hz), or all within {ACCUMULATED:g} of the time so far; more modes or "
        "contacts of finite stiffness may help",
        core.Cause.not_admissible: f"contacts {names}: no set of closed contacts is admissible at this instant",
        core.Cause.squeezed: f"rigid contacts {names}: their stops move against each other and leave no way out"
        + ("" if complete else " in the kept modes, need more of them"),
        core.Cause.unsettled: "no contact forces were found that agree with the motion: round-off decides which "
        "contacts push, or friction is too high for a unique answer, need a smaller coefficient of friction",
        core.Cause.mixed_restitution: f"rigid contacts {names}: struck together, but their restitutions differ, need "
        "one value",
        core.Cause.gaining_energy: f"rigid contacts {names}: an impact with friction and different restitutions would "
        "create energy, need one value of restitution",
        core.Cause.record_full: f"record: got {facts[0] / 1e9:.2g} GB of {facts[1]:.0f} segments, need at most "
        f"{facts[2] / 1e9:.2g} GB: make the run shorter and continue it (start=), or give loads fewer samples",
    }
    return NumericalFailure(sentences[told.cause])


def _laws_at_an_end(model: MultiPhiModel, states: Sequence[int]) -> str:
    """Return what is said of force laws that are continued beyond their spans where a run has failed."""
    laws = [
        law
        for law, state in zip(model.contacts, states, strict=False)
        if isinstance(law, ForceLaw) and law.is_last(state)
    ]
    spans = ", ".join(f"{law.name!r} ({law.knots[0]:g}, {law.knots[-1]:g})" for law in laws)
    return f"; force laws whose last segments would be continued beyond their spans: {spans}" if laws else ""
