"""Command line.

    multiphi-exudyn compare | animate | budget | needs | study | stability | new | validate | schema | compile | scenes
        | studies

Exit code 0 if every model asked for ran, 1 if one failed, 2 for bad input, with one line on stderr. Of a study: 0 if
all references and budgets, and at least one setting of every method, ran; settings that fail are rows with their cause.
Of validate: 0 if the file is valid. Of stability: 0 if no case is wrong. Of compile: 0 if what is compiled is kept.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn

from multiphi_exudyn.cli.animate_command import run_animate
from multiphi_exudyn.cli.budget_command import run_budget
from multiphi_exudyn.cli.compare_command import run_compare
from multiphi_exudyn.cli.compile_command import run_compile
from multiphi_exudyn.cli.file_commands import KINDS, run_new, run_schema, run_validate
from multiphi_exudyn.cli.needs_command import run_needs
from multiphi_exudyn.cli.stability_command import run_stability
from multiphi_exudyn.cli.study_command import run_study_file
from multiphi_exudyn.errors import MultiPhiError, MultiPhiValueError
from multiphi_exudyn.study.accuracy.cases import shipped_studies
from multiphi_exudyn.study.scene.scenes import shipped_scenes

__all__ = ["command", "main"]

THREAD_SETTINGS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")

OK, FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130


def command() -> NoReturn:
    """Entry of the installed command: ``main`` with one BLAS thread, unless the user has set the number.

    More threads cost the small matrices of a modal model more than they give. numpy reads the number when it is
    loaded, hence the restart.
    """
    if os.name == "posix" and not any(name in os.environ for name in THREAD_SETTINGS):
        os.environ.update(dict.fromkeys(THREAD_SETTINGS, "1"))
        os.execv(sys.executable, [sys.executable, *sys.orig_argv[1:]])
    sys.exit(main())


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code."""
    try:
        return OK if _run(_parser().parse_args(arguments)) else FAILED
    except MultiPhiError as error:
        print(" ".join(str(error).split()), file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return INTERRUPTED


def _run(given: argparse.Namespace) -> bool:
    if given.command == "compare":
        return run_compare(given.scene, given.t_end, given.modes, given.out)
    if given.command == "animate":
        return run_animate(given.scene, given.t_end, given.model, given.reference, given.slow, given.out)
    if given.command == "budget":
        return run_budget(given.scene, given.t_end, given.modes, given.out)
    if given.command == "needs":
        return run_needs(given.scenes)
    if given.command == "study":
        return run_study_file(given.study, given.out, given.quick, given.on, given.workers)
    if given.command == "stability":
        return run_stability(given.case, given.quick, given.out)
    if given.command == "new":
        return run_new(given.kind, given.file)
    if given.command == "validate":
        return run_validate(given.file)
    if given.command == "schema":
        return run_schema(given.kind)
    if given.command == "compile":
        return run_compile()
    return _listed(shipped_scenes() if given.command == "scenes" else shipped_studies())


class _OneLineParser(argparse.ArgumentParser):
    """A parser whose error is one line."""

    def error(self, message: str) -> NoReturn:
        """Exit with the one line."""
        raise MultiPhiValueError(f"{self.prog}: {' '.join(message.split())}")


def _parser() -> argparse.ArgumentParser:
    parser = _OneLineParser("multiphi-exudyn", description="Structures with contacts, reduced and full, side by side.")
    commands = parser.add_subparsers(
        dest="command",
        required=True,
        metavar="{compare,animate,budget,needs,study,stability,new,validate,schema,compile,scenes,studies}",
    )
    compare = commands.add_parser("compare", help="run all models of a scene and write a report")
    _scene_options(compare, "the reduced models that have the scene's own; those with a number of theirs keep it")
    _animate_options(commands.add_parser("animate", help="show a reduced model and the reference side by side, moving"))
    budget = commands.add_parser("budget", help="tell where the difference of a scene's reduced and full model is from")
    _scene_options(budget, "the truncated models instead of the scene's")
    needs = commands.add_parser("needs", help="tell what reduced runs take: levels, coordinates, packages, memory")
    needs.add_argument("scenes", metavar="SCENE", nargs="*", help="shipped scenes or TOML files (default: all shipped)")
    _study_options(commands.add_parser("study", help="run a study, or go on with one, and write its report"))
    _stability_options(commands.add_parser("stability", help="run every model through a catalogue of extreme cases"))
    _file_options(commands)
    commands.add_parser(
        "compile", help="compile the loop ahead: a container, the workers of a cluster (NUMBA_CPU_NAME)"
    )
    commands.add_parser("scenes", help="list the shipped scenes")
    commands.add_parser("studies", help="list the shipped studies")
    return parser


def _scene_options(parser: argparse.ArgumentParser, whose: str) -> None:
    _scene_option(parser)
    parser.add_argument("--modes", type=_count, metavar="R", help=f"number of modes of {whose}")
    _folder_option(parser, "SCENE")


def _animate_options(parser: argparse.ArgumentParser) -> None:
    _scene_option(parser)
    parser.add_argument("--model", metavar="NAME", help="the reduced model (default: the scene's first)")
    parser.add_argument("--reference", metavar="NAME", help="what it is shown beside (default: the scene's reference)")
    parser.add_argument("--slow", type=_factor, metavar="FACTOR", help="how many times slower than it happens")
    parser.add_argument(
        "--out", type=Path, metavar="FILE.gif", help="the animation (default: multiphi-SCENE/animation.gif)"
    )


def _scene_option(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scene", metavar="SCENE", help="a shipped scene (see: scenes) or a TOML file")
    parser.add_argument("--t-end", type=_time, metavar="S", help="end of the run [s] instead of the scene's")


def _study_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("study", metavar="STUDY", help="a shipped study (see: studies) or a TOML file")
    parser.add_argument("--quick", action="store_true", help="the short form of the study")
    parser.add_argument(
        "--on",
        metavar="WHERE",
        default="processes",
        help="where the error pass runs: processes (default), serial, or a Dask scheduler's address tcp://host:port",
    )
    parser.add_argument("--workers", type=_count, metavar="N", help="number of processes (default: one per core)")
    _folder_option(parser, "STUDY")


def _stability_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--case", metavar="NAME", help="this case alone")
    parser.add_argument("--quick", action="store_true", help="fewer cases, shorter ones")
    _folder_option(parser, "stability")


def _file_options(commands: Any) -> None:
    new = commands.add_parser("new", help="write a scene or a study to start from, with remarks on its fields")
    new.add_argument("kind", choices=list(KINDS))
    new.add_argument("file", metavar="FILE", type=Path, nargs="?", help="its name (default: scene.toml, study.toml)")
    validate = commands.add_parser("validate", help="check a scene or a study without a run")
    validate.add_argument("file", metavar="FILE", type=Path)
    schema = commands.add_parser("schema", help="print the JSON schema of a scene or a study, for editors")
    schema.add_argument("kind", choices=list(KINDS))


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


def _listed(titles: Mapping[str, str]) -> bool:
    width = max(map(len, titles))
    for name, title in titles.items():
        print(f"{name:{width}}  {title}")
    return True
