"""What a scene file describes, as mechanics: beams or matrices, contacts, force laws, friction, damping, and what is
assumed.

Errors of the mechanical objects get the file and the field they came from.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TypeVar

import numpy as np
import scipy.sparse

from multiphi_exudyn.errors import MultiPhiError, MultiPhiValueError
from multiphi_exudyn.mechanics.arguments import Matrix, one_of
from multiphi_exudyn.mechanics.beam import Beam, Clamp
from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.damping import ModalDamping, RayleighDamping
from multiphi_exudyn.mechanics.force_law import ForceLaw
from multiphi_exudyn.mechanics.friction import Friction
from multiphi_exudyn.mechanics.structure import LinearStructure
from multiphi_exudyn.study.scene.demands import Demands
from multiphi_exudyn.study.scene.described import beam_of, damping_of, matrices_of
from multiphi_exudyn.study.scene.load_tables import BaseMotionSpec, StopMotionSpec
from multiphi_exudyn.study.scene.scene_file import (
    DisplacedStart,
)
from multiphi_exudyn.study.scene.scene_friction import check_friction, described_friction, friction_of
from multiphi_exudyn.study.scene.scene_laws import check_laws, described_laws, law_of
from multiphi_exudyn.study.scene.scene_loads import described_loads, loads_of
from multiphi_exudyn.study.scene.scenes import Scene, refuse
from multiphi_exudyn.study.scene.structure_tables import (
    BeamsStructure,
    MatrixStructure,
    RigStructure,
    StructureSpec,
)
from reference_models.beams import Beams, as_beams
from reference_models.rig import assumptions, published_override, rig_beam, rig_contact, rig_damping

__all__ = ["Mechanics", "mechanics_of"]

T = TypeVar("T")
Damping = Matrix | ModalDamping | RayleighDamping | None


@dataclass(frozen=True)
class Mechanics:
    """A scene's structure, given as beams or as matrices, with its contacts, force laws, friction and damping.

    parameter_set: of the paper's rig, None for any other structure.
    assumptions: what the scene rests on beyond what is known, one sentence each.
    """

    contacts: tuple[UnilateralContact, ...]
    damping: Damping
    beams: Beams | None = None
    matrices: LinearStructure | None = None
    parameter_set: str | None = None
    assumptions: tuple[str, ...] = field(default=())
    force_laws: tuple[ForceLaw, ...] = ()
    frictions: tuple[Friction, ...] = ()

    @property
    def rubbing(self) -> tuple[str, ...]:
        """Names of what has a friction force: frictions, and contacts with friction."""
        contacts = [contact.name for contact in self.contacts if contact.friction]
        return (*(friction.name for friction in self.frictions), *contacts)

    @property
    def printed(self) -> bool:
        """Whether levels have printed frequencies in place of their own."""
        return self.parameter_set is not None and bool(published_override(self.parameter_set))

    @property
    def points(self) -> tuple[str, ...]:
        """Names of the structure's points."""
        given: Mapping[str, object] = _known(self.matrices).points if self.beams is None else self.beams.points
        return tuple(given)

    @property
    def beam(self) -> Beam | None:
        """The beam, where there is one and only one."""
        return None if self.beams is None else self.beams.only

    @property
    def directions(self) -> int:
        """How many modes a level has less than the structure has DoFs: one for each contact, force law and friction."""
        return len(self.contacts) + len(self.force_laws) + len(self.frictions)


