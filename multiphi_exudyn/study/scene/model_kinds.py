"""The tables ``[[models]]`` of a scene file: one class for each kind of model, with what it can take of a scene.

A kind says in ``lacks`` what it has not, in ``own_faults`` what else it cannot take; how it is called and run stands in
its runner (multiphi_exudyn.study.running). A new kind is a class here, its place in ``ModelSpec``, and a runner.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from multiphi_exudyn.study.scene.fields import Modes, Name, Positive, RelativeTolerance, Table
from multiphi_exudyn.study.scene.parts import Mechanics

if TYPE_CHECKING:
    from typing import Self

__all__ = ["FullModel", "ModelSpec", "ReducedModel", "UserObjectModel"]

# Field, of the model's own entry where it begins with a dot; what was given; what is needed.
Fault = tuple[str, object, str]

Lack = Literal["loads", "weight", "sparse", "matrices", "friction", "damping", "laws", "differences"]


def _reasons(lack: Lack, scene: Mechanics) -> list[str]:
    """Why a scene needs another kind of model than one that lacks something; empty where it does not."""
    rubbing = [f"the contact {contact.name} has it" for contact in scene.contacts if contact.friction]
    rubbing += [f"the scene has {friction.name}" for friction in scene.frictions]
    damped = [contact.name for contact in scene.contacts if contact.damping]
    points = {contact.name: len(_factors(contact.direction)) for contact in scene.contacts}
    reasons: dict[Lack, list[str]] = {
        "loads": ["this kind takes no loads"] if scene.loads else [],
        "weight": ["this kind takes neither gravity nor base-motion"] if scene.carried else [],
        "sparse": ["this kind takes dense matrices only"] if scene.sparse else [],
        "matrices": [] if scene.beams else ["this kind is made of beams, and the structure is given as matrices"],
        "friction": [f"this kind takes no friction, and {what}" for what in rubbing],
        "damping": [f"this kind takes no damped contacts, and {name} is damped" for name in damped],
        "laws": [f"this kind takes no force laws, and the scene has {law.name}" for law in scene.force_laws],
        "differences": [
            f"its contacts act on single points, and {name} acts on {count}"
            for name, count in points.items()
            if count > 1
        ],
    }
    return reasons[lack]


def _not_round(scene: Mechanics) -> Iterator[str]:
    """Why a round support will not do."""
    if scene.moving_stops:
        yield "a round support does not move"
    for contact in scene.contacts:
        if contact.damping:
            yield "a round support has no damping"
        if len(_factors(contact.direction)) > 1:
            yield f"a round support does not move, and {contact.name} is between two points"


def _factors(at: object) -> list[float]:
    """Coefficients of the points something acts on."""
    return list(at.values()) if isinstance(at, Mapping) else [1.0]


class _Model(Table):
    """What every kind has."""

    kind: str
    name: Name  # "{modes}" stands for the number of modes

    lacks: ClassVar[tuple[Lack, ...]] = ()
    penalty: ClassVar[bool] = False  # contacts by a finite stiffness alone

    @property
    def rigid(self) -> bool:
        """Whether it takes all contacts as rigid."""
        return getattr(self, "contact", "as-given") == "rigid"

    def filled(self, default: int) -> Self:
        """The same with its number of modes, of which ``default`` is the scene's own, and that number in its name."""
        modes = default if (given := getattr(self, "modes", None)) is None else given
        return self.model_copy(update={"modes": modes, "name": self.name.replace("{modes}", str(modes))})

    def faults(self, scene: Mechanics) -> Iterator[Fault]:
        """What it cannot take of a scene."""
        for lack in self.lacks:
            yield from (self._another(why) for why in _reasons(lack, scene))
        rigid = [contact.name for contact in scene.contacts if contact.rigid and self.penalty]
        needed = f"a finite one: contacts of the model {self.name} are penalty springs"
        yield from ((f"stiffness of contact {name}", "inf", needed) for name in rigid)
        yield from self.own_faults(scene)

    def own_faults(self, scene: Mechanics) -> Iterator[Fault]:
        """What else; nothing but for some kinds."""
        yield from ()

    def _another(self, why: str) -> Fault:
        return ".kind", self.kind, f"another kind: {why}"


class _Levels(_Model):
    """A kind with the levels of a Multi-Phi model."""

    contact: Literal["as-given", "rigid"] = "as-given"

    def own_faults(self, scene: Mechanics) -> Iterator[Fault]:
        """Printed frequencies are those of a rigid support."""
        if scene.printed and not self.rigid:
            yield ".contact", self.contact, "'rigid': the printed frequencies are of a rigid support"


class ReducedModel(_Levels):
    """A Multi-Phi model run by itself."""

    kind: Literal["reduced"]
    modes: Modes | None = None  # none given: the scene's
    tolerance: Positive | None = None  # truncation error wanted, from which the modes follow, in place of a number

    @model_validator(mode="after")
    def _one_choice_of_modes(self) -> ReducedModel:
        if self.modes is not None and self.tolerance is not None:
            raise PydanticCustomError("modes", "modes or tolerance, not both")
        return self

    def filled(self, default: int) -> ReducedModel:
        """A tolerance chooses the modes."""
        return self if self.tolerance is not None else super().filled(default)


