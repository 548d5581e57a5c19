"""Scenes: TOML files by name or path, validated, and what they describe as mechanics.

A file is checked against its tables by pydantic; what several fields must agree on is checked here. Every error is one
line: file, field, what was given and what is needed. ``with_value`` changes a file's content at a path with dots.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, NoReturn, TypeVar

import numpy as np
from pydantic import BaseModel, Field, ValidationError

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.mechanics.arguments import one_of
from multiphi_exudyn.mechanics.loads import Load
from multiphi_exudyn.study.model_kinds import ModelSpec
from multiphi_exudyn.study.scene_elements import ContactSpec, FrictionSpec, LawSpec, LoadSpec, StartSpec
from multiphi_exudyn.study.scene_tables import (
    Count,
    DampingSpec,
    Mechanics,
    Name,
    OutputSpec,
    StructureSpec,
    Table,
    inside,
)

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

__all__ = [
    "Scene",
    "SceneFile",
    "load_scene",
    "loads_of",
    "mechanics_of",
    "read_toml",
    "refuse",
    "scene_data",
    "scene_of",
    "shipped",
    "shipped_scenes",
    "validated",
    "with_value",
]

MOST_SAMPLES = 10_000_000  # of one history: more is probably a typing error
MOST_FAULTS = 12  # listed in one error
LONGEST = 120  # characters of a value that an error shows
OF_POINTS = ("load_at", "measured_at", "points", "judged_points", "direction", "tangential", "at")
EVERY = "*"
NEEDED = {"missing": "a value", "extra_forbidden": "a known field"}  # type of pydantic's error -> in place of its words

Form = TypeVar("Form", bound=BaseModel)


class ComparisonSpec(Table):
    """Which model plays which part."""

    reference: Name  # the model that all others are measured against
    coarser: Name | None = None  # its difference to the reference is the reference's own uncertainty
    cheapest: tuple[Name, ...] = ()  # the full model at its cheapest fair setting, at nearby steps


class SceneFile(Table):
    """A whole scene file."""

    title: Annotated[str, Field(min_length=1)]  # the heading of its report
    modes: Count = 6  # of each reduced model that has no number of its own
    structure: StructureSpec
    contacts: tuple[ContactSpec, ...] = ()
    force_laws: tuple[LawSpec, ...] = ()
    friction: tuple[FrictionSpec, ...] = ()
    start: StartSpec | None = None  # none, with loads: at rest, undeformed
    loads: tuple[LoadSpec, ...] = ()
    damping: DampingSpec | None = None
    outputs: OutputSpec = OutputSpec()
    models: Annotated[tuple[Annotated[ModelSpec, Field(discriminator="kind")], ...], Field(min_length=1)]
    comparison: ComparisonSpec


@dataclass(frozen=True)
class Scene:
    """A validated scene: name, path and content of its file."""

    name: str
    path: Path
    file: SceneFile

    @property
    def models(self) -> dict[str, ModelSpec]:
        """name -> model in the file's order, with their numbers of modes; equal ones appear once."""
        return {model.name: model for model in map(self.with_modes, self.file.models)}

    def with_modes(self, model: ModelSpec) -> ModelSpec:
        """The model with its number of modes, and that number in its name."""
        return model.with_modes(self.file.modes)


# files


def read_toml(path: Path) -> dict[str, Any]:
    """Read the raw content of a file."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError, RecursionError) as error:
        raise MultiPhiValueError(f"{path}: got {_one_line(error)}, need a readable TOML file") from error


def validated(form: type[Form], path: Path, data: Mapping[str, Any]) -> Form:
    """Validate ``data`` as a ``form``; the error names ``path`` and every wrong field, in pydantic's words."""
    try:
        return form.model_validate_json(json.dumps(data, default=str))
    except ValidationError as error:
        needs: dict[tuple[str, str], list[str]] = {}
        for item in error.errors(include_url=False):
            missing = item["type"] == "missing"
            given = "nothing" if missing else _one_line(repr(item["input"]))
            needed = NEEDED.get(item["type"], item["msg"].removeprefix("Input should be "))
            needs.setdefault((_field(item["loc"], data, missing), given), []).append(_one_line(needed))
        faults = [
            f"{field}: got {given}, need {' or '.join(dict.fromkeys(needed))}"
            for (field, given), needed in needs.items()
        ]
        more = f" (and {len(faults) - MOST_FAULTS} more)" if len(faults) > MOST_FAULTS else ""
        raise MultiPhiValueError(f"{path}: {'; '.join(faults[:MOST_FAULTS])}{more}") from error


