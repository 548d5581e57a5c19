"""Sliding levels: friction proportional to the normal forces of closed contacts, in the modes without friction.

Where contacts o slide, a force lambda_o acts along f_o = h_o - s mu h_t,o in place of h_o (element.py). With U = f - h
and the level of the same closed contacts without friction (omega^2, modes Psi, forces lambda = L eta + L' eta'),

    eta'' + (D - Psi^T U L'_o) eta' + (omega^2 - Psi^T U L_o) eta = p                   (38.3)

The matrices are not symmetric, and the motion may grow: flutter. Energies are those of the symmetric level. Friction
changes the reaction of a rigid contact: the truncated modes respond statically to U lambda_o, with the reactions
W lambda_o,

    lambda_o = L_o eta + L'_o eta' + W_o lambda_o

With all modes I - W_o is h.M^-1 f / (h.M^-1 h). Motion exists and is unique where all its principal minors are
positive. The static response is that of the symmetric level under the load and U lambda_o.
Source: A. Klarbring, Examples of non-uniqueness and non-existence of solutions to quasistatic contact problems with
friction, Ing. Archiv 60 (1990); on Painleve's rod F. Genot, B. Brogliato, New results on Painleve paradoxes, Eur. J.
Mech. A/Solids 18 (1999).
"""

from __future__ import annotations

import functools
import itertools
from dataclasses import dataclass, fields, replace

import numpy as np

from multiphi_exudyn.errors import NumericalFailure
from multiphi_exudyn.levels.level.build_level import drop_damping_of_free_modes
from multiphi_exudyn.levels.level.level import Asymptotic, Level
from multiphi_exudyn.levels.level.level_override import LevelOverride
from multiphi_exudyn.mathematics.round_off import ZERO

__all__ = ["SlidingLevel", "with_sliding"]

DETERMINATE = 1e-10  # relative: a smaller remainder of h.M^-1 h, or of a stiffness, beside friction is round-off


