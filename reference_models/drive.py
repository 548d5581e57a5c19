"""Sets what acts on a full beam before every step, at the time of the step's end, where an implicit step needs it.

Exudyn calls a PreStep function again with the new end where it halves a step. One call costs 3 to 5 us, whatever
acts; a load user function, called in every residual, costs about as much for a single coordinate. All forces together
are the forceVector of one ObjectGenericODE2 on the beam's nodes, the way of a stop is its contact's offset.

Values of a course are taken at step ends, so that a jump inside a step is seen up to one step late.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from reference_models.actions import Actions
from reference_models.beam_system import BeamSystem

__all__ = ["Drive"]

ON_GRID = 1e-3  # of a step: nearer to a whole number of steps, by a sum of many, a time is that of a whole step


class Drive:
    """A PreStep user function: forces and stops of ``actions`` on ``system``, whose coordinates are S x."""

    def __init__(self, system: BeamSystem, actions: Actions, coordinates: np.ndarray, t_end: float, steps: int) -> None:
        self._system, self._actions = system, actions
        self._forces = coordinates @ actions.rows.T
        self._step = t_end / steps
        time = self._step * np.arange(steps + 1)
        self._values = actions.values(time)
        self._ways = {name: (way.at(time), way.rate(time)) for name, way in actions.ways.items()}

    @property
    def forces(self) -> np.ndarray:
        """S p (n_full, m)."""
        return self._forces

    def release(self, mbs: Any) -> None:
        """Take all forces off: Exudyn counts -f.q among the energies."""
        if self._actions.courses:
            mbs.SetObjectParameter(self._system.driver, "forceVector", np.zeros(len(self._forces)))

    def __call__(self, mbs: Any, t: float) -> bool:
        """Everything as it is at t [s]."""
        steps = t / self._step
        i = round(steps)
        whole = abs(steps - i) < ON_GRID
        if self._actions.courses:
            values = self._values[i] if whole else self._actions.values(np.array([t]))[0]
            mbs.SetObjectParameter(self._system.driver, "forceVector", self._forces @ values)
        for name, (ways, rates) in self._ways.items():
            way, rate = ways[i], rates[i]
            if not whole:
                own, now = self._actions.ways[name], np.array([t])
                way, rate = own.at(now)[0], own.rate(now)[0]
            self._system.stops[name].move(mbs, float(way), float(rate))
        return True
