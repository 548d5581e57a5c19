"""Element: what stands at a point of a structure, or between two, and is linear in each of its states.

It has one link, which in some of its states holds:

    q = h.x + gap - v t - w
    lambda = -k q - c q', force on the structure along +h;   rigid: q = 0, lambda its reaction

v is the speed of the surface at its other side. w is zero, or *held*: a place that nothing but a change of state moves.
Where the link begins to hold, w becomes what gives it the stretch q that the state before says. In every state a
constant force, the push, may act along +h as well.

A state lasts as long as for each of its exits

    gap q + rate q' + force lambda + constant >= 0

Where that falls through zero the element asks for the state that the exit leads to. Where it is negative after others
have changed (or a change in truncated modes), the exit says by its firmness what holds:

    MAY_RECOVER      while it rises the state stays, and the exit waits until it has risen to zero
    NEVER_RECOVERS   it does not wait for that
    ALWAYS_TAKEN     nor for whether the state it leads to admits it: it changes at once
    TAKEN_ONCE       it waits while it rises; else it changes at once, but stays where it has just come from there

    contact          open: q;  closed: -q where compliant, lambda where rigid (always taken) or viscous (never recovers)
    friction |T| <= F, T = -lambda, rigid or by a spring in series
                     stick (the link holds, w held): F + lambda and F - lambda;  slip s: push -s F, stretch s F / k,
                     exit s q', back into stick, taken once; those of stick always taken
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from multiphi_exudyn.mechanics.structure import At

__all__ = [
    "ALWAYS_TAKEN",
    "MAY_RECOVER",
    "NEVER_RECOVERS",
    "TAKEN_ONCE",
    "Element",
    "ElementState",
    "Exit",
    "contact_states",
]

MAY_RECOVER, NEVER_RECOVERS, ALWAYS_TAKEN, TAKEN_ONCE = 0, 1, 2, 3


@dataclass(frozen=True)
class Exit:
    """A way out of a state into ``asked``; coefficients of its signal [1 and s times its unit], constant, firmness."""

    asked: str
    gap: float = 0.0
    rate: float = 0.0
    force: float = 0.0
    constant: float = 0.0
    firmness: int = MAY_RECOVER


@dataclass(frozen=True)
class ElementState:
    """One state; see the module's docstring.

    event: kind of the event that enters it. holds: whether the link holds. push: constant force [N] along +h.
    stretch: of the link [m], kept for a state in which it holds.
    """

    name: str
    event: str
    exits: tuple[Exit, ...]
    holds: bool = False
    push: float = 0.0
    stretch: float = 0.0


@runtime_checkable
class Element(Protocol):
    """An element by its link and its states; contacts and the springs of force laws are elements.

    direction, gap, stiffness, damping, rigid: of the link, as of a UnilateralContact. velocity: v [m/s]. held: whether
    w is.
    """

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
    @property
    def states(self) -> tuple[ElementState, ...]: ...
    def first_state(self, q: float, rate: float) -> str:
        """The state in which it starts, w = 0, at rest relative to its surroundings where ``rate`` is zero."""


def contact_states(rigid: bool, viscous: bool) -> tuple[ElementState, ...]:
    """Open and closed."""
    opening = Exit("open", gap=-1.0)
    if viscous:
        opening = Exit("open", force=1.0, firmness=NEVER_RECOVERS)
    if rigid:
        opening = Exit("open", force=1.0, firmness=ALWAYS_TAKEN)
    closing = Exit("closed", gap=1.0, firmness=NEVER_RECOVERS if viscous else MAY_RECOVER)
    return ElementState("open", "open", (closing,)), ElementState("closed", "close", (opening,), holds=True)
