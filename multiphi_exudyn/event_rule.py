"""Event rule: when a contact changes state, and which level follows. It is the same in every driver of the model.

Every contact has one function that says whether its present state is admissible, s >= 0:

    open                 s = g         gap
    closed, compliant    s = -g        penetration
    closed, rigid        s = lambda    reaction
    closed, viscous      s = lambda    force of spring and damper

With all modes the states exclude each other: where one stops being admissible the other begins to be. The truncated
bases of two levels need not agree, so the rule says what happens then:

1. A contact is *armed* while s >= 0. When s falls through zero it asks to change state.
2. A rigid contact that asks to close is decided together with all rigid contacts that touch, in the basis of the
   level in which they are open: Moreau's impact, then complementarity of acceleration and reaction. A contact closes
   only if the level it enters gives it a reaction >= 0. At rest is also what would be back at its stop before its gap
   is more than round-off: so ends a sequence of ever smaller bounces. A contact whose gap the closed ones hold
   already stays open at its stop, without a force: of redundant contacts a set that is independent carries all.
3. A rigid contact that asks to open always opens: it never pulls.
4. A compliant contact that asks changes state unless s in the level it would enter is negative and falling. Of
   several that ask together and may not, the first that may alone changes.
5. A contact whose s is negative after a change (truncation) is *recovering*: it keeps its state while s rises, becomes
   armed when s reaches zero, and asks again if s turns down before.
6. A contact that asked and may not change is *refused*: it keeps its state until s has risen to zero (then it is
   armed), or until s in the level it would enter has (then it changes).

7. A viscous contact never pulls. It opens when its force falls to zero, mostly before its gap has risen to zero; then,
   open with g < 0, it is refused as in 6: armed when g has risen to zero, closed when its force in the level with it
   closed has. It may stay closed only with a force >= 0, and may open where its force would be negative.
8. The springs of a force law are compliant contacts whose closed sets are nested. While all of them are armed only
   the ends of its chains can ask, the last closed and the first open spring, and only they are looked at. The two that
   meet at the law's centre have the same gap with opposite sign and exchange at one instant.

A sign is that of the first derivative that is not round-off. All instants are roots of analytic signals, so nothing
depends on sampling. Negative gaps that truncation leaves are measured and reported. An endless exchange at one
instant is a failure, with its cause.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from multiphi_exudyn.base import cleared
from multiphi_exudyn.build_level import independent
from multiphi_exudyn.errors import NumericalFailure
from multiphi_exudyn.model import SIGNAL_TABLES, MultiPhiModel
from multiphi_exudyn.recent import Recent
from multiphi_exudyn.root_search import ZERO
from multiphi_exudyn.state import Change, Loss, Phase, Row, Rows, SignalTable, State, sign_of
from multiphi_exudyn.transition import LoadedLevel, Transition, nearest_admissible

__all__ = ["EventRule"]

ROUNDS = 20  # of decisions at one instant: above it the contacts exclude each other's states for ever
RESTING = 1e-12  # of what it could be at such speeds: a gap velocity below it is zero right after an impact


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


class EventRule:
    """Applies the rule to one model under one static load (m,) in base coordinates."""

    def __init__(self, model: MultiPhiModel, load: np.ndarray) -> None:
        self.model = model
        self.load = load
        self.transitions = 0
        self.compiled: Any = None  # what the compiled loop keeps for later runs
        self._rigid: list[bool] = np.isinf(model.base.stiffnesses).tolist()
        self._viscous = [i for i, contact in enumerate(model.contacts) if contact.damping]
        self._armed = (Phase.ARMED,) * len(self._rigid)
        self._all = tuple(range(len(self._rigid)))
        self.mapped = 0  # ways between levels that have been computed
        self._known = Recent[tuple[int, ...], _Known](model.most_levels, self._close)

    def level(self, closed: Iterable[int]) -> LoadedLevel:
        """The level with these contacts closed, under this load."""
        key = tuple(sorted(closed))
        self.model.level_at(key)  # of the levels that the model keeps it is now the one used last
        return self._of(key).level

    def forget(self, closed: tuple[int, ...]) -> None:
        """Let go of what is kept of a level."""
        self._known.drop(closed)

    def _of(self, closed: tuple[int, ...]) -> _Known:
        return self._known.find(closed) or self._known.keep(closed, _Known(self._loaded(closed)))

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
            self.mapped += 1
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
            ends = self.ends(own.indices)
            position, constant = own.gap_rows[list(ends)], level.gap_constants[list(ends)]
            rate = np.zeros_like(position)
            for k, contact in enumerate(ends):
                if contact in own.indices:
                    row = self.function(level, contact)
                    position[k], rate[k], constant[k] = row.position, row.rate, row.constant
            known.together = Rows(position, rate if np.any(rate) else None, constant)
        return known.together

    def entered_function(self, level: LoadedLevel, contact: int) -> Row:
        """s that a contact would have after a change of its state, as a function of the present level's state."""
        target = self.level(set(level.level.indices) ^ {contact})
        move, there = self.transition(level, target), self.function(target, contact)
        terms = there.position * move.offset
        constant = 0.0 if sign_of(terms, there.constant) == 0 else there.constant + float(np.sum(terms))
        return Row(
            cleared(there.position @ move.matrix, np.abs(there.position) @ np.abs(move.matrix)),
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
        settled = phases is self._armed  # the hash of many phases takes its time
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
        if phases is self._armed:
            ends = self.ends(level.level.indices)
            return [(contact, True) for contact in ends], self._rows(level), [False] * len(ends)
        found = [
            (contact, *wait)
            for contact in self.candidates(level.level.indices, phases)
            for wait in self._waiting_for(level, contact, phases[contact])
        ]
        rows = Rows.of([item[2] for item in found], level.level.modes)
        return [(item[0], item[1]) for item in found], rows, [item[3] for item in found]

    def _waiting_for(self, level: LoadedLevel, contact: int, phase: Phase) -> list[tuple[bool, Row, bool]]:
        """(asks, function, whether its rate is meant) of what ends a contact's phase by falling through zero."""
        own = self.function(level, contact)
        if phase is Phase.ARMED:
            return [(True, own, False)]
        if phase is Phase.RECOVERING:
            return [(False, -own, False), (True, own, True)]
        return [(False, -own, False), (True, -self.entered_function(level, contact), False)]

    # ------------------------------------------------------------------ decisions at one instant

    def start(
        self, displacement: np.ndarray, velocity: np.ndarray, penetrating: Sequence[int], touching: Sequence[int]
    ) -> tuple[State, Loss, list[Change]]:
        """First state from y, y' (m,) in base coordinates, with what is lost on the way into its level.

        penetrating: compliant contacts that start closed. touching: rigid contacts that start at their gap.
        """
        level, changes, admissible, stop_work = self.level(penetrating), list[Change](), velocity, 0.0
        if touching:
            rows = np.column_stack([self.model.base.directions.T, -self.stop_speeds])[list(touching)]
            moved, impulses = nearest_admissible(rows, np.append(velocity, 1.0), len(velocity))
            admissible, stop_work = moved[:-1], float(impulses @ self.stop_speeds[list(touching)])
            open_state = self._entered(level, displacement, velocity)
            level = self._impact(open_state, set(touching), set(penetrating))[0].level
            pushed = dict(zip(touching, impulses.tolist(), strict=True))
            struck = [i for i in touching if pushed[i] > 0 or i in level.level.indices]
            changes = [Change(i, "close", pushed[i]) for i in struck]
            changes += [Change(i, "open") for i in struck if i not in level.level.indices]
        state = self._entered(level, displacement, admissible)
        kinetic = 0.5 * float(admissible @ admissible)
        loss = Loss(
            impact=0.5 * float(velocity @ velocity) - kinetic + stop_work,
            truncation_kinetic=kinetic - state.kinetic,
            truncation_strain=self.potential(displacement, penetrating) - state.potential,
            stop_work=stop_work,
        )
        state, lost, made = self.decide(state, set())
        return state, loss + lost, changes + made

    @property
    def stop_speeds(self) -> np.ndarray:
        """Velocities (c,) [m/s] of the stops at the present instant, along h."""
        return np.zeros(len(self._rigid))

    def potential(self, displacement: np.ndarray, penetrating: Sequence[int]) -> float:
        """Strain energy less the potential of the load [J] of a configuration y (m,), nothing truncated."""
        return self.model.base.strain(displacement, penetrating) - float(self.load @ displacement)

    def decide(self, state: State, asking: set[int]) -> tuple[State, Loss, list[Change]]:
        """State right after an instant at which these contacts ask to change."""
        heard, freed = set(asking), self._held(state, asking)
        loss, changes = Loss(), list[Change]()
        if asking:
            state, loss, changes = self._answer(state, asking, heard, freed)
        else:
            state = self._with_phases(state)
        for _ in range(ROUNDS + len(self._rigid)):
            if Phase.REFUSED not in state.phases:
                return state, loss, changes
            heard |= {change.contact for change in changes}
            refused = {i for i, phase in enumerate(state.phases) if phase is Phase.REFUSED}
            unheard, pulling = refused - heard, self._held(state, refused)
            if unheard:
                heard |= unheard
                freed |= self._held(state, unheard)
                state, lost, made = self._answer(state, unheard, heard, freed)
            elif pulling:  # heard before: what others did at this instant took its reaction away
                state, lost, made = self._switch(state, pulling)
            else:
                return state, loss, changes
            loss, changes = loss + lost, changes + made
        names = ", ".join(self.model.contacts[i].name for i in sorted(unheard))
        raise NumericalFailure(f"contacts {names}: no set of closed contacts is admissible at this instant")

    def _with_phases(self, state: State, refused: Iterable[int] = ()) -> State:
        """The state with the phase in which every contact stands; ``refused``: those that asked in vain."""
        ends = self.ends(state.closed)
        clear = self._rows(state.level).clear(state.displacement, state.velocity, state.reach)
        doubtful = [ends[k] for k in np.flatnonzero(~clear)]
        phases = list(self._armed)
        for contact in doubtful:
            phases[contact] = self._standing(state, contact)
        if all(phases[contact] is Phase.ARMED for contact in doubtful):
            return replace(state, phases=self._armed)
        for contact in set(self.candidates(state.closed, tuple(phases))) - set(ends):
            phases[contact] = self._standing(state, contact)
        for contact in refused:
            phases[contact] = Phase.ARMED if phases[contact] is Phase.ARMED else Phase.REFUSED
        return replace(state, phases=tuple(phases))

    def _standing(self, state: State, contact: int) -> Phase:
        """ARMED where s is or becomes positive, RECOVERING where it is negative and may rise, else REFUSED."""
        own = self.function(state.level, contact)
        value = own.sign(state.displacement, state.velocity, state.reach)
        if value > 0:
            return Phase.ARMED
        rate = own.rate_sign(state.velocity, state.acceleration, state.swing)
        if value == 0 or rate == 0:
            table = SignalTable(state.basis, state.shapes, Rows.of([own, own], len(state.shapes)), [False, True])
            value, rate = state.finder.signs(table.signals(state.coefficients()))
        if value >= 0:
            return Phase.ARMED
        stays = contact in self._viscous or (self._rigid[contact] and contact in state.closed)
        return Phase.RECOVERING if rate > 0 and not stays else Phase.REFUSED

    def _relaxing(self, state: State, contact: int) -> bool:
        """Whether a viscous contact is open where closed it would pull."""
        if contact not in self._viscous or contact in state.closed:
            return False
        force = self.entered_function(state.level, contact)
        sign = force.sign(state.displacement, state.velocity, state.reach)
        if sign == 0:
            table = SignalTable(state.basis, state.shapes, Rows.of([force], len(state.shapes)), [False])
            (sign,) = state.finder.signs(table.signals(state.coefficients()))
        return sign <= 0

    def _held(self, state: State, contacts: Iterable[int]) -> set[int]:
        """Those of these contacts that are rigid and closed."""
        return {i for i in contacts if self._rigid[i] and i in state.closed}

    def _joining(self, state: State, held: set[int], asking: set[int]) -> set[int]:
        """Those of the rigid contacts ``asking`` that can close beside ``held`` and each other, penetrating ones first.

        Between two stops without clearance the one on which nothing presses would keep the other out.
        """
        joined = set(held)
        for i in sorted(asking, key=lambda i: (state.phases[i] is not Phase.REFUSED, i)):
            if independent(self.model.base, sorted(joined | {i})):
                joined.add(i)
        return joined - held

    def _answer(
        self, state: State, asking: set[int], heard: set[int], freed: set[int]
    ) -> tuple[State, Loss, list[Change]]:
        """State with its phases after these contacts have been heard.

        heard: all that touch at this instant. freed: those of them whose reaction has fallen to zero at it.
        """
        striking = {i for i in heard if self._rigid[i] and i not in state.closed}
        if not striking & asking:
            return self._switch(state, asking)
        compliant = {i for i in asking.symmetric_difference(state.closed) if not self._rigid[i]}
        after, loss, changes = self._impact(state, striking, compliant, freed)
        if changes:
            return self._with_phases(after), loss, changes
        return self._close_without_impact(state, striking & asking)

    def _close_without_impact(self, state: State, asking: set[int]) -> tuple[State, Loss, list[Change]]:
        """Rigid contacts that no impact closes: into the level that gives them a reaction, or they are refused."""
        held = set(state.closed)
        joining = self._joining(state, self._held(state, held), asking)
        willing = {i for i in joining if self._reaction_sign(state, state, self.level(held | {i}), i) >= 0}
        if not willing:
            return self._with_phases(state, asking), Loss(), []
        self.transitions += 1
        entered, loss = self._moved(state, self.level(held | willing))
        return self._with_phases(entered), loss, [Change(i, "close") for i in sorted(willing)]

    def _switch(self, state: State, asking: set[int]) -> tuple[State, Loss, list[Change]]:
        """Compliant contacts change where the level they enter admits it, rigid ones open.

        Where it admits none of several together, the first that it admits alone.
        """
        heard, wishes = asking, [asking]
        while wishes:
            asking = wishes.pop(0)
            entered, loss = self._moved(state, self.level(asking.symmetric_difference(state.closed)))
            entered = self._with_phases(entered)
            denied = {
                i
                for i in asking
                if entered.phases[i] is Phase.REFUSED and not self._rigid[i] and not self._relaxing(entered, i)
            }
            if not denied:
                break
            if denied < asking:
                wishes = [asking - denied]
            elif len(asking) > 1:
                wishes = [{i} for i in sorted(asking)]
        else:
            return self._with_phases(state, heard), Loss(), []
        self.transitions += 1
        opened = sorted(i for i in asking if self._rigid[i])
        if opened:
            entered, _, lost = self._collided(entered, opened)
            entered, loss = self._with_phases(entered), loss + lost
        return entered, loss, [Change(i, "open" if i in state.closed else "close") for i in sorted(asking)]

    def _impact(
        self, state: State, striking: set[int], compliant: set[int], freed: Iterable[int] = ()
    ) -> tuple[State, Loss, list[Change]]:
        """Rigid contacts strike: velocities, then which of all that touch stay closed, then their level.

        One of ``freed`` stays closed only with a reaction that is more than round-off of zero.
        """
        held = self._held(state, state.closed)
        touching = sorted(held | striking)
        released, loss = self._moved(state, self.level(compliant))
        struck, impulses, plastic = self._collided(released, touching)
        closed = self._pressing(released, struck, touching)
        after, dropped = struck, loss + plastic
        while closed:
            after = self._at_rest_on(state, struck, compliant | closed)
            pulling = {i for i in closed if self._reaction_sign(state, struck, after.level, i) < (i in freed)}
            if not pulling:
                dropped = self._loss(state, after, released.kinetic - struck.kinetic, plastic)
                break
            closed = closed - pulling
            after = struck
        changes = self._changes(state, striking, after, compliant, dict(zip(touching, impulses, strict=True)))
        if not changes:
            return state, Loss(), []
        self.transitions += 1
        return after, dropped, changes

    def _reaction_sign(self, state: State, struck: State, level: LoadedLevel, contact: int) -> int:
        """Sign of the reaction a contact would get in a level, zero where it is round-off of the way there.

        The same function as ``entered_function``: a refused contact asks where that one says it may.
        """
        own, move = self.function(level, contact), self.transition(state.level, level)
        pushed = (own.position @ move.matrix) * state.displacement
        damped = (own.rate @ self.transition(struck.level, level).velocity_matrix) * struck.velocity
        return sign_of(np.concatenate([pushed, damped]), own.constant + float(own.position @ move.offset))

    def _at_rest_on(self, state: State, struck: State, closed: set[int]) -> State:
        """Displacement straight from the level before the impact, velocity from the one it was computed in."""
        level = self.level(closed)
        displacement = self.transition(state.level, level).displacement(state.displacement)
        velocity = self.transition(struck.level, level).velocity(struck.velocity)
        return replace(state, level=level, displacement=displacement, velocity=velocity)

    def _loss(self, state: State, after: State, collided: float = 0.0, plastic: Loss | None = None) -> Loss:
        """What was lost between two states of one instant, the energy ``collided`` in an impact with its own loss."""
        relaxed = self._relaxed(state, after) if self._viscous else 0.0
        kinetic, strain = state.kinetic - after.kinetic - collided, state.potential - after.potential - relaxed
        if plastic is None:
            return Loss(0.0, kinetic, strain, 0.0, relaxed)
        return Loss(plastic.impact, kinetic, strain, plastic.stop_work, relaxed)

    def _relaxed(self, state: State, after: State) -> float:
        """Strain energy [J] of viscous contacts that opened inside their stop, less that of those that closed there."""
        total = 0.0
        for i in self._viscous:
            opened = (i in state.closed) - (i in after.closed)
            gap = state.level.gap(i, state.displacement) if opened else 0.0
            total += opened * 0.5 * float(self.model.base.stiffnesses[i]) * gap**2
        return total

    def _changes(
        self, state: State, striking: set[int], after: State, compliant: set[int], pushed: dict[int, float]
    ) -> list[Change]:
        """All changes of an impact; who strikes and does not stay closed has closed and opened at one instant."""
        before, closed = set(state.closed), set(after.closed)
        struck = [Change(i, "close", pushed[i]) for i in sorted(striking) if i in closed or pushed[i] > 0]
        rebounds = {change.contact for change in struck} - closed
        sprung = [Change(i, "close") for i in sorted(compliant - before)]
        return struck + sprung + [Change(i, "open") for i in sorted(rebounds | (before - closed))]

    def _collided(self, state: State, touching: list[int]) -> tuple[State, np.ndarray, Loss]:
        """Moreau's impact among contacts that touch, in a level in which they are open: state, impulses, loss."""
        rows = state.level.level.speed_rows[touching]
        free = self._free(state.level)
        velocity, impulses = nearest_admissible(rows, state.velocity, free)
        if np.linalg.norm(velocity[:free]) <= RESTING * np.linalg.norm(state.velocity[:free]):
            velocity[:free] = 0.0  # round-off of rest, which would rock on redundant stops until it underflows
        after = replace(state, velocity=velocity)
        lost = state.kinetic - after.kinetic
        plastic = self._plastic(lost, rows @ state.velocity, impulses)
        return after, impulses, Loss(impact=plastic, stop_work=plastic - lost)

    @staticmethod
    def _free(level: LoadedLevel) -> int:
        """How many coordinates of a level an impulse can change, the first ones."""
        return level.level.modes

    @staticmethod
    def _plastic(lost: float, speeds: np.ndarray, impulses: np.ndarray) -> float:
        """Energy [J] that an impact dissipates: what the structure lost, as long as no stop moves."""
        return lost

    def _pressing(self, released: State, state: State, touching: list[int]) -> set[int]:
        """Contacts at rest relative to their stop after an impact whose free motion would close them further.

        Motion is acceleration, or where that presses none of them the first derivative that counts.
        """
        own = state.level.level
        rows = own.speed_rows[touching]
        speeds = rows @ state.velocity
        resting = np.abs(speeds) <= np.maximum(
            RESTING * self._sizes(rows, released, state), self._unseen(state, rows, touching)
        )
        if not np.any(resting):
            return set()
        _, multipliers = nearest_admissible(rows[resting], state.acceleration, self._free(state.level))
        at_rest = np.array(touching)[resting].tolist()
        pressing = {i for i, force in zip(at_rest, multipliers, strict=True) if force > 0}
        return pressing or self._joining(
            state, set(), {i for i in at_rest if self._standing(state, i) is Phase.REFUSED}
        )

    def _unseen(self, state: State, rows: np.ndarray, touching: list[int]) -> np.ndarray:
        """Gap velocities (k,) that the free motion turns back before the gap is more than round-off of its terms."""
        level, place = state.level, np.abs(state.displacement)
        gaps = np.abs(level.level.gap_rows[touching]) @ place + np.abs(level.gap_constants[touching])
        return np.sqrt(2 * ZERO * gaps * np.maximum(-(rows @ state.acceleration), 0.0))

    def _sizes(self, rows: np.ndarray, *states: State) -> np.ndarray:
        """What gap velocities (k,) could be at the speeds of these states, whose directions an impact mixes."""
        free = self._free(states[0].level)
        lengths, sizes = np.linalg.norm(rows[:, :free], axis=1), np.zeros(len(rows))
        for state in states:
            prescribed = np.abs(rows[:, free:]) @ np.abs(state.velocity[free:])
            sizes += lengths * np.linalg.norm(state.velocity[:free]) + prescribed
        return sizes

    def _moved(self, state: State, level: LoadedLevel) -> tuple[State, Loss]:
        """The state in another level (eq. 38.6), and what truncation took."""
        if level.level.indices == state.closed:
            return state, Loss()
        move = self.transition(state.level, level)
        displacement, velocity = move.displacement(state.displacement), move.velocity(state.velocity)
        after = replace(state, level=level, displacement=displacement, velocity=velocity)
        return after, self._loss(state, after)

    def _entered(self, level: LoadedLevel, displacement: np.ndarray, velocity: np.ndarray) -> State:
        """A state given in base coordinates, in a level's modes."""
        vectors = level.level.vectors.T
        eta = vectors @ (displacement - level.asymptotic.configuration)
        return State(level, eta, vectors @ velocity, (Phase.ARMED,) * len(self._rigid))


def _ends(chain: tuple[int, ...], closed: set[int]) -> tuple[int, ...]:
    """Last closed and first open spring of a chain; the whole chain where its closed springs are not the first ones."""
    count = sum(i in closed for i in chain)
    if not all(i in closed for i in chain[:count]):
        return chain
    return chain[max(count - 1, 0) : count + 1]
