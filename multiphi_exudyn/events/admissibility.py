"""Admissibility: functions that say whether a contact may stay as it is, and which are looked at (rule.py).

    open                 s = g         gap
    closed, compliant    s = -g        penetration
    closed, rigid        s = lambda    reaction
    closed, viscous      s = lambda    force of spring and damper

in every level under one static load. Levels, the maps between them and their functions are made when they are asked
for, and kept as long as the model's bound allows.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from multiphi_exudyn.events.state import Phase, Row, Rows, SignalTable, State
from multiphi_exudyn.events.transition import LoadedLevel, Transition
from multiphi_exudyn.levels.model import SIGNAL_TABLES, MultiPhiModel
from multiphi_exudyn.mathematics.bounded_cache import BoundedCache
from multiphi_exudyn.mathematics.round_off import drop_round_off, sign_of

__all__ = ["ContactFunctions"]


@dataclass
class _Known:
    """What is kept of a level, beside itself: all of it is made when it is first asked for.

    functions: s by contact. together: those of its ``ends``. tables: what is watched, by phases. ways: maps to other
    levels, by their closed contacts.
    """

    level: LoadedLevel
    functions: dict[int, Row] = field(default_factory=dict)
    together: Rows | None = None
    ends: tuple[int, ...] = ()
    tables: dict[tuple[Phase, ...], tuple[list[tuple[int, bool]], SignalTable]] = field(default_factory=dict)
    ways: dict[tuple[int, ...], Transition] = field(default_factory=dict)


class ContactFunctions:
    """Levels of one model under one static load (m,) in base coordinates, maps between them, and contact functions."""

    def __init__(self, model: MultiPhiModel, load: np.ndarray) -> None:
        self.model = model
        self.load = load
        self.transitions = 0
        self.arrays: Any = None  # what the loop keeps for later runs (level_arrays.py)
        self._rigid: list[bool] = np.isinf(model.base.stiffnesses).tolist()
        self._viscous = [i for i, contact in enumerate(model.contacts) if contact.damping]
        self._armed = (Phase.ARMED,) * len(self._rigid)
        self._all = tuple(range(len(self._rigid)))
        self._known = BoundedCache[tuple[int, ...], _Known](model.most_levels, self._close)

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "arrays": None}

    def level(self, closed: Iterable[int]) -> LoadedLevel:
        """The level with these contacts closed, under this load."""
        key = tuple(sorted(closed))
        self.model.level_at(key)  # of the levels that the model keeps it is now the one used last
        return self._of(key).level

    def forget(self, closed: tuple[int, ...]) -> None:
        """Let go of what is kept of a level."""
        self._known.drop(closed)

    def _of(self, closed: tuple[int, ...]) -> _Known:
        return self._known.get_or_build(closed, lambda: _Known(self._loaded(closed)))

    def _loaded(self, closed: tuple[int, ...]) -> LoadedLevel:
        return LoadedLevel.of(self.model.level_at(closed), self.load)

    def _close(self, closed: tuple[int, ...], gone: _Known) -> None:
        """The ways to a level that is not kept any more."""
        for _, known in self._known.items():
            known.ways.pop(closed, None)

    @property
    def levels_kept(self) -> int:
        """Number of levels of which something is kept."""
        return len(self._known)

    @property
    def ways(self) -> list[tuple[tuple[int, ...], tuple[int, ...]]]:
        """From and to which closed contacts maps between levels are kept."""
        return [(source, target) for source, known in self._known.items() for target in known.ways]

    def transition(self, source: LoadedLevel, target: LoadedLevel) -> Transition:
        """The map between two levels, computed once as long as they are kept."""
        ways = self._of(source.level.indices).ways
        if target.level.indices not in ways:
            ways[target.level.indices] = self._map(source, target)
        return ways[target.level.indices]

    def _map(self, source: LoadedLevel, target: LoadedLevel) -> Transition:
        return Transition(source, target)

    def function(self, level: LoadedLevel, contact: int) -> Row:
        """s of a contact in a level."""
        functions = self._of(level.level.indices).functions
        if contact not in functions:
            functions[contact] = self._function(level, contact)
        return functions[contact]

    def _function(self, level: LoadedLevel, contact: int) -> Row:
        own = level.level
        if contact not in own.indices:
            return Row(own.gap_rows[contact], np.zeros(own.modes), float(level.gap_constants[contact]))
        if not self._never_pulls(contact):
            return Row(-own.gap_rows[contact], np.zeros(own.modes), -float(level.gap_constants[contact]))
        k = own.indices.index(contact)
        return Row(own.force_rows[k], own.force_rate_rows[k], float(level.asymptotic.forces[k]))

    def _rows(self, level: LoadedLevel) -> Rows:
        """s of the ``ends`` in a level, together."""
        known, own = self._of(level.level.indices), level.level
        if known.together is None:
            ends, closed = self.ends(own.indices), set(own.indices)
            position, constant = own.gap_rows[list(ends)], level.gap_constants[list(ends)]
            rate = np.zeros_like(position)
            for k, contact in enumerate(ends):
                if contact in closed and self._never_pulls(contact):
                    row = self.function(level, contact)
                    position[k], rate[k], constant[k] = row.position, row.rate, row.constant
                elif contact in closed:
                    position[k], constant[k] = -position[k], -constant[k]
            known.together = Rows(position, rate if np.any(rate) else None, constant)
        return known.together

    def entered_function(self, level: LoadedLevel, contact: int) -> Row:
        """s that a contact would have after a change of its state, as a function of the present level's state."""
        target = self.level(set(level.level.indices) ^ {contact})
        move, there = self.transition(level, target), self.function(target, contact)
        terms = there.position * move.offset
        constant = 0.0 if sign_of(terms, there.constant) == 0 else there.constant + float(np.sum(terms))
        return Row(
            drop_round_off(there.position @ move.matrix, np.abs(there.position) @ np.abs(move.matrix)),
            there.rate @ move.velocity_matrix,
            constant,
        )

    def _never_pulls(self, contact: int) -> bool:
        """Whether a contact's s is its force while it is closed."""
        return self._rigid[contact] or contact in self._viscous

    def ends(self, closed: tuple[int, ...]) -> tuple[int, ...]:
        """Contacts that can ask first while all are armed: of a force law the ends of its chains."""
        if not self.model.chains:
            return self._all
        known = self._of(closed)
        if not known.ends:
            chains, held = self.model.chains, set(closed)
            linked = {i for chain in chains for i in chain}
            found = {i for i in range(len(self._rigid)) if i not in linked}
            for chain in chains:
                found.update(_ends(chain, held))
            known.ends = tuple(sorted(found))
        return known.ends

    def candidates(self, closed: tuple[int, ...], phases: tuple[Phase, ...]) -> tuple[int, ...]:
        """The ``ends``, and all of a chain that is not armed."""
        ends = self.ends(closed)
        unsettled = [chain for chain in self.model.chains if any(phases[i] is not Phase.ARMED for i in chain)]
        return tuple(sorted({*ends, *(i for chain in unsettled for i in chain)})) if unsettled else ends

    def watch(self, state: State, phases: tuple[Phase, ...]) -> tuple[list[tuple[int, bool]], SignalTable]:
        """Signals whose first descent is next, with (contact, whether it then asks to change or is armed)."""
        settled = phases == self._armed  # the hash of many phases takes its time
        key = () if settled else phases
        tables = self._of(state.closed).tables
        found = tables.get(key)
        if found is None:
            waiting, rows, rates = self.watched(state.level, phases)
            if len(tables) >= SIGNAL_TABLES:
                tables.clear()
            found = tables[key] = waiting, SignalTable(state.basis, state.shapes, rows, rates)
        return found

    def watched(self, level: LoadedLevel, phases: tuple[Phase, ...]) -> tuple[list[tuple[int, bool]], Rows, list[bool]]:
        """(contact, whether it then asks to change or is armed), functions, and whether their rate is meant."""
        ends, together = self.ends(level.level.indices), self._rows(level)
        if phases == self._armed:
            return [(contact, True) for contact in ends], together, [False] * len(ends)
        places, others = {contact: k for k, contact in enumerate(ends)}, list[Row]()
        waiting, taken, rates = list[tuple[int, bool]](), list[int](), list[bool]()
        for contact in self.candidates(level.level.indices, phases):
            if phases[contact] is Phase.ARMED and contact in places:
                waiting.append((contact, True))
                taken.append(places[contact])
                rates.append(False)
                continue
            for asks, row, rate in self._waiting_for(level, contact, phases[contact]):
                waiting.append((contact, asks))
                taken.append(len(ends) + len(others))
                rates.append(rate)
                others.append(row)
        return waiting, together.beside(Rows.of(others, level.level.modes)).some(taken), rates

    def _waiting_for(self, level: LoadedLevel, contact: int, phase: Phase) -> list[tuple[bool, Row, bool]]:
        """(asks, function, whether its rate is meant) of what ends a contact's phase by falling through zero."""
        own = self.function(level, contact)
        if phase is Phase.ARMED:
            return [(True, own, False)]
        if phase is Phase.RECOVERING:
            return [(False, -own, False), (True, own, True)]
        if phase is Phase.HELD_BACK:
            return [(False, -own, False)]
        return [(False, -own, False), (True, -self.entered_function(level, contact), False)]


def _ends(chain: tuple[int, ...], closed: set[int]) -> tuple[int, ...]:
    """Last closed and first open spring of a chain; the whole chain where its closed springs are not the first ones."""
    count = sum(i in closed for i in chain)
    if not all(i in closed for i in chain[:count]):
        return chain
    return chain[max(count - 1, 0) : count + 1]
