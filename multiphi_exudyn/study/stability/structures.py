"""Structures that several cases share: one mass on a spring, chains of masses, the rig's beam pulled and let go."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mechanics.arguments import Matrix
from multiphi_exudyn.mechanics.beam import Beam
from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.damping import ModalDamping, RayleighDamping
from multiphi_exudyn.mechanics.force_law import ForceLaw
from multiphi_exudyn.mechanics.friction import Friction
from multiphi_exudyn.mechanics.structure import At, LinearStructure
from multiphi_exudyn.study.stability.case import Problem, Pull
from multiphi_exudyn.time.trajectory import Trajectory
from reference_models.full_beam import FullBeam, FullBeamSettings
from reference_models.rig import rig_beam, rig_contact

__all__ = ["STOP", "chain", "differs", "in_a_row", "pulled", "rig_problem", "stop", "two_masses"]

STOP = "stop"
ELEMENTS = 8  # of the full beam beside a case: few, as its own error is shown
FINE_STEPS = {1e9: 2e-6, 1e7: 5e-6, 0.0: 2e-5}  # s, from which stiffness [N/m] on: above them it gains energy


def stop(at: Any, gap: float, stiffness: float = math.inf, name: str = STOP) -> UnilateralContact:
    """A stop below a point."""
    return UnilateralContact(name, at, gap, stiffness)


def chain(
    masses: Sequence[float],
    springs: Sequence[float],
    damping: Matrix | ModalDamping | RayleighDamping | None = None,
) -> LinearStructure:
    """Masses in a row, points m0, m1, ...: spring i holds mass i to the one before it, the first to the ground.

    One spring more than masses holds the last mass to the ground.
    """
    held = np.array([*springs, 0.0][: len(masses) + 1], dtype=float)
    stiffness = np.diag(held[:-1] + held[1:]) - np.diag(held[1:-1], 1) - np.diag(held[1:-1], -1)
    return LinearStructure(np.diag(masses), stiffness, damping, {f"m{i}": i for i in range(len(masses))})


def in_a_row(
    masses: Sequence[float],
    springs: Sequence[float],
    contacts: Sequence[UnilateralContact | ForceLaw | Friction],
    t_end: float,
    start: Sequence[float] | np.ndarray | None = None,
    damping: Matrix | ModalDamping | RayleighDamping | None = None,
    **others: Any,
) -> Problem:
    """Masses as in ``chain``, let go at ``start`` [m]; others: of a Problem."""
    displacement = None if start is None else np.array(start)
    return Problem(chain(masses, springs, damping), contacts, t_end, displacement=displacement, **others)


def two_masses(
    *contacts: UnilateralContact | ForceLaw | Friction, start: float = 0.0, t_end: float = 0.5, **others: Any
) -> Problem:
    """1 kg and 1 kg in a row, 1e4 N/m before each, let go with the last displaced so far [m], the first by half."""
    return in_a_row([1.0, 1.0], [1e4, 1e4], contacts, t_end, [start / 2, start], **others)


def pulled(
    beam: Beam,
    contacts: Sequence[UnilateralContact],
    t_end: float,
    *,
    tip: str,
    displacement: float,
    modes: int | str = "all",
    damping: ModalDamping | RayleighDamping | None = None,
    penalty: float | None = None,
) -> Problem:
    """A beam whose ``tip`` is pulled to a displacement [m] and let go; its matrices are those of the full beam."""
    stiffest = max((penalty or 0.0) if c.rigid else c.stiffness for c in contacts)
    step = next(step for stiffness, step in FINE_STEPS.items() if stiffest >= stiffness)
    settings = FullBeamSettings(elements=ELEMENTS, step=step)
    structure = FullBeam(beam, (), settings).structure
    given = LinearStructure(structure.mass, structure.stiffness, damping, structure.points)
    return Problem(
        given,
        contacts,
        t_end,
        modes,
        displacement=_deflected(given, tip, displacement),
        pull=Pull(beam, tip, displacement, ELEMENTS, step),
        penalty=penalty,
    )


def _deflected(structure: LinearStructure, point: str, displacement: float) -> np.ndarray:
    """x (n,) under the static force at a point that deflects it so far, no contact in the way."""
    shape = MultiPhiModel(structure).static_equilibrium({point: 1.0})
    return np.asarray(shape * (displacement / float(structure.row(point) @ shape)))


def rig_problem(stiffness: float, t_end: float, displacement: float = 0.02, **options: Any) -> Problem:
    """The published rig, its tip pulled away from the support of this stiffness [N/m]."""
    contact = rig_contact(stiffness)
    if "gap" in options:
        contact = replace(contact, gap=options.pop("gap"))
    return pulled(rig_beam(), [contact], t_end, tip="node3", displacement=displacement, **options)


def differs(trajectory: Trajectory, other: Trajectory, point: At | None, factor: float, share: float) -> str:
    """What is wrong with a run that should be another one, lengths times ``factor``, to a ``share`` of its largest.

    point: whose displacement is compared, None for all of them.
    """
    times = np.linspace(0.0, other.t_end, 5001)
    ours, theirs = (run.displacement(times) if point is None else run.at(point, times) for run in (trajectory, other))
    away = float(np.max(np.abs(ours / factor - theirs)) / np.max(np.abs(theirs)))
    late = max((abs(a.time - b.time) for a, b in zip(trajectory.events, other.events, strict=False)), default=0.0)
    kinds = ([(event.contact, event.kind) for event in run.events] for run in (trajectory, other))
    if len(set(map(tuple, kinds))) == 1 and max(away, late / other.t_end) <= share:
        return ""
    counts = f"{len(trajectory.events)} events and {len(other.events)}"
    return f"{counts}, {late:.1e} s and {away:.1e} of the displacement apart"
