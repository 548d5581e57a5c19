"""Start: displacement and velocity of a run in base coordinates, and the states that its elements begin in.

A contact is in touch where its gap is round-off of what makes it, |h|.|y| and the gaps themselves, or of how far the
motion may take the structure: |y|, where y' takes the modes, and what the loads make; of a rigid one the largest gap
too, as it may not lie inside. A compliant one that lies inside by so little has a force.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.events.arrays import CLOSE, IDLE, OPEN, SLIP_FORWARD
from multiphi_exudyn.events.packing.start_arrays import Start
from multiphi_exudyn.events.transitions.loaded_levels import LoadedLevels
from multiphi_exudyn.levels.model import MultiPhiModel
from multiphi_exudyn.mathematics.complementarity.least_distance import INDEPENDENT
from multiphi_exudyn.mathematics.round_off import drop_round_off
from multiphi_exudyn.mechanics.element import friction_spring
from multiphi_exudyn.time.run.start_projection import SettingOut

__all__ = ["first_start"]

TOUCHING = 1e-9  # of the gap and of the displacements that make it: closer than this is in touch
UNSEEN = 1e-12  # of what the motion may make of a gap: nearer is round-off, where a run goes on from another's end
NOWHERE = np.zeros(0)  # no held places


@dataclass(frozen=True)
class _Scales:
    """What the gaps (l,) of starts in some levels are judged by, whatever the start; directions: h (m, l).

    stops, speeds: where stops are.
    touching: of the gaps' own terms and what the loads make of them; sizes: of directions, |h|. times: in which a speed
    moves a mode at most, (m,) [s]. apart: the start of elements of which none touches, None where some have states of
    their own even then. setting_out: what sees at once that none does, None where the base is not complete.
    """

    directions: np.ndarray
    stops: np.ndarray
    speeds: np.ndarray
    touching: np.ndarray
    sizes: np.ndarray
    times: np.ndarray
    apart: tuple[int, ...] | None
    setting_out: SettingOut | None

    @classmethod
    def of(cls, levels: LoadedLevels, end: float) -> _Scales:
        """Under the loads until the end [s] of a run."""
        model, base, excitation = levels.model, levels.model.base, levels.excitation
        omega, sizes = base.modes.omega, np.linalg.norm(base.directions, axis=0)
        times = np.minimum(np.divide(1.0, omega, out=np.full(len(omega), end), where=omega > 0), end)
        ways = base.magnitudes[1] + excitation.stop_ways
        gaps = np.divide(ways, sizes, out=np.zeros(len(ways)), where=sizes > 0)
        others = np.where(np.isinf(base.stiffnesses), np.max(gaps, initial=0.0), 0.0)
        lengths = float(np.linalg.norm(excitation.largest_load * times**2)) + others
        moved, speeds = map(excitation.moved, levels.drive.values[:2])
        apart = None if model.general or model.force_laws else (OPEN,) * len(model.contacts)
        near = TOUCHING * ways + UNSEEN * lengths * sizes
        stops, out = base.gaps - moved, None
        if base.complete:  # the terms of h.y are no more than |h| |y|
            lengths = np.where(sizes > 0, sizes, 1.0)
            out = SettingOut(base, times, base.directions / lengths, (near - stops) / lengths, 2 * TOUCHING)
        return cls(base.directions, stops, speeds, near, sizes, times, apart, out)

    def near(self, terms: np.ndarray, length: float) -> np.ndarray:
        """Gaps (l,) [m] below which a contact is in touch: by the terms (l,) of h.y, by where the motion goes."""
        return TOUCHING * terms + (UNSEEN * length) * self.sizes + self.touching


def first_start(
    levels: LoadedLevels,
    end: float,
    displacement: np.ndarray | None,
    velocity: np.ndarray | None,
    stretches: Mapping[str, float],
    compiled: bool | None = None,
) -> Start:
    """The start from x, x' (n,), None for zero, of a run to ``end`` [s] as the contacts see it.

    stretches: of the springs of friction, by the names of their links. compiled: False for plain Python alone.
    """
    base, vector = levels.model.base, levels.model.structure.vector
    scales: _Scales = levels.starts.get_or_build(end, lambda: _Scales.of(levels, end))
    x = None if displacement is None else vector("displacement", displacement)
    x_t = None if velocity is None else vector("velocity", velocity)
    if scales.setting_out is None:
        y, v = [np.zeros(len(scales.times)) if given is None else base.coordinates(given) for given in (x, x_t)]
    else:
        y, v, far = scales.setting_out.coordinates(x, x_t, compiled)
        if far and scales.apart is not None:
            return Start(y, v, (), (), scales.stops, scales.apart, NOWHERE)
    moving = v * scales.times
    length = math.sqrt(y.dot(y)) + math.sqrt(moving.dot(moving))
    gaps, near = y.dot(base.directions) + scales.stops, scales.near(np.abs(y) @ base.magnitudes[0], length)
    return _in_touch(levels.model, scales, (y, v), (gaps.tolist(), near.tolist()), stretches)


def _in_touch(
    model: MultiPhiModel,
    scales: _Scales,
    start: tuple[np.ndarray, np.ndarray],
    judged: tuple[list[float], list[float]],
    stretches: Mapping[str, float],
) -> Start:
    """The start y, y' in which some contacts may be in touch; judged: gaps, and those (l,) below which they are."""
    (y, v), (gaps, near), base = start, judged, model.base
    terms = np.abs(v) @ base.magnitudes[0] + np.abs(scales.speeds)
    rates = drop_round_off(v @ base.directions - scales.speeds, terms)
    states = np.zeros(len(model.contacts), int)
    for i, contact in enumerate(model.contacts):
        if contact.rigid and not contact.held and gaps[i] < -near[i]:
            raise MultiPhiValueError(
                f"displacement: lies {-gaps[i]:g} m inside the rigid contact {contact.name!r}, need a gap >= 0 "
                "(static_equilibrium gives an admissible start)"
            )
        depth = 0.0 if abs(gaps[i]) <= near[i] else gaps[i]
        named = contact.first_state(depth, *rates[list(model.link_indices[i])].tolist())
        states[i] = [state.name for state in contact.states].index(named)
        if contact.rigid and not contact.held and gaps[i] <= near[i]:
            states[i] = CLOSE
    states = _independent(model, states)
    touching = tuple(i for i, c in enumerate(model.contacts) if c.rigid and not c.held and states[i] != OPEN)
    held = np.array([gaps[i] - stretches.get(model.links[i].name, 0.0) for i in model.held])
    left = scales.stops.copy()
    left[list(model.held)] -= held
    sprung = tuple(k for k in model.active_links(states.tolist()) if k not in touching)
    return Start(y, v, sprung, touching, left, tuple(states.tolist()), held)


def _independent(model: MultiPhiModel, states: np.ndarray) -> np.ndarray:
    """States of which, of rigid links that would stick, an independent set does; the others wait till it is decided."""
    found = np.zeros((0, len(model.base.directions)))
    for i, element in enumerate(model.contacts):
        sticks, number, spring, _ = friction_spring(element)
        if states[i] == sticks and spring == 0 and (element.held or not element.rigid):
            row = model.base.directions[:, model.link_indices[i][number]]
            left = row / np.linalg.norm(row)
            for _ in range(2):
                left = left - (found @ left) @ found
            size = float(np.linalg.norm(left))
            if size > INDEPENDENT:
                found = np.vstack([found, left / size])
            else:
                states[i] = sticks + (SLIP_FORWARD if element.held else IDLE)
    return states
