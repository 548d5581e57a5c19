"""The file of a study, and the cases it asks for: the parameters of each run, and the scene of each run.

    {"scene": name, "content": hash, "at": {field: value}, "method": name, "setting": {field: value},
     "nearby": {field: factor}}

content is a hash of the scene with the study's changes, the reference, the method's model, the files of matrices, the
time limit, and the versions of this package and of Exudyn: a stored run is reused only if all of these are the same.
The method "reference" is the scene's reference at that point of the axes, "coarser" its copy; "in turns" has
"cases": the parameters of the runs that are timed in turns.
"""

from __future__ import annotations

import copy
import functools
import hashlib
import itertools
import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.mechanics.arguments import one_of
from multiphi_exudyn.study.runs import machine
from multiphi_exudyn.study.scene import (
    Scene,
    SceneFile,
    mechanics_of,
    read_toml,
    scene_data,
    scene_of,
    validated,
    with_value,
)
from multiphi_exudyn.study.scene_tables import Finite, Positive, Table
from multiphi_exudyn.study.sweep import grid

__all__ = [
    "CASE",
    "COARSER",
    "REFERENCE",
    "TURNS",
    "MethodSpec",
    "Parameters",
    "QuickSpec",
    "Study",
    "StudyFile",
    "is_number",
    "load_study",
    "shipped_studies",
]


REFERENCE, COARSER = "reference", "coarser"  # methods of their own in every study

Value = Annotated[int, Field(strict=True)] | Finite | str | bool | dict[str, Any] | list[Any]
Values = Annotated[tuple[Value, ...], Field(min_length=1)]
Factors = Annotated[tuple[Positive, ...], Field(min_length=1)]


class MethodSpec(Table):
    """One method: a model as in a scene file (without a name), and the axes of its settings."""

    name: Annotated[str, Field(min_length=1)]
    model: dict[str, Any]  # as an entry of models in a scene
    axes: dict[str, Values] = Field(default_factory=dict)  # field of the model -> values, in every combination
    nearby: dict[str, Factors] = Field(default_factory=dict)  # field -> factors on its value
    refine: str | None = None  # its field in which all finer settings have to hold too: a smaller step, more modes
    quick: dict[str, Values] = Field(default_factory=dict)  # axes of the short form, in place of those of the same name


class QuickSpec(Table):
    """What the short form of a study changes."""

    change: dict[str, Any] = Field(default_factory=dict)  # field of the scene -> value
    axes: dict[str, Values] = Field(default_factory=dict)  # place in the scene -> values, in place of the same axis


class StudyFile(Table):
    """A whole study file.

    scene: a shipped scene or a TOML file beside the study. change: field -> value, for all runs. axes: field -> values;
    every method runs at every combination of them. reference, coarser: models that take the place of the scene's own
    reference and its coarser copy; a reference without a copy has no uncertainty.
    window [s]: the errors that are ranked are those from 0 to here. tolerances: for which the cheapest settings are
    looked up. time_limit_s: of one run, wall clock. timing: whether settings are timed, alone on the machine.
    histories: keep those of every run. maps: methods whose time-frequency maps are drawn, each at its most accurate
    setting, beside the reference's.
    """

    title: Annotated[str, Field(min_length=1)]  # the heading of its report
    scene: str  # a shipped scene, or a TOML file beside the study
    change: dict[str, Any] = Field(default_factory=dict)  # field of the scene -> value, for all runs
    axes: dict[str, Values] = Field(default_factory=dict)  # place in the scene -> values
    reference: dict[str, Any] | None = None
    coarser: dict[str, Any] | None = None
    methods: Annotated[tuple[MethodSpec, ...], Field(min_length=1)]
    window: Positive | None = None  # s; errors are ranked from 0 to here
    tolerances: Annotated[tuple[Positive, ...], Field(min_length=1)] = (0.1, 0.05, 0.02, 0.01)
    time_limit_s: Positive = 300.0  # s, wall clock of one run
    timing: bool = True
    histories: bool = False
    maps: tuple[str, ...] = ()
    quick: QuickSpec = QuickSpec()


def is_number(value: Any) -> bool:
    """Whether a field's value is a number, and not True or False."""
    return isinstance(value, (int, float)) and not isinstance(value, bool)


CASE = "case"  # name of the model that a case runs
TURNS = "in turns"  # method of settings that are timed together
DEFAULT_MODES = SceneFile.model_fields["modes"].default
MOST_RUNS = 1_000_000  # of a study: more is probably a typing error

Parameters = dict[str, Any]


