"""Element: a contact, friction or force law at a point of a structure, or between two points, linear in each state.

An element has links, some of which act (hold) in each of its states. The element itself is the first link; most
elements have no other:

    q = h.x + gap - v t - w
    lambda = -k q - c q', force on the structure along +f;   rigid: q = 0, lambda its reaction

f is h, or another direction if a further force is proportional to that of the link, as friction is to pressure. v is
the velocity of the counter-surface. w is zero, or *held*: a position that only a change of state moves. When the link
begins to act, w takes the value that gives the link the stretch q which the previous state defines. In every state a
constant force, the push, may act along +h of the first link as well.

A state lasts as long as for each of its exits the signal, summed over the links, is not negative,

    gap q + rate q' + force lambda + constant >= 0

When it falls through zero, the element requests the state to which the exit leads. If it is negative after changes of
other elements (or a change in truncated modes), the firmness of the exit decides:

    MAY_RECOVER      the state stays while the signal rises, and the exit waits until it has risen to zero
    NEVER_RECOVERS   the exit does not wait for the signal to rise
    ALWAYS_TAKEN     nor does it ask whether the new state is admissible: the state changes at once
    TAKEN_ONCE       it waits while the signal rises; else the state changes at once, but not back to the last state
    TAKEN_FALLING    it waits while the signal rises; else the state changes at once

    contact          open: q;  closed: -q where compliant, lambda where rigid (always taken) or viscous (never recovers)
    friction |T| <= F, T = -lambda, rigid or by a spring in series
                     stick (the link acts, w held): F + lambda and F - lambda;  slip s: push -s F, stretch s F / k,
                     exit s q', back into stick, taken once; those of stick always taken
    force law        a segment: its links act, exits q' - q and q - q'' at its ends, taken once
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
    "link_indices",
    "links_of",
]

MAY_RECOVER, NEVER_RECOVERS, ALWAYS_TAKEN, TAKEN_ONCE, TAKEN_FALLING = 0, 1, 2, 3, 4


@dataclass(frozen=True)
class Link:
    """A further link of an element, see the module's docstring.

    name, direction, gap, stiffness, damping, velocity, held: as of an Element. push: f as a sum of coefficients times
    rows, empty for f = h; only a link with h, gap, stiffness and damping of the first link may have another f.
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
    """Share of a link in an exit's signal: coefficients of its q, q' and lambda."""

    link: int
    gap: float = 0.0
    rate: float = 0.0
    force: float = 0.0


class Turn(NamedTuple):
    """States that an exit requests instead of its own if a link's q' is positive (forward) or negative (backward)."""

    link: int
    forward: str
    backward: str


@dataclass(frozen=True)
class Exit:
    """Exit of a state, which requests the state ``asked``; constant and firmness as in the module's docstring.

    gap, rate, force: coefficients of the first link in the signal; further: shares of other links. turn: requested
    states that depend on the sign of a velocity, or None.
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
        """Shares of all links, beginning with the first link."""
        return (Share(0, self.gap, self.rate, self.force), *self.further)


@dataclass(frozen=True)
class ElementState:
    """One state of an element, see the module's docstring.

    event: kind of the event that enters the state, "close" if it comes from open. holds: numbers of the links that act.
    push: constant force [N] along +h. stretch: of the held link [m], for the state in which it acts next. rubs: number
    of a link and the coefficient of its force in the friction force T against the held link, which gives the stretch.
    """

    name: str
    event: str
    exits: tuple[Exit, ...]
    holds: tuple[int, ...] = ()
    push: float = 0.0
    stretch: float = 0.0
    rubs: tuple[int, float] | None = None


class AnyLink(Protocol):
    """A link: direction, gap, stiffness, damping, rigid as of a UnilateralContact; v [m/s]; whether w is held."""

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
    """An element with its links and its states: a contact, friction or a force law.

    It is its own first link; further: its other links. drop: part of the energy of its held link's spring that is lost
    at the end of the state in which this link acts.
    """

    @property
    def further(self) -> tuple[Link, ...]: ...
    @property
    def drop(self) -> float: ...
    @property
    def states(self) -> tuple[ElementState, ...]: ...
    def first_state(self, q: float, rate: float, *rates: float) -> str:
        """State at the start of a run with q, q' = ``rate`` and w = 0; rates: q' of the further links."""


def links_of(elements: Sequence[Element]) -> tuple[AnyLink, ...]:
    """All links: the first links in the order of the elements, then the further ones."""
    return (*elements, *(link for element in elements for link in element.further))


def link_indices(elements: Sequence[Element]) -> tuple[tuple[int, ...], ...]:
    """Indices of every element's links among all links."""
    indices, end = [], len(elements)
    for i, element in enumerate(elements):
        indices.append((i, *range(end, end + len(element.further))))
        end += len(element.further)
    return tuple(indices)


def is_oblique(link: AnyLink) -> bool:
    """Whether a link's force acts along another direction than its own."""
    return isinstance(link, Link) and bool(link.push)


def event_kind(states: Sequence[ElementState], source: int, target: int) -> str:
    """Kind of the event from one state to another; "close" from open to any other state."""
    return "close" if states[source].name == "open" != states[target].name else states[target].event


def friction_spring(element: Element) -> tuple[int, int, float, float]:
    """State in which the held link of an element acts, the link's number, its spring [N/m] (zero for none), and drop.

    (-1, 0, 0, 0) for an element without a held link.
    """
    links: tuple[AnyLink, ...] = (element, *element.further)
    held = next((number for number, link in enumerate(links) if link.held), None)
    if held is None:
        return -1, 0, 0.0, 0.0
    state = next(k for k, state in enumerate(element.states) if held in state.holds)
    spring = 0.0 if links[held].rigid else links[held].stiffness
    return state, held, spring, element.drop


def contact_states(rigid: bool, viscous: bool) -> tuple[ElementState, ...]:
    """States of a contact without friction: open and closed."""
    opening = Exit("open", gap=-1.0)
    if viscous:
        opening = Exit("open", force=1.0, firmness=NEVER_RECOVERS)
    if rigid:
        opening = Exit("open", force=1.0, firmness=ALWAYS_TAKEN)
    closing = Exit("closed", gap=1.0, firmness=NEVER_RECOVERS if viscous else MAY_RECOVER)
    return ElementState("open", "open", (closing,)), ElementState("closed", "close", (opening,), holds=(0,))
