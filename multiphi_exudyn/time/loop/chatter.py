"""Chatter: more events in a short time than modes and loads can follow."""

from __future__ import annotations

from multiphi_exudyn.levels.model import MultiPhiModel

__all__ = ["limits"]

EVENTS_PER_PERIOD = 20  # of the fastest mode or load, for every contact: more, over CHATTER_WINDOW, is chatter
CHATTER_WINDOW = 200  # events, for every contact


def limits(model: MultiPhiModel) -> tuple[int, float]:
    """How many of the last events the chatter check is about, and how many of them a period may hold.

    That of the highest kept mode or load. So many for every contact: stops side by side are all struck in a small part
    of a period, once each. A swing passes every knot of a law twice.
    """
    found: tuple[int, float] = model.entries.get_or_build("chatter", lambda: _limits(model))
    return found


def _limits(model: MultiPhiModel) -> tuple[int, float]:
    plain = max(1, len(model.contacts) - len(model.force_laws))  # contacts that are no force laws
    knots = sum(law.levels for law in model.force_laws)
    return CHATTER_WINDOW * plain, EVENTS_PER_PERIOD * plain + 2 * knots
