"""Discretised beams: M, K, points and rigid-body motion of a scene's beams, cached for scenes with the same beams.

They are linearised full beams, or linear elements for scenes without a full model.
"""

from __future__ import annotations

import functools
import math
import time
from dataclasses import asdict, dataclass, field, replace

import numpy as np

from multiphi_exudyn.mechanics.assembly import Assembly, assemble
from multiphi_exudyn.mechanics.beam import Beam, Clamp, planar_beam
from multiphi_exudyn.mechanics.structure import LinearStructure
from reference_models.beams import Beams
from reference_models.full_beam import FullBeam, FullBeamSettings

__all__ = ["LinearBeams", "Mesh", "discretised"]

CACHE_SIZE = 32  # discretised beams in the cache; each is a few matrices of some 100 DoFs


@dataclass(frozen=True)
class Mesh:
    """Beams with their discretisation: kind of full beam (None: linear elements), and number of elements of each beam.

    written: text of all beam data, by which meshes are compared.
    """

    beams: Beams = field(compare=False)
    kind: str | None
    elements: int
    written: str

    @classmethod
    def of(cls, beams: Beams, kind: str | None, elements: int) -> Mesh:
        """Mesh of beams with a kind and a number of elements."""
        return cls(beams, kind, elements, repr(asdict(beams)))


class LinearBeams:
    """Beams of linear elements. structure: M, K and points."""

    def __init__(self, beams: Beams, elements: int) -> None:
        self.beams = beams
        self.elements = elements
        self.structure = self._structure()

    def _structure(self) -> LinearStructure:
        if self.beams.only is not None:
            return planar_beam(self.beams.only, self.elements)
        parts = {name: planar_beam(beam, self.elements) for name, beam in self.beams.parts.items()}
        return assemble(parts, self.beams.ties)

    @functools.cached_property
    def transverse(self) -> np.ndarray:
        """e (n,), unit rigid-body motion along +z: M e is the inertia of the whole beams, see FullBeam.transverse."""
        inertia = np.concatenate([_inertia(beam, self.elements) for beam in self.beams.parts.values()])
        if isinstance(self.structure, Assembly):
            inertia = self.structure.transformation.T @ inertia
        return np.asarray(np.linalg.solve(self.structure.mass, inertia))


@functools.lru_cache(maxsize=CACHE_SIZE)
def discretised(mesh: Mesh) -> tuple[FullBeam | LinearBeams, float]:
    """Return the discretised beams without contacts, and the time of their first computation [s]."""
    started = time.perf_counter()
    if mesh.kind is None:
        beams: FullBeam | LinearBeams = LinearBeams(mesh.beams, mesh.elements)
    else:
        beams = FullBeam(mesh.beams, (), FullBeamSettings(kind=mesh.kind, elements=mesh.elements))
    return beams, time.perf_counter() - started


def _inertia(beam: Beam, elements: int) -> np.ndarray:
    """Inertia force (n,) on the free coordinates of a beam of linear elements under a unit acceleration."""
    free = planar_beam(replace(beam, clamp=Clamp(0.0, 0.0)), elements)
    inertia = free.mass[:, ::2].sum(axis=1)  # deflections and rotations alternate
    springs = (beam.clamp.translation, beam.clamp.rotation)
    return np.delete(inertia, [dof for dof, spring in enumerate(springs) if math.isinf(spring)])
