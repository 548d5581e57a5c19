"""The judge of a run: the laws of mechanics and of contact along a trajectory, without any reference.

    broken = broken_laws(trajectory, loads, start=(x0, v0))   # [] where every law holds, else one sentence for each

What is checked, at a few instants of the segments and at a few events, always the same ones of the same run:

    motion      M x'' + C x' + K x - f - sum h N + sum h_t T = 0,   x' and x'' the derivatives of x
    contact     rigid     N >= 0, g >= 0, N g = 0, N g' = 0          g = h.x + gap - z(t)
                compliant N = k max(0, -g);   viscous N = max(0, -k g - c g') where g < 0, else 0
    friction    |T| <= mu_s N;   T s >= 0 and |T| = mu N where the patch slips, with s = (h_t.x - v t - T/k)'
    force law   N = -F(q)
    instants    x never jumps;   M (x'+ - x'-) = sum h p - sum h_t q,   p >= 0, |q| <= mu p, q of rigid contacts alone
                g'+ >= 0, for a contact struck once without friction g'+ = -e g'-;   without impulse x' does not jump
    switching   all over the run, refined at the lowest places: an open contact is not inside its stop, a closed one
                presses, what sticks stays within its limit; whatever changes its state has an event
    energy      the ledger is closed, its rows impact, damping and friction are not negative, its losses are those of
                the events, its first and last energies those of x and x'; energy less the work of constant loads never
                rises, but by what a damped stop gives back that closes again inside (``lawful_rise``)

Of a truncated model: the equation of motion projected onto the modes of the level, N >= 0 of rigid and viscous
contacts, |T| <= mu_s N, no open contact deeper inside its stop than the trajectory reports, a closed ledger with these
rows, no rise of energy but at events. The check shares with the loop what the public methods of the trajectory tell,
and nothing else: matrices, contacts and loads are those that the model was given.

Every bound is relative to the absolute values of the terms that are summed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from scipy.optimize import lsq_linear

from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.element import Element
from multiphi_exudyn.mechanics.friction import Friction
from multiphi_exudyn.mechanics.loads import Load
from multiphi_exudyn.study.judged_run import BRIEF, FAR, NODES, SEGMENTS, Inside, JudgedRun
from multiphi_exudyn.time.state import event_table, total_loss
from multiphi_exudyn.time.trajectory import Trajectory

__all__ = ["broken_laws", "energy_rise", "lawful_rise"]

INTERVALS = 20  # short intervals within segments, on each of which the laws are checked at NODES instants
IMPULSES = 3  # of the intervals over which the forces of contacts are integrated
EXACT = 1e-8  # of the terms of a sum: larger is no round-off
MOVES = 1e-6  # of the largest velocity: slower slip has no direction
ENERGY = 1e-8  # of the energies turned over
TOUCHES = 1e-13  # of a gap's terms: less is none
SAMPLES = 20_000  # instants of the grid all over the run
LOWEST = 8  # places at which a lowest value is looked for between the instants
POLISH, ROUNDS = 41, 3  # instants around such a place, so many times over
REPORTED = 0.5  # of a depth that is found: less must not be reported; both are sampled


def broken_laws(
    trajectory: Trajectory,
    loads: Sequence[Load] = (),
    start: tuple[np.ndarray, np.ndarray] | None = None,
    intervals: int = INTERVALS,
    seed: int = 0,
    exact: float = EXACT,
    samples: int = SAMPLES,
) -> list[str]:
    """The laws that a run breaks, one sentence each with an instant and by how much; empty if it obeys all.

    Parameters
    ----------
    trajectory : Trajectory
        The run, also the part of a failed one before its failure.
    loads : sequence of loads
        Those of the run.
    start : (array (n,), array (n,)), default None
        x, x' [m, m/s] that the run was given, to check what happens at the start; None: not checked.
    intervals : int
        How many short intervals within segments are looked at.
    seed : int
        Of the random instants.
    exact : float
        Share of the terms of a force or a velocity above which a deviation is no round-off.
    samples : int
        How many instants all over the run are looked at for what switches without an event.

    Returns
    -------
    list of str
        "law: name off by ... of its terms at t = ... s".
    """
    if not trajectory.segments:
        return []
    run = JudgedRun(trajectory, tuple(loads), start, exact)
    inside = run.inside(intervals, np.random.default_rng(seed))
    found: list[str] = []
    if inside is not None:
        for check in (_motion, _derivatives, _contacts, _impulses_of_forces, _frictions, _laws):
            found += check(run, inside)
        found += _switching(run, inside, run.grid(samples))
    return [*found, *_instants(run), *_energies(run, inside)]


def energy_rise(trajectory: Trajectory, loads: Sequence[Load] = ()) -> float | None:
    """By how much [J] energy less the work of the loads rises; None where loads or counter-surfaces do other work.

    In a truncated model within segments alone: at an event the next level's modes may store energy.
    """
    return _rise(JudgedRun(trajectory, tuple(loads), None, EXACT)) if trajectory.segments else 0.0


def lawful_rise(trajectory: Trajectory) -> str:
    """Why energy may rise in this run without a law being broken, as a sentence; empty where it may not."""
    returned = -sum(min(0.0, event.loss.damping) for event in trajectory.events)
    given = -sum(min(0.0, event.loss.truncation_strain) for event in trajectory.events)
    belts = [getattr(e, "velocity", 0.0) or getattr(e, "tangential_velocity", 0.0) for e in trajectory.model.contacts]
    ledger = trajectory.ledger
    small = ENERGY * max(abs(ledger.initial), abs(ledger.work_of_loads), abs(ledger.final))
    causes = {
        f"a damped stop that closes again inside gives back {returned:.3g} J of its spring": returned > small,
        f"transitions between truncated levels store {given:.3g} J": given > small,
        "the counter-surfaces do work": any(belts),
    }
    return "; ".join(cause for cause, holds in causes.items() if holds)


def _told(
    law: str, off: np.ndarray, allowed: np.ndarray | float, times: np.ndarray, what: str = "its terms"
) -> list[str]:
    """A sentence where a deviation (k,) is above what is allowed at times (k,); the worst one is told."""
    allowed = np.broadcast_to(allowed, off.shape)
    wrong = ~(off <= allowed)
    if not np.any(wrong):
        return []
    share = np.where(wrong, off / np.maximum(allowed, 1e-300), 0.0)
    worst = int(np.argmax(share))
    return [
        f"{law}: off by {off[worst]:.3g} at t = {times[worst]:.9g} s, {share[worst]:.3g} of what round-off of {what} is"
    ]


def _along(run: JudgedRun, row: np.ndarray, terms: np.ndarray) -> np.ndarray:
    """What force (k,) [N] along a row the terms (n, k) over the roots of the masses are."""
    weighted = np.abs(row) / run.root.ravel()
    return np.max(terms, axis=0) * np.sum(weighted) / float(weighted @ weighted)


def _motion(run: JudgedRun, inside: Inside) -> list[str]:
    """M x'' + C x' + K x - f - sum h N + sum h_t T = 0, of a truncated model in the modes that it keeps.

    Where inputs vary these models leave out the damping of the quasi-static motion that their modes do not contain.
    """
    if not run.has_equation:
        return []
    rest = run.mass @ inside.a + run.stiffness @ inside.x - sum(run.forces(inside.times), 0 * inside.x)
    if run.damping is not None:
        rest = rest + run.damping @ inside.v
    for name, N in inside.contact.items():
        rest = rest - np.outer(run.rows[name], N)
    for name, T in inside.friction.items():
        rest = rest + np.outer(run.along[name], T)
    terms = np.max(inside.terms, axis=0)
    if run.complete:
        return _told("equation of motion", np.max(np.abs(rest / run.root), axis=0), run.exact * terms, inside.times)
    kept = [run.kept_modes(t) for t in inside.times]
    off = np.array([np.max(np.abs(modes.T @ rest[:, k]), initial=0.0) for k, modes in enumerate(kept)])
    allowed = run.exact * terms * run.structure.n
    if run.damping is not None and run.varies:
        left_out = abs(run.damping) @ np.abs(inside.v)
        allowed = allowed + [np.max(np.abs(modes.T) @ left_out[:, k], initial=0.0) for k, modes in enumerate(kept)]
    return _told("equation of motion in the kept modes", off, allowed, inside.times)


def _derivatives(run: JudgedRun, inside: Inside) -> list[str]:
    """Velocities and accelerations integrate to changes of displacement and velocity."""
    middle = inside.ends.mean(axis=1)
    found = []
    for name, ends, rate, exact, size in (
        ("velocity", inside.x_ends, inside.v, max(EXACT, run.asked), run.length),
        ("acceleration", inside.v_ends, inside.a, run.exact, run.speed),
    ):
        change = np.abs(np.diff(ends, axis=2)[:, :, 0] - inside.per_interval(rate)) * run.root
        terms = (np.max(np.abs(ends), axis=2) + inside.per_interval(np.abs(rate))) * run.root
        allowed = exact * (np.max(terms, axis=0) + FAR * size)
        found += _told(f"{name} as a derivative", np.max(change, axis=0), allowed, middle)
    return found


def _impulses_of_forces(run: JudgedRun, inside: Inside) -> list[str]:
    """The impulse of a contact over a few intervals is the integral of its force."""
    found = []
    chosen = np.arange(0, len(inside.ends), max(1, len(inside.ends) // IMPULSES))
    for contact in run.contacts:
        forces, terms = inside.contact[contact.name], _along(run, run.rows[contact.name], inside.terms)
        expected, allowed = inside.per_interval(forces)[chosen], run.exact * inside.per_interval(terms)[chosen]
        impulses = [run.trajectory.contact_impulse(contact.name, *inside.ends[k]) for k in chosen]
        found += _told(f"impulse of {contact.name}", np.abs(impulses - expected), allowed, inside.ends[chosen, 0])
    return found


def _contacts(run: JudgedRun, inside: Inside) -> list[str]:
    """The law of every contact."""
    found = []
    forces = inside.contact
    for contact in run.contacts:
        name, N, row, times = contact.name, forces[contact.name], run.rows[contact.name], inside.times
        z, z_rate = run.stop(contact, times)
        gap, rate = row @ inside.x + contact.gap - z, row @ inside.v - z_rate
        length = run.length_of(contact, inside.x, z)
        speed = run.exact * (
            np.max(np.abs(row) @ np.abs(inside.v) + np.abs(z_rate)) + run.speed * np.max(np.abs(row) / run.root.ravel())
        )
        force = run.exact * _along(run, row, inside.terms)
        told = np.asarray(run.trajectory.gap(name, times))
        found += _told(f"gap of {name}", np.abs(told - gap), length, times)
        if contact.rigid or contact.damping:
            found += _told(f"force of {name} pulls", -N, force, times)
        if not run.complete:
            continue
        if contact.rigid:
            found += _told(f"penetration of {name}", -gap, length, times)
            pressed = force < N
            found += _told(f"force of {name} across its gap", np.where(pressed, np.abs(gap), 0.0), length, times)
            found += _told(f"force of {name} as it opens or closes", np.where(pressed, np.abs(rate), 0.0), speed, times)
            continue
        spring, damper = -contact.stiffness * gap, -contact.damping * rate
        bounded = np.clip(damper, -np.abs(spring), np.abs(spring)) if contact.bounded else damper
        law = np.where(gap < 0, np.maximum(0.0, spring + bounded), 0.0)
        touching = np.abs(gap) <= length  # a damper's force jumps there, unless it is bounded
        off = np.where(touching & (contact.damping > 0), 0.0, np.abs(N - law))
        found += _told(f"law of {name}", off, force + contact.stiffness * length, times)
    return found


def _frictions(run: JudgedRun, inside: Inside) -> list[str]:
    """|T| within its limit, at it and against the slip where the patch slips."""
    found = []
    for element in run.rubbing:
        name, times, row, T = element.name, inside.times, run.along[element.name], inside.friction[element.name]
        allowed = run.exact * _along(run, row, inside.terms)
        if isinstance(element, Friction):
            kinetic, static = np.full(len(T), element.limit), np.full(len(T), element.most)
            spring, belt = element.stiffness, element.velocity
        else:
            kinetic, static = element.friction * inside.contact[name], element.most * inside.contact[name]
            spring, belt = element.tangential_stiffness, element.tangential_velocity
            allowed = allowed + element.most * run.exact * _along(run, run.rows[name], inside.terms)
        found += _told(f"friction of {name} beyond its limit", np.abs(T) - static, allowed, times)
        if not run.complete:
            continue
        slip, round_off = _slip(run, inside, row, T, spring, belt)
        moves = np.abs(slip) > round_off
        acts = np.abs(T) > allowed
        along = moves & acts & (slip * T < 0)
        found += _told(f"friction of {name} along its slip", np.where(along, np.abs(T), 0.0), allowed, times)
        at_limit = np.where(moves, np.abs(np.abs(T) - kinetic), 0.0)
        found += _told(f"friction of {name} that slips off its limit", at_limit, allowed, times)
    return found


def _slip(
    run: JudgedRun, inside: Inside, row: np.ndarray, T: np.ndarray, spring: float, belt: float
) -> tuple[np.ndarray, np.ndarray]:
    """Slip (k,) at the nodes and its round-off: a velocity, with a spring the way over the interval of the node."""
    size = run.speed * float(np.max(np.abs(row) / run.root.ravel())) + abs(belt)
    if np.isinf(spring):
        return row @ inside.v - belt, np.full(len(T), MOVES * size)
    patch = row @ inside.x - belt * inside.times - T / spring
    shaped = patch.reshape(-1, NODES)
    way = np.repeat(shaped[:, -1] - shaped[:, 0], NODES)
    lasted = np.repeat(inside.ends[:, 1] - inside.ends[:, 0], NODES)
    terms = np.abs(row) @ np.abs(inside.x) + np.abs(belt * inside.times) + np.abs(T) / spring
    return way, MOVES * size * lasted + EXACT * np.max(terms)


def _laws(run: JudgedRun, inside: Inside) -> list[str]:
    """The force of every force law is that of its displacement."""
    found = []
    for law in run.laws if run.complete else ():
        q = run.rows[law.name] @ inside.x
        F = np.interp(q, law.knots, law.forces)
        F = F + law.slopes[0] * np.minimum(0.0, q - law.knots[0]) + law.slopes[-1] * np.maximum(0.0, q - law.knots[-1])
        N = np.asarray(run.trajectory.contact_force(law.name, inside.times))
        size = np.max(np.abs(law.forces)) + np.max(np.abs(law.slopes)) * np.max(run.contact_terms(law, inside.x))
        found += _told(f"law of {law.name}", np.abs(N + F), EXACT * size, inside.times)
    return found


def _switching(run: JudgedRun, inside: Inside, grid: tuple[np.ndarray, np.ndarray]) -> list[str]:
    """An element stays within the range of its state all over the run, and whatever changes it is an event."""
    found = []
    trajectory, times = run.trajectory, grid[0]
    for contact in run.contacts:
        name = contact.name
        closed = _within(times, np.array(trajectory.contact_intervals(name)).reshape(-1, 2))
        at, round_off = _lowest(partial(_apart, run, contact), grid, ~closed), _gap_round_off(run, contact)
        if run.complete:
            found += _told(f"{name} is open inside its stop", -at[1], round_off, at[0])
        else:
            deep = max(round_off, -trajectory.deepest_gap(name) / REPORTED)
            found += _told(f"{name} is open inside its stop, deeper than reported", -at[1], deep, at[0])
        force = run.exact * float(np.max(_along(run, run.rows[name], inside.terms)))
        if contact.rigid or contact.damping:
            at = _lowest(partial(trajectory.contact_force, name), grid, closed)
            found += _told(f"{name} pulls", -at[1], force, at[0])
        elif run.complete:
            at = _lowest(partial(_apart, run, contact, sign=-1.0), grid, closed)
            found += _told(f"{name} is closed outside its stop", -at[1], round_off, at[0])
    for element in run.rubbing if run.complete else ():
        name = element.name
        sticks = _within(times, trajectory.stick_intervals(name))
        allowed = run.exact * float(np.max(_along(run, run.along[name], inside.terms)))
        if isinstance(element, UnilateralContact):
            allowed += element.most * run.exact * float(np.max(_along(run, run.rows[name], inside.terms)))
        at = _lowest(partial(_reserve, trajectory, element), grid, sticks)
        found += _told(f"{name} sticks beyond its limit", -at[1], allowed, at[0])
    for element in run.springs:
        found += _switches_without_event(run, element)
    return found


def _switches_without_event(run: JudgedRun, element: UnilateralContact | Friction) -> list[str]:
    """Whether something closes, opens, sticks or slips where no event tells it."""
    trajectory, name = run.trajectory, element.name
    intervals = [] if isinstance(element, Friction) else [np.array(trajectory.contact_intervals(name)).reshape(-1, 2)]
    intervals += [trajectory.stick_intervals(name)] if element in run.rubbing else []
    edges = np.unique(np.concatenate([part.ravel() for part in intervals]))
    edges = edges[(edges > trajectory.t_start) & (edges < trajectory.t_end)]
    own = np.array([event.time for event in trajectory.events if event.contact == name])
    away = [float(np.min(np.abs(own - edge), initial=np.inf)) for edge in edges]
    return _told(f"{name} switches without an event", np.array(away), BRIEF * trajectory.t_end, edges, "the time")


def _within(times: np.ndarray, intervals: np.ndarray) -> np.ndarray:
    """Whether (k,) the times are in one of the intervals (m, 2)."""
    if not len(intervals):
        return np.zeros(len(times), bool)
    before = np.searchsorted(intervals[:, 0], times, side="right") - 1
    return (before >= 0) & (times <= intervals[before, 1])


def _lowest(
    signal: Callable[[np.ndarray], Any], grid: tuple[np.ndarray, np.ndarray], where: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Times and values of a signal on a part of the grid, and at its lowest places between the instants."""
    times, owner = grid[0][where], grid[1][where]
    if not len(times):
        return times, times
    values = np.asarray(signal(times))
    joined = np.append(np.diff(owner) == 0, False)
    left, right = np.roll(joined, 1), joined
    local = ~(left & (np.roll(values, 1) < values)) & ~(right & (np.roll(values, -1) < values))
    places = np.flatnonzero(local)
    for i in places[np.argsort(values[places], kind="stable")[:LOWEST]]:
        low, high = times[i - 1] if left[i] else times[i], times[i + 1] if right[i] else times[i]
        for _ in range(ROUNDS):
            t = np.linspace(low, high, POLISH)
            found = np.asarray(signal(t))
            j = int(np.argmin(found))
            low, high = t[max(0, j - 1)], t[min(POLISH - 1, j + 1)]
        times, values = np.append(times, t[j]), np.append(values, found[j])
    return times, values


