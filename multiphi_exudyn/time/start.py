"""Start conditions: where a run begins, in base coordinates.

Start: displacement and velocity of a run in base coordinates, and the first states of its elements.

A contact touches where its gap is round-off of its terms, |h|.|y| and the gaps themselves, or of the possible size of
the motion: |y|, the displacement of the modes by y', and that by the loads. For a rigid contact the largest gap counts
too, as it must not begin inside its stop. A compliant one that is inside by so little has a force.

Start projection: x, x' (n,) in coordinates of a complete base, and a quick check for near contacts.

    y = Phi^T M x,   y' = Phi^T M x'                          zero where they are round-off of their terms

Most starts touch nothing: they need none of the checks of every contact in start.py (core/start_projection.hpp).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

import multiphi_exudyn._core as core
from multiphi_exudyn.display import Shown
from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.events.transitions.loaded_levels import LoadedLevels
from multiphi_exudyn.events.transitions.state import State
from multiphi_exudyn.levels.base.modal_base import ModalBase
from multiphi_exudyn.levels.equilibrium.static_equilibrium import Equilibrium
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mathematics.round_off import INDEPENDENT, drop_round_off
from multiphi_exudyn.mechanics.element import friction_spring

__all__ = ["Start", "StartProjection", "first_start"]


OPEN, CLOSED = 0, 1  # states of a contact
SLIP_FORWARD, IDLE = 1, 3  # of friction, after stick; the latter of contacts that are not rigid
TOUCHING = 1e-9  # of the gap and of the terms of it: a smaller gap touches
CONTINUED = 1e-12  # of the possible size of the motion: a smaller gap is round-off at the start of a continued run
NO_PLACES = np.zeros(0)  # held places of a start without friction


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


@dataclass(frozen=True)
class _Scales:
    """Scales by which the gaps (l,) of all starts in some levels are judged; directions: h (m, l).

    stops, speeds: gaps at y = 0 [m] and velocities of stops [m/s]. touching: tolerance from the gaps' own terms and the
    loads. sizes: |h|. times: longest times (m,) [s] for which a velocity moves a mode one way. apart: first states of
    elements of which none touches, None where some have several such states. projection: the quick check that none
    touches, None where the base is not complete.
    """

    directions: np.ndarray
    stops: np.ndarray
    speeds: np.ndarray
    touching: np.ndarray
    sizes: np.ndarray
    times: np.ndarray
    apart: tuple[int, ...] | None
    projection: StartProjection | None

    @classmethod
    def of(cls, levels: LoadedLevels, end: float) -> _Scales:
        """Scales under the loads until the end [s] of a run."""
        model, base, excitation = levels.model, levels.model.base, levels.excitation
        omega, sizes = base.modes.omega, np.linalg.norm(base.directions, axis=0)
        times = np.minimum(np.divide(1.0, omega, out=np.full(len(omega), end), where=omega > 0), end)
        gap_terms = base.magnitudes[1] + excitation.stop_travel
        gaps = np.divide(gap_terms, sizes, out=np.zeros(len(gap_terms)), where=sizes > 0)
        others = np.where(np.isinf(base.stiffnesses), np.max(gaps, initial=0.0), 0.0)
        lengths = float(np.linalg.norm(excitation.largest_load * times**2)) + others
        stop_positions, speeds = map(excitation.moved, levels.drive.values[:2])
        apart = None if model.general or model.force_laws else (OPEN,) * len(model.contacts)
        near = TOUCHING * gap_terms + CONTINUED * lengths * sizes
        stops, projection = base.gaps - stop_positions, None
        if base.complete:  # the terms of h.y are no more than |h| |y|
            lengths = np.where(sizes > 0, sizes, 1.0)
            projection = StartProjection(base, times, base.directions / lengths, (near - stops) / lengths, 2 * TOUCHING)
        return cls(base.directions, stops, speeds, near, sizes, times, apart, projection)

    def near(self, terms: np.ndarray, length: float) -> np.ndarray:
        """Gaps (l,) [m] below which a contact touches: by the terms (l,) of h.y and by the size of the motion."""
        return TOUCHING * terms + (CONTINUED * length) * self.sizes + self.touching


def first_start(
    levels: LoadedLevels,
    end: float,
    displacement: np.ndarray | None,
    velocity: np.ndarray | None,
    rest: Equilibrium | None = None,
) -> Start:
    """Start of a run to ``end`` [s] from x, x' (n,), None for zero, with the first states of the contacts.

    rest: equilibrium in whose place x is, with the springs of friction stretched.
    """
    base, vector = levels.model.base, levels.model.structure.vector
    scales: _Scales = levels.starts.get_or_build(end, lambda: _Scales.of(levels, end))
    projection, far = scales.projection, False
    known = None if rest is None or velocity is not None else rest.coordinates(base)
    if known is not None:
        y, v = known, np.zeros(len(known))
        far = projection is not None and projection.is_far_at_rest(y)
    else:
        given = displacement if rest is None else rest.displacement
        x = None if given is None else vector("displacement", given)
        x_t = None if velocity is None else vector("velocity", velocity)
        if projection is None:
            y, v = [np.zeros(len(scales.times)) if each is None else base.coordinates(each) for each in (x, x_t)]
        else:
            y, v, far = projection.coordinates(x, x_t)
    if far and scales.apart is not None and not levels.model.residual:
        return Start(y, v, (), (), scales.stops, scales.apart, NO_PLACES)
    moving = v * scales.times
    length = math.sqrt(y.dot(y)) + math.sqrt(moving.dot(moving))
    gaps, near = y.dot(base.directions) + scales.stops, scales.near(np.abs(y) @ base.magnitudes[0], length)
    start = _in_touch(levels.model, scales, (y, v), (gaps.tolist(), near.tolist()), rest)
    return _pressed(levels, start) if levels.model.residual else start


def _pressed(levels: LoadedLevels, start: Start) -> Start:
    """Start with those contacts on a residual boundary closed that press where the modes are as given."""
    model, host = levels.model, levels.level(start.states)
    jump, w = start.displacement - host.asymptotic.configuration, np.concatenate([levels.drive.values[0], start.held])
    xi = np.concatenate([host.modal.inertial.T @ (jump - host.channels.shapes @ w), w])
    gaps = host.level.gap_rows @ xi + host.gap_constants
    pressed = model.residual_boundary(host.level.indices).pressed(gaps[list(model.residual)])
    states = tuple(CLOSED if i in pressed else state for i, state in enumerate(start.states))
    return replace(start, states=states, penetrating=tuple(sorted((*start.penetrating, *pressed))))


def _in_touch(
    model: MultiPhiModel,
    scales: _Scales,
    start: tuple[np.ndarray, np.ndarray],
    judged: tuple[list[float], list[float]],
    rest: Equilibrium | None,
) -> Start:
    """Start y, y' in which some contacts may touch; judged: gaps (l,), and those below which they touch."""
    (y, v), (gaps, near), base, stretches = start, judged, model.base, {} if rest is None else rest.stretches
    terms = np.abs(v) @ base.magnitudes[0] + np.abs(scales.speeds)
    rates = drop_round_off(v @ base.directions - scales.speeds, terms)
    states = np.zeros(len(model.contacts), int)
    for i, contact in enumerate(model.contacts):
        if contact.rigid and not contact.held and gaps[i] < -near[i]:
            raise MultiPhiValueError(
                f"displacement: lies {-gaps[i]:g} m inside the rigid contact {contact.name!r}, need a gap >= 0 "
                "(static_equilibrium gives an admissible start)"
            )
        if i in model.residual:
            continue  # open in the host
        depth = 0.0 if abs(gaps[i]) <= near[i] else gaps[i]
        first_state = contact.first_state(depth, *rates[list(model.link_indices[i])].tolist())
        states[i] = [state.name for state in contact.states].index(first_state)
        if contact.rigid and not contact.held and gaps[i] <= near[i]:
            states[i] = CLOSED
    states = _independent(model, states)
    touching = tuple(i for i, c in enumerate(model.contacts) if c.rigid and not c.held and states[i] != OPEN)
    held = np.array([gaps[i] - stretches.get(model.links[i].name, 0.0) for i in model.held])
    gap_offsets = scales.stops.copy()
    gap_offsets[list(model.held)] -= held
    spring_links = tuple(k for k in model.active_links(states.tolist()) if k not in touching)
    return Start(y, v, spring_links, touching, gap_offsets, tuple(states.tolist()), held)


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


