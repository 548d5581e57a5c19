"""``multiphi-exudyn budget``: where the difference between a scene's reduced and full model comes from."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from multiphi_exudyn.cli.options import results_folder
from multiphi_exudyn.files import write_whole
from multiphi_exudyn.study.accuracy.budget import budget
from multiphi_exudyn.study.accuracy.budget_figure import budget_figure
from multiphi_exudyn.study.comparison.figure_style import png
from multiphi_exudyn.study.comparison.wording import percent
from multiphi_exudyn.study.scene import load_scene
from multiphi_exudyn.study.setup import prepare
from multiphi_exudyn.time.model_warnings import grouped

__all__ = ["run_budget"]


def run_budget(source: str, t_end: float | None, modes: int | None, out: Path | None) -> bool:
    """Run all models of a scene's error budget and write budget.json and budget.png; return True if none failed."""
    scene = load_scene(source, t_end=t_end, modes=modes)
    setup = prepare(scene)
    folder = results_folder(out or Path(f"multiphi-{scene.name}"))
    values = budget(setup, scene.file.modes, progress=sys.stderr.isatty()).values()
    write_whole(folder / "budget.json", json.dumps(values, indent=1).encode())
    write_whole(folder / "budget.png", png(budget_figure([values])))
    _print_summary(values)
    print(f"\n{folder / 'budget.png'}")
    return all(rung["status"] == "ok" for rung in values["rungs"].values())


def _print_summary(values: dict[str, Any]) -> None:
    for name, rung in values["rungs"].items():
        if rung["status"] != "ok":
            print(f"{name}: {rung['status']}, {rung['message']}")
    rungs = values["rungs"]
    for group in grouped((name, rung["warnings"]) for name, rung in rungs.items()):
        print(f"warning: {group.told(len(rungs))}")
    for window, ladders in values["windows"].items():
        for ladder, groups in ladders.items():
            total = groups["all"]
            print(f"\n{ladder} ladder, to {window} s, judged points together")
            if total is None:
                print("  fewer than two of its models ran")
                continue
            for part in total["parts"]:
                uncertainty = "unknown" if part["uncertainty"] is None else percent(part["uncertainty"])
                larger = ", larger than the part" if part["significant"] is False else ""
                print(f"  {part['cause']:40}  {percent(part['size']):>9}  uncertainty {uncertainty}{larger}")
            print(f"  {'total':40}  {percent(total['total']):>9}")
