"""Laws that hold for every run of any model: each check returns a message about a violation, or None.

The checks use the analytic segments of the trajectory, independently of the event search.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Iterator, Sequence

import numpy as np

from multiphi_exudyn.events.transitions.state import Phase, total_loss
from multiphi_exudyn.levels.base.modal_base import ModalBase
from multiphi_exudyn.mathematics.round_off import ZERO
from multiphi_exudyn.mechanics.element import Element
from multiphi_exudyn.mechanics.friction import Friction
from multiphi_exudyn.study.stability.run_signals import Signal
from multiphi_exudyn.time.ledger import Ledger
from multiphi_exudyn.time.segments import Segment
from multiphi_exudyn.time.trajectory import Trajectory

__all__ = ["complaints", "ends_of", "energy_rise", "largest_energy", "missed", "still"]

CLOSES = 1e-9  # of the largest energy: what the ledger may leave open, and what a row may be below zero
RUBBED = 1e-10  # the same where there is friction
NO_TRUNCATION = 1e-9  # of the largest energy: what a complete basis may lose between levels
MISSED = 1e-11  # of a signal's largest possible value: a dip that is no round-off
LAW = 1e-8  # of the same: a complete basis' violation of the law of contact
DIFFERENCE = 1e-2  # of a level's potential: energies are differences of it; of CLOSES it is round-off, of omega^2 too
PASSED = 1e-5  # the same of what a start, an instant or a sum passes through: a few round-offs of its potential
SMALLEST = 1e-6  # J, m: less is round-off in cases whose masses, stiffnesses and gaps are about 1
ROUND_OFFS = 8  # of the time: an instant is known to so many
INSTANT = 1e-12  # of the run: a shorter segment has no times of its own
INSIDE = 5  # instants of a segment at which its reach is read

SLIPS_UP = 1  # a state of friction: stick is before it, slip downwards after it
EXPECTED_FAILURES = ("not independent of each other",)  # causes that are the scene's own


def complaints(
    run: Trajectory,
    samples: float = 24.0,
    most: int = 60,
    *,
    joule: float = 1.0,
    metre: float = 1.0,
    varying: bool = False,
    budget: float = np.inf,
) -> list[str]:
    """Messages about all violated laws of a run.

    samples: per shortest period. most: segments. joule, metre: in its units. varying: loads or stops vary in time,
    whose work only the ledger knows. budget: samples of a contact on a segment, above which the segment is not
    checked for missed events.
    """
    if not run.segments:
        return [complaint for complaint in (status(run),) if complaint]
    checked = ends_of(run, most)
    scale = largest_energy(run, checked, joule)
    checks = [status(run), ledger(run, scale), missed(run, checked, samples, metre, budget)]
    if not varying and still(run):
        checks.append(energy(run, checked, scale))
    return [complaint for complaint in checks if complaint]


def still(run: Trajectory) -> bool:
    """Whether no counter-surface moves; its work is in the ledger only."""
    return not any(link.velocity for link in run.model.links)


def ends_of(run: Trajectory, most: int = 60) -> list[Segment]:
    """The first and the last segments of a run, at most ``most`` in all."""
    return [*run.segments[: most // 2], *run.segments[max(most // 2, len(run.segments) - most // 2) :]]


def status(run: Trajectory) -> str | None:
    """ "ok", or a failure that names an instant and a cause which lies in the scene."""
    if run.status == "ok":
        return None
    if not run.message.startswith("at t = ") or not any(cause in run.message for cause in EXPECTED_FAILURES):
        return f"status: {run.message}"
    return None


def largest_energy(run: Trajectory, segments: Sequence[Segment], joule: float = 1.0) -> float:
    """What round-off of energies is measured against [J]: the largest at the ends of these segments."""
    ledger = run.ledger
    times = np.unique([time for segment in segments for time in (segment.start, segment.end)])
    stored = np.max(np.abs(run.energy(times)))
    work = np.max(np.abs(_work(run, times)))
    rests = DIFFERENCE * max(map(_potential, segments))
    passed = PASSED * abs(run.model.level(()).asymptotic(run.load).potential)
    passed = max(passed, PASSED * max((abs(event.loss.truncation_strain) for event in run.events), default=0.0))
    passed = max(passed, PASSED * _stretched(run), PASSED * max(_summed(run, segment) for segment in segments))
    entered = [run.segments[first] for first in np.unique(run.segments.numbers, return_index=True)[1]]
    passed = max(passed, PASSED * max(map(_potential_terms, entered)))
    return max(ledger.initial, abs(ledger.work_of_loads), float(stored), float(work), SMALLEST * joule, rests, passed)


def _stretched(run: Trajectory) -> float:
    """Energy [J] of friction springs if the start stretched them: a scale of round-off, as it does not."""
    links, places = run.model.links, run.start.displacement @ run.model.base.directions
    return sum(
        0.5 * link.stiffness * place**2
        for link, place in zip(links, places.tolist(), strict=True)
        if link.held and not link.rigid
    )


def _start(segment: Segment) -> np.ndarray:
    """Coordinates xi (n,) where a segment starts."""
    return segment.modal(np.array([segment.start]))[:, 0]


def _summed(run: Trajectory, segment: Segment) -> float:
    """Work [J] of the loads over the absolute terms of a motion, which may cancel (t and exp(-c t) with damping)."""
    terms = np.abs(segment.level.level.vectors) @ np.sum(np.abs(segment.rows), axis=1)
    return float(np.abs(_load(run, segment)) @ terms)


def _potential(segment: Segment) -> float:
    """The larger one [J] of a level at rest, and where a segment starts: there a varying load has its present value."""
    return max(abs(segment.level.asymptotic.potential), abs(segment.level.potential(_start(segment))))


def _potential_terms(segment: Segment) -> float:
    """Absolute terms [J] of a level's potential where a segment starts; of a load on what hardly moves they cancel."""
    form = segment.level.potential_form
    absolute = dataclasses.replace(
        form,
        constant=0.0,
        linear=np.zeros_like(form.linear),
        squares=np.abs(form.squares),
        rows=np.abs(form.rows),
        follows=form.follows[:0],
    )
    return absolute(np.abs(_start(segment)))


