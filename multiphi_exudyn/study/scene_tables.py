"""What the tables of a scene file are made of, and its structure, damping and outputs.

SI units, angles in radians. Every field is typed and none may be unknown; the remark behind a field describes it in the
schema. Points that a table names are checked where the scene is loaded (multiphi_exudyn.study.scene). ``build`` gives
what a table describes as mechanics; an error that begins with a dot names a field inside the table.
"""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

import numpy as np
import scipy.sparse
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    GetJsonSchemaHandler,
    Tag,
    WithJsonSchema,
)
from pydantic_core import PydanticCustomError

from multiphi_exudyn.errors import MultiPhiError, MultiPhiValueError
from multiphi_exudyn.mechanics.arguments import Matrix
from multiphi_exudyn.mechanics.beam import Beam, Clamp, PointMass, Section
from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.damping import ModalDamping, RayleighDamping
from multiphi_exudyn.mechanics.files import read_array, read_structure
from multiphi_exudyn.mechanics.force_law import ForceLaw
from multiphi_exudyn.mechanics.friction import Friction
from multiphi_exudyn.mechanics.structure import LinearStructure
from reference_models.beams import Beams, as_beams
from reference_models.rig import assumptions, published_override, rig_beam, rig_contact, rig_damping

__all__ = [
    "Count",
    "DampingSpec",
    "Finite",
    "Mechanics",
    "Name",
    "NotNegative",
    "NotZero",
    "OutputSpec",
    "Place",
    "Positive",
    "RigStructure",
    "Stiffness",
    "StructureSpec",
    "Table",
    "by_key",
    "inside",
    "numbered",
]

REMARK = re.compile(r"^    (\w+): .*?  # (.*)$", re.MULTILINE)
SPELLED = 3  # entries of a list from which a phrase gives their number alone

T = TypeVar("T")


# values of fields


def _not_zero(value: float) -> float:
    if value == 0:
        raise PydanticCustomError("zero", "a value that is not zero")
    return value


def _rigid_is_infinite(value: Any) -> Any:
    if isinstance(value, str) and value != "rigid":
        raise PydanticCustomError("stiffness", "a number or 'rigid'")
    return math.inf if value == "rigid" else value


Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Stiffness = Annotated[  # N/m or N m; inf or "rigid"
    float,
    BeforeValidator(_rigid_is_infinite),
    Field(gt=0),
    WithJsonSchema({"anyOf": [{"type": "number", "exclusiveMinimum": 0}, {"const": "rigid"}]}),
]
NotZero = Annotated[float, Field(allow_inf_nan=False), AfterValidator(_not_zero)]
Name = Annotated[str, Field(min_length=1, pattern=r"^[\w.{}-]+$")]
Place = Name | Annotated[dict[Name, Finite], Field(min_length=1)]  # a point, or coefficients of points
Count = Annotated[int, Field(ge=1)]


def by_key(*keys: str) -> Discriminator:
    """Choose a table's form by the key that only this form has."""

    def choose(given: Any) -> str | None:
        return next((f"<{key}>" for key in keys if isinstance(given, Mapping) and key in given), None)

    needed = "a table with the field " + " or ".join(keys)
    return Discriminator(choose, custom_error_type="form", custom_error_message=needed)


def inside(place: str, build: Callable[..., T], *arguments: Any) -> T:
    """What ``build`` gives; its error names the place, and the field inside it where it begins with a dot."""
    try:
        return build(*arguments)
    except MultiPhiError as error:
        text = " ".join(str(error).split())
        raise MultiPhiValueError(f"{place}{'' if text.startswith('.') else ': '}{text}") from error


def numbered(at: Any, i: int) -> Any:
    """The i-th of a row: "{i}" in a name, or in the names of a mapping, is its number."""
    if isinstance(at, Mapping):
        return {numbered(name, i): value for name, value in at.items()}
    return at.replace("{i}", str(i)) if isinstance(at, str) else at


class Table(BaseModel):
    """A table of a file."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    @classmethod
    def __get_pydantic_json_schema__(cls, core: Any, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        """The schema, with the remark behind a field as its description."""
        schema = handler.resolve_ref_schema(handler(core))
        owners = [owner for owner in reversed(cls.__mro__) if issubclass(owner, Table)]
        remarks = dict(remark for owner in owners for remark in REMARK.findall(inspect.getsource(owner)))
        for name, field in schema["properties"].items():
            field |= {"description": remarks[name]} if name in remarks else {}
        return schema

    def phrase(self) -> str:
        """The table's kind and its given fields, as part of a sentence."""
        fields = [name for name in type(self).model_fields if name in self.model_fields_set and name != "kind"]
        told = ", ".join(f"{name} {_spelled(getattr(self, name))}" for name in fields)
        return f"{kind} ({told})" if (kind := getattr(self, "kind", "")) else told


def _spelled(value: Any) -> str:
    if isinstance(value, Table):
        return value.phrase()
    if isinstance(value, Mapping):
        return " and ".join(f"{factor:+g} {name}" for name, factor in value.items())
    if isinstance(value, tuple) and len(value) >= SPELLED:
        return f"of {len(value)} values"
    if isinstance(value, tuple):
        return " to ".join(map(_spelled, value))
    return f"{value:g}" if isinstance(value, float) else str(value)


