"""Event rule under a modal force that is constant for the length of a step.

A force p on the coordinates eta of a level only moves the centre of their motion,

    eta'' + D eta' + diag(omega^2) (eta - d) = drive + p_0,   d = omega^-2 p,   p_0 the part on zero-frequency modes

so a level under p is the same level with another asymptotic configuration, and the event rule holds unchanged.
Coordinates of such a level are eta - d. A force on coordinate k acts on mode k of whichever level holds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np

from multiphi_exudyn.event_rule import EventRule
from multiphi_exudyn.level import Level
from multiphi_exudyn.transition import LoadedLevel

__all__ = ["ForcedRule", "shift"]


def shift(level: Level, force: np.ndarray) -> np.ndarray:
    """d (r,) of a modal force (s,), s >= r."""
    elastic = level.omega > 0
    return np.where(elastic, force[: level.modes] / np.where(elastic, level.omega, 1.0) ** 2, 0.0)


class ForcedRule(EventRule):
    """The rule ``plain`` under modal forces (s,): ``force_in`` gives them by a level's closed contacts."""

    def __init__(self, plain: EventRule, force_in: Callable[[tuple[int, ...]], np.ndarray]) -> None:
        super().__init__(plain.model, plain.load)
        self._plain = plain
        self._force_in = force_in
        self._forced: dict[tuple[int, ...], LoadedLevel] = {}

    def level(self, closed: Iterable[int]) -> LoadedLevel:
        """The level with these contacts closed, under the static load and its modal force."""
        key = tuple(sorted(closed))
        if key not in self._forced:
            self._forced[key] = _forced(self._plain.level(key), self._force_in(key))
        return self._forced[key]


def _forced(loaded: LoadedLevel, force: np.ndarray) -> LoadedLevel:
    level, rest = loaded.level, loaded.asymptotic
    d, p = shift(level, force), force[: level.modes]
    stored = 0.5 * float(np.sum((level.omega * d) ** 2))
    asymptotic = replace(
        rest,
        configuration=rest.configuration + level.vectors @ d,
        forces=rest.forces + level.force_rows @ d,
        drive=rest.drive + np.where(level.omega > 0, 0.0, p),
        load=rest.load + p,
        strain=rest.strain + stored + float((rest.load - rest.drive) @ d),
        potential=rest.potential - stored,
    )
    return LoadedLevel(level, asymptotic, loaded.gap_constants + level.gap_rows @ d)
