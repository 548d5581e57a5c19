"""The tables ``[[models]]`` of a scene file: one class for each kind of model, and the scenes that it takes.

``faults`` says what of a scene a kind cannot have, before anything runs. How a kind runs, and its label, is in its
runner (runners.py). A new kind needs a class here, an entry in ``ModelSpec``, and a runner.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from multiphi_exudyn.study.scene_tables import Count, Mechanics, Name, Positive, Table

if TYPE_CHECKING:
    from typing import Self

__all__ = ["CraigBamptonModel", "FullModel", "ModelSpec", "ReducedModel", "StepwiseModel", "UserObjectModel"]

Modes = Count | Literal["all"]
RelativeTolerance = Annotated[float, Field(ge=1e-13, lt=1)]  # below it lies round-off
Fault = tuple[str, object, str]  # field, given, needed; a field that begins with a dot is one of the model's own table
Feature = Literal["loads", "weight", "sparse", "matrices", "friction", "damping", "laws", "differences"]


def _reasons(feature: Feature, scene: Mechanics) -> list[str]:
    """Why a scene needs a kind of model that takes a feature; empty where it does not."""
    if feature == "loads":
        return ["this kind takes no loads"] if scene.loads else []
    if feature == "weight":
        return ["this kind takes neither gravity nor base-motion"] if scene.needs_rigid_body_motion else []
    if feature == "sparse":
        return ["this kind takes dense matrices only"] if scene.sparse else []
    if feature == "matrices":
        return [] if scene.beams else ["this kind is made of beams, and the structure is given as matrices"]
    if feature == "friction":
        where = [f"the contact {contact.name} has it" for contact in scene.contacts if contact.friction]
        where += [f"the scene has {friction.name}" for friction in scene.frictions]
        return [f"this kind takes no friction, and {what}" for what in where]
    if feature == "damping":
        damped = [contact.name for contact in scene.contacts if contact.damping]
        return [f"this kind takes no damped contacts, and {name} is damped" for name in damped]
    if feature == "laws":
        return [f"this kind takes no force laws, and the scene has {law.name}" for law in scene.force_laws]
    counts = [(contact.name, len(_factors(contact.direction))) for contact in scene.contacts]
    return [f"its contacts act on single points, and {name} acts on {n}" for name, n in counts if n > 1]


def _factors(at: object) -> list[float]:
    """Coefficients of the points of a direction."""
    return list(at.values()) if isinstance(at, Mapping) else [1.0]


def _one_or_two(at: object) -> bool:
    """Whether a direction is a point or the difference of two points."""
    factors = _factors(at)
    return len(factors) == 1 or (len(factors) == 2 and sum(factors) == 0 and factors[0] != 0)


class _Model(Table):
    """Fields of every kind."""

    kind: str
    name: Name  # "{modes}" stands for the number of modes

    not_taken: ClassVar[tuple[Feature, ...]] = ()
    penalty: ClassVar[bool] = False  # whether contacts need a finite stiffness

    @property
    def rigid(self) -> bool:
        """Whether all contacts are rigid in this model."""
        return getattr(self, "contact", "as-given") == "rigid"

    def with_modes(self, default: int) -> Self:
        """The table with its number of modes (``default``: that of the scene) also in its name."""
        modes = default if (given := getattr(self, "modes", None)) is None else given
        return self.model_copy(update={"modes": modes, "name": self.name.replace("{modes}", str(modes))})

    def faults(self, scene: Mechanics) -> Iterator[Fault]:
        """What of the scene the model cannot have."""
        for feature in self.not_taken:
            yield from (self._another_kind(why) for why in _reasons(feature, scene))
        needed = f"a finite one: contacts of the model {self.name} are penalty springs"
        rigid = [contact.name for contact in scene.contacts if contact.rigid and self.penalty]
        yield from ((f"stiffness of contact {name}", "inf", needed) for name in rigid)

    def _another_kind(self, why: str) -> Fault:
        return ".kind", self.kind, f"another kind: {why}"


class _Levels(_Model):
    """A kind with the levels of a Multi-Phi model."""

    contact: Literal["as-given", "rigid"] = "as-given"

    def faults(self, scene: Mechanics) -> Iterator[Fault]:
        """Printed frequencies need a rigid support."""
        yield from super().faults(scene)
        if scene.has_printed_frequencies and not self.rigid:
            yield ".contact", self.contact, "'rigid': the printed frequencies are of a rigid support"


class ReducedModel(_Levels):
    """A Multi-Phi model run by itself."""

    kind: Literal["reduced"]
    modes: Modes | None = None  # none given: the scene's
    tolerance: Positive | None = None  # truncation error wanted, from which the modes follow, in place of a number
    boundary: Literal["own", "residual"] | None = None  # modes of each level, or one basis with residual flexibility

    @model_validator(mode="after")
    def _one_choice_of_modes(self) -> ReducedModel:
        if self.modes is not None and self.tolerance is not None:
            raise PydanticCustomError("modes", "modes or tolerance, not both")
        return self

    def with_modes(self, default: int) -> ReducedModel:
        """The table itself where a tolerance determines the modes."""
        return self if self.tolerance is not None else super().with_modes(default)


class UserObjectModel(_Levels):
    """A Multi-Phi model as a body inside Exudyn."""

    kind: Literal["user-object"]
    step: Positive  # s
    modes: Count | None = None  # none given: the scene's


class FullModel(_Model):
    """The full nonlinear Exudyn beam, or beams, with contact elements."""

    kind: Literal["full"]
    beam: Literal["ancf", "geometrically-exact"] = "ancf"
    elements: Count  # of each beam
    step: Positive  # s
    spectral_radius: Annotated[float, Field(ge=0, le=1)] = 1.0  # of generalised-alpha; 1: the trapezoidal rule
    newton_tolerance: Positive = 1e-5  # relative and absolute
    contact: Literal["coordinate", "circle"] = "coordinate"  # element at the node, or a round support (ancf)

    not_taken: ClassVar[tuple[Feature, ...]] = ("matrices",)
    penalty: ClassVar[bool] = True

    def with_modes(self, default: int) -> FullModel:
        """The table itself: a full model has no modes."""
        return self

    def faults(self, scene: Mechanics) -> Iterator[Fault]:
        """Elements act on one or two points; friction needs a spring; a round support is fixed and undamped."""
        yield from super().faults(scene)
        spring = f"a finite one: friction of the model {self.name} has a spring in series"
        for contact in scene.contacts:
            if contact.friction and math.isinf(contact.tangential_stiffness):
                yield f"tangential_stiffness of contact {contact.name}", "inf", spring
        for i, friction in enumerate(scene.frictions):
            if friction.rigid:
                yield f"friction[{i}].stiffness", "inf", spring
        placed = [(each.name, each.direction) for each in scene.contacts]
        placed += [(each.name, each.direction) for each in scene.frictions]
        for name, direction in placed:
            if not _one_or_two(direction):
                acts = f"{name} acts on {direction}"
                yield self._another_kind(f"its elements act on a point, or between two, and {acts}")
        for law in scene.force_laws:
            if (points := len(_factors(law.at))) > 1:
                yield self._another_kind(f"its force laws act on single points, and {law.name} acts on {points}")
        if self.contact == "circle":
            yield from ((".contact", "circle", f"'coordinate': {why}") for why in self._round_support_faults(scene))

    def _round_support_faults(self, scene: Mechanics) -> Iterator[str]:
        if scene.moving_stops:
            yield "a round support does not move"
        for contact in scene.contacts:
            if contact.damping:
                yield "a round support has no damping"
            if len(_factors(contact.direction)) > 1:
                yield f"a round support does not move, and {contact.name} is between two points"


class CraigBamptonModel(_Model):
    """A Craig-Bampton component in Exudyn, contact elements on its interface coordinates."""

    kind: Literal["craig-bampton"]
    modes: Annotated[int, Field(ge=0)]  # with the interface held
    step: Positive  # s
    newton_tolerance: Positive = 1e-6  # relative and absolute
    spectral_radius: Annotated[float, Field(ge=0, le=1)] = 1.0  # of generalised-alpha; 1: the trapezoidal rule

    not_taken: ClassVar[tuple[Feature, ...]] = ("sparse", "loads", "friction", "damping", "laws", "differences")
    penalty: ClassVar[bool] = True


class StepwiseModel(_Model):
    """The reduced equations of a Multi-Phi model integrated by scipy's solve_ivp; compliant contacts only."""

    kind: Literal["solve-ivp"]
    modes: Modes | None = None  # none given: the scene's
    method: Literal["RK45", "DOP853", "Radau", "BDF", "LSODA"]  # of solve_ivp
    rtol: RelativeTolerance  # its relative tolerance

    not_taken: ClassVar[tuple[Feature, ...]] = ("loads", "friction", "damping", "laws")
    penalty: ClassVar[bool] = True

    def faults(self, scene: Mechanics) -> Iterator[Fault]:
        """Printed frequencies need a rigid support."""
        yield from super().faults(scene)
        if scene.has_printed_frequencies:
            yield ".kind", self.kind, "reduced: the printed frequencies are of a rigid support"


class GlobalBasisModel(_Model):
    """One basis for all levels, the modes of the open and of the closed one together, without time steps."""

    kind: Literal["global-basis"]
    modes: Count | None = None  # of each of the two levels
    contact: Literal["as-given", "rigid"] = "as-given"

    not_taken: ClassVar[tuple[Feature, ...]] = ("weight", "friction")


class TrainedBasisModel(_Model):
    """One basis for all levels from snapshots of a run with all modes (POD), without time steps."""

    kind: Literal["pod-basis"]
    modes: Count | None = None
    training: Positive = 0.1  # s, of the scene's own motion from its start

    not_taken: ClassVar[tuple[Feature, ...]] = ("weight", "friction", "laws")


class SplittingModel(_Model):
    """A Craig-Bampton component in its modes, free motion exact, penalty forces by Strang splitting, compiled."""

    kind: Literal["splitting"]
    modes: Annotated[int, Field(ge=0)]  # with the interface held
    step: Positive  # s

    not_taken: ClassVar[tuple[Feature, ...]] = ("sparse", "loads", "friction", "damping", "laws")
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
