"""Element table: the elements of a model with their links, one after the other, and what these are in each state."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.mechanics.arguments import one_of
from multiphi_exudyn.mechanics.element import AnyLink, Element, is_oblique, link_places, links_of
from multiphi_exudyn.mechanics.force_law import ForceLaw

__all__ = ["ElementTable"]


class ElementTable:
    """What the elements ``contacts`` (c,) say of their l links, of which the first ones of all come first."""

    contacts: Sequence[Element]

    def index(self, name: str) -> int:
        """Position of a contact."""
        for i, contact in enumerate(self.contacts):
            if contact.name == name:
                return i
        raise MultiPhiValueError(f"contact: got {name!r}, need {one_of(name, (c.name for c in self.contacts))}")

    @functools.cached_property
    def links(self) -> tuple[AnyLink, ...]:
        """The links of all elements, the first ones first: a direction with a gap, a stiffness and a damping each."""
        return links_of(self.contacts)

    @functools.cached_property
    def link_places(self) -> tuple[tuple[int, ...], ...]:
        """Where every element's links stand among them (c,)."""
        return link_places(self.contacts)

    @functools.cached_property
    def held(self) -> tuple[int, ...]:
        """Positions of the links that have a held place, one channel each."""
        return tuple(k for k, link in enumerate(self.links) if link.held)

    @functools.cached_property
    def laws(self) -> dict[int, ForceLaw]:
        """Every force law by its position."""
        return {i: element for i, element in enumerate(self.contacts) if isinstance(element, ForceLaw)}

    @property
    def force_laws(self) -> tuple[ForceLaw, ...]:
        """The force laws among the contacts."""
        return tuple(self.laws.values())

    @functools.cached_property
    def rubbing(self) -> tuple[int, ...]:
        """Positions of the elements that have friction: a link with a held place."""
        return tuple(i for i, places in enumerate(self.link_places) if not set(places).isdisjoint(self.held))

    @functools.cached_property
    def oblique(self) -> dict[int, int]:
        """Links whose force acts along another direction than theirs, each with the first link of its element."""
        given = ((k, places[0]) for places in self.link_places for k in places[1:])
        return {k: first for k, first in given if is_oblique(self.links[k])}

    @functools.cached_property
    def gaps(self) -> np.ndarray:
        """Initial gaps (l,) [m]."""
        return np.array([link.gap for link in self.links])

    @functools.cached_property
    def stiffnesses(self) -> np.ndarray:
        """Stiffnesses (l,) [N/m], inf where rigid."""
        return np.array([link.stiffness for link in self.links])

    @functools.cached_property
    def springs(self) -> np.ndarray:
        """The same (l,), zero where rigid: a rigid contact stores nothing."""
        return np.where(np.isinf(self.stiffnesses), 0.0, self.stiffnesses)

    @functools.cached_property
    def dampings(self) -> np.ndarray:
        """Dampings (l,) [N s/m]."""
        return np.array([link.damping for link in self.links])

    @functools.cached_property
    def restoring(self) -> np.ndarray:
        """Forces (2, l) of links along their directions at a gap and at a gap velocity of one: -springs, -dampings."""
        return -np.stack([self.springs, self.dampings])

    def label(self, link: int) -> str:
        """What a link is called: its name, of a force law the law's, with friction that of its contact."""
        element = next(i for i, places in enumerate(self.link_places) if link in places)
        own = element in self.laws or link in self.oblique
        return self.links[element if own else link].name

    def pressing_links(self, element: int) -> list[int]:
        """Positions of the links that press where a contact is closed, with and without friction.

        Their gap is that of its first one. Of a force law, those that hold where it is not in segment "0".
        """
        own, *further = self.link_places[element]
        if element in self.laws:
            return further
        return [own, *(k for k in further if k in self.oblique)]

    def links_named(self, closed: Iterable[str]) -> tuple[int, ...]:
        """Positions of the links that hold where these contacts are closed, all others open, laws in segment "0"."""
        own = {i for i, law in self.laws.items() if law.stiffness}
        return tuple(sorted({self._closed(name) for name in closed} | own))

    def _closed(self, name: str) -> int:
        """Position of a contact that is closed, or friction that sticks."""
        i = self.index(name)
        if i in self.laws:
            raise MultiPhiValueError(f"closed: got the force law {name!r}, need {{{name!r}: segment}}")
        return i

    def states_named(self, given: Mapping[str, str]) -> tuple[int, ...]:
        """Numbers of the states of all elements."""
        states = [0] * len(self.contacts)
        for name, state in given.items():
            i = self.index(name)
            known = [own.name for own in self.contacts[i].states]
            if state not in known:
                raise MultiPhiValueError(f"state of {name!r}: got {state!r}, need one of: {', '.join(known)}")
            states[i] = known.index(state)
        return tuple(states)

    def links_held(self, states: Sequence[int]) -> tuple[int, ...]:
        """Positions of the links that hold where the elements are in these states: they name the modes."""
        return tuple(sorted(link for held, state in zip(self._holding, states, strict=True) for link in held[state]))

    @functools.cached_property
    def _holding(self) -> list[list[list[int]]]:
        """Positions of the links that hold, of every element in each of its states."""
        given = zip(self.contacts, self.link_places, strict=True)
        return [[[places[k] for k in state.holds] for state in contact.states] for contact, places in given]

    @functools.cached_property
    def pushes_of_states(self) -> list[list[float]]:
        """Constant forces [N] of every element in each of its states."""
        return [[state.push for state in contact.states] for contact in self.contacts]

    @functools.cached_property
    def general(self) -> bool:
        """Whether there are elements that do more than their links: some have held places, or push."""
        return bool(self.held) or any(any(pushes) for pushes in self.pushes_of_states)

    @functools.cached_property
    def struck_alone(self) -> np.ndarray:
        """Positions of the rigid contacts where nothing rubs: an impulse is along a contact's own direction then."""
        rubs = any(element.further or element.held for element in self.contacts)
        return np.array([i for i, element in enumerate(self.contacts) if element.rigid and not rubs], int)

    @functools.cached_property
    def levels_possible(self) -> int:
        """Number of levels: the product of the states of all elements."""
        return math.prod(len(contact.states) for contact in self.contacts)