def _field(location: Sequence[int | str], data: Any, missing: bool) -> str:
    """Path in the file, without pydantic's labels of the forms that a table may have."""
    text = ""
    for i, part in enumerate(location):
        if isinstance(part, int) and isinstance(data, list):
            text, data = f"{text}[{part}]", data[part]
        elif isinstance(data, Mapping) and (part in data or (missing and i == len(location) - 1)):
            text, data = f"{text}.{part}", data.get(part)
    return text.lstrip(".") or "file"


def _one_line(text: object) -> str:
    line = " ".join(str(text).split())
    return line if len(line) <= LONGEST else f"{line[: LONGEST - 3]}..."


def with_value(data: Mapping[str, Any], place: str, value: Any) -> dict[str, Any]:
    """The content with ``value`` at a path: "start.displacement", "contacts.stop.gap", "structure.beam.masses.0.at".

    In a list a part is the index of an entry, its ``name``, or "*" for every entry; in a table it is a field, or "*"
    for every entry of the table. Names may contain dots. A path may end at a whole table; missing tables are created.
    """

    def replaced(content: Any, parts: Sequence[str]) -> Any:
        if not parts:
            return value
        if isinstance(content, Mapping):
            known = list(content)
        elif isinstance(content, list):
            known = [entry.get("name") if isinstance(entry, Mapping) else None for entry in content]
        else:
            given = f"got {'.'.join(parts)!r} inside {content!r}"
            raise MultiPhiValueError(f"{place}: {given}, need a field of a table or a list")
        longest = [count for count in range(len(parts), 0, -1) if ".".join(parts[:count]) in known]
        count = longest[0] if longest else 1
        name, rest = ".".join(parts[:count]), parts[count:]
        if isinstance(content, Mapping):
            names = known if name == EVERY else [name]
            return {**content, **{each: replaced(content.get(each, {}), rest) for each in names}}
        chosen = [i for i, each in enumerate(known) if name in (each, EVERY)]
        chosen = chosen or [i for i in range(len(known)) if name == str(i)]
        if not chosen:
            allowed = [EVERY, *map(str, range(len(known))), *(each for each in known if isinstance(each, str))]
            raise MultiPhiValueError(f"{place}: got {name!r}, need {one_of(name, allowed, 'entries')}")
        return [replaced(entry, rest) if i in chosen else entry for i, entry in enumerate(content)]

    changed: dict[str, Any] = replaced(data, place.split("."))
    return changed


# scenes


def shipped() -> dict[str, Path]:
    """name -> file of the scenes that come with the package, in alphabetical order."""
    return {path.stem: path for path in sorted((Path(__file__).parent / "scenes").glob("*.toml"))}


def shipped_scenes() -> dict[str, str]:
    """name -> title of the scenes that come with the package."""
    return {name: load_scene(name).file.title for name in shipped()}


def load_scene(source: str, *, t_end: float | None = None, modes: int | None = None) -> Scene:
    """Load a shipped scene or a TOML file; ``t_end`` [s] and ``modes`` replace the values of the file."""
    path, data = scene_data(source)
    if modes is not None:
        data["modes"] = modes
    if t_end is not None and isinstance(data.get("outputs", {}), dict):
        data["outputs"] = data.get("outputs", {}) | {"t_end": t_end}
    return scene_of(path, data)


