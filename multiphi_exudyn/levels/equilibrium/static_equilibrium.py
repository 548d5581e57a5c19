"""Equilibrium under slowly applied forces: contacts, force laws and friction together.

    f(s) = f_0 + s (f - f_0),   q_i(s) = h_i.y + gap_i - w_i + (1 - s) lift_i,   0 <= s <= 1

f_0 is in equilibrium with the closed springs of the undeformed structure, y = 0; lift opens rigid contacts that have an
initial penetration; friction sticks at w = 0. While no element changes its state, y and the forces are linear in s, so
the path goes from one change to the next, each where the signal of an exit falls below zero (element.py): an open
contact closes at zero gap, a closed one opens at zero penetration or reaction, friction slips at its limit and sticks
again where other changes reverse its motion. Where the change of a contact reverses the path, the structure snaps
through, and the equilibrium beyond is not a continuation of the path: this is refused, and so is friction whose force
drops from a static limit.

Friction at a contact is proportional to its normal force N, and changes it: where it slides, with U = f - h
(levels/level/sliding.py),

    N = N_0 + W N,   N_0 without it, W the forces that the loads U leave on the contacts

This has one solution where |W| < 1 for a single contact, for both directions of sliding, and for several contacts where
all principal minors of 1 - W are positive. Otherwise contacts wedge, which is refused with the value of the minor.

Sources: A. Klarbring, Examples of non-uniqueness and non-existence of solutions to quasistatic contact problems with
friction, Ing. Archiv 60 (1990); R. W. Cottle, J.-S. Pang, R. E. Stone, The Linear Complementarity Problem, 1992, ch.
4.5.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from multiphi_exudyn.errors import NumericalFailure
from multiphi_exudyn.levels.base.modal_base import ModalBase
from multiphi_exudyn.levels.equilibrium.sliding_equilibrium import static_response_with_friction
from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.element import Element, ElementState, Exit, contact_states

__all__ = ["Equilibrium", "equilibrium_along_path"]

SLACK = 1e-11  # of the size of a signal on the path: a smaller value counts as zero
CHANGES = 20  # of states on the path, for every link: more is an endless cycle


@dataclass(frozen=True)
class Equilibrium:
    """A structure at rest under slowly applied forces, as a start of a run; made by ``MultiPhiModel.equilibrium``.

    The forces themselves are not part of it: a run that starts from it without loads starts with their release.

    Attributes
    ----------
    displacement : array (n,)
        x [m, rad]; read-only if a model has made it, which keeps its coordinates for runs.
    stretches : mapping of str to float
        Of the springs of friction [m], by name, at a contact NAME.tangential; zero without a spring.

    Examples
    --------
    >>> import numpy as np
    >>> import multiphi_exudyn as mp
    >>> K = 4e4 * np.array([[2, -1, 0], [-1, 2, -1], [0, -1, 1]])  # N/m
    >>> chain = mp.LinearStructure(np.eye(3), K, mp.ModalDamping(0.01), {"tip": 2})
    >>> ring = mp.Friction("ring", "tip", limit=20.0, stiffness=1e5)
    >>> rest = mp.MultiPhiModel(chain, [ring]).equilibrium({"tip": 100.0})
    >>> print(1e3 * rest.displacement.round(6))  # mm
    [2. 4. 6.]
    >>> round(1e3 * rest.stretches["ring"], 3)  # mm
    0.2
    """

    displacement: np.ndarray
    stretches: Mapping[str, float]
    _known: tuple[ModalBase, np.ndarray] | None = field(default=None, init=False, repr=False, compare=False)

    @classmethod
    def of(cls, base: ModalBase, y: np.ndarray, stretches: Mapping[str, float]) -> Equilibrium:
        """Equilibrium at y (m,) in base coordinates, which it keeps, without their round-off, for runs from it."""
        x = base.modes.shapes @ y
        found, coordinates = cls(x, stretches), base.coordinates(x)
        for array in (x, coordinates):  # neither may change without the other
            array.setflags(write=False)
        object.__setattr__(found, "_known", (base, coordinates))
        return found

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.displacement, self.stretches)  # a copy does without the base

    def coordinates(self, base: ModalBase) -> np.ndarray | None:
        """Displacement in coordinates (m,) of a base where it is known there, else None."""
        return self._known[1] if self._known is not None and self._known[0] is base else None


@dataclass
class _ElementStates:
    """States of the elements on the path: indices of states (c,), held places w (l,) of links [m]."""

    states: list[int]
    held: np.ndarray

    def of(self, base: ModalBase, element: int) -> ElementState:
        """Return the state of an element."""
        return _states_at_rest(base.contacts[element])[self.states[element]]

    def closed(self, base: ModalBase) -> list[int]:
        """Return the active links."""
        links_of_elements = enumerate(base.link_indices)
        return sorted(links[k] for i, links in links_of_elements for k in self.of(base, i).holds)


@dataclass(frozen=True)
class _Path:
    """A linear part of the path, by values at s = 0 and s = 1: y (2, m), q + w (2, l) and lambda (2, l) of links."""

    configuration: np.ndarray
    places: np.ndarray
    forces: np.ndarray

    def at(self, s: float, ends: np.ndarray) -> np.ndarray:
        """Return one of these quantities at s."""
        return np.asarray((1 - s) * ends[0] + s * ends[1])

    def signal(self, links: Sequence[int], exit_: Exit, held: np.ndarray, s: float) -> tuple[np.ndarray, float]:
        """Return the signal (2,) of an exit of an element with these links, and its size; rates count from s on."""
        value, size = np.full(2, exit_.constant), 0.0
        for share in exit_.shares:
            k = links[share.link]
            displacement = self.places[:, k]
            value += (
                share.gap * (displacement - held[k])
                + share.rate * (displacement - self.at(s, displacement))
                + share.force * self.forces[:, k]
            )
            size += abs(share.rate) * float(np.max(np.abs(displacement))) + abs(share.force) * float(
                np.max(np.abs(self.forces[:, k]))
            )
        return value, max(size, float(np.max(np.abs(value))))


def equilibrium_along_path(base: ModalBase, load: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the equilibrium y (m,) under a load (m,) of a base without rigid-body modes, and stretches (c,) [m].

    Raises NumericalFailure where the structure snaps through.
    """
    rigid = np.isinf(base.stiffnesses)
    count = len(base.contacts)
    elements = _ElementStates([_first_state(base, i) for i in range(count)], np.zeros(len(base.links)))
    springs = [k for k in elements.closed(base) if not rigid[k]]
    first = base.directions[:, springs] @ (base.stiffnesses[springs] * base.gaps[springs])
    ends = np.array([first, load + base.preload])
    lifts = np.where(rigid, np.maximum(-base.gaps, 0.0), 0.0)
    s, path = 0.0, _path(base, elements, ends, lifts)
    for _ in range(CHANGES * (1 + len(base.links))):
        change = _next_change(base, elements, path, s)
        if change is None:
            return path.configuration[1], _stretches(base, elements, path)
        s, element, new_state = change
        left_state, before = elements.of(base, element), elements
        for state in _alternatives(base, elements, element, new_state):
            elements = _ElementStates(before.states.copy(), before.held.copy())
            _enter(base, elements, path, s, element, state)
            new_path = _path(base, elements, ends, lifts)
            is_checked = "open" in (left_state.name, elements.of(base, element).name) or element in base.laws
            if not is_checked or _continues(base, elements, new_path, s, element, left_state.name, state == new_state):
                break
        else:
            raise NumericalFailure(
                f"static equilibrium: at {s:.3g} of the forces the structure snaps through "
                f"({base.contacts[element].name}), need smaller forces, or a damped run that comes to rest"
            )
        path = new_path
    raise NumericalFailure(
        "static equilibrium: none was found, contacts, friction and force laws keep changing their states at one load; "
        "need a damped run that comes to rest"
    )


