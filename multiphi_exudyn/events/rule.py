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
   armed), or until s in the level it would enter has (then it changes). Where it then asks again at the same
   instant, for ever, it is *held back* until s has risen to zero, or until another contact asks.

7. A viscous contact never pulls. It opens when its force falls to zero, mostly before its gap has risen to zero; then,
   open with g < 0, it is refused as in 6: armed when g has risen to zero, closed when its force in the level with it
   closed has. It may stay closed only with a force >= 0, and may open where its force would be negative.
8. The springs of a force law are compliant contacts whose closed sets are nested. While all of them are armed only
   the ends of its chains can ask, the last closed and the first open spring, and only they are looked at. The two that
   meet at the law's centre have the same gap with opposite sign and exchange at one instant.

A sign is that of the first derivative that is not round-off. All instants are roots of analytic signals, so nothing
depends on sampling. Negative gaps that truncation leaves are reported; an endless exchange is a failure, with a cause.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from multiphi_exudyn.errors import NumericalFailure
from multiphi_exudyn.events.passage import RESTING, Passage
from multiphi_exudyn.events.state import Change, Loss, Phase, Row, Rows, SignalTable, State
from multiphi_exudyn.events.transition import LoadedLevel, nearest_admissible
from multiphi_exudyn.levels.build_level import independent
from multiphi_exudyn.mathematics.least_distance import Infeasible
from multiphi_exudyn.mathematics.round_off import sign_of

__all__ = ["EventRule"]

ONE_BY_ONE = 4  # contacts up to which each is judged on its own: one product for all costs more
ROUNDS = 20  # of decisions at one instant: above it the contacts exclude each other's states for ever


