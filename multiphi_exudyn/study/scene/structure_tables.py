"""The table ``[structure]`` of a scene file: the rig, beams and their parts, matrices; SI units.

Every table gives what it describes as mechanics; an error that begins with a dot names a field inside it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import scipy.sparse
from pydantic import Field, Tag

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.mechanics.beam import Beam, Clamp, PointMass, Section
from multiphi_exudyn.mechanics.files import read_array, read_arrays, read_structure
from multiphi_exudyn.mechanics.structure import LinearStructure
from multiphi_exudyn.study.scene.fields import (
    Finite,
    Name,
    NotNegative,
    NotZero,
    Positive,
    Stiffness,
    Table,
    by_key,
    inside,
    numbered,
)
from multiphi_exudyn.study.scene.parts import Mechanics
from reference_models.beams import Beams, as_beams
from reference_models.rig import assumptions, rig_beam, rig_contact, rig_damping

__all__ = ["RigStructure", "StructureSpec"]

PartName = Annotated[str, Field(min_length=1, pattern=r"^[\w-]+$")]
TieSpec = Annotated[dict[Name, NotZero], Field(min_length=1, max_length=2)]  # the sum is zero; of one: held


class RigStructure(Table):
    """The paper's rig by one of its parameter sets, with its support, its clamp and its measured damping."""

    rig: Literal["measured-free", "printed-pinned", "as-published"]  # the parameter set
    support_stiffness: Stiffness  # N/m
    clamp_translation: Stiffness = math.inf  # N/m
    clamp_rotation: Stiffness = math.inf  # N m/rad

    def build(self, folder: Path) -> Mechanics:
        """The rig with its contact and damping; ``folder``: of the scene file."""
        clamp = Clamp(self.clamp_translation, self.clamp_rotation)
        return Mechanics(
            contacts=(rig_contact(self.support_stiffness),),
            damping=rig_damping(),
            beams=as_beams(rig_beam(self.rig, clamp)),
            parameter_set=self.rig,
            assumptions=assumptions(self.rig, clamp),
        )


class RectangleSection(Table):
    """A piece of rectangular beam, ``height`` along z."""

    start: Finite  # m
    end: Finite  # m
    width: Positive  # m
    height: Positive  # m
    youngs_modulus: Positive  # Pa
    density: Positive  # kg/m3
    poisson_ratio: Annotated[float, Field(gt=-1, le=0.5)] = 0.3

    def section(self) -> Section:
        """The piece."""
        return Section.rectangle(**self.model_dump())


class GeneralSection(Table):
    """A piece of beam by its section values."""

    start: Finite  # m
    end: Finite  # m
    area: Positive  # m2
    second_moment: Positive  # m4
    youngs_modulus: Positive  # Pa
    density: Positive  # kg/m3
    shear_modulus: Positive  # Pa
    shear_factor: Positive = 5 / 6  # k in the shear stiffness k G A

    def section(self) -> Section:
        """The piece."""
        return Section(**self.model_dump())


class MassSpec(Table):
    """A point mass with rotary inertia."""

    at: Finite  # m
    mass: NotNegative  # kg
    inertia: NotNegative = 0.0  # kg m2


class ClampSpec(Table):
    """Stiffness of the beam's first end; infinite is ideally rigid."""

    translation: NotNegative | Stiffness = math.inf  # N/m
    rotation: NotNegative | Stiffness = math.inf  # N m/rad


SectionSpec = Annotated[
    Annotated[RectangleSection, Tag("<width>")] | Annotated[GeneralSection, Tag("<area>")],
    by_key("width", "area"),
]


class PointRow(Table):
    """``count`` points at equal distances; "{i}" in their name stands for 1, 2, ... count."""

    first: Finite  # m
    last: Finite  # m
    count: Annotated[int, Field(ge=2)]


