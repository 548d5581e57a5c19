"""The true nonlinear equations, integrated to 1e-12: what force laws and viscous contacts are compared with."""

from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp

from multiphi_exudyn import LinearStructure, UnilateralContact

RTOL, ATOL = 1e-12, 1e-13


def with_forces(
    structure: LinearStructure,
    times: np.ndarray,
    force: Callable[[float, np.ndarray, np.ndarray], np.ndarray],
    displacement: np.ndarray,
    rtol: float = RTOL,
) -> np.ndarray:
    """x (n, k) of M x'' + K x = force(t, x, x') from rest at ``displacement``, force smooth."""
    n, stiffness = structure.n, np.asarray(structure.stiffness)
    inverse = np.linalg.inv(np.asarray(structure.mass))

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        return np.concatenate([y[n:], inverse @ (force(t, y[:n], y[n:]) - stiffness @ y[:n])])

    start = np.concatenate([displacement, np.zeros(n)])
    return solve_ivp(rate, (0, times[-1]), start, method="DOP853", rtol=rtol, atol=ATOL, t_eval=times).y[:n]


def against_viscous(
    structure: LinearStructure,
    contact: UnilateralContact,
    times: np.ndarray,
    velocity: np.ndarray,
    longest: float,
    stop: Callable[[float], tuple[float, float]] = lambda t: (0.0, 0.0),
) -> tuple[np.ndarray, list[tuple[float, str, float]]]:
    """x (n, k) from x = 0, and (time, kind, gap) of every event; longest: step, so that no event is stepped over.

    stop: z and z' of a stop that moves.
    """
    n, stiffness, row = structure.n, np.asarray(structure.stiffness), structure.row(contact.direction)

    def gap(t, y):
        return row @ y[:n] + contact.gap - stop(t)[0]

    def force(t, y):
        return -contact.stiffness * gap(t, y) - contact.damping * (row @ y[n:] - stop(t)[1])

    def rate(t, y):
        pushed = row * force(t, y) if phase == "closed" else 0.0
        return np.concatenate([y[n:], pushed - stiffness @ y[:n]])

    waits = {"open": [_event(gap, -1)], "closed": [_event(force, -1)], "inside": [_event(gap, 1), _event(force, 1)]}
    y, t, values, events = np.concatenate([np.zeros(n), velocity]), 0.0, np.zeros((n, len(times))), []
    phase = "open" if gap(0, y) > 0 else "closed" if force(0, y) > 0 else "inside"
    while t < times[-1]:
        given = {"method": "DOP853", "rtol": RTOL, "atol": ATOL, "max_step": longest, "dense_output": True}
        found = solve_ivp(rate, (t, times[-1]), y, events=waits[phase], **given)
        here = (times >= t) & (times <= found.t[-1])
        if np.any(here):
            values[:, here] = found.sol(times[here])[:n]
        t, y = float(found.t[-1]), found.y[:, -1]
        if found.status != 1:
            break
        if phase == "inside" and len(found.t_events[0]):
            phase = "open"
            continue
        events.append((t, "open" if phase == "closed" else "close", gap(t, y)))
        phase = "closed" if phase != "closed" else "open" if gap(t, y) >= 0 else "inside"
    return values, events


def _event(function: Callable[[float, np.ndarray], float], direction: int) -> Callable:
    def event(t: float, y: np.ndarray) -> float:
        return function(t, y)

    event.terminal, event.direction = True, direction
    return event


def force_of_links(law, q):
    """F (k,) of a law at places q (k,), from the links that hold in its states there."""
    links, total = (law, *law.further), np.full(len(q), law.constant)
    states = {state.name: state for state in law.states}
    for i, place in enumerate(q):
        held = [links[k] for k in states[law.first_state(place - law.centre, 0.0)].holds]
        for link in held:
            sign = -1.0 if link.name.startswith(f"{law.name}+") else 1.0
            total[i] += sign * link.stiffness * (sign * place + link.gap)
    return total
