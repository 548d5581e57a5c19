"""Impacts of a run to which Coulomb's law has several answers (coulomb_impacts.py), of which the run takes one.

All rigid contacts that touch at the instant count, those too that bear nothing in the answer that is taken. Their
impulses go into the level in which they are open; what rubs elsewhere without a spring bears none. With restitution
that is asked of the plastic impact that comes first (rebounds.py).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from multiphi_exudyn.events.excitation.loaded_level import LoadedLevel
from multiphi_exudyn.events.transitions.state import event_table
from multiphi_exudyn.levels.model import MultiPhiModel
from multiphi_exudyn.mathematics.complementarity.coulomb_impacts import CoulombImpact
from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.time.trajectory.trajectory import Trajectory

__all__ = ["impact_warnings"]

TOUCHING = 1e-10  # of the largest terms of its gap: a contact touches
REMEDY = "smaller coefficients of friction, or a finite stiffness, leave one"


def impact_warnings(trajectory: Trajectory) -> Iterator[str]:
    """Of the first such impact, one sentence."""
    model, known = trajectory.model, dict[tuple[tuple[int, ...], ...], CoulombImpact]()
    mu = _coefficients(model)
    for impact in _impacts(trajectory) if np.any(mu) else ():
        if not np.any(mu[list(impact.touching)]):
            continue
        key = impact.level.states, impact.touching
        if key not in known:
            known[key] = _coulomb(model, impact, mu)
        if known[key].is_unique:
            continue
        given = ", ".join(f"{model.contacts[i].name!r} ({mu[i]:g})" for i in impact.touching)
        touch = f"{given}, with their coefficients of friction, touch in the impact at t = {impact.time:g} s"
        if not known[key].tried:
            yield f"several impacts: {touch}, too many to tell whether Coulomb's law has one answer to it; {REMEDY}"
            return
        count = known[key].answers(impact.speeds)
        if count > 1:
            yield (
                f"several impacts: {touch}, to which Coulomb's law has {count} answers with other speeds after it; the "
                f"run goes on from one of them, and the others are as right; {REMEDY}"
            )
            return


class _Impact(NamedTuple):
    """When [s], from which level, which contacts touch, and their speeds (k, 2) away from their stops and along."""

    time: float
    level: LoadedLevel
    touching: tuple[int, ...]
    speeds: np.ndarray


def _impacts(trajectory: Trajectory) -> Iterator[_Impact]:
    """All instants at which rigid contacts are struck."""
    model, segments = trajectory.model, trajectory.segments
    table = event_table(trajectory.events, model.index)
    rigid = np.array([contact.rigid and not contact.held for contact in model.contacts])
    table = table[rigid[table[:, 1].astype(int)] & (table[:, 2] > 0)]
    times, instants = np.unique(table[:, 0], return_inverse=True)
    if not len(times):
        return
    places = segments.owners(times, "left")
    x, v = segments.states(places, times - segments.starts[places])
    numbers, largest = segments.numbers[places], np.zeros(len(rigid))
    gaps, speeds = np.zeros((len(times), len(rigid))), np.zeros((len(times), len(model.links)))
    for number in np.unique(numbers):  # the states have room for those levels alone
        level = segments.levels[number]
        own, n, constants = numbers == number, level.width, level.gap_constants[: len(rigid)]
        rows = level.level.gap_rows[: len(rigid)]
        gaps[own], speeds[own] = x[own, :n] @ rows.T + constants, v[own, :n] @ level.level.speed_rows.T
        terms = np.abs(x[own, :n]) @ np.abs(rows).T + np.abs(constants)
        largest = np.maximum(largest, np.max(terms, axis=0, initial=0.0))
    struck = times == trajectory.t_start
    if np.any(struck):
        speeds[struck] = _first_speeds(trajectory, segments.levels[numbers[0]], v[0])
    touches = rigid & (np.abs(gaps) <= TOUCHING * largest)
    touches[instants, table[:, 1].astype(int)] = True
    for k, time in enumerate(times.tolist()):
        touching = tuple(np.flatnonzero(touches[k]).tolist())
        links = [model.base.link_indices[i][:2] for i in touching]
        found = np.array([[speeds[k, own[0]], speeds[k, own[-1]] if len(own) > 1 else 0.0] for own in links])
        yield _Impact(time, segments.levels[numbers[k]], touching, found)


def _first_speeds(trajectory: Trajectory, level: LoadedLevel, velocity: np.ndarray) -> np.ndarray:
    """h.x' - v (l,) of all links before an impact at the start itself; velocity: xi' behind it."""
    moved = level.excitation.stops @ velocity[level.modal.modes : level.width]
    return np.asarray(trajectory.model.base.directions.T @ trajectory.start.velocity - moved)


def _coefficients(model: MultiPhiModel) -> np.ndarray:
    """mu (c,) of the rigid contacts that rub, zero of all others."""
    given = [contact if isinstance(contact, UnilateralContact) else None for contact in model.contacts]
    return np.array([0.0 if contact is None or not contact.rigid else contact.friction for contact in given])


def _coulomb(model: MultiPhiModel, impact: _Impact, mu: np.ndarray) -> CoulombImpact:
    """The problem of those that touch in the level in which nothing rigid holds."""
    base = model.base
    rows = model.level_at(tuple(k for k in impact.level.level.indices if not base.links[k].rigid)).gap_rows
    links = [base.link_indices[i][:2] for i in impact.touching]
    found = [[rows[own[0]], rows[own[-1]] if len(own) > 1 else np.zeros_like(rows[own[0]])] for own in links]
    return CoulombImpact(np.array(found), mu[list(impact.touching)])
