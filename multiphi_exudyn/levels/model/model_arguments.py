"""Checks of the arguments of a model: contacts, their directions, the number of modes, and overrides."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.levels.level.level_override import LevelOverride
from multiphi_exudyn.levels.model.mode_choice import Tolerance, UpTo, is_count
from multiphi_exudyn.mechanics.element import AnyLink, Element
from multiphi_exudyn.mechanics.structure import LinearStructure

__all__ = ["check_directions", "check_modes", "check_overrides", "checked_contacts"]


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
