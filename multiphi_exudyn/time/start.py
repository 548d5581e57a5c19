"""Start: displacement and velocity of a run in base coordinates, and the first states of its elements.

A contact touches where its gap is round-off of its terms, |h|.|y| and the gaps themselves, or of the possible size of
the motion: |y|, the displacement of the modes by y', and that by the loads. For a rigid contact the largest gap counts
too, as it must not begin inside its stop. A compliant one that is inside by so little has a force.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
import scipy.optimize

import multiphi_exudyn._core as core
from multiphi_exudyn.display import Shown
from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.levels.equilibrium.static_equilibrium import Equilibrium
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mathematics.round_off import INDEPENDENT, drop_round_off
from multiphi_exudyn.mechanics.element import friction_spring
from multiphi_exudyn.time.loaded_levels import LoadedLevels
from multiphi_exudyn.time.state import State

__all__ = ["Start", "Starts"]


OPEN, CLOSED = 0, 1  # states of a contact
SLIP_FORWARD, IDLE = 1, 3  # of friction, after stick; the latter of contacts that are not rigid
TOUCHING = 1e-9  # of the gap and of the terms of it: a smaller gap touches
CONTINUED = 1e-12  # of the possible size of the motion: a smaller gap is round-off at the start of a continued run


@dataclass(repr=False)  # not frozen: every run makes one, which would take three times as long
class Start(Shown):
    """y, y' (m,) in base coordinates; compliant contacts that start closed, rigid ones that start at their gap.

    penetrating: includes the friction that sticks. gaps: (c,) [m] of all contacts at y = 0, with the stops and held
    displacements at the start. states: numbers of all elements' states, those contacts closed. held: displacements (h,)
    that links hold. time [s], state: of the start, and the final state of the run that is continued, if any.
    """

    displacement: np.ndarray
    velocity: np.ndarray
    penetrating: tuple[int, ...]
    touching: tuple[int, ...]
    gaps: np.ndarray
    states: tuple[int, ...]
    held: np.ndarray
    time: float = 0.0
    state: State | None = None

    def _facts(self) -> Iterator[tuple[str, str]]:
        yield "time", f"{self.time:g} s"
        yield "states", str(self.states)


class Starts:
    """Starts of runs in ``levels`` to ``end`` [s], judged by the sizes of gaps and motions under the loads.

    times: longest times (m,) [s] for which a velocity moves a mode one way. stops, speeds: gaps at y = 0 [m] and
    velocities [m/s] of the stops (l,). touching: tolerance (l,) [m] from the gaps' own terms and the loads.
    """

    def __init__(self, levels: LoadedLevels, end: float) -> None:
        self.levels, self.model, base, excitation = levels, levels.model, levels.model.base, levels.excitation
        omega, self.sizes = base.modes.omega, np.linalg.norm(base.directions, axis=0)
        self.times = np.minimum(np.divide(1.0, omega, out=np.full(len(omega), end), where=omega > 0), end)
        gap_terms = base.magnitudes[1] + excitation.stop_travel
        gaps = np.divide(gap_terms, self.sizes, out=np.zeros(len(gap_terms)), where=self.sizes > 0)
        others = np.where(np.isinf(base.stiffnesses), np.max(gaps, initial=0.0), 0.0)
        lengths = float(np.linalg.norm(excitation.largest_load * self.times**2)) + others
        positions, self.speeds = map(excitation.moved, levels.drive.values[:2])
        self.stops, self.touching = base.gaps - positions, TOUCHING * gap_terms + CONTINUED * lengths * self.sizes

    def first(
        self, displacement: np.ndarray | None, velocity: np.ndarray | None, rest: Equilibrium | None = None
    ) -> Start:
        """Start from x, x' (n,), None for zero, with the first states of the contacts.

        rest: equilibrium in whose place x is, with the springs of friction stretched.
        """
        base, vector = self.model.base, self.model.structure.vector
        y, v = np.zeros((2, len(self.times)))
        given = displacement if rest is None else rest.displacement
        known = None if rest is None else rest.coordinates(base)
        if known is not None:
            y = known
        elif given is not None:
            y = base.coordinates(vector("displacement", given))
        if velocity is not None:
            v = base.coordinates(vector("velocity", velocity))
        length = float(np.linalg.norm(y) + np.linalg.norm(v * self.times))
        near = TOUCHING * (np.abs(y) @ base.magnitudes[0]) + CONTINUED * length * self.sizes + self.touching
        stretches = {} if rest is None else rest.stretches
        start = self._in_touch(y, v, y @ base.directions + self.stops, near, stretches)
        return self._pressed(start) if self.model.residual else start

    def _pressed(self, start: Start) -> Start:
        """Start with those contacts on a residual boundary closed that press where the modes are as given."""
        host = self.levels.level(start.states)
        w = np.concatenate([self.levels.drive.values[0], start.held])
        jump = start.displacement - host.asymptotic.configuration - host.channels.shapes @ w
        xi = np.concatenate([host.modal.inertial.T @ jump, w])
        gaps = host.level.gap_rows @ xi + host.gap_constants
        boundary = self.model.modal_levels.boundary(list(host.level.indices))
        pressed = _pressing(self.model, boundary, gaps[list(self.model.residual)])
        states = tuple(CLOSED if i in pressed else state for i, state in enumerate(start.states))
        return replace(start, states=states, penetrating=tuple(sorted((*start.penetrating, *pressed))))

    def _in_touch(
        self, y: np.ndarray, v: np.ndarray, gaps: np.ndarray, near: np.ndarray, stretches: Mapping[str, float]
    ) -> Start:
        """Start y, y' with gaps (l,) [m]; near: those below which they touch; stretches: of springs of friction."""
        model, base = self.model, self.model.base
        rates = drop_round_off(v @ base.directions - self.speeds, np.abs(v) @ base.magnitudes[0] + np.abs(self.speeds))
        states = np.zeros(len(model.contacts), int)
        for i, contact in enumerate(model.contacts):
            rigid = contact.rigid and not contact.held
            if rigid and gaps[i] < -near[i]:
                raise MultiPhiValueError(
                    f"displacement: lies {-gaps[i]:g} m inside the rigid contact {contact.name!r}, need a gap >= 0 "
                    "(static_equilibrium gives an admissible start)"
                )
            if i in model.residual:
                continue  # open in the host
            depth = 0.0 if abs(gaps[i]) <= near[i] else float(gaps[i])
            first_state = contact.first_state(depth, *rates[list(model.link_indices[i])].tolist())
            states[i] = [state.name for state in contact.states].index(first_state)
            if rigid and gaps[i] <= near[i]:
                states[i] = CLOSED
        states = _independent(model, states)
        touching = tuple(i for i, c in enumerate(model.contacts) if c.rigid and not c.held and states[i] != OPEN)
        held = np.array([gaps[i] - stretches.get(model.links[i].name, 0.0) for i in model.held])
        gap_offsets = self.stops.copy()
        gap_offsets[list(model.held)] -= held
        springs = tuple(k for k in model.active_links(states.tolist()) if k not in touching)
        return Start(y, v, springs, touching, gap_offsets, tuple(states.tolist()), held)


