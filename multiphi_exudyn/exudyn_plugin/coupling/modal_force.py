"""Modal force that is constant for the length of a step.

A constant force p on the coordinates eta of a level only shifts the centre of their motion,

    eta'' + D eta' + S (eta - d) = drive + p_0,   d = S^-1 p,   p_0 = (1 - S S^-1) p

S is diag(omega^2) and the coupling by friction (sliding.py), S^-1 its inverse on the modes of nonzero frequency, p_0
the force on the others. A force on coordinate k acts on mode k of the present level. If p comes from forces f on
points, closed rigid contacts have the reactions L f in addition, which the modes of the level do not contain. Masses
attached to the points take part in impacts (attached_inertia.py). The core has the levels under such forces
(core/held_forces.hpp).
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from multiphi_exudyn.levels.level.level import Level

__all__ = ["Inertia", "LevelForces", "static_shift"]


def static_shift(level: Level, force: np.ndarray) -> np.ndarray:
    """Static shift d (r,) under a modal force (s,), s >= r."""
    elastic, shift = np.flatnonzero(level.squares), np.zeros(level.modes)
    stiffness = np.diag(level.squares[elastic]) + level.coupling[np.ix_(elastic, elastic)]
    shift[elastic] = np.linalg.solve(stiffness, force[elastic])
    return shift


class LevelForces(NamedTuple):
    """Forces in a level: a modal force (s,), and the direct reactions L f (k,) [N] of its links to forces on points."""

    force: np.ndarray
    reactions: np.ndarray


class Inertia(Protocol):
    """Inertia of masses and constraints that are attached to a structure."""

    independence: float  # of directions of length one: those whose remaining part is smaller count as redundant

    def mobility(self, states: tuple[int, ...]) -> np.ndarray:
        """F (r, r) of a level's B = F F^T."""

    def velocity_map(self, source: tuple[int, ...], target: tuple[int, ...], matrix: np.ndarray) -> np.ndarray:
        """Matrix of eta'_m from eta'_l; ``matrix`` is that without attached inertia."""

    def directions(self, units: np.ndarray) -> np.ndarray:
        """Directions (c, b) of contacts, reduced by the attached inertia."""

    @property
    def immovable(self) -> set[int]:
        """Indices of contacts that the attached inertia leaves no mobility."""