def _states_at_rest(element: Element) -> tuple[ElementState, ...]:
    """Return the states of an element where nothing moves: there a bounded damper has no force, and no bounds."""
    is_bounded = isinstance(element, UnilateralContact) and element.bounded
    return contact_states(rigid=False, viscous=False) if is_bounded else element.states


def _first_state(base: ModalBase, element: int) -> int:
    """Return the index of an element's state in the undeformed structure."""
    contact, rates = base.contacts[element], [0.0] * len(base.link_indices[element])
    return [state.name for state in contact.states].index(contact.first_state(base.gaps[element], *rates))


def _next_change(base: ModalBase, elements: _ElementStates, path: _Path, s: float) -> tuple[float, int, int] | None:
    """Return the next s at which a signal falls below zero, its element, and the index of the state it leads to."""
    change: tuple[float, int, int] | None = None
    for i, element in enumerate(base.contacts):
        for exit_ in elements.of(base, i).exits:
            ends, size = path.signal(base.link_indices[i], exit_, elements.held, s)
            decrease = ends[0] - ends[1]
            if decrease > SLACK * size:
                at = s + max(float(path.at(s, ends)), 0.0) / decrease
                if at < (1.0 if change is None else change[0]):
                    change = at, i, [state.name for state in _states_at_rest(element)].index(exit_.asked)
    return change


