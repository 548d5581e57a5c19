"""Transition between levels: the state at an event, expressed in the next level's modes (eq. 38.6).

The paper's "Phi_m^-1" is the M-projection, the best approximation in the kinetic and in the strain energy norm:

    eta_m = T eta_l + c,   eta'_m = T eta'_l,   T = Phi_m^T M Phi_l,   c = Phi_m^T M (x_inf,l - x_inf,m)

T is r x r and computed once for a pair of levels. A transition from an admissible state can
only take energy out (for one physical M, K); what it took is truncation, kinetic and strain. Where truncation has left
a gap that is not zero, the strain part can be negative; the ledger shows it.

In the coordinates xi = (eta, w) channels stay what they are, but for places that links hold. Where a link begins to
hold, q = h.x + gap - w becomes the stretch of the state before: w_m = A xi_l + a. Then

    eta_m = Psi_m^T M (x_l - x_inf,m - R_m w_m)

A rigid contact that closes is an impact first (Moreau, restitution 0), in the basis of a level where it is open:

    v+ = v- + A^T p,   p = argmin |v- + A^T p|,  p >= 0,   A = H^T Phi_l

the admissible velocity (A v+ >= 0) nearest to v- in the kinetic metric; the energy it loses is plastic.
Source: J. J. Moreau, Unilateral contact and dry friction in finite freedom dynamics, CISM 302 (1988).
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.events.excitation.loaded_level import LoadedLevel
from multiphi_exudyn.levels.level.level import Level
from multiphi_exudyn.mathematics.round_off import PRODUCT

__all__ = ["Transition", "modal_projection"]

UNMIXED = 1e-13  # product of two modes, of unit length in either energy, below which they are orthogonal


@dataclass(frozen=True)
class Transition:
    """The map of eq. (38.6) from level ``source`` to level ``target``, in the coordinates xi."""

    source: LoadedLevel
    target: LoadedLevel

    @functools.cached_property
    def matrix(self) -> np.ndarray:
        """T = [[Psi_m^T Psi_l, Psi_m^T (R_l - R_m)], [0, 1]], where no place is set."""
        if not self.source.excitation.channels:
            return modal_projection(self.target.modal, self.source.modal)
        whole, (rows, _) = self._map(self.source.channels.shapes, self._shapes), self._set_channels
        whole[: self._modes] -= self.target.modal.inertial.T @ self._shapes @ rows
        whole[self._modes :] += rows
        return whole

    @functools.cached_property
    def velocity_matrix(self) -> np.ndarray:
        """T' = [[Psi_m^T Psi_l, Psi_m^T (Y_l - Y_m)], [0, 1]]."""
        if not self.source.excitation.channels:
            return self.matrix
        return self._map(self.source.channels.carried, self.target.channels.carried)

    @functools.cached_property
    def offset(self) -> np.ndarray:
        """c (r_m + q,)."""
        jump = self.source.asymptotic.configuration - self.target.asymptotic.configuration
        if not self.source.excitation.channels:
            return np.asarray(self.target.modal.inertial.T @ jump)
        _, constants = self._set_channels
        return np.concatenate([self.target.modal.inertial.T @ (jump - self._shapes @ constants), constants])

    @property
    def _shapes(self) -> np.ndarray:
        """R_m (m, q)."""
        return self.target.channels.shapes

    @property
    def _modes(self) -> int:
        return self.target.modal.modes

    @functools.cached_property
    def _set_channels(self) -> tuple[np.ndarray, np.ndarray]:
        """Additions to w: (q, r_l + q) times xi_l, and (q,): the excess of q over the stretch it is to have."""
        source, excitation = self.source, self.source.excitation
        rows, constants = np.zeros((excitation.channels, len(source.level.squares))), np.zeros(excitation.channels)
        base = source.level.base
        places = {link: k for k, link in enumerate(base.held, start=excitation.prescribed)}
        if not places:
            return rows, constants
        for i, (element, links) in enumerate(zip(base.contacts, base.link_indices, strict=True)):
            before, after = element.states[source.states[i]], element.states[self.target.states[i]]
            for number, link in enumerate(links):
                if link in places and number in after.holds and number not in before.holds:
                    stretch, constant = source.stretch(i)
                    rows[places[link]] = source.level.gap_rows[link] - stretch
                    constants[places[link]] = source.gap_constants[link] - constant
        return rows, constants

    def _map(self, source: np.ndarray, target: np.ndarray) -> np.ndarray:
        """[[Psi_m^T Psi_l, Psi_m^T (source - target)], [0, 1]]; source, target: (m, q)."""
        target_level, source_level, q = self.target.modal, self.source.modal, source.shape[1]
        mapped = np.eye(target_level.modes + q, source_level.modes + q, source_level.modes - target_level.modes)
        mapped[: target_level.modes, : source_level.modes] = modal_projection(target_level, source_level)
        mapped[: target_level.modes, source_level.modes :] = target_level.inertial.T @ (source - target)
        return mapped

    def displacement(self, xi: np.ndarray) -> np.ndarray:
        """xi_m from xi_l."""
        return self.matrix @ xi + self.offset

    def velocity(self, xi_t: np.ndarray) -> np.ndarray:
        """xi'_m from xi'_l."""
        return self.velocity_matrix @ xi_t


def modal_projection(target: Level, source: Level) -> np.ndarray:
    """Return T = Phi_m^T M Phi_l (r_m, r_l), zero where a product is round-off of its modes' lengths in both energies.

    Such a product would give a contact at rest, which no other mode moves, a velocity. The kinetic energy is a sum of
    eta'^2, the strain energy one of (omega eta)^2: there the length of T_ij is |T_ij| omega_i / omega_j, so a small
    share that a stiff mode has in a soft one may count. The modes' own round-off, larger if there are many, is not
    considered.
    """
    products: np.ndarray = target.inertial.T @ source.vectors
    own, other = np.abs(target.squares)[:, None], np.abs(source.squares)
    share = np.sqrt(np.divide(other, own, out=np.ones(products.shape), where=own > other))
    products[np.abs(products) <= np.maximum(PRODUCT, UNMIXED * share)] = 0.0
    return products
