"""Mechanical model described by a scene file: beams or matrices, contacts, force laws, friction, loads, damping."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import scipy.sparse

from multiphi_exudyn.mechanics.arguments import Matrix
from multiphi_exudyn.mechanics.beam import Beam
from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.damping import ModalDamping, RayleighDamping
from multiphi_exudyn.mechanics.force_law import ForceLaw
from multiphi_exudyn.mechanics.friction import Friction
from multiphi_exudyn.mechanics.structure import LinearStructure
from multiphi_exudyn.study.scene.load_tables import BaseMotionSpec, GravitySpec, LoadSpec, StopMotionSpec
from reference_models.beams import Beams
from reference_models.rig import published_override

__all__ = ["Mechanics"]


@dataclass(frozen=True)
class Mechanics:
    """A scene's structure, given as beams or as matrices, with its contacts, force laws, friction and damping.

    loads: as the file gives them. parameter_set: of the paper's rig, None for any other structure.
    assumptions: one sentence each.
    """

    contacts: tuple[UnilateralContact, ...] = ()
    damping: Matrix | ModalDamping | RayleighDamping | None = None
    beams: Beams | None = None
    matrices: LinearStructure | None = None
    parameter_set: str | None = None
    assumptions: tuple[str, ...] = ()
    force_laws: tuple[ForceLaw, ...] = ()
    frictions: tuple[Friction, ...] = ()
    loads: tuple[LoadSpec, ...] = ()

    @property
    def friction_names(self) -> tuple[str, ...]:
        """Names of the frictions and of the contacts with friction."""
        contacts = [contact.name for contact in self.contacts if contact.friction]
        return (*(friction.name for friction in self.frictions), *contacts)

    @property
    def has_printed_frequencies(self) -> bool:
        """Whether printed frequencies replace those of the levels."""
        return self.parameter_set is not None and bool(published_override(self.parameter_set))

    @property
    def sparse(self) -> bool:
        """Whether the matrices are sparse."""
        return self.matrices is not None and scipy.sparse.issparse(self.matrices.stiffness)

    @property
    def points(self) -> tuple[str, ...]:
        """Names of the structure's points."""
        structure = self.beams or self.matrices
        assert structure is not None, "a structure is beams or matrices"
        points: Mapping[str, object] = structure.points
        return tuple(points)

    @property
    def beam(self) -> Beam | None:
        """The beam of a structure that is one beam, else None."""
        return None if self.beams is None else self.beams.only

    @property
    def direction_count(self) -> int:
        """Number of contacts, force laws and frictions; a level has at least so many modes less than DoFs."""
        return len(self.contacts) + len(self.force_laws) + len(self.frictions)

    @property
    def needs_rigid_body_motion(self) -> bool:
        """Whether a load acts along a rigid-body motion of the structure: weight or a moving base."""
        return any(isinstance(load, (GravitySpec, BaseMotionSpec)) for load in self.loads)

    @property
    def moving_stops(self) -> bool:
        """Whether a stop moves relative to the base."""
        return any(isinstance(load, StopMotionSpec) or getattr(load, "fixed_stops", ()) for load in self.loads)
