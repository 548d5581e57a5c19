"""Bounded cache: a mapping of bounded length that lets the least recently used go.

What is kept here can be made again from its key, to the bit; a bound costs time, and never changes a result.
"""

from __future__ import annotations

from collections.abc import Callable, ItemsView
from typing import Generic, TypeVar

__all__ = ["BoundedCache"]

K = TypeVar("K")
V = TypeVar("V")


class BoundedCache(Generic[K, V]):
    """At most ``most`` entries. dropped: told of every entry that is let go. kept: how many were ever put in."""

    def __init__(self, most: int, dropped: Callable[[K, V], None] | None = None) -> None:
        self.most = most
        self.kept = 0
        self._dropped = dropped
        self._entries: dict[K, V] = {}  # in the order of their last use

    def find(self, key: K) -> V | None:
        """The entry, which is then the one used last; None where there is none."""
        found = self._entries.pop(key, None)
        if found is not None:
            self._entries[key] = found
        return found

    def keep(self, key: K, value: V) -> V:
        """Put an entry in, in place of one of the same key; returns it."""
        self._entries.pop(key, None)
        self._entries[key] = value
        self.kept += 1
        while len(self._entries) > self.most:
            self.drop(next(iter(self._entries)))
        return value

    def get_or_build(self, key: K, make: Callable[[], V]) -> V:
        """The entry, made and put in where there is none."""
        found = self._entries.pop(key, None)
        if found is None:
            return self.keep(key, make())
        self._entries[key] = found
        return found

    def drop(self, key: K) -> None:
        """Let an entry go, if there is one."""
        gone = self._entries.pop(key, None)
        if gone is not None and self._dropped is not None:
            self._dropped(key, gone)

    def clear(self) -> None:
        """Let every entry go."""
        for key in list(self._entries):
            self.drop(key)

    def items(self) -> ItemsView[K, V]:
        """All entries, the one used last at the end; looking does not use them."""
        return self._entries.items()

    def __len__(self) -> int:
        return len(self._entries)
