"""Failures: the cause that has stopped the loop, as a sentence that names the contacts and what is needed."""

from __future__ import annotations

import math

import numpy as np

from multiphi_exudyn.errors import NumericalFailure
from multiphi_exudyn.events import arrays as a
from multiphi_exudyn.events.packing.level_arrays import LevelArrays
from multiphi_exudyn.mechanics.elements.force_law import ForceLaw
from multiphi_exudyn.time.loop.chatter import limits
from multiphi_exudyn.time.loop.loop_record import ACCUMULATED

__all__ = ["failure"]


def failure(arrays: LevelArrays) -> NumericalFailure:
    """Return the error of a failed loop, from the cause and the numbers in its arrays."""
    ints, model = arrays.ints, arrays.levels.model
    facts = arrays.numbers[a.TOLD : a.TOLD + 3].tolist()
    flags = ints[ints[a.CAUSED_BY] :][: ints[a.ELEMENTS]]
    names = ", ".join(model.contacts[i].name for i in np.flatnonzero(flags).tolist())
    complete = model.level_at(()).modes == model.base.modes.count
    window, limit = limits(model)
    sentences = {
        a.NOT_FINITE: "the motion is not finite" + _laws_at_an_end(arrays),
        a.TOO_LONG: f"search for the next event: got motion of up to {facts[0] / (2 * math.pi):g} Hz, whose "
        f"samples every {facts[1]:g} s until the end, in {facts[2]:g} s, would take too long; "
        "need fewer modes or a shorter run",
        a.CHATTER: f"chatter: {window} events in {facts[0]:g} s, more than {limit} in a period of the "
        f"highest kept mode or load ({facts[1]:g} Hz), or all within {ACCUMULATED:g} of the time so far; more modes or "
        "contacts of finite stiffness may help",
        a.NOT_ADMISSIBLE: f"contacts {names}: no set of closed contacts is admissible at this instant",
        a.SQUEEZED: f"rigid contacts {names}: their stops move against each other and leave no way out"
        + ("" if complete else " in the kept modes, need more of them"),
        a.UNSETTLED: "no contact forces were found that agree with the motion: round-off decides which contacts push, "
        "or friction is too high for a unique answer, need a smaller coefficient of friction",
        a.MIXED: f"rigid contacts {names}: struck together, but their restitutions differ, need one value",
        a.GAINING: f"rigid contacts {names}: an impact with friction and different restitutions would create energy, "
        "need one value of restitution",
    }
    return NumericalFailure(sentences[int(ints[a.CAUSE])])


def _laws_at_an_end(arrays: LevelArrays) -> str:
    """Return what is said of force laws that are continued beyond their spans where a run has failed."""
    ints, level = arrays.ints, int(arrays.ints[a.CURRENT + a.LEVEL])
    states = ints[ints[level + a.STATES] :][: ints[a.ELEMENTS]].tolist() if level else []
    laws = [
        law
        for law, state in zip(arrays.levels.model.contacts, states, strict=False)
        if isinstance(law, ForceLaw) and law.is_last(state)
    ]
    spans = ", ".join(f"{law.name!r} ({law.knots[0]:g}, {law.knots[-1]:g})" for law in laws)
    return f"; force laws whose last segments would be continued beyond their spans: {spans}" if laws else ""
