"""Model warnings: what to distrust in a model or its levels, known before a run; run_warnings.py lists the kinds.

A kind is the text before a sentence's first colon. Warnings are issued once, those of many runs grouped by kind.

Of a large structure the small base leaves out parts of a start, of a row or of the levels. A start is judged in the
norm of the mass matrix, a row by its static flexibility. The base of a run includes the rows of its loads
(MultiPhiModel.holding), like contacts and points; a continued run keeps the base of its start.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.display import per_cent
from multiphi_exudyn.errors import MultiPhiWarning
from multiphi_exudyn.levels.level.level import Level
from multiphi_exudyn.levels.model.mode_choice import CONTACT_SHARE, Tolerance
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mechanics.damping import ModalDamping
from multiphi_exudyn.mechanics.modal_structure import ModalStructure

__all__ = [
    "CALLER",
    "REMEDY",
    "WarningGroup",
    "advised",
    "base_warnings",
    "cluster_warnings",
    "damping_warnings",
    "digit_warnings",
    "grouped",
    "issue",
    "kept_back",
    "missing_modes",
    "row_warnings",
    "static_warnings",
]

NAMED = 3  # runs of a group that its sentence names, one if their names are long
LONG = 60  # characters of these names
CALLER = 3  # level of the stack: the line that calls the caller of ``issue``

_is_keeping_back = ContextVar("is_keeping_back", default=False)  # of a thread: filters of warnings are of all threads
OUTSIDE = 1e-3  # of a start, or of the static flexibility at a row
INEXACT = 1e-8  # of omega^2 of the levels on which a base was judged
PER_CENT = 0.5  # a ratio of a structure is mostly below 0.1, and half of critical damping hardly leaves an oscillation
STICKING = 8  # modes of a level in which friction sticks: with so many its force is right to 5 % on the rig's beam
REMEDY = "give the model more modes, or modes=Tolerance(0.01)"


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


def base_warnings(model: MultiPhiModel, loads: np.ndarray, **start: np.ndarray | None) -> Iterator[str]:
    """Warnings of rows (k, n) of loads, of x and x' (n,) of a start by their names, and of the levels."""
    base = model.base
    if base.error > INEXACT:
        yield f"base: squares of frequencies of levels may be off by {base.error:.2g}; need more modes, or modes='all'"
    for row in model.lacking(loads):
        yield from _base_warning(model, model.outside(row), "the static flexibility at a load")
    for name, vector in start.items():
        if vector is not None:
            yield from _base_warning(model, _share_outside(model, np.asarray(vector, float)), f"the start's {name}")


def row_warnings(model: MultiPhiModel, row: np.ndarray) -> Iterator[str]:
    """Warning of a row (n,) that is no point."""
    yield from _base_warning(model, model.outside(row), "the static flexibility at a row")


def _share_outside(model: MultiPhiModel, vector: np.ndarray) -> float:
    """|x - Phi Phi^T M x| / |x| in the norm of M."""
    shapes, mass = model.base.modes.shapes, model.base.mass
    outside = vector - shapes @ (shapes.T @ (mass @ vector))
    square = float(vector @ (mass @ vector))
    return math.sqrt(max(float(outside @ (mass @ outside)), 0.0) / square) if square > 0 else 0.0


def _base_warning(model: MultiPhiModel, share: float, what: str) -> Iterator[str]:
    """Warning where the share of something outside the base is not small."""
    if share >= OUTSIDE:
        yield (
            f"base: {100 * share:.2g} % of {what} lies outside the {model.base.modes.count} coordinates of the levels' "
            "base; give the model more modes, or make it a point"
        )


def advised(sentences: Sequence[str], tolerance: Tolerance | None) -> tuple[str, ...]:
    """Sentences of a run, with another remedy than a tolerance where one has decided the modes."""
    if tolerance is None:
        return tuple(sentences)
    smaller = f"give Tolerance an error below {tolerance.error:g}, or the model a larger number of modes"
    return tuple(sentence.replace(REMEDY, smaller) for sentence in sentences)


def static_warnings(levels: Sequence[Level]) -> Iterator[str]:
    """Warning of the contact with the largest share of static flexibility that the modes of these levels leave out."""
    yield from _sticking(levels)
    held = {link.name for level in levels[:1] for link in level.base.links if link.held}
    shares = [
        (share, name, level.modes)
        for level in levels
        for name, share in level.static_shares.items()
        if name not in held
    ]
    share, name, modes = max(shares, default=(0.0, "", 0))
    if share >= CONTACT_SHARE:
        others = len({other for value, other, _ in shares if value >= CONTACT_SHARE}) - 1
        also = f" (and at {others} more)" if others else ""
        yield (
            f"truncated contact: at {name!r}{also} {modes} modes leave out {per_cent(share)} of the static "
            f"flexibility of the closed level, so peak contact forces are not to be trusted; {REMEDY}"
        )


