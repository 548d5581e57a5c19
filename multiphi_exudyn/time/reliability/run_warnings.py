"""Run warnings: what to distrust in the result of a run, and what to do about it.

Every warning is one plain sentence with its number. It begins with its kind and a colon; many runs group them by kind:

    "open ledger: ..."        energy that is not accounted for, or that friction, damping or impacts gave: the result is
                              wrong (ledger_warnings.py)
    "truncated contact: ..."  static flexibility that a closed compliant level's modes leave out (level.py): peak
                              contact forces are off; known before any run
    "truncated friction: ..." levels in which friction sticks with few modes: its force there is off
    "backward slip: ..."      truncated friction that moves against its slip (friction_warnings.py)
    "redundant contacts: ..." rigid contacts that share a load and rub differently (friction_warnings.py)
    "redundant friction: ..." friction whose share of the load, and begin of slip, is not unique (friction_warnings.py)
    "friction in turn: ..."   friction at rigid contacts that is decided in an order (friction_warnings.py)
    "force law: ..."          what the segments of a force law may do to the motion (law_warnings.py)
    "mesh impacts: ..."       energy that impacts take of a continuum, which the mesh decides (impact_warnings.py)
    "several impacts: ..."    an impact with friction for which Coulomb's law has several solutions (impact_warnings.py)
    "truncation: ..."         the estimate of the error of displacements (truncation.py), or a Tolerance not held, and
                              the energy lost with it
    "lost energy: ..."        energy lost to truncation, of the largest of the run, where displacements hold
    "digits: ..."             rigid-body modes, or frequencies, that the digits of the stiffness leave open
    "undamped modes: ..."     modes for which a list of modal ratios has none
    "damping ratios: ..."     ratios that look like per cent
    "law span: ..."           a force law that the motion drives out of its span (law_span.py)
    "missing modes: ..."      contacts of a structure of modes alone, where its static flexibility is not known
    "linear range: ..."       result of the model's own validity check
    "cluster: ..."            levels that keep more modes than asked for, so that no modes of one frequency are parted
    "base: ..."               motion or loads outside the base of a large structure (base_warnings.py)
    "slow mode: ..."          a mode that rests so far away that its motion is lost in round-off (far_rest.py), or so
                              slow that its motion under varying loads is
    "load pieces: ..."        loads of so many samples or pieces that the run takes long
    "coarse steps: ..."       steps of Exudyn that delay the motion of modes not matched to them
    "truncated statics: ..."  what the modes leave out of a static solution of Exudyn under forces on a body's interface
    "turning: ..."            a body in Exudyn that turns beyond the linear range, or may do so unseen
    "rigid interface ...: "   a rigid interface of a body that turns beyond the linear range
    "slow model: ..."         modes that hardly begin to move in the run: matrices swapped, or units mixed
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn._core import lost_share
from multiphi_exudyn.display import per_cent
from multiphi_exudyn.events.excitation.excitation import Excitation
from multiphi_exudyn.events.excitation.loaded_level import LoadedLevel
from multiphi_exudyn.levels.level.level import Level
from multiphi_exudyn.levels.model.mode_choice import Tolerance
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.time.reliability.far_rest import FarRest
from multiphi_exudyn.time.reliability.friction_warnings import friction_warnings
from multiphi_exudyn.time.reliability.impact_warnings import impact_warnings, is_taking, mesh_warnings, spread_contacts
from multiphi_exudyn.time.reliability.law_span import LawPlaces, laws_at_an_end, span_warnings
from multiphi_exudyn.time.reliability.law_warnings import approximated_laws, law_warnings
from multiphi_exudyn.time.reliability.ledger_warnings import ledger_warnings
from multiphi_exudyn.time.reliability.truncation_warnings import energy_warning, truncation_warnings, verdict_of
from multiphi_exudyn.time.segments.segment import Segments
from multiphi_exudyn.time.trajectory.trajectory import Trajectory
from multiphi_exudyn.time.warnings.model_warnings import (
    advised,
    cluster_warnings,
    damping_warnings,
    digit_warnings,
    missing_modes,
    static_warnings,
)

__all__ = ["ModelWarnings", "RunSummary", "warnings_of", "warnings_of_body"]

SLOW = 1e-8  # rad: phase of a mode at the end of a run; below it, 2e-8 of the response to varying loads is round-off
HARDLY = 0.01  # of a period of the fastest kept mode: so short a run is hardly intended
MANY_PIECES = 2**19  # of loads in a run: some seconds of computing and 250 MB
PIECE_SECONDS = 1e-5  # that a piece of a load takes in a small model
PIECE_BYTES = 500  # that it takes there, its segment included
EPSILON = float(np.finfo(float).eps)


def warnings_of(trajectory: Trajectory, tolerance: Tolerance | None = None) -> tuple[str, ...]:
    """Warnings of a run, one sentence each; tolerance: the one that decided its modes.

    All warnings but those of the ledger, of a far rest and of truncation are the same for runs of one length in the
    same levels, and are cached for them, unless friction, a force law that is approximated or at an end of its span, or
    the model's own check needs the motion of every run.
    """
    record, model = trajectory.ending.record, trajectory.model
    visited, cache = record.visited, record.loaded.told
    if not visited:
        return ()
    begun = trajectory.start.states
    key = visited, begun, trajectory.t_end, trajectory.start.time
    entry = cache.find(key)
    if entry is None:
        general = ModelWarnings.of(model, trajectory.segments)
        first = record.loaded.kept(begun)  # a run may leave it at once, so that it has no segment there
        passed = [*trajectory.segments.levels, *([] if begun in visited or first is None else [first])]
        entry = general, FarRest.of(passed), *general.for_run(trajectory)
        if not general.needs_motion:
            cache.keep(key, entry)
    general, rest, before, after = entry
    after = (*after, *rest.warnings(trajectory))
    if not trajectory.ending.ledger.is_balanced or len(record.left_out):
        before = (*ledger_warnings(trajectory), *before)
    if general.spread and is_taking(trajectory.ending.ledger):
        after = (*mesh_warnings(trajectory, general.spread), *after)
    share, error = trajectory.segments.verdict
    if tolerance is not None or not (share >= 0 and error >= 0):
        share, error = verdict_of(trajectory, tolerance)
    if tolerance is None and not (share > 0 or error > 0):
        return (*before, *after)
    struck = general.rigid and error > 0 and _struck(trajectory)
    return advised((*before, *truncation_warnings(model, (share, error), tolerance, struck), *after), tolerance)


@dataclass(frozen=True)
class ModelWarnings:
    """Warnings of a model and of the visited levels, which need no motion.

    rigid: whether there is a rigid contact. spread: names of those whose effective mass the mesh decides. needs_motion:
    whether friction, a force law that is approximated or at an end of its span, or the model's own check, needs the
    motion of every run. before, clusters: warnings. fastest: highest frequency of the open level [Hz]. slowest: lowest
    nonzero frequency of the levels [rad/s].
    """

    rigid: bool
    spread: tuple[str, ...]
    needs_motion: bool
    before: tuple[str, ...]
    clusters: tuple[str, ...]
    fastest: float
    slowest: float

    @classmethod
    def of(cls, model: MultiPhiModel, segments: Segments) -> ModelWarnings:
        """Warnings of a model in the levels of segments, kept by the model."""
        key = ("warnings", segments.visited)
        kept: ModelWarnings | None = model.entries.find(key)
        return kept or model.entries.keep(key, cls._of(model, segments.levels))

    @classmethod
    def _of(cls, model: MultiPhiModel, loaded: Sequence[LoadedLevel]) -> ModelWarnings:
        levels = [level.modal for level in loaded]
        static = () if model.whole else static_warnings(levels)
        omega = np.concatenate([level.omega for level in levels])
        return cls(
            any(contact.rigid for contact in model.contacts),
            spread_contacts(model),
            model.general
            or model.validity is not None
            or bool(approximated_laws(model) or laws_at_an_end(model, [v.states for v in loaded])),
            (*digit_warnings(model), *damping_warnings(model), *missing_modes(model), *static),
            tuple(cluster_warnings(levels)),
            model.level_at(()).highest_frequency,
            float(np.min(omega[omega > 0], initial=math.inf)),
        )

    def for_run(self, trajectory: Trajectory) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Warnings of a run before and after those of truncation.

        The same for all runs in the same levels, unless ``needs_motion``.
        """
        before, after, excitation = self.before, self.clusters, trajectory.segments.levels[0].excitation
        before = (*_slow(trajectory, self.fastest), *before)
        if self.needs_motion:
            after = (*after, *self._of_motion(trajectory))
        if excitation.histories:
            after = (*after, *_slow_mode(trajectory, self.slowest))
        if excitation.histories and excitation.most_effort > MANY_PIECES < excitation.effort(trajectory.t_end):
            after = (*after, _load_pieces(excitation, trajectory.t_end))
        return before, after

    def _of_motion(self, trajectory: Trajectory) -> Iterator[str]:
        """Warnings of the model's own check, of force laws, and of friction in a run."""
        model = trajectory.model
        if model.validity is not None:
            yield from model.validity(trajectory)
        yield from law_warnings(trajectory)
        yield from span_warnings(trajectory)
        if model.general:
            yield from friction_warnings(trajectory.segments, model)
            yield from impact_warnings(trajectory)


