"""Truncation: estimate, from a run itself, of the error that r instead of all modes make.

The indicator adds the defects of a run like independent errors and relates them to the motion:

    indicator(T) = sqrt( sum over instants until T of |defect|^2 / mean of |y|^2 over [0, T] )

The mean is that of a polygon through 25 instants evenly spaced: the indicator is known to some per cent of itself. It
predicts an error, it does not bound it: it does not include how fast neighbouring motions separate, and motion that one
level contains and the next one drops has little weight in it (keep the levels' highest frequencies near each other).

A Tolerance is therefore not decided by the indicator alone: the run is repeated with twice as many modes, and holds if
both differ by less than the tolerance / SAFETY, in |y| and at every point of the structure, and so does a run with four
times as many: which contact strikes first may hang on a mode that both of two runs lack. Where the largest number of
modes is reached before, the difference to half of it is told.

A defect is the part of the motion at a transition that the modes of the new level do not contain. Inside a level every
kept mode moves as it would among all modes, so truncation errors arise only where a level is entered and where a rigid
contact is struck. There the state before, y and v, is known in all modes of the base, and so is the state after it with
all modes: P removes the motion that closed rigid contacts prevent, Q also the motion that an impact has stopped. The
difference to the truncated state after it is the defect

    d = P (y - Psi eta - y_inf),   w = Q (v - Psi eta'),   |defect|^2 = |d|^2 + |w / Omega|^2

in the displacement norm of the mass matrix: w / Omega is the displacement that a lost velocity would have become in the
open level, to which it comes back. At the start it is the static residual of the starting configuration. From level to
level d and w / Omega are linear in the state before and in the changes beside the map of the levels
(core/defect_form.hpp); the triangular factors of these maps are kept, a few numbers per pair of levels.
"""

from __future__ import annotations

import copy
import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

import multiphi_exudyn._core as core
from multiphi_exudyn._core import indicator
from multiphi_exudyn.display import per_cent
from multiphi_exudyn.errors import MultiPhiTypeError
from multiphi_exudyn.levels.base.modal_base import ModalBase
from multiphi_exudyn.levels.level.level import Level
from multiphi_exudyn.levels.model.mode_choice import TRIED, Tolerance, UpTo
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mathematics.orthonormal import without
from multiphi_exudyn.time.loaded_level import LoadedLevel
from multiphi_exudyn.time.model_warnings import REMEDY
from multiphi_exudyn.time.record import Record
from multiphi_exudyn.time.state import event_table
from multiphi_exudyn.time.trajectory import Trajectory

__all__ = [
    "CHANGE",
    "Defect",
    "DefectHistory",
    "defects",
    "energy_warning",
    "indicator_threshold",
    "run_with_enough_modes",
    "total_defect",
    "truncation_estimate",
    "truncation_indicator",
    "truncation_warnings",
]

APART = 1.5  # times as many modes has a run by which another one is judged
SAFETY = 2.0  # of the difference to a run with twice as many modes: the error of the coarser one is larger by its own
INSTANTS = 400  # at which two runs are compared
UNMOVED = 1e-3  # of what a point could move by |y|: a smaller motion there is not compared
FEWEST = 3  # modes of the open level in the first run
GROWTH = 0.25  # of its modes are added each time, at least one
ABOVE = 1 + 1e-9  # of its last mode's frequency: the cut-off that keeps this mode

INDICATOR = core.MOTION_THRESHOLD
CHANGE = "change"  # entry of a model: the last change by more modes, where it exceeds what a Tolerance allows
RIGID_INDICATOR = 0.05  # threshold where a rigid contact is struck: impacts raise the indicator more than the error


