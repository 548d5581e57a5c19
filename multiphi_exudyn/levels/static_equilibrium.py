"""Equilibrium under slowly applied forces: contacts, force laws and friction together.

    f(s) = f_0 + s (f - f_0),   q_i(s) = h_i.y + gap_i - w_i + (1 - s) lift_i,   0 <= s <= 1

f_0 holds the undeformed structure, y = 0, at rest against the springs that are closed there; lift raises rigid
contacts whose stop reaches into it; friction sticks where it stands, w = 0. While no element changes its state y and
the forces are straight lines in s, so the path goes from one change to the next, each where the signal of an exit falls
below zero (element.py): an open contact closes where its gap does, a closed one opens where its penetration or reaction
does, friction slips where its limit is reached and sticks again where others turn it back. Where the change of a
contact turns the path back, the structure snaps through there, and the equilibrium beyond is no longer the one that
was followed: that is refused, and so is friction whose force drops from a static limit.

Friction at a contact goes with its pressure N, and changes it: where it slides, with U = f - h (levels/sliding.py),

    N = N_0 + W N,   N_0 without it, W the forces that the loads U leave on the contacts

That has one answer where |W| < 1 for a contact alone, whichever way it slides, and for several together where all
principal minors of 1 - W are positive. Otherwise it wedges, and is refused with its number.

Sources: A. Klarbring, Examples of non-uniqueness and non-existence of solutions to quasistatic contact problems with
friction, Ing. Archiv 60 (1990); R. W. Cottle, J.-S. Pang, R. E. Stone, The Linear Complementarity Problem, 1992, ch.
4.5.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.errors import NumericalFailure
from multiphi_exudyn.levels.modal_base import ModalBase
from multiphi_exudyn.levels.sliding_equilibrium import rest_with_friction
from multiphi_exudyn.mechanics.element import ElementState, Exit

__all__ = ["Equilibrium", "equilibrium"]

SLACK = 1e-11  # of the sizes of a function on the path: nearer to zero it has reached it
CHANGES = 20  # for every link on the path: more is an exchange without end


@dataclass(frozen=True)
class Equilibrium:
    """A structure at rest under slowly applied forces, as a start of a run; made by ``MultiPhiModel.equilibrium``.

    The forces themselves are not part of it: a run that starts from it without them lets go.

    Attributes
    ----------
    displacement : array (n,)
        x [m, rad].
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


@dataclass
class _Standing:
    """What the elements have come to: numbers of their states (c,), places w (l,) of links [m]."""

    states: list[int]
    held: np.ndarray

    def of(self, base: ModalBase, element: int) -> ElementState:
        """The state of an element."""
        return base.contacts[element].states[self.states[element]]

    def closed(self, base: ModalBase) -> list[int]:
        """The links that hold."""
        given = enumerate(base.link_indices)
        return sorted(places[k] for i, places in given for k in self.of(base, i).holds)


@dataclass(frozen=True)
class _Path:
    """Straight lines in s, by their values at s = 0 and s = 1: y (2, m), q + w (2, l) and lambda (2, l) of links."""

    configuration: np.ndarray
    places: np.ndarray
    forces: np.ndarray

    def at(self, s: float, ends: np.ndarray) -> np.ndarray:
        """One of them at s."""
        return np.asarray((1 - s) * ends[0] + s * ends[1])

    def signal(self, links: Sequence[int], exit_: Exit, held: np.ndarray, s: float) -> tuple[np.ndarray, float]:
        """The signal (2,) of an exit of an element with these links, and its size; rates are of ways from s on."""
        value, size = np.full(2, exit_.constant), 0.0
        for share in exit_.shares:
            k = links[share.link]
            way = self.places[:, k]
            value += (
                share.gap * (way - held[k]) + share.rate * (way - self.at(s, way)) + share.force * self.forces[:, k]
            )
            size += abs(share.rate) * float(np.max(np.abs(way))) + abs(share.force) * float(
                np.max(np.abs(self.forces[:, k]))
            )
        return value, max(size, float(np.max(np.abs(value))))


