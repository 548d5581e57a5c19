"""The full equations under loads, integrated step by step to 1e-12: what driven motions are compared with."""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.integrate import solve_ivp

from multiphi_exudyn import LinearStructure, UnilateralContact

RTOL, ATOL = 1e-12, 1e-14


def integrated(
    structure: LinearStructure,
    times: np.ndarray,
    load: Callable[[float], np.ndarray],
    *,
    contacts: Sequence[UnilateralContact] = (),
    moved: Callable[[float, int], float] = lambda t, i: 0.0,
    displacement: np.ndarray | None = None,
    breaks: Sequence[float] = (),
    longest: float = 0.05,
) -> tuple[np.ndarray, list[float]]:
    """x (n, k) at times (k,) with compliant contacts, and the times of their events.

    moved(t, i): way of stop i. breaks: where the load is not smooth. longest: step, so that no event is stepped over.
    """
    n, stiffness = structure.n, np.asarray(structure.stiffness)
    inverse = np.linalg.inv(np.asarray(structure.mass))
    damping = np.zeros((n, n)) if structure.damping is None else np.asarray(structure.damping)
    rows = [structure.row(contact.direction) for contact in contacts]

    def gap(t: float, y: np.ndarray, i: int) -> float:
        return float(rows[i] @ y[:n] + contacts[i].gap - moved(t, i))

    y = np.concatenate([np.zeros(n) if displacement is None else displacement, np.zeros(n)])
    closed = [gap(0.0, y, i) < 0 for i in range(len(contacts))]
    values, events, t = np.zeros((n, len(times))), [], 0.0

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        force = load(t) - stiffness @ y[:n] - damping @ y[n:]
        for i, contact in enumerate(contacts):
            if closed[i]:
                force = force - contact.stiffness * gap(t, y, i) * rows[i]
        return np.concatenate([y[n:], inverse @ force])

    for end in [*sorted(b for b in breaks if 0 < b < times[-1]), times[-1]]:
        while t < end:
            found = solve_ivp(
                rate,
                (t, end),
                y,
                method="DOP853",
                rtol=RTOL,
                atol=ATOL,
                max_step=longest,
                dense_output=True,
                events=[_crossing(gap, i, 1 if closed[i] else -1) for i in range(len(contacts))],
            )
            here = (times >= t) & (times <= found.t[-1])
            if np.any(here):
                values[:, here] = found.sol(times[here])[:n]
            t, y = float(found.t[-1]), found.y[:, -1]
            for i, instants in enumerate(found.t_events or ()):
                if len(instants):
                    closed[i] = not closed[i]
                    events.append(t)
    return values, events


def _crossing(gap: Callable[[float, np.ndarray, int], float], i: int, direction: int) -> Callable:
    def event(t: float, y: np.ndarray) -> float:
        return gap(t, y, i)

    event.terminal, event.direction = True, direction
    return event