def _ledger_of_trajectory(run: Trajectory) -> Ledger:
    """The ledger with the energies of the first and the last state, and with the losses of the events.

    The run's own ledger has them from sums of the loop: both agree where the loop has summed what it tells.
    """
    assert run.final is not None, "a run with segments has a final state"
    losses = run.start_loss + total_loss(run.events)
    return dataclasses.replace(
        run.ledger,
        initial=_start_energy(run),
        impact=losses.impact,
        truncation_kinetic=losses.truncation_kinetic,
        truncation_strain=losses.truncation_strain,
        final=run.final.level.energy(run.final.displacement, run.final.velocity),
    )


def _start_energy(run: Trajectory) -> float:
    """Kinetic and strain energy [J] at the start, before anything has happened there."""
    start, base = run.start, run.model.base
    if start.state is not None:
        return start.state.level.energy(start.state.displacement, start.state.velocity)
    gaps = base.gaps_at(start.displacement, start.gaps) if start.penetrating else start.gaps
    kinetic = 0.5 * float(start.velocity @ start.velocity)
    return kinetic + strain_energy(base, start.displacement, start.penetrating, gaps)


def strain_energy(base: ModalBase, y: np.ndarray, closed: Sequence[int], gaps: np.ndarray) -> float:
    """Energy [J] of the structure at y (m,), of closed springs at their gaps, (l,), and of constant forces of laws."""
    index = list(closed)
    springs = 0.5 * float(base.springs[index] @ gaps[index] ** 2)
    return 0.5 * float(base.squares @ y**2) + springs + base.energy_offset - float(base.preload @ y)


def ledger(run: Trajectory, scale: float) -> str | None:
    """It closes; impact, damping, friction and kinetic truncation take energy; without truncation no strain is lost.

    So does that of the trajectory's own states and events, which shares with it only the works within segments.

    The strain row alone may be negative, and only in a truncated basis: an instant that leaves a gap which is not
    zero can stretch the spring of the level that it enters.
    """
    found = _ledger_of_trajectory(run)
    rows = {"impact": found.impact, "truncation_kinetic": found.truncation_kinetic, "damping": found.damping}
    rows["friction"] = found.friction
    for name, value in rows.items():
        if not value >= -CLOSES * scale:
            return f"ledger: {name} {value:g} of {scale:g} J"
    for residual in (found.residual, run.ledger.residual):
        if not abs(residual) <= (RUBBED if run.model.rubbing else CLOSES) * scale:
            return f"ledger: residual {residual:g} of {scale:g} J"
    if not abs(found.truncation_strain) + abs(found.truncation_kinetic) <= NO_TRUNCATION * scale and _complete(run):
        return f"ledger: truncation {found.truncation_strain:g}, {found.truncation_kinetic:g} of {scale:g} J"
    return None


def energy(run: Trajectory, segments: Sequence[Segment], scale: float) -> str | None:
    """Energy less the work of loads never rises."""
    worst = energy_rise(run, segments)
    return f"energy: rises by {worst:g} J" if worst > NO_TRUNCATION * scale else None


def energy_rise(run: Trajectory, segments: Sequence[Segment], samples: int = 5) -> float:
    """By how much [J] energy less the work of loads rises; in a truncated basis within segments alone."""
    ends = [(segment.start, segment.end) for segment in segments if segment.end - segment.start > INSTANT * run.t_end]
    if not ends:
        return 0.0
    inside = np.linspace(0, 1, samples + 2)[1:-1]
    times = np.array([start + inside * (end - start) for start, end in ends])
    left = (run.energy(times.ravel()) - _work(run, times.ravel())).reshape(times.shape)
    rises = np.diff(left.ravel()) if _complete(run) else np.diff(left, axis=1).ravel()
    returned = max([0.0, *(-event.loss.damping for event in run.events)])  # by dampers, which mostly take
    return max(0.0, float(np.max(rises, initial=0.0)) - returned)


