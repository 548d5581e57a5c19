"""A structure projected on a few orthonormal vectors of its base: a small linear structure of its own.

V^T M V = I,   x = V z,   K_z = V^T K V,   C_z = V^T C V
"""

from __future__ import annotations

import numpy as np

from multiphi_exudyn.levels.base.modal_base import ModalBase
from multiphi_exudyn.mechanics.structure import LinearStructure

__all__ = ["projected"]


def projected(base: ModalBase, structure: LinearStructure, vectors: np.ndarray) -> LinearStructure:
    """``structure`` on vectors (m, k), orthonormal in base coordinates, points included."""
    strained = base.modes.omega[:, None] * vectors
    return LinearStructure(
        mass=np.eye(vectors.shape[1]),
        stiffness=strained.T @ strained,
        damping=vectors.T @ base.damping @ vectors,
        points={name: vectors.T @ (base.modes.shapes.T @ row) for name, row in structure.points.items()},
    )
