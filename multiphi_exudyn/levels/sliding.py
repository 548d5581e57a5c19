"""Sliding levels: friction that goes with the pressure of closed contacts, on the modes of the level without it.

Where contacts o slide, a force lambda_o acts along f_o = h_o - s mu h_t,o in place of h_o (element.py). With U = f - h
and the level of the same closed contacts without friction (omega^2, modes Psi, forces lambda = L eta + L' eta'),

    eta'' + (D - Psi^T U L'_o) eta' + (omega^2 - Psi^T U L_o) eta = p                   (38.3)

no symmetric matrix, whose motion may grow: flutter. Energies are those of the symmetric level. The reaction of a rigid
contact is changed by the friction that it makes: what the kept modes leave out follows U lambda_o at rest, with the
reactions W lambda_o,

    lambda_o = L_o eta + L'_o eta' + W_o lambda_o

With all modes I - W_o is h.M^-1 f / (h.M^-1 h). Motion exists and is unique where all its principal minors are
positive. Its state of rest is that of the symmetric level under the load and U lambda_o.
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
from multiphi_exudyn.levels.level import Asymptotic, Level
from multiphi_exudyn.levels.level_override import LevelOverride
from multiphi_exudyn.mathematics.round_off import ZERO

__all__ = ["SlidingLevel", "sliding"]

DETERMINATE = 1e-10  # of one: a smaller share of h.M^-1 h, or of a stiffness, that friction leaves is round-off of zero


@dataclass(frozen=True, repr=False)
class SlidingLevel(Level):
    """A level in which contacts slide; see the module's docstring.

    plain: the same without friction. sliders: positions among its closed contacts of those that slide (o,).
    added: U (m, o). answer: reactions (k, o) of the closed contacts at rest to what the kept modes leave of U.
    """

    plain: Level
    sliders: tuple[int, ...]
    added: np.ndarray
    answer: np.ndarray

    @property
    def coupling(self) -> np.ndarray:
        """- Psi^T U L_o (r, r) [rad2/s2]."""
        return -self.pulled @ self.force_rows[list(self.sliders)]

    @property
    def damping_matrix(self) -> np.ndarray:
        """D - Psi^T U L'_o (r, r) [1/s]."""
        return self.damping - self.pulled @ self.force_rate_rows[list(self.sliders)]

    @functools.cached_property
    def pulled(self) -> np.ndarray:
        """Modal forces Psi^T U (r, o) of friction."""
        return np.asarray(self.vectors.T @ self.added)

    def answered(self, forces: np.ndarray) -> np.ndarray:
        """Forces (k, ...) of the closed contacts, from those that they would have without friction."""
        index = list(self.sliders)
        sliding = np.linalg.solve(np.eye(len(index)) - self.answer[index], forces[index])
        return np.asarray(forces + self.answer @ sliding)

    def asymptotic(self, load: np.ndarray) -> Asymptotic:
        """See ``Level``; the friction at rest belongs to the load."""
        forces = self._at_rest(self.plain.asymptotic(load).forces)
        return self.plain.asymptotic(load + self.added @ forces)

    def static_response(self, load: np.ndarray, gaps: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See ``Level``."""
        forces = self._at_rest(self.plain.static_response(load, gaps)[0])
        return self.plain.static_response(load + self.added @ forces, gaps)

    def truncated(self, asked: int) -> Level:
        """See ``Level``."""
        return sliding(self.plain.truncated(asked))

    def overridden(self, override: LevelOverride) -> Level:
        """See ``Level``."""
        return sliding(self.plain.overridden(override))

    def _at_rest(self, forces: np.ndarray) -> np.ndarray:
        """lambda (o,) at rest, from the forces (k,) that there are without friction."""
        left, index = self._left_at_rest, list(self.sliders)
        if not abs(np.linalg.det(left)) > DETERMINATE:
            raise NumericalFailure(
                f"level {', '.join(self.closed)}: friction cancels the stiffness against sliding, so there is no state "
                "of rest"
            )
        return np.linalg.solve(left, forces[index])

    @functools.cached_property
    def _left_at_rest(self) -> np.ndarray:
        """I less the forces (o, o) at rest under each column of U."""
        still = np.zeros(len(self.indices))
        found = [self.plain.static_response(load, still)[0][list(self.sliders)] for load in self.added.T]
        return np.eye(len(found)) - np.array(found).T


def sliding(plain: Level) -> Level:
    """A level with the friction of those of its closed contacts that slide, itself where none does."""
    base, sliders = plain.base, tuple(k for k, i in enumerate(plain.indices) if i in plain.base.oblique)
    if not sliders:
        return plain
    if plain.neutral.size:
        raise NumericalFailure(
            f"level {', '.join(plain.closed)}: negative stiffness cancels that of a mode beside contacts that slide"
        )
    links = [plain.indices[k] for k in sliders]
    added = base.pushes[:, links] - base.directions[:, links]
    answer = _answer(plain, added)
    _check(plain, sliders, answer)
    given = {field.name: getattr(plain, field.name) for field in fields(plain)}
    level = SlidingLevel(**given, plain=plain, sliders=sliders, added=added, answer=answer)
    strained = np.where(plain.squares == 0, 0.0, plain.force_rows)  # what is left of others would couple rigid bodies
    return replace(level, force_rows=level.answered(strained), force_rate_rows=level.answered(plain.force_rate_rows))


def _answer(plain: Level, added: np.ndarray) -> np.ndarray:
    """W (k, o): reactions of rigid contacts at rest to what the kept modes leave of loads (m, o)."""
    psi, still = plain.vectors, np.zeros(len(plain.indices))
    rigid = np.isinf(plain.base.stiffnesses[list(plain.indices)])
    found = np.zeros((len(still), added.shape[1]))
    if not np.any(rigid):
        return found
    for k, load in enumerate(added.T):
        left = load - psi @ (psi.T @ load)
        left[np.abs(left) <= ZERO * np.linalg.norm(load)] = 0.0
        forces, y = plain.static_response(left, still)
        found[rigid, k] = (forces - plain.force_rows @ (psi.T @ y))[rigid]
    return found


def _check(plain: Level, sliders: tuple[int, ...], answer: np.ndarray) -> None:
    """Refuse friction under which the motion is not determined."""
    left = np.eye(len(sliders)) - answer[list(sliders)]
    for count in range(1, len(sliders) + 1):
        for chosen in itertools.combinations(range(len(sliders)), count):
            minor = float(np.linalg.det(left[np.ix_(chosen, chosen)]))
            if not minor > DETERMINATE:
                names = ", ".join(repr(plain.base.label(plain.base.oblique[plain.indices[sliders[k]]])) for k in chosen)
                raise NumericalFailure(
                    f"friction at the rigid contact {names}: sliding has no unique motion, as h.M^-1 (h - s mu h_t) is "
                    f"{minor:.6g} of h.M^-1 h in the kept modes; need a smaller coefficient, for which it is positive, "
                    "or a finite stiffness"
                )