class StartProjection:
    """Projection of starts to a complete base.

    times: t (n,) [s]; units, bounds: h / |h| (n, l), b / |h| (l,); near: a.
    """

    def __init__(self, base: ModalBase, times: np.ndarray, units: np.ndarray, bounds: np.ndarray, near: float) -> None:
        self._onto, sizes = base.projection
        self._vectors = np.zeros((4, len(times)))  # x, x', y, y'
        self._check = core.StartProjection(sizes, times, units.T, bounds, near)

    def coordinates(self, x: np.ndarray | None, x_t: np.ndarray | None) -> tuple[np.ndarray, np.ndarray, bool]:
        """Return y, y' (n,) of x, x' (n,), None for zero, and whether the bound shows that no gap is near zero."""
        vectors = self._vectors
        vectors[:] = 0.0
        for i, given in enumerate((x, x_t)):
            if given is not None:
                vectors[i] = given
                self._onto.dot(vectors[i], out=vectors[2 + i])
        far = self._check.is_far(vectors)
        y, v = vectors[2:].copy()
        return y, v, far

    def is_far_at_rest(self, y: np.ndarray) -> bool:
        """Whether the bound shows that no gap is near zero at y (n,)."""
        self._vectors[:] = 0.0
        self._vectors[2] = y
        return bool(self._check.is_far(self._vectors))