def _apart(run: JudgedRun, contact: UnilateralContact, times: np.ndarray, sign: float = 1.0) -> np.ndarray:
    """g, of a viscous contact g + (c/k) max(0, g'), (k,) [m]: by its law it is closed where that is negative."""
    z, z_rate = run.stop(contact, times)
    row = run.rows[contact.name]
    gap = np.asarray(run.trajectory.at(row, times)) + contact.gap - z
    if not contact.damping:
        return sign * gap
    rate = np.asarray(run.trajectory.at(row, times, derivative=1)) - z_rate
    return sign * np.asarray(gap + contact.damping / contact.stiffness * np.maximum(0.0, rate))


def _gap_round_off(run: JudgedRun, contact: UnilateralContact) -> float:
    """What of ``_apart`` [m] is round-off."""
    z, z_rate = run.stop(contact, run.instants)
    length = float(run.length_of(contact, run.x_sides[1], z))
    if contact.damping:
        speed = run.speed * float(np.sum(np.abs(run.rows[contact.name]) / run.root.ravel())) + np.max(np.abs(z_rate))
        length += run.exact * contact.damping / contact.stiffness * speed
    return length


def _reserve(trajectory: Trajectory, element: UnilateralContact | Friction, times: np.ndarray) -> np.ndarray:
    """Static limit less |T|, (k,) [N]."""
    tension = np.abs(np.asarray(trajectory.friction_force(element.name, times)))
    if isinstance(element, Friction):
        return element.most - tension
    return element.most * np.asarray(trajectory.contact_force(element.name, times)) - tension


