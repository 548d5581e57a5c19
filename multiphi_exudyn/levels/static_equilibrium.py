"""Equilibrium under slowly applied forces: contacts, force laws and friction together.

    f(s) = f_0 + s (f - f_0),   q_i(s) = h_i.y + gap_i - w_i + (1 - s) lift_i,   0 <= s <= 1

f_0 holds the undeformed structure, y = 0, at rest against the springs that are closed there; lift raises rigid
contacts whose stop reaches into it; friction sticks where it stands, w = 0. While no element changes its state y and
the forces are straight lines in s, so the path goes from one change to the next, each where the signal of an exit falls
below zero (element.py): an open contact closes where its gap does, a closed one opens where its penetration or reaction
does, friction slips where its limit is reached and sticks again where others turn it back. Where the change of a
contact turns the path back, the structure snaps through there, and the equilibrium beyond is no longer the one that
was followed: that is refused, and so is friction whose force drops from a static limit.

Source: R. W. Cottle, J.-S. Pang, R. E. Stone, The Linear Complementarity Problem, 1992, ch. 4.5.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.errors import MultiPhiValueError, NumericalFailure
from multiphi_exudyn.levels.modal_base import ModalBase
from multiphi_exudyn.levels.static_response import static_response
from multiphi_exudyn.mathematics.least_distance import Infeasible, least_distance
from multiphi_exudyn.mechanics.element import ElementState, Exit

__all__ = ["Equilibrium", "equilibrium", "pressing"]

SLACK = 1e-11  # of the sizes of a function on the path: nearer to zero it has reached it
CHANGES = 20  # for every contact on the path: more is an exchange without end


@dataclass(frozen=True)
class Equilibrium:
    """A structure at rest under slowly applied forces, as a start of a run; made by ``MultiPhiModel.equilibrium``.

    The forces themselves are not part of it: a run that starts from it without them lets go.

    Attributes
    ----------
    displacement : array (n,)
        x [m, rad].
    stretches : mapping of str to float
        Of the springs of friction [m], by name; zero without a spring.

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
    """What the elements have come to: numbers of their states (c,), places w (c,) [m]."""

    states: list[int]
    held: np.ndarray

    def of(self, base: ModalBase, element: int) -> ElementState:
        """The state of an element."""
        return base.contacts[element].states[self.states[element]]


@dataclass(frozen=True)
class _Path:
    """Straight lines in s, by their values at s = 0 and s = 1: y (2, m), q + w (2, c) and lambda (2, c)."""

    configuration: np.ndarray
    places: np.ndarray
    forces: np.ndarray

    def at(self, s: float, ends: np.ndarray) -> np.ndarray:
        """One of them at s."""
        return np.asarray((1 - s) * ends[0] + s * ends[1])

    def signal(self, element: int, exit_: Exit, held: float, s: float) -> np.ndarray:
        """The signal (2,) of an exit; a rate is that of a way from s on."""
        way = self.places[:, element]
        gaps = exit_.gap * (way - held) + exit_.rate * (way - self.at(s, way))
        return np.asarray(gaps + exit_.force * self.forces[:, element] + exit_.constant)


