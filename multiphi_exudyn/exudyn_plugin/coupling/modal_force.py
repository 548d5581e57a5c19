"""Event rule under a modal force that is constant for the length of a step.

A force p on the coordinates eta of a level only moves the centre of their motion,

    eta'' + D eta' + diag(omega^2) (eta - d) = drive + p_0,   d = omega^-2 p,   p_0 the part on zero-frequency modes

so a level under p is the same level with another asymptotic configuration, and the event rule holds unchanged.
Coordinates of such a level are eta - d. A force on coordinate k acts on mode k of whichever level holds. Where p comes
from forces f on points, a closed rigid contact also takes what no mode of its level sees of them: L f.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from multiphi_exudyn.events.rule import EventRule
from multiphi_exudyn.events.transition import LoadedLevel
from multiphi_exudyn.levels.level import Level

__all__ = ["ForcedRule", "InLevel", "centre_of", "shift"]

InLevel = Callable[[tuple[int, ...]], np.ndarray]  # an array by the closed contacts of a level


def shift(level: Level, force: np.ndarray) -> np.ndarray:
    """d (r,) of a modal force (s,), s >= r."""
    centre = np.zeros(level.modes)
    return np.divide(force[: level.modes], level.squares, out=centre, where=level.squares != 0)


class ForcedRule(EventRule):
    """The rule ``plain`` under forces (p, f) (s + m,): ``force_in`` gives them by a level's closed contacts.

    direct_in: L (k, m) in the same way.
    """

    def __init__(
        self,
        plain: EventRule,
        force_in: InLevel,
        direct_in: InLevel,
    ) -> None:
        super().__init__(plain.model, plain.load)
        self._plain = plain
        self._force_in = force_in
        self._direct_in = direct_in

    def _loaded(self, closed: tuple[int, ...]) -> LoadedLevel:
        return _forced(self._plain.level(closed), self._force_in(closed), self._direct_in(closed))


@dataclass(frozen=True)
class _ForcedLevel(LoadedLevel):
    """``plain`` under a modal force; centre: d (r,). Its energies are those of ``plain``, without the force's."""

    plain: LoadedLevel
    centre: np.ndarray

    def potential(self, displacement: np.ndarray) -> float:
        """Strain energy less the potential f.x of the static load [J]."""
        return self.plain.potential(displacement + self.centre)


def centre_of(rule: EventRule, closed: tuple[int, ...]) -> np.ndarray | float:
    """d (r,) in a level of a rule, zero where no modal force acts."""
    level = rule.level(closed)
    return level.centre if isinstance(level, _ForcedLevel) else 0.0


def _forced(plain: LoadedLevel, force: np.ndarray, direct: np.ndarray) -> LoadedLevel:
    level, rest, d = plain.level, plain.asymptotic, shift(plain.level, force)
    asymptotic = replace(
        rest,
        configuration=rest.configuration + level.vectors @ d,
        forces=rest.forces + level.force_rows @ d + direct @ force[len(force) - direct.shape[1] :],
        drive=rest.drive + np.where(level.squares != 0, 0.0, force[: level.modes]),
    )
    return _ForcedLevel(level, asymptotic, plain.gap_constants + level.gap_rows @ d, plain, d)
