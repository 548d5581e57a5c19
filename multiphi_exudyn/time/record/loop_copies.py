"""Loop copies: the record of the loop (loop_record.py), copied out of its arrays."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from multiphi_exudyn.events import arrays as a
from multiphi_exudyn.events.packing.level_arrays import LevelArrays

__all__ = ["EMPTY", "EVENTS", "PARTS", "copy_record"]

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

PARTS = (  # name, slots of place and number of rows in the loop's arrays, width (0: a flat array)
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
COUNTS = tuple({count_slot for _, _, count_slot, _ in PARTS})
FIRST_SLOT = a.SEGMENT_INTS  # of the record
OF_NUMBERS = ("instants", "coordinates", "amounts", "impacts")


def copy_record(arrays: LevelArrays, parts: Sequence[tuple[str, int, int, int]]) -> dict[str, np.ndarray]:
    """Copies of the ``parts`` (of ``PARTS``) that have rows; all parts are then empty in the arrays."""
    ints, numbers = arrays.buffers.ints, arrays.buffers.numbers
    slots, copies = ints[FIRST_SLOT : a.IMPACT_COUNT + 1].tolist(), {}
    for name, slot, count_slot, width in parts:
        if rows := slots[count_slot - FIRST_SLOT]:
            start, buffer = slots[slot - FIRST_SLOT], numbers if name in OF_NUMBERS else ints
            end = start + rows * (width or 1) + (name == "instants")  # one more than the segments: the last end
            part = copies[name] = buffer[start:end].astype(EMPTY[name].dtype)
            if width:
                part.shape = rows, width
    for slot in COUNTS:
        ints[slot] = 0
    return copies
