"""Command line: ``multiphi-exudyn compare SCENE`` and ``multiphi-exudyn scenes``.

Exit code 0 if every model asked for ran, 1 if one failed, 2 for bad input, with one line on stderr.
"""

from __future__ import annotations

import argparse
import io
import json
import math
import os
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from tqdm import tqdm

from multiphi_exudyn.errors import MultiPhiError, MultiPhiValueError
from multiphi_exudyn.study.comparison.compare import Comparison, compare, histories, summary
from multiphi_exudyn.study.comparison.findings import findings, percent, seconds, times
from multiphi_exudyn.study.comparison.losses import loss_tables
from multiphi_exudyn.study.comparison.mode_shapes import level_modes
from multiphi_exudyn.study.comparison.report import render
from multiphi_exudyn.study.running.environment import environment
from multiphi_exudyn.study.scene.mechanics import mechanics_of
from multiphi_exudyn.study.scene.scenes import load_scene, shipped_scenes
from multiphi_exudyn.study.scene.workbench import prepare

__all__ = ["command", "main"]

THREAD_SETTINGS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")

OK, FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code."""
    try:
        given = _parser().parse_args(arguments)
        return _scenes() if given.command == "scenes" else _compare(given)
    except MultiPhiError as error:
        print(" ".join(str(error).split()), file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return INTERRUPTED


class _OneLineParser(argparse.ArgumentParser):
    """A parser whose error is one line."""

    def error(self, message: str) -> NoReturn:
        """Exit with the one line."""
        raise MultiPhiValueError(f"{self.prog}: {' '.join(message.split())}")


def _parser() -> argparse.ArgumentParser:
    parser = _OneLineParser("multiphi-exudyn", description="Structures with contacts, reduced and full, side by side.")
    commands = parser.add_subparsers(dest="command", required=True, metavar="{compare,scenes}")
    run = commands.add_parser("compare", help="run all models of a scene and write a report")
    run.add_argument("scene", metavar="SCENE", help="a shipped scene (see: scenes) or a TOML file")
    run.add_argument("--t-end", type=_time, metavar="S", help="end of the run [s] instead of the scene's")
    run.add_argument(
        "--modes", type=_count, metavar="R",
        help="number of modes of the reduced models that have the scene's own; those with a number of theirs keep it",
    )  # fmt: skip
    run.add_argument("--out", type=Path, metavar="DIR", help="folder of the results (default: multiphi-SCENE)")
    commands.add_parser("scenes", help="list the shipped scenes")
    return parser


def _time(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value > 0):
        raise argparse.ArgumentTypeError(f"got {text!r}, need a time > 0 in s")
    return value


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"got {text!r}, need a whole number >= 1")
    return int(text)


def _scenes() -> int:
    titles = shipped_scenes()
    width = max(map(len, titles))
    for name, title in titles.items():
        print(f"{name:{width}}  {title}")
    return OK


def _compare(given: argparse.Namespace) -> int:
    scene = load_scene(given.scene, t_end=given.t_end, modes=given.modes)
    bench = prepare(scene, mechanics_of(scene))
    folder = _folder(given.out or Path(f"multiphi-{scene.name}"))
    with tqdm(total=len(scene.models) + 1, disable=None, unit="model") as bar:

        def started(name: str) -> None:
            bar.set_description(name)
            bar.update(int(name != next(iter(scene.models))))

        comparison = compare(bench, environment(), progress=sys.stderr.isatty(), started=started)
        bar.update()
        bar.set_description("report")
        _write(comparison, folder)
        bar.update()
    _tell(comparison, folder)
    return OK if all(run.ok for run in comparison.runs.values()) else FAILED


def command() -> NoReturn:
    """Entry of the installed command: ``main`` with one BLAS thread, unless the user has set the number.

    More threads cost the small matrices of a modal model more than they give. numpy reads the number when it is
    loaded, hence the restart.
    """
    if os.name == "posix" and not any(name in os.environ for name in THREAD_SETTINGS):
        os.environ.update(dict.fromkeys(THREAD_SETTINGS, "1"))
        os.execv(sys.executable, [sys.executable, *sys.orig_argv[1:]])
    sys.exit(main())


def _folder(path: Path) -> Path:
    try:
        path.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=path):
            return path
    except OSError as error:
        raise MultiPhiValueError(
            f"--out: got {str(path)!r}, need a folder that can be written: {error.strerror}"
        ) from error


def _write(comparison: Comparison, folder: Path) -> None:
    """Results first, the report last; each file appears whole or not at all."""
    arrays = io.BytesIO()
    np.savez_compressed(arrays, allow_pickle=False, **dict[str, Any](histories(comparison)))
    content = json.dumps(summary(comparison), indent=1, allow_nan=False)
    page = render(comparison, level_modes(comparison.bench), loss_tables(comparison.bench))
    _replace(folder / "histories.npz", arrays.getvalue())
    _replace(folder / "summary.json", content.encode())
    _replace(folder / "report.html", page.encode())


def _replace(path: Path, content: bytes) -> None:
    """Write beside the file and rename."""
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        Path(temporary).chmod(0o644)
        Path(temporary).replace(path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def _tell(comparison: Comparison, folder: Path) -> None:
    until = comparison.headline_window
    width = max(map(len, comparison.runs))
    print(f"{'model':{width}}  {'status':6}  {'online':>9}  {'faster':>10}  NRMSE to {until:g} s")
    for name, run in comparison.runs.items():
        error = percent(comparison.worst_error(run, until)) if name in comparison.measured else "the reference"
        line = f"{seconds(run.online_s):>9}  {times(comparison.speedup(run)):>10}  {error if run.ok else run.message}"
        print(f"{name:{width}}  {run.status:6}  {line}")
    print(f"\n{findings(comparison).outcome}\n{folder / 'report.html'}")
