"""Impact warnings: impacts that lose as much energy as the mesh decides, and impacts with several answers.

A rigid contact that is struck stops the effective mass m_e = 1 / sum over modes of (h.phi)^2, which loses
(1 - e^2) m_e s^2 / 2. On a lumped mass the first modes give nearly all of the sum. On a continuum it grows with every
mode, m_e and the loss are those of the mesh, and neither is one of the structure itself. Where the upper half of the
kept modes has more than SPREAD of the sum, and the impacts have taken more than TAKEN of the energy, the run says so:
on an exact bar of 20 to 200 elements and 6 to all modes, over 1 to 10 periods, every run that was off by more than 5 %
was told, and none that was off by less than 1.5 %.

Impacts for which Coulomb's law has several solutions (coulomb_impacts.py); the run takes one.

All rigid contacts that touch at the instant are considered, also those without an impulse in the chosen solution. Their
impulses act in the level in which they are open; friction elsewhere without a spring has no impulse. With restitution
the plastic impact that comes first is examined (rebounds.py).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

import multiphi_exudyn._core as core
from multiphi_exudyn.display import per_cent
from multiphi_exudyn.events.excitation.loaded_level import LoadedLevel
from multiphi_exudyn.events.transitions.state import event_table
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mathematics.complementarity.coulomb_impacts import CoulombImpact
from multiphi_exudyn.mechanics.elements.contact import UnilateralContact
from multiphi_exudyn.time.reliability.friction_warnings import TOUCHING
from multiphi_exudyn.time.trajectory.trajectory import Trajectory

__all__ = ["impact_warnings", "is_taking", "mesh_warnings", "spread_contacts"]

TAKEN = 0.005  # of the largest energy of a run, by impacts on what the mesh decides
SPREAD = 0.3  # of an effective mass' reciprocal: on meshes the upper half of the modes has .38 to .67, on chains .2
FEWEST = 6  # modes of which this can be told
REMEDY = "smaller coefficients of friction, or a finite stiffness, leave one"


def spread_contacts(model: MultiPhiModel) -> tuple[str, ...]:
    """Names of the rigid contacts whose effective mass falls with every kept mode."""
    level, names = model.level_at(()), list[str]()
    for i, contact in enumerate(model.contacts if level.modes >= FEWEST else ()):
        if contact.rigid and not contact.held:
            shares = level.gap_rows[model.link_indices[i][0]] ** 2
            if np.sum(shares[level.modes // 2 :]) > SPREAD * np.sum(shares):
                names.append(contact.name)
    return tuple(names)


def is_taking(ledger: core.Ledger) -> bool:
    """Whether impacts may have taken more than TAKEN of the largest energy of a run."""
    start = abs(ledger.start_energy + ledger.start_potential)
    return bool(ledger.at_start[0] + ledger.at_events[0] > TAKEN * start)


def mesh_warnings(trajectory: Trajectory, spread: Sequence[str]) -> Iterator[str]:
    """At most one sentence on a run whose impacts took energy; spread: see ``spread_contacts``."""
    record, index = trajectory.ending.record, trajectory.model.index
    contacts, impulses, lost = record.elements, record.impulses, record.losses[:, 0]
    struck, losses = (np.bincount(contacts, amounts, len(trajectory.model.contacts)) for amounts in (impulses, lost))
    names = [name for name in spread if struck[index(name)] > 0]
    if not names:
        return
    taken = trajectory.start_loss.impact + float(sum(losses[index(name)] for name in names))
    largest = max(trajectory.segments.sizes(trajectory.t_end)[1], abs(trajectory.initial_energy))
    if taken > TAKEN * largest:
        yield (
            f"mesh impacts: impacts on {', '.join(map(repr, names))} took {per_cent(taken / largest)} of the largest "
            "energy of the run, and stop a mass that falls with every mode and element, so the loss is that of the "
            "mesh and motions come too late; give the stop a finite stiffness, or compare with more modes and a finer "
            "mesh"
        )


def impact_warnings(trajectory: Trajectory) -> Iterator[str]:
    """One sentence on the first such impact."""
    model, problems = trajectory.model, dict[tuple[tuple[int, ...], ...], CoulombImpact]()
    mu = _coefficients(model)
    for impact in _impacts(trajectory) if np.any(mu) else ():
        if not np.any(mu[list(impact.touching)]):
            continue
        key = impact.level.states, impact.touching
        if key not in problems:
            problems[key] = _coulomb(model, impact, mu)
        if problems[key].is_unique:
            continue
        contacts = ", ".join(f"{model.contacts[i].name!r} ({mu[i]:g})" for i in impact.touching)
        touch = f"{contacts}, with their coefficients of friction, touch in the impact at t = {impact.time:g} s"
        if not problems[key].tried:
            yield f"several impacts: {touch}, too many to tell whether Coulomb's law has one answer to it; {REMEDY}"
            return
        count = problems[key].answers(impact.speeds)
        if count > 1:
            yield (
                f"several impacts: {touch}, to which Coulomb's law has {count} answers with other speeds after it; the "
                f"run goes on from one of them, and the others are as right; {REMEDY}"
            )
            return


class _Impact(NamedTuple):
    """Time [s], level before, touching contacts, and their normal and tangential speeds (k, 2) [m/s]."""

    time: float
    level: LoadedLevel
    touching: tuple[int, ...]
    speeds: np.ndarray


def _impacts(trajectory: Trajectory) -> Iterator[_Impact]:
    """All impacts of rigid contacts."""
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
    for number in np.unique(numbers):  # states are as wide as these levels alone
        level = segments.levels[number]
        in_level, n, constants = numbers == number, level.width, level.gap_constants[: len(rigid)]
        rows = level.level.gap_rows[: len(rigid)]
        gaps[in_level], speeds[in_level] = (
            x[in_level, :n] @ rows.T + constants,
            v[in_level, :n] @ level.level.speed_rows.T,
        )
        terms = np.abs(x[in_level, :n]) @ np.abs(rows).T + np.abs(constants)
        largest = np.maximum(largest, np.max(terms, axis=0, initial=0.0))
    at_start = times == trajectory.t_start
    if np.any(at_start):
        speeds[at_start] = _first_speeds(trajectory, segments.levels[numbers[0]], v[0])
    touches = rigid & (np.abs(gaps) <= TOUCHING * largest)
    touches[instants, table[:, 1].astype(int)] = True
    for k, time in enumerate(times.tolist()):
        touching = tuple(np.flatnonzero(touches[k]).tolist())
        links = [model.base.link_indices[i][:2] for i in touching]
        contact_speeds = np.array(
            [[speeds[k, pair[0]], speeds[k, pair[-1]] if len(pair) > 1 else 0.0] for pair in links]
        )
        yield _Impact(time, segments.levels[numbers[k]], touching, contact_speeds)


def _first_speeds(trajectory: Trajectory, level: LoadedLevel, velocity: np.ndarray) -> np.ndarray:
    """h.x' - v (l,) [m/s] of all links before an impact at the start itself; velocity: xi' after it."""
    stop_speeds = level.excitation.stops @ velocity[level.modal.modes : level.width]
    return np.asarray(trajectory.model.base.directions.T @ trajectory.start.velocity - stop_speeds)


def _coefficients(model: MultiPhiModel) -> np.ndarray:
    """mu (c,) of the rigid contacts with friction, zero of all others."""
    contacts = [contact if isinstance(contact, UnilateralContact) else None for contact in model.contacts]
    return np.array([0.0 if contact is None or not contact.rigid else contact.friction for contact in contacts])


def _coulomb(model: MultiPhiModel, impact: _Impact, mu: np.ndarray) -> CoulombImpact:
    """Impact problem of the touching contacts in the level without closed rigid links."""
    base = model.base
    rows = model.level_at(tuple(k for k in impact.level.level.indices if not base.links[k].rigid)).gap_rows
    links = [base.link_indices[i][:2] for i in impact.touching]
    pairs = [[rows[pair[0]], rows[pair[-1]] if len(pair) > 1 else np.zeros_like(rows[pair[0]])] for pair in links]
    return CoulombImpact(np.array(pairs), mu[list(impact.touching)])