class BeamSpec(Table):
    """A straight planar beam in full."""

    sections: Annotated[tuple[SectionSpec, ...], Field(min_length=1)]
    points: Annotated[dict[Name, Finite | PointRow], Field(min_length=1)]  # name = x [m]
    masses: tuple[MassSpec, ...] = ()
    clamp: ClampSpec = ClampSpec()

    def build(self) -> Beam:
        """The beam with its points, masses and clamp."""
        masses = [PointMass(**mass.model_dump()) for mass in self.masses]
        clamp = Clamp(**self.clamp.model_dump())
        return Beam([section.section() for section in self.sections], dict(self._places()), masses, clamp)

    def _places(self) -> Iterator[tuple[str, float]]:
        for name, at in self.points.items():
            if not isinstance(at, PointRow):
                yield name, at
            elif "{i}" not in name:
                raise MultiPhiValueError(f"points: got the name {name!r} for {at.count} points, need one with {{i}}")
            else:
                places = np.linspace(at.first, at.last, at.count).tolist()
                yield from ((numbered(name, i), x) for i, x in enumerate(places, start=1))


class BeamStructure(Table):
    """A beam described in the scene."""

    beam: BeamSpec

    def build(self, folder: Path) -> Mechanics:
        """The beam; ``folder``: of the scene file."""
        return Mechanics(beams=as_beams(inside(".beam", self.beam.build)))


class BeamsStructure(Table):
    """Several beams, along x each; the point "tip" of the beam "a" is "a.tip"."""

    beams: Annotated[dict[PartName, BeamSpec], Field(min_length=1)]
    ties: tuple[TieSpec, ...] = ()

    def build(self, folder: Path) -> Mechanics:
        """The beams; ``folder``: of the scene file."""
        return Mechanics(
            beams=Beams({n: inside(f".beams.{n}", beam.build) for n, beam in self.beams.items()}, self.ties)
        )


class MatrixFiles(Table):
    """One file for each matrix: .mtx, .mtx.gz, .npz of scipy.sparse, .npy."""

    mass: str
    stiffness: str
    damping: str | None = None


class MatrixStructure(Table):
    """Matrices from one .npz file (arrays mass, stiffness, and optionally damping), or from a file for each.

    Paths are relative to the scene file. points: a DoF, or a row: the name of its array in the one file, else the
    path of its own.
    """

    matrices: str | MatrixFiles
    points: Annotated[dict[Name, Annotated[int, Field(ge=0)] | str], Field(min_length=1)]

    def build(self, folder: Path) -> Mechanics:
        """The structure with its damping; ``folder``: of the scene file."""
        structure = self._read(folder)
        return Mechanics(matrices=structure, damping=structure.damping)

    def _read(self, folder: Path) -> LinearStructure:
        files = self.matrices
        if isinstance(files, MatrixFiles):
            rows = {name: _own_row(folder, name, at) if isinstance(at, str) else at for name, at in self.points.items()}
            damping = None if files.damping is None else folder / files.damping
            return read_structure(folder / files.mass, folder / files.stiffness, damping, rows)
        arrays = read_arrays("matrices", folder / files)
        rows = {name: _array(arrays, at) if isinstance(at, str) else at for name, at in self.points.items()}
        return LinearStructure(_array(arrays, "mass"), _array(arrays, "stiffness"), arrays.get("damping"), rows)


def _own_row(folder: Path, name: str, path: str) -> np.ndarray:
    row = read_array(f"points[{name!r}]", folder / path)
    return np.squeeze(row.toarray() if scipy.sparse.issparse(row) else row)


def _array(arrays: Mapping[str, np.ndarray], name: str) -> np.ndarray:
    if name not in arrays:
        raise MultiPhiValueError(f"matrices: got the arrays {', '.join(arrays) or 'none'}, need {name!r}")
    return arrays[name]


StructureSpec = Annotated[
    Annotated[RigStructure, Tag("<rig>")]
    | Annotated[BeamStructure, Tag("<beam>")]
    | Annotated[BeamsStructure, Tag("<beams>")]
    | Annotated[MatrixStructure, Tag("<matrices>")],
    by_key("rig", "beam", "beams", "matrices"),
]
