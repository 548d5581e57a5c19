"""Judgement of a native trajectory: energy, contact law, events; and when it is wrong.

    laws        what must hold of every run, along its analytic segments (run_laws.py): ledger, energy, missed contacts
                and at a few instants, from what it tells (law_check.py): motion, contact, friction, impacts, energy
    residual    |initial + work - losses - final| / E     E the largest energy of the run
    energy      by how much energy less the work of constant loads rises, over E; where others do any, the residual
    beyond      how far a contact is from its law [m]:
                open -a;   closed and rigid |g|;   closed and compliant max(g, |lambda + k g + c g'| / |k|)
                with a as in brute_force.py; a force law: |force on the structure + F(q)| / max |F'|
    pulling     most negative reaction of a rigid or viscous contact over the largest one
    friction    sticks: |T| - static limit;   slips: | |T| - limit |;   T against the slip: |T|;   all over the limit;
                its way, |h.x - v t - T / k - (the same at the start) - slip| [m], is among ``beyond``

A truncated model may leave negative gaps; its event rule says where, in the phases, and ``Trajectory.deepest_gap``
how deep. There only what no phase excuses is wrong, and a depth that the trajectory does not report.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.force_law import ForceLaw
from multiphi_exudyn.mechanics.friction import Friction
from multiphi_exudyn.study.law_check import broken_laws
from multiphi_exudyn.study.stability import run_laws
from multiphi_exudyn.study.stability.brute_force import (
    ContactSamples,
    SegmentTable,
    missed,
    sample_contact,
    sampling,
    switches_without_event,
    truncated,
)
from multiphi_exudyn.study.stability.case import Problem
from multiphi_exudyn.time.trajectory import Trajectory

__all__ = ["BEYOND", "Judgement", "judge"]

BEYOND = 1e-9  # m beyond the contact law
FRICTION = 1e-9  # of its limit: what a friction force may be off
PULLING = 1e-9  # of the largest reaction: round-off of a release
REPORTED = 0.5  # of a depth that sampling finds: less must not be reported; both are sampled, on different grids
ROUND_OFF = 1e-14  # of the largest way of a point that rubs, which a stiff spring makes a force
MOVED = 1e-9  # of the largest way of a point that rubs: a smaller slip between two samples has no direction
SMALL = 1e-6  # of a newton metre and of a metre: cases may be as small


@dataclass(frozen=True)
class Judgement:
    """See the module's docstring; lengths in the case's unit.

    truncated: whether a level has fewer modes than the structure has motions. unexcused: the part of ``beyond`` that no
    phase excuses. open_depth: deepest negative gap of an open contact. reported: the same, as the trajectory tells it.
    laws: complaints of run_laws.py and law_check.py. covered, samples: of the brute force.
    """

    laws: tuple[str, ...]
    energy: float
    residual: float
    events: int
    missed: int
    beyond: float
    unexcused: float
    open_depth: float
    pulling: float
    friction: float
    truncated: bool
    reported: float
    samples: int
    covered: float

    def complaints(self, metre: float) -> list[str]:
        """Violations of the criteria, one sentence each."""
        law = self.unexcused if self.truncated else self.beyond
        checks = [
            (not law <= BEYOND * metre, f"{law / metre:.1e} m beyond the contact law"),
            (not self.pulling <= PULLING, f"a contact pulls with {self.pulling:.1e} of its largest reaction"),
            (not self.friction <= FRICTION, f"friction off its law by {self.friction:.1e} of its limit"),
            (self.missed > 0, f"{self.missed} closings or openings without an event"),
            (self._hidden(metre), f"open {self.open_depth / metre:.1e} m deep, {self.reported / metre:.1e} m reported"),
        ]
        return [*self.laws, *(sentence for violated, sentence in checks if violated)]

    def _hidden(self, metre: float) -> bool:
        """Whether an open contact of a truncated model penetrates deeper than the trajectory reports."""
        return self.truncated and self.open_depth > max(BEYOND * metre, self.reported / REPORTED)


def judge(problem: Problem, trajectory: Trajectory, budget: int) -> Judgement:
    """Judge a trajectory with about ``budget`` samples of every contact."""
    table, grid, tolerance = SegmentTable.of(trajectory), sampling(trajectory, budget), BEYOND * problem.metre
    parts = problem.unilateral
    samples = [sample_contact(trajectory, contact, table, grid.times, problem.loads) for contact in parts]
    beyond = [_beyond(contact, values) for contact, values in zip(parts, samples, strict=True)]
    frictions = [_judge_friction(trajectory, friction, table, grid.times) for friction in problem.frictions]
    laws = [deviation for deviation, _, _ in frictions] + [
        _beyond_law(law, trajectory, grid.times) for law in problem.laws
    ]
    small, ends = SMALL * problem.metre, run_laws.ends_of(trajectory)
    largest = run_laws.largest_energy(trajectory, ends, small)
    residual = _share(trajectory.ledger.residual, largest)
    judged = run_laws.still(trajectory) and not problem.driven
    rise = _share(run_laws.energy_rise(trajectory, ends), largest) if judged else residual
    return Judgement(
        laws=(
            *run_laws.complaints(trajectory, joule=small, metre=small, varying=problem.driven, budget=budget),
            *broken_laws(trajectory, problem.loads, problem.start),
        ),
        energy=rise,
        residual=residual,
        events=len(trajectory.events),
        missed=sum(count for _, _, count in frictions)
        + sum(switches_without_event(trajectory, table, law.name) for law in problem.laws)
        + sum(
            missed(trajectory, values, table, contact.name, tolerance)
            for contact, values in zip(parts, samples, strict=True)
        ),
        beyond=_largest([*(np.max(values) for values in beyond), *laws]),
        unexcused=_largest(
            [*(np.max(v[~s.excused], initial=0.0) for v, s in zip(beyond, samples, strict=True)), *laws]
        ),
        open_depth=_largest([-np.min(s.apart[~s.closed], initial=0.0) for s in samples]),
        pulling=_pulling(parts, samples),
        friction=_largest([force for _, force, _ in frictions]),
        truncated=truncated(trajectory),
        reported=_largest([-trajectory.deepest_gap(contact.name) for contact in parts]),
        samples=len(grid.times),
        covered=grid.covered,
    )


def _largest(values: Sequence[float]) -> float:
    return float(max(values, default=0.0))


def _share(part: float, whole: float) -> float:
    return abs(part) / whole if whole > 0 else abs(part)


def _beyond(contact: UnilateralContact, seen: ContactSamples) -> np.ndarray:
    """Distance from the contact law (k,)."""
    if contact.rigid:
        closed = np.abs(seen.gap)
    else:
        closed = np.maximum(seen.gap, np.abs(seen.force / contact.stiffness + seen.gap + seen.slowed))
    return np.maximum(0.0, np.where(seen.closed, closed, -seen.apart))


def _beyond_law(law: ForceLaw, trajectory: Trajectory, times: np.ndarray) -> float:
    """Largest distance from a force law: what its force is off by, over its steepest slope [m]."""
    q, forces = np.asarray(trajectory.at(law.at, times)), np.asarray(trajectory.contact_force(law.name, times))
    return float(np.max(np.abs(forces + law.force(q))) / np.max(np.abs(law.slopes)))


def _pulling(contacts: Sequence[UnilateralContact], seen: Sequence[ContactSamples]) -> float:
    worst = 0.0
    for contact, found in zip(contacts, seen, strict=True):
        if (contact.rigid or contact.damping > 0) and np.any(found.closed):
            worst = max(worst, _share(min(0.0, float(np.min(found.force))), float(np.max(np.abs(found.force)))))
    return worst


def _judge_friction(
    trajectory: Trajectory, friction: Friction, table: SegmentTable, times: np.ndarray
) -> tuple[float, float, int]:
    """Of a friction at times (k,) [s]: its way [m], its force, and changes of its state without an event."""
    name, i = friction.name, trajectory.model.index(friction.name)
    tension = np.asarray(trajectory.friction_force(name, times))
    slip, place = np.asarray(trajectory.slip(name, times)), np.asarray(trajectory.at(friction.direction, times))
    patch = place - friction.velocity * times - tension / friction.stiffness
    owner = table.owners(times)
    sticks, one = table.closed[owner, i], np.diff(owner) == 0
    beyond = np.where(sticks, np.abs(tension) - friction.most, np.abs(np.abs(tension) - friction.limit))
    moved = np.diff(slip)
    against = one & (moved * tension[1:] < 0) & (np.abs(moved) > MOVED * np.max(np.abs(place), initial=0.0))
    force = max(float(np.max(beyond)), float(np.max(np.abs(tension[1:][against]), initial=0.0)))
    spring = 0.0 if friction.rigid else friction.stiffness
    force -= ROUND_OFF * spring * float(np.max(np.abs(place), initial=0.0))
    way = float(np.max(np.abs(patch - patch[0] - slip)))
    return way, max(0.0, force) / friction.limit, switches_without_event(trajectory, table, name)
