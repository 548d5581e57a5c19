"""Tables in which the loop finds levels by their keys, and maps by their two levels (arrays.py).

Entries that are missing are requested by the loop (NEED).
"""

from __future__ import annotations

from multiphi_exudyn.events import arrays as a
from multiphi_exudyn.events.arrays import Buffers
from multiphi_exudyn.events.states.maps import level_hash, map_hash

__all__ = ["LevelTables"]

SLOTS = 64  # of a table at first: twice as many as it holds, or more


class LevelTables:
    """Tables in ``buffers``; levels: records in the first, maps: records in the second, by their levels."""

    def __init__(self, buffers: Buffers) -> None:
        self._buffers = buffers
        self.levels = set[int]()
        self.maps = dict[tuple[int, int], int]()
        self._make_levels(SLOTS)
        self._make_maps(SLOTS)

    def add_level(self, record: int) -> None:
        """Enter a level in its table."""
        ints = self._buffers.ints
        self.levels.add(record)
        if 2 * len(self.levels) > ints[a.LEVEL_SLOTS]:
            self._make_levels(2 * int(ints[a.LEVEL_SLOTS]))
        else:
            self._enter_level(record)

    def add_map(self, source: int, target: int, record: int) -> None:
        """Enter the map between two levels in its table."""
        ints = self._buffers.ints
        self.maps[source, target] = record
        if 2 * len(self.maps) > ints[a.MAP_SLOTS]:
            self._make_maps(2 * int(ints[a.MAP_SLOTS]))
        else:
            self._enter_map(source, target, record)

    def clear(self) -> None:
        """Empty both tables."""
        self.levels.clear()
        self.maps.clear()
        ints = self._buffers.ints
        for table, slots, width in ((a.LEVELS, a.LEVEL_SLOTS, 1), (a.MAPS, a.MAP_SLOTS, a.MAP_ENTRY)):
            start = ints[table]
            ints[start : start + width * ints[slots]] = 0

    def _make_levels(self, slots: int) -> None:
        """Make a table of levels with so many slots."""
        table = self._buffers.take("ints", slots)
        self._buffers.ints[a.LEVELS], self._buffers.ints[a.LEVEL_SLOTS] = table, slots
        for record in self.levels:
            self._enter_level(record)

    def _make_maps(self, slots: int) -> None:
        """Make a table of maps with so many slots."""
        table = self._buffers.take("ints", a.MAP_ENTRY * slots)
        self._buffers.ints[a.MAPS], self._buffers.ints[a.MAP_SLOTS] = table, slots
        for (source, target), record in self.maps.items():
            self._enter_map(source, target, record)

    def _enter_level(self, record: int) -> None:
        ints = self._buffers.ints
        slots = int(ints[a.LEVEL_SLOTS])
        states = ints[ints[record + a.STATES] :][: ints[a.ELEMENTS]].tolist()
        slot = level_hash(states, 0, len(states)) % slots
        while ints[ints[a.LEVELS] + slot]:
            slot = (slot + 1) % slots
        ints[ints[a.LEVELS] + slot] = record

    def _enter_map(self, source: int, target: int, record: int) -> None:
        ints = self._buffers.ints
        slots = int(ints[a.MAP_SLOTS])
        slot = map_hash(source, target) % slots
        while ints[ints[a.MAPS] + a.MAP_ENTRY * slot]:
            slot = (slot + 1) % slots
        at = int(ints[a.MAPS]) + a.MAP_ENTRY * slot
        ints[at : at + a.MAP_ENTRY] = source, target, record