def _instants(run: JudgedRun) -> list[str]:
    """Displacements never jump, velocities by the impulses of rigid contacts, which leave their stops."""
    if not run.complete:
        return []
    jump = np.max(np.abs(run.root * (run.x_sides[1] - run.x_sides[0])), axis=0)
    found = _told("displacement jumps", jump, EXACT * run.length, run.instants, "the largest displacement")
    rigid = [contact for contact in run.contacts if contact.rigid]
    impulses, counts = _impulses(run, rigid)
    found += _momentum(run, rigid, impulses)
    for k, contact in enumerate(rigid):
        found += _rebounds(run, contact, impulses[k], (np.sum(impulses > 0, axis=0) == 1) & (counts == 1))
    return found


def _impulses(run: JudgedRun, rigid: Sequence[UnilateralContact]) -> tuple[np.ndarray, np.ndarray]:
    """Impulses (c, k) [N s] of rigid contacts at the instants, and how many impacts (k,) each instant has."""
    times = {t: k for k, t in enumerate(run.instants.tolist())}
    places = {contact.name: i for i, contact in enumerate(rigid)}
    impulses, counts = np.zeros((len(rigid), len(times))), np.zeros(len(times), int)
    for event in run.trajectory.events if rigid else ():
        if (k := times.get(event.time)) is not None:
            for name, impulse in ((event.contact, event.impulse), *event.shared):
                if name in places:
                    impulses[places[name], k] += impulse
            counts[k] += event.impulse != 0
    return impulses, counts