@dataclass(frozen=True)
class Study:
    """A validated study: name, path and content of its file; path and raw content of its scene with the changes.

    quick: whether it is the short form.
    """

    name: str
    path: Path
    file: StudyFile
    scene_path: Path
    scene: Mapping[str, Any]
    quick: bool = False

    @functools.cached_property
    def _matrices(self) -> list[str]:
        """Hashes of the scene's files of matrices and rows; empty without such files."""
        structure = self.scene.get("structure", {})
        matrices = structure.get("matrices", "")
        names = [matrices] if isinstance(matrices, str) else [*matrices.values(), *structure.get("points", {}).values()]
        files = [self.scene_path.parent / name for name in names if isinstance(name, str)]
        return [hashlib.sha256(file.read_bytes()).hexdigest() for file in files if file.is_file()]

    @property
    def points(self) -> list[dict[str, Any]]:
        """Every combination of the values on the scene's axes."""
        return grid(self.file.axes | (self.file.quick.axes if self.quick else {}))

    def reference(self, at: Mapping[str, Any]) -> Parameters:
        """The reference at one point of the axes."""
        return self._case(at, REFERENCE, {}, {})

    def runs(self, at: Mapping[str, Any]) -> list[Parameters]:
        """The reference's coarser copy, then every method's settings with those nearby, at one point of the axes."""
        coarser = [COARSER] if self.scene["comparison"].get("coarser") is not None else []
        return [self._case(at, name, {}, {}) for name in coarser] + [
            self._case(at, method.name, setting, nearby)
            for method in self.file.methods
            for setting in self._settings(method)
            for nearby in _nearby(method)
        ]

    def turns(self, at: Mapping[str, Any], cases: Sequence[Parameters]) -> Parameters:
        """The case that times these cases in turns, at one point of the axes."""
        return {**self._case(at, TURNS, {}, {}), "cases": list(cases)}

    def scene_for(self, parameters: Mapping[str, Any]) -> Scene:
        """Scene of a case: the models named in its comparison, and the model of the case under the name CASE."""
        data = copy.deepcopy(dict(self.scene))
        for field, value in parameters["at"].items():
            _put(data, field, value)
        parts = data["comparison"]
        names = {parts["reference"], parts.get("coarser"), *parts.get("cheapest", ())}
        models = [m for m in data["models"] if _name(m, data) in names]
        if parameters["method"] not in (REFERENCE, COARSER):
            models.append(self._model(parameters) | {"name": CASE})
        return scene_of(self.scene_path, data | {"models": models})

    def model_name(self, parameters: Mapping[str, Any]) -> str:
        """Name of the model, in its scene, that a case runs."""
        parts = self.scene["comparison"]
        return {REFERENCE: parts["reference"], COARSER: parts.get("coarser")}.get(parameters["method"], CASE)

    def _model(self, parameters: Mapping[str, Any]) -> dict[str, Any]:
        method = next(method for method in self.file.methods if method.name == parameters["method"])
        model = method.model | parameters["setting"]
        return model | {field: factor * model[field] for field, factor in parameters["nearby"].items()}

    def _settings(self, method: MethodSpec) -> list[dict[str, Any]]:
        return grid(method.axes | (method.quick if self.quick else {}))

    def _case(
        self, at: Mapping[str, Any], method: str, setting: Mapping[str, Any], nearby: Mapping[str, float]
    ) -> Parameters:
        model = next((spec.model for spec in self.file.methods if spec.name == method), {})
        return {
            "scene": self.file.scene,
            "content": _hash([self.scene, model, self.file.time_limit_s, self._matrices, _versions()]),
            "at": dict(at),
            "method": method,
            "setting": dict(setting),
            "nearby": dict(nearby),
        }


def shipped_studies() -> dict[str, str]:
    """name -> title of the studies that come with the package."""
    paths = sorted(_shipped_folder().glob("*.toml"), key=lambda path: path.stem)
    return {path.stem: str(read_toml(path)["title"]) for path in paths}


def load_study(source: str, *, quick: bool = False) -> Study:
    """Load a shipped study or a TOML file, and check all its scenes.

    Raises MultiPhiValueError, one line: file, field, given value, needed value.
    """
    path = _find(source)
    raw = read_toml(path)
    if "structure" in raw and "scene" not in raw:
        raise MultiPhiValueError(f"{path}: got a scene, need a study (a scene is run by the command compare)")
    file = validated(StudyFile, path, raw)
    scene_path, data = scene_data(file.scene, path.parent)
    try:
        _change(data, file, quick)
        scene_of(scene_path, data)
    except MultiPhiValueError as error:
        message = str(error).removeprefix(f"{scene_path}: ")
        raise MultiPhiValueError(f"{path}: scene {file.scene} as the study changes it: {message}") from error
    study = Study(path.stem, path, file, scene_path, data, quick)
    _check(study)
    return study


def _change(data: dict[str, Any], file: StudyFile, quick: bool) -> None:
    """Make the changes of a study in the content of its scene."""
    for field, value in (file.change | (file.quick.change if quick else {})).items():
        _put(data, field, value)
    _put(data, "outputs.tolerances", list(file.tolerances))
    if file.reference is not None:
        _put_reference(data, file)
    if file.window is not None:
        _put(data, "outputs.windows", [file.window])


