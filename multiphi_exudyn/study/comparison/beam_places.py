"""Where the beams of a scene are drawn: points that meet stand over each other, as far apart as their gap.

A contact g = c (w_a - w_b) + gap is closed where w_a - w_b = -gap / c, so b is drawn gap / c below a: lines that touch
are beams that touch. Points that are tied to each other have one height. The mechanics know no such places.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from multiphi_exudyn.mechanics.contact import UnilateralContact
from reference_models.beams import Beams

__all__ = ["beam_places", "coefficients"]


def coefficients(contact: UnilateralContact) -> dict[str, float]:
    """The points a contact acts on, and c of each; none where it acts on a row of coordinates."""
    given = contact.direction
    if isinstance(given, str):
        return {given: 1.0}
    return dict(given) if isinstance(given, Mapping) else {}


def beam_places(beams: Beams, contacts: Sequence[UnilateralContact]) -> dict[str, float]:
    """The beams from top to bottom, and by how much the x of each is shifted [m].

    Beams that contacts or ties hold together stand together; where several link two beams, the first one counts.
    """
    links = list(_links(beams, contacts))
    places: dict[str, tuple[int, float, float]] = {}  # group, depth below its first beam [m], shift [m]
    for group, first in enumerate(beams.parts):
        places.setdefault(first, (group, 0.0, 0.0))
        waiting = [first]
        for beam in waiting:
            _, depth, shift = places[beam]
            for above, below, ahead, drop in links:
                if above == beam and below not in places:
                    places[below] = (group, depth + drop, shift + ahead)
                    waiting.append(below)
    return {name: places[name][2] for name in sorted(places, key=lambda name: places[name][:2])}


def _links(beams: Beams, contacts: Sequence[UnilateralContact]) -> Iterator[tuple[str, str, float, float]]:
    """Two beams, how far the second one's x is ahead of the first one's, and how far it lies below [m]; both ways."""
    met = [(coefficients(contact), contact.gap) for contact in contacts]
    for points, gap in [*met, *((dict(tie), 0.0) for tie in beams.ties)]:
        if len(points) == 2:
            (a, x_a), (b, x_b) = (beams.points[point] for point in points)
            drop = gap / next(iter(points.values()))
            yield from [(a, b, x_a - x_b, drop), (b, a, x_b - x_a, -drop)] if a != b else []
