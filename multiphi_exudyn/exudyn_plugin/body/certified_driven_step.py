"""Certified test that nothing happens within a time step of a body under varying loads, from the step's two ends.

For a contact's function s (events/rule.py) of xi = (eta, w) linear interpolation is off by at most h^2/8 max|s''|:

    min(s0, s1) > h^2/8 (|[P R] A S^-1| max|S z'| + |R| |p'| + |P_w| |w''| + |R_w| |w'''|),
    max |S z'| <= (max at the ends + h |p'|) exp(sigma h)

in the notation of certified_step.py, p = P w + Q w' the modal force. The channels enter by bounds that hold for the
whole run; a kink of a sampled course counts as the second derivative 2 |jump of w'| / h. Steps in which a course itself
jumps are never taken for clear.
"""

from __future__ import annotations

import math

import numpy as np

from multiphi_exudyn.events.state import Row
from multiphi_exudyn.exudyn_plugin.body.certified_step import energy_norm, gains, swell
from multiphi_exudyn.exudyn_plugin.coupling.stepped_level import SteppedLevel
from multiphi_exudyn.mathematics.piecewise_exponential import PiecewiseExponential
from multiphi_exudyn.time.driven.excitation import Excitation
from multiphi_exudyn.time.driven.level import DrivenLevel

__all__ = ["DrivenStepTest", "jump_times"]


class DrivenStepTest:
    """The test for the functions ``rows`` of all contacts in one level, for steps of length ``step`` [s]."""

    def __init__(self, stepped: SteppedLevel, level: DrivenLevel, rows: list[Row], step: float) -> None:
        size, count, modes, q = stepped.size, len(rows), stepped.loaded.level.modes, level.excitation.channels
        position = np.reshape([row.position for row in rows], (count, modes + q))
        rate = np.reshape([row.rate for row in rows], (count, modes + q))
        modal = np.zeros((count, 3 * size))
        modal[:, :modes], modal[:, size : size + modes] = position[:, :modes], rate[:, :modes]
        constants = np.array([row.constant for row in rows]).reshape(count, 1)
        norm = np.hstack([energy_norm(stepped), np.zeros((2 * size, 1))])
        self._matrix = np.vstack([np.hstack([modal @ stepped.physical, constants]), norm])
        self._channels = np.hstack([position[:, modes:], rate[:, modes:]])
        self._count, self._share = count, step**2 / 8
        first, second, third = (np.array(bounds) for bounds in zip(*_bounds(level.excitation, step), strict=True))
        forced = float(np.linalg.norm(np.abs(level.force) @ first + np.abs(level.force_rate) @ second))
        self._gains = gains(stepped, modal[:, : 2 * size], 1) * swell(stepped, step)
        self._extra = np.linalg.norm(rate[:, :modes], axis=1) * forced + step * forced * self._gains
        self._extra += np.abs(position[:, modes:]) @ second + np.abs(rate[:, modes:]) @ third

    def clear(self, before: np.ndarray, w_before: np.ndarray, after: np.ndarray, w_after: np.ndarray) -> bool:
        """Whether nothing can have happened between (q, q', q'', 1), (w, w') at both ends of a step."""
        if not self._count:
            return True
        both = self._matrix @ np.column_stack([before, after])
        functions = both[: self._count] + self._channels @ np.column_stack([w_before.ravel(), w_after.ravel()])
        speed = math.sqrt(float(np.max(np.sum(both[self._count :] ** 2, axis=0))))
        limits = self._share * (self._gains * speed + self._extra)
        return bool(np.all(np.min(functions, axis=1) > limits))


def jump_times(excitation: Excitation) -> np.ndarray:
    """When a channel jumps, ascending [s]."""
    times = np.unique(np.concatenate([history.jump_times() for history in excitation.histories]))
    return np.asarray(times[times > 0])


def _bounds(excitation: Excitation, step: float) -> list[tuple[float, float, float]]:
    """Bounds of |w'|, |w''|, |w'''| of every channel, kinks counted for steps of this length."""
    return [_smooth_bounds(history, step) for history in excitation.histories]


def _smooth_bounds(history: PiecewiseExponential, step: float) -> tuple[float, float, float]:
    first = history.derivative
    second, third = first.derivative, first.derivative.derivative
    return first.largest, second.largest + _kinks(first, step), third.largest + _kinks(second, step)


def _kinks(derivative: PiecewiseExponential, step: float) -> float:
    """Second derivative that stands for the jumps of a first one within a step."""
    shortest = float(np.min(np.diff(derivative.breaks)))
    inner = derivative.jumps[1:-1] if len(derivative.jumps) > 2 else np.zeros(1)
    return 2 * float(np.max(np.abs(inner), initial=0.0)) / step * (1 + step / shortest)