def equilibrium(base: ModalBase, load: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """y (m,) at rest under a load (m,) in base coordinates, of a base without rigid-body modes, and stretches (c,) [m].

    Raises NumericalFailure where the path snaps through.
    """
    rigid = np.isinf(base.stiffnesses)
    count = len(base.contacts)
    standing = _Standing([_first_state(base, i) for i in range(count)], np.zeros(len(base.links)))
    sprung = [k for k in standing.closed(base) if not rigid[k]]
    first = base.directions[:, sprung] @ (base.stiffnesses[sprung] * base.gaps[sprung])
    ends = np.array([first, load + base.preload])
    lifts = np.where(rigid, np.maximum(-base.gaps, 0.0), 0.0)
    s, path = 0.0, _path(base, standing, ends, lifts)
    for _ in range(CHANGES * (1 + len(base.links))):
        change = _next_change(base, standing, path, s)
        if change is None:
            return path.configuration[1], _stretches(base, standing, path)
        s, element, asked = change
        left, before = standing.of(base, element), standing
        for state in _alternatives(base, standing, element, asked):
            standing = _Standing(before.states.copy(), before.held.copy())
            _enter(base, standing, path, s, element, state)
            entered = _path(base, standing, ends, lifts)
            touches = "open" in (left.name, standing.of(base, element).name) or element in base.laws
            if not touches or _lasts(base, standing, entered, s, element, left.name, state == asked):
                break
        else:
            raise NumericalFailure(
                f"static equilibrium: at {s:.3g} of the forces the structure snaps through "
                f"({base.contacts[element].name}), need smaller forces, or a damped run that comes to rest"
            )
        path = entered
    raise NumericalFailure(
        "static equilibrium: none was found, contacts, friction and force laws keep changing their states at one load; "
        "need a damped run that comes to rest"
    )


def _first_state(base: ModalBase, element: int) -> int:
    """The state of an element where nothing has moved yet."""
    given, still = base.contacts[element], [0.0] * len(base.link_indices[element])
    return [state.name for state in given.states].index(given.first_state(base.gaps[element], *still))


def _next_change(base: ModalBase, standing: _Standing, path: _Path, s: float) -> tuple[float, int, int] | None:
    """Where on the path a signal next falls below zero, of which element, and for which state it asks."""
    found: tuple[float, int, int] | None = None
    for i, element in enumerate(base.contacts):
        for exit_ in standing.of(base, i).exits:
            ends, size = path.signal(base.link_indices[i], exit_, standing.held, s)
            fall = ends[0] - ends[1]
            if fall > SLACK * size:
                at = s + max(float(path.at(s, ends)), 0.0) / fall
                if at < (1.0 if found is None else found[0]):
                    found = at, i, [state.name for state in element.states].index(exit_.asked)
    return found


def _enter(base: ModalBase, standing: _Standing, path: _Path, s: float, element: int, asked: int) -> None:
    """An element changes its state at s; where its held link begins to hold, its place gives it its stretch."""
    before, standing.states[element] = standing.of(base, element), asked
    after, link = standing.of(base, element), _held_link(base, element)
    if link is None:
        return
    if _holds(base, element, after, link):
        pulled = 0.0 if before.name == "open" else _sliding_force(base, element, before, path, s)
        stiffness = base.stiffnesses[link]
        standing.held[link] = path.at(s, path.places[:, link]) - (0.0 if np.isinf(stiffness) else pulled / stiffness)
    elif after.name != "open" and _holds(base, element, before, link):
        stuck, slips = -path.at(s, path.forces[:, link]), _sliding_force(base, element, after, path, s)
        if abs(stuck - slips) > SLACK**0.5 * abs(slips) + SLACK * np.max(np.abs(path.forces)):
            raise NumericalFailure(
                f"static equilibrium: at {s:.3g} of the forces {base.contacts[element].name!r} lets go at its static "
                "limit and where it then comes to rest depends on inertia, need smaller forces, or a run"
            )


def _held_link(base: ModalBase, element: int) -> int | None:
    """The link of an element that has a held place."""
    return next((k for k in base.link_indices[element] if base.links[k].held), None)


def _holds(base: ModalBase, element: int, state: ElementState, link: int) -> bool:
    return base.link_indices[element].index(link) in state.holds


def _sliding_force(base: ModalBase, element: int, state: ElementState, path: _Path, s: float) -> float:
    """T [N] of friction that slips, at s."""
    if state.rubs is None:
        return -state.push
    normal = [k for k in base.link_indices[element] if not base.links[k].held]  # one holds, the others have none
    return float(state.rubs[1] * path.at(s, np.sum(path.forces[:, normal], axis=1)))


def _alternatives(base: ModalBase, standing: _Standing, element: int, asked: int) -> list[int]:
    """The states that an element may enter, the one it asks for first: a contact that closes may slide at once."""
    states = base.contacts[element].states
    if standing.of(base, element).name != "open":
        return [asked]
    return [asked, *(k for k, state in enumerate(states) if state.name != "open" and k != asked)]


def _lasts(base: ModalBase, standing: _Standing, path: _Path, s: float, element: int, left: str, asked: bool) -> bool:
    """Whether a contact that has closed or opened at s does not turn the path back; one that slides at once slides on.

    Nor a force law from one segment into the next. left: the state before. asked: whether it has the state that it
    asked for, in which it may stick at first and slide afterwards.
    """
    state = standing.of(base, element)
    for exit_ in state.exits:
        ends, size = path.signal(base.link_indices[element], exit_, standing.held, s)
        falls = ends[0] - ends[1] > SLACK * size
        turns_back = exit_.asked == left or "open" in (state.name, exit_.asked)
        slides_back = not asked and path.at(s, ends) <= SLACK * size
        if falls and (turns_back or slides_back):
            return False
    return True


def _stretches(base: ModalBase, standing: _Standing, path: _Path) -> np.ndarray:
    """Of all links (l,) [m], zero of contacts."""
    found = np.zeros(len(base.links))
    for i in range(len(base.contacts)):
        state, link = standing.of(base, i), _held_link(base, i)
        if link is None or np.isinf(base.stiffnesses[link]) or state.name == "open":
            continue
        if _holds(base, i, state, link):
            found[link] = path.places[1, link] - standing.held[link]
        else:
            found[link] = _sliding_force(base, i, state, path, 1.0) / base.stiffnesses[link]
    return found


def _path(base: ModalBase, standing: _Standing, loads: np.ndarray, lifts: np.ndarray) -> _Path:
    """The path with the elements in these states."""
    states = [standing.of(base, i) for i in range(len(base.contacts))]
    index = standing.closed(base)
    pushes = base.directions[:, : len(states)] @ np.array([state.push for state in states])
    configurations, places, forces = [], [], []
    for load, part in zip(loads, (1.0, 0.0), strict=True):
        initial = base.gaps + part * lifts
        pressing, configuration = rest_with_friction(base, index, initial - standing.held, load + pushes)
        configurations.append(configuration)
        places.append(base.directions.T @ configuration + initial)
        forces.append(pressing)
    return _Path(np.array(configurations), np.array(places), np.array(forces))
