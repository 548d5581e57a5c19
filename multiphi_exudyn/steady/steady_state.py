"""Steady state: the response to which a run under a harmonic load settles, from the map of one period of the load.

The state at whole periods T of the load is a sequence, q = (s y, y', F / sqrt(k)) with s = max(omega, 2 pi / T), y in
base coordinates, F the forces of springs k in series with friction,

    q_k+1 = P(q_k)

A response of order p repeats after p periods, P^p(q) = q: p = 1 is a periodic response, p > 1 a sub-harmonic one. The
run continues in chunks of periods until the states repeat to a tolerance. To save time with slowly decaying motions,
Newton's method searches for the repeating state between chunks (shooting.py), and if it is an attractor the next chunk
starts there. A chunk takes over the whole final state of the previous one, stick positions included. If a link sticks
for ever, every stick position belongs to another response; the result is the one to which the start leads.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.levels.equilibrium.static_equilibrium import Equilibrium
from multiphi_exudyn.levels.model.mode_choice import Tolerance
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mechanics.loads.loads import HarmonicLoad
from multiphi_exudyn.mechanics.loads.static_loads import ConstantLoad, Gravity, StaticLoad
from multiphi_exudyn.mechanics.structures.arguments import is_real
from multiphi_exudyn.steady.settled_state import PeriodicLoad, SteadyState, course_of, frequency
from multiphi_exudyn.steady.settling import CHUNK, Search, with_warnings
from multiphi_exudyn.steady.shooting import PeriodMap
from multiphi_exudyn.time.simulate import Run, base_warnings_of, check_start, holding
from multiphi_exudyn.time.trajectory.trajectory import Trajectory
from multiphi_exudyn.time.warnings.warning_groups import issue, kept_back

__all__ = ["at_frequency", "settle_run", "steady_state"]

TIGHTEST = 1e-12  # smallest tolerance, above the round-off of a period


def steady_state(
    model: MultiPhiModel,
    load: PeriodicLoad,
    *,
    displacement: np.ndarray | None = None,
    velocity: np.ndarray | None = None,
    other_loads: Sequence[StaticLoad] = (),
    periods: int = 400,
    tolerance: float = 1e-6,
    start: Trajectory | Equilibrium | None = None,
) -> SteadyState:
    """Steady state of a run under a harmonic load.

        q_k+1 = P(q_k),   P^p(q) = q

    q is the state at whole periods of the load, P one period of the run, p the order of the response. The run continues
    until the states repeat; for slowly decaying motions Newton's method finds the repeating state from the present one.
    If there are several attractors, the start determines the response; the start includes stick positions of friction,
    which only ``start`` can give.

    Parameters
    ----------
    model : MultiPhiModel
        Structure and contacts; a ``Tolerance`` needs a run of ``simulate`` before, which determines the modes.
    load : HarmonicLoad or BaseMotion
        The harmonic load; a base motion needs a Harmonic course.
    displacement, velocity : array (n,), default None
        x [m, rad] and x' [m/s, rad/s] at t = 0, None for zero.
    other_loads : sequence of ConstantLoad and Gravity, default ()
        Static loads that act as well.
    periods : int, default 400
        Number of periods of the load after which a run that has not settled ends.
    tolerance : float, default 1e-6
        Tolerance to which states repeat, relative to the size of the motion; at least 1e-12.
    start : Trajectory or Equilibrium, default None
        Start of the run instead of a displacement, as in ``simulate``; time begins anew.

    Returns
    -------
    SteadyState
        "periodic", "not settled" or "failed", with its cause. A MultiPhiWarning is issued for each kind of its
        warnings.

    Raises
    ------
    MultiPhiTypeError
        For arguments of another kind, and a BaseMotion that is not Harmonic.
    MultiPhiValueError
        For a frequency of zero, a model with an undecided Tolerance, and periods or a tolerance out of range.

    Examples
    --------
    >>> import numpy as np
    >>> import multiphi_exudyn as mp
    >>> K = 4e4 * np.array([[2, -1, 0], [-1, 2, -1], [0, -1, 1]])  # N/m
    >>> chain = mp.LinearStructure(np.eye(3), K, mp.ModalDamping(0.01), {"tip": 2})
    >>> stop = mp.UnilateralContact("stop", "tip", gap=1e-3, stiffness=1e6)
    >>> model = mp.MultiPhiModel(chain, [stop])
    >>> state = mp.steady_state(model, mp.HarmonicLoad("tip", 20.0, 12.0))
    >>> state.status, round(1e3 * state.amplitude("tip"), 2)  # mm
    ('periodic', 1.76)
    """
    with kept_back():
        state = settle_run(model, load, (displacement, velocity, start), other_loads, periods, tolerance)
    issue(state.warnings)
    return state


def settle_run(
    model: MultiPhiModel,
    load: PeriodicLoad,
    begin: tuple[np.ndarray | None, np.ndarray | None, Trajectory | Equilibrium | None],
    other_loads: Sequence[StaticLoad],
    periods: int,
    tolerance: float,
) -> SteadyState:
    """Result of ``steady_state`` without its MultiPhiWarning; begin: x, x' (n,) and ``start``."""
    _check(model, load, other_loads, periods, tolerance)
    (displacement, velocity, start), loads, period = begin, (load, *other_loads), 1.0 / frequency(load)
    model = holding(model.decided or model, loads, start)
    run = Run(model, CHUNK * period, displacement, velocity, loads, start=start, rewound=True)
    check_start(run)
    search = Search(PeriodMap(model, loads, period), load, tolerance, base_warnings_of(run, model))
    return search.settle(with_warnings(run.trajectory()), periods)


def at_frequency(load: PeriodicLoad, frequency_hz: float) -> PeriodicLoad:
    """The load with another frequency [Hz]."""
    if isinstance(load, HarmonicLoad):
        return replace(load, frequency_hz=frequency_hz)
    return replace(load, course=replace(course_of(load), frequency_hz=frequency_hz))


def _check(
    model: MultiPhiModel, load: PeriodicLoad, other_loads: Sequence[StaticLoad], periods: int, tolerance: float
) -> None:
    if isinstance(model.modes, Tolerance) and model.decided is None:
        raise MultiPhiValueError(
            "model modes: got a Tolerance that has not decided yet, need a run of simulate first, a number or 'all'"
        )
    if frequency(load) == 0:
        raise MultiPhiValueError("load frequency_hz: got 0, need a frequency > 0 Hz")
    for other in other_loads:
        if not isinstance(other, (ConstantLoad, Gravity)):
            raise MultiPhiTypeError(f"other_loads: got {type(other).__name__}, need ConstantLoad or Gravity")
    if not isinstance(periods, (int, np.integer)) or periods < 1:
        raise MultiPhiValueError(f"periods: got {periods!r}, need an integer >= 1")
    if not is_real(tolerance) or not TIGHTEST <= tolerance < 1:
        raise MultiPhiValueError(f"tolerance: got {tolerance!r}, need {TIGHTEST:g} <= tolerance < 1")
