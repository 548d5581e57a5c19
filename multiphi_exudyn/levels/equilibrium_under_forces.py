"""Rest under forces: of a structure on its contacts, of one that nothing holds, and of one with friction or laws.

On contacts alone it is the configuration that they admit nearest to the one without them, in the energy of structure
and springs: y = Omega^-1 z, and the springs' forces, with the shortest z that leaves no contact penetrated. Force laws
and friction have a path (static_equilibrium.py).

A structure that nothing holds has no place of rest, but a deformation: with forces that balance each other,

    y_e = Omega_e^-2 f_e,   y_0 = 0,   f_0 = 0

x is then M-orthogonal to the rigid-body modes. Forces that do not balance accelerate it, f - M Phi_0 f_0 is what
deforms it (inertia relief), and y_e is the same. Its contacts have to stay open there: where it would lie on them is
not said.
"""

from __future__ import annotations

import numpy as np

from multiphi_exudyn.display import per_cent
from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.levels.build_level import build_level
from multiphi_exudyn.levels.modal_base import ModalBase
from multiphi_exudyn.levels.static_equilibrium import equilibrium
from multiphi_exudyn.mathematics.complementarity.least_distance import Infeasible, least_distance
from multiphi_exudyn.mathematics.round_off import BALANCED, drop_round_off

__all__ = ["at_rest"]


def at_rest(base: ModalBase, load: np.ndarray, size: np.ndarray, inertia_relief: bool) -> tuple[np.ndarray, np.ndarray]:
    """y (m,) and stretches (l,) [m] of links at rest under a load (m,) of terms that add up to ``size``."""
    if base.modes.rigid:
        if base.laws or base.general:
            raise MultiPhiValueError(
                f"static equilibrium: the structure is free ({base.modes.rigid} rigid-body modes) and has force laws "
                "or friction, need supports that hold it"
            )
        return _floating(base, load, size, inertia_relief), np.zeros(len(base.contacts))
    if base.laws or base.general:
        return equilibrium(base, load)
    compliance = base.modes.omega**-2.0
    gaps = base.directions.T @ (compliance * load) + base.gaps
    bending = base.directions.T / base.modes.omega
    closed = _pressing(np.hstack([bending, np.diag(base.stiffnesses**-0.5)]), -gaps)
    level = build_level(base, tuple(int(i) for i in np.flatnonzero(closed)))
    return level.asymptotic(load).configuration, np.zeros(len(base.contacts))


def _floating(base: ModalBase, load: np.ndarray, size: np.ndarray, inertia_relief: bool) -> np.ndarray:
    """y (m,) of a structure that nothing holds, as it is deformed by a load (m,) of terms that add up to ``size``.

    Raises MultiPhiValueError for a load that does not balance itself, unless with inertia relief, and where a contact
    would be pressed on.
    """
    free, elastic = slice(base.modes.rigid), slice(base.modes.rigid, None)
    left = np.divide(np.abs(load[free]), size[free], out=np.zeros(base.modes.rigid), where=size[free] > 0)
    name = f"static equilibrium: the structure is free ({base.modes.rigid} rigid-body modes)"
    if not inertia_relief and np.max(left) > BALANCED:
        raise MultiPhiValueError(
            f"{name} and {per_cent(float(np.max(left)))} of the forces are not balanced, need balanced forces, "
            "supports, or inertia_relief=True (the deformation while the forces accelerate the structure)"
        )
    y = np.zeros(base.modes.count)
    y[elastic] = load[elastic] / base.modes.omega[elastic] ** 2
    terms = np.abs(base.directions.T) @ np.abs(y) + np.abs(base.gaps)
    pressed = np.flatnonzero(drop_round_off(base.directions.T @ y + base.gaps, terms) < 0)
    if len(pressed):
        raise MultiPhiValueError(
            f"{name} and would press on {base.links[int(pressed[0])].name!r}, need a gap there, or supports"
        )
    return y


def _pressing(rows: np.ndarray, least: np.ndarray) -> np.ndarray:
    """Which of the constraints rows z >= least press on the shortest z; they are independent of each other.

    Raises MultiPhiValueError where no z meets all of them.
    """
    try:
        _, multipliers = least_distance(rows, least, np.abs(least))
    except Infeasible as found:
        raise MultiPhiValueError(
            "static equilibrium: got rigid contacts that exclude each other, need gaps that leave room between them"
        ) from found
    return np.asarray(multipliers > 0)
