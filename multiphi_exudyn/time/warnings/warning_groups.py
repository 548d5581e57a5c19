"""Warning groups: warnings are issued once, those of many runs grouped by kind.

A kind is the text before a sentence's first colon (run_warnings.py).
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass

from multiphi_exudyn.errors import MultiPhiWarning

__all__ = ["CALLER", "WarningGroup", "grouped", "issue", "kept_back"]

NAMED = 3  # runs of a group that its sentence names, one if their names are long
LONG = 60  # characters of these names
CALLER = 3  # level of the stack: the line that calls the caller of ``issue``

_is_keeping_back = ContextVar("is_keeping_back", default=False)  # of a thread: filters of warnings are of all threads


@dataclass(frozen=True)
class WarningGroup:
    """Warnings of one kind in many runs; runs: names of the runs, in order; example: sentence of the first one."""

    kind: str
    runs: tuple[str, ...]
    example: str

    def told(self, of: int) -> str:
        """Return the group as one sentence that begins with its kind; of: number of all runs."""
        count = NAMED if len(", ".join(self.runs[:NAMED])) <= LONG else 1
        names, more = ", ".join(self.runs[:count]), len(self.runs) - count
        listed = f"{names} and {more} more" if more > 0 else names
        if of == 1:
            return f"{self.kind}: {self.example}"
        return f"{self.kind}: {len(self.runs)} of {of} runs ({listed}); the first: {self.example}"


def grouped(runs: Iterable[tuple[str, Sequence[str]]]) -> tuple[WarningGroup, ...]:
    """Group (name of a run, its warnings) of many runs by kind, in the order of first appearance."""
    groups = dict[str, tuple[str, dict[str, None]]]()  # the first sentence of a kind, and the runs in order
    for run, sentences in runs:
        for kind, _, text in (sentence.partition(": ") for sentence in sentences):
            groups.setdefault(kind, (text, {}))[1][run] = None
    return tuple(WarningGroup(kind, tuple(names), example) for kind, (example, names) in groups.items())


def issue(sentences: Iterable[str], level: int = CALLER) -> None:
    """Issue each sentence as a MultiPhiWarning, at a level of the stack; nothing inside ``kept_back``."""
    for sentence in () if _is_keeping_back.get() else sentences:
        warnings.warn(sentence, MultiPhiWarning, level)  # by a keyword it takes a seventh longer


@contextmanager
def kept_back() -> Iterator[None]:
    """Keep back what ``issue`` would issue inside, in this thread: sentences of many runs are issued in groups."""
    token = _is_keeping_back.set(True)
    try:
        yield
    finally:
        _is_keeping_back.reset(token)
