"""The tables ``[[models]]`` of a scene file: one class for each kind of model, with what it can take of a scene.

A kind says in ``lacks`` what it has not, in ``own_faults`` what else it cannot take; how it is called and run stands in
its runner (multiphi_exudyn.study.running). A new kind is a class here, its place in ``ModelSpec``, and a runner.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.force_law import ForceLaw
from multiphi_exudyn.mechanics.friction import Friction
from multiphi_exudyn.mechanics.loads import Load
from multiphi_exudyn.mechanics.moving_supports import BaseMotion, StopMotion
from multiphi_exudyn.mechanics.static_loads import Gravity
from multiphi_exudyn.study.scene.fields import Modes, Name, Positive, RelativeTolerance, Table

if TYPE_CHECKING:
    from typing import Self

__all__ = [
    "CraigBamptonModel",
    "Demands",
    "Fault",
    "FullModel",
    "GlobalBasisModel",
    "ModelSpec",
    "ReducedModel",
    "SplittingModel",
    "StepwiseModel",
    "TrainedBasisModel",
    "UserObjectModel",
]


@dataclass(frozen=True)
class Demands:
    """What a scene asks of its models. given_as: its structure; printed: whether levels have printed frequencies."""

    given_as: Literal["beams", "dense", "sparse"]
    contacts: Sequence[UnilateralContact]
    laws: Sequence[ForceLaw]
    frictions: Sequence[Friction]
    loads: Sequence[Load]
    printed: bool

    @property
    def moving_stops(self) -> bool:
        """Whether a stop moves beside the structure."""
        return any(isinstance(load, StopMotion) or getattr(load, "fixed_stops", ()) for load in self.loads)


@dataclass(frozen=True)
class Fault:
    """A wrong field, of the model's own entry or, with ``whole``, of the file: what was given, what is needed."""

    field: str
    given: object
    needed: str
    whole: bool = False


Lack = Callable[[Demands], Iterator[str]]  # why another kind is needed


def _loads(demands: Demands) -> Iterator[str]:
    if demands.loads:
        yield "this one has no loads"


def _weight(demands: Demands) -> Iterator[str]:
    if any(isinstance(load, (Gravity, BaseMotion)) for load in demands.loads):
        yield "this one has neither weight nor moving base"


def _sparse(demands: Demands) -> Iterator[str]:
    if demands.given_as == "sparse":
        yield "this one takes dense matrices"


def _matrices(demands: Demands) -> Iterator[str]:
    if demands.given_as != "beams":
        yield "matrices have no full model"


def _friction(demands: Demands) -> Iterator[str]:
    yield from (f"its contacts have no friction, {c.name} has" for c in demands.contacts if c.friction)
    yield from (f"this one has no friction, and there is {friction.name}" for friction in demands.frictions)


def _damping(demands: Demands) -> Iterator[str]:
    yield from (f"its contacts have no damping, {c.name} has" for c in demands.contacts if c.damping)


def _laws(demands: Demands) -> Iterator[str]:
    yield from (f"this one has no force laws, and there is {law.name}" for law in demands.laws)


def _pairs(demands: Demands) -> Iterator[str]:
    for contact in demands.contacts:
        if len(_factors(contact.direction)) > 1:
            yield f"its contacts act on single points, {contact.name} on {len(_factors(contact.direction))}"


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

    def faults(self, demands: Demands) -> Iterator[Fault]:
        """What it cannot take of a scene."""
        for lack in self.lacks:
            yield from (Fault("kind", self.kind, f"another kind: {why}") for why in lack(demands))
        if self.penalty:
            for contact in demands.contacts:
                if contact.rigid:
                    needed = f"a finite one: {self.name} is a penalty model"
                    yield Fault(f"stiffness of contact {contact.name}", "inf", needed, whole=True)
        yield from self.own_faults(demands)

    def own_faults(self, demands: Demands) -> Iterator[Fault]:
        """What else; nothing but for some kinds."""
        yield from ()


class _Levels(_Model):
    """A kind with the levels of a Multi-Phi model."""

    contact: Literal["as-given", "rigid"] = "as-given"

    def own_faults(self, demands: Demands) -> Iterator[Fault]:
        """Printed frequencies are those of a rigid support."""
        if demands.printed and not self.rigid:
            yield Fault("contact", self.contact, "'rigid': the printed frequencies are of a rigid support")


class ReducedModel(_Levels):
    """A Multi-Phi model run by itself."""

    kind: Literal["reduced"]
    modes: Modes | None = None  # none given: the scene's
    tolerance: Positive | None = None  # truncation error wanted, from which the modes follow, in place of a number

    @model_validator(mode="after")
    def _one_choice_of_modes(self) -> ReducedModel:
        if self.modes is not None and self.tolerance is not None:
            raise PydanticCustomError("modes", "modes or a tolerance, not both")
        return self

    def filled(self, default: int) -> ReducedModel:
        """A tolerance chooses the modes."""
        return self if self.tolerance is not None else super().filled(default)


class UserObjectModel(_Levels):
    """A Multi-Phi model as a body inside Exudyn."""

    kind: Literal["user-object"]
    step: Positive  # s
    modes: Annotated[int, Field(ge=1)] | None = None


