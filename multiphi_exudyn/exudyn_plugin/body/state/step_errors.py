"""Step errors: how far the trapezoidal rule changes the motion of modes that are not matched to its step h.

It lowers the frequency of a mode, so after a time t its phase lags by

    phi = (omega - (2/h) arctan(omega h/2)) t,   about omega t (omega h)^2 / 12

From the state at the start of a run and at every event on, and with that at its end for the whole run, as others may
have excited the body on the way, the error of a displacement is estimated as

    sqrt(sum a^2 min(phi, 2)^2 / max sum (eta^2 + eta'^2/omega^2)),   a^2 = (eta''/omega^2)^2 + (eta'/omega)^2

summed over the modes, whose vibration has the amplitude a: what follows a slow force has none, and fast modes that do
not vibrate do not count. On the cantilever of the examples the error is .4 to 4.4 times the estimate. It is kept for
halved steps too, to name steps that are short enough.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from multiphi_exudyn.display import per_cent
from multiphi_exudyn.exudyn_plugin.body.state.coordinates import Coordinates

__all__ = ["StepErrors"]

TOLERATED = 0.005  # of the largest displacement: a smaller estimate is not told
OPPOSITE = 2.0  # largest difference of two vibrations of amplitude one
HALVED = 0.5 ** np.arange(16)  # steps in units of the solver's


class StepErrors:
    """Estimate for a run from ``start`` to ``end`` [s] in steps of length ``step`` [s].

    corrected: whether events correct the motion, which then lags from one to the next only.
    """

    def __init__(self, step: float, start: float, end: float, corrected: bool) -> None:
        self.step, self._start, self._end, self._corrected = step, start, end, corrected
        self._last: tuple[float, np.ndarray, np.ndarray] = end, np.zeros(0), np.zeros(0)
        self._squares, self._size, self._fastest = np.zeros(len(HALVED)), 0.0, 0.0

    def include(self, coordinates: Coordinates, time: float) -> None:
        """Include the present state of a body, at the start of the run or after an event at a time [s]."""
        if self._corrected:
            self._squares = self._squares_until(time)
        stepped = coordinates.stepped
        r, s = stepped.modes, stepped.size
        eta, eta_t, eta_tt = np.split(stepped.to_physical @ np.concatenate(coordinates.views), 3)
        vibrates = np.flatnonzero(stepped.squares[:r] > 0)
        squares = stepped.squares[vibrates]
        omega, moved = np.sqrt(squares), eta_t[vibrates] ** 2 / squares
        self._size = max(self._size, float(np.sum(eta[:s] ** 2) + np.sum(moved)))
        self._last = time, omega, (eta_tt[vibrates] / squares) ** 2 + moved
        self._fastest = max(self._fastest, float(np.max(omega, initial=0.0)))
        if not self._corrected:
            self._squares = self._squares_until(self._end)

    def finish(self, coordinates: Coordinates) -> None:
        """Include the state at the end of the run."""
        if not self._corrected:
            self.include(coordinates, self._start)

    def _squares_until(self, time: float) -> np.ndarray:
        """Largest squares of the errors until a time [s], for all steps (k,)."""
        start, omega, amplitudes = self._last
        steps = self.step * HALVED[:, None]
        lag = (omega - 2 / steps * np.arctan(omega * steps / 2)) * (time - start)
        return np.maximum(self._squares, np.minimum(lag, OPPOSITE) ** 2 @ amplitudes)

    @property
    def warnings(self) -> Iterator[str]:
        """Warning of steps that are too long."""
        squares = self._squares_until(self._end)
        errors = np.sqrt(squares / self._size) if self._size > 0 else squares
        if errors[0] <= TOLERATED:
            return
        step, longest = self.step, math.pi / self._fastest
        enough = step * float(np.max(HALVED[errors <= TOLERATED], initial=HALVED[-1]))
        shorter = f"take steps of {enough:.2g} s"
        remedy = f"give matchedStepSize={step:g}, or {shorter}"
        if step >= longest:
            remedy = f"{shorter}, or steps below {longest:.3g} s with the same matchedStepSize, or keep fewer modes"
        count = 2 * longest / step
        yield (
            f"coarse steps: the modes are not matched to steps of {step:g} s, {count:.3g} in the shortest kept period, "
            f"which delay the motion by an estimated {per_cent(float(errors[0]))} of it; {remedy}"
        )
