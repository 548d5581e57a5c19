"""What to distrust in the friction of a run: what several bear together, and what truncation turns round.

Friction without a spring that follows from what sticks beside it moves as that does: it pushes with its kinetic limit,
as if it slipped (decision.py). Where one of them has a higher static limit, that one bears it. Where several have, or
where it has let go and others stick for it, which of them bears the load is not determined, nor when they begin to
slip: two of equal limits F and static limits S do at S + F here, and might at 2 S. Nor is it at contacts that give way,
whose limits change with their pressures. Friction at rigid contacts is decided one contact after the other: where
several turn at one instant, their order may count.

A truncated basis may leave friction that slips a speed s (h_t.x' - v_t - T'/k_t) < 0 against its slip (decision.py):
the modes of slip and those of stick do not move its place alike. It is told, and not mended. The static residual of the
modes left out, which serves friction of constant limits, would go with the pressure here: a force that moves no mass
and follows N' is not symmetric, and may make energy. More modes are the remedy.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from multiphi_exudyn.display import per_cent
from multiphi_exudyn.events.excitation.loaded_level import LoadedLevel
from multiphi_exudyn.events.transitions.exits import signal_row, state_of
from multiphi_exudyn.levels.modal_base import ModalBase
from multiphi_exudyn.levels.model import MultiPhiModel
from multiphi_exudyn.mathematics.complementarity.least_distance import INDEPENDENT
from multiphi_exudyn.mathematics.round_off import CLEAR
from multiphi_exudyn.mechanics.element import friction_spring
from multiphi_exudyn.time.segments.segment import Segments

__all__ = ["rubbing_warnings"]

SEEN = 1e-9  # of the largest speed: less against a slip is round-off
BACKWARDS = 0.01  # of the time that it slips: less of it against its slip is not told
REMEDY = "give one element with the sum of their limits, or each a spring (stiffness, tangential_stiffness)"


def rubbing_warnings(segments: Segments, model: MultiPhiModel) -> Iterator[str]:
    """Of a model with friction, one sentence of each kind at most."""
    yield from _shared(segments)
    yield from _in_turn(segments)
    if not model.whole:
        yield from _backwards(segments)


def _shared(segments: Segments) -> Iterator[str]:
    """Of those that push with the smallest share of their static limit."""
    rubs = _rigid_friction(segments)
    pairs = [(one, other) for one in rubs for other in rubs if one is not other and one.drop > 0]
    found = [together for level in segments.levels for pair in pairs for together in _together(level, *pair)]
    if found:
        share, name, others = min(found)
        yield (
            f"redundant friction: {name!r} follows from {', '.join(map(repr, others))}, so which of them bears the "
            f"load, and when they begin to slip, is not unique: its kinetic limit is {per_cent(share)} of its "
            f"static one; {REMEDY}"
        )


class _Rub(NamedTuple):
    """Friction without a spring: its place, name and link, the state in which it sticks, and what it drops there."""

    element: int
    name: str
    link: int
    sticks: int
    drop: float
    pressed: bool  # by a rigid contact
    gives_way: bool  # what presses it

    def turns(self, left: Sequence[int], entered: Sequence[int]) -> bool:
        """Whether it slips in a level that is left, and the other way, or not at all, in the one that is entered."""
        return left[self.element] > self.sticks <= entered[self.element] != left[self.element]

    def lets_go(self, left: Sequence[int], entered: Sequence[int]) -> bool:
        """Whether it falls from its static limit where a level is left."""
        return self.drop > 0 and left[self.element] == self.sticks < entered[self.element]


def _rigid_friction(segments: Segments) -> list[_Rub]:
    base, found = segments.levels[0].level.base, []
    for i, element in enumerate(base.contacts):
        sticks, number, spring, drop = friction_spring(element)
        if sticks >= 0 and not spring:
            pressed, gives_way = element.rigid and not element.held, not (element.rigid or element.held)
            found.append(_Rub(i, element.name, base.link_indices[i][number], sticks, drop, pressed, gives_way))
    return found


def _together(level: LoadedLevel, one: _Rub, other: _Rub) -> Iterator[tuple[float, str, tuple[str, ...]]]:
    """Of friction that follows from another one and from what is held in a level: its share, its name, and theirs.

    It slips while the other one sticks, or has a static limit too; at a contact that gives way it may stick as well.
    """
    base, own_state, its_state = level.level.base, level.states[one.element], level.states[other.element]
    takes_over = other.drop > 0 or its_state == other.sticks
    shared = own_state >= one.sticks if one.gives_way else own_state > one.sticks and takes_over
    if its_state < other.sticks or not shared:
        return
    held = [k for k in level.level.indices if base.links[k].rigid and k not in (one.link, other.link)] + [other.link]
    rows, row = base.directions[:, held], base.directions[:, one.link]
    shares = np.linalg.lstsq(rows, row, rcond=None)[0]
    own, carried = base.links[one.link].velocity, shares * [base.links[k].velocity for k in held]
    slides = abs(own - np.sum(carried)) > CLEAR * (abs(own) + np.sum(np.abs(carried)))
    alone = np.linalg.norm(row - rows @ shares) > INDEPENDENT * np.linalg.norm(row)
    if slides or alone or abs(shares[-1]) <= INDEPENDENT:
        return
    owners = {k: i for i, places in enumerate(base.link_indices) for k in places}
    taken = [owners[k] for k, share in zip(held, shares, strict=True) if abs(share) > INDEPENDENT]
    yield math.sqrt(1.0 - one.drop), one.name, tuple(dict.fromkeys(base.contacts[k].name for k in taken))


def _in_turn(segments: Segments) -> Iterator[str]:
    """Of friction at rigid contacts that turns as other friction turns or lets go, where not all of it sticks."""
    rubs = _rigid_friction(segments)
    if len(rubs) < 2 or not any(rub.pressed for rub in rubs):
        return
    for before, after in np.unique(np.column_stack([segments.numbers[:-1], segments.numbers[1:]]), axis=0):
        left, entered = (segments.levels[k].states for k in (before, after))
        turned = [rub for rub in rubs if rub.turns(left, entered)]
        turned += [rub for rub in rubs if turned and rub.lets_go(left, entered)]
        several = any(_coupled(segments.levels[0].level.base, *pair) for pair in itertools.combinations(turned, 2))
        loose = any(entered[rub.element] > rub.sticks for rub in turned)
        if several and loose and any(rub.pressed for rub in turned) and any(rub.drop > 0 for rub in turned):
            names = ", ".join(repr(rub.name) for rub in turned)
            yield (
                f"friction in turn: {names} come to rest, or let go, at one instant and are decided one after the "
                "other, as a rigid contact rubs: with static limits above the kinetic ones another order may have "
                f"another answer; {REMEDY}"
            )
            return


def _coupled(base: ModalBase, one: _Rub, other: _Rub) -> bool:
    """Whether a force of one accelerates the other."""
    first, second = (base.directions[:, [rub.element, rub.link]] for rub in (one, other))
    sizes = np.outer(np.linalg.norm(first, axis=0), np.linalg.norm(second, axis=0))
    return bool(np.any(np.abs(first.T @ second) > INDEPENDENT * sizes))


def _backwards(segments: Segments) -> Iterator[str]:
    """Of the friction that for the largest part of its slip has a speed against it, seen in the middle of segments.

    Where every exit is armed it has none: those segments are left out.
    """
    contacts = segments.levels[0].level.base.contacts
    middles, lasting = (segments.starts + segments.ends) / 2, segments.ends - segments.starts
    worst, name = 0.0, ""
    for i, element in enumerate(contacts):
        sticks = friction_spring(element)[0]
        slips = np.array([level.states[i] > sticks for level in segments.levels])[segments.numbers]
        if sticks < 0 or np.sum(lasting[slips & ~segments.settled]) <= BACKWARDS * np.sum(lasting[slips]):
            continue
        places = np.flatnonzero(slips & ~segments.settled)
        speeds = segments.values(middles[places], "right", functools.partial(_slip_row, i, sticks))
        against = places[speeds < -SEEN * np.max(np.abs(speeds))]
        share = float(np.sum(lasting[against]) / np.sum(lasting[slips]))
        worst, name = max((worst, name), (share, element.name))
    if worst > BACKWARDS:
        yield (
            f"backward slip: {name!r} moves against its slip for {per_cent(worst)} of the time that it slips, as "
            "truncation has turned its speed round; give the model more modes, or modes=Tolerance(0.01)"
        )


def _slip_row(element: int, sticks: int, level: LoadedLevel) -> np.ndarray:
    """s (h_t.x' - v_t - T'/k_t) [m/s] of an element while it slips, else zero."""
    width = level.width
    if level.states[element] <= sticks:
        return np.zeros(2 * width + 1)
    row = signal_row(level, element, state_of(level, element).exits[0])
    return np.concatenate([row.position, row.rate, [row.constant]])
