"""What a scene asks of its models, and the reasons for which a kind of model cannot take it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.force_law import ForceLaw
from multiphi_exudyn.mechanics.friction import Friction
from multiphi_exudyn.mechanics.loads import Load
from multiphi_exudyn.mechanics.moving_supports import BaseMotion, StopMotion
from multiphi_exudyn.mechanics.static_loads import Gravity

__all__ = [
    "Demands",
    "Fault",
    "Lack",
    "beams_only",
    "between_two",
    "factors",
    "no_damping",
    "no_friction",
    "no_laws",
    "no_loads",
    "no_sparse",
    "no_weight",
    "not_round",
    "single_points",
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


def no_loads(demands: Demands) -> Iterator[str]:
    """Of one that takes no loads."""
    if demands.loads:
        yield "this kind takes no loads"


def no_weight(demands: Demands) -> Iterator[str]:
    """Of one that takes neither weight nor a moving base."""
    if any(isinstance(load, (Gravity, BaseMotion)) for load in demands.loads):
        yield "this kind takes neither gravity nor base-motion"


def no_sparse(demands: Demands) -> Iterator[str]:
    """Of one that takes dense matrices alone."""
    if demands.given_as == "sparse":
        yield "this kind takes dense matrices only"


def beams_only(demands: Demands) -> Iterator[str]:
    """Of one that is made of beams."""
    if demands.given_as != "beams":
        yield "this kind is made of beams, and the structure is given as matrices"


def no_friction(demands: Demands) -> Iterator[str]:
    """Of one that takes no friction."""
    yield from (f"this kind takes no friction, and the contact {c.name} has it" for c in demands.contacts if c.friction)
    yield from (f"this kind takes no friction, and the scene has {friction.name}" for friction in demands.frictions)


def no_damping(demands: Demands) -> Iterator[str]:
    """Of one whose contacts have no damping."""
    yield from (f"this kind takes no damped contacts, and {c.name} is damped" for c in demands.contacts if c.damping)


def no_laws(demands: Demands) -> Iterator[str]:
    """Of one that takes no force laws."""
    yield from (f"this kind takes no force laws, and the scene has {law.name}" for law in demands.laws)


def single_points(demands: Demands) -> Iterator[str]:
    """Of one whose contacts act on single points."""
    for contact in demands.contacts:
        if len(factors(contact.direction)) > 1:
            points = len(factors(contact.direction))
            yield f"its contacts act on single points, and {contact.name} acts on {points}"


def not_round(demands: Demands) -> Iterator[str]:
    """Why a round support will not do."""
    if demands.moving_stops:
        yield "a round support does not move"
    for contact in demands.contacts:
        if contact.damping:
            yield "a round support has no damping"
        if len(factors(contact.direction)) > 1:
            yield f"a round support does not move, and {contact.name} is between two points"


def factors(at: object) -> list[float]:
    """Coefficients of the points something acts on."""
    return list(at.values()) if isinstance(at, Mapping) else [1.0]


def between_two(given: Sequence[float]) -> bool:
    """Whether these coefficients are of a difference of two points."""
    return len(given) == 2 and sum(given) == 0
