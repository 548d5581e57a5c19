"""Choice of modes: how many a level has, where it is not said by a number.

UpTo         all up to a cut-off frequency
Tolerance    as many as a truncation error of the run needs (truncation.py)
None         as many as hold the static response of contacts and points, a choice made without a run:
             all of them up to SMALL degrees of freedom, else the smallest r, FEWEST <= r <= MOST, with

    rho = 1 - (sum over r modes of (h.psi / omega)^2) / (h.K_l^-1 h) < CONTACT_SHARE

in the level l that every compliant contact makes alone, for a force law in that of its largest stiffness, and

    1 - (sum over r modes of (p.phi / Omega)^2) / (p.K^-1 p) <= POINT_SHARE

in the open level for every named point, rigid-body modes left out. A closed rigid contact does not move, so nothing is
said of it by a static response: with one r is at least RIGID. Friction on a spring is a compliant contact that sticks,
and with RIGID modes it has enough as well: its force keeps below its limit. Where the base does not hold all modes it
is that of FIRST modes; contacts, not points, may ask for twice as many, until it serves them.
"""

from __future__ import annotations

import bisect
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.levels.level import Level
from multiphi_exudyn.levels.modal_base import ModalBase
from multiphi_exudyn.mechanics.arguments import is_real
from multiphi_exudyn.mechanics.structure import LinearStructure

__all__ = ["CONTACT_SHARE", "FIRST", "MOST", "SMALL", "TRIED", "Tolerance", "UpTo", "chosen_modes", "is_count"]

SMALL = 30  # degrees of freedom up to which all modes are kept: they cost less than a choice
FEWEST = 6  # modes: a start or a load may move what no contact and no point tells of
RIGID = 12  # modes beside a rigid stop, where the error of the rig's displacements is 1 % and hardly falls with more
FIRST = 22  # modes that an incomplete base is built for before more are known to be needed
TRIED = 12  # the same where runs of a Tolerance say what is needed: mostly fewer, else twice as many
MOST = 60  # modes: levels beyond it take longer than most models are worth
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
        Modes that a level is given at most.

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
    """Choice of modes: as many as a wanted truncation error of a run needs, decided by the first run of the model.

    Parameters
    ----------
    error : float
        The wanted ``truncation_indicator``, an estimate of the relative error of displacements; 0.01 is 1 %.
    most : int, default 60
        Modes that a level is given at most.

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


def chosen_modes(
    structure: LinearStructure,
    base: ModalBase,
    level: Callable[[tuple[int, ...], int], Level],
) -> int:
    """The number of modes r for ``None``; see the module's docstring. More than the base serves: to choose anew there.

    level: of links that hold by their positions, with its lowest so many modes at least or all that it has.
    """
    count = max(FEWEST, base.modes.rigid + 1)
    if any(link.rigid for link in base.links):
        count = max(count, RIGID)
    rows = np.array([structure.row(name) for name in structure.points]).reshape(-1, structure.n)
    of_points = _of_points(base, rows @ base.modes.shapes)
    count = max(count, of_points if base.complete else min(of_points, FIRST))
    most = min(MOST, base.served)
    for closed in _alone(base):
        bound = most if not base.links[closed[0]].held else min(most, max(count, RIGID))
        count = count if count >= bound else _of_contact(level, closed, count, bound)
        if bound == count == base.served and not base.complete and not _held(level(closed, count).truncated(count)):
            return min(2 * count, MOST)
    return min(count, most)


def _of_points(base: ModalBase, rows: np.ndarray) -> int:
    """Smallest number of modes that hold the flexibility at the points (k, m) but for POINT_SHARE."""
    elastic = base.modes.omega > 0
    flexibility = (rows[:, elastic] / base.modes.omega[elastic]) ** 2
    held = np.cumsum(flexibility, axis=1)
    missing = held[:, -1:] - held > POINT_SHARE * held[:, -1:]
    return base.modes.rigid + 1 + int(np.max(np.sum(missing, axis=1), initial=0))


def _alone(base: ModalBase) -> list[tuple[int, ...]]:
    """Positions of links that hold: every compliant element's first one alone, a force law's where it is stiffest."""
    single = [(i,) for i, element in enumerate(base.contacts) if i not in base.laws and not element.rigid]
    return single + [links for links in (_stiffest(base, i) for i in base.laws) if links]


def _stiffest(base: ModalBase, law: int) -> tuple[int, ...]:
    """The links that hold in the stiffest segment of a force law."""
    places = base.link_indices[law]
    segments = [tuple(places[k] for k in state.holds) for state in base.laws[law].states]
    return max(segments, key=lambda links: float(np.sum(base.stiffnesses[list(links)])))


def _of_contact(level: Callable[[tuple[int, ...], int], Level], closed: tuple[int, ...], fewest: int, most: int) -> int:
    """Smallest number of modes from ``fewest`` on that hold the flexibility of closed contacts, ``most`` where none."""
    asked = min(max(FIRST, fewest), most)
    while asked < most and not _held(level(closed, asked).truncated(asked)):
        asked = min(2 * asked, most)
    found = level(closed, asked)
    counts = range(fewest, asked)
    return fewest + bisect.bisect_left(counts, True, key=lambda r: _held(found.truncated(r)))


def _held(level: Level) -> bool:
    return max(level.static_shares.values(), default=0.0) < CONTACT_SHARE


def is_count(value: object) -> bool:
    """Whether a value is a whole number."""
    return is_real(value) and isinstance(value, (int, np.integer))


def _check_limits(given: UpTo | Tolerance, name: str, value: float, most: int) -> None:
    kind = type(given).__name__
    if not is_real(value) or not is_count(most):
        raise MultiPhiTypeError(f"{kind}: got {value!r} and {most!r}, need a number and an integer")
    largest = math.inf if isinstance(given, UpTo) else 1.0
    if not (0 < value < math.inf and value <= largest and most >= 1):
        limits = f"{name} > 0" if isinstance(given, UpTo) else f"0 < {name} <= 1 (0.01 is 1 %)"
        raise MultiPhiValueError(f"{kind}: got {name} {value!r} and most {most}, need {limits} and most >= 1")