def truncation_indicator(trajectory: Trajectory, until: float | None = None) -> float:
    """Estimate of the relative error of displacements that truncation has made.

        indicator(T) = sqrt( sum over instants until T of |defect|^2 / mean of |y|^2 over [0, T] )

    The defects of a run are the motion at its events that the modes of the next level do not contain; the mean is that
    of a polygon through 25 instants evenly spaced. The indicator predicts an error, it does not bound it: it does not
    include how fast neighbouring motions separate.

    Parameters
    ----------
    trajectory : Trajectory
        Of ``simulate``.
    until : float, default None
        T [s], None for the end of the trajectory.

    Returns
    -------
    float
        The estimate; 0.01 is 1 %.

    Raises
    ------
    MultiPhiTypeError
        For anything but a Trajectory.

    Examples
    --------
    >>> import numpy as np
    >>> import multiphi_exudyn as mp
    >>> K = 4e4 * np.array([[2, -1, 0], [-1, 2, -1], [0, -1, 1]])  # N/m
    >>> chain = mp.LinearStructure(np.eye(3), K, mp.ModalDamping(0.01), {"tip": 2})
    >>> stop = mp.UnilateralContact("stop", "tip", gap=1e-3, stiffness=1e6)
    >>> model = mp.MultiPhiModel(chain, [stop])
    >>> pulled = model.static_equilibrium({"tip": 100.0})
    >>> tr = mp.simulate(model, 0.5, displacement=pulled)
    >>> mp.truncation_indicator(tr) < 1e-9  # all modes are kept: nothing is lost
    True
    """
    if not isinstance(trajectory, Trajectory):
        raise MultiPhiTypeError(f"trajectory: got {type(trajectory).__name__}, need a Trajectory")
    return DefectHistory.of(trajectory).indicator(trajectory.t_end if until is None else until)


def run_with_enough_modes(model: MultiPhiModel, run: Callable[[MultiPhiModel], Trajectory]) -> Trajectory:
    """Repeat ``run`` with more modes until the Tolerance of the model is met; ``Trajectory.model`` has these modes.

    The open level begins with the modes that contain the static flexibility of every contact, and is given more until
    the indicator is below the tolerance and runs with two and four times as many differ by less; every other level has
    its modes up to the same frequency. The last try is all modes of the structure, unless the tolerance allows fewer:
    then the model keeps the change from half as many, if that is more than the tolerance. The base, at first of TRIED
    modes, is doubled when more are needed.
    """
    tolerance = model.modes
    assert isinstance(tolerance, Tolerance), "the caller has checked it"
    most = min(tolerance.most, model.structure.n)
    attempts = _Attempts(replace(model, modes=most if model.base.complete else min(most, TRIED)), most, run)
    level = attempts.level
    count = max(_modes_for_flexibility(level, tolerance.error), min(int(np.sum(level.omega == 0)) + 1, most))
    while True:
        count, trajectory = attempts.run(count)
        if trajectory.status != "ok" or trajectory.model.modes == "all":
            return trajectory
        if truncation_indicator(trajectory) <= tolerance.error:
            changes = [_change(trajectory, other) for other in attempts.judges(count)]
            if count < most and changes and max(changes) <= tolerance.error / SAFETY:
                return trajectory
            if (count == most or math.inf in changes) and max(changes) > tolerance.error:
                trajectory.model.entries.keep(CHANGE, max(changes))
            if math.inf in changes:
                return trajectory
        if count == most:
            return trajectory
        count = min(most, count + max(1, round(GROWTH * count)))


