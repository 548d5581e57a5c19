"""Reliability: what to distrust in an answer, and what to do about it.

Every warning is one plain sentence with its number. It begins with its kind and a colon; many runs group them by kind:

    "truncated contact: ..."  static flexibility that a closed compliant level's modes leave out (level.py): peak
                              contact forces are off; known before any run
    "truncated friction: ..." levels in which friction sticks with few modes: its force there is off
    "backward slip: ..."      truncated friction that moves against its slip (rubbing.py)
    "redundant friction: ..." which of several bears the load, and when they slip, is not unique (rubbing.py)
    "friction in turn: ..."   rigid contacts that rub and turn at one instant, whose order may count (rubbing.py)
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
from multiphi_exudyn.levels.mode_choice import CONTACT_SHARE, Tolerance
from multiphi_exudyn.levels.model import MultiPhiModel
from multiphi_exudyn.mechanics.damping import ModalDamping
from multiphi_exudyn.mechanics.modal_structure import ModalStructure
from multiphi_exudyn.time.defects import Samples, indicator, total_defect
from multiphi_exudyn.time.rubbing import rubbing_warnings
from multiphi_exudyn.time.segment import Segments, listed
from multiphi_exudyn.time.trajectory import Trajectory

__all__ = ["RunSummary", "damping_warnings", "static_warnings", "warnings_of", "warnings_of_body"]

ENERGY_SHARE = 0.01  # of the largest energy of a run
INDICATOR = 0.03  # of the motion, where every contact that is struck is compliant
RIGID_INDICATOR = 0.05  # where a rigid one is: its impacts raise the indicator more than the error
PER_CENT = 0.5  # a ratio of a structure is below 0.1 mostly, and half of critical is hardly an oscillation any more
REMEDY = "give the model more modes, or modes=Tolerance(0.01)"

SLOW = 1e-5  # rad of a period that a run sees: with less, a millionth of what loads make is round-off
LEFT = 2e-8  # rad of a period: nothing but round-off, whose share falls with the square of what is seen
STICKING = 8  # modes beside friction that sticks: from there on its force is right to 5 % on the rig's beam
HARDLY = 0.01  # of a period of the fastest kept mode: a run so short is hardly one that was meant
MANY_PIECES = 2**19  # of loads in a run: some seconds of computing and 250 MB
PIECE_SECONDS = 1e-5  # that a piece of a load takes in a small model
PIECE_BYTES = 500  # that it takes there, its segment included


def warnings_of(trajectory: Trajectory, tolerance: Tolerance | None = None) -> tuple[str, ...]:
    """What a user must not miss of a run, one sentence each; tolerance: the one that its modes were decided by."""
    if not trajectory.segments:
        return ()
    model, segments, span = trajectory.model, listed(trajectory.segments), trajectory.t_end - trajectory.t_start
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
    if known.slowest * span < SLOW:
        found += _slow_mode(segments, known.slowest, span)
    if model.general:
        found += rubbing_warnings(segments, model)
    if excitation.histories and excitation.effort(trajectory.t_end) > MANY_PIECES:
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
            (*damping_warnings(model), *_missing_modes(model)),
            tuple(static),
            tuple(_clusters(levels)),
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
    found = [*damping_warnings(model), *_missing_modes(model)]
    if not model.whole:
        found.extend(static_warnings(run.levels))
        found.extend(_energy_warning(abs(run.truncated), run.energy))
    return tuple(found)


def static_warnings(levels: Sequence[Level]) -> Iterator[str]:
    """Of the contact of which the modes of these levels leave out most of the static flexibility."""
    yield from _sticking(levels)
    held = {link.name for level in levels[:1] for link in level.base.links if link.held}
    shares = [
        (share, name, level.modes)
        for level in levels
        for name, share in level.static_shares.items()
        if name not in held
    ]
    share, name, modes = max(shares, default=(0.0, "", 0))
    if share >= CONTACT_SHARE:
        others = len({other for value, other, _ in shares if value >= CONTACT_SHARE}) - 1
        also = f" (and at {others} more)" if others else ""
        yield (
            f"truncated contact: at {name!r}{also} {modes} modes leave out {per_cent(share)} of the static "
            f"flexibility of the closed level, so peak contact forces are not to be trusted; {REMEDY}"
        )


def _sticking(levels: Sequence[Level]) -> Iterator[str]:
    """Of friction that sticks in a level of few modes, which leave out much of its flexibility there."""
    found: dict[str, int] = {}
    for level in levels:
        for link in (level.base.links[i] for i in level.indices if level.modes < STICKING):
            if link.held and (link.rigid or level.static_shares.get(link.name, 0.0) >= CONTACT_SHARE):
                found[link.name] = min(level.modes, found.get(link.name, STICKING))
    if found:
        names = ", ".join(repr(name) for name in found)
        yield (
            f"truncated friction: {min(found.values())} modes hold what sticks at {names}, so its force may be off by "
            f"5 % and more until it slips; {REMEDY}"
        )


def _slow(trajectory: Trajectory, fastest: float) -> Iterator[str]:
    """Not of runs that go on with one another, and not of a system that was reduced."""
    if not (trajectory.t_start > 0 or trajectory.model.validity is not None):
        yield (
            f"slow model: its fastest mode takes {1 / fastest:.3g} s for an oscillation, and the run lasts "
            f"{trajectory.t_end:.3g} s; are mass and stiffness swapped, or in different units?"
        )


def damping_warnings(model: MultiPhiModel) -> Iterator[str]:
    """Of modal ratios that end before the modes do, or look like per cent."""
    damping = model.structure.damping
    if not isinstance(damping, ModalDamping):
        return
    listed = damping.listed
    if damping.beyond is None and 0 < len(listed) < (kept := model.level_at(()).modes):
        yield (
            f"undamped modes: ModalDamping lists {len(listed)} ratios and {kept} modes are kept, so modes "
            f"{len(listed) + 1} to {kept} are undamped; give beyond={listed[-1]:g}, or beyond=0.0 if that is meant"
        )
    if (largest := max(listed, default=0.0)) >= PER_CENT:
        yield (
            f"damping ratios: {largest:g} is {100 * largest:g} % of critical damping, which looks like a "
            "ratio in per cent; write 0.01 for 1 %"
        )


def _missing_modes(model: MultiPhiModel) -> Iterator[str]:
    """Of what acts on a structure of modes at points of which no static flexibility is known."""
    structure = model.structure
    if not isinstance(structure, ModalStructure):
        return
    names = [link.name for link in model.contacts]
    places = [{at} if isinstance(at, str) else {*at} for at in (link.direction for link in model.contacts)]
    told = dict.fromkeys(name for name, points in zip(names, places, strict=True) if not points <= structure.completed)
    if told:
        yield (
            f"missing modes: the structure has its modes up to {structure.highest:g} Hz alone, so "
            f"{', '.join(map(repr, told))} acts on too stiff a structure and its peak forces are not to be trusted"
            f"{_swinging(model, [names.index(name) for name in told], structure.highest)}; give structure_from_modes "
            "the static flexibility of the points there"
        )


def _swinging(model: MultiPhiModel, contacts: Sequence[int], highest: float) -> str:
    """How high above the highest mode [Hz] given modes swing on the stiffest of some contacts: sqrt(k h.M^-1 h)."""
    k, lengths = model.base.stiffnesses[contacts], model.base.lengths[contacts]
    swinging = np.sqrt(np.where(np.isfinite(k) & (k > 0), k, 0.0)) * lengths / (2 * math.pi)
    most = int(np.argmax(swinging))
    if not 0 < highest < swinging[most]:
        return ""
    return f" (on {k[most]:g} N/m these modes swing at up to {swinging[most]:.3g} Hz, where others would as well)"


def _left_out(trajectory: Trajectory, segments: Segments, tolerance: Tolerance | None) -> list[str]:
    """Of the energy that truncation took, whatever its sign at an instant, and of the motion that it did."""
    samples, found = Samples(segments, trajectory.t_end), list[str]()
    at_start = trajectory.start_loss.truncation_kinetic + trajectory.start_loss.truncation_strain
    at_events = segments.truncated
    if math.isnan(at_events):
        at_events = float(np.sum(np.abs(event_table(trajectory.events, trajectory.model.index)[:, 3])))
    lost, defects = abs(at_start) + at_events, total_defect(trajectory)
    if lost > 0 and lost > ENERGY_SHARE * abs(given := trajectory.initial_energy):
        alone = _left_alone(trajectory, segments)
        found += _energy_warning(lost, abs(given) if alone else max(samples.largest_energy, abs(given)))
    if defects != 0:
        y, size = trajectory.start.displacement, math.sqrt(defects)
        least = min(INDICATOR, tolerance.error if tolerance else INDICATOR)
        if not samples.amplitude_exceeds(size / least, math.sqrt(y.dot(y)) - size):
            found += _truncation(trajectory, indicator(defects, samples), tolerance)
    return found


def _left_alone(trajectory: Trajectory, segments: Segments) -> bool:
    """Whether nothing works on the structure from outside, so that it has no more energy than at its start."""
    excitation, model = segments.levels[0].excitation, trajectory.model
    return not (excitation.histories or np.any(excitation.static) or model.general or model.overrides)


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
            "give the tolerance a larger number of most modes, or a run of its own to decide by"
        )
    elif error > (RIGID_INDICATOR if rigid else INDICATOR):
        typical = ", with rigid contacts a quarter of that is typical" if rigid else ""
        yield f"truncation: displacements may be off by {per_cent(error)} of the motion{typical}; {REMEDY}"


def _clusters(levels: Sequence[Level]) -> list[str]:
    """One sentence where some of these levels keep modes beyond those asked for."""
    kept = [level for level in levels if level.kept_beyond]
    if not kept:
        return []
    most = max(kept, key=lambda level: level.kept_beyond)
    asked, name = most.modes - most.kept_beyond, ", ".join(most.closed) or "open"
    return [
        f"cluster: {len(kept)} of {len(levels)} levels keep more modes than asked for, level ({name}) {most.modes} in "
        f"place of {asked}, as a cut between modes of one frequency ({most.frequencies[asked - 1]:.6g} Hz) would be "
        f"arbitrary; ask for {most.modes} modes"
    ]


def _slow_mode(segments: Segments, slowest: float, span: float) -> Iterator[str]:
    """Of a mode of which a run of ``span`` [s] sees so little that where loads move it is a difference of far places.

    p (1 - cos omega t) / omega^2 is p t^2 / 2, and its terms are 2 / (omega t)^2 of that.
    """
    if any(np.any(level.excitation.static) or level.excitation.histories for level in segments.levels):
        share = min(1.0, LEFT / (slowest * span)) ** 2
        yield (
            f"slow mode: a mode of {slowest / (2 * math.pi):.3g} Hz has hardly begun in {span:g} s, so "
            f"{per_cent(share)} of what loads move it by is round-off; hold it, or make its stiffness exactly zero"
        )


def _load_pieces(excitation: Excitation, end: float) -> str:
    """Of loads that have so many pieces that they set the time and memory of a run to ``end`` [s]."""
    pieces = excitation.pieces(end)
    return (
        f"load pieces: the loads have {pieces} pieces in {end:g} s, some "
        f"{1e3 * PIECE_SECONDS * excitation.effort(end) / pieces:.1g} ms and {PIECE_BYTES / 1000:g} kB each; fewer "
        "samples, a larger tolerance or a lower highest frequency make the run shorter"
    )