def _momentum(run: JudgedRun, rigid: Sequence[UnilateralContact], impulses: np.ndarray) -> list[str]:
    """M (x'+ - x'-) = sum h p - sum h_t q, p >= 0, |q| <= mu p."""
    found = []
    rest = (run.mass @ (run.v_sides[1] - run.v_sides[0])) / run.root
    terms = np.sum(np.abs(rest), axis=0) + run.speed
    for contact, p in zip(rigid, impulses, strict=True):
        row = run.rows[contact.name] / run.root.ravel()
        rest = rest - np.outer(row, p)
        terms = terms + np.abs(p) * np.max(np.abs(row))
        found += _told(
            f"impulse of {contact.name} pulls", -p * np.max(np.abs(row)), EXACT * terms, run.instants, "momenta"
        )
    at_stop = np.any([np.zeros(len(run.instants), bool), *(_touches(run, contact) for contact in rigid)], axis=0)
    allowed = run.exact * terms + np.where(at_stop, run.smallest_bounce, 0.0)
    rubbing = [k for k, contact in enumerate(rigid) if contact.further]
    for j in np.flatnonzero(np.max(np.abs(rest), axis=0) > allowed) if rubbing else ():
        rows = np.column_stack([run.along[rigid[k].name] / run.root.ravel() for k in rubbing])
        most = np.array([rigid[k].friction * impulses[k, j] for k in rubbing]) * (1 + EXACT) + EXACT * terms[j]
        rest[:, j] += rows @ lsq_linear(rows, -rest[:, j], (-most, most), method="bvls", tol=1e-15).x
    return found + _told("balance of momentum", np.max(np.abs(rest), axis=0), allowed, run.instants, "momenta")


