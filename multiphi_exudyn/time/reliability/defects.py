"""Defects: the part of the motion at a transition that the modes of the new level do not contain.

Inside a level every kept mode moves as it would among all modes, so truncation errors arise only where a level is
entered and where a rigid contact is struck. There the state before, y and v, is known in all modes of the base, and so
is the state after it with all modes: P removes the motion that closed rigid contacts prevent, Q also the motion that an
impact has stopped. The difference to the truncated state after it is the defect

    d = P (y - Psi eta - y_inf),   w = Q (v - Psi eta'),   |defect|^2 = |d|^2 + |w / Omega|^2

in the displacement norm of the mass matrix: w / Omega is the displacement that a lost velocity would have become in the
open level, to which it comes back. At the start it is the static residual of the starting configuration. From level to
level d and w / Omega are linear in the state before and in the changes beside the map of the levels
(transitions/defect_forms.py); the triangular factors of these maps are kept, a few numbers per pair of levels.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn._core import indicator
from multiphi_exudyn.events.excitation.loaded_level import LoadedLevel
from multiphi_exudyn.events.transitions.defect_forms import allowed, defect_form, held_rigidly, over_omega
from multiphi_exudyn.events.transitions.state import event_table
from multiphi_exudyn.events.transitions.transition import Transition
from multiphi_exudyn.time.segments.segment import Segments
from multiphi_exudyn.time.trajectory.trajectory import Trajectory

__all__ = ["Defect", "DefectHistory", "defects", "total_defect"]


@dataclass(frozen=True)
class Defect:
    """Defect at ``time`` [s]; closed: the closed contacts of the level entered there; size: |defect| [m sqrt(kg)]."""

    time: float
    closed: tuple[str, ...]
    size: float


def defects(trajectory: Trajectory) -> list[Defect]:
    """The defect of the start, of every transition to another level and of every impact, in order of time."""
    history = DefectHistory.of(trajectory)
    segments, sizes = history.segments, np.sqrt(history.squares).tolist()
    closed = [segments.levels[number].level.closed for number in segments.numbers[history.places].tolist()]
    starts = segments.starts[history.places].tolist()
    return [Defect(*values) for values in zip(starts, closed, sizes, strict=True)]


@dataclass(frozen=True)
class DefectHistory:
    """The defects of a run in arrays.

    segments: of the run. places: indices (k,) of those that begin with a defect. squares: |defect|^2 (k,) [m2 kg].
    """

    segments: Segments
    places: np.ndarray
    squares: np.ndarray

    @classmethod
    def of(cls, trajectory: Trajectory) -> DefectHistory:
        """Defects of a run with segments."""
        segments = trajectory.segments
        table = event_table(trajectory.events, trajectory.model.index)
        stopped = _stopped(table, segments.starts)
        transitions = _transitions(segments.numbers, stopped)
        entered = np.array([0, *sorted(itertools.chain(*transitions.values()))])
        last_before, k = entered[1:] - 1, len(entered)
        after = np.zeros(k), segments.ends[last_before] - segments.starts[last_before]
        states = segments.states(np.concatenate([entered, last_before]), np.concatenate(after))
        first, last = states[:, :k], states[:, k:]
        squares = np.empty(k)
        squares[0] = _at_start(trajectory, segments.levels[segments.numbers[0]], stopped.get(0, ()), first[:, 0])
        for (before, after_it, struck), places in transitions.items():
            rows = np.searchsorted(entered, places)
            form = defect_form(Transition(segments.levels[before], segments.levels[after_it]), struck)
            squares[rows] = form.squares(last[:, rows - 1], first[:, rows])
        return cls(segments, entered, squares)

    def indicator(self, end: float) -> float:
        """The truncation indicator of [0, end] (truncation.py)."""
        lost = float(np.sum(self.squares[self.segments.starts[self.places] <= end]))
        return indicator(lost, self.segments.sizes(end)[0])


def total_defect(trajectory: Trajectory) -> float:
    """Sum of |defect|^2 [m2 kg] over the segments of a run, from the loop where it has summed them."""
    from_loop = trajectory.segments.defects
    return float(np.sum(DefectHistory.of(trajectory).squares)) if math.isnan(from_loop) else from_loop


def _at_start(trajectory: Trajectory, level: LoadedLevel, stopped: tuple[int, ...], state: np.ndarray) -> float:
    """|defect|^2 [m2 kg] of the start; state: xi, xi' (2, >= r) of the first segment."""
    base, rigid, r = level.level.base, held_rigidly(level), level.level.modes
    start = trajectory.start
    d = allowed(base, rigid, start.displacement - level.configuration(state[0, :r]))
    v = allowed(base, rigid | set(stopped), start.velocity - level.level.vectors @ state[1, :r])
    w = over_omega(base, v)
    return float(d @ d + w @ w)


def _stopped(table: np.ndarray, starts: np.ndarray) -> dict[int, tuple[int, ...]]:
    """Contacts that an impact has stopped, by the index of the segment after it."""
    contacts: dict[int, tuple[int, ...]] = {}
    struck = table[table[:, 2] > 0]
    places = np.searchsorted(starts, struck[:, 0])
    for place, contact in zip(places.tolist(), struck[:, 1].astype(int).tolist(), strict=True):
        contacts[place] = tuple(sorted({*contacts.get(place, ()), contact}))
    return contacts


def _transitions(
    numbers: np.ndarray, stopped: dict[int, tuple[int, ...]]
) -> dict[tuple[int, int, tuple[int, ...]], list[int]]:
    """Indices of the segments that begin in another level or after an impact, by their levels and stopped contacts.

    numbers: (n,) of the levels of all segments.
    """
    transitions: dict[tuple[int, int, tuple[int, ...]], list[int]] = {}
    begins = np.append(False, numbers[1:] != numbers[:-1])
    begins[[place for place in stopped if 0 < place < len(begins)]] = True  # not one that ends the run
    entered = np.flatnonzero(begins)
    for place, before, after in zip(
        entered.tolist(), numbers[entered - 1].tolist(), numbers[entered].tolist(), strict=True
    ):
        transitions.setdefault((before, after, stopped.get(place, ())), []).append(place)
    return transitions
