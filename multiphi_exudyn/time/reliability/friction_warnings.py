"""Friction warnings: redundant contacts and friction, friction decided in turn, slip that truncation turns backwards.

Of rigid contacts whose directions depend linearly on each other an independent set carries the load (core/law). How
they share it is not unique, and if they rub differently neither is the motion.

Friction without a spring whose row depends linearly on those of sticking friction beside it moves with that friction:
its force is its kinetic limit, as in slip (core/law). Where one of them has a higher static limit, that one bears
the load. Where several have, or where one has begun to slip and others stick for it, neither the distribution of the
load nor the begin of slip is determined: two of equal limits F and static limits S slip at S + F here, and might at
2 S. Nor is it at compliant contacts, whose limits change with their normal forces. Friction at rigid contacts is
decided one contact after the other: where several change direction at one instant, their order may matter.

With a truncated basis friction in slip may have a speed s (h_t.x' - v_t - T'/k_t) < 0 against its slip (core/law):
the modes of slip and those of stick do not move its place alike. There is a warning and no correction. The static
residual of the modes left out, which corrects friction of constant limits, would follow the normal force here: a force
that moves no mass and follows N' is not symmetric, and may create energy. More modes are the remedy.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import scipy.optimize

from multiphi_exudyn.display import per_cent
from multiphi_exudyn.events.excitation.loaded_level import LoadedLevel
from multiphi_exudyn.events.transitions.exits import signal_table, state_of
from multiphi_exudyn.levels.base.modal_base import ModalBase
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mathematics.round_off import CLEAR, INDEPENDENT
from multiphi_exudyn.mechanics.elements.contact import UnilateralContact
from multiphi_exudyn.mechanics.elements.element import friction_spring
from multiphi_exudyn.time.segments.segment import Segments

__all__ = ["TOUCHING", "friction_warnings"]

SPEED_ROUND_OFF = 1e-9  # of the largest speed: a smaller one against the slip is round-off
TOUCHING = 1e-10  # of the largest terms of its gap: a contact touches
BACKWARDS = 0.01  # of the time in slip: a smaller share against the slip gives no warning
REMEDY = "give one element with the sum of their limits, or each a spring (stiffness, tangential_stiffness)"


def friction_warnings(segments: Segments, model: MultiPhiModel) -> Iterator[str]:
    """Warnings of a model with friction, at most one sentence of each kind."""
    yield from _redundant_contacts(segments)
    yield from _redundant(segments)
    yield from _decided_in_turn(segments)
    if not model.whole:
        yield from _backward_slip(segments)


def _redundant_contacts(segments: Segments) -> Iterator[str]:
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


def _length(segments: Segments, place: int) -> float:
    """Duration [s] of a segment."""
    return float(segments.ends[place] - segments.starts[place])


def _touching(segments: Segments, place: int, contacts: Sequence[int]) -> list[int]:
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


def _redundant(segments: Segments) -> Iterator[str]:
    """Warning of the redundant friction with the smallest ratio of kinetic to static limit."""
    frictions = _rigid_friction(segments)
    pairs = [(one, other) for one in frictions for other in frictions if one is not other and one.drop > 0]
    redundant = [warning for level in segments.levels for pair in pairs for warning in _redundancies(level, *pair)]
    if redundant:
        share, name, others = min(redundant)
        yield (
            f"redundant friction: {name!r} follows from {', '.join(map(repr, others))}, so which of them bears the "
            f"load, and when they begin to slip, is not unique: its kinetic limit is {per_cent(share)} of its "
            f"static one; {REMEDY}"
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


def _rigid_friction(segments: Segments) -> list[_RigidFriction]:
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


def _decided_in_turn(segments: Segments) -> Iterator[str]:
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
                f"another answer; {REMEDY}"
            )
            return


def _coupled(base: ModalBase, one: _RigidFriction, other: _RigidFriction) -> bool:
    """Whether a force of one friction accelerates the other."""
    first, second = (base.directions[:, [friction.element, friction.link]] for friction in (one, other))
    sizes = np.outer(np.linalg.norm(first, axis=0), np.linalg.norm(second, axis=0))
    return bool(np.any(np.abs(first.T @ second) > INDEPENDENT * sizes))


def _backward_slip(segments: Segments) -> Iterator[str]:
    """Warning of the friction with the largest share of slip time at a speed against it, sampled in mid-segment.

    Segments with all exits armed have no such speed and are left out.
    """
    contacts = segments.levels[0].level.base.contacts
    middles, durations = (segments.starts + segments.ends) / 2, segments.ends - segments.starts
    worst, name = 0.0, ""
    for i, element in enumerate(contacts):
        sticks = friction_spring(element)[0]
        slips = np.array([level.states[i] > sticks for level in segments.levels])[segments.numbers]
        if sticks < 0 or np.sum(durations[slips & ~segments.settled]) <= BACKWARDS * np.sum(durations[slips]):
            continue
        places = np.flatnonzero(slips & ~segments.settled)
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
        slips, exit_ = level.states[element] > sticks, state_of(level, element).exits[0]
        level.entries[key] = signal_table(level, [(element, exit_)])[0] if slips else np.zeros(2 * level.width + 1)
    row: np.ndarray = level.entries[key]
    return row