def _independent(model: MultiPhiModel, states: np.ndarray) -> np.ndarray:
    """First states in which an independent set of the rigid links sticks; the others slip, or are decided later."""
    basis = np.zeros((0, len(model.base.directions)))
    for i, element in enumerate(model.contacts):
        sticks, number, spring, _ = friction_spring(element)
        if states[i] == sticks and spring == 0 and (element.held or not element.rigid):
            row = model.base.directions[:, model.link_indices[i][number]]
            remainder = row / np.linalg.norm(row)
            for _ in range(2):
                remainder = remainder - (basis @ remainder) @ basis
            size = float(np.linalg.norm(remainder))
            if size > INDEPENDENT:
                basis = np.vstack([basis, remainder / size])
            else:
                states[i] = sticks + (SLIP_FORWARD if element.held else IDLE)
    return states


def _pressing(model: MultiPhiModel, boundary: core.ResidualBoundary, gaps: np.ndarray) -> tuple[int, ...]:
    """Links that press, f > 0, where the host has gaps (c,) [m]: f >= 0, (1/k + F) f + gaps >= 0."""
    if not np.any(gaps < 0):
        return ()
    values, vectors = np.linalg.eigh(boundary.flexibility + np.diag(boundary.compliances))
    resisting = values > INDEPENDENT * values[-1]
    root = np.sqrt(values[resisting])[:, None] * vectors[:, resisting].T
    aimed = -(vectors[:, resisting].T @ gaps) / np.sqrt(values[resisting])
    forces, _ = scipy.optimize.nnls(root, aimed)
    return tuple(link for link, force in zip(model.residual, forces.tolist(), strict=True) if force > 0)
