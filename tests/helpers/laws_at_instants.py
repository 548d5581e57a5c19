"""The laws of a run at instants between its events, from its motion and forces alone: no reference is needed."""

import math

import numpy as np

from multiphi_exudyn import ConstantLoad, ForceLaw, Friction, SampledLoad, Trajectory, UnilateralContact

CLOSE = 1e-9  # of the largest force or velocity: more is a violation
AWAY = 1e-7  # of the run: instants are so far from events


def instants(run: Trajectory, count: int = 3) -> np.ndarray:
    """So many instants (k,) in every interval between events, at irrational parts of it."""
    ends = np.unique([run.t_start, *(event.time for event in run.events), run.t_end])
    parts = np.modf(np.sqrt(2.0) * np.arange(1, count + 1))[0]
    times = (ends[:-1, None] + np.diff(ends)[:, None] * parts).ravel()
    distances = np.min(np.abs(times[:, None] - ends), axis=1)
    return times[distances > AWAY * (run.t_end - run.t_start)]


def residual(run: Trajectory, times: np.ndarray, loads=()) -> float:
    """Largest |M x'' + C x' + K x - f - sum h N + sum h_t T| over the largest of its terms.

    loads: constant and sampled ones. Of dampings only a matrix, or none.
    """
    structure = run.model.structure
    terms = [
        structure.mass @ run.acceleration(times),
        structure.stiffness @ run.displacement(times),
    ]
    if isinstance(structure.damping, np.ndarray):
        terms.append(structure.damping @ run.velocity(times))
    for load in loads:
        assert isinstance(load, (ConstantLoad, SampledLoad))
        force = load.force if isinstance(load, ConstantLoad) else np.interp(times, load.time, load.force)
        terms.append(-np.outer(structure.row(load.at), np.broadcast_to(force, times.shape)))
    for element in run.model.contacts:
        if isinstance(element, Friction):
            terms.append(np.outer(structure.row(element.direction), run.friction_force(element.name, times)))
            continue
        direction = element.at if isinstance(element, ForceLaw) else element.direction
        terms.append(-np.outer(structure.row(direction), run.contact_force(element.name, times)))
        if isinstance(element, UnilateralContact) and element.most:
            tangential = structure.row(element.tangential)
            terms.append(np.outer(tangential, run.friction_force(element.name, times)))
    return float(np.abs(sum(terms)).max() / max(np.abs(term).max() for term in terms))


def violations_of_friction(run: Trajectory, times: np.ndarray) -> list[str]:
    """Names of friction whose force exceeds its limit, or pushes along its slip, and of springs that do not follow."""
    wrong = []
    for element in (each for each in run.model.contacts if isinstance(each, Friction)):
        row, force = run.model.structure.row(element.direction), run.friction_force(element.name, times)
        place, speed = row @ run.displacement(times), row @ run.velocity(times) - element.velocity
        fastest = np.abs(speed).max()
        sticks, most = (
            np.zeros(len(times), bool),
            element.limit if element.static_limit is None else element.static_limit,
        )
        for first, last in run.stick_intervals(element.name):
            within = (times > first) & (times < last)
            sticks |= within
            if not math.isinf(element.stiffness) and np.any(within):
                ahead = force[within] / element.stiffness - place[within] + element.velocity * times[within]
                if np.ptp(ahead) > CLOSE * (np.abs(place).max() + most / element.stiffness):
                    wrong.append(f"{element.name}: its spring does not follow")
        if np.any(np.abs(force) > (1 + CLOSE) * most):
            wrong.append(f"{element.name}: beyond its limit")
        if np.any(~sticks & (force * speed < -CLOSE * element.limit * fastest)):
            wrong.append(f"{element.name}: pushes along its slip")
    return wrong
