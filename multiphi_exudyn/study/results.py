"""The results of a study as a pandas table; pandas is only loaded where a table is asked for."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from multiphi_exudyn.errors import MultiPhiValueError

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["TABLE", "load"]

TABLE = "runs.csv"  # in a study's folder
CHOSEN = ("at.", "setting.", "nearby.")  # columns of what was varied, numbers beside words like "rigid"


def load(folder: str | Path) -> pd.DataFrame:
    """The results of a finished study as a tidy pandas table: one row for each run.

    Parameters
    ----------
    folder : the study's folder, ``multiphi-NAME`` or what ``--out`` named; its ``runs.csv`` is read.

    Returns
    -------
    DataFrame with the columns (empty where a run has no such number; seconds, metres, newtons, joules):

    - what was run: ``scene``, ``method`` ("reference" and its copy "coarser" among them), ``at.FIELD`` the place in the
      scene and its value, ``setting.FIELD`` the method's own, ``nearby.FIELD`` the factor of a neighbouring setting
    - ``status`` "ok", "failed" or "over budget", ``cause``, ``warnings`` a list of sentences, ``label``, ``kind``,
      ``dofs``, ``steps``
    - ``error``: the largest NRMSE of the judged points in the study's window
    - against the reference: ``nrmse.WINDOW.POINT``, ``max_difference.WINDOW.POINT`` [m],
      ``spectral_difference.WINDOW.POINT``, ``horizon.TOLERANCE`` [s], ``indicator`` the model's own prediction of its
      error, ``horizon_s.TOLERANCE`` [s] until when it agrees with itself nudged by 1e-12
    - ``largest.POINT`` [m] the largest displacement; of each contact ``largest_force.CONTACT`` [N],
      ``impulse.CONTACT`` [N s], ``first_contact.CONTACT`` [s], ``contact_count.CONTACT``, ``closed_time.CONTACT`` [s],
      ``inner_losses.CONTACT``, ``intervals.CONTACT`` a list of [closed, open] [s]
    - ``energy_end`` [J], ``ledger.ROW`` [J]
    - of the timing pass ``timing.online_s`` the median, ``timing.first_s``, ``timing.offline_s``, ``timing.repeats_s``
    - ``budget.NAME``: the parts of an error budget; ``elapsed_s``, ``finished``

    How the numbers are defined stands at the end of the study's report. For instance, the largest force by gap and
    stiffness::

        runs = multiphi_exudyn.study.load("multiphi-study")
        ours = runs[(runs.method == "Multi-Phi") & (runs["setting.modes"] == 16)]
        ours.pivot_table("largest_force.stop", "at.contacts.*.gap", "at.contacts.*.stiffness")
    """
    import pandas as pd

    path = Path(folder) / TABLE
    if not path.is_file():
        raise MultiPhiValueError(f"folder: got {str(folder)!r}, need the folder of a finished study, with {TABLE}")
    found = pd.read_csv(path)
    for name in found.columns[found.dtypes.map(pd.api.types.is_string_dtype)]:
        lists = found[name].astype(str).str.startswith("[").any()
        if lists or name.startswith(CHOSEN):
            found[name] = pd.Series([_value(cell) for cell in found[name]], index=found.index, dtype=object)
    return found


def _value(cell: Any) -> Any:
    """What a text stands for: a number, a list, or itself."""
    try:
        return json.loads(cell)
    except (TypeError, ValueError):
        return cell
