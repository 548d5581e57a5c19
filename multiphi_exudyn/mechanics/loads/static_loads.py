"""Static loads: constant forces at points, and weight.

    f = p F,   f = M e g

They are part of the asymptotic configuration of every level, so they are exact for any number of modes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from multiphi_exudyn.errors import MultiPhiTypeError
from multiphi_exudyn.mechanics.loads.time_functions import check_numbers
from multiphi_exudyn.mechanics.structures.structure import At, LinearStructure

__all__ = ["ConstantLoad", "Gravity", "StaticLoad"]


@dataclass(frozen=True)
class ConstantLoad:
    """A constant force at a point, f(t) = p force.

    It is part of the asymptotic configuration of every level, so it is exact for any number of modes.

    Parameters
    ----------
    at : str, mapping or array (n,)
        p, point of the force: a point name, {point: coefficient} or a row.
    force : float
        [N], [N m] on a rotation.

    Raises
    ------
    MultiPhiTypeError
        For a force that is not a number.
    MultiPhiValueError
        For a force that is not finite.

    Examples
    --------
    >>> import numpy as np
    >>> import multiphi_exudyn as mp
    >>> K = 4e4 * np.array([[2, -1, 0], [-1, 2, -1], [0, -1, 1]])  # N/m
    >>> chain = mp.LinearStructure(np.eye(3), K, mp.ModalDamping(0.01), {"tip": 2})
    >>> stop = mp.UnilateralContact("stop", "tip", gap=1e-3, stiffness=1e6)
    >>> model = mp.MultiPhiModel(chain, [stop])
    >>> tr = mp.simulate(model, 0.5, loads=[mp.ConstantLoad("tip", -50.0)])
    >>> tr.events[0].kind
    'close'
    """

    at: At
    force: float

    def __post_init__(self) -> None:
        check_numbers("load", force=self.force)

    def row(self, structure: LinearStructure) -> np.ndarray:
        """The static force (n,)."""
        return self.force * structure.row(self.at)


@dataclass(frozen=True)
class Gravity:
    """The weight of the whole structure, f = M e acceleration.

    Parameters
    ----------
    direction : array (n,) or mapping
        e (n,): 1 at every translation along gravity, -1 at those against it, 0 at the others; or {point: coefficient}.
    acceleration : float, default 9.81
        [m/s2].

    Raises
    ------
    MultiPhiTypeError
        For a direction that is one point or one number, and an acceleration that is not a number.
    MultiPhiValueError
        For an acceleration that is not finite.

    Examples
    --------
    >>> import numpy as np
    >>> import multiphi_exudyn as mp
    >>> K = 4e4 * np.array([[2, -1, 0], [-1, 2, -1], [0, -1, 1]])  # N/m
    >>> chain = mp.LinearStructure(np.eye(3), K, mp.ModalDamping(0.01), {"tip": 2})
    >>> mp.Gravity(-np.ones(3)).row(chain).tolist()
    [-9.81, -9.81, -9.81]
    """

    direction: Mapping[str, float] | np.ndarray
    acceleration: float = 9.81

    def __post_init__(self) -> None:
        if np.isscalar(self.direction):
            raise MultiPhiTypeError(
                f"gravity direction: got {self.direction!r}, need a row (n,): 1 at every degree of freedom that is a "
                "translation along gravity, 0 at the others, as in Gravity(e, 9.81); the weight of a mass at a point "
                "is ConstantLoad(point, -m * 9.81)"
            )
        check_numbers("gravity", acceleration=self.acceleration)

    def row(self, structure: LinearStructure) -> np.ndarray:
        """The static force (n,)."""
        return np.asarray(self.acceleration * (structure.mass @ structure.row(self.direction)))


StaticLoad: TypeAlias = "ConstantLoad | Gravity"
