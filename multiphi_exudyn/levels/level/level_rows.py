"""Rows of a level: from its modes the gaps, the damping matrix and the forces of closed contacts.

Each direction of positive stiffness added interlaces: omega_i(open) <= omega_i(level) <= omega_i+c(open), one of
negative stiffness downwards; asserted here. The rows follow from the modes in core/level_rows.hpp.
"""

from __future__ import annotations

import numpy as np

import multiphi_exudyn._core as core
from multiphi_exudyn.errors import NumericalFailure
from multiphi_exudyn.levels.base.modal_base import INTERLACING, ModalBase

__all__ = ["level_rows"]


def level_rows(
    base: ModalBase,
    closed: list[int],
    stiffnesses: np.ndarray,
    squares: np.ndarray,
    vectors: np.ndarray,
    accuracy: float,
) -> core.LevelRows:
    """Return the rows of a level of omega^2 (r,) and modes (m, r), whose signs become unique.

    closed: links, of which rigid ones are independent. stiffnesses: of all closed directions. accuracy: mu, which
    limits that of omega^2. Raises NumericalFailure for omega^2 that violate the interlacing theorem.
    """
    if not _interlaces(base, stiffnesses, squares, INTERLACING * accuracy):
        raise NumericalFailure(
            "level: its modes are not accurate (interlacing violated); are units and magnitudes of mass and stiffness "
            "right?"
        )
    rigid = [place for place, link in enumerate(closed) if base.links[link].rigid]
    modes, damped, gaps = vectors.T, base.damped(vectors, closed).T, base.directions.T @ vectors
    return core.level_rows(
        *base.observed_rows, base.squares, base.restoring, closed, rigid, squares, modes, damped, gaps, modes @ damped.T
    )


def _interlaces(base: ModalBase, stiffnesses: np.ndarray, squares: np.ndarray, slack: float) -> bool:
    """Return whether omega^2 (r,) lie between those of the base, but for the slack."""
    (lowest, highest), r = base.square_bounds, len(squares)
    stiffening, softening = np.count_nonzero(stiffnesses > 0), np.count_nonzero(stiffnesses < 0)
    highest = highest[stiffening : stiffening + r]
    is_above = squares[softening:] >= lowest[: max(r - softening, 0)] - slack
    return bool(np.all(is_above) and np.all(squares[: len(highest)] <= highest + slack))
