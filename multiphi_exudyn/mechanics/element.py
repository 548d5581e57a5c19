"""Element: what stands at a point of a structure, or between two, and is linear in each of its states.

It has links, of which some hold in each of its states. The element itself is the first of them, most have no other:

    q = h.x + gap - v t - w
    lambda = -k q - c q', force on the structure along +f;   rigid: q = 0, lambda its reaction

f is h, or another direction where a force beside the link's own goes with it, as friction goes with pressure. v is the
speed of the surface at its other side. w is zero, or *held*: a place that nothing but a change of state moves. Where
the link begins to hold, w becomes what gives it the stretch q that the state before says. In every state a constant
force, the push, may act along +h of the first link as well.

A state lasts as long as for each of its exits, summed over the links

    gap q + rate q' + force lambda + constant >= 0

Where that falls through zero the element asks for the state that the exit leads to. Where it is negative after others
have changed (or a change in truncated modes), the exit says by its firmness what holds:

    MAY_RECOVER      while it rises the state stays, and the exit waits until it has risen to zero
    NEVER_RECOVERS   it does not wait for that
    ALWAYS_TAKEN     nor for whether the state it leads to admits it: it changes at once
    TAKEN_ONCE       it waits while it rises; else it changes at once, but stays where it has just come from there
    TAKEN_FALLING    it waits while it rises; else it changes at once

    contact          open: q;  closed: -q where compliant, lambda where rigid (always taken) or viscous (never recovers)
    friction |T| <= F, T = -lambda, rigid or by a spring in series
                     stick (the link holds, w held): F + lambda and F - lambda;  slip s: push -s F, stretch s F / k,
                     exit s q', back into stick, taken once; those of stick always taken
    force law        a segment: its links hold, exits q' - q and q - q'' at its ends, taken once
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol, runtime_checkable

from multiphi_exudyn.mechanics.structure import At

__all__ = [
    "ALWAYS_TAKEN",
    "MAY_RECOVER",
    "NEVER_RECOVERS",
    "TAKEN_FALLING",
    "TAKEN_ONCE",
    "AnyLink",
    "Element",
    "ElementState",
    "Exit",
    "Link",
    "Share",
    "Turn",
    "contact_states",
    "event_kind",
    "friction_spring",
    "is_oblique",
    "link_places",
    "links_of",
]

MAY_RECOVER, NEVER_RECOVERS, ALWAYS_TAKEN, TAKEN_ONCE, TAKEN_FALLING = 0, 1, 2, 3, 4


@dataclass(frozen=True)
class Link:
    """A link beside an element's first one; see the module's docstring.

    name, direction, gap, stiffness, damping, velocity, held: as of an Element. push: f as a sum of coefficients times
    rows, empty for h; only a link whose h, gap, stiffness and damping are those of the first link has one of its own.
    """

    name: str
    direction: At
    gap: float = 0.0
    stiffness: float = math.inf
    damping: float = 0.0
    velocity: float = 0.0
    held: bool = False
    push: tuple[tuple[float, At], ...] = ()

    @property
    def rigid(self) -> bool:
        """True for an infinite stiffness."""
        return math.isinf(self.stiffness)


class Share(NamedTuple):
    """What a link has in an exit's signal: coefficients of its q, q' and lambda."""

    link: int
    gap: float = 0.0
    rate: float = 0.0
    force: float = 0.0


class Turn(NamedTuple):
    """The states that an exit asks for in place of its own while a link's q' is positive, or negative."""

    link: int
    forward: str
    backward: str


@dataclass(frozen=True)
class Exit:
    """A way out of a state into ``asked``; coefficients of its signal [1 and s times its unit], constant, firmness.

    gap, rate, force: of the first link. further: the shares of others. turn: where the way hangs on a speed.
    """

    asked: str
    gap: float = 0.0
    rate: float = 0.0
    force: float = 0.0
    constant: float = 0.0
    firmness: int = MAY_RECOVER
    further: tuple[Share, ...] = ()
    turn: Turn | None = None

    @property
    def shares(self) -> tuple[Share, ...]:
        """Of all links, the first one's first."""
        return (Share(0, self.gap, self.rate, self.force), *self.further)


