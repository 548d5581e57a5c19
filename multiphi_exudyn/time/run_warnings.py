"""Run warnings: what to distrust in the result of a run, and what to do about it.

Every warning is one plain sentence with its number. It begins with its kind and a colon; many runs group them by kind:

    "open ledger: ..."        energy that is not accounted for, or that friction, damping or impacts gave: the result is
                              wrong
    "truncated contact: ..."  static flexibility that a closed compliant level's modes leave out (level.py): peak
                              contact forces are off; known before any run
    "truncated friction: ..." levels in which friction sticks with few modes: its force there is off
    "backward slip: ..."      truncated friction that moves against its slip
    "redundant contacts: ..." rigid contacts that share a load and rub differently
    "redundant friction: ..." friction whose share of the load, and begin of slip, is not unique
    "friction in turn: ..."   friction at rigid contacts that is decided in an order
    "force law: ..."          what the segments of a force law may do to the motion (law_warnings.py)
    "mesh impacts: ..."       energy that impacts take of a continuum, which the mesh decides
    "several impacts: ..."    an impact with friction for which Coulomb's law has several solutions
    "truncation: ..."         the estimate of the error of displacements (truncation.py), or a Tolerance not held, and
                              the energy lost with it
    "lost energy: ..."        energy lost to truncation, of the largest of the run, where displacements hold
    "digits: ..."             rigid-body modes, or frequencies, that the digits of the stiffness leave open
    "undamped modes: ..."     modes for which a list of modal ratios has none
    "damping ratios: ..."     ratios that look like per cent
    "law span: ..."           a force law that the motion drives out of its span (law_warnings.py)
    "missing modes: ..."      contacts of a structure of modes alone, where its static flexibility is not known
    "linear range: ..."       result of the model's own validity check
    "cluster: ..."            levels that keep more modes than asked for, so that no modes of one frequency are parted
    "base: ..."               motion or loads outside the base of a large structure (model_warnings.py)
    "slow mode: ..."          a mode that rests so far away that its motion is lost in round-off, or so slow that its
                              motion under varying loads is
    "load pieces: ..."        loads of so many samples or pieces that the run takes long
    "coarse steps: ..."       steps of Exudyn that delay the motion of modes not matched to them
    "truncated statics: ..."  what the modes leave out of a static solution of Exudyn under forces on a body's interface
    "turning: ..."            a body in Exudyn that turns beyond the linear range, or may do so unseen
    "rigid interface ...: "   a rigid interface of a body that turns beyond the linear range
    "slow model: ..."         modes that hardly begin to move in the run: matrices swapped, or units mixed

What a run loses because a level rests far away from where the structure moves ("slow mode"):

    eps |y_inf| sqrt(N + 1) > LOST |y|

A level moves about its static response y_inf under constant forces. Where hardly anything holds a mode, y_inf =
p / omega^2 may lie a million times farther away than the structure comes, and y, the sum of both, has the round-off
eps |y_inf|. Each of N events makes a new one; being independent, they add up as their root. |y| is the root mean
square of the run.

LOST is calibrated on 1277 nearly free structures of the campaign (tests/campaign, kind "nearly free") against brute
force: 71 displacements were off by a millionth and more, and had 7e-8 or more but for one of few digits and one that
is sensitive by itself; right ones had 3e-8 at most. Extreme cases of the catalogue have less than 1e-11.

An energy balance is open, or friction, damping or impacts gave energy ("open ledger"):

    |residual| > OPEN (|initial| + |work of loads| + |final| + sum of |losses|)

In a right run both sides agree to round-off, 1e-12 of these energies in the worst of some thousand random runs. It is
more only where they are small beside what the loads could give, of which ROUND_OFF is allowed: p t of every mode, t no
longer than the run and than the mode moves one way. A wrong force or a wrong impulse opens the ledger by its whole
work. OPEN lies far from both.

The core balances its sums when a run ends; only where it finds them open, or has left works out, the ledger
is made.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg.blas import dnrm2

from multiphi_exudyn._core import OPEN_LEDGER as OPEN
from multiphi_exudyn._core import lost_share
from multiphi_exudyn.display import per_cent
from multiphi_exudyn.levels.level.level import Level
from multiphi_exudyn.levels.model.mode_choice import Tolerance
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.time.contact_warnings import (
    friction_warnings,
    impact_warnings,
    is_taking,
    mesh_warnings,
    spread_contacts,
)
from multiphi_exudyn.time.excitation import Excitation
from multiphi_exudyn.time.law_warnings import LawPlaces, approximated_laws, law_warnings, laws_at_an_end, span_warnings
from multiphi_exudyn.time.ledger import Ledger
from multiphi_exudyn.time.loaded_level import LoadedLevel
from multiphi_exudyn.time.model_warnings import (
    advised,
    cluster_warnings,
    damping_warnings,
    digit_warnings,
    missing_modes,
    static_warnings,
)
from multiphi_exudyn.time.segments import Segments
from multiphi_exudyn.time.trajectory import Trajectory
from multiphi_exudyn.time.truncation import energy_warning, truncation_estimate, truncation_warnings

__all__ = ["FarRest", "ModelWarnings", "RunSummary", "ledger_warnings", "warnings_of", "warnings_of_body"]

SLOW = 1e-8  # rad: phase of a mode at the end of a run; below it, 2e-8 of the response to varying loads is round-off
HARDLY = 0.01  # of a period of the fastest kept mode: so short a run is hardly intended
MANY_PIECES = 2**19  # of loads in a run: some seconds of computing and 250 MB
PIECE_SECONDS = 1e-5  # that a piece of a load takes in a small model
PIECE_BYTES = 500  # that it takes there, its segment included
EPSILON = float(np.finfo(float).eps)
LOST = 5e-8  # of the displacements: a larger round-off may grow to a millionth of them
GROWN = 3.0  # root mean squares: where a motion ends that grows with t^2, and more
SAMPLES = 257  # of the displacements, for their root mean square
SAMPLES = 257  # of the speed, for its largest value
ROUND_OFF = 1e-9  # of the largest energy of a run, and of what its loads could give
REMEDY = (
    "this result is not to be trusted: run it again with a small stiffness where there is none, or a finite one where "
    "it is infinite, and report the case"
)


def warnings_of(trajectory: Trajectory, tolerance: Tolerance | None = None) -> tuple[str, ...]:
    """Warnings of a run, one sentence each; tolerance: the one that decided its modes."""
    record, model = trajectory.ending.record, trajectory.model
    if not record.visited:
        return ()
    general, begun = ModelWarnings.of(model, record), trajectory.start.states
    first = record.loaded.kept(begun)  # a run may leave it at once, so that it has no segment there
    passed = [*record.levels, *([] if begun in record.visited or first is None else [first])]
    before, after = general.for_run(trajectory)
    after = (*after, *FarRest.of(passed).warnings(trajectory))
    if not trajectory.ending.ledger.is_balanced or len(record.left_out):
        before = (*ledger_warnings(trajectory), *before)
    if general.spread and is_taking(trajectory.ending.ledger):
        after = (*mesh_warnings(trajectory, general.spread), *after)
    share, error = record.truncation.energy_share, record.truncation.motion
    if tolerance is not None or not (share >= 0 and error >= 0):
        share, error = truncation_estimate(trajectory, tolerance)
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
            yield from friction_warnings(trajectory.ending.record, model)
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


@dataclass(frozen=True)
class FarRest:
    """The largest |y_inf| of some levels, and the frequency omega [rad/s] of the mode along which it mainly lies."""

    distance: float
    omega: float

    @classmethod
    def of(cls, levels: Sequence[LoadedLevel]) -> FarRest:
        """The farthest rest of these levels."""
        distances = [float(np.linalg.norm(level.asymptotic.configuration)) for level in levels]
        level = levels[int(np.argmax(distances))]
        along = np.abs(level.modal.vectors.T @ level.asymptotic.configuration)
        return cls(max(distances), float(level.modal.omega[np.argmax(along)]) if len(along) else 0.0)

    def warnings(self, trajectory: Trajectory) -> Iterator[str]:
        """At most one warning of a run in these levels."""
        level, events = trajectory.ending.level, len(trajectory.events)
        round_off = EPSILON * self.distance * math.sqrt(events + 1)
        if level is None:
            return
        last = level.configuration(trajectory.ending.displacement)
        if GROWN * round_off <= LOST * math.sqrt(last.dot(last)):  # most runs end far beyond it
            return
        times = np.linspace(trajectory.t_start, trajectory.t_end, SAMPLES)
        places = trajectory.model.base.coordinates(trajectory.displacement(times))
        size = max(round_off, float(dnrm2(places.ravel())) / math.sqrt(SAMPLES))  # does not overflow
        if round_off > LOST * size:
            more = f", and more where its {events} events enlarge it" if events else ""
            yield (
                f"slow mode: a mode of {self.omega / (2 * math.pi):.3g} Hz rests {self.distance / size:.2g} times as "
                f"far away as the structure moves, so {per_cent(round_off / size)} of the motion is round-off{more}; "
                "hold it, or make its stiffness exactly zero"
            )


def ledger_warnings(trajectory: Trajectory) -> Iterator[str]:
    """At most one warning of a run with motion."""
    ledger = trajectory.ledger
    taken = {"friction": ledger.friction, "impact": ledger.impact}
    if trajectory.model.whole and not trajectory.model.overrides:  # dampers give back what truncation lets them
        taken["damping"] = ledger.damping
    name = min(taken, key=taken.__getitem__)
    given, limit = -taken[name], OPEN * ledger.turned_over
    if max(abs(ledger.residual), given) <= limit:
        return
    limit = max(limit, ROUND_OFF * _largest(trajectory))
    if abs(ledger.residual) > limit:
        yield f"open ledger: {_share(ledger.residual, ledger)} is not accounted for; {REMEDY}"
    elif given > limit:
        yield f"open ledger: {name} gave {_share(given, ledger)}, and can only take; {REMEDY}"


def _share(energy: float, ledger: Ledger) -> str:
    """An energy [J] as a share of those turned over."""
    return f"{per_cent(abs(energy) / ledger.turned_over)} of the energies turned over"


@np.errstate(over="ignore", invalid="ignore")  # of a run that grew without end
def _largest(trajectory: Trajectory) -> float:
    """Largest total and kinetic energy [J] of a run, or that which its loads could give the structure."""
    speeds = trajectory.model.base.coordinates(
        trajectory.velocity(np.linspace(trajectory.t_start, trajectory.t_end, SAMPLES))
    )
    kinetic = 0.5 * float(np.max(np.sum(speeds**2, axis=0)))
    omega, span = trajectory.model.base.modes.omega, trajectory.t_end - trajectory.start.time
    times = np.minimum(np.divide(1.0, omega, out=np.full(len(omega), span), where=omega > 0), span)
    loads = trajectory.segments.levels[0].excitation.largest_load
    return max(trajectory.ending.record.sizes(trajectory.t_end)[1], kinetic, 0.5 * float(np.sum((loads * times) ** 2)))
