"""Where the beams of a scene are drawn: points that meet stand over each other, as far apart as their gap.

A contact g = c (w_a - w_b) + gap is closed where w_a - w_b = -gap / c, so b is drawn gap / c below a: lines that touch
are beams that touch. Points that are tied to each other have one height. The mechanics know no such places.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from multiphi_exudyn.mechanics.contact import UnilateralContact
from reference_models.beams import Beams

__all__ = ["Placement", "coefficient", "meeting", "placements"]


@dataclass(frozen=True)
class Placement:
    """Of a beam: shift of its x [m], its height when undeformed [m]; group: beams that contacts or ties hold together.

    Shift and height are relative to the first beam of the group.
    """

    shift: float
    height: float
    group: int


@dataclass(frozen=True)
class _Link:
    """Beam b stands where its x_b is over x_a of beam a, ``drop`` [m] below."""

    a: str
    b: str
    ahead: float
    drop: float

    @property
    def turned(self) -> _Link:
        return _Link(self.b, self.a, -self.ahead, -self.drop)


def placements(beams: Beams, contacts: Sequence[UnilateralContact]) -> dict[str, Placement]:
    """A place for every beam; where several contacts link two beams, the first one counts."""
    links = [*_contact_links(beams, contacts), *_tie_links(beams)]
    links += [link.turned for link in links]
    placed: dict[str, Placement] = {}
    for group, first in enumerate(beams.parts):
        waiting = [] if first in placed else [first]
        placed.setdefault(first, Placement(0.0, 0.0, group))
        while waiting:
            waiting += _place_next_to(waiting.pop(0), links, placed)
    return placed


def meeting(contact: UnilateralContact) -> tuple[str, ...]:
    """The points a contact acts on; none where it acts on a row of coordinates."""
    given = contact.direction
    if isinstance(given, str):
        return (given,)
    return tuple(given) if isinstance(given, Mapping) else ()


def coefficient(contact: UnilateralContact) -> float:
    """c of the first point a contact acts on."""
    given = contact.direction
    return next(iter(given.values())) if isinstance(given, Mapping) else 1.0


def _place_next_to(beam: str, links: Sequence[_Link], placed: dict[str, Placement]) -> list[str]:
    """Place the beams linked to ``beam`` that have no place; their names."""
    new = []
    for link in links:
        if link.a == beam and link.b not in placed:
            own = placed[beam]
            placed[link.b] = replace(own, shift=own.shift + link.ahead, height=own.height - link.drop)
            new.append(link.b)
    return new


def _contact_links(beams: Beams, contacts: Sequence[UnilateralContact]) -> list[_Link]:
    links = []
    for contact in contacts:
        if len(meeting(contact)) == 2:
            point, other = meeting(contact)
            links += _link(beams, point, other, contact.gap / coefficient(contact))
    return links


def _tie_links(beams: Beams) -> list[_Link]:
    pairs = [tuple(tie) for tie in beams.ties if len(tie) == 2]
    return [link for point, other in pairs for link in _link(beams, point, other, 0.0)]


def _link(beams: Beams, point: str, other: str, drop: float) -> list[_Link]:
    """The link of two points, none within one beam."""
    (a, x_a), (b, x_b) = beams.points[point], beams.points[other]
    return [_Link(a, b, x_a - x_b, drop)] if a != b else []