@dataclass(frozen=True)
class ElementState:
    """One state; see the module's docstring.

    event: kind of the event that enters it, "close" where it is left open. holds: numbers of the links that hold.
    push: constant force [N] along +h. stretch: of the held link [m], kept for a state in which it holds. rubs: a link,
    and how much of its force friction T has against the held link; its stretch goes with T.
    """

    name: str
    event: str
    exits: tuple[Exit, ...]
    holds: tuple[int, ...] = ()
    push: float = 0.0
    stretch: float = 0.0
    rubs: tuple[int, float] | None = None


class AnyLink(Protocol):
    """direction, gap, stiffness, damping, rigid: as of a UnilateralContact. velocity: v [m/s]. held: whether w is."""

    @property
    def name(self) -> str: ...
    @property
    def direction(self) -> At: ...
    @property
    def gap(self) -> float: ...
    @property
    def stiffness(self) -> float: ...
    @property
    def damping(self) -> float: ...
    @property
    def rigid(self) -> bool: ...
    @property
    def velocity(self) -> float: ...
    @property
    def held(self) -> bool: ...


@runtime_checkable
class Element(AnyLink, Protocol):
    """An element by its links and its states; contacts, friction and force laws are elements.

    It is its own first link; further: the others. drop: the part of the energy of its held link's spring that is lost
    where the state in which it holds is left.
    """

    @property
    def further(self) -> tuple[Link, ...]: ...
    @property
    def drop(self) -> float: ...
    @property
    def states(self) -> tuple[ElementState, ...]: ...
    def first_state(self, q: float, rate: float, *rates: float) -> str:
        """The state in which it starts, w = 0, at rest relative to its surroundings where ``rate`` is zero.

        rates: q' of its further links.
        """


def links_of(elements: Sequence[Element]) -> tuple[AnyLink, ...]:
    """All links: the first ones in the order of the elements, then the further ones."""
    return (*elements, *(link for element in elements for link in element.further))


def link_places(elements: Sequence[Element]) -> tuple[tuple[int, ...], ...]:
    """Where every element's links stand among all of them."""
    places, end = [], len(elements)
    for i, element in enumerate(elements):
        places.append((i, *range(end, end + len(element.further))))
        end += len(element.further)
    return tuple(places)


def is_oblique(link: AnyLink) -> bool:
    """Whether a link's force acts along another direction than its own."""
    return isinstance(link, Link) and bool(link.push)


def event_kind(states: Sequence[ElementState], left: int, entered: int) -> str:
    """Kind of the event that leads from one state to another: a contact that was open closes, whatever it enters."""
    return "close" if states[left].name == "open" != states[entered].name else states[entered].event


def friction_spring(element: Element) -> tuple[int, int, float, float]:
    """Of an element with a held link: the state in which that holds, its number, its spring [N/m], zero for none.

    And what the spring loses of its energy where it begins to slip. (-1, 0, 0, 0) of other elements.
    """
    links: tuple[AnyLink, ...] = (element, *element.further)
    held = next((number for number, link in enumerate(links) if link.held), None)
    if held is None:
        return -1, 0, 0.0, 0.0
    state = next(k for k, state in enumerate(element.states) if held in state.holds)
    spring = 0.0 if links[held].rigid else links[held].stiffness
    return state, held, spring, element.drop


def contact_states(rigid: bool, viscous: bool) -> tuple[ElementState, ...]:
    """Open and closed."""
    opening = Exit("open", gap=-1.0)
    if viscous:
        opening = Exit("open", force=1.0, firmness=NEVER_RECOVERS)
    if rigid:
        opening = Exit("open", force=1.0, firmness=ALWAYS_TAKEN)
    closing = Exit("closed", gap=1.0, firmness=NEVER_RECOVERS if viscous else MAY_RECOVER)
    return ElementState("open", "open", (closing,)), ElementState("closed", "close", (opening,), holds=(0,))