def _touches(run: JudgedRun, contact: UnilateralContact) -> np.ndarray:
    """Whether (k,) a contact is at its stop at the instants."""
    z, _ = run.stop(contact, run.instants)
    gap = run.rows[contact.name] @ run.x_sides[1] + contact.gap - z
    return np.asarray(np.abs(gap) <= TOUCHES / run.exact * run.length_of(contact, run.x_sides[1], z))


def _is_struck_next(run: JudgedRun, contact: UnilateralContact, speed: np.ndarray) -> np.ndarray:
    """Whether (k,) the contact is struck before it has gone on with these speeds for more than round-off of its gap.

    A load may change where a mass arrives: what is left of the gap is round-off, and the impact comes just afterwards.
    """
    name, times = contact.name, run.instants
    z, _ = run.stop(contact, times)
    struck = [e.time for e in run.trajectory.events if (e.contact == name and e.impulse) or name in dict(e.shared)]
    following = np.append(struck, np.inf)[np.searchsorted(struck, times, side="right")]
    length = TOUCHES / run.exact * run.length_of(contact, run.x_sides[1], z)
    return np.asarray(speed <= length / (following - times))


def _rebounds(run: JudgedRun, contact: UnilateralContact, impulse: np.ndarray, alone: np.ndarray) -> list[str]:
    """The contact does not go on into its stop; struck alone and once it leaves it with -e times its velocity."""
    row, name, times = run.rows[contact.name], contact.name, run.instants
    scaled = np.abs(row) / run.root.ravel()
    _, z_rate = run.stop(contact, times)
    arriving, leaving = (row @ v - z_rate for v in run.v_sides)
    round_off = run.exact * (run.speed * np.sum(scaled) + np.abs(z_rate)) + run.smallest_bounce * np.sum(scaled)
    goes_on = _touches(run, contact) & run.has_both_sides & ~_is_struck_next(run, contact, -leaving)
    into = np.where(goes_on, -leaving, 0.0)
    found = _told(f"{name} goes on into its stop", into, round_off, times, "velocities")
    judged = alone & (impulse * (scaled @ scaled) > round_off)
    if not contact.further:
        off = np.where(judged, np.abs(leaving + contact.restitution * arriving), 0.0)
        found += _told(f"rebound of {name}", off, round_off, times, "velocities")
    return found


