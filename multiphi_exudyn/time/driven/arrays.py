"""Levels under an excitation, and the pieces of its channels, as arrays (events/arrays.py)."""

from __future__ import annotations

import numpy as np

from multiphi_exudyn.events import arrays as a
from multiphi_exudyn.events import flow
from multiphi_exudyn.events.level_arrays import LevelArrays
from multiphi_exudyn.events.transition import LoadedLevel
from multiphi_exudyn.mathematics import flat_basis
from multiphi_exudyn.mathematics.free_response import ModalResponse
from multiphi_exudyn.time.driven.excitation import Drive
from multiphi_exudyn.time.driven.level import DrivenLevel
from multiphi_exudyn.time.driven.rule import DrivenRule

__all__ = ["DrivenArrays"]

POWERS = 96  # of a response to one term: where a carrier meets a pole it takes some 40
PIECES_AT_ONCE = 256  # packed when the loop comes to the end of those it knows


class DrivenArrays(LevelArrays):
    """What the loop knows of the levels of a rule under an excitation. drives: the pieces so far."""

    rule: DrivenRule

    def __init__(self, rule: DrivenRule) -> None:
        self.drives: list[Drive] = []
        super().__init__(rule)

    def forget(self) -> None:
        """Begin anew, without any level, and with the pieces from the first one on."""
        self._records: list[int] = []
        self._powers = POWERS
        super().forget()

    def _describe_elements(self) -> None:
        super()._describe_elements()
        self.ints[a.CHANNELS] = self.rule.excitation.channels
        self.ints[a.FORCED_ROOM] = self._powers
        self._reserve_terms()
        self._reserve_pieces()

    def _supply_channels(self) -> None:
        if self.ints[a.NEEDED] == a.NEED_PIECES:
            self._reserve_pieces()
            return
        self._powers = self.ints[a.FORCED_ROOM] = 2 * int(self.ints[a.FORCED_WANTED])
        self.ints[a.FORCED_WANTED] = 0
        n, _, exits = self._most
        self._reserve(
            n, max(self._exponentials(self._plain(level).level.response) for level in self.loaded.values()), exits
        )

    @property
    def _terms(self) -> int:
        """The largest number of coefficients of a channel's piece."""
        return max(history.coefficients.shape[1] for history in self.rule.excitation.histories)

    def _reserve_terms(self) -> None:
        """Memory for the channels at an instant, which lasts as long as the run."""
        q, count = int(self.ints[a.CHANNELS]), self._terms
        self.ints[a.DRIVE] = self.buffers.take("numbers", 6 * q)
        for slot in (a.DRIVE_WAVES, a.DRIVE_NEXT):
            self.ints[slot] = self.buffers.take("waves", q * count * q)
        self.ints[a.SCALED_TERM] = self.buffers.take("waves", count * q)

    def _scratch(self, n: int, p: int, signals: int) -> dict[str, dict[int, int]]:
        q, room = int(self.ints[a.CHANNELS]), max(self._powers, self._terms)
        sizes = super()._scratch(n, p, signals)
        sizes["numbers"] |= {a.FLOW_STATE: 4 * n}
        sizes["waves"] |= {a.FORCES: self._terms * n, a.FORCED: room * n, a.FORCED_WORK: 2 * room}
        sizes["waves"] |= {a.FLOW_FORCED: q * room * n}
        take = self.buffers.take
        given = {flat_basis.POWERS: take("ints", p), flat_basis.RATES: take("waves", p)}
        given[flat_basis.SCALES], record = take("numbers", 3), take("ints", flat_basis.BASIS)
        for slot, value in given.items():
            self.ints[record + slot] = value
        self.ints[a.FLOW_RECORD] = record
        return sizes

    def _parts(self, level: LoadedLevel) -> dict[int, np.ndarray]:
        assert isinstance(level, DrivenLevel)
        own, plain, r = level.level, level.plain.level, level.plain.level.modes
        motion = [-np.diag(plain.squares), level.force, -plain.damping, level.force_rate, level.asymptotic.drive]
        carried = np.hstack([level.carried.T @ plain.vectors, level.carried.T @ level.carried])
        patterns = level.excitation.patterns.T
        return {
            a.MOTION: np.column_stack(motion),
            a.GAPS: np.column_stack([own.gap_rows, level.gap_constants]),
            a.SPEEDS: np.column_stack([own.speed_rows, np.zeros(len(own.gap_rows))]),
            a.POTENTIAL: self._potential(level, r),
            a.PATTERNS: np.column_stack([patterns @ own.vectors, patterns @ level.asymptotic.configuration]),
            **({a.CARRIED: carried} if np.any(level.carried) else {}),
        }

    @staticmethod
    def _potential(level: DrivenLevel, r: int) -> np.ndarray:
        """Strain energy less the potential of the loads as a form in xi: constant, linear, squares (r,), rows of w."""
        own, base, y = level.level, level.level.base, level.asymptotic.configuration
        index = [i for i in own.indices if np.isfinite(base.stiffnesses[i])]
        springs, rows, gaps = base.stiffnesses[index], own.gap_rows[index], level.gap_constants[index]
        bent = base.modes.omega[:, None] * own.vectors
        form = bent.T @ bent + (rows.T * springs) @ rows
        pulled = level.excitation.patterns.T @ own.vectors
        form[r:] -= pulled
        form[:, r:] -= pulled.T
        load = base.modes.omega**2 * y - base.preload - level.excitation.static
        linear = own.vectors.T @ load + rows.T @ (springs * gaps)
        linear[r:] -= level.excitation.patterns.T @ y
        constant = 0.5 * float(np.sum((base.modes.omega * y) ** 2) + gaps**2 @ springs) + base.energy_offset
        constant -= float(y @ (base.preload + level.excitation.static))
        return np.concatenate([[constant], linear, np.diagonal(form)[:r], form[r:].ravel()])

    def _plain(self, level: LoadedLevel) -> LoadedLevel:
        assert isinstance(level, DrivenLevel)
        return level.plain

    def _exponentials(self, response: ModalResponse) -> int:
        return len(response.basis.rates) + int(self.ints[a.CHANNELS]) * self._powers

    # ------------------------------------------------------------------ pieces

    def _reserve_pieces(self) -> None:
        """Records of the pieces that follow."""
        put = self.buffers.put
        for k in range(len(self._records), len(self._records) + PIECES_AT_ONCE):
            if k == len(self.drives):
                time = self.drives[-1].until if k else self.rule.drive.time
                if k and time >= self.rule.until:
                    break
                self.drives.append(self.rule.excitation.drive(time))
            drive = self.drives[k]
            terms = [(len(given), put("waves", [rate, *given.ravel()])) for rate, given in drive.terms]
            times = put("numbers", [drive.time, drive.until])
            self._records.append(put("ints", [times, len(terms), *np.ravel(terms)]))
        self.ints[a.PIECES] = put("ints", self._records)
        self.ints[a.PIECE_COUNT] = len(self._records)

    def set_drive(self, piece: int, age: float, time: float) -> None:
        """The channels a time ``age`` after the beginning of a piece, for the scales of the first state."""
        while len(self._records) <= piece:
            self._reserve_pieces()
        self.ints[a.PIECE], self.numbers[a.AGE] = piece, age
        self.level(())
        flow.load_piece(self.ints, self.buffers.waves)
        until = min(self.rule.until, self.drives[piece].until)
        flow.set_drive(*self.buffers.all, int(self.ints[a.DRIVE_NEXT]), age, time, until)
        flow.keep_drive(self.ints, self.buffers.waves)