class UserObjectModel(_Levels):
    """A Multi-Phi model as a body inside Exudyn."""

    kind: Literal["user-object"]
    step: Positive  # s
    modes: Annotated[int, Field(ge=1)] | None = None  # none given: the scene's


class FullModel(_Model):
    """The full nonlinear Exudyn beam, or beams, with contact elements."""

    kind: Literal["full"]
    beam: Literal["ancf", "geometrically-exact"] = "ancf"
    elements: Annotated[int, Field(ge=1)]  # of each beam
    step: Positive  # s
    spectral_radius: Annotated[float, Field(ge=0, le=1)] = 1.0  # of generalised-alpha; 1: the trapezoidal rule
    newton_tolerance: Positive = 1e-5  # relative and absolute
    contact: Literal["coordinate", "circle"] = "coordinate"  # element at the node, or a round support (ancf)

    lacks: ClassVar[tuple[Lack, ...]] = ("matrices",)
    penalty: ClassVar[bool] = True

    def filled(self, default: int) -> FullModel:
        """It has no modes."""
        return self

    def own_faults(self, scene: Mechanics) -> Iterator[Fault]:
        """Elements act on a point or between two; friction has a spring; a round support is at rest and undamped."""
        spring = f"a finite one: friction of the model {self.name} has a spring in series"
        for contact in scene.contacts:
            if contact.friction and math.isinf(contact.tangential_stiffness):
                yield f"tangential_stiffness of contact {contact.name}", "inf", spring
            if not _one_or_two(contact.direction):
                acts = f"{contact.name} acts on {contact.direction}"
                yield self._another(f"its contacts act on a point, or between two, and {acts}")
        for i, friction in enumerate(scene.frictions):
            if friction.rigid:
                yield f"friction[{i}].stiffness", "inf", spring
            if not _one_or_two(friction.direction):
                acts = f"{friction.name} acts on {len(_factors(friction.direction))}"
                yield self._another(f"its friction acts on a point, or between two, and {acts}")
        for law in scene.force_laws:
            if (points := len(_factors(law.at))) > 1:
                yield self._another(f"its force laws act on single points, and {law.name} acts on {points}")
        if self.contact == "circle":
            yield from ((".contact", "circle", f"'coordinate': {why}") for why in _not_round(scene))


def _one_or_two(at: object) -> bool:
    """Whether something acts on a point, or on the difference of two."""
    given = _factors(at)
    return len(given) == 1 or (len(given) == 2 and sum(given) == 0 and given[0] != 0)


class CraigBamptonModel(_Model):
    """A Craig-Bampton component in Exudyn, contact elements on its interface coordinates."""

    kind: Literal["craig-bampton"]
    modes: Annotated[int, Field(ge=0)]  # with the interface held
    step: Positive  # s
    newton_tolerance: Positive = 1e-6  # relative and absolute
    spectral_radius: Annotated[float, Field(ge=0, le=1)] = 1.0  # of generalised-alpha; 1: the trapezoidal rule

    lacks: ClassVar[tuple[Lack, ...]] = ("sparse", "loads", "friction", "damping", "laws", "differences")
    penalty: ClassVar[bool] = True


class StepwiseModel(_Model):
    """The reduced equations of a Multi-Phi model integrated by scipy's solve_ivp; compliant contacts only."""

    kind: Literal["solve-ivp"]
    modes: Modes | None = None  # none given: the scene's
    method: Literal["RK45", "DOP853", "Radau", "BDF", "LSODA"]  # of solve_ivp
    rtol: RelativeTolerance  # its relative tolerance

    lacks: ClassVar[tuple[Lack, ...]] = ("loads", "friction", "damping", "laws")
    penalty: ClassVar[bool] = True

    def own_faults(self, scene: Mechanics) -> Iterator[Fault]:
        """Printed frequencies are those of a rigid support."""
        if scene.printed:
            yield ".kind", self.kind, "reduced: the printed frequencies are of a rigid support"


class GlobalBasisModel(_Model):
    """One basis for all levels, the modes of the open and of the closed one together, without time steps."""

    kind: Literal["global-basis"]
    modes: Annotated[int, Field(ge=1)] | None = None  # of each of the two levels
    contact: Literal["as-given", "rigid"] = "as-given"

    lacks: ClassVar[tuple[Lack, ...]] = ("weight", "friction")


class TrainedBasisModel(_Model):
    """One basis for all levels from snapshots of a run with all modes (POD), without time steps."""

    kind: Literal["pod-basis"]
    modes: Annotated[int, Field(ge=1)] | None = None
    training: Positive = 0.1  # s, of the scene's own motion from its start

    lacks: ClassVar[tuple[Lack, ...]] = ("weight", "friction", "laws")


class SplittingModel(_Model):
    """A Craig-Bampton component in its modes, free motion exact, penalty forces by Strang splitting, compiled."""

    kind: Literal["splitting"]
    modes: Annotated[int, Field(ge=0)]  # with the interface held
    step: Positive  # s

    lacks: ClassVar[tuple[Lack, ...]] = ("sparse", "loads", "friction", "damping", "laws")
    penalty: ClassVar[bool] = True


ModelSpec = (
    ReducedModel
    | UserObjectModel
    | FullModel
    | CraigBamptonModel
    | StepwiseModel
    | GlobalBasisModel
    | TrainedBasisModel
    | SplittingModel
)