@dataclass(frozen=True)
class RunSummary:
    """Summary of a run of a body in Exudyn, which keeps no segments.

    levels: visited levels, each once. truncated: energy [J] lost to truncation at the start and at all events.
    energy: largest sampled kinetic and strain energy of the run [J]. places: of force laws beyond their spans.
    """

    levels: Sequence[Level]
    truncated: float
    energy: float
    places: LawPlaces


def warnings_of_body(model: MultiPhiModel, run: RunSummary) -> tuple[str, ...]:
    """Warnings of a run in Exudyn, from its levels and losses."""
    sentences = [*digit_warnings(model), *damping_warnings(model), *missing_modes(model)]
    if not model.whole:
        sentences.extend(static_warnings(run.levels))
        sentences.extend(energy_warning(lost_share(abs(run.truncated), run.energy)))
    sentences.extend(run.places.warnings)
    return tuple(sentences)


def _slow(trajectory: Trajectory, fastest: float) -> Iterator[str]:
    """Warning of a run too short for its modes; not for continued runs or reduced systems."""
    too_short = 0 < fastest * trajectory.t_end < HARDLY
    if too_short and not (trajectory.t_start > 0 or trajectory.model.validity is not None):
        yield (
            f"slow model: its fastest mode takes {1 / fastest:.3g} s for an oscillation, and the run lasts "
            f"{trajectory.t_end:.3g} s; are mass and stiffness swapped, or in different units?"
        )


