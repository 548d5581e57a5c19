"""Taken: what the loop has recorded (loop_record.py), copied out of its arrays as it stands there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from multiphi_exudyn.events import arrays as a
from multiphi_exudyn.events.level_arrays import LevelArrays

__all__ = ["EMPTY", "EVENTS", "PARTS", "taken"]

EMPTY = {
    "rows": np.empty((0, a.SEGMENT_WIDTH), np.int64),
    "spans": np.empty((0, a.SEGMENT_WIDTH_NUMBERS)),
    "coordinates": np.empty(0),
    "phases": np.empty(0, np.int64),
    "left_out": np.empty(0, np.int64),
    "kinds": np.empty((0, a.EVENT_WIDTH), np.int64),
    "amounts": np.empty((0, a.EVENT_WIDTH_NUMBERS)),
}

PARTS = (  # where in the loop's arrays they begin, how many rows there are, how wide: 0 for numbers alone
    ("rows", a.SEGMENT_INTS, a.SEGMENT_COUNT, a.SEGMENT_WIDTH),
    ("spans", a.SEGMENT_NUMBERS, a.SEGMENT_COUNT, a.SEGMENT_WIDTH_NUMBERS),
    ("coordinates", a.COORDINATE_NUMBERS, a.COORDINATE_COUNT, 0),
    ("phases", a.PHASE_INTS, a.PHASE_COUNT, 0),
    ("left_out", a.LEFT_OUT, a.LEFT_OUT_COUNT, 0),
    ("kinds", a.EVENT_INTS, a.EVENT_COUNT, a.EVENT_WIDTH),
    ("amounts", a.EVENT_NUMBERS, a.EVENT_COUNT, a.EVENT_WIDTH_NUMBERS),
)
EVENTS = PARTS[-2:]
COUNTS = tuple({counted for _, _, counted, _ in PARTS})
FIRST = a.SEGMENT_INTS  # of the slots that tell of a record
OF_NUMBERS = ("spans", "coordinates", "amounts")


def taken(arrays: LevelArrays, wanted: Sequence[tuple[str, int, int, int]]) -> dict[str, np.ndarray]:
    """Copies of those of the ``wanted`` of ``PARTS`` that have rows; all of them are then empty in the arrays."""
    ints, numbers = arrays.buffers.ints, arrays.buffers.numbers
    slots, parts = ints[FIRST : a.EVENT_ROOM + 1].tolist(), {}
    for name, slot, counted, width in wanted:
        if rows := slots[counted - FIRST]:
            start, buffer = slots[slot - FIRST], numbers if name in OF_NUMBERS else ints
            part = parts[name] = buffer[start : start + rows * (width or 1)].copy()
            if width:
                part.shape = rows, width
    for slot in COUNTS:
        ints[slot] = 0
    return parts
