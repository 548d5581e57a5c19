"""Force law: a local continuous nonlinearity as one element, whose state is its segment.

    force on the structure -F(q) along p,   q = p.x

F is approximated by straight segments between knots on the law itself. q_m, its centre, is the zero of F nearest to
q = 0, or without a zero the point of the span nearest to q = 0. From the segment at q_m, of slope k_m,

    F(q) = F(q_m) + k_m (q - q_m) + sum_j dk_j max(0, q - q_j) - sum_j dk'_j max(0, q'_j - q),   q_j >= q_m >= q'_j

dk_j [N/m] is the change of slope at a knot, negative where the law softens. The element has a link for k_m and one for
each dk_j (element.py), and its states are nested: in segment +i the links of the first i knots above q_m act, in -i
those below. Each segment has two exits, at its ends, into the next segments. Knots without a change of slope are left
out. F(q_m) is a constant force of every level. The strain energy is the integral of the segmented law from q_m. Beyond
the span the last segments are continued.

The knots lie on the law, and the zero of F nearest to q = 0 is one of them. piecewise_linear_fit.py determines their
number.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.mathematics.piecewise_linear_fit import MOST_SEGMENTS, spread, with_segments
from multiphi_exudyn.mechanics.arguments import is_real
from multiphi_exudyn.mechanics.element import TAKEN_ONCE, ElementState, Exit, Link, Share
from multiphi_exudyn.mechanics.structure import At

__all__ = ["ForceLaw", "Function", "LawLines"]

STRAIGHT = 1e-12  # of the largest slope: a smaller change of slope is round-off
Function = Callable[[Any], Any]

SAMPLES = 2**14  # of a law on either side of its central knot; knots are samples
ZERO_FORCE = 1e-14  # of the largest force: a smaller one counts as zero


@dataclass(frozen=True, eq=False)
class ForceLaw:
    """A local continuous force-displacement law as a chain of levels.

        force on the structure -F(q) along p,   q = p.x

    F is approximated by straight segments between knots on it. The segment of q is the law's state: "0" at q_m, the
    zero of F nearest to q = 0, "+1", "+2", ... above it, "-1", "-2", ... below. Beyond the span the last segments are
    continued, and a run that goes there has a warning. ``contact_force`` of a law is -F, ``gap`` is q - q_m. Two laws
    are equal only if they are the same object.

    Parameters
    ----------
    at : str, mapping or array (n,)
        p, direction of the force: a point name, {point: coefficient} or a row.
    law : callable, or two arrays (k,)
        F [N] as a function of q [m], a number or (k,) numbers; or a table, q [m] ascending and F [N], whose lines are
        the segments.
    tolerance : float, default None
        For a function: largest error of the segments, relative to the largest |F| on the span; 0 < tolerance < 1. The
        motion is not known to this share: an error of the force shifts the frequency, and the phase drifts for the
        whole run, most where a motion is small on a wide span. A run whose motion it may move by 2 % warns, and names
        a tolerance.
    name : str, default "law"
        Name in levels and results.
    span : (float, float), default None
        For a function: range (q_lo, q_hi) [m] of the segments.
    segments : int, default None
        For a function, instead of a tolerance: number of segments.

    Attributes
    ----------
    knots, forces : array (k,)
        Ends of the segments [m] and F [N] there.
    centre : float
        q_m [m].
    error : float
        Error of the segments, relative as the tolerance.

    Raises
    ------
    MultiPhiTypeError
        For arguments of another kind, and a function that does not give numbers.
    MultiPhiValueError
        For a table that is not ascending, a law that is constant or not finite, and a span, a tolerance or a number of
        segments that is missing, given twice or out of range.

    Examples
    --------
    A cubic spring at the end of the chain, to 1 % of its largest force, which is not 1 % of the motion:

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
        knots, forces, centre, error = self._lines.knots_and_forces()
        slopes = np.diff(forces) / np.diff(knots)
        if not np.any(slopes):
            raise MultiPhiValueError(
                f"force law {self.name!r} law: got a constant force, need one that changes with q (or a ConstantLoad)"
            )
        for name, value in (("knots", knots), ("forces", forces), ("centre", centre), ("error", error)):
            object.__setattr__(self, name, value)

    def force(self, q: float | np.ndarray) -> np.ndarray:
        """Force (k,) [N] of the segmented law at q."""
        lines = np.clip(np.searchsorted(self.knots, q, side="right") - 1, 0, len(self.knots) - 2)
        return np.asarray(self.forces[lines] + self.slopes[lines] * (q - self.knots[lines]))

    def deviation(self, q: np.ndarray) -> np.ndarray:
        """What the segments leave out, F less them, (k,) [N] at q (k,); zero for a table and beyond the span."""
        if self.span is None:
            return np.zeros_like(q)
        inside = np.clip(q, *self.span)
        return np.where(inside == q, self._lines.sampled(inside) - self.force(inside), 0.0)

    @property
    def _lines(self) -> LawLines:
        return LawLines(f"force law {self.name!r}", self.law, self.tolerance, self.span, self.segments)

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
        """k_m [N/m]; of the softer segment if two meet at q_m."""
        return float(self.slopes[self._central])

    @functools.cached_property
    def _central(self) -> int:
        """Index of the segment at q_m."""
        right, last = int(np.searchsorted(self.knots, self.centre)), len(self.slopes) - 1
        adjacent = min(right, last), max(right - 1, 0)
        return min(adjacent, key=lambda k: abs(self.slopes[k]))

    @property
    def levels(self) -> int:
        """Number of states of the law: segments of different slope."""
        return len(self.states)

    @property
    def knot_counts(self) -> tuple[int, int]:
        """Numbers of knots with a change of slope, above segment "0" and below it."""
        return len(self._above), len(self._below)

    def is_last(self, state: int) -> bool:
        """Return whether a state is a last segment, at one of the ends of the span."""
        up, down = self.knot_counts
        return state == up or state == up + down or (state == 0 and not down)

    @property
    def further(self) -> tuple[Link, ...]:
        """A link for every change of slope: above q_m in ascending order, then below it in descending order."""
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
        changed, side = np.abs(changes) > STRAIGHT * np.max(np.abs(self.slopes)), float(f"{sign}1")
        return tuple(
            Link(f"{self.name}{sign}{i}", _scaled(self.at, -side), side * float(q), float(k))
            for i, (k, q) in enumerate(zip(changes[changed], places[changed], strict=True), start=1)
        )

    @functools.cached_property
    def states(self) -> tuple[ElementState, ...]:
        """Segments: that at q_m, those above it in ascending order, then those below it in descending order."""
        up, down = len(self._above), len(self._below)
        return tuple(self._segment(i) for i in (*range(up + 1), *range(-1, -down - 1, -1)))

    def _segment(self, i: int) -> ElementState:
        """State of segment i, in which the links between it and q_m act."""
        chain = range(1, i + 1) if i > 0 else range(len(self._above) + 1, len(self._above) + 1 - i)
        central = (0,) if self.stiffness else ()
        return ElementState(_state_name(i), "segment", tuple(self._exits(i)), holds=(*central, *chain))

    def _exits(self, i: int) -> Iterator[Exit]:
        """Exits of segment i: outward when the gap of the next link closes, inward when that of the last link opens."""
        up, down = len(self._above), len(self._below)
        for side, first, count in ((1, 1, up), (-1, up + 1, down)):
            if 0 <= side * i < count:
                yield _exit(i + side, first + abs(i), 1.0)
            if side * i > 0:
                yield _exit(i - side, first + abs(i) - 1, -1.0)

    def first_state(self, gap: float, rate: float, *rates: float) -> str:
        """Segment at the start of a run with q - q_m = gap [m]."""
        q = self.centre + gap
        return _state_name(sum(q > link.gap for link in self._above) - sum(-q > link.gap for link in self._below))


