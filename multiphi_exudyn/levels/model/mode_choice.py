"""Choice of modes: the number of modes of a level, where it is not given as a number.

UpTo         all up to a cut-off frequency
Tolerance    as many as a truncation error of the run needs, confirmed by runs with more (truncation.py)
None         as many as represent the static response of contacts and points, chosen without a run:
             all of them up to SMALL degrees of freedom, else the smallest r, FEWEST <= r <= MOST, with

    rho = 1 - (sum over r modes of (h.psi / omega)^2) / (h.K_l^-1 h) < CONTACT_SHARE

in the level l of every compliant contact closed alone, for a force law in its stiffest segment, and

    1 - (sum over r modes of (p.phi / Omega)^2) / (p.K^-1 p) <= POINT_SHARE

in the open level for every named point, without rigid-body modes. A closed rigid contact does not move, so its static
response gives no criterion: with one r is at least RIGID. Sticking friction on a spring is a compliant contact; RIGID
modes are enough for it too, as its force is limited. An incomplete base is built for FIRST modes first; if contacts
need more, not points, the number is doubled until the base is large enough.
"""

from __future__ import annotations

import bisect
import math
from dataclasses import dataclass

import numpy as np

import multiphi_exudyn._core as core
from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.levels.base.modal_base import ModalBase
from multiphi_exudyn.mechanics.arguments import is_real
from multiphi_exudyn.mechanics.structure import LinearStructure

__all__ = ["CONTACT_SHARE", "FIRST", "MOST", "SMALL", "TRIED", "Tolerance", "UpTo", "choose_mode_count", "is_count"]

SMALL = 30  # degrees of freedom up to which all modes are kept: they cost less than a choice
FEWEST = 6  # modes: initial states and loads may excite modes that contacts and points do not show
RIGID = 12  # modes beside a rigid stop, where the error of the rig's displacements is 1 % and hardly falls with more
FIRST = 22  # modes for which an incomplete base is built first
TRIED = 12  # the same for a Tolerance, whose runs show the number needed: mostly fewer, else twice as many
MOST = 60  # modes: larger levels are too slow for most models
CONTACT_SHARE = 0.1  # of a closed level's flexibility at its contact: peak forces of the rig are right to 1 % below it
POINT_SHARE = 0.01  # of the open level's flexibility at a point


@dataclass(frozen=True)
class UpTo:
    """Choice of modes: every level has its modes up to a cut-off frequency, at least one.

    A closed contact raises frequencies, so no level has more modes than the open one.

    Parameters
    ----------
    frequency : float
        The cut-off [Hz], > 0.
    most : int, default 60
        Largest number of modes of a level.

    Raises
    ------
    MultiPhiTypeError
        For a frequency that is no number, or a ``most`` that is no whole number.
    MultiPhiValueError
        For a frequency that is not finite and > 0, or most < 1.

    Examples
    --------
    >>> import numpy as np
    >>> import multiphi_exudyn as mp
    >>> K = 4e4 * np.array([[2, -1, 0], [-1, 2, -1], [0, -1, 1]])  # N/m
    >>> chain = mp.LinearStructure(np.eye(3), K, mp.ModalDamping(0.01), {"tip": 2})
    >>> model = mp.MultiPhiModel(chain, modes=mp.UpTo(50.0))
    >>> print(model.level(()).frequencies.round(1))
    [14.2 39.7]
    """

    frequency: float
    most: int = MOST

    def __post_init__(self) -> None:
        _check_limits(self, "frequency", self.frequency, self.most)


@dataclass(frozen=True)
class Tolerance:
    """Choice of modes: as many as a given truncation error of a run needs, found by the first run of the model.

    Parameters
    ----------
    error : float
        Largest relative error of displacements; 0.01 is 1 %. Its estimate is the ``truncation_indicator``, confirmed by
        runs with two and four times as many modes.
    most : int, default 60
        Largest number of modes of a level.

    Raises
    ------
    MultiPhiTypeError
        For an error that is no number, or a ``most`` that is no whole number.
    MultiPhiValueError
        For an error that is not > 0 and <= 1, or most < 1.

    Examples
    --------
    >>> import numpy as np
    >>> import multiphi_exudyn as mp
    >>> K = 4e4 * np.array([[2, -1, 0], [-1, 2, -1], [0, -1, 1]])  # N/m
    >>> chain = mp.LinearStructure(np.eye(3), K, mp.ModalDamping(0.01), {"tip": 2})
    >>> model = mp.MultiPhiModel(chain, modes=mp.Tolerance(0.01))
    >>> pulled = model.static_equilibrium({"tip": 100.0})
    >>> tr = mp.simulate(model, 0.5, displacement=pulled)
    >>> model.decided.modes
    'all'
    """

    error: float
    most: int = MOST

    def __post_init__(self) -> None:
        _check_limits(self, "error", self.error, self.most)


