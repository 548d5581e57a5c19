"""A study's settings along one axis: convergence with observed orders, and tables along a scene's axis.

With mesh size, step or tolerance h (h = 1 / value for modes and elements) the observed order is

    p = log(e1 / e2) / log(h1 / h2)        between consecutive values

and along a scene's axis, where h is the value itself, p says error ~ value**p.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import pandas as pd

from multiphi_exudyn.study.accuracy.study_file import REFERENCE, is_number
from multiphi_exudyn.study.accuracy.study_result import StudyResult
from multiphi_exudyn.study.store import key_of

__all__ = ["FINER", "Series", "numeric_axes", "series", "tables_along"]

FINER = {"modes": 1, "elements": 1, "step": -1, "rtol": -1, "tolerance": -1, "newton_tolerance": -1}  # if larger
QUANTITIES = ("largest", "first_contact", "inner_losses", "largest_force", "impulse")  # of a point or a contact


@dataclass(frozen=True)
class Series:
    """A method's settings along one numeric axis, all other fields fixed, those of the scene not counted.

    table: a line for each setting, with its value on the axis, ascending, and the order [-] since the line before.
    """

    method: str
    axis: str
    fixed: Mapping[str, Any]
    table: pd.DataFrame


def numeric_axes(table: pd.DataFrame, kind: str) -> list[str]:
    """Fields, of the scene (kind "at") or of the methods ("setting"), that take two or more numeric values."""
    values = pd.DataFrame(table[kind].tolist()).map(lambda value: value if is_number(value) else None)
    return [str(field) for field, count in values.nunique().items() if count > 1]


def series(table: pd.DataFrame, method: str, axis: str) -> Series | None:
    """The method along one axis, every other field at its finest value (those without one: at their first).

    Fields that leave fewer than two errors are passed over where others have them. None without two numeric values.
    """
    own = table[table.method == method]
    fields = pd.Series([{**at, **setting} for at, setting in zip(own["at"], own.setting, strict=True)], own.index)
    rest = fields.map(lambda each: {field: value for field, value in each.items() if field != axis})
    lines = own.assign(value=fields.map(lambda each: each.get(axis)), rest=rest)
    lines = lines[lines.value.map(is_number)]
    groups = [group for _, group in lines.groupby(lines.rest.map(key_of), sort=False) if len(group) > 1]
    if not groups:
        return None
    best = max(groups, key=lambda group: (group.error.count() > 1, _fineness(group.rest.iloc[0])))
    fixed = {field: value for field, value in best.setting.iloc[0].items() if field != axis}
    best = best.astype({"value": float}).sort_values("value")
    return Series(method, axis, fixed, best.assign(order=_orders(axis, best.value, best.error)))


def tables_along(result: StudyResult, axis: str) -> dict[str, pd.DataFrame]:
    """Quantity -> a row for each method, a column for each value along a scene's axis.

    First "error", then what each point and contact does, as "largest.tip".
    """
    methods = list(result.table.method.unique())
    lines = [line.table for name in methods if (line := series(result.table, name, axis))]
    whole = pd.concat(lines, ignore_index=True)
    measures = pd.json_normalize([{name: each.get(name, {}) for name in QUANTITIES} for each in whole.measures])
    cells = whole[["method", "value", "error"]].join(measures)
    tables = {}
    for quantity in ["error", *map(str, measures)]:
        table = cells.pivot(index="method", columns="value", values=quantity).astype(float)
        judged = [name for name in methods if name in table.index and (quantity, name) != ("error", REFERENCE)]
        tables[quantity] = table.loc[judged]
    return tables


def _fineness(fields: Mapping[str, Any]) -> tuple[float, ...]:
    """Larger is finer, field by field; "all" modes are finest, fields without a fine end do not count."""
    known = {name: value for name, value in fields.items() if name in FINER}
    return tuple(FINER[name] * value if is_number(value) else math.inf for name, value in known.items())


def _orders(axis: str, values: pd.Series, errors: pd.Series) -> pd.Series:
    """Observed order since the value before; NaN where an error is missing or zero, or the value changes its sign."""
    positive = (errors * errors.shift() > 0) & (values * values.shift() > 0)
    finer = (errors / errors.shift()).where(positive), (values / values.shift()).where(positive)
    return finer[0].map(math.log) / finer[1].map(math.log) * (-1 if FINER.get(axis) == 1 else 1)
