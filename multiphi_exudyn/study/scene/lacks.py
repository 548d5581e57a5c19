"""What a kind of model may lack: for each, why a scene that asks for it needs another kind."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

from multiphi_exudyn.study.scene.parts import Mechanics

__all__ = [
    "Lack",
    "beams_only",
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

Lack = Callable[[Mechanics], Iterator[str]]


def no_loads(scene: Mechanics) -> Iterator[str]:
    """Of one that takes no loads."""
    if scene.loads:
        yield "this kind takes no loads"


def no_weight(scene: Mechanics) -> Iterator[str]:
    """Of one that takes neither weight nor a moving base."""
    if scene.carried:
        yield "this kind takes neither gravity nor base-motion"


def no_sparse(scene: Mechanics) -> Iterator[str]:
    """Of one that takes dense matrices alone."""
    if scene.sparse:
        yield "this kind takes dense matrices only"


def beams_only(scene: Mechanics) -> Iterator[str]:
    """Of one that is made of beams."""
    if scene.beams is None:
        yield "this kind is made of beams, and the structure is given as matrices"


def no_friction(scene: Mechanics) -> Iterator[str]:
    """Of one that takes no friction."""
    yield from (f"this kind takes no friction, and the contact {c.name} has it" for c in scene.contacts if c.friction)
    yield from (f"this kind takes no friction, and the scene has {friction.name}" for friction in scene.frictions)


def no_damping(scene: Mechanics) -> Iterator[str]:
    """Of one whose contacts have no damping."""
    yield from (f"this kind takes no damped contacts, and {c.name} is damped" for c in scene.contacts if c.damping)


def no_laws(scene: Mechanics) -> Iterator[str]:
    """Of one that takes no force laws."""
    yield from (f"this kind takes no force laws, and the scene has {law.name}" for law in scene.force_laws)


def single_points(scene: Mechanics) -> Iterator[str]:
    """Of one whose contacts act on single points."""
    for contact in scene.contacts:
        if (points := len(factors(contact.direction))) > 1:
            yield f"its contacts act on single points, and {contact.name} acts on {points}"


def not_round(scene: Mechanics) -> Iterator[str]:
    """Of one whose contact is a round support: why that will not do."""
    if scene.moving_stops:
        yield "a round support does not move"
    for contact in scene.contacts:
        if contact.damping:
            yield "a round support has no damping"
        if len(factors(contact.direction)) > 1:
            yield f"a round support does not move, and {contact.name} is between two points"


def factors(at: object) -> list[float]:
    """Coefficients of the points something acts on."""
    return list(at.values()) if isinstance(at, Mapping) else [1.0]
