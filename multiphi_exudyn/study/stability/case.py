"""A case of the catalogue: one thing that is hard for a contact model, as a problem every model can be given."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mechanics.beam import Beam
from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.force_law import ForceLaw
from multiphi_exudyn.mechanics.friction import Friction
from multiphi_exudyn.mechanics.loads import ConstantLoad, Gravity, Load
from multiphi_exudyn.mechanics.structure import LinearStructure
from multiphi_exudyn.time.trajectory import Trajectory

__all__ = ["STATIC_LOADS", "Case", "Problem", "Pull"]

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
