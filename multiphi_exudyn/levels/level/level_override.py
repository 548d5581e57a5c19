"""Level override: measured frequencies and damping ratios in place of a level's computed ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.mechanics.arguments import real_array

__all__ = ["LevelOverride"]


@dataclass(frozen=True)
class LevelOverride:
    """Frequencies and damping ratios that replace the computed ones of a level's lowest modes.

    Measured modal data for a level, as in the paper. An overridden level does not follow from one physical (M, C, K):
    its frequencies need not interlace with those of other levels, and a transition into it may raise the energy. Mode
    shapes and static deflections stay the computed ones, also the quasi-static ones under slowly varying loads.

    Parameters
    ----------
    frequencies : sequence of float, default None
        Of the lowest modes [Hz], lowest first, as many as are known; None keeps the computed ones.
    ratios : sequence of float, default None
        Damping ratios of the lowest modes, 0.01 is 1 %; None keeps the computed ones.

    Raises
    ------
    MultiPhiTypeError
        For values that are no real numbers.
    MultiPhiValueError
        For an array of numbers that is no list.

    Examples
    --------
    >>> import numpy as np
    >>> import multiphi_exudyn as mp
    >>> K = 4e4 * np.array([[2, -1, 0], [-1, 2, -1], [0, -1, 1]])  # N/m
    >>> chain = mp.LinearStructure(np.eye(3), K, mp.ModalDamping(0.01), {"tip": 2})
    >>> measured = mp.LevelOverride(frequencies=[14.5])
    >>> model = mp.MultiPhiModel(chain, overrides={(): measured})
    >>> print(model.level(()).frequencies.round(1))
    [14.5 39.7 57.4]
    """

    frequencies: Sequence[float] | None = None
    ratios: Sequence[float] | None = None

    def __post_init__(self) -> None:
        for name in ("frequencies", "ratios"):
            if (numbers := getattr(self, name)) is not None:
                values = real_array(f"level override {name}", numbers, "a list of numbers")
                if values.ndim != 1:
                    raise MultiPhiValueError(f"level override {name}: got shape {values.shape}, need a list of numbers")
                object.__setattr__(self, name, tuple(values.tolist()))

    @property
    def arrays(self) -> tuple[np.ndarray | None, np.ndarray | None]:
        """Frequencies and ratios as arrays (k,), None where the computed ones stay."""
        frequencies, ratios = (None if each is None else np.array(each) for each in (self.frequencies, self.ratios))
        return frequencies, ratios
