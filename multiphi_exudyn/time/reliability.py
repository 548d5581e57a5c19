"""Reliability: what to distrust in an answer, and what to do about it.

Every warning is one plain sentence with its number. It begins with its kind and a colon; many runs group them by kind:

    "truncated contact: ..."  static flexibility that a closed compliant level's modes leave out (level.py): peak
                              contact forces are off; known before any run
    "truncated friction: ..." levels in which friction sticks with few modes: its force there is off
    "backward slip: ..."      truncated friction that moves against its slip (rubbing.py)
    "redundant friction: ..." which of several bears the load, and when they slip, is not unique (rubbing.py)
    "friction in turn: ..."   rigid contacts that rub and turn at one instant, whose order may count (rubbing.py)
    "several impacts: ..."    an impact with friction to which Coulomb's law has several answers (rough_impacts.py)
    "lost energy: ..."        what truncation took of the largest energy of the run
    "truncation: ..."         the estimate of the error of displacements (truncation.py), or a Tolerance not held
    "undamped modes: ..."     modes for which a list of modal ratios has none
    "damping ratios: ..."     ratios that look like per cent
    "missing modes: ..."      contacts of a structure of modes alone, where its static flexibility is not known
    "linear range: ..."       what the model's own validity check says
    "cluster: ..."            levels that keep more modes than asked for, so that no modes of one frequency are parted
    "base: ..."               what the base of a large structure does not hold (base_share.py)
    "slow mode: ..."          a mode whose period is so long that its motion under loads is lost in round-off
    "load pieces: ..."        loads of so many samples or pieces that the run takes long
    "slow model: ..."         modes that hardly begin to move in the run: matrices swapped, or units mixed

The thresholds are calibrated on random truncated models judged by the same with all modes:
tests/campaign/truncation_study.py.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.display import per_cent
from multiphi_exudyn.events.excitation import Excitation
from multiphi_exudyn.events.state import event_table
from multiphi_exudyn.levels.level import Level
from multiphi_exudyn.levels.mode_choice import Tolerance
from multiphi_exudyn.levels.model import MultiPhiModel
from multiphi_exudyn.time.defects import Samples, indicator, is_small, total_defect
from multiphi_exudyn.time.known_warnings import (
    REMEDY,
    cluster_warnings,
    damping_warnings,
    missing_modes,
    static_warnings,
)
from multiphi_exudyn.time.rough_impacts import impact_warnings
from multiphi_exudyn.time.rubbing import rubbing_warnings
from multiphi_exudyn.time.segment import Segments, listed
from multiphi_exudyn.time.trajectory import Trajectory

__all__ = ["INDICATOR", "RunSummary", "left_alone", "looked_into", "warnings_of", "warnings_of_body"]

ENERGY_SHARE = 0.01  # of the largest energy of a run
INDICATOR = 0.03  # of the motion, where every contact that is struck is compliant
RIGID_INDICATOR = 0.05  # where a rigid one is: its impacts raise the indicator more than the error

SLOW = 1e-5  # rad of a period that a run sees: with less, a millionth of what loads make is round-off
LEFT = 2e-8  # rad of a period: nothing but round-off, whose share falls with the square of what is seen
HARDLY = 0.01  # of a period of the fastest kept mode: a run so short is hardly one that was meant
MANY_PIECES = 2**19  # of loads in a run: some seconds of computing and 250 MB
PIECE_SECONDS = 1e-5  # that a piece of a load takes in a small model
PIECE_BYTES = 500  # that it takes there, its segment included


def warnings_of(trajectory: Trajectory, tolerance: Tolerance | None = None) -> tuple[str, ...]:
    """What a user must not miss of a run, one sentence each; tolerance: the one that its modes were decided by."""
    if not trajectory.segments:
        return ()
    model, segments, span = trajectory.model, listed(trajectory.segments), trajectory.t_end - trajectory.start.time
    known, excitation = _Known.of(model, segments), segments.levels[0].excitation
    found = list(known.always)
    if 0 < known.fastest * trajectory.t_end < HARDLY:
        found[:0] = _slow(trajectory, known.fastest)
    if not known.whole:
        found += known.static
        found += _left_out(trajectory, segments, tolerance)
    found += known.clusters
    if model.validity is not None:
        found += model.validity(trajectory)
    if 0 < known.slowest * span < SLOW:
        found += _slow_mode(segments, known.slowest, span)
    if model.general:
        found += rubbing_warnings(segments, model)
        found += impact_warnings(trajectory)
    if excitation.histories and excitation.most_effort > MANY_PIECES < excitation.effort(trajectory.t_end):
        found.append(_load_pieces(excitation, trajectory.t_end))
    return tuple(found)


@dataclass(frozen=True)
class _Known:
    """What is known of a model before any run, and of the levels of a run before it comes there.

    whole: no level leaves out a mode. always, static, clusters: warnings. fastest: the highest frequency of the open
    level [Hz]. slowest: the lowest of the levels that is not zero [rad/s].
    """

    whole: bool
    always: tuple[str, ...]
    static: tuple[str, ...]
    clusters: tuple[str, ...]
    fastest: float
    slowest: float

    @classmethod
    def of(cls, model: MultiPhiModel, segments: Segments) -> _Known:
        """Kept by the model."""
        visited = tuple([level.level.indices for level in segments.levels])
        found: _Known = model.entries.get_or_build(("warnings", visited), lambda: cls._of(model, segments))
        return found

    @classmethod
    def _of(cls, model: MultiPhiModel, segments: Segments) -> _Known:
        levels = [level.modal for level in segments.levels]
        static = () if model.whole else static_warnings([level.level for level in segments.levels])
        omega = np.concatenate([level.omega for level in levels])
        return cls(
            model.whole,
            (*damping_warnings(model), *missing_modes(model)),
            tuple(static),
            tuple(cluster_warnings(levels)),
            model.level_at(()).highest_frequency,
            float(np.min(omega[omega > 0], initial=math.inf)),
        )


@dataclass(frozen=True)
class RunSummary:
    """What a body in Exudyn, which keeps no segments, knows of its run.

    levels: it has been in, each once. truncated: energy [J] that truncation took at its start and at all events.
    energy: the largest of the run [J], kinetic and strain, as far as it was seen.
    """

    levels: Sequence[Level]
    truncated: float
    energy: float


def warnings_of_body(model: MultiPhiModel, run: RunSummary) -> tuple[str, ...]:
    """What a user must not miss of a run in Exudyn, as far as levels and losses tell."""
    found = [*damping_warnings(model), *missing_modes(model)]
    if not model.whole:
        found.extend(static_warnings(run.levels))
        found.extend(_energy_warning(abs(run.truncated), run.energy))
    return tuple(found)


def _slow(trajectory: Trajectory, fastest: float) -> Iterator[str]:
    """Not of runs that go on with one another, and not of a system that was reduced."""
    if not (trajectory.t_start > 0 or trajectory.model.validity is not None):
        yield (
            f"slow model: its fastest mode takes {1 / fastest:.3g} s for an oscillation, and the run lasts "
            f"{trajectory.t_end:.3g} s; are mass and stiffness swapped, or in different units?"
        )


def _left_out(trajectory: Trajectory, segments: Segments, tolerance: Tolerance | None) -> list[str]:
    """Of the energy that truncation took, whatever its sign at an instant, and of the motion that it did."""
    at_start, at_events = trajectory.ending.truncated_at_start, segments.truncated
    if math.isnan(at_events):
        at_events = float(np.sum(np.abs(event_table(trajectory.events, trajectory.model.index)[:, 3])))
    lost, defects = abs(at_start) + at_events, total_defect(trajectory, segments)
    given = abs(_given_energy(trajectory)) if lost > 0 else 0.0
    least = min(INDICATOR, tolerance.error) if tolerance else INDICATOR
    much, far = looked_into((lost, defects, given), trajectory.start.displacement, least)
    if not (much or far):
        return []
    samples, found = Samples(segments, trajectory.t_end), list[str]()
    if much:
        alone = left_alone(trajectory.model, segments.levels[0].excitation)
        found += _energy_warning(lost, given if alone else max(samples.largest_energy, given))
    if far:
        found += _truncation(trajectory, indicator(defects, samples), tolerance)
    return found


def looked_into(taken: tuple[float, float, float], start: np.ndarray, least: float) -> tuple[bool, bool]:
    """Whether truncation is looked into for its energy, and for the motion; what is not a number is.

    taken: energy [J] that it took, its sum of |defect|^2, and the energy [J] given at the start y (m,). least: the
    indicator from which it is told.
    """
    lost, defects, given = taken
    return not lost <= ENERGY_SHARE * given, not (defects <= 0 or is_small(defects, least, start))


def _given_energy(trajectory: Trajectory) -> float:
    """Kinetic and strain energy [J] at the start."""
    return trajectory.ending.given_energy + float(trajectory.load.dot(trajectory.start.displacement))


def left_alone(model: MultiPhiModel, excitation: Excitation) -> bool:
    """Whether nothing works on the structure from outside, so that it has no more energy than at its start."""
    return excitation.nothing and not (model.general or model.overrides)


def _energy_warning(lost: float, largest: float) -> Iterator[str]:
    """largest: zero where truncation has taken all energy at the start."""
    if lost > ENERGY_SHARE * largest:
        share = per_cent(lost / (largest or lost))
        yield f"lost energy: truncation took {share} of the largest energy of the run; {REMEDY}"


def _truncation(trajectory: Trajectory, error: float, tolerance: Tolerance | None) -> Iterator[str]:
    """Of the estimated error, which with rigid contacts is four times the true one in the mean."""
    rigid = any(contact.rigid for contact in trajectory.model.contacts)
    rigid = rigid and bool(np.any(event_table(trajectory.events, trajectory.model.index)[:, 2] > 0))
    if tolerance is not None and error > tolerance.error:
        kept = trajectory.model.level_at(()).modes
        yield (
            f"truncation: the indicator is {error:.2g} with {kept} modes, the tolerance {tolerance.error:g}; "
            "give Tolerance a larger most=, or a new model, so that it decides by this run"
        )
    elif error > (RIGID_INDICATOR if rigid else INDICATOR):
        typical = ", with rigid contacts a quarter of that is typical" if rigid else ""
        yield f"truncation: displacements may be off by {per_cent(error)} of the motion{typical}; {REMEDY}"


def _slow_mode(segments: Segments, slowest: float, span: float) -> Iterator[str]:
    """Of a mode of which a run of ``span`` [s] sees so little that where loads move it is a difference of far places.

    p (1 - cos omega t) / omega^2 is p t^2 / 2, and its terms are 2 / (omega t)^2 of that.
    """
    if not all(level.excitation.nothing for level in segments.levels):
        share = min(1.0, LEFT / (slowest * span)) ** 2
        yield (
            f"slow mode: a mode of {slowest / (2 * math.pi):.3g} Hz has hardly begun in {span:g} s, so "
            f"{per_cent(share)} of what loads move it by is round-off; hold it, or make its stiffness exactly zero"
        )


def _load_pieces(excitation: Excitation, end: float) -> str:
    """Of loads that have so many pieces that they set the time and memory of a run to ``end`` [s]."""
    pieces = excitation.pieces(end)
    return (
        f"load pieces: the loads have {pieces} pieces in {end:g} s, each of which takes some "
        f"{1e3 * PIECE_SECONDS * excitation.effort(end) / pieces:.1g} ms and {PIECE_BYTES / 1000:g} kB; fewer "
        "samples, a larger tolerance or a lower highest frequency make the run shorter"
    )
