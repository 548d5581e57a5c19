"""Places in a scene file with dots: "start.displacement", "contacts.stop.gap", "structure.beam.sections.0.end".

In a list a part is an entry's number from 0, its ``name``, or "*" for every entry; in a table it is a field, or "*" for
every entry that is there. Names may have dots themselves. A place may be a whole table.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.mechanics.arguments import one_of

__all__ = ["with_value"]

EVERY = "*"


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
        count = _names(parts, given) or 1
        name = ".".join(parts[:count])
        names = list(given) if name == EVERY else [name]
        return {**given, **{n: _changed(given.get(n, {}), parts[count:], value, place) for n in names}}
    if isinstance(given, list):
        chosen, count = _entries(given, parts, place)
        return [_changed(e, parts[count:], value, place) if i in chosen else e for i, e in enumerate(given)]
    raise MultiPhiValueError(f"{place}: got {'.'.join(parts)!r} inside {given!r}, need a field of a table or a list")


def _entries(given: list[Any], parts: Sequence[str], place: str) -> tuple[set[int], int]:
    """Which entries of a list the first parts name, and how many parts these are."""
    names = [entry.get("name") if isinstance(entry, Mapping) else None for entry in given]
    known = [name for name in names if isinstance(name, str)]
    count = _names(parts, known) or 1
    chosen = {i for i, name in enumerate(names) if name == ".".join(parts[:count])}
    numbers = set(range(len(given)))
    if not chosen:
        chosen = numbers if parts[0] == EVERY else numbers & {int(parts[0]) if parts[0].isdecimal() else -1}
    if not chosen:
        entries = [EVERY, *map(str, numbers), *known]
        raise MultiPhiValueError(f"{place}: got {parts[0]!r}, need {one_of(parts[0], entries, 'entries')}")
    return chosen, count


def _names(parts: Sequence[str], known: Any) -> int:
    """How many parts together are a known name, the longest first; 0 for none."""
    return next((count for count in range(len(parts), 0, -1) if ".".join(parts[:count]) in known), 0)
