"""Equilibrium under forces: of a structure on its contacts, of a free structure, and with friction or force laws.

With contacts alone the equilibrium has the least distance to the one without contacts, in the energy of structure and
springs, among all configurations without penetration: y = Omega^-1 z, and the springs' forces, with the shortest z.
Force laws and friction depend on the path (static_equilibrium.py).

A structure without supports has no equilibrium position, but a deformation. Under balanced forces it is

    y_e = Omega_e^-2 f_e,   y_0 = 0,   f_0 = 0

x is then M-orthogonal to the rigid-body modes, and its contacts have to stay open. Unbalanced forces either accelerate
the structure: f - M Phi_0 f_0 deforms it (inertia relief), and y_e is the same. Or they press it on its contacts
(equilibrium_on_contacts.py).
"""

from __future__ import annotations

import numpy as np

import multiphi_exudyn._core as core
from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.levels.base.modal_base import ModalBase
from multiphi_exudyn.levels.equilibrium.equilibrium_on_contacts import equilibrium_on_contacts
from multiphi_exudyn.levels.equilibrium.static_equilibrium import equilibrium_along_path
from multiphi_exudyn.mathematics.least_distance import Infeasible, least_distance
from multiphi_exudyn.mathematics.round_off import BALANCED, drop_round_off

__all__ = ["equilibrium_under_forces"]


def equilibrium_under_forces(
    base: ModalBase, load: np.ndarray, size: np.ndarray, inertia_relief: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Return y (m,) and the stretches (l,) [m] of links in equilibrium under a load (m,).

    size: (m,) sum of the absolute values of the terms of the load.
    """
    follows_path = base.laws or base.general or len(base.links) > len(base.contacts)  # states beside open and closed
    if base.modes.rigid:
        if follows_path:
            raise MultiPhiValueError(
                f"static equilibrium: the structure is free ({base.modes.rigid} rigid-body modes) and has force "
                "laws, friction or bounded dampers, need supports that hold it"
            )
        unbalanced = _unbalanced(base, load, size)
        if unbalanced > BALANCED and not inertia_relief:
            return equilibrium_on_contacts(base, load, unbalanced), np.zeros(len(base.contacts))
        return _free_deformation(base, load), np.zeros(len(base.contacts))
    if follows_path:
        return equilibrium_along_path(base, load)
    compliance = base.modes.omega**-2.0
    gaps = base.directions.T @ (compliance * load) + base.gaps
    bending = base.directions.T / base.modes.omega
    closed = _active_constraints(np.hstack([bending, np.diag(base.stiffnesses**-0.5)]), -gaps)
    response = core.static_response(base.core_base, np.flatnonzero(closed).tolist(), base.gaps[closed], load)
    return response[1], np.zeros(len(base.contacts))


def _unbalanced(base: ModalBase, load: np.ndarray, size: np.ndarray) -> float:
    """Return the largest share of a load (m,) on a rigid-body mode that is not balanced; size: (m,) of its terms."""
    free = slice(base.modes.rigid)
    return float(
        np.max(np.divide(np.abs(load[free]), size[free], out=np.zeros(base.modes.rigid), where=size[free] > 0))
    )


def _free_deformation(base: ModalBase, load: np.ndarray) -> np.ndarray:
    """Return the deformation y (m,) of a structure without supports under a load (m,).

    Raises MultiPhiValueError where the deformation closes a contact.
    """
    elastic = slice(base.modes.rigid, None)
    y = np.zeros(base.modes.count)
    y[elastic] = load[elastic] / base.modes.omega[elastic] ** 2
    terms = np.abs(base.directions.T) @ np.abs(y) + np.abs(base.gaps)
    pressed = np.flatnonzero(drop_round_off(base.directions.T @ y + base.gaps, terms) < 0)
    if len(pressed):
        raise MultiPhiValueError(
            f"static equilibrium: the structure is free ({base.modes.rigid} rigid-body modes) and would press on "
            f"{base.links[int(pressed[0])].name!r}, need a gap there, or supports"
        )
    return y


def _active_constraints(rows: np.ndarray, least: np.ndarray) -> np.ndarray:
    """Return which constraints rows z >= least are active at the shortest z; the active ones are linearly independent.

    Raises MultiPhiValueError where no z satisfies all of them.
    """
    try:
        _, multipliers = least_distance(rows, least, np.abs(least))
    except Infeasible as error:
        raise MultiPhiValueError(
            "static equilibrium: got rigid contacts that exclude each other, need gaps that leave room between them"
        ) from error
    return np.asarray(multipliers > 0)
