"""Channels of a run, q >= 0, in buffers (arrays.py): their values at an instant, and records of their pieces."""

from __future__ import annotations

import numpy as np

from multiphi_exudyn.events import arrays as a
from multiphi_exudyn.events.arrays import Buffers
from multiphi_exudyn.events.excitation.excitation import Drive
from multiphi_exudyn.events.excitation.pieces import Pieces
from multiphi_exudyn.events.states import channel_values
from multiphi_exudyn.events.transitions.loaded_levels import LoadedLevels

__all__ = ["ChannelArrays"]

PIECES_AT_ONCE = 1024  # packed at once, when the loop reaches the end of those packed


class ChannelArrays:
    """Channels of ``levels`` in buffers.

    prescribed: number of channels that are functions of time. terms: the largest number of coefficients of a piece of
    theirs. carriers: the largest number of coefficients of each carrier, by its rate, in the pieces packed so far.
    """

    def __init__(self, levels: LoadedLevels) -> None:
        self._excitation, self._until, self.prescribed = levels.excitation, levels.until, levels.excitation.prescribed
        self._pieces = Pieces(levels.excitation.histories, levels.drive.time, levels.until)
        self.terms = max((history.coefficients.shape[1] for history in levels.excitation.histories), default=0)
        self.carriers: dict[complex, int] = {}

    def describe(self, buffers: Buffers) -> None:
        """Write the number of channels and reserve memory for their values, in new buffers."""
        q, ints = self.prescribed, buffers.ints
        ints[a.CHANNELS], ints[a.PRESCRIBED] = self._excitation.channels, q
        slots = {a.DRIVE: buffers.take("numbers", 6 * q), a.SCALED_TERM: buffers.take("waves", self.terms * q)}
        for slot in (a.DRIVE_WAVES, a.DRIVE_NEXT):
            slots[slot] = buffers.take("waves", q * self.terms * q)
        for slot, value in slots.items():
            ints[slot] = value
        self.reserve(buffers)

    def reserve(self, buffers: Buffers) -> None:
        """Pack the next pieces."""
        if not self.prescribed:
            return
        put, first, pieces = buffers.put, int(buffers.ints[a.PIECE_COUNT]), self._pieces
        if first == 0:
            table = buffers.take("ints", len(pieces))
            buffers.ints[a.PIECES] = table
        last = min(first + PIECES_AT_ONCE, len(pieces))
        times = put("numbers", np.column_stack([pieces.starts, pieces.ends])[first:last])
        for places, terms in pieces.terms(first, last):
            for rates, coefficients in terms:
                for rate in np.unique(rates).tolist():
                    self.carriers[rate] = max(self.carriers.get(rate, 0), coefficients.shape[1])
            k, parts = (
                len(places),
                [
                    np.column_stack([rates, coefficients.reshape(len(coefficients), -1)])
                    for rates, coefficients in terms
                ],
            )
            waves = np.hstack(parts)
            starts = np.cumsum([0, *(part.shape[1] for part in parts)])[:-1] + np.arange(k)[:, None] * waves.shape[1]
            records = np.empty((k, a.TERM_INTS + 2 * len(terms)), np.int64)
            records[:, a.PIECE_TIMES], records[:, a.PIECE_TERMS] = times + 2 * (places - first), len(terms)
            records[:, a.TERM_INTS :: 2] = [coefficients.shape[1] for _, coefficients in terms]
            records[:, a.TERM_INTS + 1 :: 2] = put("waves", waves) + starts
            record_starts = put("ints", records) + np.arange(k) * records.shape[1]
            buffers.ints[buffers.ints[a.PIECES] + places] = record_starts
        buffers.ints[a.PIECE_COUNT] = last

    def reserve_until(self, buffers: Buffers, piece: int) -> None:
        """Pack the pieces up to one."""
        while self.prescribed and buffers.ints[a.PIECE_COUNT] <= piece:
            self.reserve(buffers)

    @property
    def first_end(self) -> float:
        """End [s] of the first piece of the channels, or of the motion."""
        return min(self._until, float(self._pieces.ends[0])) if self.prescribed else self._until

    def drive(self, piece: int) -> Drive:
        """Return the channels from the start of a piece on."""
        return self._excitation.drive(float(self._pieces.starts[piece]))

    def at(self, buffers: Buffers, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Set the channels to a time [s], and return w, w' (q,) of those that are functions of time."""
        if not self.prescribed:
            self.set(buffers, 0, time - float(self._pieces.starts[0]), time)
            return np.zeros(0), np.zeros(0)
        piece = max(int(np.searchsorted(self._pieces.starts, time, side="right")) - 1, 0)
        self.set(buffers, piece, time - float(self._pieces.starts[piece]), time)
        q, place = int(buffers.ints[a.PRESCRIBED]), int(buffers.ints[a.DRIVE])
        return buffers.numbers[place : place + q].copy(), buffers.numbers[place + q : place + 2 * q].copy()

    def set(self, buffers: Buffers, piece: int, age: float, time: float) -> None:
        """Set the channels to a time ``age`` [s] after the start of a piece, for the scales of the first state."""
        ints, numbers = buffers.ints, buffers.numbers
        ints[a.PIECE], numbers[a.AGE], numbers[a.HORIZON] = piece, age, 1.0
        if not self.prescribed:
            return
        self.reserve_until(buffers, piece)
        channel_values.load_piece(buffers.ints, buffers.waves)
        until = min(self._until, float(self._pieces.ends[piece]))
        channel_values.set_drive(*buffers.all, int(buffers.ints[a.DRIVE_NEXT]), age, time, until)
        channel_values.keep_drive(buffers.ints, buffers.waves)
