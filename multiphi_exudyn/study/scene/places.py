"""Paths of fields in a scene file, with dots: "start.displacement", "contacts.stop.gap", "structure.beam.masses.0.at".

In a list a part is the index of an entry, its ``name``, or "*" for every entry; in a table it is a field, or "*" for
every entry of the table. Names may contain dots. A path may end at a whole table.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.mechanics.arguments import one_of

__all__ = ["with_value"]

EVERY = "*"


def with_value(data: Mapping[str, Any], place: str, value: Any) -> dict[str, Any]:
    """Return the content with ``value`` at a path; missing tables are created.

    Raises MultiPhiValueError for an entry that a list does not have.
    """
    changed: dict[str, Any] = _replaced(data, place.split("."), value, place)
    return changed


def _replaced(content: Any, parts: Sequence[str], value: Any, place: str) -> Any:
    if not parts:
        return value
    if isinstance(content, Mapping):
        count = _name_length(parts, content) or 1
        name = ".".join(parts[:count])
        names = list(content) if name == EVERY else [name]
        return {**content, **{n: _replaced(content.get(n, {}), parts[count:], value, place) for n in names}}
    if isinstance(content, list):
        chosen, count = _entries(content, parts, place)
        return [_replaced(e, parts[count:], value, place) if i in chosen else e for i, e in enumerate(content)]
    raise MultiPhiValueError(f"{place}: got {'.'.join(parts)!r} inside {content!r}, need a field of a table or a list")


def _entries(entries: list[Any], parts: Sequence[str], place: str) -> tuple[set[int], int]:
    """Indices of the list's entries named by the first parts of a path, and the number of these parts."""
    names = [entry.get("name") if isinstance(entry, Mapping) else None for entry in entries]
    known = [name for name in names if isinstance(name, str)]
    count = _name_length(parts, known) or 1
    chosen = {i for i, name in enumerate(names) if name == ".".join(parts[:count])}
    numbers = set(range(len(entries)))
    if not chosen:
        chosen = numbers if parts[0] == EVERY else numbers & {int(parts[0]) if parts[0].isdecimal() else -1}
    if not chosen:
        allowed = [EVERY, *map(str, numbers), *known]
        raise MultiPhiValueError(f"{place}: got {parts[0]!r}, need {one_of(parts[0], allowed, 'entries')}")
    return chosen, count


def _name_length(parts: Sequence[str], known: Any) -> int:
    """Number of parts that form the longest known name; 0 for none."""
    return next((count for count in range(len(parts), 0, -1) if ".".join(parts[:count]) in known), 0)
