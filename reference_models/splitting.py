"""The best of the step-by-step methods for few modes: free motion exact, penalty forces by splitting (Strang).

    z'' + D z' + diag(omega^2) z = sum_i h_i k_i max(0, -g_i)     g_i = h_i.z + gap_i

z are the modes of a Craig-Bampton component, D its projected damping. A step kicks the velocities by the contact forces
for h/2, moves on without contact for h, exactly, and kicks again: second order, symplectic without damping, 30 lines.
Contact begins and ends with the ends of steps; D is taken by its diagonal, whose neighbours are told as ``coupling``.
Source: G. Strang, On the construction and comparison of difference schemes, SIAM J. Numer. Anal. 5 (1968) 506.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg

from multiphi_exudyn._core import split_steps
from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.structure import LinearStructure
from reference_models.craig_bampton import craig_bampton
from reference_models.stepwise import StepwiseHistories

__all__ = ["Splitting", "SplittingRun", "splitting"]


@dataclass(frozen=True)
class Splitting:
    """The component in its modes: omega^2, diagonal of D (r,), shapes (n, r), weights (r, n) that take x to z.

    coupling: the largest entry beside D's diagonal, relative to it. rows (c, r), laws (c, 2): gap [m], stiffness [N/m].
    """

    contacts: tuple[str, ...]
    squares: np.ndarray
    damping: np.ndarray
    coupling: float
    shapes: np.ndarray
    weights: np.ndarray
    rows: np.ndarray
    laws: np.ndarray

    def run(self, displacement: np.ndarray, t_end: float, step: float) -> SplittingRun:
        """From rest at x (n,) over equal steps [s], the last of which reaches t_end [s]."""
        steps, modes = math.ceil(t_end / step * (1 - 1e-12)), len(self.squares)
        record = np.zeros((steps + 1, 2 * modes))
        record[0, :modes] = self.weights @ displacement
        flow = _free_flow(self.squares, self.damping, step)
        split_steps(step, flow, self.rows, self.laws, record)
        return SplittingRun(self, step, record)


@dataclass(frozen=True)
class SplittingRun:
    """States (steps + 1, 2 r) at the ends of steps [s]."""

    model: Splitting
    step: float
    record: np.ndarray

    @property
    def steps(self) -> int:
        """Number of steps."""
        return len(self.record) - 1

    @property
    def finite(self) -> bool:
        """Whether it has not exploded."""
        return bool(np.all(np.isfinite(self.record)))

    def histories(self, structure: LinearStructure, points: Sequence[str], time: np.ndarray) -> StepwiseHistories:
        """On times (k,) [s]: within a step the kick at its start and the free motion after it.

        Energies are those at the ends of steps, after both kicks, and between them on straight lines.
        """
        model, r = self.model, len(self.model.squares)
        places = np.minimum((time / self.step * (1 + 1e-12)).astype(int), self.steps)
        z, speed = self.record[places, :r].T, self.record[places, r:].T
        speed = speed + 0.5 * self.step * model.rows.T @ self._forces(z)
        flow = _free_flow(model.squares[:, None], model.damping[:, None], np.maximum(time - places * self.step, 0.0))
        z, speed = flow[0] * z + flow[1] * speed, flow[2] * z + flow[3] * speed
        gaps, forces = model.rows @ z + model.laws[:, :1], self._forces(z)
        return StepwiseHistories(
            points={name: (structure.row(name) @ model.shapes) @ z for name in points},
            gaps=dict(zip(model.contacts, gaps, strict=True)),
            contact_force=dict(zip(model.contacts, forces, strict=True)),
            energy=np.interp(time, self.step * np.arange(len(self.record)), self._energy),
        )

    def contact_intervals(self, contact: str) -> list[tuple[float, float]]:
        """[(closed at, opened at), ...] [s], by straight lines between the ends of steps."""
        i, r = self.model.contacts.index(contact), len(self.model.squares)
        gaps = self.record[:, :r] @ self.model.rows[i] + self.model.laws[i, 0]
        time, closed = self.step * np.arange(len(gaps)), gaps < 0
        turns = np.flatnonzero(closed[1:] != closed[:-1])
        instants = (time[turns] + self.step * gaps[turns] / (gaps[turns] - gaps[turns + 1])).tolist()
        ends = [*([0.0] if closed[0] else []), *instants, *([float(time[-1])] if closed[-1] else [])]
        return list(zip(ends[::2], ends[1::2], strict=True))

    @functools.cached_property
    def _energy(self) -> np.ndarray:
        """Kinetic and strain energy (steps + 1,) [J] at the ends of steps."""
        z, speed = np.split(self.record.T, 2)
        pressed = 0.5 * np.sum(self._forces(z) ** 2 / self.model.laws[:, 1:], axis=0)
        return np.asarray(0.5 * np.sum(speed**2, axis=0) + 0.5 * self.model.squares @ z**2 + pressed)

    def _forces(self, z: np.ndarray) -> np.ndarray:
        """Contact forces (c, k) [N] at coordinates (r, k)."""
        return self.model.laws[:, 1:] * np.maximum(-(self.model.rows @ z + self.model.laws[:, :1]), 0.0)


def splitting(
    structure: LinearStructure, contacts: Sequence[UnilateralContact], interface: Sequence[str], modes: int
) -> Splitting:
    """The Craig-Bampton component with these interface points and ``modes`` modes inside, its contacts on it.

    Raises MultiPhiValueError for contacts without a finite stiffness, or with damping or friction.
    """
    for contact in contacts:
        if contact.rigid or contact.damping or contact.further:
            raise MultiPhiValueError(
                f"contact {contact.name!r}: got one that is no spring, need a finite stiffness alone"
            )
    component = craig_bampton(structure, interface, modes)
    squares, vectors = scipy.linalg.eigh(component.stiffness, component.mass)
    damping = vectors.T @ component.damping @ vectors
    own, shapes = np.diagonal(damping).copy(), component.shapes @ vectors
    beside = damping - np.diag(own)
    laws = [(contact.gap, contact.stiffness) for contact in contacts]
    return Splitting(
        contacts=tuple(contact.name for contact in contacts),
        squares=np.maximum(squares, 0.0),
        damping=own,
        coupling=float(np.max(np.abs(beside)) / np.max(own)) if np.any(own) else 0.0,
        shapes=shapes,
        weights=shapes.T @ structure.mass,
        rows=np.array([structure.row(contact.direction) @ shapes for contact in contacts]).reshape(len(laws), -1),
        laws=np.array(laws).reshape(-1, 2),
    )


def _free_flow(squares: np.ndarray, damping: np.ndarray, t: float | np.ndarray) -> np.ndarray:
    """z, z' at t from z, z': (4, ...) with cos, sin of the damped frequency, or cosh, sinh above critical damping."""
    half = damping / 2
    root = np.sqrt(squares - half**2 + 0j)
    fade, wave = np.exp(-half * t), np.cos(root * t).real
    sine = np.where(root == 0, t, np.sin(root * t) / np.where(root == 0, 1, root)).real
    return np.array([fade * (wave + half * sine), fade * sine, -fade * squares * sine, fade * (wave - half * sine)])
