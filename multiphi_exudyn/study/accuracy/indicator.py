"""Does a model's own prediction of its error, made before anything full is run, rank the runs as their errors do?"""

from __future__ import annotations

import pandas as pd

from multiphi_exudyn.study.accuracy.study_file import COARSER, REFERENCE
from multiphi_exudyn.study.accuracy.study_result import StudyResult, error_of

__all__ = ["indicators", "rank_correlation"]

ROUND_OFF = 1e-9  # NRMSE below which two answers differ by round-off only
FEWEST = 3  # pairs that have a rank correlation


def indicators(result: StudyResult) -> pd.DataFrame:
    """method, indicator, error (NaN without) of every run that has an indicator, nearby ones included."""
    runs = [row for row in result.rows if row.parameters["method"] not in (REFERENCE, COARSER)]
    pairs = [(row.parameters["method"], row.values.get("indicator"), error_of(result, row)) for row in runs]
    frame = pd.DataFrame(pairs, columns=["method", "indicator", "error"])
    return frame.astype({"indicator": float, "error": float}).dropna(subset="indicator")


def rank_correlation(pairs: pd.DataFrame) -> tuple[float | None, int]:
    """Spearman's rank correlation of indicator and error, None without meaning, and of how many runs it is."""
    known = pairs[pairs.error >= ROUND_OFF]
    if len(known) < FEWEST or known.indicator.nunique() < 2 or known.error.nunique() < 2:
        return None, len(known)
    return float(known.indicator.corr(known.error, method="spearman")), len(known)
