"""Command line.

    multiphi-exudyn compare | animate | budget | needs | study | stability | new | validate | schema | scenes
                    | studies

Exit code 0 if every requested model ran, 1 if one failed, 2 for bad input, with one line on stderr. For a study: 0 if
all references and budgets, and at least one setting of every method, ran; failed settings are rows with their cause.
For validate: 0 if the file is valid. For stability: 0 if no case is wrong.

The module of a command is loaded when the command runs, so that ``--help`` is fast.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NoReturn, TypeAlias

from multiphi_exudyn.cli.options import animate_options, scene_options, stability_options, study_options
from multiphi_exudyn.errors import MultiPhiError, MultiPhiValueError
from multiphi_exudyn.version import __version__

__all__ = ["command", "main", "parser"]

THREAD_SETTINGS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")

Run: TypeAlias = "Callable[[argparse.Namespace], bool]"

KINDS = ("scene", "study")  # of files

OK, FAILED, BAD_INPUT, INTERRUPTED, CLOSED_PIPE = 0, 1, 2, 130, 141


def command() -> NoReturn:
    """Entry point of the installed command: ``main`` with one BLAS thread, unless the user has set the number.

    With the small matrices of a modal model more threads are slower. BLAS reads the number when it is loaded, by the
    command that runs. If the reader of a pipe has closed it, as in ``multiphi-exudyn scenes | head -1``, the command
    ends without a message.
    """
    if not any(name in os.environ for name in THREAD_SETTINGS):
        os.environ.update(dict.fromkeys(THREAD_SETTINGS, "1"))
    try:
        code = main()
        sys.stdout.flush()
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # the interpreter flushes once more at its end
        code = CLOSED_PIPE
    sys.exit(code)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code."""
    try:
        options = parser().parse_args(arguments)
        return OK if options.run(options) else FAILED
    except MultiPhiError as error:
        print(" ".join(str(error).split()), file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return INTERRUPTED


class _OneLineParser(argparse.ArgumentParser):
    """A parser with errors of one line."""

    def error(self, message: str) -> NoReturn:
        """Raise the error, as one line."""
        raise MultiPhiValueError(f"{self.prog}: {' '.join(message.split())}")


def parser() -> argparse.ArgumentParser:
    """Parser of all commands with their options; ``run`` of its result is the function of the command."""
    top_parser = _OneLineParser(
        "multiphi-exudyn",
        description="Structures with contacts: reduced models and the full nonlinear one, side by side.",
        epilog="multiphi-exudyn COMMAND --help says more about a command, with an example.",
    )
    top_parser.add_argument("--version", action="version", version=f"multiphi-exudyn {__version__}")
    commands = top_parser.add_subparsers(
        dest="command",
        required=True,
        metavar="{compare,animate,budget,needs,study,stability,new,validate,schema,scenes,studies}",
    )

    def add(
        name: str, run: Callable[[argparse.Namespace], bool], summary: str, text: str, example: str
    ) -> argparse.ArgumentParser:
        subparser = commands.add_parser(
            name,
            help=summary,
            description=f"{summary[0].upper()}{summary[1:]}. {text}".strip(),
            epilog=f"Example: multiphi-exudyn {example}",
        )
        subparser.set_defaults(run=run)
        return subparser

    compare = add(
        "compare",
        _compare,
        "run all models of a scene and write a report",
        "Writes report.html, summary.json and histories.npz.",
        "compare paper-rig --t-end 0.5 --modes 12 --out rig",
    )
    scene_options(compare, "of the models whose number the scene does not fix")
    animate = add(
        "animate",
        _animate,
        "animate a reduced model over the reference, as a GIF",
        "",
        "animate paper-rig --t-end 0.3 --slow 40",
    )
    animate_options(animate)
    budget = add(
        "budget",
        _budget,
        "show where the difference between a scene's reduced and full model comes from",
        "Writes budget.json and budget.png.",
        "budget paper-rig --t-end 0.3",
    )
    scene_options(budget, "of the truncated models")
    needs = add(
        "needs",
        _needs,
        "show what the reduced run of a scene needs: levels, coordinates, packages, memory",
        "Runs its first reduced model and prints how many of the possible levels it built, how many coordinates its "
        "largest level has, its peak memory without M and K, and how much it imported.",
        "needs paper-rig bed-of-stops",
    )
    needs.add_argument("scenes", metavar="SCENE", nargs="*", help="shipped scenes or TOML files (default: all shipped)")
    study = add(
        "study",
        _study,
        "run a study, or continue an interrupted one, and write its report",
        "Writes report.html and runs.csv; runs.sqlite keeps every run: a second call does only what is missing.",
        "study pareto --quick",
    )
    study_options(study)
    stability = add(
        "stability",
        _stability,
        "run every model through a catalogue of extreme cases",
        "",
        "stability --quick",
    )
    stability_options(stability)
    new = add(
        "new",
        _new,
        "write a scene or a study to start from, with remarks on its fields",
        "A study comes with the scene it names.",
        "new study my-study.toml",
    )
    new.add_argument("kind", choices=KINDS, help="what to write")
    new.add_argument("file", metavar="FILE", type=Path, nargs="?", help="its name (default: scene.toml, study.toml)")
    validate = add(
        "validate",
        _validate,
        "check a scene or a study without a run",
        "Names all faults at once, each with its place in the file.",
        "validate my-study.toml",
    )
    validate.add_argument("file", metavar="FILE", help="a TOML file, or the name of a shipped scene or study")
    schema = add(
        "schema",
        _schema,
        "print the JSON schema of a scene or a study, with which editors complete files",
        "",
        "schema scene",
    )
    schema.add_argument("kind", choices=KINDS, help="of which file")
    add("scenes", _scenes, "list the shipped scenes, which compare, animate, budget and needs take", "", "scenes")
    add("studies", _studies, "list the shipped studies, which study takes", "", "studies")
    return top_parser


def _compare(options: argparse.Namespace) -> bool:
    from multiphi_exudyn.cli.compare_command import run_compare

    return run_compare(options.scene, options.t_end, options.modes, options.out)


def _animate(options: argparse.Namespace) -> bool:
    from multiphi_exudyn.cli.animate_command import run_animate

    return run_animate(options.scene, options.t_end, options.model, options.reference, options.slow, options.out)


def _budget(options: argparse.Namespace) -> bool:
    from multiphi_exudyn.cli.budget_command import run_budget

    return run_budget(options.scene, options.t_end, options.modes, options.out)


def _needs(options: argparse.Namespace) -> bool:
    from multiphi_exudyn.cli.needs_command import run_needs

    return run_needs(options.scenes)


def _study(options: argparse.Namespace) -> bool:
    from multiphi_exudyn.cli.study_command import run_study_file

    return run_study_file(options.study, options.out, options.quick, options.on, options.workers)


def _stability(options: argparse.Namespace) -> bool:
    from multiphi_exudyn.cli.stability_command import run_stability

    return run_stability(options.case, options.quick, options.out)


def _new(options: argparse.Namespace) -> bool:
    from multiphi_exudyn.cli.file_commands import run_new

    return run_new(options.kind, options.file)


def _validate(options: argparse.Namespace) -> bool:
    from multiphi_exudyn.cli.file_commands import run_validate

    return run_validate(options.file)


def _schema(options: argparse.Namespace) -> bool:
    from multiphi_exudyn.cli.file_commands import run_schema

    return run_schema(options.kind)


def _scenes(options: argparse.Namespace) -> bool:
    from multiphi_exudyn.study.scene import shipped_scenes

    return _print_titles(shipped_scenes())


def _studies(options: argparse.Namespace) -> bool:
    from multiphi_exudyn.study.accuracy.cases import shipped_studies

    return _print_titles(shipped_studies())


def _print_titles(titles: Mapping[str, str]) -> bool:
    width = max(map(len, titles))
    for name, title in titles.items():
        print(f"{name:{width}}  {title}")
    return True
