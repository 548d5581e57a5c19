"""Checks of the arguments of a model: contacts, their directions, the number of modes, and overrides."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.levels.base.build_base import COMPLETE
from multiphi_exudyn.levels.level.level_override import LevelOverride
from multiphi_exudyn.levels.model.mode_choice import Tolerance, UpTo, is_count
from multiphi_exudyn.mechanics.arguments import one_of
from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.element import AnyLink, Element
from multiphi_exudyn.mechanics.residual_contact import ResidualContact
from multiphi_exudyn.mechanics.structure import LinearStructure

__all__ = ["check_directions", "check_modes", "check_overrides", "checked_contacts", "on_boundaries"]

MANY = 24  # contacts, from which levels on a residual boundary cost less than own modes in an incomplete base


def checked_contacts(given: Any) -> tuple[Element, ...]:
    """Return the contacts as a tuple; raise an error for other types and for names that occur twice."""
    needed = "UnilateralContact, Friction or ForceLaw"
    if not isinstance(given, Iterable):
        raise MultiPhiTypeError(f"contacts: got {type(given).__name__}, need a sequence of {needed}")
    items = tuple(given)
    for item in items:
        if not isinstance(item, Element):
            raise MultiPhiTypeError(f"contacts: got {type(item).__name__}, need {needed}")
    names = [contact.name for contact in items]
    if len(set(names)) < len(names):
        raise MultiPhiValueError(f"contacts: got the names {names}, need each name once")
    return items


def on_boundaries(contacts: Sequence[Element], boundary: Any, modes: Any, n: int) -> tuple[Element, ...]:
    """Return the contacts of a structure of n degrees of freedom, those with a residual boundary as such."""
    if isinstance(boundary, Mapping):
        _check_names(boundary, contacts)
        given = [boundary.get(contact.name) for contact in contacts]
    else:
        given = [boundary] * len(contacts)
    for each in given:
        if each not in ("own", "residual", None):
            raise MultiPhiValueError(f"boundary: got {each!r}, need 'own', 'residual' or None")
    able = [contact for contact in contacts if _can_be_residual(contact)]
    chosen = "residual" if len(able) >= MANY and n > COMPLETE and str(modes) != "all" else "own"
    return tuple(
        _on_boundary(contact, each or (chosen if contact in able else "own"), required=isinstance(boundary, Mapping))
        for contact, each in zip(contacts, given, strict=True)
    )


def _check_names(boundary: Mapping[Any, Any], contacts: Sequence[Element]) -> None:
    names = [contact.name for contact in contacts]
    for name in boundary:
        if name not in names:
            raise MultiPhiValueError(f"boundary: got {name!r}, need {one_of(name, names)}")


def _can_be_residual(element: Element) -> bool:
    if not isinstance(element, UnilateralContact):
        return False
    return not (element.damping or element.most or element.restitution)


def _on_boundary(element: Element, boundary: str, required: bool) -> Element:
    """Return an element on a boundary; force laws and friction have own modes unless a residual one is ``required``."""
    if isinstance(element, ResidualContact):
        return element if boundary == "residual" else element.own
    if boundary == "own" or (not isinstance(element, UnilateralContact) and not required):
        return element
    if not isinstance(element, UnilateralContact):
        raise MultiPhiValueError(f"boundary of {element.name!r}: got 'residual', need a UnilateralContact, or 'own'")
    return ResidualContact.of(element)


def check_directions(structure: LinearStructure, links: Iterable[AnyLink]) -> None:
    """Raise an error for a link whose direction is zero."""
    for link in links:
        if not np.any(_row(structure, link)):
            raise MultiPhiValueError(f"contact {link.name!r} direction: got a zero row, need a direction")


def _row(structure: LinearStructure, link: AnyLink) -> np.ndarray:
    """Return the row (n,) of a link's direction; an error names the link."""
    try:
        return structure.row(link.direction)
    except (MultiPhiValueError, MultiPhiTypeError) as error:
        raise type(error)(f"contact {link.name!r}: {error}") from error


def check_modes(modes: Any) -> None:
    """Raise an error for a value that is no choice of a number of modes."""
    if modes is None or isinstance(modes, (UpTo, Tolerance)) or str(modes) == "all":
        return
    needed = "need an integer >= 1, 'all', UpTo, Tolerance or None"
    if not is_count(modes):
        raise MultiPhiTypeError(f"modes: got {modes!r}, {needed}")
    if int(modes) < 1:
        raise MultiPhiValueError(f"modes: got {modes}, {needed}")


def check_overrides(overrides: Any) -> None:
    """Raise an error for a value that is no mapping of closed contacts to level overrides."""
    needed = "need {(names of closed contacts, ...): LevelOverride}"
    if not isinstance(overrides, Mapping):
        raise MultiPhiTypeError(f"overrides: got {type(overrides).__name__}, {needed}")
    for key, value in overrides.items():
        if not (isinstance(key, tuple) and isinstance(value, LevelOverride)):
            raise MultiPhiTypeError(f"overrides: got {key!r}: {type(value).__name__}, {needed}")
