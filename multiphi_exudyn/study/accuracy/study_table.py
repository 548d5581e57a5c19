"""All numbers of a study as one tidy pandas table, a row for each run; ``multiphi_exudyn.study.load`` says which
columns.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import pandas as pd

from multiphi_exudyn.study.accuracy.study_result import StudyResult, error_of
from multiphi_exudyn.study.sweep.row import Row, key_of

__all__ = ["csv_text", "table"]


def table(result: StudyResult) -> pd.DataFrame:
    """One row for each run: its error pass, its timing and its budget."""
    lines: dict[str, dict[str, Any]] = {}
    for row in result.rows:
        lines[key_of(row.parameters)] = {**row.parameters, **_of_run(row), "error": error_of(result, row)}
    for name, rows in (("timing", result.timings), ("budget", result.budgets)):
        for row in rows:
            lines.setdefault(key_of(row.parameters), dict(row.parameters))[name] = _of_run(row)
    return pd.DataFrame([dict(_flat(line)) for line in lines.values()])


def csv_text(result: StudyResult) -> str:
    """The same as CSV; lists are JSON."""
    return table(result).map(_text).to_csv(index=False, lineterminator="\n")


def _of_run(row: Row) -> dict[str, Any]:
    of_run = {"status": row.status, "cause": row.message, "elapsed_s": row.elapsed_s, "finished": row.finished}
    return {**of_run, **row.values}


def _flat(given: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Nested tables as dotted columns."""
    for name, value in given.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{name}.")
        else:
            yield prefix + name, value


def _text(cell: Any) -> Any:
    return json.dumps(cell) if isinstance(cell, Sequence) and not isinstance(cell, str) else cell