def _energies(run: JudgedRun, inside: Inside | None) -> list[str]:
    """The ledger is closed, what is lost is not negative, and the energies at both ends are those of the motion."""
    trajectory, ledger = run.trajectory, run.trajectory.ledger
    end = trajectory.t_end
    ends = np.array([trajectory.t_start, end])
    x, v = np.asarray(trajectory.displacement(ends)), np.asarray(trajectory.velocity(ends))
    if inside is not None:
        x, v = np.hstack([x, inside.x]), np.hstack([v, inside.v])
    x, v = np.hstack([x, *run.x_sides]), np.hstack([v, *run.v_sides])
    scale = _energy_terms(run, x, v)
    scale = max(
        scale,
        *(abs(getattr(ledger, n)) for n in ("initial", "work_of_loads", "impact", "damping", "friction", "final")),
    )
    scale = max(scale, run.acceleration * run.length)  # the work of forces on what they hardly move
    found, at = [], np.array([end])
    found += _told("ledger is open", np.array([abs(ledger.residual)]), ENERGY * scale, at, "its rows")
    returned = {"damping": _stored_inside(run)}
    for name in ("impact", "damping", "friction", "truncation_kinetic"):
        allowed = ENERGY * scale + returned.get(name, 0.0)
        found += _told(f"ledger row {name} is negative", np.array([-getattr(ledger, name)]), allowed, at, "its rows")
    losses = total_loss(trajectory.events) + trajectory.start_loss
    for name in ("impact", "truncation_kinetic", "truncation_strain"):
        lost, row = getattr(losses, name), getattr(ledger, name)
        off = max(abs(lost - row), abs(row) if run.complete and name != "impact" else 0.0)
        found += _told(f"ledger row {name} is not that of the events", np.array([off]), ENERGY * scale, at, "its rows")
    rise = _rise(run)
    if rise is not None:
        found += _told("energy rises", np.array([rise]), ENERGY * scale, at, "energies")
    happened = event_table(trajectory.events, trajectory.model.index)[:, 0]
    after = len(happened) and happened[-1] == end  # the last energy is that after the event
    if run.complete and trajectory.status == "ok" and not after and not trajectory.model.overrides:
        own, either = _energy(run, trajectory, end)
        off = np.array([abs(own - ledger.final)])
        found += _told("energy at the end", off, ENERGY * scale + either, at, "energies")
    return found


