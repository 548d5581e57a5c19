"""Modal structure: a structure given by its modes alone, from a modal test or a finite element result.

    x_p = sum_j phi_pj q_j + z_p,   m_j (q_j'' + 2 zeta_j omega_j q_j' + omega_j^2 q_j) = sum_p phi_pj F_p
    z_p = rho_p F_p,   rho_p = flexibility_p - sum_j phi_pj^2 / (m_j omega_j^2)

q are the modal coordinates, x_p the displacement of a point. Modes that are not given would add to the flexibility of a
point, by an amount that the given modes do not determine. Without it a contact acts on too stiff a structure, and a
rigid stop stops the given modes alone: its forces are too large and too short. With three modes of a cantilever and a
stop of 1e6 N/m at half its length (examples/structures_from_files.py), the largest force is 47 % too large; with the
following completion its error is 2 %. With a stop ten times as stiff both errors are larger.

If the static flexibility of a point is known (its displacement under 1 N, from one static load case; of a free
structure without its motion as a rigid body), rho_p completes it, by a further coordinate z_p with a frequency above
the given ones. The residual flexibility between two points is assumed to be zero.

Source: R. H. MacNeal, A hybrid method of component mode synthesis, Comput. Struct. 1 (1971) 581; D. J. Ewins, Modal
Testing, 2000, ch. 5.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.mechanics.arguments import is_real, one_of, real_array
from multiphi_exudyn.mechanics.structure import LinearStructure

__all__ = ["ModalStructure", "structure_from_modes"]

ABOVE = 2.0  # of the highest given frequency: gives the best peak forces of factors from 1.5 to 10
MEASURED = 1e-3  # of a point's flexibility: allowed deficit compared with that of the modes
NOTHING = 1e-9  # of a point's flexibility: a smaller residual one is round-off


@dataclass(frozen=True, eq=False, kw_only=True)
class ModalStructure(LinearStructure):
    """A structure in modal coordinates; the result of ``structure_from_modes``.

    Attributes
    ----------
    mass, stiffness : array (n, n)
        Modal masses and stiffnesses, diagonal.
    damping : array (n, n) or None
        Modal damping, diagonal.
    points : mapping of str to array (n,)
        Displacements of the points in the modes, as rows.
    dofs : None
        Modal coordinates have no nodes.
    free : array (n,)
        0 to n - 1.
    highest : float
        Frequency [Hz] of the last mode.
    completed : frozenset of str
        Points with a given static flexibility.

    Examples
    --------
    >>> import multiphi_exudyn as mp
    >>> tested = mp.structure_from_modes([10.0, 62.0], {"tip": [1.9, -1.8]}, ratios=0.01)
    >>> tested.highest, sorted(tested.completed)
    (62.0, [])
    """

    highest: float
    completed: frozenset[str]


def structure_from_modes(
    frequencies: Sequence[float],
    shapes: Mapping[str, Sequence[float]],
    masses: Sequence[float] | None = None,
    ratios: Sequence[float] | float = 0.0,
    flexibility: Mapping[str, float] | None = None,
) -> ModalStructure:
    """A structure given by r modes alone, from a modal test or a finite element result.

        x_p = sum_j phi_pj q_j + z_p
        m_j (q_j'' + 2 zeta_j omega_j q_j' + omega_j^2 q_j) = sum_p phi_pj F_p
        z_p = rho_p F_p,   rho_p = flexibility_p - sum_j phi_pj^2 / (m_j omega_j^2)

    Modes that are not given would add to the flexibility of a point. Without it a contact acts on too stiff a
    structure: its forces are too large and too short. If it is known, a further coordinate z_p completes it.
    Source: R. H. MacNeal, Comput. Struct. 1 (1971) 581.

    Parameters
    ----------
    frequencies : array (r,)
        [Hz], zero for rigid-body modes.
    shapes : mapping of str to array (r,)
        Point to its displacement (or rotation) in every mode.
    masses : array (r,), default None
        Modal masses [kg] of these shapes; None: shapes are mass-normalised [kg^-1/2].
    ratios : array (r,) or float, default 0.0
        Fractions of critical damping below 1 (0.01 is 1 %), or one for all modes.
    flexibility : mapping of str to float, default None
        Point to its static displacement under a unit force there [m/N], of a free structure without its motion as a
        rigid body. Without it, a run with a contact at the point issues a warning.

    Returns
    -------
    ModalStructure
        In modal coordinates, with a further one for each point that is completed.

    Raises
    ------
    MultiPhiTypeError
        For arguments of another kind.
    MultiPhiValueError
        For what does not fit, and for a flexibility that is smaller than that of the modes.

    Examples
    --------
    >>> import multiphi_exudyn as mp
    >>> known = {"tip": 9.4e-4}  # m/N
    >>> tested = mp.structure_from_modes([10.0, 62.0], {"tip": [1.9, -1.8]}, flexibility=known)
    >>> tested.n, sorted(tested.completed)
    (3, ['tip'])
    """
    hz = _numbers("frequencies", frequencies, None, least=0.0)
    m = np.ones(len(hz)) if masses is None else _numbers("masses", masses, len(hz))
    if not np.all(m > 0):
        raise MultiPhiValueError(f"masses: got {np.min(m):g}, need modal masses > 0")
    zeta = _ratios(ratios, len(hz))
    if not isinstance(shapes, Mapping) or not shapes:
        raise MultiPhiTypeError(f"shapes: got {_kind(shapes)}, need {{point: ({len(hz)},) displacements in the modes}}")
    rows = {name: _numbers(f"shapes[{name!r}]", shape, len(hz)) for name, shape in shapes.items()}
    omega = 2 * np.pi * hz
    own = {name: _flexibility(row, m, omega) for name, row in rows.items()}
    missing = _missing(own, {} if flexibility is None else flexibility)
    residual = {name: rho for name, rho in missing.items() if rho > NOTHING * own[name]}
    above = 2 * np.pi * ABOVE * (np.max(hz) or 1.0)
    stiffness = np.r_[m * omega**2, [1 / rho for rho in residual.values()]]
    omega, zeta = np.r_[omega, np.full(len(residual), above)], np.r_[zeta, np.full(len(residual), zeta[np.argmax(hz)])]
    mass = np.r_[m, stiffness[len(hz) :] / above**2]
    points = {name: np.r_[row, [float(name == other) for other in residual]] for name, row in rows.items()}
    damping = np.diag(2 * zeta * mass * omega) if np.any(zeta) else None
    return ModalStructure(
        np.diag(mass), np.diag(stiffness), damping, points, highest=float(np.max(hz)), completed=frozenset(missing)
    )


def _flexibility(row: np.ndarray, masses: np.ndarray, omega: np.ndarray) -> float:
    """Of a point [m/N], as far as elastic modes have it."""
    elastic = omega > 0
    return float(np.sum(row[elastic] ** 2 / (masses[elastic] * omega[elastic] ** 2)))


def _missing(own: Mapping[str, float], given: Any) -> dict[str, float]:
    """Residual flexibility [m/N] of the points with a given one, beyond that of the modes."""
    if not isinstance(given, Mapping):
        raise MultiPhiTypeError(f"flexibility: got {type(given).__name__}, need {{point: m/N}}")
    missing = {}
    for name, value in given.items():
        if name not in own:
            raise MultiPhiValueError(f"flexibility: got point {name!r}, need {one_of(name, own)}")
        if not is_real(value) or not np.isfinite(value):
            raise MultiPhiTypeError(f"flexibility[{name!r}]: got {value!r}, need a number [m/N]")
        if value < (1 - MEASURED) * own[name]:
            needed = f"need no less than the {own[name]:g} m/N of the modes (units? modal masses?)"
            raise MultiPhiValueError(f"flexibility[{name!r}]: got {value:g} m/N, {needed}")
        missing[name] = float(value) - own[name]
    return missing


def _ratios(given: Any, count: int) -> np.ndarray:
    zeta = np.full(count, given) if is_real(given) else _numbers("ratios", given, count)
    wrong = zeta[~((zeta >= 0) & (zeta < 1))]
    if len(wrong):
        raise MultiPhiValueError(f"ratios: got {wrong[0]:g}, need fractions of critical damping below 1 (0.01 is 1 %)")
    return zeta


def _numbers(name: str, given: Any, count: int | None, least: float = -np.inf) -> np.ndarray:
    """Finite numbers (count,), or one or more of them for None."""
    length = "r" if count is None else count
    array = np.asarray(real_array(name, given, f"({length},) real numbers"))
    if array.ndim != 1 or not array.size or (count is not None and len(array) != count):
        raise MultiPhiValueError(f"{name}: got shape {array.shape}, need ({length},)")
    wrong = array[~(np.isfinite(array) & (array >= least))]
    if len(wrong):
        raise MultiPhiValueError(
            f"{name}: got {wrong[0]:g}, need finite numbers{'' if least < 0 else f' >= {least:g}'}"
        )
    return array


def _kind(given: Any) -> str:
    return "no point" if isinstance(given, Mapping) else type(given).__name__