def _struck(trajectory: Trajectory) -> bool:
    """Whether a rigid contact was struck."""
    return bool(np.any(trajectory.ending.record.impulses > 0))


def _slow_mode(trajectory: Trajectory, slowest: float) -> Iterator[str]:
    """Warning of a mode with so small a phase at the end of a run that sin(omega t) / omega has few digits."""
    span = trajectory.t_end - trajectory.start.time
    if 0 < slowest * span < SLOW:
        yield (
            f"slow mode: a mode of {slowest / (2 * math.pi):.3g} Hz has hardly begun in {span:g} s, so "
            f"{per_cent(min(1.0, EPSILON / (slowest * span)))} of what varying loads move it by is round-off; hold it, "
            "or make its stiffness exactly zero"
        )


def _load_pieces(excitation: Excitation, end: float) -> str:
    """Warning of loads with so many pieces that they determine the time and memory of a run to ``end`` [s]."""
    pieces = excitation.pieces(end)
    return (
        f"load pieces: the loads have {pieces} pieces in {end:g} s, each of which takes some "
        f"{1e3 * PIECE_SECONDS * excitation.effort(end) / pieces:.1g} ms and {PIECE_BYTES / 1000:g} kB; fewer "
        "samples, a larger tolerance or a lower highest frequency make the run shorter"
    )