def _rise(run: JudgedRun) -> float | None:
    """``energy_rise``."""
    trajectory = run.trajectory
    if run.varies:
        return None
    times, owner = run.grid(10 * SEGMENTS)
    ends = np.append(trajectory.t_start, times)
    moved = np.asarray(trajectory.displacement(ends))
    force = sum((f[:, 0] for f in run.forces(ends[:1])), np.zeros(run.structure.n))
    left = np.asarray(trajectory.energy(times)) - (force @ (moved - moved[:, :1]))[1:]
    rises = np.diff(left) if run.complete else np.diff(left)[np.diff(owner) == 0]
    returned = max([0.0, *(-event.loss.damping for event in trajectory.events)])  # by dampers, which mostly take
    return max(0.0, float(np.max(rises, initial=0.0)) - returned)


def _stored_inside(run: JudgedRun) -> float:
    """Energy [J] of viscous contacts that start open inside their stop: damping gives it back if they close there."""
    first, stored = np.array([run.trajectory.t_start]), 0.0
    for contact in run.contacts:
        if contact.damping and float(run.trajectory.contact_force(contact.name, first[0])) <= 0:
            gap = float(run.trajectory.gap(contact.name, first[0]))
            stored += 0.5 * contact.stiffness * min(0.0, gap) ** 2
    return stored


