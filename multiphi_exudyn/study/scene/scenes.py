"""Load scenes by name or path and validate them; every error is one line with file and field."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any, NoReturn

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.mechanics.arguments import one_of
from multiphi_exudyn.study.scene.model_kinds import ModelSpec
from multiphi_exudyn.study.scene.scene_file import SceneFile
from multiphi_exudyn.study.scene.toml_file import read_toml, validated

__all__ = ["Scene", "load_scene", "refuse", "scene_data", "scene_of", "shipped_scenes"]

MOST_SAMPLES = 10_000_000  # of one history: more is probably a typing error


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


def shipped_scenes() -> dict[str, str]:
    """name -> title of the scenes that come with the package."""
    return {name: load_scene(name).file.title for name in _shipped()}


def load_scene(source: str, *, t_end: float | None = None, modes: int | None = None) -> Scene:
    """Load a shipped scene or a TOML file; ``t_end`` [s] and ``modes`` replace the values of the file.

    Raises MultiPhiValueError, one line: file, field, given value, needed value.
    """
    path, data = scene_data(source)
    if modes is not None:
        data["modes"] = modes
    if t_end is not None and isinstance(data.get("outputs", {}), dict):
        data["outputs"] = data.get("outputs", {}) | {"t_end": t_end}
    return scene_of(path, data)


def scene_data(source: str, folder: Path | None = None) -> tuple[Path, dict[str, Any]]:
    """Path and raw content, base included, of a shipped scene or of a TOML file (relative to ``folder``)."""
    path = _find(source, folder or Path())
    data = read_toml(path)
    if "scene" in data and "structure" not in data:
        raise MultiPhiValueError(f"{path}: got a study, need a scene (a study is run by the command study)")
    return path, _with_base(path, data)


def scene_of(path: Path, data: Mapping[str, Any]) -> Scene:
    """Validate raw content as a scene; ``path`` is the file named in errors."""
    scene = Scene(path.stem, path, validated(SceneFile, path, data))
    _check(scene)
    return scene


def refuse(scene: Scene, field: str, given: object, needed: str) -> NoReturn:
    """Raise the one-line error of a wrong field."""
    raise MultiPhiValueError(f"{scene.path}: {field}: got {given!r}, need {needed}")


def _shipped() -> dict[str, Path]:
    """name -> file, in alphabetical order."""
    folder = Path(str(resources.files("multiphi_exudyn.study.scene"))) / "shipped"
    return {path.stem: path for path in sorted(folder.glob("*.toml"), key=lambda path: path.stem)}


def _find(source: str, folder: Path) -> Path:
    shipped = _shipped()
    if source in shipped:
        return shipped[source]
    if (folder / source).is_file():
        return folder / source
    raise MultiPhiValueError(f"SCENE: got {source!r}, need a TOML file or {one_of(source, shipped)}")


def _with_base(path: Path, data: dict[str, Any]) -> dict[str, Any]:
    """Content of a file merged into that of its field ``base``; the fields of the file replace those of the base."""
    if "base" not in data:
        return data
    base, shipped = data.pop("base"), _shipped()
    if base not in list(shipped):
        raise MultiPhiValueError(f"{path}: base: got {base!r}, need {one_of(base, shipped)}")
    content = read_toml(shipped[base])
    if "base" in content:
        raise MultiPhiValueError(f"{path}: base: got {base!r}, need a scene that has no base itself")
    return content | data


def _check(scene: Scene) -> None:
    """Check what concerns several fields: a start or loads, names of models, size of the histories."""
    file = scene.file
    if file.start is None and not file.loads:
        raise MultiPhiValueError(f"{scene.path}: start: got nothing, need a value, or loads")
    names = list(scene.models)
    parts = {"reference": (file.comparison.reference,), "cheapest": file.comparison.cheapest}
    if file.comparison.coarser is not None:
        parts["coarser"] = (file.comparison.coarser,)
    for part, model_names in parts.items():
        for name in model_names:
            if name not in names:
                refuse(scene, f"comparison.{part}", name, one_of(name, names, "models"))
    first: dict[str, ModelSpec] = {}
    for i, model in enumerate(map(scene.with_modes, file.models)):
        if first.setdefault(model.name, model) != model:
            refuse(scene, f"models[{i}].name", model.name, "another name for each model")
    if file.outputs.t_end / file.outputs.interval > MOST_SAMPLES:
        need = f"at least {file.outputs.t_end / MOST_SAMPLES:g} s for this t_end"
        refuse(scene, "outputs.interval", file.outputs.interval, need)
