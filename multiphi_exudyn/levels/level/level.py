"""Level: the linear system that holds while a set of contacts is closed, in its own modes (eqs. 38.2 to 38.5).

    x = Phi_l eta + x_inf,l                                                           (38.4)
    eta'' + Phi_l^T C Phi_l eta' + diag(omega_l^2) eta = Phi_l^T (f - f_static)       (38.3)

The asymptotic configuration x_inf,l is the static response to gaps and static loads (static_response.py). Where no
closed contact resists a rigid-body motion, the load along it accelerates the level's zero-frequency modes. The total
stiffness of a force law may be negative, and the level indefinite: then omega^2 < 0, the square of a rate of growth
(eta ~ exp(+-|omega| t)).
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

import multiphi_exudyn._core as core
from multiphi_exudyn.display import Shown, names
from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.levels.base.closed_directions import ClosedDirections
from multiphi_exudyn.levels.base.modal_base import ModalBase
from multiphi_exudyn.levels.level.level_override import LevelOverride
from multiphi_exudyn.levels.level.mode_figure import mode_figure
from multiphi_exudyn.levels.level.static_response import (
    Asymptotic,
    gaps_and_strain,
    response_of_neutral_level,
    static_response,
)
from multiphi_exudyn.mathematics.modes import cluster_end
from multiphi_exudyn.mathematics.round_off import BALANCED, SLOW, ZERO, drop_round_off
from multiphi_exudyn.mechanics.arguments import real_array

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Level"]


@dataclass(frozen=True, repr=False)
class Level(Shown):
    """The linear system that holds while a set of contacts is closed, in its own r modes.

        x = Phi_l eta + x_inf,l                                                           (38.4)
        eta'' + Phi_l^T C Phi_l eta' + diag(omega_l^2) eta = Phi_l^T (f - f_static)       (38.3)

    Made by ``MultiPhiModel.level``. The arrays are in base coordinates (m,), which all levels of a model share;
    ``shapes`` and ``asymptotic_configuration`` are in structural coordinates (n,). Springs of a force law may be
    negative: then some omega^2 < 0, the square of a rate of growth, eta ~ exp(+-|omega| t).

    Attributes
    ----------
    closed : tuple of str
        Names of its closed contacts; of a force law, of the links that its segment has beside those of segment "0".
    indices : tuple of int
        Positions in the base of all active links.
    base : ModalBase
        The coordinates that all levels share.
    squares : array (r,)
        omega^2 [rad2/s2], ascending, negative for growing modes.
    vectors : array (m, r)
        Modes in base coordinates, orthonormal but for a bending.
    damping : array (r, r)
        Phi_l^T C Phi_l [1/s].
    gap_rows : array (c, r)
        gap_i = gap_rows[i].eta + ... for every contact of the model.
    following : array (c,)
        Whether the closed rigid contacts alone determine a contact's gap, so that loads do not change it.
    speed_rows : array (c, r)
        gap_i' = speed_rows[i].eta' for impacts, without the quasi-static part of varying loads (events/channels).
    force_rows, force_rate_rows : array (k, r)
        They give the forces of the closed contacts from eta and eta'.
    neutral : array (m, z)
        The zero-frequency modes if negative springs cancel the stiffness of a mode, else z = 0.
    computed : array (r,)
        omega^2 [rad2/s2] computed from M and K; ``squares`` differ where they are overridden.
    kept_beyond : int
        Number of modes beyond the requested ones, kept so that no cluster of modes of one frequency is cut.
    bending : array (m, r) or None
        The part of ``vectors`` without inertia, of contacts on a residual boundary; None for none.

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

    closed: tuple[str, ...]
    indices: tuple[int, ...]
    base: ModalBase
    squares: np.ndarray
    vectors: np.ndarray
    damping: np.ndarray
    gap_rows: np.ndarray
    following: np.ndarray
    speed_rows: np.ndarray
    force_rows: np.ndarray
    force_rate_rows: np.ndarray
    neutral: np.ndarray
    computed: np.ndarray
    kept_beyond: int
    bending: np.ndarray | None

    def __getstate__(self) -> dict[str, Any]:
        return {key: value for key, value in vars(self).items() if key != "response"}  # of the core: a copy asks again

    def _facts(self) -> Iterator[tuple[str, str]]:
        yield "closed", names(self.closed)
        yield "modes", str(self.modes)
        if self.modes:
            yield "frequencies", f"{self.frequencies[0]:.4g} to {self.frequencies[-1]:.4g} Hz"

    @property
    def modes(self) -> int:
        """Number of modes r."""
        return len(self.squares)

    @functools.cached_property
    def inertial(self) -> np.ndarray:
        """The part (m, r) of the modes that has inertia, orthonormal: all of it without a bending."""
        return self.vectors if self.bending is None else self.vectors - self.bending

    @functools.cached_property
    def vibrates(self) -> bool:
        """Whether no mode has zero frequency."""
        return int(np.count_nonzero(self.squares)) == len(self.squares)

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
    def coupling(self) -> np.ndarray:
        """Coupling (r, r) [rad2/s2] that is added to diag(omega^2), zero unless contacts slide."""
        return np.zeros((self.modes, self.modes))

    @property
    def damping_matrix(self) -> np.ndarray:
        """Damping matrix (r, r) [1/s] of the motion, which is D unless contacts slide."""
        return self.damping

    @functools.cached_property
    def static_shares(self) -> dict[str, float]:
        """For every closed compliant contact, the part of its flexibility h.K_l^-1 h that the truncated modes have.

        rho = truncated / (truncated + sum |h.psi / omega|^2 over kept modes), 0 to 1, by name; for a force law by the
        law's name. A contact beside a closed rigid contact of the same direction cannot move and is not listed; on a
        residual boundary none is, as they have all of it.
        """
        base = self.base
        if self.bending is not None:
            return {}
        closed_directions = base.closed_at(self.indices).orthogonal
        springs, flexibilities = np.flatnonzero(~closed_directions.rigid), self._flexibilities(closed_directions)
        names = [base.labels[closed_directions.members[s][0]] for s in springs.tolist()]
        rows = closed_directions.vectors[:, springs].T
        open_flexibility = np.sum((rows * base.periods) ** 2, axis=1)
        kept = (rows @ self.vectors) ** 2 / np.where(self.computed == 0, np.inf, self.computed)
        truncated = np.maximum(flexibilities[springs] - np.sum(kept, axis=1), 0.0)
        whole = truncated + np.sum(np.abs(kept), axis=1)
        moving = whole > ZERO * open_flexibility  # else rigid contacts hold the gap, but for round-off
        shares = np.divide(truncated, whole, out=np.zeros(len(truncated)), where=moving)
        return dict(zip(names, shares.tolist(), strict=True))

    def _flexibilities(self, closed_directions: ClosedDirections) -> np.ndarray:
        """Return p.K_l^-1 p (d,) along springs: (1/K) (1/K + F)^-1 F, F = P^T Omega^-2 P, P of all closed contacts."""
        stiffness, vectors = closed_directions.stiffness, closed_directions.vectors
        if self.base.modes.rigid or np.any(stiffness == 0):
            gaps = np.zeros(len(self.indices))
            return np.array([row @ self.static_response(row, gaps)[1] for row in vectors.T])
        free = vectors.T @ (self.base.compliance[:, None] * vectors)
        compliances = 1 / stiffness
        if len(compliances) == 1:
            return np.asarray(compliances * free[0] / (free[0] + compliances))
        return np.asarray(compliances * np.diagonal(np.linalg.solve(free + np.diag(compliances), free)))

    @functools.cached_property
    def shapes(self) -> np.ndarray:
        """Mass-normalised mode shapes (n, r)."""
        return self.base.modes.shapes @ self.vectors

    @functools.cached_property
    def asymptotic_configuration(self) -> np.ndarray:
        """x_inf (n,) [m, rad] without loads."""
        unloaded = self.asymptotic(np.zeros(self.base.modes.count))
        return self.base.modes.shapes @ unloaded.configuration

    @functools.cached_property
    def response(self) -> core.ModalResponse:
        """Closed form of the level's motion, of any duration."""
        return core.modal_response(self.squares, self.damping_matrix, self.coupling)

    def response_within(self, duration: float) -> core.ModalResponse:
        """Return the closed form of motions of at most ``duration`` [s], also with slowly damped rigid-body modes."""
        if self.vibrates:
            return self.response
        rates = np.abs(self.response.basis.rates)
        if not np.any((rates != 0) & (rates <= SLOW / duration)):
            return self.response
        return core.modal_response(self.squares, self.damping_matrix, self.coupling, duration)

    def truncated(self, count: int) -> Level:
        """Return a level with the lowest ``count`` modes of this one, and those that complete a cluster.

        It is this one if this one was truncated to as many.
        """
        if count == self.modes - self.kept_beyond:
            return self
        modes = cluster_end(self.squares, count) or self.modes
        return Level(
            closed=self.closed,
            indices=self.indices,
            base=self.base,
            squares=self.squares[:modes],
            vectors=self.vectors[:, :modes],
            damping=self.damping[:modes, :modes],
            gap_rows=self.gap_rows[:, :modes],
            following=self.following,
            speed_rows=self.speed_rows[:, :modes],
            force_rows=self.force_rows[:, :modes],
            force_rate_rows=self.force_rate_rows[:, :modes],
            neutral=self.neutral,
            computed=self.computed[:modes],
            kept_beyond=modes - count,
            bending=None if self.bending is None else self.bending[:, :modes],
        )

    def overridden(self, override: LevelOverride) -> Level:
        """Return the level with the same mode shapes and the frequencies and damping ratios of an override."""
        squares, damping = self.squares.copy(), self.damping.copy()
        if override.frequencies is not None:
            omega = 2 * math.pi * np.asarray(override.frequencies, dtype=float)[: self.modes]
            squares[: len(omega)] = omega**2
        if override.ratios is not None:
            ratios = np.asarray(override.ratios, dtype=float)[: self.modes]
            damping[: len(ratios), :] = damping[:, : len(ratios)] = 0.0
            doubled = 2 * np.sqrt(np.abs(squares[: len(ratios)]))
            damping[np.arange(len(ratios)), np.arange(len(ratios))] = ratios * doubled
        return replace(self, squares=squares, damping=damping)

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

    def asymptotic(self, load: np.ndarray) -> Asymptotic:
        """Return the static response to a load (m,) in base coordinates and to the constant forces of force laws."""
        base, index = self.base, list(self.indices)
        closed_directions = base.closed_at(self.indices)
        along, configuration, unbalanced = self._response(closed_directions, load + base.preload)
        gaps, strain = gaps_and_strain(base, configuration, index, self.following)
        return Asymptotic(
            configuration=configuration,
            gaps=gaps,
            forces=base.contact_forces(index, closed_directions, along, gaps),
            drive=np.zeros(self.modes) if self.vibrates else np.where(self.squares, 0.0, self.vectors.T @ unbalanced),
            load=load,
            strain=strain,
        )

    def static_response(self, load: np.ndarray, gaps: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return contact forces (k,) and y (m,) in response to a static load (m,) and gaps (k,) of closed contacts."""
        base, index, initial = self.base, list(self.indices), np.zeros(len(self.base.links))
        initial[index] = gaps
        closed_directions = base.closed_directions(index, gaps)
        along, configuration, _ = self._response(closed_directions, load)
        return base.contact_forces(index, closed_directions, along, base.gaps_at(configuration, initial)), configuration

    def driving_force(self, load: np.ndarray, gaps: np.ndarray) -> np.ndarray:
        """Return the force (r,) that ``static_response`` leaves on zero-frequency modes, zero on the others."""
        if self.vibrates:
            return np.zeros(self.modes)
        closed_directions = self.base.closed_directions(list(self.indices), gaps)
        along, _, unbalanced = self._response(closed_directions, load)
        sizes = np.abs(self.vectors).T @ (np.abs(load) + np.abs(closed_directions.vectors) @ np.abs(along))
        driving = drop_round_off(self.vectors.T @ unbalanced, BALANCED / ZERO * sizes)
        return np.where(self.squares, 0.0, driving)

    def _response(
        self, closed_directions: ClosedDirections, total: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return (f, y, force on zero-frequency modes) of the static response to a load (m,)."""
        if self.neutral.size:
            return response_of_neutral_level(self.base, closed_directions, self.neutral, total, self.closed)
        along, configuration = static_response(self.base, closed_directions, total)
        if self.vibrates:
            return along, configuration, total
        return along, configuration, total + closed_directions.vectors @ along
