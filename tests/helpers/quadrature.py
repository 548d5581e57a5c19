"""Works of a run by quadrature of its segments, beside the closed form that the core has.

The work of varying loads is that of the loads, of the stops of compliant contacts and of those of rigid ones,

    f.y' + lambda s w' + (Y w').(M y'' + C y' + K y - f)
"""

import numpy as np

from multiphi_exudyn.time.segments import panels


def works_by_quadrature(run):
    """Work [J] of damping, of loads and stops that vary in time, and of friction."""
    total = np.sum([_works(s.level, s.modal, s.basis.rates, s.start, s.end) for s in run.segments], axis=0)
    return total + np.array([0.0, np.sum(run.segments.trajectory.entry_works[: len(run.segments)]), 0.0])


def _works(level, modal, rates, start, end):
    damping = varying = friction = 0.0
    for times, weights in panels(rates, start, end):
        xi, xi_t, xi_tt = (modal(times, derivative) for derivative in range(3))
        damping += float(weights @ _dissipation(level, xi_t))
        varying += float(weights @ _power(level, xi, xi_t, xi_tt))
        friction -= float(weights @ (level.pushes @ level.level.gap_rows @ xi_t))
        friction += sum(
            float(weights @ (tension * speed)) for tension, speed, _ in _following_friction(level, xi, xi_t)
        )
    follows = level.follows
    for sign, time in ((1, start), (-1, end)):
        stretched = follows[:, :-1] @ modal(np.array([time]), 0)[:, 0] + follows[:, -1]
        friction += sign * 0.5 * float(stretched @ stretched)
    return damping, varying, friction


def _following_friction(level, xi, xi_t):
    """T (k,) [N] of friction that follows other forces, slip speed (k,) [m/s], and s (q,) of its counter-surface."""
    inner, base = level.level, level.level.base
    for i in level.rubbing_elements:
        held = next(k for k in base.link_indices[i] if base.links[k].held)
        place, rate, constant = level.rubbing(i)
        yield place @ xi + rate @ xi_t + constant, inner.gap_rows[held] @ xi_t, level.excitation.stops[held]


def _dissipation(level, xi_t):
    """Power (k,) [W] dissipated by damping."""
    base, index, modal = level.level.base, list(level.level.indices), level.modal
    velocity, dampers, eta_t = level.motion(xi_t), _dampers(level, xi_t), level.split(xi_t)[0]
    coefficients = base.dampings[index]
    viscous = np.divide(dampers.T**2, coefficients, out=np.zeros_like(dampers.T), where=coefficients > 0)
    # damping matrix of given ratios
    from_ratios = modal.damping - modal.vectors.T @ base.damping_matrix(modal.indices) @ modal.vectors
    total = np.sum(velocity * (base.damping @ velocity), axis=0) + np.sum(eta_t * (from_ratios @ eta_t), axis=0)
    return np.asarray(total + np.sum(viscous, axis=1))


def _dampers(level, xi_t):
    """c g' (k, times) [N] of the closed contacts: the forces of their dampers."""
    index = list(level.level.indices)
    return np.asarray(level.level.base.dampings[index][:, None] * (level.speed_rows[index] @ xi_t))


def _power(level, xi, xi_t, xi_tt):
    """Power (k,) [W] of the channels."""
    base, carried = level.level.base, level.channels.carried
    w, w_t = level.split(xi)[1], level.split(xi_t)[1]
    varying = level.excitation.patterns @ w
    power = np.sum(varying * (level.level.vectors @ xi_t), axis=0)
    index = list(level.level.indices)
    stiffness = np.where(np.isinf(base.stiffnesses[index]), 0.0, base.stiffnesses[index])
    gaps = level.level.gap_rows[index] @ xi + level.gap_constants[index][:, None]
    springs = stiffness[:, None] * gaps + _dampers(level, xi_t)
    residual = np.isin(index, base.residual)
    springs[residual] = -(level.level.force_rows[residual] @ xi + level.asymptotic.forces[residual, None])
    power -= np.sum(springs * (level.excitation.stops[index] @ w_t), axis=0)
    power += level.pushes @ level.excitation.stops @ w_t
    for tension, _, surface in _following_friction(level, xi, xi_t):
        power -= tension * (surface @ w_t)
    if np.any(carried):
        y, velocity, acceleration = level.configuration(xi), level.motion(xi_t), level.motion(xi_tt)
        load = (level.excitation.static + base.preload + base.pushes @ level.pushes)[:, None] + varying
        remainder = acceleration + base.damping @ velocity + (base.modes.omega**2 * y.T).T - load
        remainder += base.pushes[:, index] @ (springs - _reactions(level, xi, xi_t))
        power += np.sum((carried @ w_t) * remainder, axis=0)
    return np.asarray(power)


def _reactions(level, xi, xi_t):
    """Forces (k, times) [N] of the closed rigid contacts that slide; their friction acts on the carried motion."""
    inner, index = level.level, list(level.level.indices)
    forces = inner.force_rows @ xi + inner.force_rate_rows @ xi_t + level.asymptotic.forces[:, None]
    slides = [link in inner.base.oblique and np.isinf(inner.base.stiffnesses[link]) for link in index]
    return np.where(np.array(slides, bool)[:, None], forces, 0.0)
