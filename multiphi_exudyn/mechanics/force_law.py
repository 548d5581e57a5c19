"""Force law: a local continuous nonlinearity as one element, whose state is its segment.

    force on the structure -F(q) along p,   q = p.x

F is followed by straight segments between knots on the law itself. q_m, its centre, is the zero of F nearest to q = 0,
without any the place nearest to q = 0. From the segment at q_m, of slope k_m,

    F(q) = F(q_m) + k_m (q - q_m) + sum_j dk_j max(0, q - q_j) - sum_j dk'_j max(0, q'_j - q),   q_j >= q_m >= q'_j

dk_j [N/m] is the change of slope at a knot, negative where the law softens. So the element has a link for k_m and one
for each dk_j (element.py), and its states are nested: in segment +i those of the first i knots above q_m hold, in -i
those below. Each has two exits, where q reaches one end of the segment or the other, into the next. Knots where the
slope does not change are left out. F(q_m) is a constant force of every level. Strain energy is the integral of the
segmented law from q_m. Beyond the span its last segments go on.

Where the knots stand is in law_lines.py.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.mechanics.element import TAKEN_ONCE, ElementState, Exit, Link, Share
from multiphi_exudyn.mechanics.law_lines import Function, LawLines
from multiphi_exudyn.mechanics.structure import At

__all__ = ["ForceLaw"]

STRAIGHT = 1e-12  # of the largest slope: a smaller change of slope is round-off


@dataclass(frozen=True, eq=False)
class ForceLaw:
    """A local continuous force-displacement law as a chain of levels.

        force on the structure -F(q) along p,   q = p.x

    F is followed by straight segments between knots that lie on it. The segment that q is in is the law's state: "0" at
    q_m, the zero of F nearest to q = 0, "+1", "+2", ... above it, "-1", "-2", ... below. Beyond the span its last
    segments go on. ``contact_force`` of a law is -F, ``gap`` is q - q_m. Two laws are equal only if they are the same
    object.

    Parameters
    ----------
    at : str, mapping or array (n,)
        p, along which it acts: a point name, {point: coefficient} or a row.
    law : callable, or two arrays (k,)
        F [N] as a function of q [m], of a number or of (k,) numbers; or a table, q [m] ascending and F [N], whose lines
        are the segments.
    tolerance : float, default None
        Of a function: largest error of the segments, of the largest absolute F on the span; 0 < tolerance < 1.
    name : str, default "law"
        How levels and results refer to it.
    span : (float, float), default None
        Of a function: (q_lo, q_hi) [m] on which it is followed.
    segments : int, default None
        Of a function, instead of a tolerance: number of segments.

    Attributes
    ----------
    knots, forces : array (k,)
        Ends of the segments [m] and F [N] there.
    centre : float
        q_m [m].
    error : float
        Of the segments, relative as the tolerance is.

    Raises
    ------
    MultiPhiTypeError
        For arguments of another kind, and a function that does not give numbers.
    MultiPhiValueError
        For a table that is not ascending, a law that is constant or not finite, and a span, a tolerance or a number of
        segments that is missing, given twice or out of range.

    Examples
    --------
    A cubic spring at the end of the chain, to 1 % of its largest force:

    >>> import numpy as np
    >>> import multiphi_exudyn as mp
    >>> K = 4e4 * np.array([[2, -1, 0], [-1, 2, -1], [0, -1, 1]])  # N/m
    >>> chain = mp.LinearStructure(np.eye(3), K, mp.ModalDamping(0.01), {"tip": 2})
    >>> cubic = mp.ForceLaw("tip", lambda q: 1e9 * q**3, tolerance=0.01, span=(-0.01, 0.01))
    >>> cubic.levels, cubic.error <= 0.01
    (12, True)
    >>> model = mp.MultiPhiModel(chain, [cubic])
    >>> mp.simulate(model, 0.1, velocity=np.array([0.0, 0.0, 0.5])).status
    'ok'
    """

    at: At
    law: Function | Sequence[Any]
    tolerance: float | None = None
    name: str = "law"
    span: tuple[float, float] | None = None
    segments: int | None = None
    knots: np.ndarray = field(init=False, repr=False)
    forces: np.ndarray = field(init=False, repr=False)
    centre: float = field(init=False, repr=False)
    error: float = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name:
            raise MultiPhiTypeError(f"force law name: got {self.name!r}, need a non-empty string")
        given = LawLines(f"force law {self.name!r}", self.law, self.tolerance, self.span, self.segments)
        knots, forces, centre, error = given.found()
        slopes = np.diff(forces) / np.diff(knots)
        if not np.any(slopes):
            raise MultiPhiValueError(
                f"force law {self.name!r} law: got a constant force, need one that changes with q (or a ConstantLoad)"
            )
        for name, value in (("knots", knots), ("forces", forces), ("centre", centre), ("error", error)):
            object.__setattr__(self, name, value)

    def force(self, q: float | np.ndarray) -> np.ndarray:
        """The segmented law at q, (k,) [N]."""
        lines = np.clip(np.searchsorted(self.knots, q, side="right") - 1, 0, len(self.knots) - 2)
        return np.asarray(self.forces[lines] + self.slopes[lines] * (q - self.knots[lines]))

    def energy(self, q: float | np.ndarray) -> np.ndarray:
        """Integral of the segmented law from q_m to q, (k,) [J]."""
        total = self.constant * (q - self.centre) + 0.5 * self.stiffness * (q - self.centre) ** 2
        for side, links in ((1, self._above), (-1, self._below)):
            for link in links:
                total += 0.5 * link.stiffness * np.minimum(0.0, link.gap - side * q) ** 2
        return np.asarray(total)

    @functools.cached_property
    def slopes(self) -> np.ndarray:
        """Stiffness of the segments (k - 1,) [N/m]."""
        return np.asarray(np.diff(self.forces) / np.diff(self.knots))

    @property
    def constant(self) -> float:
        """F(q_m) [N]."""
        return float(self.force(self.centre))

    # ------------------------------------------------------------------ element

    damping: ClassVar[float] = 0.0
    velocity: ClassVar[float] = 0.0
    drop: ClassVar[float] = 0.0
    rigid: ClassVar[bool] = False
    held: ClassVar[bool] = False

    @property
    def direction(self) -> At:
        """p."""
        return self.at

    @property
    def gap(self) -> float:
        """-q_m [m]."""
        return -self.centre

    @functools.cached_property
    def stiffness(self) -> float:
        """k_m [N/m], of the softer segment where two meet at q_m."""
        return float(self.slopes[self._central])

    @functools.cached_property
    def _central(self) -> int:
        """The number of its segment."""
        place, last = int(np.searchsorted(self.knots, self.centre)), len(self.slopes) - 1
        beside = min(place, last), max(place - 1, 0)
        return min(beside, key=lambda k: abs(self.slopes[k]))

    @property
    def levels(self) -> int:
        """Number of levels it makes: segments of different slope."""
        return len(self.states)

    @property
    def knots_beside(self) -> tuple[int, int]:
        """Number of knots where the slope changes, above segment "0" and below it."""
        return len(self._above), len(self._below)

    @property
    def further(self) -> tuple[Link, ...]:
        """A link for every change of slope: those above q_m from it outward, then those below it."""
        return (*self._above, *self._below)

    @functools.cached_property
    def _above(self) -> tuple[Link, ...]:
        m = self._central
        return self._chain("+", np.diff(self.slopes[m:]), self.knots[m + 1 : -1])

    @functools.cached_property
    def _below(self) -> tuple[Link, ...]:
        m = self._central
        return self._chain("-", np.diff(self.slopes[m::-1]), self.knots[m:0:-1])

    def _chain(self, sign: str, changes: np.ndarray, places: np.ndarray) -> tuple[Link, ...]:
        bent, side = np.abs(changes) > STRAIGHT * np.max(np.abs(self.slopes)), float(f"{sign}1")
        return tuple(
            Link(f"{self.name}{sign}{i}", _times(self.at, -side), side * float(q), float(k))
            for i, (k, q) in enumerate(zip(changes[bent], places[bent], strict=True), start=1)
        )

    @functools.cached_property
    def states(self) -> tuple[ElementState, ...]:
        """The segments: that at q_m, those above it from there outward, then those below it."""
        up, down = len(self._above), len(self._below)
        return tuple(self._segment(i) for i in (*range(up + 1), *range(-1, -down - 1, -1)))

    def _segment(self, i: int) -> ElementState:
        """Segment i, with the links of those between it and q_m."""
        chain = range(1, i + 1) if i > 0 else range(len(self._above) + 1, len(self._above) + 1 - i)
        own = (0,) if self.stiffness else ()
        return ElementState(_called(i), "segment", tuple(self._ways(i)), holds=(*own, *chain))

    def _ways(self, i: int) -> Iterator[Exit]:
        """Out of segment i: outward where the next link's gap closes, inward where that of the last one opens."""
        up, down = len(self._above), len(self._below)
        for side, first, count in ((1, 1, up), (-1, up + 1, down)):
            if 0 <= side * i < count:
                yield _exit(i + side, first + abs(i), 1.0)
            if side * i > 0:
                yield _exit(i - side, first + abs(i) - 1, -1.0)

    def first_state(self, gap: float, rate: float, *rates: float) -> str:
        """The segment in which a run starts that begins with q - q_m [m]."""
        q = self.centre + gap
        return _called(sum(q > link.gap for link in self._above) - sum(-q > link.gap for link in self._below))


def _called(segment: int) -> str:
    """The name of the state."""
    return f"{segment:+d}" if segment else "0"


def _exit(into: int, link: int, side: float) -> Exit:
    """The exit into a segment where a link's gap falls through zero, or rises through it for a side of -1."""
    return Exit(_called(into), firmness=TAKEN_ONCE, further=(Share(link, gap=side),))


def _times(at: At, factor: float) -> At:
    """factor p."""
    if isinstance(at, str):
        return {at: factor}
    if isinstance(at, Mapping):
        return {name: factor * coefficient for name, coefficient in at.items()}
    return factor * np.asarray(at)