def missed(
    run: Trajectory, segments: Sequence[Segment], samples: float, metre: float = 1.0, budget: float = np.inf
) -> str | None:
    """No contact leaves the admissible range of its state without an event: s >= 0 (core/law).

    In a truncated basis this is checked for armed contacts and for closed rigid ones, which never pull. Round-off is
    that of the whole run: an impact that stops all motion leaves a state that is round-off of the one before, and a
    reaction is zero to the law where it is within ZERO of the terms that coordinates of the run make of it, or within
    round-off of the terms of which coordinates are the sum: a level may move about an equilibrium that is far away.
    """
    complete, reach = _complete(run), _reach(segments, SMALLEST * metre)
    place_round_off = max(ZERO * reach, ROUND_OFFS * np.finfo(float).eps * max(map(_coordinate_terms, segments)))
    largest: dict[tuple[int, str], float] = {}
    checked = list(_signals(segments, run, complete))
    for segment, contact, _, signal in checked:
        key, own = (contact, signal.of), signal.size(segment.end - segment.start)
        most = np.max(np.abs(_load(run, segment))) if signal.of == "reaction" else reach * signal.per_metre()
        largest[key] = max(largest.get(key, 0.0), own, signal.arm * most)
    for segment, contact, armed, signal in checked:
        if signal.samples(segment.end - segment.start, samples) > budget:
            continue
        size = largest[contact, signal.of]
        lowest, at = signal.lowest(segment.end - segment.start, samples)
        unresolved = ROUND_OFFS * np.finfo(float).eps * segment.end * signal.steepness(at)
        unresolved += signal.grain * place_round_off
        if lowest < -(MISSED if armed else LAW) * size - unresolved:
            name = run.model.contacts[contact].name
            return f"missed: {name} at {segment.start + at:.9g} s, {lowest / size:g} of its size"
    return None


def _signals(
    segments: Sequence[Segment], run: Trajectory, complete: bool
) -> Iterator[tuple[Segment, int, bool, Signal]]:
    """(segment, contact, whether it is armed, its signal) for all signals to be checked."""
    for segment in segments:
        phases = iter(segment.phases)
        for contact, element in enumerate(run.model.contacts):
            link, state = run.model.link_indices[contact][0], segment.level.states[contact]
            if len(run.model.link_indices[contact]) > 1:  # a contact with friction: brute force judges it
                list(itertools.islice(phases, len(element.states[state].exits)))
                continue
            for arguments in _signal_arguments(element, link in segment.level.level.indices, state):
                phase, signal = next(phases), Signal(segment, link, *arguments)
                if element.damping:
                    continue  # its signal is a force with a rate of its own: brute force judges it
                if segment.end > segment.start and (phase is Phase.ARMED or complete or signal.of == "reaction"):
                    yield segment, contact, phase is Phase.ARMED, signal


def _signal_arguments(element: Element, closed: bool, state: int) -> list[tuple[str, float, float]]:
    """Quantity, factor and constant of each signal of an element in a state."""
    if isinstance(element, Friction):
        if closed:
            kind = "reaction" if element.rigid else "tension"
            return [(kind, s, element.most) for s in (1.0, -1.0)]
        return [("rate", 1.0 if state == SLIPS_UP else -1.0, 0.0)]
    if not closed:
        return [("gap", 1.0, 0.0)]
    return [("reaction", 1.0, 0.0) if element.rigid else ("gap", -1.0, 0.0)]


def _reach(segments: Sequence[Segment], smallest: float) -> float:
    """Largest coordinate y of the run, also within segments: the scale of round-off of a gap at rest."""
    times = [np.linspace(segment.start, segment.end, INSIDE) for segment in segments]
    places = [segment.level.configuration(segment.modal(t)) for segment, t in zip(segments, times, strict=True)]
    return max([smallest, *(float(np.max(np.abs(y), initial=0.0)) for y in places)])


def _coordinate_terms(segment: Segment) -> float:
    """Largest sum of the absolute terms of a coordinate y where a segment starts."""
    level = segment.level
    terms = np.abs(level.level.vectors) @ np.abs(_start(segment)) + np.abs(level.asymptotic.configuration)
    return float(np.max(terms, initial=0.0))


def _complete(run: Trajectory) -> bool:
    return run.model.modes == "all"


def _load(run: Trajectory, segment: Segment) -> np.ndarray:
    """Constant loads (m,); those that pull at damped rigid-body motion are a channel (excitation.py)."""
    _, w = segment.level.split(_start(segment))
    return segment.level.excitation.load(w)


def _work(run: Trajectory, times: np.ndarray) -> np.ndarray:
    """Work of the constant loads since the start [J]."""
    starts = np.array([segment.start for segment in run.segments])
    owner = np.maximum(np.searchsorted(starts, times, side="right") - 1, 0)
    work = np.empty(len(times))
    for k in np.unique(owner):
        segment, part = run.segments[k], owner == k
        moved = (
            segment.level.level.vectors @ segment.modal(times[part])
            + (segment.level.asymptotic.configuration - run.start.displacement)[:, None]
        )
        work[part] = _load(run, segment) @ moved
    return work
