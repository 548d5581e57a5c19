"""Warnings as they reach a user: issued once, those of many runs grouped by kind.

A kind is the text before a sentence's first colon (run_warnings.py).
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

from multiphi_exudyn.errors import MultiPhiWarning

__all__ = ["WarningGroup", "grouped", "issue", "kept_back"]

NAMED = 3  # runs of a group that its sentence names, one if their names are long
LONG = 60  # characters of these names


@dataclass(frozen=True)
class WarningGroup:
    """Warnings of one kind in many runs; runs: names of those that have it, in order; example: of the first one."""

    kind: str
    runs: tuple[str, ...]
    example: str

    def told(self, of: int) -> str:
        """The group as one sentence that begins with its kind; of: how many runs there are."""
        count = NAMED if len(", ".join(self.runs[:NAMED])) <= LONG else 1
        names, more = ", ".join(self.runs[:count]), len(self.runs) - count
        listed = f"{names} and {more} more" if more > 0 else names
        if of == 1:
            return f"{self.kind}: {self.example}"
        return f"{self.kind}: {len(self.runs)} of {of} runs ({listed}); the first: {self.example}"


def grouped(runs: Iterable[tuple[str, Sequence[str]]]) -> tuple[WarningGroup, ...]:
    """(name of a run, its warnings) of many runs, by kind in the order of their first appearance."""
    found = dict[str, tuple[str, dict[str, None]]]()  # the first sentence of a kind, and the runs in order
    for run, sentences in runs:
        for kind, _, rest in (sentence.partition(": ") for sentence in sentences):
            found.setdefault(kind, (rest, {}))[1][run] = None
    return tuple(WarningGroup(kind, tuple(names), example) for kind, (example, names) in found.items())


def issue(sentences: Iterable[str]) -> None:
    """Each as a MultiPhiWarning, at the line that has called the function which calls this one."""
    for sentence in sentences:
        warnings.warn(sentence, MultiPhiWarning, stacklevel=3)


@contextmanager
def kept_back() -> Iterator[None]:
    """No MultiPhiWarning is issued in here: who makes many runs takes the sentences from them and tells the groups."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MultiPhiWarning)
        yield
