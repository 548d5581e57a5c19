"""Friction on a boundary without mass: one basis of open modes, and the residual flexibility of those left out.

    x = Phi eta + G (b f - h T),   G = K^-1 - Phi omega^-2 Phi^T

Phi are the r lowest modes of the open structure, whatever the state of the friction. What is left out follows the load
b f and the friction force T statically: the friction stands behind a spring of stiffness 1 / (1 / k + h.G h), whose end
the load moves by h.G b f. That is a small linear structure with another friction; nothing is projected at an event.

Source: C. D. Monjaraz-Tec, J. Gross, M. Krack, A massless boundary component mode synthesis method for elastodynamic
contact problems, Computers & Structures 260 (2022).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mechanics.friction import Friction
from multiphi_exudyn.mechanics.loads import HarmonicLoad, StopMotion
from multiphi_exudyn.mechanics.structure import At, LinearStructure
from multiphi_exudyn.mechanics.time_functions import Harmonic
from multiphi_exudyn.time.simulate import simulate
from multiphi_exudyn.time.trajectory import Trajectory

__all__ = ["MasslessBoundary", "massless_boundary"]


@dataclass(frozen=True)
class MasslessBoundary:
    """A run on a massless boundary.

    own: the small structure's. structure, load, friction: the whole one's, its load and the friction's name.
    shapes: Phi (n, m) of all modes. residual: omega^-2 of those left out. left: b and h in them, (2, m - r).
    """

    own: Trajectory
    structure: LinearStructure
    load: HarmonicLoad
    friction: str
    shapes: np.ndarray
    residual: np.ndarray
    left: np.ndarray

    def at(self, point: At, t: np.ndarray) -> np.ndarray:
        """Displacement (k,) [m] of a point at times (k,)."""
        row, r = self.structure.row(point) @ self.shapes, self.own.model.structure.n
        by_load, by_friction = (row[r:] * self.residual) @ self.left.T
        given = self.load.course.history(self.own.t_end).at(t)
        kept = row[:r] @ self.own.displacement(t)
        return np.asarray(kept + by_load * given - by_friction * self.own.friction_force(self.friction, t))


def massless_boundary(
    structure: LinearStructure, friction: Friction, load: HarmonicLoad, modes: int, t_end: float
) -> MasslessBoundary:
    """The motion from rest of a structure without rigid-body modes, with so many of its own modes."""
    base = MultiPhiModel(structure, [friction], modes="all").base
    shapes, omega = base.modes.shapes, base.modes.omega
    rows = np.array([structure.row(load.at), structure.row(friction.direction)]) @ shapes
    residual, left = omega[modes:] ** -2.0, rows[:, modes:]
    flexibility = 1 / friction.stiffness + float(left[1] * residual @ left[1])
    moved = -float(left[0] * residual @ left[1]) * load.amplitude
    small = LinearStructure(np.eye(modes), np.diag(omega[:modes] ** 2), damping=base.damping[:modes, :modes])
    stiffness = 1 / flexibility if flexibility > 0 else math.inf
    held = replace(friction, direction=rows[1, :modes], stiffness=stiffness)
    end = StopMotion(friction.name, Harmonic(moved, load.frequency_hz, load.phase))
    own = simulate(MultiPhiModel(small, [held], modes="all"), t_end, loads=[replace(load, at=rows[0, :modes]), end])
    return MasslessBoundary(own, structure, load, friction.name, shapes, residual, left)
