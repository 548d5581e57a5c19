"""Equilibrium of a structure without supports that its contacts alone hold, as a body on its bearings.

    y_e = Omega_e^-2 (f_e + H_e lambda),   H_0 lambda + f_0 = 0
    w = H_e^T y_e + H_0^T y_0 + gap + lambda / k >= 0,   lambda >= 0,   w . lambda = 0

This is a linear complementarity problem with equations for the rigid-body modes, whose solution minimises a convex
energy: every solution has the same deformation. Weak springs on the rigid-body modes make it a least distance problem
(least_distance.py), which tells the contacts that press; with these closed the equations above are linear, and their
solution is checked against the inequalities. Where it leaves a rigid-body motion open, that is zero.
"""

from __future__ import annotations

import numpy as np
import scipy.optimize

from multiphi_exudyn.display import per_cent
from multiphi_exudyn.errors import MultiPhiValueError, NumericalFailure
from multiphi_exudyn.levels.base.modal_base import ModalBase
from multiphi_exudyn.mathematics.least_distance import least_distance
from multiphi_exudyn.mathematics.round_off import FOLLOWING, INDEPENDENT

__all__ = ["equilibrium_on_contacts"]

WEAK = (1e-6, 1e-8, 1e-4, 1e-10, 1e-2)  # of the stiffness of contacts on a rigid-body motion, one after the other
CARRIED = 1e-9  # of the forces on rigid-body modes: a smaller rest is round-off


def equilibrium_on_contacts(base: ModalBase, load: np.ndarray, unbalanced: float) -> np.ndarray:
    """Return y (m,) in equilibrium under a load (m,), of whose terms a share is ``unbalanced`` without contacts.

    Raises MultiPhiValueError where the contacts cannot carry it, NumericalFailure where no set of them is found.
    """
    free, elastic = slice(base.modes.rigid), slice(base.modes.rigid, None)
    scale = float(np.linalg.norm(load[free]))
    units = np.linalg.norm(base.directions[free], axis=0)
    units[units == 0] = 1.0
    rest = scipy.optimize.nnls(base.directions[free] / units, -load[free] / scale)[1] if units.size else 1.0
    if rest > CARRIED:
        carried = " that its contacts cannot carry" if units.size else ""
        raise MultiPhiValueError(
            f"static equilibrium: the structure is free ({base.modes.rigid} rigid-body modes) and "
            f"{per_cent(unbalanced)} of the forces are not balanced{carried}, need balanced forces, supports, or "
            "inertia_relief=True (the deformation while the forces accelerate the structure)"
        )
    flexible = base.directions[elastic] / base.modes.omega[elastic, None]
    own = np.sum(flexible**2, axis=0) + 1 / base.stiffnesses
    stiffness = float(np.max(np.divide(units**2, own, out=np.zeros(len(own)), where=own > 0), initial=0.0)) or 1.0
    for weak in WEAK:
        omega = np.concatenate([np.full(base.modes.rigid, np.sqrt(weak * stiffness)), base.modes.omega[elastic]])
        gaps = base.directions.T @ (load / omega**2) + base.gaps
        rows = np.hstack([base.directions.T / omega, np.diag(base.stiffnesses**-0.5)])
        sizes = np.abs(base.directions.T) @ np.abs(load / omega**2) + np.abs(base.gaps)
        try:
            _, multipliers = least_distance(rows, -gaps, sizes)
        except NumericalFailure:
            continue
        closed = np.flatnonzero(multipliers > 0)
        y = _with_closed(base, load, closed) if len(closed) else None
        if y is not None:
            return y
    raise NumericalFailure(
        "static equilibrium: no contacts were found that carry the forces, need a damped run that comes to rest"
    )


def _with_closed(base: ModalBase, load: np.ndarray, closed: np.ndarray) -> np.ndarray | None:
    """Return y (m,) in equilibrium with these contacts closed, None where it violates an inequality."""
    rigid, count = base.modes.rigid, len(closed)
    moved = base.directions[:rigid, closed]
    flexible = base.directions[rigid:, closed] / base.modes.omega[rigid:, None]
    bent = flexible.T @ (load[rigid:] / base.modes.omega[rigid:])
    own = np.sum(flexible**2, axis=0) + 1 / base.stiffnesses[closed]
    own[own == 0] = np.max(own, initial=0.0) or 1.0
    matrix = np.zeros((count + rigid, count + rigid))
    matrix[:count, :count] = flexible.T @ flexible + np.diag(1 / base.stiffnesses[closed])
    matrix[:count, count:], matrix[count:, :count] = moved.T, moved
    units = np.sqrt(np.concatenate([1 / own, np.full(rigid, np.min(own) / np.max(np.abs(moved)) ** 2)]))
    right = -np.concatenate([bent + base.gaps[closed], load[:rigid]])
    scaled = np.linalg.lstsq(units[:, None] * matrix * units, units * right, rcond=INDEPENDENT)[0]
    forces, y = (units * scaled)[:count], np.zeros(base.modes.count)
    y[:rigid] = (units * scaled)[count:]
    y[rigid:] = (load[rigid:] + base.directions[rigid:, closed] @ forces) / base.modes.omega[rigid:] ** 2
    penetrations = np.zeros(len(base.gaps))
    penetrations[closed] = forces / base.stiffnesses[closed]
    pushed = np.abs(load) + np.abs(base.directions[:, closed]) @ np.abs(forces)
    balance = base.directions[:rigid, closed] @ forces + load[:rigid]
    bending = np.abs(base.directions[rigid:].T) @ (pushed[rigid:] / base.modes.omega[rigid:] ** 2)
    lengths = np.linalg.norm(base.directions, axis=0)
    sizes = bending + np.abs(base.directions.T) @ np.abs(y) + np.abs(base.gaps)
    terms = lengths * np.max(np.divide(sizes, lengths, out=np.zeros(len(sizes)), where=lengths > 0))
    is_admissible = (
        np.max(np.abs(balance)) <= CARRIED * np.max(pushed[:rigid])
        and np.all(forces >= -FOLLOWING * np.max(forces))
        and np.all(base.directions.T @ y + base.gaps + penetrations >= -FOLLOWING * (terms + np.abs(base.gaps)))
    )
    return y if is_admissible else None
