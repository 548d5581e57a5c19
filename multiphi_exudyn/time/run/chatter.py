"""Chatter: more events in a short time than modes and loads can follow."""

from __future__ import annotations

from multiphi_exudyn.levels.model.model import MultiPhiModel

__all__ = ["limits"]

EVENTS_PER_PERIOD = 20  # of the fastest mode or load, for each contact: more, over CHATTER_WINDOW, is chatter
CHATTER_WINDOW = 200  # events, for each contact


def limits(model: MultiPhiModel) -> tuple[int, float]:
    """Window of the chatter check [events], and largest number of events in a period of the highest mode or load.

    Both grow with the number of contacts: stops side by side are all struck in a small part of a period, once each.
    An oscillation passes every knot of a force law twice.
    """
    window_and_limit: tuple[int, float] = model.entries.get_or_build("chatter", lambda: _limits(model))
    return window_and_limit


def _limits(model: MultiPhiModel) -> tuple[int, float]:
    contacts = max(1, len(model.contacts) - len(model.force_laws))  # that are no force laws
    knots = sum(law.levels for law in model.force_laws)
    return CHATTER_WINDOW * contacts, EVENTS_PER_PERIOD * contacts + 2 * knots