def _enter(base: ModalBase, elements: _ElementStates, path: _Path, s: float, element: int, new_state: int) -> None:
    """Change the state of an element at s; where its held link becomes active, its held place sets its stretch."""
    before, elements.states[element] = elements.of(base, element), new_state
    after, link = elements.of(base, element), _held_link(base, element)
    if link is None:
        return
    if _holds(base, element, after, link):
        force = 0.0 if before.name == "open" else _sliding_force(base, element, before, path, s)
        stiffness = base.stiffnesses[link]
        elements.held[link] = path.at(s, path.places[:, link]) - (0.0 if np.isinf(stiffness) else force / stiffness)
    elif after.name != "open" and _holds(base, element, before, link):
        sticking_force, slipping_force = (
            -path.at(s, path.forces[:, link]),
            _sliding_force(base, element, after, path, s),
        )
        if abs(sticking_force - slipping_force) > SLACK**0.5 * abs(slipping_force) + SLACK * np.max(
            np.abs(path.forces)
        ):
            raise NumericalFailure(
                f"static equilibrium: at {s:.3g} of the forces {base.contacts[element].name!r} slips at its static "
                "limit and where it then comes to rest depends on inertia, need smaller forces, or a run"
            )


def _held_link(base: ModalBase, element: int) -> int | None:
    """Return the link of an element that has a held place, None without one."""
    return next((k for k in base.link_indices[element] if base.links[k].held), None)


def _holds(base: ModalBase, element: int, state: ElementState, link: int) -> bool:
    return base.link_indices[element].index(link) in state.holds


def _sliding_force(base: ModalBase, element: int, state: ElementState, path: _Path, s: float) -> float:
    """Return the friction force T [N] of a slipping element at s."""
    if state.rubs is None:
        return -state.push
    # one of these links is active, the forces of the others are zero
    normal = [k for k in base.link_indices[element] if not base.links[k].held]
    return float(state.rubs[1] * path.at(s, np.sum(path.forces[:, normal], axis=1)))


def _alternatives(base: ModalBase, elements: _ElementStates, element: int, new_state: int) -> list[int]:
    """Return the states that an element may enter, that of its exit first: a contact that closes may slide at once."""
    states = _states_at_rest(base.contacts[element])
    if elements.of(base, element).name != "open":
        return [new_state]
    return [new_state, *(k for k, state in enumerate(states) if state.name != "open" and k != new_state)]


def _continues(
    base: ModalBase, elements: _ElementStates, path: _Path, s: float, element: int, left_state: str, is_requested: bool
) -> bool:
    """Return whether the path goes on after a contact has closed or opened at s, or a law has changed its segment.

    It does not if an exit of the new state leads back at once. left_state: before the change. is_requested: whether the
    new state is that of the exit, in which it may stick first and slide afterwards.
    """
    state = elements.of(base, element)
    for exit_ in state.exits:
        ends, size = path.signal(base.link_indices[element], exit_, elements.held, s)
        falls = ends[0] - ends[1] > SLACK * size
        turns_back = exit_.asked == left_state or "open" in (state.name, exit_.asked)
        slides_back = not is_requested and path.at(s, ends) <= SLACK * size
        if falls and (turns_back or slides_back):
            return False
    return True


def _stretches(base: ModalBase, elements: _ElementStates, path: _Path) -> np.ndarray:
    """Return the stretches of the springs of all links (l,) [m], zero for contacts."""
    stretches = np.zeros(len(base.links))
    for i in range(len(base.contacts)):
        state, link = elements.of(base, i), _held_link(base, i)
        if link is None or np.isinf(base.stiffnesses[link]) or state.name == "open":
            continue
        if _holds(base, i, state, link):
            stretches[link] = path.places[1, link] - elements.held[link]
        else:
            stretches[link] = _sliding_force(base, i, state, path, 1.0) / base.stiffnesses[link]
    return stretches


def _path(base: ModalBase, elements: _ElementStates, loads: np.ndarray, lifts: np.ndarray) -> _Path:
    """Return the linear path with the elements in these states."""
    states = [elements.of(base, i) for i in range(len(base.contacts))]
    index = elements.closed(base)
    pushes = base.directions[:, : len(states)] @ np.array([state.push for state in states])
    configurations, places, forces = [], [], []
    for load, lift_factor in zip(loads, (1.0, 0.0), strict=True):
        initial = base.gaps + lift_factor * lifts
        contact_forces, configuration = static_response_with_friction(
            base, index, initial - elements.held, load + pushes
        )
        configurations.append(configuration)
        places.append(base.directions.T @ configuration + initial)
        forces.append(contact_forces)
    return _Path(np.array(configurations), np.array(places), np.array(forces))
