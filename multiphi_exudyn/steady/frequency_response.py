"""Frequency response of a structure with contacts: steady states under a harmonic load, one frequency after the other.

Each frequency starts from the final state of the previous one, as in a stepped-sine test. So if there are several
attractors, the curve stays on its branch as long as it exists, and ascending and descending frequencies give different
curves. Without contact both are the linear response, amplitude = |p.(K - omega^2 M + i omega C)^-1 b| F.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.display import Shown
from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.levels.equilibrium.static_equilibrium import Equilibrium
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mechanics.loads import StaticLoad
from multiphi_exudyn.mechanics.structure import At
from multiphi_exudyn.steady.steady_state import PeriodicLoad, SteadyState, at_frequency, settle_run
from multiphi_exudyn.time.model_warnings import grouped, issue, kept_back
from multiphi_exudyn.time.trajectory import Trajectory

__all__ = ["FrequencyResponse", "frequency_response"]


@dataclass(frozen=True, repr=False)
class FrequencyResponse(Shown):
    """Result of ``frequency_response``: steady states, one for each frequency.

    Attributes
    ----------
    frequencies : array (k,)
        Frequencies in the order of the runs [Hz].
    states : tuple of SteadyState
        Steady state of every frequency.
    """

    frequencies: np.ndarray
    states: tuple[SteadyState, ...]

    def _facts(self) -> Iterator[tuple[str, str]]:
        yield "frequencies", f"{len(self.frequencies)}, {min(self.frequencies):g} to {max(self.frequencies):g} Hz"
        yield "periodic", str(sum(state.status == "periodic" for state in self.states))
        yield "failed", str(sum(state.status == "failed" for state in self.states))

    @property
    def orders(self) -> np.ndarray:
        """Periods of the load in one period of the response (k,), 0 if it is not periodic."""
        return np.array([state.order for state in self.states])

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings of the states, a sentence for each kind with its frequencies."""
        groups = grouped(
            (f"{hz:g} Hz", state.warnings) for hz, state in zip(self.frequencies, self.states, strict=True)
        )
        return tuple(group.told(len(self.states)) for group in groups)

    @property
    def last(self) -> SteadyState:
        """The last state that has not failed."""
        return next((state for state in reversed(self.states) if state.status != "failed"), self.states[-1])

    def amplitude(self, point: At) -> np.ndarray:
        """Half the range (k,) [m] of a point in a period of the load, a mean over recorded periods; NaN if failed."""
        return np.array([np.mean(state.amplitudes(point)) for state in self.states])

    def duty(self, contact: str) -> np.ndarray:
        """Part of the time (k,) in which a contact is closed; NaN if failed."""
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

    Each frequency starts from the final state of the previous one, as in a stepped-sine test. So if there are several
    attractors, the curve stays on its branch as long as it exists, and ascending and descending frequencies give
    different curves. Without contact both are the linear response, amplitude = |p.(K - omega^2 M + i omega C)^-1 b| F.

    Parameters
    ----------
    model : MultiPhiModel
        Structure and contacts; a ``Tolerance`` needs a run of ``simulate`` before, which determines the modes.
    load : HarmonicLoad or BaseMotion
        The harmonic load, whose frequency is replaced.
    frequencies : array (k,)
        Frequencies in the order of the runs [Hz], > 0.
    displacement, velocity : array (n,), default None
        x [m, rad] and x' [m/s, rad/s] at the start of the first run, None for zero.
    other_loads : sequence of ConstantLoad and Gravity, default ()
        Static loads that act as well.
    periods : int, default 400
        Number of periods of the load after which a run that has not settled ends.
    tolerance : float, default 1e-6
        Tolerance to which states repeat, relative to the size of the motion.
    start : Trajectory or Equilibrium, default None
        Start of the first run instead of a displacement, as in ``simulate``.

    Returns
    -------
    FrequencyResponse
        If the run of a frequency fails, its state has the status "failed", and the next frequency has the same start.
        A MultiPhiWarning is issued for each kind of warning of the states.

    Raises
    ------
    MultiPhiTypeError
        For arguments of another kind, and a BaseMotion that is not Harmonic.
    MultiPhiValueError
        For frequencies that are not > 0, a model with an undecided Tolerance, and periods or a tolerance out of range.

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
            state = settle_run(model, at_frequency(load, hz), begin, other_loads, periods, tolerance)
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
