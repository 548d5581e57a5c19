"""Level: the linear system that holds while a set of contacts is closed, in its own modes (eqs. 38.2 to 38.5).

    x = Phi_l eta + x_inf,l                                                           (38.4)
    eta'' + Phi_l^T C Phi_l eta' + diag(omega_l^2) eta = Phi_l^T (f - f_static)       (38.3)

The core builds it (core/modal_level.hpp) and knows its static response, x_inf,l of gaps and static loads
(core/static_response.hpp). Where no closed contact resists a rigid-body motion, the load along it accelerates the
level's zero-frequency modes. The total stiffness of a force law may be negative, and the level indefinite: then
omega^2 < 0, the square of a rate of growth (eta ~ exp(+-|omega| t)).
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

import multiphi_exudyn._core as core
from multiphi_exudyn.display import Shown, names
from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.levels.base.modal_base import ModalBase
from multiphi_exudyn.levels.level.mode_figure import mode_figure
from multiphi_exudyn.mechanics.arguments import real_array

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Level"]


class Level(Shown):
    """The linear system that holds while a set of contacts is closed, in its own r modes.

        x = Phi_l eta + x_inf,l                                                           (38.4)
        eta'' + Phi_l^T C Phi_l eta' + diag(omega_l^2) eta = Phi_l^T (f - f_static)       (38.3)

    Made by ``MultiPhiModel.level``. The arrays are in base coordinates (m,), which all levels of a model share;
    ``shapes`` and ``asymptotic_configuration`` are in structural coordinates (n,). Springs of a force law may be
    negative: then some omega^2 < 0, the square of a rate of growth, eta ~ exp(+-|omega| t).

    Attributes
    ----------
    base : ModalBase
        The coordinates that all levels share.
    indices : tuple of int
        Positions in the base of all active links.
    closed : tuple of str
        Names of its closed contacts; of a force law, of the links that its segment has beside those of segment "0".

    Examples
    --------
    >>> import numpy as np
    >>> import multiphi_exudyn as mp
    >>> K = 4e4 * np.array([[2, -1, 0], [-1, 2, -1], [0, -1, 1]])  # N/m
    >>> chain = mp.LinearStructure(np.eye(3), K, mp.ModalDamping(0.01), {"tip": 2})
    >>> stop = mp.UnilateralContact("stop", "tip", gap=1e-3, stiffness=1e6)
    >>> model = mp.MultiPhiModel(chain, [stop])
    >>> for closed in ((), ("stop",)):
    ...     print(model.level(closed).frequencies.round(1))
    [14.2 39.7 57.4]
    [ 31.5  54.9 162.4]
    """

    def __init__(self, base: ModalBase, moving: core.MovingLevel) -> None:
        self.base, self.indices = base, moving.modal.links
        self.closed = tuple(base.links[i].name for i in self.indices if i not in base.laws)
        self._moving = moving

    def _facts(self) -> Iterator[tuple[str, str]]:
        yield "closed", names(self.closed)
        yield "modes", str(self.modes)
        if self.modes:
            yield "frequencies", f"{self.frequencies[0]:.4g} to {self.frequencies[-1]:.4g} Hz"

    def __getstate__(self) -> dict[str, Any]:
        arrays = {name: getattr(self, name) for name in ARRAYS}  # what is of the core stays: a copy asks it again
        return {"base": self.base, "indices": self.indices, "closed": self.closed, "_moving": None, **arrays}

    @property
    def _of_core(self) -> core.MovingLevel:
        """The level in the core; in a copy it is built again, without measured frequencies, which it does not need."""
        if self._moving is None:
            levels = core.ModalLevels(self.base.core_base, self.modes - self.kept_beyond, math.inf, [])
            self._moving = levels.level(list(self.indices))
        return self._moving

    @property
    def modes(self) -> int:
        """Number of modes r."""
        return len(self.squares)

    @functools.cached_property
    def kept_beyond(self) -> int:
        """Number of modes beyond the requested ones, kept so that no cluster of modes of one frequency is cut."""
        return self._of_core.modal.kept_beyond

    @functools.cached_property
    def squares(self) -> np.ndarray:
        """omega^2 (r,) [rad2/s2], ascending, negative for growing modes."""
        return self._of_core.modal.squares

    @functools.cached_property
    def computed(self) -> np.ndarray:
        """omega^2 (r,) [rad2/s2] computed from M and K; ``squares`` differ where they are overridden."""
        return self._of_core.modal.computed

    @functools.cached_property
    def vectors(self) -> np.ndarray:
        """Modes (m, r) in base coordinates, orthonormal but for what residual contacts bend without inertia."""
        return self._of_core.modal.shapes

    @functools.cached_property
    def inertial(self) -> np.ndarray:
        """The part (m, r) of the modes that has inertia, orthonormal: all of it, but for residual contacts."""
        return self._of_core.modal.inertial

    @functools.cached_property
    def damping(self) -> np.ndarray:
        """Phi_l^T C Phi_l (r, r) [1/s]."""
        return self._of_core.modal.damping

    @functools.cached_property
    def damping_matrix(self) -> np.ndarray:
        """Damping matrix (r, r) [1/s] of the motion, which is D unless contacts slide."""
        return self._of_core.damping_matrix

    @functools.cached_property
    def coupling(self) -> np.ndarray:
        """Coupling (r, r) [rad2/s2] that is added to diag(omega^2), zero unless contacts slide."""
        return self._of_core.coupling

    @functools.cached_property
    def gap_rows(self) -> np.ndarray:
        """Rows (l, r) of all links: gap_i = gap_rows[i].eta + ..."""
        return self._of_core.modal.gaps

    @functools.cached_property
    def force_rows(self) -> np.ndarray:
        """Rows (k, r) that give the forces of the closed contacts from eta,"""
        return self._of_core.forces

    @functools.cached_property
    def force_rate_rows(self) -> np.ndarray:
        """and from eta'."""
        return self._of_core.force_rates

    @functools.cached_property
    def omega(self) -> np.ndarray:
        """Rates (r,) [rad/s] of oscillation, or of growth where ``squares`` is negative."""
        return np.sqrt(np.abs(self.squares))

    @property
    def frequencies(self) -> np.ndarray:
        """Undamped natural frequencies (r,) [Hz]; for a growing mode minus its rate of growth over 2 pi."""
        return np.sign(self.squares) * self.omega / (2 * math.pi)

    @functools.cached_property
    def highest_frequency(self) -> float:
        """Highest natural frequency [Hz], zero without modes."""
        return math.sqrt(self.squares.max(initial=0.0)) / (2 * math.pi)

    @property
    def ratios(self) -> np.ndarray:
        """Damping ratios (r,), diagonal of the projected damping over 2 |omega|; zero for rigid-body modes."""
        doubled = np.where(self.omega > 0, 2 * self.omega, np.inf)
        return np.diagonal(self.damping) / doubled

    @property
    def static_shares(self) -> dict[str, float]:
        """For every closed compliant contact, the part of its flexibility h.K_l^-1 h that the truncated modes have.

        rho = truncated / (truncated + sum |h.psi / omega|^2 over kept modes), 0 to 1, by name; for a force law by the
        law's name. A contact beside a closed rigid contact of the same direction cannot move and is not listed; on a
        residual boundary none is, as they have all of it.
        """
        if not set(self.indices).isdisjoint(self.base.residual):
            return {}
        shares = self._of_core.modal.static_shares(self.modes)
        return {self.base.labels[link]: share for link, share in shares.items()}

    @functools.cached_property
    def shapes(self) -> np.ndarray:
        """Mass-normalised mode shapes (n, r)."""
        return self.base.modes.shapes @ self.vectors

    @functools.cached_property
    def asymptotic_configuration(self) -> np.ndarray:
        """x_inf (n,) [m, rad] without loads."""
        unloaded = self.asymptotic(np.zeros(self.base.modes.count))
        return self.base.modes.shapes @ unloaded.configuration

    @property
    def response(self) -> core.ModalResponse:
        """Closed form of the level's motion, of any duration."""
        return core.modal_response(self.squares, self.damping_matrix, self.coupling)

    def asymptotic(self, load: np.ndarray) -> core.Asymptotic:
        """Return the static response to a load (m,) in base coordinates and to the constant forces of force laws."""
        return self._of_core.asymptotic(load, self.base.gaps)

    def static_response(self, load: np.ndarray, gaps: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return contact forces (k,) and y (m,) in response to a static load (m,) and gaps (k,) of closed contacts."""
        return self._of_core.deflection(load, gaps)

    def plot_modes(self, count: int = 6, rows: np.ndarray | None = None, positions: np.ndarray | None = None) -> Figure:
        """Return a matplotlib figure of the lowest mode shapes, each scaled to 1.

        Parameters
        ----------
        count : int, default 6
            Number of modes to draw.
        rows : array (k, n), default None
            Rows that give the quantities to draw, such as deflections along a beam; None for all degrees of freedom.
        positions : array (k,), default None
            Position of each quantity, in any unit; None for its number.

        Raises
        ------
        MultiPhiValueError
            For arrays of another shape.
        """
        n = self.base.modes.shapes.shape[0]
        shown = np.eye(n) if rows is None else real_array("rows", rows, f"a (k, {n}) array of real numbers")
        if shown.ndim != 2 or shown.shape[1] != n or not len(shown):
            raise MultiPhiValueError(f"rows: got shape {shown.shape}, need (k, {n})")
        places = np.arange(len(shown)) if positions is None else real_array("positions", positions, "a (k,) array")
        if places.shape != (len(shown),):
            raise MultiPhiValueError(f"positions: got shape {places.shape}, need ({len(shown)},)")
        label = ("degree of freedom" if rows is None else "row") if positions is None else "position"
        return mode_figure(shown @ self.shapes[:, :count], self.frequencies[:count], places, label)


ARRAYS = (
    "kept_beyond",
    "squares",
    "computed",
    "vectors",
    "inertial",
    "damping",
    "damping_matrix",
    "coupling",
    "gap_rows",
    "force_rows",
    "force_rate_rows",
)
