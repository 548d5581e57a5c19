"""Does a model's own prediction of its error, made before anything full is run, rank the runs as their errors do?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import scipy.stats

from multiphi_exudyn.study.accuracy.analysis import COARSER, REFERENCE, StudyResult, error_of

__all__ = ["Correlation", "indicators", "rank_correlation"]

ROUND_OFF = 1e-9  # NRMSE below which two answers differ by round-off only
FEWEST = 3  # pairs that have a rank correlation


@dataclass(frozen=True)
class Correlation:
    """Spearman's rank correlation: coefficient (None without meaning), from how many runs; left_out: cause -> runs."""

    coefficient: float | None
    runs: int
    left_out: Mapping[str, int]


def indicators(result: StudyResult) -> dict[str, list[tuple[float | None, float | None]]]:
    """Method -> (indicator, error) of every run of it that has an indicator, nearby ones included."""
    found: dict[str, list[tuple[float | None, float | None]]] = {}
    for row in result.rows:
        if row.values.get("indicator") is not None and row.parameters["method"] not in (REFERENCE, COARSER):
            found.setdefault(row.parameters["method"], []).append((row.values["indicator"], error_of(result, row)))
    return found


def rank_correlation(indicator: Sequence[float | None], error: Sequence[float | None]) -> Correlation:
    """Do larger indicators go with larger errors? Runs without meaning are left out and counted."""
    pairs, left_out = [], dict.fromkeys(("no indicator", "no error", "error below 1e-9"), 0)
    for given, true in zip(indicator, error, strict=True):
        if given is None:
            left_out["no indicator"] += 1
        elif true is None:
            left_out["no error"] += 1
        elif true < ROUND_OFF:
            left_out["error below 1e-9"] += 1
        else:
            pairs.append((given, true))
    return Correlation(_spearman(pairs), len(pairs), {cause: n for cause, n in left_out.items() if n})


def _spearman(pairs: Sequence[tuple[float, float]]) -> float | None:
    if len(pairs) < FEWEST or any(len(set(side)) < 2 for side in zip(*pairs, strict=True)):
        return None
    return float(scipy.stats.spearmanr(*zip(*pairs, strict=True)).statistic)
