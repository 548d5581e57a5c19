"""Taken: what the loop has recorded (loop_record.py), copied out of its arrays as it stands there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from multiphi_exudyn.events import arrays as a
from multiphi_exudyn.events.packing.level_arrays import LevelArrays

__all__ = ["EMPTY", "EVENTS", "PARTS", "taken"]

EMPTY: dict[str, np.ndarray] = {  # numbers and places of segments and events: below 2**31 by RECORD_BYTES (motion.py)
    "rows": np.empty((0, a.SEGMENT_WIDTH), np.int32),
    "instants": np.empty(0),
    "coordinates": np.empty(0),
    "phases": np.empty(0, np.int8),
    "left_out": np.empty(0, np.int64),
    "kinds": np.empty((0, a.EVENT_WIDTH), np.int32),
    "amounts": np.empty((0, a.EVENT_WIDTH_NUMBERS)),
    "struck": np.empty(0, np.int32),
    "impacts": np.empty((0, a.IMPACT_WIDTH)),
}

PARTS = (  # where in the loop's arrays they begin, how many rows there are, how wide: 0 for numbers alone
    ("rows", a.SEGMENT_INTS, a.SEGMENT_COUNT, a.SEGMENT_WIDTH),
    ("instants", a.INSTANTS, a.SEGMENT_COUNT, 0),
    ("coordinates", a.COORDINATE_NUMBERS, a.COORDINATE_COUNT, 0),
    ("phases", a.PHASE_INTS, a.PHASE_COUNT, 0),
    ("left_out", a.LEFT_OUT, a.LEFT_OUT_COUNT, 0),
    ("kinds", a.EVENT_INTS, a.EVENT_COUNT, a.EVENT_WIDTH),
    ("amounts", a.EVENT_NUMBERS, a.EVENT_COUNT, a.EVENT_WIDTH_NUMBERS),
    ("struck", a.IMPACT_INTS, a.IMPACT_COUNT, 0),
    ("impacts", a.IMPACT_NUMBERS, a.IMPACT_COUNT, a.IMPACT_WIDTH),
)
EVENTS = PARTS[-4:]
COUNTS = tuple({counted for _, _, counted, _ in PARTS})
FIRST = a.SEGMENT_INTS  # of the slots that tell of a record
OF_NUMBERS = ("instants", "coordinates", "amounts", "impacts")


def taken(arrays: LevelArrays, wanted: Sequence[tuple[str, int, int, int]]) -> dict[str, np.ndarray]:
    """Copies of those of the ``wanted`` of ``PARTS`` that have rows; all of them are then empty in the arrays."""
    ints, numbers = arrays.buffers.ints, arrays.buffers.numbers
    slots, parts = ints[FIRST : a.IMPACT_COUNT + 1].tolist(), {}
    for name, slot, counted, width in wanted:
        if rows := slots[counted - FIRST]:
            start, buffer = slots[slot - FIRST], numbers if name in OF_NUMBERS else ints
            end = start + rows * (width or 1) + (name == "instants")  # they end with the last segment
            part = parts[name] = buffer[start:end].astype(EMPTY[name].dtype)
            if width:
                part.shape = rows, width
    for slot in COUNTS:
        ints[slot] = 0
    return parts
