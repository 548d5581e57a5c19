"""Transition between levels: the state at an event, expressed in the next level's modes (eq. 38.6).

The paper's "Phi_m^-1" is the M-projection, the best approximation in the kinetic and in the strain energy norm:

    eta_m = T eta_l + c,   eta'_m = T eta'_l,   T = Phi_m^T M Phi_l,   c = Phi_m^T M (x_inf,l - x_inf,m)

T is r x r and computed once for a pair of levels. A transition from an admissible state can
only take energy out (for one physical M, K); what it took is truncation, kinetic and strain. Where truncation has left
a gap that is not zero, the strain part can be negative; the ledger shows it.

A rigid contact that closes is an impact first (Moreau, restitution 0), in the basis of a level where it is open:

    v+ = v- + A^T p,   p = argmin |v- + A^T p|,  p >= 0,   A = H^T Phi_l

the admissible velocity (A v+ >= 0) nearest to v- in the kinetic metric; the energy it loses is plastic.
Source: J. J. Moreau, Unilateral contact and dry friction in finite freedom dynamics, CISM 302 (1988).
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any

import numpy as np

from multiphi_exudyn.levels.level import Asymptotic, Level
from multiphi_exudyn.mathematics.least_distance import FOLLOWING, least_distance
from multiphi_exudyn.mathematics.round_off import ZERO, drop_round_off

__all__ = ["LoadedLevel", "Transition", "modal_projection", "nearest_admissible"]

UNMIXED = 1e-13  # product of two modes of unit length, below which they have no part in each other


@dataclass(frozen=True)
class LoadedLevel:
    """A level under the static loads of one run: where its motion is centred, and its energies.

    level, asymptotic: as there. gap_constants: gaps (c,) of all contacts at eta = 0.
    """

    level: Level
    asymptotic: Asymptotic
    gap_constants: np.ndarray

    @classmethod
    def of(cls, level: Level, load: np.ndarray) -> LoadedLevel:
        """``level`` under a static load (m,) in base coordinates."""
        rest = level.asymptotic(load)
        magnitudes, initial = level.base.magnitudes
        gaps = level.base.directions.T @ rest.configuration + level.base.gaps
        terms = initial + np.abs(rest.configuration) @ magnitudes
        held = ~np.any(level.gap_rows, axis=1)  # by the closed contacts, of which its gap is the sum
        return cls(level, rest, drop_round_off(gaps, np.where(held, FOLLOWING / ZERO, 1.0) * terms))

    @functools.cached_property
    def entries(self) -> dict[Any, Any]:
        """What is kept of the ways into this level, by what distinguishes them (truncation.py)."""
        return {}

    @functools.cached_property
    def driven(self) -> bool:
        """Whether a load drives zero-frequency modes."""
        return bool(np.any(self.asymptotic.drive))

    def strain(self, displacement: np.ndarray) -> np.ndarray:
        """Strain energy [J] of the structure and of its closed compliant contacts, for (r,) or every column of (r, k).

        1/2 sum omega^2 eta^2 + eta . (Phi^T f - drive) + strain(x_inf); of force laws as in ``Base.strain``
        """
        bent = self.asymptotic.load - self.asymptotic.drive
        stretched = 0.5 * self.level.squares @ displacement**2
        return np.asarray(stretched + bent @ displacement + self.asymptotic.strain)

    def potential(self, displacement: np.ndarray) -> float:
        """Strain energy less the potential f.x of the static load [J]."""
        potential = 0.5 * float(self.level.squares.dot(displacement * displacement)) + self.asymptotic.potential
        return potential - float(self.asymptotic.drive @ displacement) if self.driven else potential

    def kinetic(self, velocity: np.ndarray) -> np.ndarray:
        """Kinetic energy [J] of (r,) or of every column of (r, k)."""
        return np.asarray(0.5 * (velocity * velocity).sum(axis=0))

    def acceleration(self, displacement: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """eta'' (r,) from eta, eta' (38.3)."""
        own = self.level
        return self.asymptotic.drive - own.squares * displacement - own.damping @ velocity

    def gap(self, contact: int, displacement: np.ndarray) -> float:
        """Gap of a contact [m]."""
        return float(self.level.gap_rows[contact] @ displacement + self.gap_constants[contact])

    def configuration(self, displacement: np.ndarray) -> np.ndarray:
        """y = Psi eta + y_inf in base coordinates, (m,) or (m, k)."""
        return np.asarray((self.level.vectors @ displacement).T + self.asymptotic.configuration).T


@dataclass(frozen=True)
class Transition:
    """The map of eq. (38.6) from level ``source`` to level ``target``."""

    source: LoadedLevel
    target: LoadedLevel

    @functools.cached_property
    def matrix(self) -> np.ndarray:
        """T (r_m, r_l)."""
        return modal_projection(self.target.level, self.source.level)

    @property
    def velocity_matrix(self) -> np.ndarray:
        """The same for velocities."""
        return self.matrix

    @functools.cached_property
    def offset(self) -> np.ndarray:
        """c (r_m,)."""
        jump = self.source.asymptotic.configuration - self.target.asymptotic.configuration
        return self.target.level.vectors.T @ jump

    def displacement(self, eta: np.ndarray) -> np.ndarray:
        """eta_m from eta_l."""
        return self.matrix @ eta + self.offset

    def velocity(self, eta_t: np.ndarray) -> np.ndarray:
        """eta'_m from eta'_l."""
        return self.velocity_matrix @ eta_t


def modal_projection(target: Level, source: Level) -> np.ndarray:
    """T = Phi_m^T M Phi_l (r_m, r_l), zero where the product of two modes is one round-off of their length.

    In its place it would give a contact at rest, which no other mode moves, a speed. The modes' own round-off, larger
    where there are many, is not seen here.
    """
    products = target.vectors.T @ source.vectors
    return np.where(np.abs(products) <= UNMIXED, 0.0, products)


def nearest_admissible(
    rows: np.ndarray, vector: np.ndarray, free: int | None = None, sizes: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """(v+, p): the vector nearest to ``vector`` (r,) with rows v+ >= 0, and its multipliers p (k,) >= 0.

    Both of Moreau's laws: velocities at an impact, accelerations of contacts that touch at rest. Only the first
    ``free`` components change, all of them for None; the others are those of stops that move. sizes: (k,) of the terms
    of rows v beside those of v itself, for what is round-off. Post-conditions and errors are those of least_distance.
    """
    free = len(vector) if free is None else free
    terms = np.abs(rows) @ np.abs(vector) + (0.0 if sizes is None else sizes)
    change, multipliers = least_distance(rows[:, :free], -(rows @ vector), terms)
    after = vector.copy()
    after[:free] += change
    return after, multipliers