def scene_data(source: str, folder: Path | None = None) -> tuple[Path, dict[str, Any]]:
    """Path and raw content, base included, of a shipped scene or of a TOML file (relative to ``folder``)."""
    known = shipped()
    path = known.get(source, (folder or Path()) / source)
    if not path.is_file():
        raise MultiPhiValueError(f"SCENE: got {source!r}, need a TOML file or {one_of(source, known)}")
    data = read_toml(path)
    if "scene" in data and "structure" not in data:
        raise MultiPhiValueError(f"{path}: got a study, need a scene (a study is run by the command study)")
    return path, _with_base(path, data)


def _with_base(path: Path, data: dict[str, Any]) -> dict[str, Any]:
    """Content of a file merged into that of its field ``base``; the fields of the file replace those of the base."""
    if "base" not in data:
        return data
    base, known = data.pop("base"), shipped()
    if base not in list(known):
        raise MultiPhiValueError(f"{path}: base: got {base!r}, need {one_of(base, known)}")
    content = read_toml(known[base])
    if "base" in content:
        raise MultiPhiValueError(f"{path}: base: got {base!r}, need a scene that has no base itself")
    return content | data


def scene_of(path: Path, data: Mapping[str, Any]) -> Scene:
    """Validate raw content as a scene; ``path`` is the file named in errors."""
    scene = Scene(path.stem, path, validated(SceneFile, path, data))
    file, names = scene.file, list(scene.models)
    if file.start is None and not file.loads:
        raise MultiPhiValueError(f"{path}: start: got nothing, need a value, or loads")
    coarser = () if file.comparison.coarser is None else (file.comparison.coarser,)
    parts = {"reference": (file.comparison.reference,), "coarser": coarser, "cheapest": file.comparison.cheapest}
    for part, name in [(part, name) for part, given in parts.items() for name in given]:
        if name not in names:
            refuse(scene, f"comparison.{part}", name, one_of(name, names, "models"))
    first: dict[str, ModelSpec] = {}
    for i, model in enumerate(map(scene.with_modes, file.models)):
        if first.setdefault(model.name, model) != model:
            refuse(scene, f"models[{i}].name", model.name, "another name for each model")
    if file.outputs.t_end / file.outputs.interval > MOST_SAMPLES:
        need = f"at least {file.outputs.t_end / MOST_SAMPLES:g} s for this t_end"
        refuse(scene, "outputs.interval", file.outputs.interval, need)
    return scene


def refuse(scene: Scene, field: str, given: object, needed: str) -> NoReturn:
    """Raise the one-line error of a wrong field."""
    raise MultiPhiValueError(f"{scene.path}: {field}: got {given!r}, need {needed}")


# mechanics


def mechanics_of(scene: Scene) -> Mechanics:
    """Build and check what ``scene`` describes; raises MultiPhiValueError naming file and field."""
    file, path = scene.file, scene.path
    structure = inside(f"{path}: structure", file.structure.build, path.parent)
    contacts = [inside(f"{path}: contacts[{i}]", one.build) for i, row in enumerate(file.contacts) for one in row.row]
    mechanics = replace(
        structure,
        contacts=(*structure.contacts, *contacts),
        force_laws=tuple(inside(f"{path}: force_laws[{i}]", law.build) for i, law in enumerate(file.force_laws)),
        frictions=tuple(inside(f"{path}: friction[{i}]", each.build) for i, each in enumerate(file.friction)),
        loads=file.loads,
        damping=structure.damping if file.damping is None else file.damping.build(),
        assumptions=(*structure.assumptions, *(_assumptions(file) if structure.parameter_set else ())),
    )
    _check_points(scene, mechanics)
    _check_names(scene, mechanics)
    _check_printed(scene, mechanics)
    loads_of(scene, None if mechanics.beams is None else np.zeros(0))  # the mesh gives the direction for beams later
    for i, model in enumerate(file.models):
        for field, given, needed in model.faults(mechanics):
            refuse(scene, f"models[{i}]{field}" if field.startswith(".") else field, given, needed)
    return mechanics


def loads_of(scene: Scene, transverse: np.ndarray | None) -> tuple[Load, ...]:
    """Build the loads in the order of the file.

    transverse: unit rigid-body motion along +z, which depends on the mesh; None for a structure that has none.
    """
    folder = scene.path.parent
    return tuple(
        inside(f"{scene.path}: loads[{i}]", load.build, folder, transverse) for i, load in enumerate(scene.file.loads)
    )


