"""``multiphi-exudyn study``: run or continue a study, and write its report, table and pictures."""

from __future__ import annotations

import sys
from pathlib import Path

from multiphi_exudyn.cli.options import results_folder
from multiphi_exudyn.files import write_whole
from multiphi_exudyn.study.accuracy.analysis import cheapest, points, words
from multiphi_exudyn.study.accuracy.cases import load_study
from multiphi_exudyn.study.accuracy.study import run_study
from multiphi_exudyn.study.accuracy.study_findings import findings, records, study_warnings
from multiphi_exudyn.study.accuracy.study_report import render_study
from multiphi_exudyn.study.accuracy.study_result import StudyResult, csv_text
from multiphi_exudyn.study.comparison.wording import percent, seconds, share, times
from multiphi_exudyn.study.results import TABLE
from multiphi_exudyn.study.store import Store
from multiphi_exudyn.study.sweep import open_executor

__all__ = ["run_study_file"]

STORE = "runs.sqlite"


def run_study_file(source: str, out: Path | None, quick: bool, where: str, workers: int | None) -> bool:
    """Run a study in its folder; return True if all references, all budgets and a setting of every method ran."""
    study = load_study(source, quick=quick)
    folder = results_folder(out or Path(f"multiphi-{study.name}{'-quick' if quick else ''}"))
    with Store(folder / STORE) as store, open_executor(where, workers) as executor:
        result = run_study(study, store, executor, progress=sys.stderr.isatty())
    write_whole(folder / TABLE, csv_text(result).encode())
    write_whole(folder / "report.html", render_study(result).encode())
    _print_summary(result, folder)
    return _complete(result)


def _complete(result: StudyResult) -> bool:
    ran = {row.parameters["method"] for row in result.rows if row.status == "ok"}
    references = all(row.status == "ok" for row in result.rows if row.parameters["method"] == "reference")
    budgets = all(row.status == "ok" for row in result.budgets)
    return references and budgets and {method.name for method in result.study.methods} <= ran


def _print_summary(result: StudyResult, folder: Path) -> None:
    """The cheapest setting of every method for every tolerance, at its worst point of the axes; untimed, errors."""
    places = points(result) if result.rows else [{}]
    several = len(places) > 1
    everywhere = f" at all {len(places)} points" if several else ""
    for tolerance in result.study.tolerances if result.timings else ():
        print(f"\ncheapest within {share(tolerance)}{everywhere} (NRMSE to {result.window:g} s)")
        print(f"  {'method':32}  {'online':>9}  {'faster':>12}  {'error':>8}  setting")
        for best in records(cheapest(result, None if several else places[0], tolerance)):
            if best["online_s"] is None:
                print(f"  {best['method']:32}  none")
                continue
            numbers = f"{seconds(best['online_s']):>9}  {times(best['faster']):>12}  {percent(best['error']):>8}"
            worst = f"; worst at {words(best['at'])}" if several else ""
            print(f"  {best['method']:32}  {numbers}  {words(best['setting'])}{worst}")
    if not result.timings:
        print("", *findings(result)["outcome"], sep="\n")
    rows = result.rows + result.budgets
    failed = sum(row.status != "ok" for row in rows)
    for sentence in study_warnings(result):
        print(f"warning: {sentence}")
    print(f"\n{len(rows)} runs, {failed} without an answer\n{folder / 'report.html'}")