def _sticking(levels: Sequence[Level]) -> Iterator[str]:
    """Warning of friction that sticks in a level of few modes, which leave out much of its flexibility there."""
    fewest: dict[str, int] = {}
    for level in levels:
        for link in (level.base.links[i] for i in level.indices if level.modes < STICKING):
            if link.held and (link.rigid or level.static_shares.get(link.name, 0.0) >= CONTACT_SHARE):
                fewest[link.name] = min(level.modes, fewest.get(link.name, STICKING))
    if fewest:
        names = ", ".join(repr(name) for name in fewest)
        yield (
            f"truncated friction: only {min(fewest.values())} modes are kept while {names} sticks, so its force may be "
            f"off by 5 % and more until it slips; {REMEDY}"
        )


def digit_warnings(model: MultiPhiModel) -> tuple[str, ...]:
    """Warnings of what the digits of the stiffness leave open of the structure's modes, cached by the model."""
    found: tuple[str, ...] | None = model.entries.find("digits")
    return model.entries.keep("digits", model.stiffness_warnings()) if found is None else found


def damping_warnings(model: MultiPhiModel) -> Iterator[str]:
    """Warnings of fewer modal ratios than modes, and of ratios that look like per cent."""
    damping = model.structure.damping
    if not isinstance(damping, ModalDamping):
        return
    listed = damping.listed
    if damping.beyond is None and 0 < len(listed) < (kept := model.level_at(()).modes):
        yield (
            f"undamped modes: ModalDamping lists {len(listed)} ratios and {kept} modes are kept, so modes "
            f"{len(listed) + 1} to {kept} are undamped; give beyond={listed[-1]:g}, or beyond=0.0 if that is meant"
        )
    if (largest := max(listed, default=0.0)) >= PER_CENT:
        yield (
            f"damping ratios: {largest:g} is {100 * largest:g} % of critical damping, which looks like a "
            "ratio in per cent; write 0.01 for 1 %"
        )


def missing_modes(model: MultiPhiModel) -> Iterator[str]:
    """Warning of contacts on a structure of modes at points without a known static flexibility."""
    structure = model.structure
    if not isinstance(structure, ModalStructure):
        return
    names = [link.name for link in model.contacts]
    places = [{at} if isinstance(at, str) else {*at} for at in (link.direction for link in model.contacts)]
    lacking = [name for name, points in zip(names, places, strict=True) if not points <= structure.completed]
    affected = list(dict.fromkeys(lacking))
    if affected:
        yield (
            f"missing modes: the structure has only its modes up to {structure.highest:g} Hz, so "
            f"{', '.join(map(repr, affected))} acts on too stiff a structure and its peak forces are not to be trusted"
            f"{_contact_frequency(model, [names.index(name) for name in affected], structure.highest)}; give "
            "structure_from_modes the static flexibility of these points (flexibility=)"
        )


def _contact_frequency(model: MultiPhiModel, contacts: Sequence[int], highest: float) -> str:
    """Clause on the frequency sqrt(k h.M^-1 h) of the modes on the stiffest contact, where above the highest mode."""
    k, lengths = model.base.stiffnesses[contacts], model.base.lengths[contacts]
    frequencies = np.sqrt(np.where(np.isfinite(k) & (k > 0), k, 0.0)) * lengths / (2 * math.pi)
    most = int(np.argmax(frequencies))
    if not 0 < highest < frequencies[most]:
        return ""
    return f" (on {k[most]:g} N/m these modes swing at up to {frequencies[most]:.3g} Hz, where others would as well)"


def cluster_warnings(levels: Sequence[Level]) -> list[str]:
    """One sentence where some of these levels keep more modes than the number given or chosen."""
    kept = [level for level in levels if level.kept_beyond]
    if not kept:
        return []
    most = max(kept, key=lambda level: level.kept_beyond)
    count, name = most.modes - most.kept_beyond, ", ".join(most.closed) or "open"
    return [
        f"cluster: {len(kept)} of {len(levels)} levels keep more modes than the number given or chosen, level ({name}) "
        f"{most.modes} in place of {count}, as a cut between modes of one frequency "
        f"({most.frequencies[count - 1]:.6g} Hz) would be arbitrary; modes={most.modes} says so"
    ]
