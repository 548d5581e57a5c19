"""Bounded cache: a mapping of bounded length that drops the least recently used entry.

Entries can be built again from their keys, bit by bit; the bound costs time, and never changes a result.
"""

from __future__ import annotations

from collections.abc import Callable, ItemsView
from typing import Generic, TypeVar

__all__ = ["BoundedCache"]

K = TypeVar("K")
V = TypeVar("V")


class BoundedCache(Generic[K, V]):
    """At most ``most`` entries. dropped: called with every dropped entry. kept: number of entries ever added."""

    def __init__(self, most: int, dropped: Callable[[K, V], None] | None = None) -> None:
        self.most = most
        self.kept = 0
        self._dropped = dropped
        self._entries: dict[K, V] = {}  # in the order of their last use

    def find(self, key: K) -> V | None:
        """Return the entry, which becomes the one used last, or None."""
        entry = self._entries.pop(key, None)
        if entry is not None:
            self._entries[key] = entry
        return entry

    def keep(self, key: K, value: V) -> V:
        """Add an entry, in place of one of the same key, and return it."""
        self._entries.pop(key, None)
        self._entries[key] = value
        self.kept += 1
        while len(self._entries) > self.most:
            self.drop(next(iter(self._entries)))
        return value

    def get_or_build(self, key: K, build: Callable[[], V]) -> V:
        """Return the entry, built and added if it is missing."""
        entry = self._entries.pop(key, None)
        if entry is None:
            return self.keep(key, build())
        self._entries[key] = entry
        return entry

    def drop(self, key: K) -> None:
        """Drop an entry, if it exists."""
        entry = self._entries.pop(key, None)
        if entry is not None and self._dropped is not None:
            self._dropped(key, entry)

    def clear(self) -> None:
        """Drop all entries."""
        for key in list(self._entries):
            self.drop(key)

    def items(self) -> ItemsView[K, V]:
        """Return all entries, the one used last at the end, without changing their order."""
        return self._entries.items()

    def __len__(self) -> int:
        return len(self._entries)