def mechanics_of(scene: Scene) -> Mechanics:
    """Build and check what ``scene`` describes; raises MultiPhiValueError naming file and field."""
    mechanics = _structure(scene, scene.file.structure)
    own = tuple(
        _at(scene, f"contacts[{i}]", partial(UnilateralContact, **spec.model_dump(exclude_defaults=True)))
        for i, row in enumerate(scene.file.contacts)
        for spec in row.row
    )
    laws = tuple(_at(scene, f"force_laws[{i}]", partial(law_of, spec)) for i, spec in enumerate(scene.file.force_laws))
    rubbing = tuple(_at(scene, f"friction[{i}]", partial(friction_of, s)) for i, s in enumerate(scene.file.friction))
    mechanics = replace(mechanics, contacts=mechanics.contacts + own, force_laws=laws, frictions=rubbing)
    if scene.file.damping is not None:
        mechanics = replace(mechanics, damping=damping_of(scene.file.damping))
    _check_points(scene, mechanics)
    _check_contacts(scene, mechanics)
    check_laws(scene, mechanics.contacts, mechanics.force_laws)
    taken = [*(contact.name for contact in mechanics.contacts), *(law.name for law in mechanics.force_laws)]
    check_friction(scene, taken, mechanics.frictions)
    _check_loads(scene, mechanics)
    _check_models(scene, mechanics)
    return mechanics


def _structure(scene: Scene, spec: StructureSpec) -> Mechanics:
    if isinstance(spec, RigStructure):
        clamp = Clamp(spec.clamp_translation, spec.clamp_rotation)
        return Mechanics(
            contacts=(rig_contact(spec.support_stiffness),),
            damping=rig_damping(),
            beams=as_beams(rig_beam(spec.rig, clamp)),
            parameter_set=spec.rig,
            assumptions=(*assumptions(spec.rig, clamp), *_scene_assumptions(scene, spec)),
        )
    if isinstance(spec, MatrixStructure):
        matrices = _at(scene, "structure", lambda: matrices_of(scene.path.parent, spec))
        return Mechanics((), matrices.damping, matrices=matrices)
    if isinstance(spec, BeamsStructure):
        parts = {n: _at(scene, f"structure.beams.{n}", partial(beam_of, part)) for n, part in spec.beams.items()}
        return Mechanics((), None, beams=_at(scene, "structure", lambda: Beams(parts, spec.ties)))
    return Mechanics((), None, beams=as_beams(_at(scene, "structure.beam", lambda: beam_of(spec.beam))))


def _scene_assumptions(scene: Scene, spec: RigStructure) -> Iterator[str]:
    """What a scene adds to the rig's own assumptions."""
    start = scene.file.start
    if isinstance(start, DisplacedStart):
        yield _assumed_start(f"{1e3 * start.displacement:+g} mm at {start.measured_at}", start.load_at)
    elif start is not None:
        yield _assumed_start(f"{start.force:+g} N", start.load_at)
    for law in described_laws(scene):
        yield f"force law of this scene: {law} (assumed: the paper's rig has none)"
    for friction in described_friction(scene):
        yield f"friction of this scene: {friction} (assumed: the paper's rig has none)"
    for load in described_loads(scene):
        yield f"load of this scene: {load} (assumed: the paper's rig is only released)"
    if math.isfinite(spec.support_stiffness):
        yield (
            f"support stiffness: {spec.support_stiffness:g} N/m (assumed: the paper's support is ideally rigid, "
            "a penalty contact element needs a number)"
        )


def _assumed_start(size: str, load_at: str) -> str:
    return f"start of this scene: {size} by a static force at {load_at} (assumed: no number is printed)"