# structures


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
    loads: tuple[Table, ...] = ()

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
        return any(getattr(load, "kind", "") in ("gravity", "base-motion") for load in self.loads)

    @property
    def moving_stops(self) -> bool:
        """Whether a stop moves relative to the base."""
        return any(hasattr(load, "contact") or getattr(load, "fixed_stops", ()) for load in self.loads)


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


class PointRow(Table):
    """``count`` points at equal distances; "{i}" in their name stands for 1, 2, ... count."""

    first: Finite  # m
    last: Finite  # m
    count: Annotated[int, Field(ge=2)]


SectionSpec = Annotated[
    Annotated[RectangleSection, Tag("<width>")] | Annotated[GeneralSection, Tag("<area>")],
    by_key("width", "area"),
]


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


PartName = Annotated[str, Field(min_length=1, pattern=r"^[\w-]+$")]
TieSpec = Annotated[dict[Name, NotZero], Field(min_length=1, max_length=2)]  # the sum is zero; of one: held


class BeamsStructure(Table):
    """Several beams, along x each; the point "tip" of the beam "a" is "a.tip"."""

    beams: Annotated[dict[PartName, BeamSpec], Field(min_length=1)]
    ties: tuple[TieSpec, ...] = ()

    def build(self, folder: Path) -> Mechanics:
        """The beams; ``folder``: of the scene file."""
        parts = {name: inside(f".beams.{name}", beam.build) for name, beam in self.beams.items()}
        return Mechanics(beams=Beams(parts, self.ties))


FileOrArray = str | tuple[str, str]  # a path, relative to the scene file, or [path, name of the array in the file]
Dof = Annotated[int, Field(ge=0)] | tuple[int, int | str]  # a number from 0, or [node, component] where nodes are known


class MatrixFiles(Table):
    """One file for each matrix, or one array for each in files of several."""

    mass: FileOrArray
    stiffness: FileOrArray
    damping: FileOrArray | None = None


class MatrixStructure(Table):
    """Matrices from files of every format that ``multiphi_exudyn.read_structure`` reads.

    One path is a file of several arrays, whose names tell which is the mass and which the stiffness; one that is called
    "damping" is that.
    """

    matrices: str | MatrixFiles
    points: Annotated[dict[Name, Dof | str], Field(min_length=1)]  # a DoF, or a row: its array in the one file, or path
    dofs: str | None = None  # path of a table of node and component of every row
    fixed: tuple[Dof | tuple[int, Literal["all"]], ...] = ()  # DoFs that supports fix

    def build(self, folder: Path) -> Mechanics:
        """The structure with its damping; ``folder``: of the scene file."""
        files = self.matrices
        if isinstance(files, str):
            files = MatrixFiles(mass=files, stiffness=files, damping=_damping_in(folder / files))
        structure = read_structure(
            _file(folder, files.mass),
            _file(folder, files.stiffness),
            _file(folder, files.damping),
            {name: self._point(folder, name, at) for name, at in self.points.items()},
            None if self.dofs is None else folder / self.dofs,
            self.fixed,
        )
        return Mechanics(matrices=structure, damping=structure.damping)

    def _point(self, folder: Path, name: str, at: Dof | str) -> Any:
        if not isinstance(at, str):
            return at
        given = (folder / self.matrices, at) if isinstance(self.matrices, str) else folder / at
        row = read_array(f"points[{name!r}]", given)
        return np.squeeze(row.toarray() if scipy.sparse.issparse(row) else row)


def _damping_in(path: Path) -> tuple[str, str] | None:
    """The array "damping" of a file, where it has one."""
    try:
        read_array("damping", (path, "damping"))
    except MultiPhiError:
        return None
    return str(path), "damping"


def _file(folder: Path, given: FileOrArray | None) -> Any:
    if isinstance(given, tuple):
        return folder / given[0], given[1]
    return None if given is None else folder / given


StructureSpec = Annotated[
    Annotated[RigStructure, Tag("<rig>")]
    | Annotated[BeamStructure, Tag("<beam>")]
    | Annotated[BeamsStructure, Tag("<beams>")]
    | Annotated[MatrixStructure, Tag("<matrices>")],
    by_key("rig", "beam", "beams", "matrices"),
]


class ModalDampingSpec(Table):
    """Damping ratios of the open level's modes, lowest first, as fractions."""

    modal_ratios: tuple[NotNegative, ...]  # 0.01 is 1 %
    beyond: NotNegative | None = None  # of all further modes; none given: undamped

    def build(self) -> ModalDamping:
        return ModalDamping(self.modal_ratios, self.beyond)


class RayleighDampingSpec(Table):
    """C = alpha M + beta K."""

    alpha: NotNegative  # 1/s
    beta: NotNegative  # s

    def build(self) -> RayleighDamping:
        return RayleighDamping(self.alpha, self.beta)


DampingSpec = Annotated[
    Annotated[ModalDampingSpec, Tag("<modal_ratios>")] | Annotated[RayleighDampingSpec, Tag("<alpha>")],
    by_key("modal_ratios", "alpha"),
]


class OutputSpec(Table):
    """What is recorded and how it is judged."""

    t_end: Positive = 1.0  # s
    interval: Positive = 1e-4  # s, between the samples of the common time grid
    points: tuple[Name, ...] = ()  # none named: all of the structure
    judged_points: tuple[Name, ...] = ()  # those the report's headline figures speak of; none named: all
    windows: tuple[Positive, ...] = (0.1, 0.3)  # s, from 0; t_end is added
    tolerances: tuple[Positive, ...] = (0.01, 0.05)  # of the agreement horizon