def equilibrium(base: ModalBase, load: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """y (m,) at rest under a load (m,) in base coordinates, of a base without rigid-body modes, and stretches (c,) [m].

    Raises NumericalFailure where the path snaps through.
    """
    rigid = np.isinf(base.stiffnesses)
    pressed = np.flatnonzero((base.gaps < 0) & ~rigid)
    standing = _Standing([0] * len(base.contacts), np.zeros(len(base.contacts)))
    for i in pressed.tolist():
        standing.states[i] = 1
    first = base.directions[:, pressed] @ (base.stiffnesses[pressed] * base.gaps[pressed])
    ends = np.array([first, load + base.preload])
    lifts = np.where(rigid, np.maximum(-base.gaps, 0.0), 0.0)
    s, path = 0.0, _path(base, standing, ends, lifts)
    for _ in range(CHANGES * (1 + len(base.contacts))):
        change = _next_change(base, standing, path, s)
        if change is None:
            return path.configuration[1], _stretches(base, standing, path.places[1])
        s, element, asked = change
        _enter(base, standing, path, s, element, asked)
        path = _path(base, standing, ends, lifts)
        if not base.contacts[element].held:
            _check_snap(base, standing, path, s, element)
    raise NumericalFailure("static equilibrium: contacts, friction and force laws exchange their states without end")


def _next_change(base: ModalBase, standing: _Standing, path: _Path, s: float) -> tuple[float, int, int] | None:
    """Where on the path a signal next falls below zero, of which element, and for which state it asks."""
    found: tuple[float, int, int] | None = None
    for i, element in enumerate(base.contacts):
        for exit_ in standing.of(base, i).exits:
            ends = path.signal(i, exit_, standing.held[i], s)
            size = max(np.max(np.abs(ends)), abs(exit_.rate) * np.max(np.abs(path.places[:, i])))
            fall = ends[0] - ends[1]
            if fall > SLACK * size:
                at = s + max(float(path.at(s, ends)), 0.0) / fall
                if at < (1.0 if found is None else found[0]):
                    found = at, i, [state.name for state in element.states].index(exit_.asked)
    return found


def _enter(base: ModalBase, standing: _Standing, path: _Path, s: float, element: int, asked: int) -> None:
    """An element changes its state at s; where its link begins to hold, its place is what gives it its stretch."""
    before, standing.states[element] = standing.of(base, element), asked
    after = standing.of(base, element)
    if not base.contacts[element].held:
        return
    if after.holds:
        standing.held[element] = path.at(s, path.places[:, element]) - before.stretch
    elif before.holds and not np.isclose(path.at(s, path.forces[:, element]), after.push, rtol=SLACK**0.5, atol=0):
        raise NumericalFailure(
            f"static equilibrium: at {s:.3g} of the forces {base.contacts[element].name!r} lets go at its static limit "
            "and where it then comes to rest depends on inertia, need smaller forces, or a run"
        )


def _check_snap(base: ModalBase, standing: _Standing, path: _Path, s: float, element: int) -> None:
    """Refuse a change that turns the path back."""
    for exit_ in standing.of(base, element).exits:
        ends = path.signal(element, exit_, standing.held[element], s)
        if ends[1] < ends[0]:
            raise NumericalFailure(
                f"static equilibrium: at {s:.3g} of the forces the structure snaps through "
                f"({base.contacts[element].name}), need forces that reach an equilibrium slowly"
            )


def _stretches(base: ModalBase, standing: _Standing, places: np.ndarray) -> np.ndarray:
    """Of all links (c,) [m], zero of contacts; places: q + w (c,)."""
    found = np.zeros(len(places))
    for i, element in enumerate(base.contacts):
        state = standing.of(base, i)
        if element.held and not element.rigid:
            found[i] = places[i] - standing.held[i] if state.holds else state.stretch
    return found


def _path(base: ModalBase, standing: _Standing, loads: np.ndarray, lifts: np.ndarray) -> _Path:
    """The path with the elements in these states."""
    states = [standing.of(base, i) for i in range(len(base.contacts))]
    index = [i for i, state in enumerate(states) if state.holds]
    pushes = base.directions @ np.array([state.push for state in states])
    configurations, places, forces = [], [], []
    for load, part in zip(loads, (1.0, 0.0), strict=True):
        initial = base.gaps + part * lifts
        gaps = initial - standing.held
        closed_directions = base.closed_directions(index, gaps[index])
        along, configuration = static_response(base, closed_directions, load + pushes)
        moved = base.directions.T @ configuration
        configurations.append(configuration)
        places.append(moved + initial)
        forces.append(base.contact_forces(closed_directions, along, moved + gaps))
    return _Path(np.array(configurations), np.array(places), np.array(forces))


def pressing(rows: np.ndarray, least: np.ndarray) -> np.ndarray:
    """Which of the constraints rows z >= least press on the shortest z; they are independent of each other.

    Raises MultiPhiValueError where no z meets all of them.
    """
    try:
        _, multipliers = least_distance(rows, least, np.abs(least))
    except Infeasible as found:
        raise MultiPhiValueError(
            "static equilibrium: got rigid contacts that exclude each other, need a way between"
        ) from found
    return np.asarray(multipliers > 0)
