"""One basis for all levels: the structure projected on the modes of its open and of its closed state together.

    V = span(Phi_open, Phi_closed),   V^T M V = I,   x = V z

Phi_open are the r lowest modes with every contact open, Phi_closed those with every contact closed. The projected
structure is a small linear structure of its own, to be used with all its modes: no transition loses anything, but
every level has up to 2 r coordinates instead of r.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.structure import LinearStructure
from reference_models.projection import projected

__all__ = ["global_basis"]

INDEPENDENT = 1e-6  # sine of the angle to the other modes: below it a direction adds nothing but round-off


def global_basis(structure: LinearStructure, contacts: Sequence[UnilateralContact], modes: int) -> LinearStructure:
    """``structure`` projected on the ``modes`` lowest modes of its open and of its closed level, points included."""
    model = MultiPhiModel(structure, contacts, modes=modes)
    base = model.base
    both = [model.level(closed).vectors for closed in ((), [contact.name for contact in contacts])]
    directions, sines, _ = np.linalg.svd(np.column_stack(both), full_matrices=False)
    vectors = directions[:, sines > INDEPENDENT]
    return projected(base, structure, vectors)
