"""Reliability: what to distrust in an answer, and what to do about it.

Every warning is one plain sentence with its number. It begins with its kind and a colon; many runs group them by kind:

    "truncated contact: ..."  static flexibility that a closed compliant level's modes leave out (level.py): peak
                              contact forces are off; known before any run
    "truncated friction: ..." levels in which friction sticks with few modes: its force there is off
    "backward slip: ..."      truncated friction that moves against its slip (friction_warnings.py)
    "redundant friction: ..." which of several bears the load, and when they slip, is not unique (friction_warnings.py)
    "friction in turn: ..."   rigid contacts that rub and turn at one instant in an order (friction_warnings.py)
    "several impacts: ..."    an impact with friction to which Coulomb's law has several answers (impact_warnings.py)
    "lost energy: ..."        what truncation took of the largest energy of the run (truncation_warnings.py)
    "truncation: ..."         the estimate of the error of displacements (truncation.py), or a Tolerance not held
    "undamped modes: ..."     modes for which a list of modal ratios has none
    "damping ratios: ..."     ratios that look like per cent
    "missing modes: ..."      contacts of a structure of modes alone, where its static flexibility is not known
    "linear range: ..."       what the model's own validity check says
    "cluster: ..."            levels that keep more modes than asked for, so that no modes of one frequency are parted
    "base: ..."               what the base of a large structure does not hold (base_warnings.py)
    "slow mode: ..."          a mode whose period is so long that its motion under loads is lost in round-off
    "load pieces: ..."        loads of so many samples or pieces that the run takes long
    "slow model: ..."         modes that hardly begin to move in the run: matrices swapped, or units mixed
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.display import per_cent
from multiphi_exudyn.events.excitation.excitation import Excitation
from multiphi_exudyn.events.excitation.loaded_level import LoadedLevel
from multiphi_exudyn.events.transitions.state import event_table
from multiphi_exudyn.levels.level import Level
from multiphi_exudyn.levels.mode_choice import Tolerance
from multiphi_exudyn.levels.model import MultiPhiModel
from multiphi_exudyn.time.loop.verdict import share_lost
from multiphi_exudyn.time.reliability.friction_warnings import rubbing_warnings
from multiphi_exudyn.time.reliability.impact_warnings import impact_warnings
from multiphi_exudyn.time.reliability.truncation_warnings import energy_warning, left_out_warnings, verdict_of
from multiphi_exudyn.time.segments.segment import Segments
from multiphi_exudyn.time.trajectory.trajectory import Trajectory
from multiphi_exudyn.time.warnings.model_warnings import (
    cluster_warnings,
    damping_warnings,
    missing_modes,
    static_warnings,
)

__all__ = ["Known", "RunSummary", "warnings_of", "warnings_of_body"]

SLOW = 1e-5  # rad of a period that a run sees: with less, a millionth of what loads make is round-off
LEFT = 2e-8  # rad of a period: nothing but round-off, whose share falls with the square of what is seen
HARDLY = 0.01  # of a period of the fastest kept mode: a run so short is hardly one that was meant
MANY_PIECES = 2**19  # of loads in a run: some seconds of computing and 250 MB
PIECE_SECONDS = 1e-5  # that a piece of a load takes in a small model
PIECE_BYTES = 500  # that it takes there, its segment included


def warnings_of(trajectory: Trajectory, tolerance: Tolerance | None = None) -> tuple[str, ...]:
    """What a user must not miss of a run, one sentence each; tolerance: the one that its modes were decided by.

    What is told beside the verdict on truncation is the same for runs of one length in the same levels, and kept for
    them, but where somebody looks into every run.
    """
    segments = trajectory.segments
    if not segments:
        return ()
    record, model = trajectory.ending.record, trajectory.model
    key, kept = (record.visited, trajectory.t_end, trajectory.start.time), record.arrays.levels.told
    found = kept.find(key)
    if found is None:
        known = Known.of(model, segments)
        found = known, *known.around(trajectory)
        if not known.asked:
            kept.keep(key, found)
    known, before, after = found
    share, error = segments.verdict
    if tolerance is not None or not (share >= 0 and error >= 0):
        share, error = verdict_of(trajectory, tolerance)
    if not (share > 0 or error > 0):
        return before + after
    struck = known.rigid and error > 0 and _struck(trajectory)
    return before + left_out_warnings(model, (share, error), tolerance, struck) + after


@dataclass(frozen=True)
class Known:
    """What is known of a model before any run, and of the levels of a run before it comes there.

    rigid: there is a rigid contact. asked: whether friction, or the model's own check, looks into every run. before,
    clusters: warnings. fastest: the highest frequency of the open level [Hz]. slowest: the lowest of the levels that is
    not zero [rad/s]. ample: a time [s] in which all modes move.
    """

    rigid: bool
    asked: bool
    before: tuple[str, ...]
    clusters: tuple[str, ...]
    fastest: float
    slowest: float
    ample: float

    @classmethod
    def of(cls, model: MultiPhiModel, segments: Segments) -> Known:
        """Kept by the model."""
        key = ("warnings", segments.visited)
        found: Known | None = model.entries.find(key)
        return found or model.entries.keep(key, cls._of(model, segments.levels))

    @classmethod
    def _of(cls, model: MultiPhiModel, loaded: Sequence[LoadedLevel]) -> Known:
        levels = [level.modal for level in loaded]
        static = () if model.whole else static_warnings(levels)
        omega = np.concatenate([level.omega for level in levels])
        fastest = model.level_at(()).highest_frequency
        slowest = float(np.min(omega[omega > 0], initial=math.inf))
        return cls(
            any(contact.rigid for contact in model.contacts),
            model.general or model.validity is not None,
            (*damping_warnings(model), *missing_modes(model), *static),
            tuple(cluster_warnings(levels)),
            fastest,
            slowest,
            max(HARDLY / fastest if fastest > 0 else 0.0, SLOW / slowest),
        )

    def around(self, trajectory: Trajectory) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """What is told of a run before and after what truncation took of it.

        The same for all runs in the same levels, but where friction, or a model's own check, looks into the run.
        """
        before, after, excitation = self.before, self.clusters, trajectory.segments.levels[0].excitation
        brief = trajectory.t_end - trajectory.start.time < self.ample
        if brief:
            before = (*_slow(trajectory, self.fastest), *before)
        if brief or self.asked:
            after = (*after, *self._asked(trajectory))
        if excitation.histories and excitation.most_effort > MANY_PIECES < excitation.effort(trajectory.t_end):
            after = (*after, _load_pieces(excitation, trajectory.t_end))
        return before, after

    def _asked(self, trajectory: Trajectory) -> Iterator[str]:
        """What the model's own check, and friction, see in a run, and of a mode that has hardly begun."""
        model = trajectory.model
        if model.validity is not None:
            yield from model.validity(trajectory)
        yield from _slow_mode(trajectory, self.slowest)
        if model.general:
            yield from rubbing_warnings(trajectory.segments, model)
            yield from impact_warnings(trajectory)


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
        found.extend(energy_warning(share_lost(abs(run.truncated), run.energy)))
    return tuple(found)


def _slow(trajectory: Trajectory, fastest: float) -> Iterator[str]:
    """Not of runs that go on with one another, and not of a system that was reduced."""
    hardly = 0 < fastest * trajectory.t_end < HARDLY
    if hardly and not (trajectory.t_start > 0 or trajectory.model.validity is not None):
        yield (
            f"slow model: its fastest mode takes {1 / fastest:.3g} s for an oscillation, and the run lasts "
            f"{trajectory.t_end:.3g} s; are mass and stiffness swapped, or in different units?"
        )


def _struck(trajectory: Trajectory) -> bool:
    """Whether a rigid contact was struck."""
    return bool(np.any(event_table(trajectory.events, trajectory.model.index)[:, 2] > 0))


def _slow_mode(trajectory: Trajectory, slowest: float) -> Iterator[str]:
    """Of a mode of which a run sees so little that where loads move it is a difference of far places.

    p (1 - cos omega t) / omega^2 is p t^2 / 2, and its terms are 2 / (omega t)^2 of that.
    """
    span, levels = trajectory.t_end - trajectory.start.time, trajectory.segments.levels
    if 0 < slowest * span < SLOW and not all(level.excitation.nothing for level in levels):
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
