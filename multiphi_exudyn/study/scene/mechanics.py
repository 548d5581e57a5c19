"""Build and check the mechanical model of a scene, and list its assumptions.

Errors of the mechanical objects are raised with file and field.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.mechanics.arguments import one_of
from multiphi_exudyn.study.scene.fields import Table, inside
from multiphi_exudyn.study.scene.load_tables import BaseMotionSpec, StopMotionSpec
from multiphi_exudyn.study.scene.parts import Mechanics
from multiphi_exudyn.study.scene.scene_file import SceneFile
from multiphi_exudyn.study.scene.scene_loads import load_phrases, loads_of
from multiphi_exudyn.study.scene.scenes import Scene, refuse

__all__ = ["mechanics_of"]

OF_POINTS = ("load_at", "measured_at", "points", "judged_points", "direction", "tangential", "at")


def mechanics_of(scene: Scene) -> Mechanics:
    """Build and check what ``scene`` describes; raises MultiPhiValueError naming file and field."""
    file = scene.file
    structure = inside(f"{scene.path}: structure", lambda: file.structure.build(scene.path.parent))
    contacts = [
        inside(f"{scene.path}: contacts[{i}]", spec.build) for i, row in enumerate(file.contacts) for spec in row.row
    ]
    mechanics = replace(
        structure,
        contacts=(*structure.contacts, *contacts),
        force_laws=tuple(inside(f"{scene.path}: force_laws[{i}]", s.build) for i, s in enumerate(file.force_laws)),
        frictions=tuple(inside(f"{scene.path}: friction[{i}]", s.build) for i, s in enumerate(file.friction)),
        loads=file.loads,
        damping=structure.damping if file.damping is None else file.damping.build(),
        assumptions=(*structure.assumptions, *(_assumptions(file) if structure.parameter_set else ())),
    )
    _check_points(scene, mechanics)
    _check_names(scene, mechanics)
    _check_printed(scene, mechanics)
    _check_stops(scene, mechanics)
    loads_of(scene, None if mechanics.beams is None else np.zeros(0))  # the mesh gives the direction for beams later
    for i, model in enumerate(file.models):
        for field, given, needed in model.faults(mechanics):
            refuse(scene, f"models[{i}]{field}" if field.startswith(".") else field, given, needed)
    return mechanics


def _assumptions(file: SceneFile) -> Iterator[str]:
    """Assumptions of the scene beyond those of the rig."""
    start = file.start
    if start is not None:
        given = f"{start.phrase()} by a static force at {start.load_at}"
        yield f"start of this scene: {given} (assumed: no number is printed)"
    for law in file.force_laws:
        yield f"force law of this scene: {law.phrase()} (assumed: the paper's rig has none)"
    for friction in file.friction:
        yield f"friction of this scene: {friction.phrase()} (assumed: the paper's rig has none)"
    for load in load_phrases(file.loads):
        yield f"load of this scene: {load} (assumed: the paper's rig is only released)"
    stiffness = getattr(file.structure, "support_stiffness", math.inf)
    if math.isfinite(stiffness):
        yield (
            f"support stiffness: {stiffness:g} N/m (assumed: the paper's support is ideally rigid, "
            "a penalty contact element needs a number)"
        )


def _check_points(scene: Scene, mechanics: Mechanics) -> None:
    """Check that all points named in the file exist; one error lists all unknown ones."""
    file = scene.file
    tables: list[tuple[str, Table | None]] = [("start", file.start), ("outputs", file.outputs)]
    tables += [(f"contacts[{i}]", spec) for i, row in enumerate(file.contacts) for spec in row.row]
    for group in ("friction", "force_laws", "loads"):
        tables += [(f"{group}[{i}]", spec) for i, spec in enumerate(getattr(file, group))]
    point_names = [(f"{place}.{field}", name) for place, table in tables for field, name in _named_points(table)]
    unknown = dict.fromkeys((field, name) for field, name in point_names if name not in mechanics.points)
    faults = [f"{field}: got {name!r}, need {one_of(name, mechanics.points, 'points')}" for field, name in unknown]
    if faults:
        raise MultiPhiValueError(f"{scene.path}: {'; '.join(faults)}")


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
    names = [contact.name for contact in mechanics.contacts]
    for name in names:
        if names.count(name) > 1:
            refuse(scene, "contacts", name, "another name for each contact")
    for i, law in enumerate(mechanics.force_laws):
        if law.name in names:
            refuse(scene, f"force_laws[{i}].name", law.name, f"another name: there is a {law.name} already")
        names.append(law.name)
    for i, friction in enumerate(mechanics.frictions):
        if friction.name in names:
            needed = "another name for each contact, force law and friction"
            refuse(scene, f"friction[{i}].name", friction.name, needed)
        names.append(friction.name)


def _check_printed(scene: Scene, mechanics: Mechanics) -> None:
    """Check that a scene with printed frequencies has a rigid clamp, no force laws and no friction."""
    if not mechanics.has_printed_frequencies:
        return
    if mechanics.force_laws:
        refuse(scene, "force_laws[0].name", mechanics.force_laws[0].name, "none: the printed frequencies have no law")
    if mechanics.frictions:
        refuse(scene, "friction[0].name", mechanics.frictions[0].name, "none: the printed frequencies have no friction")
    for name in ("clamp_translation", "clamp_rotation"):
        stiffness = getattr(scene.file.structure, name)
        if math.isfinite(stiffness):
            refuse(scene, f"structure.{name}", stiffness, "'rigid': the printed frequencies are of a rigid clamp")


def _check_stops(scene: Scene, mechanics: Mechanics) -> None:
    """Check that loads on stops name existing contacts."""
    names = [contact.name for contact in mechanics.contacts]
    for i, load in enumerate(scene.file.loads):
        names_used = [("contact", load.contact)] if isinstance(load, StopMotionSpec) else []
        names_used += [("fixed_stops", name) for name in load.fixed_stops] if isinstance(load, BaseMotionSpec) else []
        for part, name in names_used:
            if name not in names:
                refuse(scene, f"loads[{i}].{part}", name, one_of(name, names, "contacts"))
