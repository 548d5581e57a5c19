"""Scenes: found by name or path, read, validated; every error is one line naming file and field."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any, NoReturn

from pydantic import ValidationError

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.study.scene.scene_file import FullModel, ReducedModel, SceneFile, UserObjectModel

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

__all__ = ["ModelSpec", "Scene", "load_scene", "refuse", "shipped_scenes"]

ModelSpec = ReducedModel | UserObjectModel | FullModel

MOST_SAMPLES = 10_000_000  # of one history: beyond that a typing error is likelier than a wish


@dataclass(frozen=True)
class Scene:
    """A validated scene: its name, the file it came from, and the file's content."""

    name: str
    path: Path
    file: SceneFile

    @property
    def models(self) -> dict[str, ModelSpec]:
        """name -> model in the file's order, numbers of modes filled in; equal ones appear once."""
        return {model.name: model for model in map(self.filled, self.file.models)}

    def filled(self, model: ModelSpec) -> ModelSpec:
        """The model with its number of modes, and that number in its name."""
        if isinstance(model, FullModel):
            return model
        modes = self.file.modes if model.modes is None else model.modes
        return model.model_copy(update={"modes": modes, "name": model.name.replace("{modes}", str(modes))})


def shipped_scenes() -> dict[str, str]:
    """name -> title of the scenes that come with the package."""
    files = sorted((p for p in _shipped_folder().iterdir() if p.suffix == ".toml"), key=lambda p: p.stem)
    return {path.stem: load_scene(path.stem).file.title for path in files}


def load_scene(source: str, *, t_end: float | None = None, modes: int | None = None) -> Scene:
    """The scene of a shipped name or a TOML file, with its end time and number of modes replaced.

    Raises MultiPhiValueError, one line: file, field, what was given, what is needed.
    """
    path = _find(source)
    data = _with_base(path, _read(path))
    if modes is not None:
        data["modes"] = modes
    if t_end is not None and isinstance(data.get("outputs", {}), dict):
        data["outputs"] = data.get("outputs", {}) | {"t_end": t_end}
    scene = Scene(path.stem, path, _validated(path, data))
    _check(scene)
    return scene


def refuse(scene: Scene, field: str, given: object, needed: str) -> NoReturn:
    """Raise the one-line error of a wrong field."""
    raise MultiPhiValueError(f"{scene.path}: {field}: got {given!r}, need {needed}")


def _shipped_folder() -> Path:
    return Path(str(resources.files("multiphi_exudyn.study.scene"))) / "shipped"


def _find(source: str) -> Path:
    shipped = sorted(path.stem for path in _shipped_folder().glob("*.toml"))
    if source in shipped:
        return _shipped_folder() / f"{source}.toml"
    if Path(source).is_file():
        return Path(source)
    raise MultiPhiValueError(f"SCENE: got {source!r}, need a TOML file or one of: {', '.join(shipped)}")


def _read(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError, RecursionError) as error:
        raise MultiPhiValueError(f"{path}: got {_one_line(error)}, need a readable TOML file") from error


def _with_base(path: Path, data: dict[str, Any]) -> dict[str, Any]:
    """The scene a file is a variant of (its field ``base``), the file's own fields in place of its fields."""
    if "base" not in data:
        return data
    base = data.pop("base")
    shipped = sorted(path.stem for path in _shipped_folder().glob("*.toml"))
    if base not in shipped:
        raise MultiPhiValueError(f"{path}: base: got {base!r}, need one of: {', '.join(shipped)}")
    content = _read(_shipped_folder() / f"{base}.toml")
    if "base" in content:
        raise MultiPhiValueError(f"{path}: base: got {base!r}, need a scene that has no base itself")
    return content | data


def _validated(path: Path, data: Mapping[str, Any]) -> SceneFile:
    try:
        return SceneFile.model_validate_json(json.dumps(data, default=str))
    except ValidationError as error:
        raise MultiPhiValueError(f"{path}: {_complaint(error, data)}") from error


def _complaint(error: ValidationError, data: Mapping[str, Any]) -> str:
    """The first wrong field: what was given, what is needed, and how many more there are."""
    found: dict[str, tuple[str, list[str]]] = {}
    for item in error.errors(include_url=False):
        missing = item["type"] == "missing"
        field = _field(item["loc"], data, missing)
        given = "nothing" if missing else _one_line(repr(item["input"]))
        found.setdefault(field, (given, []))[1].append(_needed(item))
    field, (given, needs) = next(iter(found.items()))
    more = f" (and {len(found) - 1} more)" if len(found) > 1 else ""
    return f"{field}: got {given}, need {' or '.join(dict.fromkeys(needs))}{more}"


def _needed(item: Mapping[str, Any]) -> str:
    kinds = {
        "missing": "a value",
        "extra_forbidden": "no field of this name",
        "union_tag_invalid": f"a kind among {item.get('ctx', {}).get('expected_tags')}",
        "union_tag_not_found": "a table with the field kind",
    }
    return kinds.get(item["type"], _one_line(item["msg"]).removeprefix("Input should be "))


def _field(location: Sequence[int | str], data: Any, missing: bool) -> str:
    """Dotted place in the file, without the labels the validator gives to the branches of a union."""
    text = ""
    for i, part in enumerate(location):
        if isinstance(part, int) and isinstance(data, list):
            text += f"[{part}]"
            data = data[part]
        elif isinstance(data, Mapping) and (part in data or (missing and i == len(location) - 1)):
            text += f".{part}" if text else str(part)
            data = data.get(part)
    return text or "scene"


def _one_line(text: object) -> str:
    """At most 120 characters on one line."""
    line = " ".join(str(text).split())
    return line if len(line) <= 120 else line[:117] + "..."


def _check(scene: Scene) -> None:
    """What no single field can say: names that refer to models, and the size of the histories."""
    file = scene.file
    names = list(scene.models)
    parts = {"reference": (file.comparison.reference,), "cheapest": file.comparison.cheapest}
    if file.comparison.coarser is not None:
        parts["coarser"] = (file.comparison.coarser,)
    for part, given in parts.items():
        for name in given:
            if name not in names:
                refuse(scene, f"comparison.{part}", name, f"one of the models: {', '.join(names)}")
    first: dict[str, ModelSpec] = {}
    for i, model in enumerate(map(scene.filled, file.models)):
        if first.setdefault(model.name, model) != model:
            refuse(scene, f"models[{i}].name", model.name, "a name of its own for every model")
    if file.outputs.t_end / file.outputs.interval > MOST_SAMPLES:
        need = f"at least {file.outputs.t_end / MOST_SAMPLES:g} s for this t_end"
        refuse(scene, "outputs.interval", file.outputs.interval, need)
