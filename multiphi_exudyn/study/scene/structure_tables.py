"""The table ``[structure]`` of a scene file: the rig, beams and their parts, matrices; SI units."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field, Tag

from multiphi_exudyn.study.scene.fields import (
    Finite,
    Name,
    NotNegative,
    NotZero,
    Positive,
    Stiffness,
    Table,
    by_key,
)

__all__ = [
    "BeamSpec",
    "BeamStructure",
    "BeamsStructure",
    "MatrixFiles",
    "MatrixStructure",
    "PointRow",
    "RectangleSection",
    "RigStructure",
    "SectionSpec",
    "StructureSpec",
]

PartName = Annotated[str, Field(min_length=1, pattern=r"^[\w-]+$")]
TieSpec = Annotated[dict[Name, NotZero], Field(min_length=1, max_length=2)]  # the sum is zero; of one: held


class RigStructure(Table):
    """The paper's rig by one of its parameter sets, with its support, its clamp and its measured damping."""

    rig: Literal["measured-free", "printed-pinned", "as-published"]  # the parameter set
    support_stiffness: Stiffness  # N/m
    clamp_translation: Stiffness = math.inf  # N/m
    clamp_rotation: Stiffness = math.inf  # N m/rad


class RectangleSection(Table):
    """A piece of rectangular beam, ``height`` along z."""

    start: Finite  # m
    end: Finite  # m
    width: Positive  # m
    height: Positive  # m
    youngs_modulus: Positive  # Pa
    density: Positive  # kg/m3
    poisson_ratio: Annotated[float, Field(gt=-1, le=0.5)] = 0.3


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


class BeamStructure(Table):
    """A beam described in the scene."""

    beam: BeamSpec


class BeamsStructure(Table):
    """Several beams, along x each; the point "tip" of the beam "a" is "a.tip"."""

    beams: Annotated[dict[PartName, BeamSpec], Field(min_length=1)]
    ties: tuple[TieSpec, ...] = ()


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


StructureSpec = Annotated[
    Annotated[RigStructure, Tag("<rig>")]
    | Annotated[BeamStructure, Tag("<beam>")]
    | Annotated[BeamsStructure, Tag("<beams>")]
    | Annotated[MatrixStructure, Tag("<matrices>")],
    by_key("rig", "beam", "beams", "matrices"),
]
