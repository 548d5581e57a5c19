"""Passage: from one level into another at one instant, and what is lost on the way: by impact, truncation, relaxation.

A plastic impact takes the part of the velocity that contacts cannot have (Moreau), the map of eq. (38.6) what the
modes of the next level cannot hold; a viscous contact that opens inside its stop what its spring held.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from multiphi_exudyn.errors import NumericalFailure
from multiphi_exudyn.events.admissibility import ContactFunctions
from multiphi_exudyn.events.state import Loss, Phase, State
from multiphi_exudyn.events.transition import LoadedLevel, nearest_admissible
from multiphi_exudyn.mathematics.least_distance import Infeasible
from multiphi_exudyn.mathematics.round_off import ZERO, drop_round_off

__all__ = ["RESTING", "Passage"]

RESTING = 1e-12  # of what it could be at such speeds: a gap velocity below it is zero right after an impact


class Passage(ContactFunctions):
    """States carried from level to level, and through impacts."""

    @property
    def stop_speeds(self) -> np.ndarray:
        """Velocities (c,) [m/s] of the stops at the present instant, along h."""
        return np.zeros(len(self._rigid))

    def potential(self, displacement: np.ndarray, penetrating: Sequence[int]) -> float:
        """Strain energy less the potential of the load [J] of a configuration y (m,), nothing truncated."""
        return self.model.base.strain(displacement, penetrating) - float(self.load @ displacement)

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

    def _collided(
        self, state: State, touching: Sequence[int], held: Sequence[int] = ()
    ) -> tuple[State, np.ndarray, Loss]:
        """Moreau's impact among contacts that touch, in a level in which they are open: state, impulses, loss.

        held: those of them that keep no speed away from their stop either; their impulses come once more, behind.
        """
        contacts, sides = [*touching, *held], np.r_[np.ones(len(touching)), -np.ones(len(held))]
        rows = sides[:, None] * state.level.level.speed_rows[contacts]
        free = self._free(state.level)
        velocity, impulses = self._nearest(state.level, contacts, rows, state.velocity)
        before, left = np.abs(state.velocity[:free]), np.abs(velocity[:free])
        stopped = left <= RESTING * before  # round-off of rest, which would bounce and rock on until it underflows
        velocity[:free][stopped | (np.linalg.norm(left) <= RESTING * np.linalg.norm(before))] = 0.0
        still = (velocity[:free] == 0) & (np.abs(state.displacement[:free]) <= ZERO * state.reach[:free])
        displacement = state.displacement.copy()
        displacement[:free][still] = 0.0  # where it has come to rest: what is left would swing, and strike again
        after = replace(state, displacement=displacement, velocity=velocity)
        lost = state.kinetic - after.kinetic
        plastic = self._plastic(lost, rows @ state.velocity, impulses)
        return after, impulses, Loss(impact=plastic, stop_work=plastic - lost)

    def _stilled(self, state: State, touching: Sequence[int], closed: set[int]) -> tuple[State, np.ndarray, Loss]:
        """After an impact: contacts that stay closed lose a speed too small to be seen, and give it to no other.

        State, impulses of those that touch, loss.
        """
        held = sorted(closed)
        rows = state.level.level.speed_rows[held]
        if np.all(np.abs(rows @ state.velocity) <= RESTING * self._sizes(rows, state)):
            return state, np.zeros(len(touching)), Loss()
        after, impulses, lost = self._collided(state, touching, held)
        pushed, pulled = np.split(impulses, [len(touching)])
        pushed[np.searchsorted(touching, held)] -= pulled
        return after, pushed, lost

    def _nearest(
        self,
        level: LoadedLevel,
        touching: Sequence[int],
        rows: np.ndarray,
        vector: np.ndarray,
        sizes: np.ndarray | None = None,
    ) -> tuple[np.ndarray, np.ndarray]:
        """``nearest_admissible`` among the motions of a level, for the rows of these contacts."""
        try:
            return self._nearest_of(level, rows, vector, sizes)
        except Infeasible as found:
            raise self.squeezed([touching[k] for k in found.rows]) from found

    def _nearest_of(
        self, level: LoadedLevel, rows: np.ndarray, vector: np.ndarray, sizes: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray]:
        return nearest_admissible(rows, vector, self._free(level), sizes)

    def squeezed(self, contacts: Sequence[int]) -> NumericalFailure:
        """The failure of a run in which stops that move leave no way out between these contacts."""
        names = ", ".join(self.model.contacts[i].name for i in sorted(contacts))
        complete = self.model.level_at(()).modes == self.model.base.modes.count
        kept = "" if complete else " in the kept modes, need more of them"
        return NumericalFailure(
            f"rigid contacts {names}: their stops move against each other and leave no way out{kept}"
        )

    @staticmethod
    def _free(level: LoadedLevel) -> int:
        """How many coordinates of a level an impulse can change, the first ones."""
        return level.level.modes

    def _same_velocity(self, before: State, after: State) -> bool:
        """Whether an impact, between two states of one level, has changed no more than round-off."""
        free = self._free(before.level)
        change = np.linalg.norm(after.velocity[:free] - before.velocity[:free])
        return bool(change <= RESTING * np.linalg.norm(before.velocity[:free]))

    @staticmethod
    def _plastic(lost: float, speeds: np.ndarray, impulses: np.ndarray) -> float:
        """Energy [J] that an impact dissipates: what the structure lost, as long as no stop moves."""
        return lost

    def _unseen(self, state: State, rows: np.ndarray, touching: list[int], acceleration: np.ndarray) -> np.ndarray:
        """Gap velocities (k,) that an acceleration turns back before the gap is more than round-off of its terms."""
        level, place = state.level, np.abs(state.displacement)
        gaps = np.abs(level.level.gap_rows[touching]) @ place + np.abs(level.gap_constants[touching])
        return np.sqrt(2 * ZERO * gaps * np.maximum(-(rows @ acceleration), 0.0))

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
        """A state given in base coordinates, in a level's modes; one at its own rest has no round-off of its place."""
        vectors, rest = level.level.vectors.T, level.asymptotic.configuration
        eta = drop_round_off(vectors @ (displacement - rest), np.linalg.norm(displacement) + np.linalg.norm(rest))
        return State(level, eta, vectors @ velocity, (Phase.ARMED,) * len(self._rigid))