@dataclass(frozen=True, repr=False)
class SlidingLevel(Level):
    """A level in which contacts slide; see the module's docstring.

    plain: the level without friction. sliders: positions of sliding contacts among its closed contacts (o,).
    added: U (m, o). reactions: W (k, o), static reactions of the closed contacts to the part of U of truncated modes.
    """

    plain: Level
    sliders: tuple[int, ...]
    added: np.ndarray
    reactions: np.ndarray

    @property
    def coupling(self) -> np.ndarray:
        """- Psi^T U L_o (r, r) [rad2/s2]."""
        return -self.pulled @ self.force_rows[list(self.sliders)]

    @property
    def damping_matrix(self) -> np.ndarray:
        """D - Psi^T U L'_o (r, r) [1/s]; of zero-frequency modes without what is round-off of the damping."""
        added, free = -self.pulled @ self.force_rate_rows[list(self.sliders)], self.squares == 0
        if np.any(free):
            drop_damping_of_free_modes(self.base, list(self.indices), free, added)
        return self.damping + added

    @functools.cached_property
    def pulled(self) -> np.ndarray:
        """Modal forces Psi^T U (r, o) of friction."""
        return np.asarray(self.vectors.T @ self.added)

    def answered(self, forces: np.ndarray) -> np.ndarray:
        """Return the forces (k, ...) of closed contacts with friction, from those without."""
        index = list(self.sliders)
        sliding = np.linalg.solve(np.eye(len(index)) - self.reactions[index], forces[index])
        return np.asarray(forces + self.reactions @ sliding)

    def asymptotic(self, load: np.ndarray) -> Asymptotic:
        """See ``Level``; the load includes the friction of the static response."""
        forces = self._sliding_forces(self.plain.asymptotic(load).forces)
        return self.plain.asymptotic(load + self.added @ forces)

    def static_response(self, load: np.ndarray, gaps: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See ``Level``."""
        forces = self._sliding_forces(self.plain.static_response(load, gaps)[0])
        return self.plain.static_response(load + self.added @ forces, gaps)

    def driving_force(self, load: np.ndarray, gaps: np.ndarray) -> np.ndarray:
        """See ``Level``."""
        forces = self._sliding_forces(self.plain.static_response(load, gaps)[0])
        return self.plain.driving_force(load + self.added @ forces, gaps)

    def truncated(self, count: int) -> Level:
        """See ``Level``."""
        return with_sliding(self.plain.truncated(count))

    def overridden(self, override: LevelOverride) -> Level:
        """See ``Level``."""
        return with_sliding(self.plain.overridden(override))

    def _sliding_forces(self, forces: np.ndarray) -> np.ndarray:
        """Return lambda (o,) of the static response, from the forces (k,) without friction."""
        remaining, index = self._remaining_forces, list(self.sliders)
        if not abs(np.linalg.det(remaining)) > DETERMINATE:
            raise NumericalFailure(
                f"level {', '.join(self.closed)}: friction cancels the stiffness against sliding, so there is no "
                "equilibrium"
            )
        return np.linalg.solve(remaining, forces[index])

    @functools.cached_property
    def _remaining_forces(self) -> np.ndarray:
        """I minus the static forces (o, o) of sliding contacts under each column of U."""
        gaps = np.zeros(len(self.indices))
        forces = [self.plain.static_response(load, gaps)[0][list(self.sliders)] for load in self.added.T]
        return np.eye(len(forces)) - np.array(forces).T


def with_sliding(plain: Level) -> Level:
    """Return a level with the friction of its sliding contacts, the level itself where none slides."""
    base, sliders = plain.base, tuple(k for k, i in enumerate(plain.indices) if i in plain.base.oblique)
    if not sliders:
        return plain
    if plain.neutral.size:
        raise _cancelled(plain)
    links = [plain.indices[k] for k in sliders]
    added = base.pushes[:, links] - base.directions[:, links]
    reactions = _static_reactions(plain, added)
    _check_unique_motion(plain, sliders, reactions)
    level_fields = {field.name: getattr(plain, field.name) for field in fields(plain)}
    level = SlidingLevel(**level_fields, plain=plain, sliders=sliders, added=added, reactions=reactions)
    rigid = np.isinf(base.stiffnesses[list(plain.indices)])
    is_round_off = rigid[:, None] & (plain.squares == 0)  # of reactions: it would couple rigid-body modes
    elastic_rows = np.where(is_round_off, 0.0, plain.force_rows)
    level = replace(
        level, force_rows=level.answered(elastic_rows), force_rate_rows=level.answered(plain.force_rate_rows)
    )
    if np.any(level.coupling[:, plain.squares == 0]):
        raise _cancelled(plain)
    return level


def _cancelled(plain: Level) -> NumericalFailure:
    return NumericalFailure(
        f"level {', '.join(plain.closed)}: negative stiffness cancels that of a mode beside contacts that slide"
    )


def _static_reactions(plain: Level, added: np.ndarray) -> np.ndarray:
    """Return W (k, o), static reactions of rigid contacts to the part of loads (m, o) that truncated modes have."""
    psi, gaps = plain.vectors, np.zeros(len(plain.indices))
    rigid = np.isinf(plain.base.stiffnesses[list(plain.indices)])
    reactions = np.zeros((len(gaps), added.shape[1]))
    if not np.any(rigid):
        return reactions
    for k, load in enumerate(added.T):
        truncated = load - psi @ (psi.T @ load)
        truncated[np.abs(truncated) <= ZERO * np.linalg.norm(load)] = 0.0
        forces, y = plain.static_response(truncated, gaps)
        reactions[rigid, k] = (forces - plain.force_rows @ (psi.T @ y))[rigid]
    return reactions


def _check_unique_motion(plain: Level, sliders: tuple[int, ...], reactions: np.ndarray) -> None:
    """Raise NumericalFailure for friction under which the motion is not unique."""
    remaining = np.eye(len(sliders)) - reactions[list(sliders)]
    for count in range(1, len(sliders) + 1):
        for subset in itertools.combinations(range(len(sliders)), count):
            minor = float(np.linalg.det(remaining[np.ix_(subset, subset)]))
            if not minor > DETERMINATE:
                links = (plain.base.oblique[plain.indices[sliders[k]]] for k in subset)
                names = ", ".join(repr(plain.base.labels[link]) for link in links)
                raise NumericalFailure(
                    f"friction at the rigid contact {names}: sliding has no unique motion, as h.M^-1 (h - s mu h_t) is "
                    f"{minor:.6g} of h.M^-1 h in the kept modes; need a smaller coefficient, for which it is positive, "
                    "or a finite stiffness"
                )
