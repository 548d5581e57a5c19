"""Equilibrium under slowly applied forces, contacts and force laws together.

    f(s) = f_0 + s (f - f_0),   g_i(s) = h_i.y + gap_i + (1 - s) lift_i,   0 <= s <= 1

f_0 holds the undeformed structure, y = 0, at rest against the springs that are closed there; lift raises rigid
contacts whose stop reaches into it. Within a level y and the forces are straight lines in s, so the path goes from
one change of a contact to the next: an open contact closes where its gap falls to zero, a closed one opens where its
penetration or reaction does. Where a change turns the path back, the structure snaps through there, and the
equilibrium beyond is no longer the one that was followed: that is refused.
Source: R. W. Cottle, J.-S. Pang, R. E. Stone, The Linear Complementarity Problem, 1992, ch. 4.5.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.errors import MultiPhiValueError, NumericalFailure
from multiphi_exudyn.levels.modal_base import ModalBase
from multiphi_exudyn.levels.static_response import static_response
from multiphi_exudyn.mathematics.least_distance import Infeasible, least_distance

__all__ = ["equilibrium", "pressing"]

SLACK = 1e-11  # of the sizes of a function on the path: nearer to zero it has reached it
CHANGES = 20  # for every contact on the path: more is an exchange without end


@dataclass(frozen=True)
class _Path:
    """Straight lines in s: y (2, m) and what every contact's state asks to be >= 0 (2, c), at s = 0 and s = 1."""

    configuration: np.ndarray
    functions: np.ndarray

    def at(self, s: float) -> np.ndarray:
        """The functions at s (c,)."""
        return np.asarray((1 - s) * self.functions[0] + s * self.functions[1])


def equilibrium(base: ModalBase, load: np.ndarray) -> np.ndarray:
    """Configuration y (m,) at rest under a load (m,) in base coordinates; of a base without rigid-body modes.

    Raises NumericalFailure where the path snaps through.
    """
    rigid = np.isinf(base.stiffnesses)
    closed = set(np.flatnonzero((base.gaps < 0) & ~rigid).tolist())
    pressed = sorted(closed)
    first = base.directions[:, pressed] @ (base.stiffnesses[pressed] * base.gaps[pressed])
    ends = np.array([first, load + base.preload])
    lifts = np.where(rigid, np.maximum(-base.gaps, 0.0), 0.0)
    s, path = 0.0, _path(base, closed, ends, lifts)
    for _ in range(CHANGES * (1 + len(base.contacts))):
        change = _next_change(path, s)
        if change is None:
            return np.asarray(path.configuration[1])
        s, contact = change
        closed ^= {contact}
        path = _path(base, closed, ends, lifts)
        if path.functions[1, contact] < path.functions[0, contact]:
            raise NumericalFailure(
                f"static equilibrium: at {s:.3g} of the forces the structure snaps through "
                f"({base.contacts[contact].name}), need forces that reach an equilibrium slowly"
            )
    raise NumericalFailure("static equilibrium: contacts and force laws exchange their states without end")


def _next_change(path: _Path, s: float) -> tuple[float, int] | None:
    """Where on the path, and at which contact, a function next falls below zero."""
    values, falls = path.at(s), path.functions[0] - path.functions[1]
    sizes = SLACK * np.max(np.abs(path.functions), axis=0)
    falling = falls > sizes
    ahead = np.where(falling, np.maximum(values, 0.0) / np.where(falling, falls, 1.0), np.inf)
    contact = int(np.argmin(ahead))
    if not s + ahead[contact] < 1:
        return None
    return s + float(ahead[contact]), contact


def _path(base: ModalBase, closed: set[int], loads: np.ndarray, lifts: np.ndarray) -> _Path:
    """The path in the level with these contacts closed."""
    index = sorted(closed)
    configurations, functions = [], []
    for load, part in zip(loads, (1.0, 0.0), strict=True):
        gaps = base.gaps + part * lifts
        closed_directions = base.closed_directions(index, gaps[index])
        forces, configuration = static_response(base, closed_directions, load)
        states = base.directions.T @ configuration + gaps
        pushed = base.contact_forces(closed_directions, forces, states)
        for i in index:
            states[i] = pushed[i] if np.isinf(base.stiffnesses[i]) else -states[i]
        configurations.append(configuration)
        functions.append(states)
    return _Path(np.array(configurations), np.array(functions))


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
