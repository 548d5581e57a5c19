"""An extreme case: one thing that is hard for a contact model, as a problem that every model can be given.

Structures that several cases share: one mass on a spring, chains of masses, the rig's beam pulled and let go.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mechanics.arguments import Matrix
from multiphi_exudyn.mechanics.beam import Beam
from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.damping import ModalDamping, RayleighDamping
from multiphi_exudyn.mechanics.force_law import ForceLaw
from multiphi_exudyn.mechanics.friction import Friction
from multiphi_exudyn.mechanics.loads import ConstantLoad, Gravity, Load
from multiphi_exudyn.mechanics.structure import At, LinearStructure
from multiphi_exudyn.time.trajectory import Trajectory
from reference_models.full_beam import FullBeam, FullBeamSettings
from reference_models.rig import rig_beam, rig_contact

__all__ = [
    "STATIC_LOADS",
    "STOP",
    "Case",
    "Problem",
    "Pull",
    "chain",
    "differs",
    "in_a_row",
    "pulled",
    "rig_problem",
    "stop",
    "two_masses",
]

STATIC_LOADS = (ConstantLoad, Gravity)


@dataclass(frozen=True)
class Pull:
    """A beam pulled and let go: what the full nonlinear beam needs beside the contacts and the end of the run.

    elements, step [s]: of the full beam. displacement [m] of the point ``tip`` under a static force there.
    """

    beam: Beam
    tip: str
    displacement: float
    elements: int
    step: float


@dataclass(frozen=True)
class Problem:
    """What a run is given.

    structure, contacts (force laws and friction among them), modes: of the model.
    displacement, velocity: x, x' (n,) at the start, None for zero.
    loads: of loads.py. t_end: end of the run in the case's unit of time.
    pull: the same problem for the full nonlinear beam; without one the full model has the structure's matrices.
    penalty: stiffness of the full model's contact elements where the contacts are rigid, None: it cannot be run.
    metre: length units in one metre (1e3 where lengths are in mm).
    """

    structure: LinearStructure
    contacts: Sequence[UnilateralContact | ForceLaw | Friction]
    t_end: float
    modes: int | str = "all"
    displacement: np.ndarray | None = None
    velocity: np.ndarray | None = None
    loads: Sequence[Load] = ()
    pull: Pull | None = None
    penalty: float | None = None
    metre: float = 1.0

    def model(self) -> MultiPhiModel:
        """A model that no run has used yet."""
        return MultiPhiModel(self.structure, self.contacts, modes=self.modes)

    @property
    def start(self) -> tuple[np.ndarray, np.ndarray]:
        """x, x' (n,) at the start."""
        rest = np.zeros(self.structure.n)
        return (
            rest if self.displacement is None else self.displacement,
            rest if self.velocity is None else self.velocity,
        )

    @property
    def parts(self) -> list[UnilateralContact | ForceLaw]:
        """The contacts and force laws, without friction."""
        return [contact for contact in self.contacts if not isinstance(contact, Friction)]

    @property
    def unilateral(self) -> list[UnilateralContact]:
        """The contacts alone."""
        return [contact for contact in self.contacts if isinstance(contact, UnilateralContact)]

    @property
    def frictions(self) -> list[Friction]:
        """The friction among the contacts."""
        return [contact for contact in self.contacts if isinstance(contact, Friction)]

    @property
    def laws(self) -> list[ForceLaw]:
        """The force laws among the contacts."""
        return [contact for contact in self.contacts if isinstance(contact, ForceLaw)]

    @property
    def damped(self) -> bool:
        """Whether structure or contacts are."""
        return self.structure.damping is not None or any(contact.damping > 0 for contact in self.parts)

    @property
    def driven(self) -> bool:
        """Whether a load varies in time."""
        return not all(isinstance(load, STATIC_LOADS) for load in self.loads)

    @property
    def penalty_contacts(self) -> list[UnilateralContact] | None:
        """The unilateral contacts as penalty elements, None where a rigid one has no stand-in."""
        penalty, given = self.penalty, self.unilateral
        if penalty is None:
            return None if any(contact.rigid for contact in given) else given
        return [replace(c, stiffness=penalty) if c.rigid else c for c in given]


@dataclass(frozen=True)
class Case:
    """name; hard: what is hard about it, one sentence; build: the problem, shorter for True (the quick catalogue).

    check: what is wrong with a native answer beyond what every case is judged by, "" if nothing. quick: whether the
    quick catalogue has it.
    """

    name: str
    hard: str
    build: Callable[[bool], Problem]
    check: Callable[[Problem, Trajectory], str] | None = None
    quick: bool = True


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