def _state_name(segment: int) -> str:
    """Name of a segment's state."""
    return f"{segment:+d}" if segment else "0"


def _exit(into: int, link: int, side: float) -> Exit:
    """Exit into a segment when a link's gap falls through zero, or rises through zero for side = -1."""
    return Exit(_state_name(into), firmness=TAKEN_ONCE, further=(Share(link, gap=side),))


def _scaled(at: At, factor: float) -> At:
    """The direction factor p, in the form of ``at``."""
    if isinstance(at, str):
        return {at: factor}
    if isinstance(at, Mapping):
        return {name: factor * coefficient for name, coefficient in at.items()}
    return factor * np.asarray(at)


@dataclass(frozen=True)
class LawLines:
    """Arguments of a ``ForceLaw``, from which the segments follow; label: name of the law in errors."""

    label: str
    law: Function | Sequence[Any]
    tolerance: float | None
    span: tuple[float, float] | None
    segments: int | None

    def knots_and_forces(self) -> tuple[np.ndarray, np.ndarray, float, float]:
        """Knots (k,) [m], F (k,) [N] there, the centre [m], and the error relative to the largest F."""
        return self._from_function() if callable(self.law) else self._from_table()

    def _from_table(self) -> tuple[np.ndarray, np.ndarray, float, float]:
        unused = {"tolerance": self.tolerance, "segments": self.segments, "span": self.span}
        for name, value in unused.items():
            if value is not None:
                raise MultiPhiValueError(f"{self.label} {name}: got {value!r} for a table, need none")
        try:
            knots, forces = (np.array(column, dtype=float) for column in self.law)  # type: ignore[union-attr]
        except (TypeError, ValueError) as error:
            needed = "need a function, or two arrays: q ascending, and F"
            raise MultiPhiTypeError(f"{self.label} law: got {type(self.law).__name__}, {needed}") from error
        if knots.ndim != 1 or knots.shape != forces.shape or len(knots) < 2:
            raise MultiPhiValueError(f"{self.label} law: got shapes {knots.shape} and {forces.shape}, need (k,) twice")
        if not (np.all(np.isfinite(knots)) and np.all(np.isfinite(forces)) and np.all(np.diff(knots) > 0)):
            raise MultiPhiValueError(f"{self.label} law: got a table of q and F, need finite numbers and q ascending")
        centre = _centre(knots, forces)
        if centre not in knots:
            index = int(np.searchsorted(knots, centre))
            value = float(np.interp(centre, knots, forces))
            knots, forces = np.insert(knots, index, centre), np.insert(forces, index, value)
        return knots, forces, centre, 0.0

    def _from_function(self) -> tuple[np.ndarray, np.ndarray, float, float]:
        low, high = self._checked_span()
        accuracy = self._checked_accuracy()
        q = np.linspace(low, high, SAMPLES + 1)
        centre = _centre(q, self.sampled(q))
        sides = [
            q for q in (np.linspace(low, centre, SAMPLES + 1), np.linspace(centre, high, SAMPLES + 1)) if q[-1] > q[0]
        ]
        values = [self.sampled(side) for side in sides]
        largest = max(float(np.max(np.abs(value))) for value in values)
        if isinstance(accuracy, int):
            chosen = with_segments(sides, values, max(accuracy, len(sides)), 2 * largest)
        else:
            chosen = self._within(sides, values, accuracy * largest)
        knots = np.concatenate([side[index[first:]] for first, (side, index) in _numbered(sides, chosen)])
        forces = np.concatenate([value[index[first:]] for first, (value, index) in _numbered(values, chosen)])
        between = np.concatenate([(side[1:] + side[:-1]) / 2 for side in sides])
        error = np.max(np.abs(self.sampled(between) - np.interp(between, knots, forces)))
        return knots, forces, centre, float(error / largest) if largest else 0.0

    def _within(self, sides: list[np.ndarray], values: list[np.ndarray], error: float) -> list[np.ndarray]:
        count = sum(len(index) - 1 for index in spread(sides, values, error))
        if count > MOST_SEGMENTS:
            raise MultiPhiValueError(
                f"{self.label} tolerance: got {self.tolerance!r}, which needs more than {MOST_SEGMENTS} segments, "
                "need a larger one"
            )
        return with_segments(sides, values, count, error)

    def _checked_span(self) -> tuple[float, float]:
        span = self.span
        if not (isinstance(span, (tuple, list, np.ndarray)) and len(span) == 2 and all(map(is_real, span))):
            raise MultiPhiTypeError(f"{self.label} span: got {span!r}, need (q_lo, q_hi) for a function")
        low, high = float(span[0]), float(span[1])
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            raise MultiPhiValueError(f"{self.label} span: got {span!r}, need finite q_lo < q_hi")
        return low, high

    def _checked_accuracy(self) -> int | float:
        """Number of segments (int), or the tolerance."""
        if (self.tolerance is None) == (self.segments is None):
            received = f"got tolerance {self.tolerance!r} and segments {self.segments!r}"
            raise MultiPhiValueError(f"{self.label}: {received}, need exactly one of them for a function")
        if self.segments is None:
            if not is_real(self.tolerance):
                raise MultiPhiTypeError(f"{self.label} tolerance: got {self.tolerance!r}, need a number")
            if not (self.tolerance is not None and 0 < self.tolerance < 1):
                raise MultiPhiValueError(f"{self.label} tolerance: got {self.tolerance!r}, need 0 < tolerance < 1")
            return float(self.tolerance)
        if not isinstance(self.segments, (int, np.integer)) or isinstance(self.segments, bool):
            raise MultiPhiTypeError(f"{self.label} segments: got {self.segments!r}, need an integer")
        if not 2 <= self.segments <= MOST_SEGMENTS:
            raise MultiPhiValueError(f"{self.label} segments: got {self.segments!r}, need 2 to {MOST_SEGMENTS}")
        return int(self.segments)

    def sampled(self, q: np.ndarray) -> np.ndarray:
        """F (k,) [N] at q (k,) [m], from a function of arrays or of numbers."""
        assert callable(self.law), "a table has no samples"
        try:
            values = np.asarray(self.law(q), dtype=float)
        except (TypeError, ValueError):
            values = np.array([], dtype=float)
        if values.shape != q.shape:
            values = self._one_by_one(q)
        if not np.all(np.isfinite(values)):
            worst = float(q[np.argmin(np.isfinite(values))])
            raise MultiPhiValueError(f"{self.label} law: gives no finite force at q = {worst:g}, need one on the span")
        return values

    def _one_by_one(self, q: np.ndarray) -> np.ndarray:
        assert callable(self.law), "a table has no samples"
        try:
            return np.array([float(self.law(each)) for each in q.tolist()])
        except (TypeError, ValueError, ArithmeticError) as error:
            raise MultiPhiTypeError(f"{self.label} law: fails ({error}), need a function of q [m] in N") from error


def _centre(q: np.ndarray, forces: np.ndarray) -> float:
    """Zero of the lines through (q, F) nearest to q = 0; without a zero, the point nearest to q = 0."""
    nearest = float(np.clip(0.0, q[0], q[-1]))
    small = np.abs(forces) <= ZERO_FORCE * np.max(np.abs(forces))
    if abs(np.interp(nearest, q, forces)) <= ZERO_FORCE * np.max(np.abs(forces)):
        return nearest
    crossing = np.flatnonzero(np.sign(forces[:-1]) * np.sign(forces[1:]) < 0)
    rise = forces[crossing + 1] - forces[crossing]
    zeros = np.concatenate([q[small], q[crossing] - forces[crossing] * (q[crossing + 1] - q[crossing]) / rise])
    return float(zeros[np.argmin(np.abs(zeros))]) if len(zeros) else nearest


def _numbered(columns: list[np.ndarray], chosen: list[np.ndarray]) -> list[tuple[int, tuple[np.ndarray, np.ndarray]]]:
    """For every column and its knots: 1 if it begins with the last sample of the previous column, else 0."""
    return [(min(i, 1), pair) for i, pair in enumerate(zip(columns, chosen, strict=True))]
