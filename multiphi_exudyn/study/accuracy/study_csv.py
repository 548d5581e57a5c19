"""All numbers of a study as one CSV table, one line per run; column ``warnings``: its sentences as a JSON list."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping
from typing import Any

from multiphi_exudyn.study.accuracy.analysis import StudyResult
from multiphi_exudyn.study.sweep.store import Row, key_of

__all__ = ["csv_text"]


def csv_text(result: StudyResult) -> str:
    """One line per run, everything flattened to dotted columns: its error pass, its timing and its budget."""
    lines: dict[str, dict[str, Any]] = {}
    for prefix, rows in (("", result.rows), ("timing.", result.timings), ("budget.", result.budgets)):
        for row in rows:
            line = lines.setdefault(key_of(row.parameters), _flat(row.parameters))
            line |= {prefix + column: value for column, value in _cells(row).items()}
    buffer = io.StringIO()
    columns = list(dict.fromkeys(column for line in lines.values() for column in line))
    writer = csv.DictWriter(buffer, columns, restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(lines.values())
    return buffer.getvalue()


def _cells(row: Row) -> dict[str, Any]:
    of_run = {"status": row.status, "cause": row.message, "elapsed_s": row.elapsed_s, "finished": row.finished}
    return of_run | _flat(row.values)


def _flat(given: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Nested mappings as dotted columns, lists as JSON."""
    flat: dict[str, Any] = {}
    for name, value in given.items():
        if isinstance(value, Mapping):
            flat |= _flat(value, f"{prefix}{name}.")
        else:
            flat[prefix + name] = json.dumps(value) if isinstance(value, (list, tuple)) else value
    return flat
