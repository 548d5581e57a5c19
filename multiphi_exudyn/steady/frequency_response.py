"""Frequency response of a structure with contacts: steady states under a harmonic load, one frequency after the other.

Each frequency starts from the state that the one before has reached, as a stepped-sine test does, so where several
responses attract the curve stays on its branch as long as there is one: frequencies going up and going down give
different curves. Without contact both are the linear response, amplitude = |p.(K - omega^2 M + i omega C)^-1 b| F.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.display import Shown
from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.levels.model import MultiPhiModel
from multiphi_exudyn.levels.static_equilibrium import Equilibrium
from multiphi_exudyn.mechanics.static_loads import StaticLoad
from multiphi_exudyn.mechanics.structure import At
from multiphi_exudyn.steady.settled_state import PeriodicLoad, SteadyState
from multiphi_exudyn.steady.steady_state import at_frequency, settled
from multiphi_exudyn.time.trajectory import Trajectory
from multiphi_exudyn.time.warning_groups import grouped, issue, kept_back

__all__ = ["FrequencyResponse", "frequency_response"]


@dataclass(frozen=True, repr=False)
class FrequencyResponse(Shown):
    """Result of ``frequency_response``: steady states, one for each frequency.

    Attributes
    ----------
    frequencies : array (k,)
        In the order in which they were run [Hz].
    states : tuple of SteadyState
        k of them.

    Examples
    --------
    >>> import numpy as np
    >>> import multiphi_exudyn as mp
    >>> K = 4e4 * np.array([[2, -1, 0], [-1, 2, -1], [0, -1, 1]])  # N/m
    >>> chain = mp.LinearStructure(np.eye(3), K, mp.ModalDamping(0.01), {"tip": 2})
    >>> stop = mp.UnilateralContact("stop", "tip", gap=1e-3, stiffness=1e6)
    >>> model = mp.MultiPhiModel(chain, [stop])
    >>> load = mp.HarmonicLoad("tip", 2.0, 10.0)
    >>> response = mp.frequency_response(model, load, [10.0, 12.0])
    >>> response.orders.tolist(), response.duty("stop").tolist()
    ([1, 1], [0.0, 0.0])
    """

    frequencies: np.ndarray
    states: tuple[SteadyState, ...]

    def _facts(self) -> Iterator[tuple[str, str]]:
        yield "frequencies", f"{len(self.frequencies)}, {min(self.frequencies):g} to {max(self.frequencies):g} Hz"
        yield "periodic", str(sum(state.status == "periodic" for state in self.states))
        yield "failed", str(sum(state.status == "failed" for state in self.states))

    @property
    def orders(self) -> np.ndarray:
        """Periods of the load in one of the response (k,), 0 where it is not periodic."""
        return np.array([state.order for state in self.states])

    @property
    def warnings(self) -> tuple[str, ...]:
        """What to distrust in the states, a sentence for each kind with the frequencies that have it."""
        found = grouped((f"{hz:g} Hz", state.warnings) for hz, state in zip(self.frequencies, self.states, strict=True))
        return tuple(group.told(len(self.states)) for group in found)

    @property
    def last(self) -> SteadyState:
        """The last state that has not failed."""
        return next((state for state in reversed(self.states) if state.status != "failed"), self.states[-1])

    def amplitude(self, point: At) -> np.ndarray:
        """Half the range (k,) [m] of a point in a period of the load, the mean over those kept; NaN where failed."""
        return np.array([np.mean(state.amplitudes(point)) for state in self.states])

    def duty(self, contact: str) -> np.ndarray:
        """Part of the time (k,) that a contact is closed; NaN where failed."""
        return np.array([state.duty(contact) for state in self.states])


def frequency_response(
    model: MultiPhiModel,
    load: PeriodicLoad,
    frequencies: Sequence[float] | np.ndarray,
    *,
    displacement: np.ndarray | None = None,
    velocity: np.ndarray | None = None,
    other_loads: Sequence[StaticLoad] = (),
    periods: int = 400,
    tolerance: float = 1e-6,
    start: Trajectory | Equilibrium | None = None,
) -> FrequencyResponse:
    """Steady states under a harmonic load, one frequency after the other.

    Each starts from the state that the one before has reached, as a stepped-sine test does, so where several responses
    attract the curve stays on its branch as long as there is one: going up and going down give different curves.
    Without contact both are the linear response, amplitude = |p.(K - omega^2 M + i omega C)^-1 b| F.

    Parameters
    ----------
    model : MultiPhiModel
        Structure and contacts; one with a ``Tolerance`` has to be decided, by a run of ``simulate``.
    load : HarmonicLoad or BaseMotion
        Whose frequency is replaced.
    frequencies : array (k,)
        In the order in which they are run [Hz], > 0.
    displacement, velocity : array (n,), default None
        x [m, rad] and x' [m/s, rad/s] that the first one starts from, None for zero.
    other_loads : sequence of ConstantLoad and Gravity, default ()
        That act as well.
    periods : int, default 400
        Of the load, after which a run that has not settled ends.
    tolerance : float, default 1e-6
        Relative to the size of the motion, to which states repeat.
    start : Trajectory or Equilibrium, default None
        What the first one starts from instead, as in ``simulate``.

    Returns
    -------
    FrequencyResponse
        A frequency at which the run fails is a state with that status; the next one starts where the failed one did. A
        MultiPhiWarning is issued for each kind of warning that states have.

    Raises
    ------
    MultiPhiTypeError
        For arguments of another kind, and a BaseMotion that is not Harmonic.
    MultiPhiValueError
        For frequencies that are not > 0, a model with a Tolerance that has not decided, and periods or a tolerance out
        of range.

    Examples
    --------
    The linear response, as this load is too small to close the stop:

    >>> import numpy as np
    >>> import multiphi_exudyn as mp
    >>> K = 4e4 * np.array([[2, -1, 0], [-1, 2, -1], [0, -1, 1]])  # N/m
    >>> chain = mp.LinearStructure(np.eye(3), K, mp.ModalDamping(0.01), {"tip": 2})
    >>> stop = mp.UnilateralContact("stop", "tip", gap=1e-3, stiffness=1e6)
    >>> model = mp.MultiPhiModel(chain, [stop])
    >>> load = mp.HarmonicLoad("tip", 2.0, 10.0)
    >>> response = mp.frequency_response(model, load, [10.0, 12.0])
    >>> print((1e3 * response.amplitude("tip")).round(3))  # mm
    [0.287 0.499]
    """
    states = list[SteadyState]()
    begin: tuple[np.ndarray | None, np.ndarray | None, Trajectory | Equilibrium | None] = displacement, velocity, start
    with kept_back():
        for hz in _frequencies(frequencies):
            state = settled(model, at_frequency(load, hz), begin, other_loads, periods, tolerance)
            states.append(state)
            if state.status != "failed":
                begin = None, None, state.trajectory
    response = FrequencyResponse(np.array(frequencies, dtype=float), tuple(states))
    issue(response.warnings)
    return response


def _frequencies(given: Sequence[float] | np.ndarray) -> list[float]:
    try:
        values = np.array(given, dtype=float)
    except (TypeError, ValueError) as error:
        raise MultiPhiTypeError(f"frequencies: got {type(given).__name__}, need (k,) numbers in Hz") from error
    if values.ndim != 1 or len(values) == 0:
        raise MultiPhiValueError(f"frequencies: got shape {values.shape}, need (k,) with k >= 1")
    if not np.all(np.isfinite(values) & (values > 0)):
        raise MultiPhiValueError(f"frequencies: got {values[~(values > 0)][:1]}, need finite frequencies > 0 Hz")
    return values.tolist()
