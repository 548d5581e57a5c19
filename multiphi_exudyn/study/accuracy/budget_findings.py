"""Error budgets in plain words: what each difference is made of, and whether its parts explain it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from multiphi_exudyn.study.accuracy.analysis import StudyResult, words
from multiphi_exudyn.study.comparison.wording import percent

__all__ = ["budget_asked", "budget_outcome"]

SHOWN = 0.01  # of the whole difference: a smaller share of it is not named


def budget_asked(result: StudyResult) -> str:
    """What the budgets are about."""
    axes = result.study.axes
    where = f", at {len(result.budgets)} points of {' × '.join(axes)}" if axes else ""
    return (
        "Where does the difference between the full and the reduced model come from? One run per rung of a ladder from "
        f"one to the other, one cause per difference. Scene: {result.study.scene}{where}; "
        f"{', '.join(result.judged_points)} together."
    )


def budget_outcome(result: StudyResult) -> Iterable[str]:
    """One sentence per budget and ladder, for the longest window."""
    for row in result.budgets:
        at = f"At {words(row.parameters['at'])}: " if row.parameters["at"] else ""
        if row.status != "ok":
            yield f"{at}{row.status}, {row.message}."
        if not row.values:
            continue
        window, ladders = max(row.values["windows"].items(), key=lambda item: float(item[0]))
        for ladder, groups in ladders.items():
            yield f"{at}{ladder} levels, to {window} s: {_parts(groups['all'])}"


def _parts(found: Mapping[str, Any] | None) -> str:
    if found is None:
        return "fewer than two of the models ran."
    known = [part for part in found["parts"] if part["share"] is not None]
    named = sorted((part for part in known if abs(part["share"]) >= SHOWN), key=lambda part: -part["share"])
    shares = ", ".join(f"{part['cause']} {100 * part['share']:.0f} %" for part in named)
    explained = {True: "the parts explain it", False: "the parts do not explain it", None: "not checked"}
    return f"{percent(found['total'])} in all, of which {shares}; {explained[found['explained']]}."
