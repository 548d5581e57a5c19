"""Places in a scene file with dots: "start.displacement", "contacts.stop.gap", "structure.beam.sections.0.end".

In a list a part is an entry's number from 0, its ``name``, or "*" for every entry; in a table it is a field, or "*" for
every entry that is there. Names may have dots themselves. A place may be a whole table.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.mechanics.arguments import one_of

__all__ = ["with_value"]

EVERY = "*"

Change = Callable[[Any, Sequence[str]], Any]  # a place further in, and what is left of its parts -> its new content


def with_value(data: Mapping[str, Any], place: str, value: Any) -> dict[str, Any]:
    """The same content with ``value`` at a place; a table that is not there is made.

    Raises MultiPhiValueError for an entry that a list does not have.
    """
    changed: dict[str, Any] = _changed(data, place.split("."), value, place)
    return changed


def _changed(given: Any, parts: Sequence[str], value: Any, place: str) -> Any:
    if not parts:
        return value
    if isinstance(given, Mapping):
        return _table(given, parts, lambda inner, rest: _changed(inner, rest, value, place))
    if isinstance(given, list):
        return _list(given, parts, lambda inner, rest: _changed(inner, rest, value, place), place)
    raise MultiPhiValueError(f"{place}: got {'.'.join(parts)!r} inside {given!r}, need a field of a table or a list")


def _table(given: Mapping[str, Any], parts: Sequence[str], change: Change) -> dict[str, Any]:
    if parts[0] == EVERY:
        return {name: change(inner, parts[1:]) for name, inner in given.items()}
    count = _names(parts, given) or 1
    name = ".".join(parts[:count])
    return {**given, name: change(given.get(name, {}), parts[count:])}


def _list(given: list[Any], parts: Sequence[str], change: Change, place: str) -> list[Any]:
    names = [entry.get("name") if isinstance(entry, Mapping) else None for entry in given]
    count = _names(parts, [name for name in names if isinstance(name, str)])
    if count:
        chosen = {i for i, name in enumerate(names) if name == ".".join(parts[:count])}
    elif parts[0] == EVERY:
        chosen, count = set(range(len(given))), 1
    else:
        chosen, count = {int(parts[0])} if parts[0].isdecimal() else set(), 1
    if not chosen or max(chosen) >= len(given):
        known = [EVERY, *map(str, range(len(given))), *(name for name in names if isinstance(name, str))]
        raise MultiPhiValueError(f"{place}: got {parts[0]!r}, need {one_of(parts[0], known, 'entries')}")
    return [change(entry, parts[count:]) if i in chosen else entry for i, entry in enumerate(given)]


def _names(parts: Sequence[str], known: Any) -> int:
    """How many parts together are a known name, the longest first; 0 for none."""
    return next((count for count in range(len(parts), 0, -1) if ".".join(parts[:count]) in known), 0)
