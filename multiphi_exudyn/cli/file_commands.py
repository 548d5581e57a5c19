"""``multiphi-exudyn new | validate | schema``: write or check a scene or a study file, or print its schema."""

from __future__ import annotations

import json
from importlib import resources
from pathlib import Path

from pydantic import BaseModel

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.files import write_whole
from multiphi_exudyn.study.accuracy.cases import Study, load_study, shipped_studies
from multiphi_exudyn.study.accuracy.study_file import StudyFile
from multiphi_exudyn.study.scene.file_reference import file_reference
from multiphi_exudyn.study.scene.mechanics import mechanics_of
from multiphi_exudyn.study.scene.scene_file import SceneFile
from multiphi_exudyn.study.scene.scenes import load_scene
from multiphi_exudyn.study.scene.toml_file import read_toml
from multiphi_exudyn.study.scene.workbench import prepare

__all__ = ["KINDS", "run_new", "run_schema", "run_validate"]

KINDS: dict[str, tuple[str, type[BaseModel]]] = {
    "scene": ("multiphi_exudyn.study.scene", SceneFile),
    "study": ("multiphi_exudyn.study.accuracy", StudyFile),
}


def run_new(kind: str, path: Path | None) -> bool:
    """Write a valid template; for a study also its scene, if the file does not exist."""
    path = path or Path(f"{kind}.toml")
    scene = path.parent / "scene.toml"
    _write_template(kind, path)
    if kind == "study" and not scene.exists():
        _write_template("scene", scene)
    return True


def run_validate(source: str) -> bool:
    """Check a scene or a study without a run, from a file or shipped, and print a summary of it."""
    file = Path(source)
    is_study = source in shipped_studies() or (file.is_file() and "scene" in read_toml(file))
    print(f"{source}: valid, {_of_study(load_study(source)) if is_study else _of_scene(source)}")
    return True


def run_schema(kind: str, markdown: bool) -> bool:
    """Print the JSON schema of a file, for editors, or a page with its fields."""
    if markdown:
        print(file_reference(KINDS[kind][1], f"The fields of a {kind} file"))
        return True
    schema = json.dumps(KINDS[kind][1].model_json_schema())
    print(json.dumps(json.loads(schema, parse_constant=lambda infinite: "rigid"), indent=1))
    return True


def _write_template(kind: str, path: Path) -> None:
    if path.exists():
        raise MultiPhiValueError(f"FILE: got {str(path)!r}, which exists already, need another name")
    template = resources.files(KINDS[kind][0]) / "templates" / f"{kind}.toml"
    try:
        write_whole(path, template.read_bytes())
    except OSError as error:
        raise MultiPhiValueError(f"FILE: got {str(path)!r}, need a folder that can be written") from error
    print(path)


def _of_scene(source: str) -> str:
    scene = load_scene(source)
    setup = prepare(scene, mechanics_of(scene))
    contacts = ", ".join(contact.name for contact in setup.mechanics.contacts) or "none"
    return f"a scene of {setup.structure.n} degrees of freedom; contacts: {contacts}; models: {', '.join(scene.models)}"


def _of_study(study: Study) -> str:
    axes = " x ".join(f"{len(values)} of {axis}" for axis, values in study.file.axes.items()) or "no axes"
    runs = len(study.budgets()) + sum(1 + len(study.runs(at)) for at in study.points if study.file.methods)
    return f"a study of {len(study.points)} points ({axes}), {runs} runs"
