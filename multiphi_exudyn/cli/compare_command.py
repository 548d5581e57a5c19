"""``multiphi-exudyn compare``: all models of a scene side by side, as a report."""

from __future__ import annotations

import io
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from multiphi_exudyn.cli.options import results_folder
from multiphi_exudyn.files import write_whole
from multiphi_exudyn.study.comparison.compare import Comparison, compare, histories, summary
from multiphi_exudyn.study.comparison.findings import comparison_warnings, findings
from multiphi_exudyn.study.comparison.losses import loss_tables
from multiphi_exudyn.study.comparison.mode_shapes import level_modes
from multiphi_exudyn.study.comparison.report import render
from multiphi_exudyn.study.comparison.wording import percent, seconds, times
from multiphi_exudyn.study.running.environment import environment, import_times
from multiphi_exudyn.study.scene import load_scene
from multiphi_exudyn.study.setup import prepare

__all__ = ["run_compare"]


def run_compare(source: str, t_end: float | None, modes: int | None, out: Path | None) -> bool:
    """Run every model of a scene and write report.html, summary.json and histories.npz; return True if all ran."""
    scene = load_scene(source, t_end=t_end, modes=modes)
    setup = prepare(scene)
    folder = results_folder(out or Path(f"multiphi-{scene.name}"))
    with tqdm(total=len(scene.models) + 1, disable=None, unit="model") as bar:

        def started(name: str) -> None:
            bar.set_description(name)
            bar.update(int(name != next(iter(scene.models))))

        where = environment() | {"import_s": import_times()}
        comparison = compare(setup, where, progress=sys.stderr.isatty(), started=started)
        bar.update()
        bar.set_description("report")
        _write(comparison, folder)
        bar.update()
    _print_summary(comparison, folder)
    return all(run.ok for run in comparison.runs.values())


def _write(comparison: Comparison, folder: Path) -> None:
    """Write the results first and the report last, without incomplete files."""
    arrays = io.BytesIO()
    np.savez_compressed(arrays, allow_pickle=False, **dict[str, Any](histories(comparison)))
    content = json.dumps(summary(comparison), indent=1, allow_nan=False)
    page = render(comparison, level_modes(comparison), loss_tables(comparison.setup))
    write_whole(folder / "histories.npz", arrays.getvalue())
    write_whole(folder / "summary.json", content.encode())
    write_whole(folder / "report.html", page.encode())


def _print_summary(comparison: Comparison, folder: Path) -> None:
    until = comparison.headline_window
    width = max(map(len, comparison.runs))
    print(f"{'model':{width}}  {'status':6}  {'online':>9}  {'faster':>10}  NRMSE to {until:g} s")
    for name, run in comparison.runs.items():
        error = percent(comparison.worst_error(run, until)) if name in comparison.measured else "the reference"
        if name in comparison.rigid:
            error += f", from stiff stops {percent(comparison.stiff_error(run, until))}"
        line = f"{seconds(run.online_s):>9}  {times(comparison.speedup(run)):>10}  {error if run.ok else run.message}"
        print(f"{name:{width}}  {run.status:6}  {line}")
    found = findings(comparison)
    print("", *found["outcome"], found["distrust"][-1], sep="\n")  # the last one is of the run times
    for sentence in comparison_warnings(comparison):
        print(f"warning: {sentence}")
    print(folder / "report.html")