class FullModel(_Model):
    """The full nonlinear Exudyn beam, or beams, with contact elements."""

    kind: Literal["full"]
    beam: Literal["ancf", "geometrically-exact"] = "ancf"
    elements: Annotated[int, Field(ge=1)]  # of each beam
    step: Positive  # s
    spectral_radius: Annotated[float, Field(ge=0, le=1)] = 1.0
    newton_tolerance: Positive = 1e-5  # relative and absolute
    contact: Literal["coordinate", "circle"] = "coordinate"  # element at the node, or a round support (ancf)

    lacks: ClassVar[tuple[Lack, ...]] = (_matrices,)
    penalty: ClassVar[bool] = True

    def filled(self, default: int) -> FullModel:
        """It has no modes."""
        return self

    def own_faults(self, demands: Demands) -> Iterator[Fault]:
        """Elements act on a point or between two; friction has a spring; a round support is at rest and undamped."""
        for contact in demands.contacts:
            if contact.friction and math.isinf(contact.tangential_stiffness):
                yield self._springless(f"tangential_stiffness of contact {contact.name}")
            factors = _factors(contact.direction)
            if len(factors) > 1 and (not _between_two(factors) or not factors[0]):
                yield self._another("contacts act on a point, or between two", contact.name, contact.direction)
        for i, friction in enumerate(demands.frictions):
            if friction.rigid:
                yield self._springless(f"friction[{i}].stiffness")
            factors = _factors(friction.direction)
            if len(factors) > 1 and not _between_two(factors):
                yield self._another("friction acts on a point, or between two", friction.name, len(factors))
        for law in demands.laws:
            if len(_factors(law.at)) > 1:
                yield self._another("force laws act on single points", law.name, len(_factors(law.at)))
        if self.contact == "circle":
            yield from (Fault("contact", "circle", f"'coordinate': {why}") for why in _not_round(demands))

    def _springless(self, field: str) -> Fault:
        return Fault(field, "inf", f"a finite one: {self.name} has friction with a spring in series", whole=True)

    def _another(self, does: str, name: str, given: object) -> Fault:
        return Fault("kind", self.kind, f"another kind: its {does}, {name} on {given}")


class CraigBamptonModel(_Model):
    """A Craig-Bampton component in Exudyn, contact elements on its interface coordinates."""

    kind: Literal["craig-bampton"]
    modes: Annotated[int, Field(ge=0)]  # with the interface held
    step: Positive  # s
    newton_tolerance: Positive = 1e-6  # relative and absolute
    spectral_radius: Annotated[float, Field(ge=0, le=1)] = 1.0

    lacks: ClassVar[tuple[Lack, ...]] = (_sparse, _loads, _friction, _damping, _laws, _pairs)
    penalty: ClassVar[bool] = True


class StepwiseModel(_Model):
    """The reduced equations of a Multi-Phi model integrated by scipy's solve_ivp; compliant contacts only."""

    kind: Literal["solve-ivp"]
    modes: Modes | None = None
    method: Literal["RK45", "DOP853", "Radau", "BDF", "LSODA"]
    rtol: RelativeTolerance

    lacks: ClassVar[tuple[Lack, ...]] = (_loads, _friction, _damping, _laws)
    penalty: ClassVar[bool] = True

    def own_faults(self, demands: Demands) -> Iterator[Fault]:
        """Printed frequencies are those of a rigid support."""
        if demands.printed:
            yield Fault("kind", self.kind, "reduced: the printed frequencies are of a rigid support")


class GlobalBasisModel(_Model):
    """One basis for all levels, the modes of the open and of the closed one together, without time steps."""

    kind: Literal["global-basis"]
    modes: Annotated[int, Field(ge=1)] | None = None  # of each of the two levels
    contact: Literal["as-given", "rigid"] = "as-given"

    lacks: ClassVar[tuple[Lack, ...]] = (_weight, _friction)


class TrainedBasisModel(_Model):
    """One basis for all levels from snapshots of a run with all modes (POD), without time steps."""

    kind: Literal["pod-basis"]
    modes: Annotated[int, Field(ge=1)] | None = None
    training: Positive = 0.1  # s, of the scene's own motion from its start

    lacks: ClassVar[tuple[Lack, ...]] = (_weight, _friction, _laws)


class SplittingModel(_Model):
    """A Craig-Bampton component in its modes, free motion exact, penalty forces by Strang splitting, compiled."""

    kind: Literal["splitting"]
    modes: Annotated[int, Field(ge=0)]  # with the interface held
    step: Positive  # s

    lacks: ClassVar[tuple[Lack, ...]] = (_sparse, _loads, _friction, _damping, _laws)
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


def _not_round(demands: Demands) -> Iterator[str]:
    """Why a round support will not do."""
    if demands.moving_stops:
        yield "a round support does not move"
    for contact in demands.contacts:
        if contact.damping:
            yield "a round support has no damping"
        if len(_factors(contact.direction)) > 1:
            yield f"a round support does not move, {contact.name} is between two points"


def _factors(at: object) -> list[float]:
    """Coefficients of the points something acts on."""
    return list(at.values()) if isinstance(at, Mapping) else [1.0]


def _between_two(factors: Sequence[float]) -> bool:
    return len(factors) == 2 and sum(factors) == 0
