"""Element table: the elements of a model with all their links, and the links that act in each state."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.mechanics.arguments import one_of
from multiphi_exudyn.mechanics.element import AnyLink, Element, is_oblique, link_indices, links_of
from multiphi_exudyn.mechanics.force_law import ForceLaw
from multiphi_exudyn.mechanics.residual_contact import ResidualContact

__all__ = ["ElementTable"]


class ElementTable:
    """Table of the elements ``contacts`` (c,) and their l links, the first links of all elements before the others."""

    contacts: Sequence[Element]

    def index(self, name: str) -> int:
        """Index of a contact by name."""
        for i, contact in enumerate(self.contacts):
            if contact.name == name:
                return i
        raise MultiPhiValueError(f"contact: got {name!r}, need {one_of(name, (c.name for c in self.contacts))}")

    @functools.cached_property
    def links(self) -> tuple[AnyLink, ...]:
        """Links of all elements, first links first; each has a direction, a gap, a stiffness and a damping."""
        return links_of(self.contacts)

    @functools.cached_property
    def link_indices(self) -> tuple[tuple[int, ...], ...]:
        """Indices of every element's links among all links (c,)."""
        return link_indices(self.contacts)

    @functools.cached_property
    def held(self) -> tuple[int, ...]:
        """Indices of the links with a stick position, which is a channel each."""
        return tuple(k for k, link in enumerate(self.links) if link.held)

    @functools.cached_property
    def residual(self) -> tuple[int, ...]:
        """Indices of the links that act through the flexibility of the modes left out."""
        return tuple(i for i, element in enumerate(self.contacts) if isinstance(element, ResidualContact))

    @functools.cached_property
    def rigid_links(self) -> np.ndarray:
        """Whether a link (l,) that acts takes a direction from the motion."""
        return np.array([link.rigid for link in self.links], bool)

    @functools.cached_property
    def laws(self) -> dict[int, ForceLaw]:
        """Force laws by index."""
        return {i: element for i, element in enumerate(self.contacts) if isinstance(element, ForceLaw)}

    @property
    def force_laws(self) -> tuple[ForceLaw, ...]:
        """The force laws among the contacts."""
        return tuple(self.laws.values())

    @functools.cached_property
    def rubbing(self) -> tuple[int, ...]:
        """Indices of the elements with friction, that is with a link that has a stick position."""
        return tuple(i for i, indices in enumerate(self.link_indices) if not set(indices).isdisjoint(self.held))

    @functools.cached_property
    def oblique(self) -> dict[int, int]:
        """Links whose force has another direction than the link, with the first link of their element."""
        pairs = ((k, indices[0]) for indices in self.link_indices for k in indices[1:])
        return {k: first for k, first in pairs if is_oblique(self.links[k])}

    @functools.cached_property
    def gaps(self) -> np.ndarray:
        """Initial gaps (l,) [m]."""
        return np.array([link.gap for link in self.links])

    @functools.cached_property
    def stiffnesses(self) -> np.ndarray:
        """Stiffnesses (l,) [N/m], inf for rigid links."""
        return np.array([link.stiffness for link in self.links])

    @functools.cached_property
    def springs(self) -> np.ndarray:
        """Stiffnesses (l,) [N/m], zero for rigid links, which store no energy."""
        return np.where(np.isinf(self.stiffnesses), 0.0, self.stiffnesses)

    @functools.cached_property
    def dampings(self) -> np.ndarray:
        """Dampings (l,) [N s/m]."""
        return np.array([link.damping for link in self.links])

    @functools.cached_property
    def restoring(self) -> np.ndarray:
        """Forces (2, l) of links along their directions for a unit gap and a unit gap velocity: -springs, -dampings."""
        return -np.stack([self.springs, self.dampings])

    @functools.cached_property
    def labels(self) -> tuple[str, ...]:
        """Names of all links (l,); those of their elements for links that press."""
        named = list(range(len(self.links)))
        for element, indices in enumerate(self.link_indices):
            for link in indices:
                if element in self.laws or not self.links[link].held:
                    named[link] = element
        return tuple(self.links[k].name for k in named)

    def pressing_links(self, element: int) -> list[int]:
        """Indices of the links that press in the closed states of a contact, with and without friction.

        They have the gap of its first link. For a force law: the links that act in other segments than "0".
        """
        first, *further = self.link_indices[element]
        if element in self.laws:
            return further
        return [first, *(k for k in further if not self.links[k].held)]

    def links_named(self, closed: Iterable[str]) -> tuple[int, ...]:
        """Indices of the links that act with these contacts closed, all others open, and laws in segment "0"."""
        of_laws = {i for i, law in self.laws.items() if law.stiffness}
        return tuple(sorted({self._closed(name) for name in closed} | of_laws))

    def _closed(self, name: str) -> int:
        """Index of a contact that is closed, or of friction that sticks."""
        i = self.index(name)
        if i in self.laws:
            raise MultiPhiValueError(f"closed: got the force law {name!r}, need {{{name!r}: segment}}")
        return i

    def states_named(self, state_names: Mapping[str, str]) -> tuple[int, ...]:
        """Numbers of the states of all elements, zero for those without a name."""
        states = [0] * len(self.contacts)
        for name, state in state_names.items():
            i = self.index(name)
            possible = [each.name for each in self.contacts[i].states]
            if state not in possible:
                raise MultiPhiValueError(f"state of {name!r}: got {state!r}, need one of: {', '.join(possible)}")
            states[i] = possible.index(state)
        return tuple(states)

    def active_links(self, states: Sequence[int]) -> tuple[int, ...]:
        """Indices of the links that act with the elements in these states; they determine the modes."""
        active = zip(self._active_links, states, strict=True)
        return tuple(sorted(link for by_state, state in active for link in by_state[state]))

    @functools.cached_property
    def _active_links(self) -> list[list[list[int]]]:
        """Indices of the links that act, for every element and each of its states."""
        pairs = zip(self.contacts, self.link_indices, strict=True)
        return [[[indices[k] for k in state.holds] for state in contact.states] for contact, indices in pairs]

    @functools.cached_property
    def pushes_of_states(self) -> list[list[float]]:
        """Constant forces [N] of every element in each of its states."""
        return [[state.push for state in contact.states] for contact in self.contacts]

    @functools.cached_property
    def general(self) -> bool:
        """Whether some elements have stick positions or pushes besides their links."""
        return bool(self.held) or any(any(pushes) for pushes in self.pushes_of_states)

    @functools.cached_property
    def levels_possible(self) -> int:
        """Number of levels: the product of the states of all elements."""
        return math.prod(len(contact.states) for contact in self.contacts)
