"""Residual level: closed contacts that act through the flexibility of the modes left out (core/residual_boundary.hpp).

The host is the level with these contacts open. The modes that it leaves out have stiffness and no inertia: a force f
along the direction h of a contact bends the structure, beside the r modes Psi of the host, by

    (K_l^-1 - Psi omega^-2 Psi^T) h f,   F = h^T (K_l^-1 - Psi omega^-2 Psi^T) h

and f follows from the modes. So a residual level has r modes in the space of those of the host, and a bending beside
each. In statics it is exact, whatever r.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.optimize

import multiphi_exudyn._core as core
from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.levels.level.level import Level
from multiphi_exudyn.levels.level.quasi_static import quasi_static_response
from multiphi_exudyn.mathematics.round_off import INDEPENDENT

__all__ = ["ResidualBoundary"]


@dataclass(frozen=True)
class ResidualBoundary:
    """The residual contacts of a host, with what their forces bend beside its modes.

    links: (c,). shapes: (m, c). forces_of_host: (k, c), of the links that act in the host. gaps: of all links (l, c).
    flexibility: F (c, c), those of these contacts. compliances: 1/k (c,), zero where rigid.
    """

    host: Level
    links: tuple[int, ...]
    shapes: np.ndarray
    forces_of_host: np.ndarray
    gaps: np.ndarray
    flexibility: np.ndarray
    compliances: np.ndarray

    @classmethod
    def of(cls, host: Level) -> ResidualBoundary:
        """Return the boundary of all residual contacts of a model, open in the host."""
        base, links = host.base, host.base.residual
        directions = base.directions[:, list(links)]
        shapes, forces = quasi_static_response(host, directions)
        gaps, compliances = base.directions.T @ shapes, 1 / base.stiffnesses[list(links)]
        flexibility = gaps[list(links)]
        whole = np.sum((directions * base.periods[:, None]) ** 2, axis=0)
        for place, link in enumerate(links):
            if compliances[place] == 0 and flexibility[place, place] <= INDEPENDENT * whole[place]:
                raise MultiPhiValueError(
                    f"boundary of {base.links[link].name!r}: got 'residual' for a rigid contact where all modes are "
                    "kept, need 'own' or fewer modes"
                )
        return cls(host, links, shapes, forces, gaps, (flexibility + flexibility.T) / 2, compliances)

    def level(self, closed: Sequence[int]) -> Level:
        """Return the level in which these links act besides those of the host."""
        host, base, acting = self.host, self.host.base, list(closed)
        places = [self.links.index(link) for link in closed]
        directions, shapes, compliances = base.directions[:, acting], self.shapes[:, places], self.compliances[places]
        flexibility = self.flexibility[np.ix_(places, places)]
        squares, rotation, forces = core.residual_modes(
            host.squares, directions.T @ host.vectors, flexibility, compliances
        )
        bending = shapes @ forces
        gap_rows = host.gap_rows @ rotation + self.gaps[:, places] @ forces
        gap_rows[acting] = -compliances[:, None] * forces  # no difference of large terms
        both = [*host.indices, *acting]
        force_rows = np.vstack([host.force_rows @ rotation + self.forces_of_host[:, places] @ forces, forces])
        return Level(
            closed=tuple(base.links[i].name for i in sorted(both) if i not in base.laws),
            indices=tuple(sorted(both)),
            base=base,
            squares=squares,
            vectors=host.vectors @ rotation + bending,
            damping=rotation.T @ host.damping @ rotation,
            gap_rows=gap_rows,
            following=host.following,
            speed_rows=gap_rows,
            force_rows=force_rows[np.argsort(both)],
            force_rate_rows=np.zeros_like(force_rows),
            neutral=host.neutral,
            computed=squares,
            kept_beyond=host.kept_beyond,
            bending=bending,
        )

    def pressed(self, gaps: np.ndarray) -> tuple[int, ...]:
        """Return the links that press, f > 0, where the host has gaps (c,) [m]: f >= 0, (1/k + F) f + gaps >= 0."""
        near = np.flatnonzero(gaps < 0)
        if not len(near):
            return ()
        values, vectors = np.linalg.eigh(self.flexibility + np.diag(self.compliances))
        resisting = values > INDEPENDENT * values[-1]
        root = np.sqrt(values[resisting])[:, None] * vectors[:, resisting].T
        aimed = -(vectors[:, resisting].T @ gaps) / np.sqrt(values[resisting])
        forces, _ = scipy.optimize.nnls(root, aimed)
        return tuple(link for link, force in zip(self.links, forces.tolist(), strict=True) if force > 0)