def _assumptions(file: SceneFile) -> Iterator[str]:
    """Assumptions of a scene of the rig beyond those of the rig."""
    if file.start is not None:
        yield f"start of this scene: static, {file.start.phrase()} (assumed: no number is printed)"
    for law in file.force_laws:
        yield f"force law of this scene: {law.phrase()} (assumed: the paper's rig has none)"
    for friction in file.friction:
        yield f"friction of this scene: {friction.phrase()} (assumed: the paper's rig has none)"
    for load in file.loads:
        yield f"load of this scene: {load.phrase()} (assumed: the paper's rig is only released)"
    stiffness = getattr(file.structure, "support_stiffness", math.inf)
    if math.isfinite(stiffness):
        yield (
            f"support stiffness: {stiffness:g} N/m (assumed: the paper's support is ideally rigid, "
            "a penalty contact element needs a number)"
        )


def _check_points(scene: Scene, mechanics: Mechanics) -> None:
    """Check that all points and contacts named in the file exist; one error lists all unknown points."""
    file = scene.file
    tables: list[tuple[str, Table | None]] = [("start", file.start), ("outputs", file.outputs)]
    tables += [(f"contacts[{i}]", spec) for i, row in enumerate(file.contacts) for spec in row.row]
    for group in ("friction", "force_laws", "loads"):
        tables += [(f"{group}[{i}]", spec) for i, spec in enumerate(getattr(file, group))]
    named = [(f"{place}.{field}", name) for place, table in tables for field, name in _named_points(table)]
    unknown = dict.fromkeys((field, name) for field, name in named if name not in mechanics.points)
    faults = [f"{field}: got {name!r}, need {one_of(name, mechanics.points, 'points')}" for field, name in unknown]
    if faults:
        raise MultiPhiValueError(f"{scene.path}: {'; '.join(faults)}")
    contacts = [contact.name for contact in mechanics.contacts]
    for i, load in enumerate(file.loads):
        stop = getattr(load, "contact", None)
        used = [("contact", stop)] if stop else [("fixed_stops", name) for name in getattr(load, "fixed_stops", ())]
        for part, name in used:
            if name not in contacts:
                refuse(scene, f"loads[{i}].{part}", name, one_of(name, contacts, "contacts"))


def _named_points(table: Table | None) -> Iterator[tuple[str, str]]:
    """(field, name) of every point that a table names."""
    for field in OF_POINTS:
        value = getattr(table, field, None) or ()
        if isinstance(value, tuple):
            yield from ((f"{field}[{i}]", name) for i, name in enumerate(value))
        else:
            yield from ((field, name) for name in ([value] if isinstance(value, str) else value))


def _check_names(scene: Scene, mechanics: Mechanics) -> None:
    """Check that the names of contacts, force laws and frictions differ."""
    named = [("contacts", contact.name) for contact in mechanics.contacts]
    named += [(f"force_laws[{i}].name", law.name) for i, law in enumerate(mechanics.force_laws)]
    named += [(f"friction[{i}].name", friction.name) for i, friction in enumerate(mechanics.frictions)]
    names = [name for _, name in named]
    for i, (field, name) in enumerate(named):
        if name in names[:i]:
            refuse(scene, field, name, "another name for each contact, force law and friction")


def _check_printed(scene: Scene, mechanics: Mechanics) -> None:
    """Check that a scene with printed frequencies has a rigid clamp, no force laws and no friction."""
    if not mechanics.has_printed_frequencies:
        return
    for field, elements in (("force_laws", mechanics.force_laws), ("friction", mechanics.frictions)):
        for element in elements:
            refuse(scene, f"{field}[0].name", element.name, f"no {field}: the printed frequencies are without")
    for name in ("clamp_translation", "clamp_rotation"):
        if math.isfinite(stiffness := getattr(scene.file.structure, name)):
            refuse(scene, f"structure.{name}", stiffness, "'rigid': the printed frequencies are of a rigid clamp")
