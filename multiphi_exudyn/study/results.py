"""Load the results of a study as a pandas table; pandas is imported at the first call."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from multiphi_exudyn.errors import MultiPhiValueError

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["TABLE", "load"]

TABLE = "runs.csv"  # in a study's folder
VARIED = ("at.", "setting.", "nearby.")  # columns of varied fields, with numbers and words like "rigid"


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
    - of the timing pass ``timing.online_s`` the median, ``timing.first_s``, ``timing.offline_s``, ``timing.repeats_s``;
      ``turns.online_s``, ``turns.repeats_s`` of settings near the cheapest, timed in turns:
      the lower quartile, and the times of all rounds [s]
    - ``elapsed_s``, ``finished``

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
    table = pd.read_csv(path)
    for name in table.columns[table.dtypes.map(pd.api.types.is_string_dtype)]:
        lists = table[name].astype(str).str.startswith("[").any()
        if lists or name.startswith(VARIED):
            table[name] = pd.Series([_value(cell) for cell in table[name]], index=table.index, dtype=object)
    return table


def _value(cell: Any) -> Any:
    """Value of a cell: a number, a list, or the text itself."""
    try:
        return json.loads(cell)
    except (TypeError, ValueError):
        return cell
