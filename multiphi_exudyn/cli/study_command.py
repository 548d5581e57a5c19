"""``multiphi-exudyn study``: run or continue a study, and write its report, table and pictures."""

from __future__ import annotations

import sys
from pathlib import Path

from multiphi_exudyn.cli.options import results_folder
from multiphi_exudyn.files import write_whole
from multiphi_exudyn.study.accuracy.analysis import cheapest, points, settings, times_faster, words
from multiphi_exudyn.study.accuracy.analysis import full_methods as full_methods_of
from multiphi_exudyn.study.accuracy.cases import load_study
from multiphi_exudyn.study.accuracy.study import run_study
from multiphi_exudyn.study.accuracy.study_report import render_study
from multiphi_exudyn.study.accuracy.study_result import StudyResult
from multiphi_exudyn.study.accuracy.study_table import csv_text
from multiphi_exudyn.study.accuracy.study_warnings import warned
from multiphi_exudyn.study.comparison.wording import percent, seconds, share, times
from multiphi_exudyn.study.results import TABLE
from multiphi_exudyn.study.sweep.executors import open_executor
from multiphi_exudyn.study.sweep.store import Store

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
    """Print the cheapest setting of every method for every tolerance, at the first point of the axes, if timed."""
    all_points = points(result) if result.rows else [{}]
    at = all_points[0]
    first = f", at the first of {len(all_points)} points: {words(at)}" if at else ""
    settings_here = [setting for setting in settings(result) if setting.at == at]
    full = full_methods_of(result)
    for tolerance in result.study.tolerances if result.timings else ():
        chosen = cheapest(settings_here, tolerance)
        faster = times_faster(chosen, full)
        print(f"\ncheapest within {share(tolerance)} (NRMSE to {result.window:g} s){first}")
        print(f"  {'method':32}  {'online':>9}  {'faster':>12}  {'error':>8}  setting")
        for name, setting in chosen.items():
            if setting is None:
                print(f"  {name:32}  none")
                continue
            line = (
                f"{seconds(setting.online_s or 0.0):>9}  {times(faster[name]):>12}  {percent(setting.error or 0.0):>8}"
            )
            print(f"  {name:32}  {line}  {words(setting.setting)}")
    rows = result.rows + result.budgets
    failed = sum(row.status != "ok" for row in rows)
    for sentence in warned(result):
        print(f"warning: {sentence}")
    print(f"\n{len(rows)} runs, {failed} without an answer\n{folder / 'report.html'}")
