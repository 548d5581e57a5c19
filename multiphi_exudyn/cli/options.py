"""Options of the commands, with their defaults and the types of their values; the folder of results."""

from __future__ import annotations

import argparse
import math
import tempfile
from pathlib import Path

from multiphi_exudyn.errors import MultiPhiValueError

__all__ = ["animate_options", "results_folder", "scene_options", "stability_options", "study_options"]


def scene_options(parser: argparse.ArgumentParser, whose: str) -> None:
    _scene_option(parser)
    parser.add_argument("--modes", type=_count, metavar="R", help=f"number of modes {whose} (default: the scene's)")
    _folder_option(parser, "SCENE")


def animate_options(parser: argparse.ArgumentParser) -> None:
    _scene_option(parser)
    parser.add_argument("--model", metavar="NAME", help="the reduced model (default: the scene's first)")
    parser.add_argument(
        "--reference", metavar="NAME", help="the model drawn beside it (default: the scene's reference)"
    )
    parser.add_argument(
        "--slow", type=_factor, metavar="FACTOR", help="slow motion factor (default: chosen from the duration)"
    )
    parser.add_argument(
        "--out", type=Path, metavar="FILE.gif", help="the animation (default: multiphi-SCENE/animation.gif)"
    )


def _scene_option(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scene", metavar="SCENE", help="a shipped scene (see: scenes) or a TOML file")
    parser.add_argument("--t-end", type=_time, metavar="S", help="end of the run [s] (default: the scene's)")


def study_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("study", metavar="STUDY", help="a shipped study (see: studies) or a TOML file")
    parser.add_argument("--quick", action="store_true", help="the study's short form: fewer values, shorter runs")
    parser.add_argument(
        "--on",
        metavar="WHERE",
        default="processes",
        help="where runs are made: processes (default), serial, or a Dask scheduler's address tcp://host:port",
    )
    parser.add_argument("--workers", type=_count, metavar="N", help="number of processes (default: one per core)")
    _folder_option(parser, "STUDY")


def stability_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--case", metavar="NAME", help="this case alone (default: all)")
    parser.add_argument("--quick", action="store_true", help="fewer cases, shorter ones")
    _folder_option(parser, "stability")


def _folder_option(parser: argparse.ArgumentParser, default: str) -> None:
    parser.add_argument("--out", type=Path, metavar="DIR", help=f"folder of the results (default: multiphi-{default})")


def _time(text: str) -> float:
    return _positive(text, "a time > 0 in s")


def _factor(text: str) -> float:
    return _positive(text, "a factor > 0")


def _positive(text: str, need: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value > 0):
        raise argparse.ArgumentTypeError(f"got {text!r}, need {need}")
    return value


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"got {text!r}, need a whole number >= 1")
    return int(text)


def results_folder(path: Path) -> Path:
    """The folder, made where there is none; an error, before anything has run, where it cannot be written."""
    try:
        path.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=path):
            return path
    except OSError as error:
        needed = f"a folder that can be written: {error.strerror}"
        raise MultiPhiValueError(f"--out: got {str(path)!r}, need {needed}") from error