def _check(study: Study) -> None:
    """Check names, sizes and all scenes of a study; one error lists all faults."""
    if faults := [*_faults_of_methods(study), *_faults_of_size(study)] or [*_faults_of_scenes(study)]:
        raise MultiPhiValueError(f"{study.path}: {'; '.join(faults)}")


def _faults_of_methods(study: Study) -> Iterator[str]:
    names = [method.name for method in study.file.methods]
    for name in dict.fromkeys(names):
        if names.count(name) > 1 or name in (REFERENCE, COARSER, TURNS):
            needed = "another name for each method, none of them reference, coarser or in turns"
            yield _fault("methods", name, needed)
    for name in study.file.maps:
        if name not in names:
            yield _fault("maps", name, f"one of the methods: {', '.join(names)}")
    if study.file.coarser is not None and study.file.reference is None:
        yield _fault("reference", "none", "a reference, as the study gives a coarser copy of it")
    for method in study.file.methods:
        fields = [("nearby", field) for field in method.nearby] + [("refine", method.refine)] * bool(method.refine)
        for kind, field in fields:
            if not all(is_number(value) for value in method.axes.get(field or "", [method.model.get(field or "")])):
                yield _fault(f"{kind} of {method.name}", field, "a field of its model or its axes with numbers")


def _faults_of_size(study: Study) -> Iterator[str]:
    if "outputs.t_end" in study.file.axes and study.file.window is None:
        yield _fault("window", "none", "a window no longer than the shortest t_end of the axis outputs.t_end")
    axes = [study.file.axes, *(method.axes for method in study.file.methods)]
    points, *settings = (math.prod(map(len, each.values())) for each in axes)
    runs = points * sum(settings)
    if runs > MOST_RUNS:
        yield _fault("axes", f"{runs} runs", f"at most {MOST_RUNS}")


def _name(model: Mapping[str, Any], scene: Mapping[str, Any]) -> str:
    """Name of a model with its number of modes."""
    modes = model.get("modes", scene.get("modes", DEFAULT_MODES))
    return str(model.get("name")).replace("{modes}", str(modes))


def _faults_of_scenes(study: Study) -> Iterator[str]:
    """Faults of the scene at the first wrong point of the axes, and of the first wrong setting of each method.

    Settings are checked at the first point of the axes, or in the unchanged scene if the points are wrong.
    """
    faults = list(itertools.islice(_scene_faults(study, map(study.reference, study.points)), 1))
    yield from faults
    for _, cases in itertools.groupby(study.runs({} if faults else study.points[0]), lambda case: case["method"]):
        yield from itertools.islice(_scene_faults(study, cases), 1)


def _scene_faults(study: Study, cases: Iterable[Parameters]) -> Iterator[str]:
    """Faults of the scenes of cases."""
    for case in cases:
        try:
            mechanics_of(study.scene_for(case))
        except MultiPhiValueError as error:
            yield f"at {_place(case)}: {str(error).removeprefix(f'{study.scene_path}: ')}"


def _place(case: Mapping[str, Any]) -> str:
    """A case as text."""
    fields = {**case["at"], **case["setting"]}
    return " ".join([case["method"], *(f"{field}={value}" for field, value in fields.items())])


def _nearby(method: MethodSpec) -> list[dict[str, float]]:
    """Factors of the setting itself ({}) and of its neighbours; all fields change together."""
    count = max((len(factors) for factors in method.nearby.values()), default=0)
    return [{}] + [
        {field: factors[i] for field, factors in method.nearby.items() if i < len(factors)} for i in range(count)
    ]


def _put_reference(data: dict[str, Any], file: StudyFile) -> None:
    """Replace the models of the scene by the study's reference and its coarser copy."""
    specs = {REFERENCE: file.reference, COARSER: file.coarser}
    models = {name: model for name, model in specs.items() if model is not None}
    data["models"] = [model | {"name": name} for name, model in models.items()]
    data["comparison"] = {name: name for name in models}


def _put(data: dict[str, Any], field: str, value: Any) -> None:
    """Set a field of the scene."""
    data.update(with_value(data, field, value))


def _hash(content: Any) -> str:
    text = json.dumps(content, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


@functools.cache
def _versions() -> dict[str, str]:
    versions = machine()["versions"]
    return {name: versions[name] for name in ("multiphi-exudyn", "exudyn")}


def _shipped_folder() -> Path:
    return Path(str(resources.files("multiphi_exudyn.study"))) / "studies"


def _find(source: str) -> Path:
    shipped = sorted(path.stem for path in _shipped_folder().glob("*.toml"))
    if source in shipped:
        return _shipped_folder() / f"{source}.toml"
    if Path(source).is_file():
        return Path(source)
    raise MultiPhiValueError(f"STUDY: got {source!r}, need a TOML file or {one_of(source, shipped)}")


def _fault(field: str, given: object, needed: str) -> str:
    return f"{field}: got {given!r}, need {needed}"
