"""Contact warnings: redundant contacts and friction, slip that truncation turns backwards, impacts of a mesh.

Of rigid contacts whose directions depend linearly on each other an independent set carries the load (core/law). How
they share it is not unique, and if they rub differently neither is the motion.

Friction without a spring whose row depends linearly on those of sticking friction beside it moves with that friction:
its force is its kinetic limit, as in slip (core/law). Where one of them has a higher static limit, that one bears the
load. Where several have, or where one has begun to slip and others stick for it, neither the distribution of the load
nor the begin of slip is determined: two of equal limits F and static limits S slip at S + F here, and might at 2 S. Nor
is it at compliant contacts, whose limits change with their normal forces. Friction at rigid contacts is decided one
contact after the other: where several change direction at one instant, their order may matter.

With a truncated basis friction in slip may have a speed s (h_t.x' - v_t - T'/k_t) < 0 against its slip (core/law): the
modes of slip and those of stick do not move its place alike. There is a warning and no correction. The static residual
of the modes left out, which corrects friction of constant limits, would follow the normal force here: a force that
moves no mass and follows N' is not symmetric, and may create energy. More modes are the remedy.

A rigid contact that is struck stops the effective mass m_e = 1 / sum over modes of (h.phi)^2, which loses (1 - e^2) m_e
s^2 / 2. On a lumped mass the first modes give nearly all of the sum. On a continuum it grows with every mode, m_e and
the loss are those of the mesh, and neither is one of the structure itself. Where the upper half of the kept modes has
more than SPREAD of the sum, and the impacts have taken more than TAKEN of the energy, the run says so: on an exact bar
of 20 to 200 elements and 6 to all modes, over 1 to 10 periods, every run that was off by more than 5 % was told, and
none that was off by less than 1.5 %.

Of impacts for which Coulomb's law has several solutions (coulomb_impacts.py) the run takes one. All rigid contacts that
touch at the instant are considered, also those without an impulse in the chosen solution. Their impulses act in the
level in which they are open; friction elsewhere without a spring has no impulse. With restitution the plastic impact
that comes first is examined.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import scipy.optimize

import multiphi_exudyn._core as core
from multiphi_exudyn.display import per_cent
from multiphi_exudyn.levels.base.modal_base import ModalBase
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mathematics.coulomb_impacts import CoulombImpact
from multiphi_exudyn.mathematics.round_off import CLEAR, INDEPENDENT
from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.element import friction_spring
from multiphi_exudyn.time.loaded_level import LoadedLevel
from multiphi_exudyn.time.record import Record
from multiphi_exudyn.time.state import event_table
from multiphi_exudyn.time.trajectory import Trajectory

__all__ = ["TOUCHING", "friction_warnings", "impact_warnings", "is_taking", "mesh_warnings", "spread_contacts"]

SPEED_ROUND_OFF = 1e-9  # of the largest speed: a smaller one against the slip is round-off
TOUCHING = 1e-10  # of the largest terms of its gap: a contact touches
BACKWARDS = 0.01  # of the time in slip: a smaller share against the slip gives no warning
ONE_ELEMENT = "give one element with the sum of their limits, or each a spring (stiffness, tangential_stiffness)"
TAKEN = 0.005  # of the largest energy of a run, by impacts on what the mesh decides
SPREAD = 0.3  # of an effective mass' reciprocal: on meshes the upper half of the modes has .38 to .67, on chains .2
FEWEST = 6  # modes of which this can be told
ONE_ANSWER = "smaller coefficients of friction, or a finite stiffness, leave one"


def friction_warnings(segments: Record, model: MultiPhiModel) -> Iterator[str]:
    """Warnings of a model with friction, at most one sentence of each kind."""
    yield from _redundant_contacts(segments)
    yield from _redundant(segments)
    yield from _decided_in_turn(segments)
    if not model.whole:
        yield from _backward_slip(segments)


def _redundant_contacts(segments: Record) -> Iterator[str]:
    """Warning of a rigid contact that touches without a force, and would rub otherwise than those that carry it."""
    base = segments.levels[0].level.base
    rigid = [i for i, contact in enumerate(base.contacts) if isinstance(contact, UnilateralContact) and contact.rigid]
    if all(_rub_alike(base, rigid[0], i) for i in rigid[1:]):
        return
    longest = {k: i for i, k in sorted(enumerate(segments.numbers), key=lambda each: _length(segments, each[0]))}
    for number, place in sorted(longest.items()):
        states, touching = segments.levels[number].states, _touching(segments, place, rigid)
        closed, idle = [i for i in touching if states[i]], [i for i in touching if not states[i]]
        for i in idle if closed else ():
            bearing = _relieved(base, i, closed, [k for k in idle if k != i])
            others = [base.contacts[k].name for k in bearing if not _rub_alike(base, i, k)]
            if others:
                yield (
                    f"redundant contacts: {base.contacts[i].name!r} touches, but {', '.join(map(repr, others))} "
                    f"{'carries' if len(others) == 1 else 'carry'} the load, and they rub differently: how rigid "
                    "contacts share a load, and so their friction, is not unique; the run lets the roughest of those "
                    "that close together carry it; give each of them a stiffness"
                )
                return


def _length(segments: Record, place: int) -> float:
    """Duration [s] of a segment."""
    return float(segments.ends[place] - segments.starts[place])


def _touching(segments: Record, place: int, contacts: Sequence[int]) -> list[int]:
    """Those of the rigid contacts whose gaps are round-off in the middle of a segment."""
    level, after = segments.levels[segments.numbers[place]], 0.5 * _length(segments, place)
    xi = segments.states(np.array([place]), np.array([after]))[0, 0, : level.width]
    rows, constants = level.level.gap_rows[contacts], level.gap_constants[contacts]
    sizes = np.abs(rows) @ np.abs(xi) + np.abs(constants)
    touches = np.abs(rows @ xi + constants) <= TOUCHING * sizes
    return [i for i, is_touching in zip(contacts, touches.tolist(), strict=True) if is_touching]


def _relieved(base: ModalBase, contact: int, closed: Sequence[int], idle: Sequence[int]) -> list[int]:
    """Closed contacts (by number) that a force on another one can relieve, as forces on further idle ones may.

    The forces along the rows h have no resultant: h_contact + sum a_k h_k = sum b_k h_k, a >= 0 of the idle ones.
    """
    rows = base.directions
    columns = np.column_stack([-rows[:, list(idle)], rows[:, list(closed)], -rows[:, list(closed)]])
    shares, remainder = scipy.optimize.nnls(columns, rows[:, contact])
    if remainder > INDEPENDENT * np.linalg.norm(rows[:, contact]):
        return []
    relieved = shares[len(idle) : len(idle) + len(closed)] - shares[len(idle) + len(closed) :]
    return [k for k, share in zip(closed, relieved, strict=True) if share > INDEPENDENT]


def _rub_alike(base: ModalBase, one: int, other: int) -> bool:
    """Whether the friction of two contacts is the same for the same normal forces."""
    first, second = base.contacts[one], base.contacts[other]
    assert isinstance(first, UnilateralContact), "only contacts are compared"
    assert isinstance(second, UnilateralContact), "only contacts are compared"
    if (first.friction, first.most) != (second.friction, second.most):
        return False
    if not first.most:
        return True
    links = [base.link_indices[i][1] for i in (one, other)]
    (row, its_row), speeds = base.directions[:, links].T, [base.links[k].velocity for k in links]
    return any(
        speeds[0] == sign * speeds[1] and np.linalg.norm(row - sign * its_row) <= INDEPENDENT * np.linalg.norm(row)
        for sign in (1.0, -1.0)
    )


def _redundant(segments: Record) -> Iterator[str]:
    """Warning of the redundant friction with the smallest ratio of kinetic to static limit."""
    frictions = _rigid_friction(segments)
    pairs = [(one, other) for one in frictions for other in frictions if one is not other and one.drop > 0]
    redundant = [warning for level in segments.levels for pair in pairs for warning in _redundancies(level, *pair)]
    if redundant:
        share, name, others = min(redundant)
        yield (
            f"redundant friction: {name!r} follows from {', '.join(map(repr, others))}, so which of them bears the "
            f"load, and when they begin to slip, is not unique: its kinetic limit is {per_cent(share)} of its "
            f"static one; {ONE_ELEMENT}"
        )


class _RigidFriction(NamedTuple):
    """Friction without a spring: element, name, link, state of stick, and relative drop from the static limit."""

    element: int
    name: str
    link: int
    sticks: int
    drop: float
    pressed: bool  # by a rigid contact
    compliant: bool  # whether its contact is

    def turns(self, before: Sequence[int], after: Sequence[int]) -> bool:
        """Whether it slips before a transition, and slips the other way or sticks after it."""
        return before[self.element] > self.sticks <= after[self.element] != before[self.element]

    def breaks_away(self, before: Sequence[int], after: Sequence[int]) -> bool:
        """Whether it breaks away from its static limit at a transition."""
        return self.drop > 0 and before[self.element] == self.sticks < after[self.element]


def _rigid_friction(segments: Record) -> list[_RigidFriction]:
    base, frictions = segments.levels[0].level.base, []
    for i, element in enumerate(base.contacts):
        sticks, number, spring, drop = friction_spring(element)
        if sticks >= 0 and not spring:
            pressed, compliant = element.rigid and not element.held, not (element.rigid or element.held)
            frictions.append(
                _RigidFriction(i, element.name, base.link_indices[i][number], sticks, drop, pressed, compliant)
            )
    return frictions


def _redundancies(
    level: LoadedLevel, one: _RigidFriction, other: _RigidFriction
) -> Iterator[tuple[float, str, tuple[str, ...]]]:
    """Ratio of limits and name of friction that depends on another and on rigid links in a level, and their names.

    It slips while the other one sticks or has a static limit too; at a compliant contact it may stick as well.
    """
    base, own_state, its_state = level.level.base, level.states[one.element], level.states[other.element]
    other_bears = other.drop > 0 or its_state == other.sticks
    is_shared = own_state >= one.sticks if one.compliant else own_state > one.sticks and other_bears
    if its_state < other.sticks or not is_shared:
        return
    rigid_links = [k for k in level.level.indices if base.links[k].rigid and k not in (one.link, other.link)]
    rigid_links.append(other.link)
    rows, row = base.directions[:, rigid_links], base.directions[:, one.link]
    shares = np.linalg.lstsq(rows, row, rcond=None)[0]
    velocity, dependent = base.links[one.link].velocity, shares * [base.links[k].velocity for k in rigid_links]
    slides = abs(velocity - np.sum(dependent)) > CLEAR * (abs(velocity) + np.sum(np.abs(dependent)))
    independent = np.linalg.norm(row - rows @ shares) > INDEPENDENT * np.linalg.norm(row)
    if slides or independent or abs(shares[-1]) <= INDEPENDENT:
        return
    owners = {k: i for i, places in enumerate(base.link_indices) for k in places}
    involved = [owners[k] for k, share in zip(rigid_links, shares, strict=True) if abs(share) > INDEPENDENT]
    yield math.sqrt(1.0 - one.drop), one.name, tuple(dict.fromkeys(base.contacts[k].name for k in involved))


def _decided_in_turn(segments: Record) -> Iterator[str]:
    """Warning of friction at rigid contacts that changes direction at one instant with other friction."""
    frictions = _rigid_friction(segments)
    if len(frictions) < 2 or not any(friction.pressed for friction in frictions):
        return
    for before, after in np.unique(np.column_stack([segments.numbers[:-1], segments.numbers[1:]]), axis=0):
        left, entered = (segments.levels[k].states for k in (before, after))
        changed = [friction for friction in frictions if friction.turns(left, entered)]
        changed += [friction for friction in frictions if changed and friction.breaks_away(left, entered)]
        coupled = any(_coupled(segments.levels[0].level.base, *pair) for pair in itertools.combinations(changed, 2))
        some_slip = any(entered[friction.element] > friction.sticks for friction in changed)
        if (
            coupled
            and some_slip
            and any(friction.pressed for friction in changed)
            and any(friction.drop > 0 for friction in changed)
        ):
            names = ", ".join(repr(friction.name) for friction in changed)
            yield (
                f"friction in turn: {names} come to rest, or let go, at one instant and are decided one after the "
                "other, as a rigid contact rubs: with static limits above the kinetic ones another order may have "
                f"another answer; {ONE_ELEMENT}"
            )
            return


def _coupled(base: ModalBase, one: _RigidFriction, other: _RigidFriction) -> bool:
    """Whether a force of one friction accelerates the other."""
    first, second = (base.directions[:, [friction.element, friction.link]] for friction in (one, other))
    sizes = np.outer(np.linalg.norm(first, axis=0), np.linalg.norm(second, axis=0))
    return bool(np.any(np.abs(first.T @ second) > INDEPENDENT * sizes))


def _backward_slip(segments: Record) -> Iterator[str]:
    """Warning of the friction with the largest share of slip time at a speed against it, sampled in mid-segment.

    Segments with all exits armed have no such speed and are left out.
    """
    contacts = segments.levels[0].level.base.contacts
    middles, durations = (segments.starts + segments.ends) / 2, segments.ends - segments.starts
    worst, name = 0.0, ""
    for i, element in enumerate(contacts):
        sticks = friction_spring(element)[0]
        slips = np.array([level.states[i] > sticks for level in segments.levels])[segments.numbers]
        if sticks < 0 or np.sum(durations[slips & ~segments.all_armed]) <= BACKWARDS * np.sum(durations[slips]):
            continue
        places = np.flatnonzero(slips & ~segments.all_armed)
        speeds = segments.values(middles[places], "right", functools.partial(_slip_row, i, sticks))
        against = places[speeds < -SPEED_ROUND_OFF * np.max(np.abs(speeds))]
        share = float(np.sum(durations[against]) / np.sum(durations[slips]))
        worst, name = max((worst, name), (share, element.name))
    if worst > BACKWARDS:
        yield (
            f"backward slip: {name!r} moves against its slip for {per_cent(worst)} of the time that it slips, as "
            "truncation has turned its speed round; give the model more modes, or modes=Tolerance(0.01)"
        )


def _slip_row(element: int, sticks: int, level: LoadedLevel) -> np.ndarray:
    """s (h_t.x' - v_t - T'/k_t) [m/s] of an element while it slips, else zero; the level keeps it."""
    key = "slip", element
    if key not in level.entries:
        first = [i for i, _ in level.exits].index(element)
        slips, (place, rate, constant) = level.states[element] > sticks, level.signals[first]
        level.entries[key] = np.concatenate([place, rate, [constant]]) if slips else np.zeros(2 * level.width + 1)
    row: np.ndarray = level.entries[key]
    return row


def spread_contacts(model: MultiPhiModel) -> tuple[str, ...]:
    """Names of the rigid contacts whose effective mass falls with every kept mode."""
    level, names = model.level_at(()), list[str]()
    for i, contact in enumerate(model.contacts if level.modes >= FEWEST else ()):
        if contact.rigid and not contact.held:
            shares = level.gap_rows[model.link_indices[i][0]] ** 2
            if np.sum(shares[level.modes // 2 :]) > SPREAD * np.sum(shares):
                names.append(contact.name)
    return tuple(names)


def is_taking(ledger: core.Ledger) -> bool:
    """Whether impacts may have taken more than TAKEN of the largest energy of a run."""
    start = abs(ledger.start_energy + ledger.start_potential)
    return bool(ledger.at_start[0] + ledger.at_events[0] > TAKEN * start)


def mesh_warnings(trajectory: Trajectory, spread: Sequence[str]) -> Iterator[str]:
    """At most one sentence on a run whose impacts took energy; spread: see ``spread_contacts``."""
    record, index = trajectory.ending.record, trajectory.model.index
    contacts, impulses, lost = record.elements, record.impulses, record.losses[:, 0]
    struck, losses = (np.bincount(contacts, amounts, len(trajectory.model.contacts)) for amounts in (impulses, lost))
    names = [name for name in spread if struck[index(name)] > 0]
    if not names:
        return
    taken = trajectory.start_loss.impact + float(sum(losses[index(name)] for name in names))
    largest = max(trajectory.ending.record.sizes(trajectory.t_end)[1], abs(trajectory.initial_energy))
    if taken > TAKEN * largest:
        yield (
            f"mesh impacts: impacts on {', '.join(map(repr, names))} took {per_cent(taken / largest)} of the largest "
            "energy of the run, and stop a mass that falls with every mode and element, so the loss is that of the "
            "mesh and motions come too late; give the stop a finite stiffness, or compare with more modes and a finer "
            "mesh"
        )


def impact_warnings(trajectory: Trajectory) -> Iterator[str]:
    """One sentence on the first such impact."""
    model, problems = trajectory.model, dict[tuple[tuple[int, ...], ...], CoulombImpact]()
    mu = _coefficients(model)
    for impact in _impacts(trajectory) if np.any(mu) else ():
        if not np.any(mu[list(impact.touching)]):
            continue
        key = impact.level.states, impact.touching
        if key not in problems:
            problems[key] = _coulomb(model, impact, mu)
        if problems[key].is_unique:
            continue
        contacts = ", ".join(f"{model.contacts[i].name!r} ({mu[i]:g})" for i in impact.touching)
        touch = f"{contacts}, with their coefficients of friction, touch in the impact at t = {impact.time:g} s"
        if not problems[key].tried:
            yield f"several impacts: {touch}, too many to tell whether Coulomb's law has one answer to it; {ONE_ANSWER}"
            return
        count = problems[key].answers(impact.speeds)
        if count > 1:
            yield (
                f"several impacts: {touch}, to which Coulomb's law has {count} answers with other speeds after it; the "
                f"run goes on from one of them, and the others are as right; {ONE_ANSWER}"
            )
            return


class _Impact(NamedTuple):
    """Time [s], level before, touching contacts, and their normal and tangential speeds (k, 2) [m/s]."""

    time: float
    level: LoadedLevel
    touching: tuple[int, ...]
    speeds: np.ndarray


def _impacts(trajectory: Trajectory) -> Iterator[_Impact]:
    """All impacts of rigid contacts."""
    model, segments = trajectory.model, trajectory.segments
    table = event_table(trajectory.events, model.index)
    rigid = np.array([contact.rigid and not contact.held for contact in model.contacts])
    table = table[rigid[table[:, 1].astype(int)] & (table[:, 2] > 0)]
    times, instants = np.unique(table[:, 0], return_inverse=True)
    if not len(times):
        return
    places = segments.owners(times, "left")
    x, v = segments.states(places, times - segments.starts[places])
    numbers, largest = segments.numbers[places], np.zeros(len(rigid))
    gaps, speeds = np.zeros((len(times), len(rigid))), np.zeros((len(times), len(model.links)))
    for number in np.unique(numbers):  # states are as wide as these levels alone
        level = segments.levels[number]
        in_level, n, constants = numbers == number, level.width, level.gap_constants[: len(rigid)]
        rows = level.level.gap_rows[: len(rigid)]
        gaps[in_level], speeds[in_level] = (
            x[in_level, :n] @ rows.T + constants,
            v[in_level, :n] @ level.speed_rows.T,
        )
        terms = np.abs(x[in_level, :n]) @ np.abs(rows).T + np.abs(constants)
        largest = np.maximum(largest, np.max(terms, axis=0, initial=0.0))
    at_start = times == trajectory.t_start
    if np.any(at_start):
        speeds[at_start] = _first_speeds(trajectory, segments.levels[numbers[0]], v[0])
    touches = rigid & (np.abs(gaps) <= TOUCHING * largest)
    touches[instants, table[:, 1].astype(int)] = True
    for k, time in enumerate(times.tolist()):
        touching = tuple(np.flatnonzero(touches[k]).tolist())
        links = [model.base.link_indices[i][:2] for i in touching]
        contact_speeds = np.array(
            [[speeds[k, pair[0]], speeds[k, pair[-1]] if len(pair) > 1 else 0.0] for pair in links]
        )
        yield _Impact(time, segments.levels[numbers[k]], touching, contact_speeds)


def _first_speeds(trajectory: Trajectory, level: LoadedLevel, velocity: np.ndarray) -> np.ndarray:
    """h.x' - v (l,) [m/s] of all links before an impact at the start itself; velocity: xi' after it."""
    stop_speeds = level.excitation.stops @ velocity[level.modal.modes : level.width]
    return np.asarray(trajectory.model.base.directions.T @ trajectory.start.velocity - stop_speeds)


def _coefficients(model: MultiPhiModel) -> np.ndarray:
    """mu (c,) of the rigid contacts with friction, zero of all others."""
    contacts = [contact if isinstance(contact, UnilateralContact) else None for contact in model.contacts]
    return np.array([0.0 if contact is None or not contact.rigid else contact.friction for contact in contacts])


def _coulomb(model: MultiPhiModel, impact: _Impact, mu: np.ndarray) -> CoulombImpact:
    """Impact problem of the touching contacts in the level without closed rigid links."""
    base = model.base
    rows = model.level_at(tuple(k for k in impact.level.level.indices if not base.links[k].rigid)).gap_rows
    links = [base.link_indices[i][:2] for i in impact.touching]
    pairs = [[rows[pair[0]], rows[pair[-1]] if len(pair) > 1 else np.zeros_like(rows[pair[0]])] for pair in links]
    return CoulombImpact(np.array(pairs), mu[list(impact.touching)])
