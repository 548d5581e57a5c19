"""``multiphi-exudyn new | validate | schema``: write or check a scene or a study file, or print its schema."""

from __future__ import annotations

import json
from pathlib import Path

from pydantic import BaseModel

from multiphi_exudyn import study
from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.files import write_whole
from multiphi_exudyn.study.accuracy.cases import Study, load_study, shipped_studies
from multiphi_exudyn.study.accuracy.study_file import StudyFile
from multiphi_exudyn.study.scene import SceneFile, load_scene, read_toml
from multiphi_exudyn.study.setup import prepare

__all__ = ["KINDS", "run_new", "run_schema", "run_validate"]

KINDS: dict[str, type[BaseModel]] = {"scene": SceneFile, "study": StudyFile}
TEMPLATES = Path(study.__file__).parent / "templates"


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


def run_schema(kind: str) -> bool:
    """Print the JSON schema of a file, for editors."""
    schema = json.dumps(KINDS[kind].model_json_schema())
    print(json.dumps(json.loads(schema, parse_constant=lambda infinite: "rigid"), indent=1))
    return True


def _write_template(kind: str, path: Path) -> None:
    if path.exists():
        raise MultiPhiValueError(f"FILE: got {str(path)!r}, which exists already, need another name")
    try:
        write_whole(path, (TEMPLATES / f"{kind}.toml").read_bytes())
    except OSError as error:
        raise MultiPhiValueError(f"FILE: got {str(path)!r}, need a folder that can be written") from error
    print(path)


def _of_scene(source: str) -> str:
    scene = load_scene(source)
    setup = prepare(scene)
    contacts = ", ".join(contact.name for contact in setup.mechanics.contacts) or "none"
    return f"a scene of {setup.structure.n} degrees of freedom; contacts: {contacts}; models: {', '.join(scene.models)}"


def _of_study(given: Study) -> str:
    axes = " x ".join(f"{len(values)} of {axis}" for axis, values in given.file.axes.items()) or "no axes"
    runs = len(given.budgets()) + sum(1 + len(given.runs(at)) for at in given.points if given.file.methods)
    return f"a study of {len(given.points)} points ({axes}), {runs} runs"