def _energy_terms(run: JudgedRun, x: np.ndarray, v: np.ndarray) -> float:
    """Largest sum of the absolute terms of an energy [J]."""
    terms = 0.5 * np.sum(np.abs(v) * (abs(run.mass) @ np.abs(v)), axis=0)
    terms = terms + 0.5 * np.sum(np.abs(x) * (abs(run.stiffness) @ np.abs(x)), axis=0)
    springs: list[tuple[Element, float]] = [(element, element.stiffness) for element in run.springs]
    for element, stiffness in (*springs, *((law, float(np.max(np.abs(law.slopes)))) for law in run.laws)):
        if np.isfinite(stiffness):
            terms = terms + 0.5 * stiffness * run.contact_terms(element, x) ** 2
    return float(np.max(terms))


def _energy(run: JudgedRun, trajectory: Trajectory, t: float) -> tuple[float, float]:
    """Kinetic and strain energy [J] at an instant, from x, x' and forces of friction springs.

    And the part of viscous contacts without a force, which may just be opening or open.
    """
    x, v = np.asarray(trajectory.displacement(t)), np.asarray(trajectory.velocity(t))
    either, energy = 0.0, 0.5 * float(v @ (run.mass @ v)) + 0.5 * float(x @ (run.stiffness @ x))
    for law in run.laws:
        energy += float(law.energy(run.rows[law.name] @ x))
    for contact in run.contacts:
        gap = float(run.rows[contact.name] @ x) + contact.gap - float(run.stop(contact, np.array([t]))[0][0])
        stored = 0.5 * contact.stiffness * min(0.0, gap) ** 2 if math.isfinite(contact.stiffness) else 0.0
        force, spring = float(trajectory.contact_force(contact.name, t)), contact.stiffness * abs(gap)
        if contact.damping and force <= EXACT * spring:
            either += stored
        elif contact.bounded and force >= 2 * (1 - EXACT) * spring:
            energy += 2 * stored  # of the spring 2 k that stands for spring and damper
        else:
            energy += stored
    springs = [(friction.name, friction.stiffness) for friction in run.frictions]
    for name, spring in (*springs, *((contact.name, contact.tangential_stiffness) for contact in run.rough)):
        energy += 0.5 * float(trajectory.friction_force(name, t)) ** 2 / spring
    return energy, either
