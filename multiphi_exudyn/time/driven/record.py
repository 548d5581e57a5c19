"""What the loop has done under an excitation, taken from its arrays."""

from __future__ import annotations

from multiphi_exudyn.time.driven.excitation import Drive
from multiphi_exudyn.time.driven.flow import Flow
from multiphi_exudyn.time.driven.level import DrivenLevel
from multiphi_exudyn.time.driven.segment import DrivenSegment
from multiphi_exudyn.time.record import Record
from multiphi_exudyn.time.segment import Batch, Segment, batched

__all__ = ["DrivenRecord"]


class DrivenRecord(Record):
    """Segments and events of a run whose channels have these pieces; more may follow."""

    def __init__(self, names: list[str], drives: list[Drive]) -> None:
        super().__init__(names)
        self._drives = drives

    def segment(self, i: int) -> Segment:
        """The i-th segment."""
        level = self.level(i)
        assert isinstance(level, DrivenLevel)
        start, end, armed_at, horizon, work, age = self.spans[i].tolist()
        flow = Flow.of(level, *self.state(i), self._drives[self.rows[i, 1]].after(age), horizon)
        return DrivenSegment(start, end, level, flow.coefficients, self.standing(i), armed_at, flow, work)

    def batches(self) -> list[Batch]:
        """The segments by level and exponentials."""
        return batched(dict(enumerate(self.segments())))
