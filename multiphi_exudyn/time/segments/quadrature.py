"""Quadrature of a segment's motion: integrals of sums of exponentials, and the works of damping and of what varies.

The work of what varies is that of the loads, of the stops of compliant contacts and of those of rigid ones,

    f.y' + lambda s w' + (Y w').(M y'' + C y' + K y - f)

Gauss-Legendre quadrature is exact to round-off on panels short beside the shortest period.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator

import numpy as np

from multiphi_exudyn.events.excitation.loaded_level import LoadedLevel

__all__ = ["panels", "works"]

NODES = 20  # of the quadrature on a panel
PANEL = 6.0  # rad, the phase of the fastest exponential on it: products of two have twice that
CHUNK = 512  # panels evaluated at a time


def panels(rates: np.ndarray, start: float, end: float) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Times and weights, in parts, of the integral from start to end [s] of exponentials (p,); none where p = 0."""
    if not len(rates):
        return
    fastest = float(np.max(np.abs(rates)))
    count = max(1, math.ceil(fastest * (end - start) / PANEL))
    width, (nodes, weights) = (end - start) / count, _gauss_legendre()
    for first in range(0, count, CHUNK):
        lefts = start + width * np.arange(first, min(count, first + CHUNK))
        yield (lefts[:, None] + width * nodes).ravel(), np.tile(width * weights, len(lefts))


def works(
    level: LoadedLevel, modal: Callable[[np.ndarray, int], np.ndarray], rates: np.ndarray, start: float, end: float
) -> tuple[float, float, float]:
    """Work [J] of damping, of what varies and of friction; modal: xi or a derivative (n, k) at times (k,)."""
    damping = varying = friction = 0.0
    for times, weights in panels(rates, start, end):
        xi, xi_t, xi_tt = (modal(times, derivative) for derivative in range(3))
        damping += float(weights @ _dissipation(level, xi_t))
        varying += float(weights @ _power(level, xi, xi_t, xi_tt))
        friction -= float(weights @ (level.pushes @ level.level.gap_rows @ xi_t))
        friction += sum(float(weights @ (tension * speed)) for tension, speed, _ in _rubbing(level, xi, xi_t))
    follows = level.follows
    for sign, time in ((1, start), (-1, end)):
        stretched = follows[:, :-1] @ modal(np.array([time]), 0)[:, 0] + follows[:, -1]
        friction += sign * 0.5 * float(stretched @ stretched)
    return damping, varying, friction


def _rubbing(
    level: LoadedLevel, xi: np.ndarray, xi_t: np.ndarray
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """T (k,) of friction that goes with other forces, the speed (k,) on which it works, and s (q,) of its surface."""
    own, base = level.level, level.level.base
    for i in level.rubbing_elements:
        held = next(k for k in base.link_indices[i] if base.links[k].held)
        place, rate, constant = level.rubbing(i)
        yield place @ xi + rate @ xi_t + constant, own.gap_rows[held] @ xi_t, level.excitation.stops[held]


def _dissipation(level: LoadedLevel, xi_t: np.ndarray) -> np.ndarray:
    """Power (k,) [W] of damping."""
    base, index, own = level.level.base, list(level.level.indices), level.modal
    moved, dampers, eta_t = level.motion(xi_t), _dampers(level, xi_t), level.split(xi_t)[0]
    coefficients = base.dampings[index]
    viscous = np.divide(dampers.T**2, coefficients, out=np.zeros_like(dampers.T), where=coefficients > 0)
    given = own.damping - own.vectors.T @ base.damping_matrix(own.indices) @ own.vectors  # of ratios that are given
    total = np.sum(moved * (base.damping @ moved), axis=0) + np.sum(eta_t * (given @ eta_t), axis=0)
    return np.asarray(total + np.sum(viscous, axis=1))


def _dampers(level: LoadedLevel, xi_t: np.ndarray) -> np.ndarray:
    """c g' (k, times) [N] of the closed contacts: what their dampers hold against opening."""
    index = list(level.level.indices)
    return np.asarray(level.level.base.dampings[index][:, None] * (level.level.speed_rows[index] @ xi_t))


def _power(level: LoadedLevel, xi: np.ndarray, xi_t: np.ndarray, xi_tt: np.ndarray) -> np.ndarray:
    """Power (k,) [W] of the channels."""
    base, carried = level.level.base, level.channels.carried
    w, w_t = level.split(xi)[1], level.split(xi_t)[1]
    varying = level.excitation.patterns @ w
    power = np.sum(varying * (level.level.vectors @ xi_t), axis=0)
    index = list(level.level.indices)
    stiffness = np.where(np.isinf(base.stiffnesses[index]), 0.0, base.stiffnesses[index])
    gaps = level.level.gap_rows[index] @ xi + level.gap_constants[index][:, None]
    springs = stiffness[:, None] * gaps + _dampers(level, xi_t)
    power -= np.sum(springs * (level.excitation.stops[index] @ w_t), axis=0)
    power += level.pushes @ level.excitation.stops @ w_t
    for tension, _, moves in _rubbing(level, xi, xi_t):
        power -= tension * (moves @ w_t)
    if np.any(carried):
        y, moved, accelerated = level.configuration(xi), level.motion(xi_t), level.motion(xi_tt)
        load = (level.excitation.static + base.preload + base.pushes @ level.pushes)[:, None] + varying
        residual = accelerated + base.damping @ moved + (base.modes.omega**2 * y.T).T - load
        residual += base.pushes[:, index] @ (springs - _reactions(level, xi, xi_t))
        power += np.sum((carried @ w_t) * residual, axis=0)
    return np.asarray(power)


def _reactions(level: LoadedLevel, xi: np.ndarray, xi_t: np.ndarray) -> np.ndarray:
    """Forces (k, times) [N] of the closed rigid contacts that slide, whose friction acts on what channels carry."""
    own, index = level.level, list(level.level.indices)
    forces = own.force_rows @ xi + own.force_rate_rows @ xi_t + level.asymptotic.forces[:, None]
    slides = [link in own.base.oblique and np.isinf(own.base.stiffnesses[link]) for link in index]
    return np.where(np.array(slides, bool)[:, None], forces, 0.0)


@functools.cache
def _gauss_legendre() -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights on [0, 1]."""
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    return (nodes + 1) / 2, weights / 2