class _Attempts:
    """Runs with numbers of modes up to ``most``; level: the open one of a model with at least so many."""

    def __init__(self, source: MultiPhiModel, most: int, run: Callable[[MultiPhiModel], Trajectory]) -> None:
        self._source, self._most, self._run = source, most, run
        self.level, self._runs = source.level(()), dict[int, Trajectory]()

    def run(self, count: int) -> tuple[int, Trajectory]:
        """Trajectory with ``count`` modes, or as many as there may be, and their number before it."""
        count = max(1, min(count, self._most))
        while count > self.level.modes < self._most:
            modes = self.level.modes
            self._source = replace(self._source, modes=min(self._most, 2 * modes))
            self.level = self._source.level(())
            if self.level.modes <= modes:
                break
        count = min(count, self.level.modes)
        if count not in self._runs:
            self._runs[count] = self._run(replace(self._source, modes=_mode_choice(self.level, count)))
        return count, self._runs[count]

    def judges(self, count: int) -> list[Trajectory]:
        """Runs by which one of ``count`` modes is judged: with twice and four times as many, and all at the most.

        With half as many, where there may not be more; none where there are too few more.
        """
        if count == self._most:
            return [self.run(count // 2)[1]]
        found = dict[int, Trajectory]()
        for factor in (2, 4):
            known = [other for other in self._runs if other >= min(self._most, APART * factor / 2 * count)]
            other, trajectory = self.run(min(known, default=factor * count))
            if other >= APART * count or trajectory.model.modes == "all":
                found[other] = trajectory
        return list(found.values())


def _change(coarser: Trajectory, finer: Trajectory) -> float:
    """Largest relative difference of two runs, as root mean squares over time: of |y|, and at points that move."""
    if finer.status != "ok":
        return math.inf
    times = np.linspace(coarser.t_start, coarser.t_end, INSTANTS)
    x, difference = finer.displacement(times), coarser.displacement(times)
    difference -= x
    base, rows = finer.model.base, np.array([finer.model.structure.row(name) for name in finer.points])
    y, apart = base.coordinates(x), base.coordinates(difference)
    whole, largest = float(np.linalg.norm(y)), float(np.linalg.norm(apart))
    change = largest / whole if whole > 0 else 0.0
    for row in rows:
        moved, reach = float(np.linalg.norm(row @ x)), float(np.linalg.norm(base.modes.shapes.T @ row))
        if moved > UNMOVED * reach * whole:
            change = max(change, float(np.linalg.norm(row @ difference)) / moved)
    return change


def _mode_choice(level: Level, count: int) -> str | int | UpTo:
    """Choice of modes that keeps ``count`` in the open level and the same frequencies in the others."""
    highest = float(level.frequencies[count - 1])
    if count == level.base.modes.count:
        return "all"
    return UpTo(ABOVE * highest, count) if highest > 0 else count


def _modes_for_flexibility(level: Level, error: float) -> int:
    """Smallest number of modes that leaves a static residual below the error at every contact."""
    elastic = level.omega > 0
    flexibility = np.zeros_like(level.gap_rows)
    flexibility[:, elastic] = (level.gap_rows[:, elastic] / level.omega[elastic]) ** 2
    partial_sums = np.cumsum(flexibility, axis=1)
    enough = partial_sums >= (1 - error) * partial_sums[:, -1:]
    return max(FEWEST, 1 + int(np.max(np.argmax(enough, axis=1), initial=0)))


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

    segments: Record
    places: np.ndarray
    squares: np.ndarray

    @classmethod
    def of(cls, trajectory: Trajectory) -> DefectHistory:
        """Defects of a run with segments."""
        segments = trajectory.ending.record
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
            source, target = segments.levels[before], segments.levels[after_it]
            squares[rows] = _squares(source, target, struck, last[:, rows - 1], first[:, rows])
        return cls(segments, entered, squares)

    def indicator(self, end: float) -> float:
        """The truncation indicator of [0, end] (truncation.py)."""
        lost = float(np.sum(self.squares[self.segments.starts[self.places] <= end]))
        return indicator(lost, self.segments.sizes(end)[0])


def total_defect(trajectory: Trajectory) -> float:
    """Sum of |defect|^2 [m2 kg] over the segments of a run, from the run where it has summed them."""
    summed = trajectory.ending.record.truncation.defects
    return float(np.sum(DefectHistory.of(trajectory).squares)) if math.isnan(summed) else summed


def _squares(
    source: LoadedLevel, target: LoadedLevel, stopped: tuple[int, ...], before: np.ndarray, after: np.ndarray
) -> np.ndarray:
    """|defect|^2 (k,) between states (2, k, >= n) before and after an instant."""
    transition = core.Transition(source.of_core, target.of_core)
    form = core.DefectForm(transition, list(stopped))
    n_after, n = transition.matrix.shape
    (x, v), (x_after, v_after) = before[:, :, :n], after[:, :, :n_after]
    changed = x @ transition.matrix.T + transition.offset - x_after
    slowed = v @ transition.velocity_matrix.T - v_after
    d = form.displaced[:, 0] + np.hstack([x, changed]) @ form.displaced[:, 1:].T
    w = np.hstack([v, slowed]) @ form.moving.T
    return np.asarray(np.sum(d * d, axis=1) + np.sum(w * w, axis=1))


def _allowed(base: ModalBase, held: set[int], motion: np.ndarray) -> np.ndarray:
    """The part of a motion (m,) that rigid contacts allow."""
    return without(base.directions[:, sorted(held)], motion) if held else motion


def _at_start(trajectory: Trajectory, level: LoadedLevel, stopped: tuple[int, ...], state: np.ndarray) -> float:
    """|defect|^2 [m2 kg] of the start; state: xi, xi' (2, >= r) of the first segment."""
    base, r = level.level.base, level.level.modes
    rigid = {i for i in level.level.indices if base.links[i].rigid}
    start = trajectory.start
    d = _allowed(base, rigid, start.displacement - level.configuration(state[0, :r]))
    v = _allowed(base, rigid | set(stopped), start.velocity - level.level.vectors @ state[1, :r])
    w = v * base.periods
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


def indicator_threshold(tolerance: Tolerance | None) -> float:
    """Threshold of the indicator for a warning; tolerance: the one that decided the modes."""
    return INDICATOR if tolerance is None else min(INDICATOR, tolerance.error)


def truncation_estimate(trajectory: Trajectory, tolerance: Tolerance | None = None) -> tuple[float, float]:
    """Estimate of what a run has lost, for one that could not compute it, or used another limit.

    tolerance: the one that decided the modes.
    """
    if trajectory.model.whole:
        return 0.0, 0.0
    limit, ledger = indicator_threshold(tolerance), trajectory.ending.ledger
    found = copy.copy(trajectory.ending.record.truncation)
    found.defects = total_defect(trajectory)
    found.start_square = found.start_square or float(np.sum(trajectory.start.displacement**2))
    found.estimate(ledger, limit)
    if math.isnan(found.energy_share) or math.isnan(found.motion):
        found.mean_square, found.largest_energy = trajectory.ending.record.sizes(trajectory.t_end)
        found.estimate(ledger, limit)
    return found.energy_share, found.motion


def truncation_warnings(
    model: MultiPhiModel, estimate: tuple[float, float], tolerance: Tolerance | None, struck: bool
) -> tuple[str, ...]:
    """One warning of motion and energy lost to truncation, or none; struck: whether a rigid contact was struck."""
    share, error = estimate
    if tolerance is not None and (told := _of_tolerance(model, share, error, tolerance)):
        return (told,)
    return _sentence(share, error, struck)


def _of_tolerance(model: MultiPhiModel, share: float, error: float, tolerance: Tolerance) -> str:
    """Warning of a tolerance that the run which decided the modes, or this one, does not keep, or ""."""
    kept, change = model.level_at(()).modes, model.entries.find(CHANGE)
    if change is not None:
        found = f"differs by {per_cent(change)} from" if math.isfinite(change) else "could not be compared with"
        return (
            f"truncation: with {kept} modes the run that decided them {found} one with another number of modes, the "
            f"tolerance is {tolerance.error:g}{_also_lost(share)}; give Tolerance a larger most=, or a shorter run"
        )
    if error > tolerance.error:
        return (
            f"truncation: the indicator is {error:.2g} with {kept} modes, the tolerance {tolerance.error:g}"
            f"{_also_lost(share)}; give Tolerance a larger most=, or a new model, so that it decides by this run"
        )
    return ""


def _sentence(share: float, error: float, struck: bool) -> tuple[str, ...]:
    """One warning of the estimate of a run whose modes no tolerance has decided: of its motion, else of its energy.

    The estimated error of motion is on average four times the true one where a rigid contact was struck.
    """
    if not error > (RIGID_INDICATOR if struck else INDICATOR):
        return energy_warning(share)
    typical = ", with rigid contacts a quarter of that is typical" if struck else ""
    off = f"truncation: displacements may be off by {per_cent(error)} of the motion"
    return (f"{off}{typical}{_also_lost(share)}; {REMEDY}",)


def energy_warning(share: float) -> tuple[str, ...]:
    """Warning of the energy lost, a share of the largest energy of the run; none where the share is zero."""
    if not share > 0:
        return ()
    return (f"lost energy: truncation took {per_cent(share)} of the largest energy of the run; {REMEDY}",)


def _also_lost(share: float) -> str:
    """Energy lost, as part of a sentence on the motion."""
    return f", and {per_cent(share)} of the largest energy of the run was lost" if share > 0 else ""
