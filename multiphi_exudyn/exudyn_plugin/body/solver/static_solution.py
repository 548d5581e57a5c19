"""Static solutions with Multi-Phi bodies: each ends in the level whose contacts and reactions agree with it.

Exudyn solves with the matrices of one level. There every signal of an exit has to be at least zero: gaps of open
contacts, forces of closed ones, the distance of a force law to the ends of its segment, and the reserve of friction
that sticks. Where some are negative, the element of the most negative one, relative to its terms, takes the exit and
Exudyn solves again. If this does not end, the first of them does, in a fixed order, which ends where contacts have one
equilibrium.

Where friction slips on the way, and where a contact that closes then sticks, depends on the path of the loads, which a
static solution does not follow. So elements with friction have to keep their states.

Source: K. G. Murty, Note on a Bard-type scheme for solving the complementarity problem, Opsearch 11 (1974).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple, Protocol

import numpy as np

from multiphi_exudyn.errors import MultiPhiValueError, NumericalFailure
from multiphi_exudyn.events.excitation.loaded_level import LoadedLevel
from multiphi_exudyn.events.transitions.exits import asked_state, exits_of, force_shares, signal_rows, state_of

__all__ = ["SolvedBody", "StaticChange", "solve_static", "static_changes"]

RESIDUAL = 1e-7  # of its terms: a signal that is less negative is the residual of the solver's iterations

GREEDY = 5  # solutions for every element after which the element of the most negative signal takes its exit
MOST = 20  # solutions for every element: more is an endless cycle


class StaticChange(NamedTuple):
    """Change of an element to a state that its signal asks for; signal: relative to its terms, from -1 to 0."""

    signal: float
    element: int
    state: int


class SolvedBody(Protocol):
    """Attributes of a body that its static solution needs."""

    name: str

    @property
    def elements(self) -> int:
        """Number of contacts, force laws and friction elements."""

    def begin_static(self) -> None:
        """Begin with the level of the data node."""

    def static_changes(self) -> list[StaticChange]:
        """Changes of elements whose states do not agree with the present static solution."""

    def change_static_level(self, change: StaticChange) -> None:
        """Take the state of an element in the next static solution."""


def solve_static(solve: Callable[[], bool], bodies: Iterable[SolvedBody]) -> bool:
    """Solve until the levels of all bodies agree with the static solution; return whether the solver succeeded.

    Raises NumericalFailure where no level agrees, and by the bodies where friction would change its state.
    """
    solved = tuple(bodies)
    for body in solved:
        body.begin_static()
    count = sum(body.elements for body in solved)
    for solution in range(1 + MOST * count):
        if not solve():
            return False
        changes = [(body, change) for body in solved for change in body.static_changes()]
        if not changes:
            return True
        greedy = solution < GREEDY * count
        body, change = min(changes, key=lambda each: each[1].signal) if greedy else changes[0]
        body.change_static_level(change)
    raise NumericalFailure(
        f"static solution of {body.name!r}: no level was found whose contacts agree with it; need more modes, "
        "or start=model.equilibrium({point: force}) of the model in place of SolveStatic"
    )


def static_changes(body: str, level: LoadedLevel, xi: np.ndarray, reactions: np.ndarray) -> list[StaticChange]:
    """Changes of elements whose exits have negative signals at rest, in the order of the elements.

    xi: coordinates of the level. reactions: L f (k,) [N] of its links to forces on points, which xi does not contain.
    Raises MultiPhiValueError where friction would change its state, or slips at rest.
    """
    base, changes = level.level.base, []
    for (element, exit_), row in zip(exits_of(level), signal_rows(level), strict=True):
        shares = [share * reactions[link] for link, share in force_shares(level, element, exit_)]
        terms = np.array([*(row.position * xi), row.constant, *shares])
        signal, size = float(np.sum(terms)), float(np.sum(np.abs(terms)))
        comes_to_rest = exit_.asked == "stick" and state_of(level, element).event == "slip"
        if signal >= -RESIDUAL * size and not (comes_to_rest and signal <= 0):
            continue
        if any(base.links[link].held for link in base.link_indices[element]):
            name = base.contacts[element].name
            raise MultiPhiValueError(
                f"static solution of {body!r}: got forces that change the state of {name!r}, whose friction depends on "
                "their path; need start=model.equilibrium({point: force}), or a damped run that comes to rest"
            )
        changes.append(StaticChange(signal / size, element, asked_state(level, element, exit_)))
    return changes
