"""Judgement of a native trajectory: energy, contact law, events; and when it is wrong.

    residual    |initial + work - losses - final| / E     E the largest energy of the run
    energy      undamped, unforced: max |energy(t) + losses until t - initial| / E; else the residual
    beyond      how far a contact is from its law [m]:
                open -a;   closed and rigid |g|;   closed and compliant max(g, |lambda + k g + c g'| / |k|)
                with a as in brute_force.py; a force law: |force on the structure + F(q)| / max |F'|
    pulling     most negative reaction of a rigid or viscous contact over the largest one
    friction    see friction_judgement.py: its ways are among ``beyond``

A truncated model may leave negative gaps; its event rule says where, in the phases, and ``Trajectory.deepest_gap``
how deep. There only what no phase excuses is wrong, and a depth that the trajectory does not report.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.force_law import ForceLaw
from multiphi_exudyn.study.stability.brute_force import (
    ContactSamples,
    SegmentTable,
    missed,
    sample_contact,
    sampling,
    truncated,
    untold_switches,
)
from multiphi_exudyn.study.stability.case import Problem
from multiphi_exudyn.study.stability.friction_judgement import judge_friction
from multiphi_exudyn.time.trajectory import Trajectory

__all__ = ["BEYOND", "RESIDUAL", "Judgement", "judge"]

RESIDUAL = 1e-9  # of the largest energy: what a ledger may leave over
BEYOND = 1e-9  # m beyond the contact law
FRICTION = 1e-9  # of its limit: what a friction force may be off
PULLING = 1e-9  # of the largest reaction: round-off of a release
REPORTED = 0.5  # of a depth that sampling finds: less must not be reported; both are sampled, on different grids
LOOKS = 1000  # segments at whose ends the energy is looked at


@dataclass(frozen=True)
class Judgement:
    """See the module's docstring; lengths in the case's unit.

    truncated: whether a level has fewer modes than the structure has motions. unexcused: the part of ``beyond`` that no
    phase excuses. open_depth: deepest negative gap of an open contact. reported: the same, as the trajectory tells it.
    covered, samples: of the brute force.
    """

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
        """What makes the answer wrong, one sentence each."""
        law = self.unexcused if self.truncated else self.beyond
        found = [
            (not self.residual <= RESIDUAL, f"ledger residual {self.residual:.1e} of the largest energy"),
            (not self.energy <= RESIDUAL, f"energy off by {self.energy:.1e}"),
            (not law <= BEYOND * metre, f"{law / metre:.1e} m beyond the contact law"),
            (not self.pulling <= PULLING, f"a contact pulls with {self.pulling:.1e} of its largest reaction"),
            (not self.friction <= FRICTION, f"friction off its law by {self.friction:.1e} of its limit"),
            (self.missed > 0, f"{self.missed} closings or openings without an event"),
            (self._hidden(metre), f"open {self.open_depth / metre:.1e} m deep, {self.reported / metre:.1e} m reported"),
        ]
        return [sentence for is_so, sentence in found if is_so]

    def _hidden(self, metre: float) -> bool:
        """Whether an open contact of a truncated model lies deeper than the trajectory tells."""
        return self.truncated and self.open_depth > max(BEYOND * metre, self.reported / REPORTED)


def judge(problem: Problem, trajectory: Trajectory, budget: int) -> Judgement:
    """Judge a trajectory with about ``budget`` samples of every contact."""
    table, look, tolerance = SegmentTable.of(trajectory), sampling(trajectory, budget), BEYOND * problem.metre
    parts = problem.unilateral
    seen = [sample_contact(trajectory, contact, table, look.times, problem.loads) for contact in parts]
    beyond = [_beyond(contact, found) for contact, found in zip(parts, seen, strict=True)]
    rubbed = [judge_friction(trajectory, friction, table, look.times) for friction in problem.frictions]
    laws = [*(found.way for found in rubbed)] + [_beyond_law(law, trajectory, look.times) for law in problem.laws]
    largest, drift = _energies(trajectory, table)
    residual = _share(trajectory.ledger.residual, largest)
    return Judgement(
        energy=drift if problem.conservative else residual,
        residual=residual,
        events=len(trajectory.events),
        missed=sum(found.missed for found in rubbed)
        + sum(untold_switches(trajectory, table, law.name) for law in problem.laws)
        + sum(
            missed(trajectory, found, table, contact.name, tolerance)
            for contact, found in zip(parts, seen, strict=True)
        ),
        beyond=_largest([*(np.max(values) for values in beyond), *laws]),
        unexcused=_largest([*(np.max(v[~s.excused], initial=0.0) for v, s in zip(beyond, seen, strict=True)), *laws]),
        open_depth=_largest([-np.min(s.apart[~s.closed], initial=0.0) for s in seen]),
        pulling=_pulling(parts, seen),
        friction=_largest([found.force for found in rubbed]),
        truncated=truncated(trajectory),
        reported=_largest([-trajectory.deepest_gap(contact.name) for contact in parts]),
        samples=len(look.times),
        covered=look.covered,
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


def _largest_kinetic(trajectory: Trajectory, times: np.ndarray) -> float:
    """The size of the energy where strain may be negative: kinetic energy [J] of a motion that swaps much of it."""
    v = trajectory.velocity(times)
    return float(np.max(np.sum(v * (trajectory.model.structure.mass @ v), axis=0))) / 2


def _energies(trajectory: Trajectory, table: SegmentTable) -> tuple[float, float]:
    """The largest energy, and the largest deviation of energy and losses from the initial one as a share of it."""
    ledger = trajectory.ledger
    chosen = np.unique(np.linspace(0, len(table.start) - 1, LOOKS).astype(int))
    times = np.concatenate([table.start[chosen], table.end[chosen][table.end[chosen] > table.start[chosen]]])
    sides = ["right"] * len(chosen) + ["left"] * (len(times) - len(chosen))
    right = np.array(sides) == "right"
    energy = np.empty(len(times))
    for side, part in (("right", right), ("left", ~right)):
        if np.any(part):
            energy[part] = trajectory.energy(times[part], side=side)
    at = np.array([event.time for event in trajectory.events])
    lost = np.cumsum([0.0, *(event.energy_loss for event in trajectory.events)]) + trajectory.start_loss.total
    before = lost[np.searchsorted(at, times, side="left")]
    after = lost[np.searchsorted(at, times, side="right")]
    largest = max(float(np.max(np.abs(energy))), abs(ledger.initial), abs(ledger.work_of_loads))
    if trajectory.model.force_laws:
        largest = max(largest, _largest_kinetic(trajectory, times))
    drift = np.abs(energy + np.where(right, after, before) - ledger.initial)
    return largest, _share(float(np.max(drift)), largest)
