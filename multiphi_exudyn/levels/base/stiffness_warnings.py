"""Stiffness warnings: what the digits of a stiffness matrix leave open of a structure's modes (stiffness_digits.py)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import scipy.sparse

from multiphi_exudyn.display import per_cent
from multiphi_exudyn.mathematics.modes import ROUND_OFF, Modes, round_off_energy
from multiphi_exudyn.mathematics.stiffness_digits import (
    CERTAIN,
    digits_of,
    doubled_product,
    energy_noise,
    has_soft_ground,
    is_exact,
)

__all__ = ["stiffness_warnings"]

UNCERTAIN = 1e-3  # of omega^2: what the digits may leave open without a warning
FEW_UNITS = 0.1  # of omega^2: the same for exact numbers, as so few units of the last bit may be exact by chance
RESOLVED = 8.0  # times what the digits leave open: assembled free structures have at most 2
SHAPES = 0.02  # of the energy that counts as round-off: what the round-off of rigid-body shapes stays below
LOWEST = 8  # elastic modes that are judged: higher ones are stiffer


def stiffness_warnings(stiffness: Any, modes: Modes) -> Iterator[str]:
    """Warnings of rigid-body modes of a K (n, n) of few digits, and of frequencies that its digits leave open."""
    digits, rigid = digits_of(stiffness), modes.shapes[:, : modes.rigid]
    elastic = slice(modes.rigid, modes.rigid + LOWEST)
    omega, shapes = modes.omega[elastic], modes.shapes[:, elastic]
    if digits is not None and modes.rigid:
        squares = np.abs(np.einsum("ij,ij->j", rigid, stiffness @ rigid))
        if np.any(squares > round_off_energy(stiffness, rigid)):
            first = f", far below the first other of {omega[0] / 2 / math.pi:.4g} Hz" if len(omega) else ""
            yield (
                f"digits: the stiffness has {digits.name}, which leave {modes.rigid} rigid-body modes up to "
                f"{math.sqrt(np.max(squares)) / 2 / math.pi:.2g} Hz{first}; they are taken as free; if a soft "
                "suspension holds the structure, give the stiffness with all its digits"
            )
    if digits is None and modes.rigid and (scipy.sparse.issparse(stiffness) or not is_exact(stiffness)):
        squares = np.einsum("ij,ij->j", rigid, doubled_product(stiffness, rigid))
        least = np.maximum(RESOLVED * energy_noise(stiffness, rigid), SHAPES * round_off_energy(stiffness, rigid))
        if np.any(squares > least) or (np.any(squares > 0) and has_soft_ground(stiffness, rigid)):
            yield (
                f"digits: a mode of {math.sqrt(np.max(squares)) / 2 / math.pi:.3g} Hz, the difference of far stiffer "
                "springs, is taken as a rigid-body one, as 16 digits of the stiffness hardly hold it; tie rigidly what "
                "these springs connect"
            )
    largest = round_off_energy(stiffness, shapes) / ROUND_OFF
    if digits is None and np.all(largest * np.finfo(float).eps <= UNCERTAIN * omega**2):
        return
    are_sums = digits is None and is_exact(stiffness, CERTAIN)
    shares = energy_noise(stiffness, shapes, digits) / omega**2
    worst = int(np.argmax(shares)) if len(shares) else 0
    if len(shares) and shares[worst] > (FEW_UNITS if are_sums else UNCERTAIN):
        yield (
            f"digits: the stiffness has {'16 digits' if digits is None else digits.name}, which give the frequency "
            f"{omega[worst] / 2 / math.pi:.4g} Hz only to {per_cent(float(shares[worst]) / 2)}, as it is the "
            "difference of far stiffer springs; give more digits, or tie rigidly what these springs connect"
        )
