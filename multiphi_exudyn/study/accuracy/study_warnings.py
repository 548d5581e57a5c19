"""What the models of a study warn of, and how long their runs are determined, in words."""

from __future__ import annotations

from collections.abc import Iterable

from multiphi_exudyn.study.accuracy.analysis import Setting, StudyResult, longest, named, settings, words
from multiphi_exudyn.study.comparison.wording import percent
from multiphi_exudyn.study.scene.workbench import ROUND_OFF
from multiphi_exudyn.study.sweep.store import Row
from multiphi_exudyn.time.warning_groups import grouped

__all__ = ["warned"]


def warned(result: StudyResult) -> list[str]:
    """What the models warn of, a sentence for each kind, and how long their runs are determined."""
    rows = [row for row in (*result.rows, *result.budgets) if row.status == "ok"]
    found = [group.told(len(rows)) for group in grouped(_warnings(row) for row in rows)]
    return found + list(_nudged(result))


def _warnings(row: Row) -> tuple[str, list[str]]:
    """A run in words, and its warnings; of a budget those of its rungs."""
    given = row.parameters
    near = {f"{field} ×": factor for field, factor in given["nearby"].items()}
    fields = words({**given["at"], **given["setting"], **near})
    sentences = [each for rung in row.values.get("rungs", {}).values() for each in rung["warnings"]]
    return f"{given['method']}{f' ({fields})' if fields else ''}", row.values.get("warnings", sentences)


def _nudged(result: StudyResult) -> Iterable[str]:
    """The settings whose sensitivity horizon ends before their run, the shortest first."""
    ends = [(end, tolerance, setting) for setting in settings(result) for tolerance, end in _ends(setting)]
    early = sorted((each for each in ends if each[0] < ROUND_OFF * longest(result)), key=lambda each: each[0])
    if early:
        end, tolerance, shortest = early[0]
        yield (
            f"sensitivity: {len(early)} of {len(ends)} settings are not determined to the end: with a start changed by "
            f"1e-12 they differ by {percent(float(tolerance))}, the first one from {end:.3g} s on: {named(shortest)}"
        )


def _ends(setting: Setting) -> Iterable[tuple[str, float]]:
    return setting.values.get("horizon_s", {}).items()
