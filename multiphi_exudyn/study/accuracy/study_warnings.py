"""What the models of a study warn of, and how long their runs are determined, in words."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from multiphi_exudyn.study.accuracy.analysis import longest, named, settings, words
from multiphi_exudyn.study.accuracy.study_result import Setting, StudyResult
from multiphi_exudyn.study.comparison.wording import listed, share
from multiphi_exudyn.study.scene.workbench import ROUND_OFF
from multiphi_exudyn.study.sweep.row import Row
from multiphi_exudyn.time.warning_groups import WarningGroup, grouped

__all__ = ["warned"]

NAMED = 3  # settings of a method that are named one by one


def warned(result: StudyResult) -> list[str]:
    """What the models warn of, a sentence for each kind, and how long their runs are determined."""
    rows = [row for row in (*result.rows, *result.budgets) if row.status == "ok"]
    found = grouped((str(number), _warnings(row)) for number, row in enumerate(rows))
    return [_told(group, [rows[int(run)] for run in group.runs], len(rows)) for group in found] + list(_nudged(result))


def _warnings(row: Row) -> list[str]:
    """Of a run; of a budget those of its rungs."""
    rungs = row.values.get("rungs", {}).values()
    return list(row.values.get("warnings", [sentence for rung in rungs for sentence in rung["warnings"]]))


def _told(group: WarningGroup, rows: Sequence[Row], of: int) -> str:
    """A kind of warning: how many runs have it, of which settings of which methods, and what the first one says."""
    methods = dict[str, dict[str, None]]()
    for row in rows:
        methods.setdefault(row.parameters["method"], {})[words(row.parameters["setting"])] = None
    which = "; ".join(_method(method, [s for s in settings if s]) for method, settings in methods.items())
    return f"{group.kind}: {len(rows)} of {of} runs ({which}); the first: {group.example}"


def _method(name: str, settings: Sequence[str]) -> str:
    shown = settings if len(settings) <= NAMED else [f"{settings[0]} to {settings[-1]}"]
    return f"{name}, {listed(shown)}" if shown else name


def _nudged(result: StudyResult) -> Iterable[str]:
    """The settings whose sensitivity horizon ends before their run, the shortest first."""
    ends = [(end, tolerance, setting) for setting in settings(result) for tolerance, end in _ends(setting)]
    early = sorted((each for each in ends if each[0] < ROUND_OFF * longest(result)), key=lambda each: each[0])
    if early:
        end, tolerance, shortest = early[0]
        yield (
            f"sensitivity: {len(early)} of {len(ends)} settings are not determined to the end: with a start changed by "
            f"1e-12 they differ by {share(float(tolerance))}, the first one from {end:.3g} s on: {named(shortest)}"
        )


def _ends(setting: Setting) -> Iterable[tuple[str, float]]:
    return setting.values.get("horizon_s", {}).items()
