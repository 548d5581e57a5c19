"""Chatter: more events in a short time than modes and loads can follow."""

from __future__ import annotations

from multiphi_exudyn.levels.model import MultiPhiModel

__all__ = ["allowed", "window"]

EVENTS_PER_PERIOD = 20  # of the fastest mode or load, for every contact: more, over CHATTER_WINDOW, is chatter
CHATTER_WINDOW = 200  # events, for every contact


def window(model: MultiPhiModel) -> int:
    """How many of the last events the chatter check is about, so many for every contact.

    Stops side by side are all struck in a small part of a period, once each.
    """
    return CHATTER_WINDOW * _plain(model)


def allowed(model: MultiPhiModel) -> float:
    """How many of them a period of the highest kept mode or load may hold.

    A swing passes every knot of a law twice.
    """
    return EVENTS_PER_PERIOD * _plain(model) + 2 * sum(law.levels for law in model.force_laws)


def _plain(model: MultiPhiModel) -> int:
    """Number of contacts that are no force laws, at least 1."""
    return max(1, len(model.contacts) - len(model.force_laws))