class EventRule(Passage):
    """Applies the rule to one model under one static load (m,) in base coordinates."""

    def start(
        self, displacement: np.ndarray, velocity: np.ndarray, penetrating: Sequence[int], touching: Sequence[int]
    ) -> tuple[State, Loss, list[Change]]:
        """First state from y, y' (m,) in base coordinates, with what is lost on the way into its level.

        penetrating: compliant contacts that start closed. touching: rigid contacts that start at their gap.
        """
        level, changes, admissible, stop_work = self.level(penetrating), list[Change](), velocity, 0.0
        if touching:
            rows = np.column_stack([self.model.base.directions.T, -self.stop_speeds])[list(touching)]
            try:
                moved, impulses = nearest_admissible(rows, np.append(velocity, 1.0), len(velocity))
            except Infeasible as found:
                raise self.squeezed([touching[k] for k in found.rows]) from found
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

    def decide(self, state: State, asking: set[int], again: Iterable[int] = ()) -> tuple[State, Loss, list[Change]]:
        """State right after an instant at which these contacts ask to change; ``again``: those refused at it before.

        Where in the end all contacts are as before, and none was struck, nothing has happened at it.
        """
        after, loss, changes = self._decided(state, asking, again)
        if changes and after.closed == state.closed and not any(c.impulse or c.shared for c in changes):
            return self._held_back(self._with_phases(state, asking), again), Loss(), []
        return after, loss, changes

    def _decided(self, state: State, asking: set[int], again: Iterable[int]) -> tuple[State, Loss, list[Change]]:
        """``decide`` with all that happens on the way."""
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
                return self._held_back(state, again), loss, changes
            loss, changes = loss + lost, changes + made
        names = ", ".join(self.model.contacts[i].name for i in sorted(unheard))
        raise NumericalFailure(f"contacts {names}: no set of closed contacts is admissible at this instant")

    @staticmethod
    def _held_back(state: State, again: Iterable[int]) -> State:
        """The state, with those of ``again`` held back that are refused once more."""
        phases = list(state.phases)
        for i in again:
            phases[i] = Phase.HELD_BACK if phases[i] is Phase.REFUSED else phases[i]
        return replace(state, phases=tuple(phases))

    def _with_phases(self, state: State, refused: Iterable[int] = ()) -> State:
        """The state with the phase in which every contact stands; ``refused``: those that asked in vain."""
        ends = self.ends(state.closed)
        doubtful: Sequence[int] = ends
        if len(ends) > ONE_BY_ONE:
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
        if rate == 0:
            rate = self._becoming(state, own, since=2)
        if value == 0 and rate >= 0:
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
            sign = self._becoming(state, force)
        return sign <= 0

    @staticmethod
    def _becoming(state: State, row: Row, since: int = 0) -> int:
        """Sign of a function's first derivative, of order ``since`` or higher, that is not round-off."""
        table = SignalTable(state.basis, state.shapes, Rows.of([row], len(state.shapes)), [False])
        (sign,) = state.finder.signs(table.signals(state.coefficients(), state), table.sizes(state), since)
        return sign

    def _held(self, state: State, contacts: Iterable[int]) -> set[int]:
        """Those of these contacts that are rigid and closed."""
        return {i for i in contacts if self._rigid[i] and i in state.closed}

    def _joining(self, state: State, held: set[int], asking: set[int]) -> set[int]:
        """Those of the rigid contacts ``asking`` that can close beside ``held`` and each other, penetrating ones first.

        Between two stops without clearance the one on which nothing presses would keep the other out.
        """
        if len(held | asking) == 1 or independent(self.model.base, sorted(held | asking)):
            return set(asking)
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
        pushed = dict[int, float]()
        if opened:
            before = entered
            entered, impulses, lost = self._collided(before, opened)
            entered, loss = self._with_phases(entered), loss + lost
            if not self._same_velocity(before, entered):
                pushed = dict(zip(opened, impulses.tolist(), strict=True))
        changes = [Change(i, "open" if i in state.closed else "close", pushed.get(i, 0.0)) for i in sorted(asking)]
        return entered, loss, changes

    def _impact(
        self, state: State, striking: set[int], compliant: set[int], freed: Iterable[int] = ()
    ) -> tuple[State, Loss, list[Change]]:
        """Rigid contacts strike: velocities, then which of all that touch stay closed, then their level.

        One of ``freed`` stays closed only with a reaction that is more than round-off of zero, and not in the level and
        at the speed at which it fell to zero.
        """
        held = self._held(state, state.closed)
        touching = sorted(held | striking)
        released, loss = self._moved(state, self.level(compliant))
        struck, impulses, plastic = self._collided(released, touching)
        same = self._same_velocity(released, struck)
        if same:
            impulses = np.zeros_like(impulses)  # round-off of them: nothing was struck
        closed = self._pressing(released, struck, touching)
        after, dropped = struck, loss + plastic
        while closed:
            still, further, stilled = self._stilled(struck, touching, closed)
            after = self._at_rest_on(state, still, compliant | closed)
            pulling = {i for i in closed if self._reaction_sign(state, still, after.level, i) < (i in freed)}
            if same and after.closed == state.closed:
                pulling.update(closed.intersection(freed))
            if not pulling:
                dropped = self._loss(state, after, released.kinetic - still.kinetic, plastic + stilled)
                impulses = impulses + further
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
        there = self.transition(struck.level, level)
        pushed = (own.position @ move.matrix) * state.displacement
        damped = (own.rate @ there.velocity_matrix) * struck.velocity
        size = float(np.abs(own.position @ there.matrix) @ struck.reach)
        return sign_of(np.concatenate([pushed, damped]), own.constant + float(own.position @ move.offset), size)

    def _changes(
        self, state: State, striking: set[int], after: State, compliant: set[int], pushed: dict[int, float]
    ) -> list[Change]:
        """All changes of an impact; who strikes and does not stay closed has closed and opened at one instant."""
        before, closed = set(state.closed), set(after.closed)
        struck = [Change(i, "close", pushed[i]) for i in sorted(striking) if i in closed or pushed[i] > 0]
        rebounds = {change.contact for change in struck} - closed
        sprung = [Change(i, "close") for i in sorted(compliant - before)]
        opened = [Change(i, "open", pushed.get(i, 0.0)) for i in sorted(before - closed)]
        changes = [
            *struck,
            *sprung,
            *sorted([*(Change(i, "open") for i in rebounds), *opened], key=lambda c: c.contact),
        ]
        shared = tuple((i, pushed[i]) for i in sorted(pushed) if i in before & closed and pushed[i] > 0)
        if shared and changes:
            changes[0] = replace(changes[0], shared=shared)
        return changes

    def _pressing(self, released: State, state: State, touching: list[int]) -> set[int]:
        """Contacts at rest relative to their stop after an impact whose free motion would close them further.

        Motion is acceleration, or where that presses none of them the first derivative that counts.
        """
        rows = state.level.level.speed_rows[touching]
        speeds = np.abs(rows @ state.velocity)
        sizes = np.abs(rows) @ np.maximum(state.accelerating, released.accelerating)
        resting = speeds <= RESTING * self._sizes(rows, released, state)
        acceleration, multipliers = self._pressed(state, touching, rows, sizes, resting)
        unseen = speeds <= self._unseen(state, rows, touching, acceleration)
        if np.any(unseen & ~resting):
            resting |= unseen
            _, multipliers = self._pressed(state, touching, rows, sizes, resting)
        at_rest = np.array(touching)[resting].tolist()
        pressing = {i for i, force in zip(at_rest, multipliers, strict=True) if force > 0}
        pressing = pressing or {i for i in at_rest if self._standing(state, i) is Phase.REFUSED}
        return self._joining(state, set(), pressing)

    def _pressed(
        self, state: State, touching: list[int], rows: np.ndarray, sizes: np.ndarray, resting: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """The acceleration (r,) that contacts at rest, of those that touch, leave of the free one, and their forces."""
        if not np.any(resting):
            return state.acceleration, np.zeros(0)
        at_rest = np.array(touching)[resting].tolist()
        return self._nearest(state.level, at_rest, rows[resting], state.acceleration, sizes[resting])
