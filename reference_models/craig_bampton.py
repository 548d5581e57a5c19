"""Craig-Bampton reduction of a structure: interface displacements and fixed-interface modes.

    x = Psi u + Phi eta,   q = (u, eta)

u (b,) [m] are the displacements of interface points, Psi their constraint modes (the static response to one of them
being 1 m, the others held), Phi the lowest mass-normalised modes with all of them held. Psi^T K Phi = 0, so that

    K_q = [Psi^T K Psi, 0; 0, diag(omega^2)],   M_q = T^T M T,   C_q = T^T C T,   T = [Psi, Phi]

Both come from one level of the reduced model, in which a rigid contact holds every interface point: Phi are its
modes, Psi its asymptotic configurations (38.5). Source: R. R. Craig, M. C. C. Bampton, Coupling of substructures for
dynamic analyses, AIAA Journal 6 (1968) 1313.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.levels.level.level import Level
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.structure import LinearStructure

__all__ = ["CraigBampton", "craig_bampton", "independent_points"]

INDEPENDENT = 1e-9  # of a point's row: less than this beside the rows before it is dependent on them


@dataclass(frozen=True)
class CraigBampton:
    """A reduced component; see the module's docstring for its equations.

    interface: names of the points whose displacements come first among the coordinates q (b + m,).
    mass, damping, stiffness: (b + m, b + m). shapes: [Psi, Phi] (n, b + m). weights: (b + m, n), takes x to q.
    """

    interface: tuple[str, ...]
    mass: np.ndarray
    damping: np.ndarray
    stiffness: np.ndarray
    shapes: np.ndarray
    weights: np.ndarray

    @property
    def dofs(self) -> int:
        """Number of coordinates."""
        return len(self.mass)

    def coordinates(self, x: np.ndarray) -> np.ndarray:
        """q (b + m,) of a configuration x (n,): exact at the interface, nearest to it in strain energy inside."""
        return self.weights @ x


def craig_bampton(structure: LinearStructure, interface: Sequence[str], modes: int) -> CraigBampton:
    """Reduce ``structure`` to its ``interface`` points, independent of each other, and ``modes`` modes inside."""
    held = [UnilateralContact(name, name, gap=0.0) for name in interface]
    if not held or not 0 <= modes <= structure.n - len(held):
        needed = f"0 to {structure.n - len(held)} modes beside 1 interface point or more"
        raise MultiPhiValueError(f"modes: got {modes} and {len(held)} interface points, need {needed}")
    kept = max(modes, 1) if len(held) < structure.n else "all"
    level = MultiPhiModel(structure, held, modes=kept).level(interface)
    base, inside = level.base, level.vectors[:, :modes]
    constraint = np.column_stack([_constraint_mode(level, i) for i in range(len(held))])
    basis = np.column_stack([constraint, inside])
    stiffness = np.diag(np.concatenate([np.zeros(len(held)), level.omega[:modes] ** 2]))
    stiffness[: len(held), : len(held)] = constraint.T @ (base.modes.omega[:, None] ** 2 * constraint)
    rows = base.directions.T
    taken = np.vstack([rows, inside.T - (inside.T @ constraint) @ rows])
    return CraigBampton(
        interface=tuple(interface),
        mass=basis.T @ basis,
        damping=basis.T @ base.damping @ basis,
        stiffness=stiffness,
        shapes=base.modes.shapes @ basis,
        weights=(structure.mass @ (base.modes.shapes @ taken.T)).T,
    )


def independent_points(structure: LinearStructure, names: Iterable[str]) -> tuple[str, ...]:
    """Those of the points, in their order, whose displacement does not follow from the points before them."""
    kept: list[str] = []
    span = np.zeros((structure.n, 0))
    for name in names:
        row = structure.row(name)
        beside = row - span @ (span.T @ row)
        if np.linalg.norm(beside) > INDEPENDENT * np.linalg.norm(row):
            kept.append(name)
            span = np.linalg.qr(np.column_stack([span, row]))[0]
    return tuple(kept)


def _constraint_mode(level: Level, point: int) -> np.ndarray:
    """Psi_i (m,) in base coordinates: the level at rest with one contact displaced by 1 m."""
    gaps = -np.array([float(i == point) for i in level.indices])
    return level.static_response(np.zeros(level.base.modes.count), gaps)[1]
