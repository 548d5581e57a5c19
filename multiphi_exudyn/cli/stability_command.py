"""``multiphi-exudyn stability``: run every model through a catalogue of extreme cases."""

from __future__ import annotations

import json
from pathlib import Path

from tqdm import tqdm

from multiphi_exudyn.cli.options import results_folder
from multiphi_exudyn.files import write_whole
from multiphi_exudyn.study.running.environment import environment
from multiphi_exudyn.study.stability.catalogue_run import FULL_LENGTH, QUICK, chosen_cases, run_case
from multiphi_exudyn.study.stability.report import render_stability, text_table
from multiphi_exudyn.study.stability.summary import contents

__all__ = ["run_stability"]


def run_stability(name: str | None, quick: bool, out: Path | None) -> bool:
    """Run the catalogue or one case, write report.html, summary.json and table.txt; return True if no case is wrong."""
    cases = chosen_cases(name, quick)
    folder = results_folder(out or Path(f"multiphi-stability{'-quick' if quick else ''}"))
    results = []
    with tqdm(total=len(cases), disable=None, unit="case") as bar:
        for case in cases:
            bar.set_description(case.name)
            results.append(run_case(case, QUICK if quick else FULL_LENGTH))
            bar.update()
    where, table = environment(), text_table(results)
    content = json.dumps(contents(results, where, quick), indent=1, allow_nan=False)
    write_whole(folder / "summary.json", content.encode())
    write_whole(folder / "table.txt", f"{table}\n".encode())
    write_whole(folder / "report.html", render_stability(results, where, quick).encode())
    print(f"{table}\n{folder / 'report.html'}")
    return not any(result.wrong for result in results)
