"""A basis from a run that was made before: proper orthogonal decomposition in the mass matrix.

    Y = Phi^T M [x(t_1), ..., x(t_k)] = U S W^T,   V = the r columns of U with the largest singular values

Y are snapshots in base coordinates, in which the mass matrix is the unit matrix. The projected structure is used with
all its modes, whatever is in contact. It knows what the training run has shown, and costs that run.
Source: G. Kerschen, J.-C. Golinval, A. F. Vakakis, L. A. Bergman, The method of proper orthogonal decomposition for
dynamical characterization and order reduction of mechanical systems, Nonlinear Dynamics 41 (2005) 147.
"""

from __future__ import annotations

import numpy as np

from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mechanics.structure import LinearStructure
from multiphi_exudyn.time.trajectory import Trajectory
from reference_models.projection import projected

__all__ = ["pod_basis"]

SNAPSHOTS = 2000  # evenly spaced over the training run


def pod_basis(training: Trajectory, modes: int) -> LinearStructure:
    """The structure of a training run projected on the ``modes`` directions in which it moved most.

    Fewer where it has moved in fewer. Points included.
    """
    model: MultiPhiModel = training.model
    times = np.linspace(training.start.time, training.t_end, SNAPSHOTS)
    snapshots = model.base.coordinates(training.displacement(times))
    directions, sizes, _ = np.linalg.svd(snapshots, full_matrices=False)
    moved = int(np.sum(sizes > np.finfo(float).eps * len(times) * sizes[0]))
    return projected(model.base, model.structure, directions[:, : min(modes, moved)])