def choose_mode_count(structure: LinearStructure, base: ModalBase) -> int:
    """Return the number of modes r for ``None``; see the module's docstring.

    If it is larger than the base allows, the choice has to be repeated with a larger base.
    """
    count = max(FEWEST, base.modes.rigid + 1)
    if any(link.rigid for link in base.links):
        count = max(count, RIGID)
    rows = np.array([structure.row(name) for name in structure.points]).reshape(-1, structure.n)
    point_count = _count_for_points(base, rows @ base.modes.shapes)
    count = max(count, point_count if base.complete else min(point_count, FIRST))
    most = min(MOST, base.most_level_modes)
    for closed in _single_closures(base):
        bound = most if not base.links[closed[0]].held else min(most, max(count, RIGID))
        count = count if count >= bound else _count_for_contact(base, closed, count, bound)
        if (
            bound == count == base.most_level_modes
            and not base.complete
            and not _is_represented(_level(base, closed, count), count)
        ):
            return min(2 * count, MOST)
    return min(count, most)


def _count_for_points(base: ModalBase, rows: np.ndarray) -> int:
    """Return the least number of modes with all but POINT_SHARE of the flexibility at points (k, m)."""
    elastic = base.modes.omega > 0
    flexibility = (rows[:, elastic] / base.modes.omega[elastic]) ** 2
    cumulative = np.cumsum(flexibility, axis=1)
    missing = cumulative[:, -1:] - cumulative > POINT_SHARE * cumulative[:, -1:]
    return base.modes.rigid + 1 + int(np.max(np.sum(missing, axis=1), initial=0))


def _single_closures(base: ModalBase) -> list[tuple[int, ...]]:
    """Return active links of each level to check: the first link of a compliant element, a law's stiffest segment.

    A contact on a residual boundary has its whole flexibility with any number of modes.
    """
    single = [
        (i,) for i, element in enumerate(base.contacts) if not (i in base.laws or i in base.residual or element.rigid)
    ]
    return single + [links for links in (_stiffest(base, i) for i in base.laws) if links]


def _stiffest(base: ModalBase, law: int) -> tuple[int, ...]:
    """Return the active links of the stiffest segment of a force law."""
    places = base.link_indices[law]
    segments = [tuple(places[k] for k in state.holds) for state in base.laws[law].states]
    return max(segments, key=lambda links: float(np.sum(base.stiffnesses[list(links)])))


def _count_for_contact(base: ModalBase, closed: tuple[int, ...], fewest: int, most: int) -> int:
    """Return the least number of modes, ``fewest`` to ``most``, that represent the flexibility of closed contacts."""
    count = min(max(FIRST, fewest), most)
    while count < most and not _is_represented(_level(base, closed, count), count):
        count = min(2 * count, most)
    largest = _level(base, closed, count)
    counts = range(fewest, count)
    return fewest + bisect.bisect_left(counts, True, key=lambda r: _is_represented(largest, r))


def _level(base: ModalBase, closed: tuple[int, ...], count: int) -> core.ModalLevel:
    """Return the level of closed contacts with its lowest ``count`` modes."""
    return core.MovingLevel(base.core_base, list(closed), core.KeptModes(count)).modal


def _is_represented(level: core.ModalLevel, count: int) -> bool:
    """Return whether the first ``count`` modes of a level represent the flexibility of its contacts."""
    return max(level.static_shares(count).values(), default=0.0) < CONTACT_SHARE


def is_count(value: object) -> bool:
    """Whether a value is a whole number."""
    return is_real(value) and isinstance(value, (int, np.integer))


def _check_limits(choice: UpTo | Tolerance, name: str, value: float, most: int) -> None:
    kind = type(choice).__name__
    if not is_real(value) or not is_count(most):
        raise MultiPhiTypeError(f"{kind}: got {value!r} and {most!r}, need a number and an integer")
    largest = math.inf if isinstance(choice, UpTo) else 1.0
    if not (0 < value < math.inf and value <= largest and most >= 1):
        limits = f"{name} > 0" if isinstance(choice, UpTo) else f"0 < {name} <= 1 (0.01 is 1 %)"
        raise MultiPhiValueError(f"{kind}: got {name} {value!r} and most {most}, need {limits} and most >= 1")