def _check_points(scene: Scene, mechanics: Mechanics) -> None:
    """Every point named anywhere in the file is one of the structure's."""
    file = scene.file
    named = {} if file.start is None else {"start.load_at": file.start.load_at}
    if isinstance(file.start, DisplacedStart):
        named["start.measured_at"] = file.start.measured_at
    for group in ("points", "judged_points"):
        named |= {f"outputs.{group}[{i}]": name for i, name in enumerate(getattr(file.outputs, group))}
    places = [(i, spec.direction) for i, row in enumerate(file.contacts) for spec in row.row]
    for i, at in places:
        named |= {f"contacts[{i}].direction": name for name in ([at] if isinstance(at, str) else at)}
    for i, at in ((i, spec.tangential) for i, row in enumerate(file.contacts) for spec in row.row if spec.tangential):
        named |= {f"contacts[{i}].tangential": name for name in ([at] if isinstance(at, str) else at)}
    for i, friction in enumerate(file.friction):
        at = friction.direction
        named |= {f"friction[{i}].direction": name for name in ([at] if isinstance(at, str) else at)}
    for i, law in enumerate(file.force_laws):
        named |= {f"force_laws[{i}].at": name for name in ([law.at] if isinstance(law.at, str) else law.at)}
    for i, load in enumerate(file.loads):
        for part in ("at", "direction"):
            place = getattr(load, part, None) or ()
            named |= {f"loads[{i}].{part}": name for name in ([place] if isinstance(place, str) else place)}
    unknown = {field_name: name for field_name, name in named.items() if name not in mechanics.points}
    faults = [f"{at}: got {name!r}, need {one_of(name, mechanics.points, 'points')}" for at, name in unknown.items()]
    if faults:
        raise MultiPhiValueError(f"{scene.path}: {'; '.join(faults)}")


def _check_loads(scene: Scene, mechanics: Mechanics) -> None:
    """Loads name contacts there are."""
    names = [contact.name for contact in mechanics.contacts]
    for i, load in enumerate(scene.file.loads):
        moved = [("contact", load.contact)] if isinstance(load, StopMotionSpec) else []
        moved += [("fixed_stops", name) for name in load.fixed_stops] if isinstance(load, BaseMotionSpec) else []
        for part, name in moved:
            if name not in names:
                refuse(scene, f"loads[{i}].{part}", name, one_of(name, names, "contacts"))


def _check_contacts(scene: Scene, mechanics: Mechanics) -> None:
    names = [contact.name for contact in mechanics.contacts]
    for name in names:
        if names.count(name) > 1:
            refuse(scene, "contacts", name, "another name for each contact")
    _check_published(scene, mechanics)


def _check_models(scene: Scene, mechanics: Mechanics) -> None:
    """Every model can take what the scene has."""
    sparse = mechanics.matrices is not None and scipy.sparse.issparse(mechanics.matrices.stiffness)
    demands = Demands(
        given_as="beams" if mechanics.matrices is None else "sparse" if sparse else "dense",
        contacts=mechanics.contacts,
        laws=mechanics.force_laws,
        frictions=mechanics.frictions,
        loads=loads_of(scene, None if mechanics.beams is None else np.zeros(0)),
        printed=mechanics.printed,
    )
    for i, model in enumerate(scene.file.models):
        for fault in model.faults(demands):
            refuse(scene, fault.field if fault.whole else f"models[{i}].{fault.field}", fault.given, fault.needed)


def _check_published(scene: Scene, mechanics: Mechanics) -> None:
    """Printed frequencies are those of a rigid clamp and of a rigid support, and say nothing of others."""
    if not mechanics.printed:
        return
    if mechanics.force_laws:
        refuse(scene, "force_laws[0].name", mechanics.force_laws[0].name, "none: the printed frequencies have no law")
    if mechanics.frictions:
        refuse(scene, "friction[0].name", mechanics.frictions[0].name, "none: the printed frequencies have no friction")
    for name in ("translation", "rotation"):
        given = getattr(scene.file.structure, f"clamp_{name}")
        if math.isfinite(given):
            refuse(scene, f"structure.clamp_{name}", given, "'rigid': the printed frequencies are of a rigid clamp")


def _at(scene: Scene, place: str, build: Callable[[], T]) -> T:
    """What ``build`` gives; its error names file and field."""
    try:
        return build()
    except MultiPhiError as error:
        raise MultiPhiValueError(f"{scene.path}: {place}: {' '.join(str(error).split())}") from error


def _known(matrices: LinearStructure | None) -> LinearStructure:
    assert matrices is not None, "a structure is beams or matrices"
    return matrices
