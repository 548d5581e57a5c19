"""Histories: displacements, forces and energies of a motion in segments, of a run or a saved one (eq. 38.4).

    x(t) = Phi_l eta(t) + x_inf,l,   eta(t) = Re V (c exp(lambda (t - t_k)))   on [t_k, t_k+1]

All but energies are rows of (xi, xi', 1) in every level, which the subclasses define.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from multiphi_exudyn.display import Shown, names
from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.mechanics.arguments import no_text
from multiphi_exudyn.mechanics.structure import At
from multiphi_exudyn.time.segments import Segment, Segments
from multiphi_exudyn.time.state import Event, total_impulse

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame
if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["INSTANTS", "Histories", "history_figure"]

INSTANTS = 1001  # of a history where no times are given
GREY, LINE = "0.85", 1.0
SIZE = (9.0, 3.0)  # inches, of one panel


class Histories(Shown, ABC):
    """Histories of a motion, of a run or of a saved one.

    Times [s] are scalars or (k,); at an event ``side`` chooses the limit from the "right" (default) or the "left".
    MultiPhiValueError and MultiPhiTypeError for a time outside of the motion, and for an unknown name.
    """

    segments: Segments
    events: Sequence[Event]
    t_end: float
    message: str

    @property
    @abstractmethod
    def t_start(self) -> float:
        """Start of the motion [s]."""

    @property
    @abstractmethod
    def points(self) -> tuple[str, ...]:
        """Names of points."""

    @property
    @abstractmethod
    def contacts(self) -> tuple[str, ...]:
        """Names of contacts."""

    @property
    @abstractmethod
    def frictions(self) -> tuple[str, ...]:
        """Names of friction elements that are no contacts."""

    @property
    @abstractmethod
    def rubbing(self) -> tuple[str, ...]:
        """Names of contacts that have friction."""

    @abstractmethod
    def _row(self, quantity: str, name: At) -> Callable[[Any], np.ndarray]:
        """A level's row (2 (r + q) + 1,) of (xi, xi', 1) for "at", "gap", "contact_force", "friction_force", "slip"."""

    @abstractmethod
    def _holds(self, quantity: str, name: str) -> Callable[[Any], bool]:
        """Whether in a level a contact is closed ("contact_intervals"), or a friction sticks ("stick_intervals")."""

    @abstractmethod
    def _motion(self, level: Any, xi: np.ndarray) -> np.ndarray:
        """Phi_l xi (n, k) of coordinates (r + q, k) or their derivatives."""

    @abstractmethod
    def _asymptotic(self, level: Any) -> np.ndarray:
        """x_inf,l (n,) [m, rad]."""

    def displacement(self, t: float | np.ndarray, side: str = "right") -> np.ndarray:
        """x [m, rad] of all degrees of freedom: (n,) for a scalar t, (n, k) for (k,) times."""
        return self._configurations(t, side, 0)

    def velocity(self, t: float | np.ndarray, side: str = "right") -> np.ndarray:
        """x' [m/s, rad/s] of all degrees of freedom: (n,) for a scalar t, (n, k) for (k,) times."""
        return self._configurations(t, side, 1)

    def acceleration(self, t: float | np.ndarray, side: str = "right") -> np.ndarray:
        """x'' [m/s2, rad/s2] of all degrees of freedom: (n,) for a scalar t, (n, k) for (k,) times."""
        return np.asarray(
            self._evaluate(t, side, lambda segment, times: self._motion(segment.level, segment.modal(times, 2)))
        )

    def at(self, point: At, t: float | np.ndarray, side: str = "right", derivative: int = 0) -> float | np.ndarray:
        """Displacement [m] of a point (name, {point: coefficient} or row): a float, or (k,) for (k,) times.

        derivative: 1 for its velocity [m/s], 2 for its acceleration [m/s2].
        """
        if derivative not in (0, 1, 2):
            raise MultiPhiValueError(f"derivative: got {derivative!r}, need 0, 1 or 2")
        if derivative == 0:
            return self._values("at", point, t, side)
        place = self._row("at", point)

        def derived(segment: Segment, times: np.ndarray) -> np.ndarray:
            row = place(segment.level)
            return np.asarray(row[: len(row) // 2] @ segment.modal(times, derivative))

        return self._evaluate(t, side, derived)

    def gap(self, contact: str, t: float | np.ndarray, side: str = "right") -> float | np.ndarray:
        """Gap [m] of a contact: a float for a scalar t, (k,) for (k,) times."""
        return self._values("gap", contact, t, side)

    def contact_force(self, contact: str, t: float | np.ndarray, side: str = "right") -> float | np.ndarray:
        """Contact force lambda >= 0 [N]: a float for a scalar t, (k,) for (k,) times.

        Impacts of rigid contacts are impulses, not forces: ``contact_impulse``.
        """
        return self._values("contact_force", contact, t, side)

    def contact_impulse(self, contact: str, t0: float, t1: float) -> float:
        """Integral of the contact force over [t0, t1] [N s], impulses of impacts in it included."""
        row = self._row("contact_impulse", contact)
        first, last = float(self._times(t0)[0]), float(self._times(t1)[0])
        if first > last:
            raise MultiPhiValueError(f"contact_impulse: got t0 = {t0!r} > t1 = {t1!r}, need t0 <= t1")
        return self.segments.integral(row, first, last) + total_impulse(self.events, contact, first, last)

    def contact_intervals(self, contact: str) -> list[tuple[float, float]]:
        """[(closed at, opened at), ...] [s]; one still closed at the end ends at t_end, instants are left out."""
        return self.segments.intervals(self._holds("contact_intervals", contact))

    def friction_force(self, name: str, t: float | np.ndarray, side: str = "right") -> float | np.ndarray:
        """T [N] of a friction, whose force on the structure is -h T: a float for a scalar t, (k,) for (k,) times."""
        return self._values("friction_force", name, t, side)

    def slip(self, name: str, t: float | np.ndarray, side: str = "right") -> float | np.ndarray:
        """Displacement [m] along +h of the patch of a friction on its counter-surface since the start.

        A float, or (k,). Exact: it does not change by a bit while the patch sticks.
        """
        return self._values("slip", name, t, side) - self._values("slip", name, self.t_start, "right")

    def stick_intervals(self, name: str) -> np.ndarray:
        """[[sticks from, slips from], ...] (k, 2) [s]; the first may begin at the start, the last end at t_end.

        Instants are left out: a block without a spring that turns sticks at one and slips on.
        """
        return np.array(self.segments.intervals(self._holds("stick_intervals", name))).reshape(-1, 2)

    def energy(self, t: float | np.ndarray, side: str = "right") -> float | np.ndarray:
        """Kinetic + strain energy [J], closed compliant contacts and force laws included: a float, or (k,)."""
        return self._evaluate(t, side, lambda segment, times: segment.energy(times))

    def to_dataframe(self, points: Sequence[str] | None = None, times: np.ndarray | None = None) -> DataFrame:
        """Histories as a pandas table: a row for each time [s], which is the index.

        Columns: displacement [m] of every point by its name, of every contact "gap NAME" [m] and "force NAME" [N], of
        what has friction "friction NAME" [N] and "slip NAME" [m].

        Parameters
        ----------
        points : sequence of str, default None
            Names of points, None for all of the structure's.
        times : array (k,), default None
            Times [s], None for 1001 that are evenly spaced.

        Raises
        ------
        MultiPhiValueError
            For an unknown name, or a time outside of the motion.
        """
        from pandas import DataFrame, Index

        at = self._shown_times(times)
        columns = self._at_points(points, at)
        for name in self.contacts:
            columns |= {f"gap {name}": self.gap(name, at), f"force {name}": self.contact_force(name, at)}
        for name in (*self.frictions, *self.rubbing):
            columns |= {f"friction {name}": self.friction_force(name, at), f"slip {name}": self.slip(name, at)}
        return DataFrame(columns, index=Index(at, name="time"))

    def plot(self, points: Sequence[str] | None = None, times: np.ndarray | None = None) -> Figure:
        """A matplotlib figure: displacements of points, and below them the forces of contacts and frictions.

        Grey: while a contact is closed; where there are none, while friction sticks.

        Parameters
        ----------
        points, times
            As in ``to_dataframe``.
        """
        at = self._shown_times(times)
        forces: dict[str, Any] = {name: self.contact_force(name, at) for name in self.contacts}
        forces |= {name: self.friction_force(name, at) for name in self.frictions}
        closed: Mapping[str, Any] = {f"{name} closed": self.contact_intervals(name) for name in self.contacts}
        stuck = {f"{name} sticks": self.stick_intervals(name).tolist() for name in self.frictions}
        return history_figure(at, self._at_points(points, at), forces, closed or stuck)

    # ------------------------------------------------------------------ evaluation

    def _shown_times(self, times: np.ndarray | None) -> np.ndarray:
        return self._times(np.linspace(self.t_start, self.t_end, INSTANTS) if times is None else times)

    def _at_points(self, points: Sequence[str] | None, times: np.ndarray) -> dict[str, Any]:
        """Displacements (k,) [m] of points by name, of all of them for None."""
        no_text("points", points)
        return {name: self.at(name, times) for name in (self.points if points is None else points)}

    def _configurations(self, t: float | np.ndarray, side: str, derivative: int) -> np.ndarray:
        times = self._times(t)
        segments, places = self.segments, self.segments.owners(times, _side(side))
        states = segments.states(places, times - segments.starts[places])
        numbers, result = segments.numbers[places], np.empty((0, len(times)))
        for number in np.unique(numbers).tolist():
            level, in_level = segments.levels[number], np.flatnonzero(numbers == number)
            x = self._motion(level, states[derivative, in_level, : level.width].T)
            if not len(result):
                result = np.empty((len(x), len(times)))
            result[:, in_level] = x if derivative else x + self._asymptotic(level)[:, None]
        return result if np.ndim(t) else result[:, 0]

    def _values(self, quantity: str, name: At, t: float | np.ndarray, side: str) -> Any:
        """A row of (xi, xi', 1) at times: a float, or (k,)."""
        row = self._row(quantity, name)
        values = self.segments.values(self._times(t), _side(side), row)
        return values if np.ndim(t) else float(values[0])

    def _evaluate(
        self, t: float | np.ndarray, side: str, values: Callable[[Segment, np.ndarray], np.ndarray]
    ) -> float | np.ndarray:
        """``values`` (..., k) of the segments that own the times."""
        result = self.segments.evaluated(self._times(t), _side(side), values)
        if np.ndim(t) == 0:
            return float(result[0]) if result.ndim == 1 else result[:, 0]
        return result

    def _times(self, t: float | np.ndarray) -> np.ndarray:
        try:
            times = np.atleast_1d(np.asarray(t, dtype=float))
        except (TypeError, ValueError) as error:
            hint = f"; a point's displacement: at({t!r}, times)" if isinstance(t, str) and t in self.points else ""
            needed = f"a time or (k,) times in s{hint}"
            raise MultiPhiTypeError(f"t: got {type(t).__name__}, need {needed}") from error
        if times.ndim != 1 or len(times) == 0:
            raise MultiPhiValueError(f"t: got shape {np.shape(t)}, need a scalar or (k,)")
        if not self.segments:
            raise MultiPhiValueError(f"t: got a time of a run that has no motion ({self.message}), need one that began")
        if not np.all((times >= self.t_start) & (times <= self.t_end)):
            interval = " to ".join(f"{t:g}" for t in sorted({np.min(times), np.max(times)}))
            raise MultiPhiValueError(f"t: got {interval} s, need {self.t_start:g} <= t <= {self.t_end:g} s")
        return times


def _side(side: str) -> str:
    if side not in ("left", "right"):
        raise MultiPhiValueError(f"side: got {side!r}, need 'left' or 'right'")
    return side


def history_figure(
    times: np.ndarray,
    displacements: Mapping[str, np.ndarray],
    forces: Mapping[str, np.ndarray],
    intervals: Mapping[str, Sequence[tuple[float, float]]],
) -> Figure:
    """Panels over times (k,) [s]: displacements by point, forces by contact, in the structure's own units.

    intervals: what holds in the times [s] drawn grey -> these, such as "stop closed".
    """
    from matplotlib.figure import Figure

    panels = [(displacements, "displacement"), *(((forces, "force"),) if forces else ())]
    figure = Figure(figsize=(SIZE[0], SIZE[1] * len(panels)), layout="constrained")
    axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    for axis, (curves, label) in zip(axes, panels, strict=True):
        _shade(axis, (interval for of_one in intervals.values() for interval in of_one))
        for name, values in curves.items():
            axis.plot(times, values, lw=LINE, label=name)
        axis.set_ylabel(label)
        axis.margins(x=0)
        if curves:
            axis.legend(loc="upper right", frameon=False, ncols=3)
    axes[-1].set_xlabel("time [s]" + (f"; grey: {names(list(intervals))}" if intervals else ""))
    return figure


def _shade(axis: Axes, intervals: Iterable[tuple[float, float]]) -> None:
    for start, end in intervals:
        axis.axvspan(start, end, color=GREY, lw=0)
