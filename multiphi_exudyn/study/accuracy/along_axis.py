"""A study's settings along one axis: convergence with observed orders, and tables along a scene's axis.

With mesh size, step or tolerance h (h = 1 / value for modes and elements) the observed order is

    p = log(e1 / e2) / log(h1 / h2)        between consecutive values

and along a scene's axis, where h is the value itself, p says error ~ value**p.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import pandas as pd

from multiphi_exudyn.study.accuracy.analysis import names_of, references, settings
from multiphi_exudyn.study.accuracy.study_file import REFERENCE, is_number
from multiphi_exudyn.study.accuracy.study_result import Setting, StudyResult
from multiphi_exudyn.study.sweep.row import key_of

__all__ = ["FINEST", "Series", "Table", "numeric_axes", "series", "tables_along"]

FINEST: Mapping[str, Callable[[Iterable[float]], float]] = {
    "modes": max,
    "elements": max,
    "step": min,
    "rtol": min,
    "tolerance": min,
    "newton_tolerance": min,
}


QUANTITIES = ("largest", "first_contact", "inner_losses", "largest_force", "impulse")  # of a point or a contact


@dataclass(frozen=True)
class Series:
    """A method's settings along one numeric axis, values ascending, all other fields fixed."""

    method: str
    axis: str
    fixed: Mapping[str, Any]
    settings: tuple[Setting, ...]

    @property
    def fixed_setting(self) -> dict[str, Any]:
        """The method's own fixed fields, without those of the scene."""
        return {field: value for field, value in self.fixed.items() if field in self.settings[0].setting}

    @property
    def values(self) -> tuple[float, ...]:
        """Along the axis."""
        return tuple(_fields(setting)[self.axis] for setting in self.settings)

    @property
    def errors(self) -> tuple[float | None, ...]:
        """Worst of nearby, None in a gap."""
        return tuple(setting.error for setting in self.settings)

    @property
    def orders(self) -> tuple[float | None, ...]:
        """Observed orders between consecutive values; along a scene's axis p of error ~ value**p."""
        sign = -1.0 if FINEST.get(self.axis) is max else 1.0
        pairs = list(zip(self.values, self.errors, strict=True))
        return tuple(_order(*one, *two, sign) for one, two in itertools.pairwise(pairs))


@dataclass(frozen=True)
class Table:
    """One quantity along a scene's axis: a row for each method, a column for each value; contact: or point, or ""."""

    quantity: str
    contact: str
    axis: str
    frame: pd.DataFrame


def series(settings: Sequence[Setting], method: str, axis: str) -> Series | None:
    """The method along one axis, every other field at its finest value (those without one: at their first).

    Fields that leave fewer than two errors are passed over where others have them. None without two numeric values.
    """
    groups: dict[str, list[Setting]] = {}
    for setting in settings:
        if setting.method == method and is_number(_fields(setting).get(axis)):
            groups.setdefault(key_of(_others(setting, axis)), []).append(setting)
    known = [sorted(group, key=lambda s: _fields(s)[axis]) for group in groups.values() if len(group) > 1]
    if not known:
        return None
    best = max(known, key=lambda group: (sum(s.error is not None for s in group) > 1, _fineness(group[0], axis)))
    return Series(method, axis, _others(best[0], axis), tuple(best))


def numeric_axes(settings: Sequence[Setting], of_scene: bool) -> list[str]:
    """Fields, of the scene or of the methods, that take two or more numeric values."""
    found: dict[str, set[float]] = {}
    for setting in settings:
        for field, value in (setting.at if of_scene else setting.setting).items():
            if is_number(value):
                found.setdefault(field, set()).add(value)
    return [field for field, values in found.items() if len(values) > 1]


def tables_along(result: StudyResult, axis: str) -> list[Table]:
    """Error, and what each point and contact does, along a scene's axis, by method."""
    everything = [*references(result), *settings(result)]
    lines = [line for name in names_of(everything) if (line := series(everything, name, axis))]
    found = [setting.values for line in lines for setting in line.settings]
    named = {q: dict.fromkeys(name for values in found for name in values.get(q, {})) for q in QUANTITIES}
    wanted = [("error", ""), *((quantity, name) for quantity, names in named.items() for name in names)]
    return [Table(quantity, name, axis, _frame(lines, quantity, name)) for quantity, name in wanted]


def _fields(setting: Setting) -> dict[str, Any]:
    return {**setting.at, **setting.setting}


def _others(setting: Setting, axis: str) -> dict[str, Any]:
    return {field: value for field, value in _fields(setting).items() if field != axis}


def _fineness(setting: Setting, axis: str) -> tuple[float, ...]:
    """Larger is finer, field by field; fields without a fine end do not count, so the first one stays."""
    others = _others(setting, axis)
    return tuple(_fine(FINEST[field], value) for field, value in others.items() if field in FINEST)


def _fine(finest: Callable[..., float], value: Any) -> float:
    if not is_number(value):
        return math.inf  # "all" modes
    return float(value) if finest is max else -float(value)


def _order(h1: float, e1: float | None, h2: float, e2: float | None, sign: float) -> float | None:
    if not e1 or not e2 or h1 * h2 <= 0 or h1 == h2:
        return None
    return sign * math.log(e1 / e2) / math.log(h1 / h2)


def _frame(lines: Sequence[Series], quantity: str, name: str) -> pd.DataFrame:
    shown = [line for line in lines if (quantity, line.method) != ("error", REFERENCE)]
    cells = {
        line.method: pd.Series([_cell(each, quantity, name) for each in line.settings], line.values, dtype=float)
        for line in shown
    }
    return pd.DataFrame(cells).sort_index().T


def _cell(setting: Setting, quantity: str, name: str) -> float | None:
    return setting.error if quantity == "error" else setting.values.get(quantity, {}).get(name)
