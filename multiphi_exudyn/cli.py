"""Command line.

    multiphi-exudyn compare | animate | budget | needs | study | stability | new | validate | schema | scenes
                    | studies

Exit code 0 if every requested model ran, 1 if one failed, 2 for bad input, with one line on stderr. For a study: 0 if
all references, and at least one setting of every method, ran; failed settings are rows with their cause.
For validate: 0 if the file is valid. For stability: 0 if no case is wrong.

A command imports what it needs when it runs, so that ``--help`` is fast.
"""

from __future__ import annotations

import argparse
import io
import json
import math
import os
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, TypeAlias

from multiphi_exudyn.errors import MultiPhiError, MultiPhiValueError
from multiphi_exudyn.files import write_whole
from multiphi_exudyn.version import __version__

if TYPE_CHECKING:
    from multiphi_exudyn.study.accuracy import StudyResult
    from multiphi_exudyn.study.compare import Comparison

__all__ = ["command", "main", "parser"]

THREAD_SETTINGS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
KINDS = ("scene", "study")  # of files
BAR_DELAY = 2.0  # s before the progress bar of an animation appears
OK, FAILED, BAD_INPUT, INTERRUPTED, CLOSED_PIPE = 0, 1, 2, 130, 141

Options: TypeAlias = argparse.Namespace


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

    def add(run: Callable[[Options], bool], summary: str, text: str, example: str) -> argparse.ArgumentParser:
        subparser = commands.add_parser(
            example.split()[0],
            help=summary,
            description=f"{summary[0].upper()}{summary[1:]}. {text}".strip(),
            epilog=f"Example: multiphi-exudyn {example}",
        )
        subparser.set_defaults(run=run)
        return subparser

    def add_scene(to: argparse.ArgumentParser) -> None:
        to.add_argument("scene", metavar="SCENE", help="a shipped scene (see: scenes) or a TOML file")
        to.add_argument("--t-end", type=_time, metavar="S", help="end of the run [s] (default: the scene's)")

    def add_modes(to: argparse.ArgumentParser, whose: str) -> None:
        to.add_argument("--modes", type=_count, metavar="R", help=f"number of modes {whose} (default: the scene's)")

    def add_folder(to: argparse.ArgumentParser, default: str) -> None:
        to.add_argument("--out", type=Path, metavar="DIR", help=f"folder of the results (default: multiphi-{default})")

    compare = add(
        _compare,
        "run all models of a scene and write a report",
        "Writes report.html, summary.json and histories.npz.",
        "compare paper-rig --t-end 0.5 --modes 12 --out rig",
    )
    add_scene(compare)
    add_modes(compare, "of the models whose number the scene does not fix")
    add_folder(compare, "SCENE")
    animate = add(
        _animate,
        "animate a reduced model over the reference, as a GIF",
        "",
        "animate paper-rig --t-end 0.3 --slow 40",
    )
    add_scene(animate)
    animate.add_argument("--model", metavar="NAME", help="the reduced model (default: the scene's first)")
    animate.add_argument(
        "--reference", metavar="NAME", help="the model drawn beside it (default: the scene's reference)"
    )
    animate.add_argument(
        "--slow", type=_factor, metavar="FACTOR", help="slow motion factor (default: chosen from the duration)"
    )
    animate.add_argument(
        "--out", type=Path, metavar="FILE.gif", help="the animation (default: multiphi-SCENE/animation.gif)"
    )
    budget = add(
        _budget,
        "show where the difference between a scene's reduced and full model comes from",
        "Writes budget.json and budget.png.",
        "budget paper-rig --t-end 0.3",
    )
    add_scene(budget)
    add_modes(budget, "of the truncated models")
    add_folder(budget, "SCENE")
    needs = add(
        _needs,
        "show what the reduced run of a scene needs: levels, coordinates, packages, memory",
        "Runs its first reduced model and prints how many of the possible levels it built, how many coordinates its "
        "largest level has, its peak memory without M and K, and how much it imported.",
        "needs paper-rig bed-of-stops",
    )
    needs.add_argument("scenes", metavar="SCENE", nargs="*", help="shipped scenes or TOML files (default: all shipped)")
    study = add(
        _study,
        "run a study, or continue an interrupted one, and write its report",
        "Writes report.html and runs.csv; runs.sqlite keeps every run: a second call does only what is missing.",
        "study pareto --quick",
    )
    study.add_argument("study", metavar="STUDY", help="a shipped study (see: studies) or a TOML file")
    study.add_argument("--quick", action="store_true", help="the study's short form: fewer values, shorter runs")
    study.add_argument(
        "--on",
        metavar="WHERE",
        default="processes",
        help="where runs are made: processes (default), serial, or a Dask scheduler's address tcp://host:port",
    )
    study.add_argument("--workers", type=_count, metavar="N", help="number of processes (default: one per core)")
    add_folder(study, "STUDY")
    stability = add(_stability, "run every model through a catalogue of extreme cases", "", "stability --quick")
    stability.add_argument("--case", metavar="NAME", help="this case alone (default: all)")
    stability.add_argument("--quick", action="store_true", help="fewer cases, shorter ones")
    add_folder(stability, "stability")
    new = add(
        _new,
        "write a scene or a study to start from, with remarks on its fields",
        "A study comes with the scene it names.",
        "new study my-study.toml",
    )
    new.add_argument("kind", choices=KINDS, help="what to write")
    new.add_argument("file", metavar="FILE", type=Path, nargs="?", help="its name (default: scene.toml, study.toml)")
    validate = add(
        _validate,
        "check a scene or a study without a run",
        "Names all faults at once, each with its place in the file.",
        "validate my-study.toml",
    )
    validate.add_argument("file", metavar="FILE", help="a TOML file, or the name of a shipped scene or study")
    schema = add(
        _schema,
        "print the JSON schema of a scene or a study, with which editors complete files",
        "",
        "schema scene",
    )
    schema.add_argument("kind", choices=KINDS, help="of which file")
    add(_scenes, "list the shipped scenes, which compare, animate, budget and needs take", "", "scenes")
    add(_studies, "list the shipped studies, which study takes", "", "studies")
    return top_parser


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


def _folder(path: Path) -> Path:
    """The folder, made where there is none; an error, before anything has run, where it cannot be written."""
    try:
        path.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=path):
            return path
    except OSError as error:
        needed = f"a folder that can be written: {error.strerror}"
        raise MultiPhiValueError(f"--out: got {str(path)!r}, need {needed}") from error


# compare, animate, budget, needs


def _compare(options: Options) -> bool:
    """Write report.html, summary.json and histories.npz, the report last; True if all models ran."""
    import numpy as np
    from tqdm import tqdm

    from multiphi_exudyn.study.compare import compare, histories, summary
    from multiphi_exudyn.study.details import details_of
    from multiphi_exudyn.study.report import render
    from multiphi_exudyn.study.runs import environment, import_times
    from multiphi_exudyn.study.scene import load_scene
    from multiphi_exudyn.study.setup import prepare

    scene = load_scene(options.scene, t_end=options.t_end, modes=options.modes)
    setup = prepare(scene)
    folder = _folder(options.out or Path(f"multiphi-{scene.name}"))
    with tqdm(total=len(scene.models) + 1, disable=None, unit="model") as bar:

        def started(name: str) -> None:
            bar.set_description(name)
            bar.update(int(name != next(iter(scene.models))))

        where = environment() | {"import_s": import_times()}
        comparison = compare(setup, where, progress=sys.stderr.isatty(), started=started)
        bar.update()
        bar.set_description("report")
        arrays = io.BytesIO()
        np.savez_compressed(arrays, allow_pickle=False, **dict[str, Any](histories(comparison)))
        content = json.dumps(summary(comparison), indent=1, allow_nan=False)
        page = render(comparison, details_of(comparison))
        write_whole(folder / "histories.npz", arrays.getvalue())
        write_whole(folder / "summary.json", content.encode())
        write_whole(folder / "report.html", page.encode())
        bar.update()
    _print_comparison(comparison, folder)
    return all(run.ok for run in comparison.runs.values())


def _print_comparison(comparison: Comparison, folder: Path) -> None:
    from multiphi_exudyn.study.report import comparison_warnings, findings
    from multiphi_exudyn.study.wording import percent, seconds, times

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


def _animate(options: Options) -> bool:
    """Write the GIF; True if both models ran, else False without a file."""
    from tqdm import tqdm

    from multiphi_exudyn.study.animation import gif, prepare_animation
    from multiphi_exudyn.study.scene import load_scene
    from multiphi_exudyn.time.model_warnings import grouped

    scene = load_scene(options.scene, t_end=options.t_end)
    stage = prepare_animation(scene, options.model, options.reference, options.slow)
    file = options.out or Path(f"multiphi-{scene.name}") / "animation.gif"
    if file.suffix.lower() != ".gif" or file.is_dir():
        raise MultiPhiValueError(f"--out: got {str(file)!r}, need the name of a .gif file")
    _folder(file.parent)
    runs = stage.runs(progress=sys.stderr.isatty())
    failed = {name: run.message for name, run in runs.items() if not run.ok}
    for name, message in failed.items():
        print(f"{name}: failed, {message}")
    if failed:
        return False
    for group in grouped((name, run.warnings) for name, run in runs.items()):
        print(f"warning: {group.told(len(runs))}")
    count = len(stage.time)
    with tqdm(total=count, disable=None, unit="frame", delay=BAR_DELAY, leave=False) as bar:
        write_whole(file, gif(stage, runs, bar.update))
    print(f"{count} frames, {stage.slow:g} times slower than reality\n{file}")
    return True


def _budget(options: Options) -> bool:
    """Write budget.json and budget.png; True if none of the models failed."""
    from multiphi_exudyn.study.budget import budget, budget_figure
    from multiphi_exudyn.study.plots import png
    from multiphi_exudyn.study.scene import load_scene
    from multiphi_exudyn.study.setup import prepare

    scene = load_scene(options.scene, t_end=options.t_end, modes=options.modes)
    setup = prepare(scene)
    folder = _folder(options.out or Path(f"multiphi-{scene.name}"))
    values = budget(setup, scene.file.modes, progress=sys.stderr.isatty())
    write_whole(folder / "budget.json", json.dumps(values, indent=1).encode())
    write_whole(folder / "budget.png", png(budget_figure(values)))
    _print_budget(values)
    print(f"\n{folder / 'budget.png'}")
    return all(rung["status"] == "ok" for rung in values["rungs"].values())


def _print_budget(values: dict[str, Any]) -> None:
    from multiphi_exudyn.study.wording import percent
    from multiphi_exudyn.time.model_warnings import grouped

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


def _needs(options: Options) -> bool:
    """Print a line for every scene, or for all shipped scenes without a name; True if all ran."""
    from tqdm import tqdm

    from multiphi_exudyn.study.needs import needs_of, needs_table
    from multiphi_exudyn.study.scene import load_scene, shipped_scenes
    from multiphi_exudyn.time.model_warnings import grouped

    scenes = [load_scene(source) for source in options.scenes or shipped_scenes()]
    all_needs = [needs_of(scene) for scene in tqdm(scenes, disable=None, unit="scene")]
    print(needs_table(all_needs))
    for group in grouped((needs.scene, needs.warnings) for needs in all_needs):
        print(f"warning: {group.told(len(all_needs))}")
    return all(needs.status == "ok" for needs in all_needs)


# study, stability


def _study(options: Options) -> bool:
    """Run or continue a study in its folder; True if all references and a setting of every method ran."""
    from multiphi_exudyn.study.accuracy import csv_text, run_study
    from multiphi_exudyn.study.accuracy_report import render_study
    from multiphi_exudyn.study.results import TABLE
    from multiphi_exudyn.study.study_file import load_study
    from multiphi_exudyn.study.sweep import Store, open_executor

    study = load_study(options.study, quick=options.quick)
    folder = _folder(options.out or Path(f"multiphi-{study.name}{'-quick' if options.quick else ''}"))
    with Store(folder / "runs.sqlite") as store, open_executor(options.on, options.workers) as executor:
        result = run_study(study, store, executor, progress=sys.stderr.isatty())
    write_whole(folder / TABLE, csv_text(result).encode())
    write_whole(folder / "report.html", render_study(result).encode())
    _print_study(result, folder)
    ran = {row.parameters["method"] for row in result.rows if row.status == "ok"}
    references = all(row.status == "ok" for row in result.rows if row.parameters["method"] == "reference")
    return references and {method.name for method in result.study.methods} <= ran


def _print_study(result: StudyResult, folder: Path) -> None:
    """The cheapest setting of every method for every tolerance, at its worst point of the axes; untimed, errors."""
    from multiphi_exudyn.study.accuracy import cheapest, points, words
    from multiphi_exudyn.study.accuracy_report import findings, records, study_warnings
    from multiphi_exudyn.study.wording import percent, seconds, share, times

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
    failed = sum(row.status != "ok" for row in result.rows)
    for sentence in study_warnings(result):
        print(f"warning: {sentence}")
    print(f"\n{len(result.rows)} runs, {failed} without an answer\n{folder / 'report.html'}")


def _stability(options: Options) -> bool:
    """Run the catalogue or one case, write report.html, summary.json and table.txt; True if no case is wrong."""
    from tqdm import tqdm

    from multiphi_exudyn.study.runs import environment
    from multiphi_exudyn.study.stability import (
        FULL_LENGTH,
        QUICK,
        chosen_cases,
        contents,
        render_stability,
        run_case,
        text_table,
    )

    cases = chosen_cases(options.case, options.quick)
    folder = _folder(options.out or Path(f"multiphi-stability{'-quick' if options.quick else ''}"))
    results = []
    with tqdm(total=len(cases), disable=None, unit="case") as bar:
        for case in cases:
            bar.set_description(case.name)
            results.append(run_case(case, QUICK if options.quick else FULL_LENGTH))
            bar.update()
    where, table = environment(), text_table(results)
    content = json.dumps(contents(results, where, options.quick), indent=1, allow_nan=False)
    write_whole(folder / "summary.json", content.encode())
    write_whole(folder / "table.txt", f"{table}\n".encode())
    write_whole(folder / "report.html", render_stability(results, where, options.quick).encode())
    print(f"{table}\n{folder / 'report.html'}")
    return not any(result.wrong for result in results)


# new, validate, schema, scenes, studies


def _new(options: Options) -> bool:
    """Write a valid template; for a study also its scene, if the file does not exist."""
    path = options.file or Path(f"{options.kind}.toml")
    scene = path.parent / "scene.toml"
    _write_template(options.kind, path)
    if options.kind == "study" and not scene.exists():
        _write_template("scene", scene)
    return True


def _write_template(kind: str, path: Path) -> None:
    if path.exists():
        raise MultiPhiValueError(f"FILE: got {str(path)!r}, which exists already, need another name")
    try:
        write_whole(path, (Path(__file__).parent / "study" / "templates" / f"{kind}.toml").read_bytes())
    except OSError as error:
        raise MultiPhiValueError(f"FILE: got {str(path)!r}, need a folder that can be written") from error
    print(path)


def _validate(options: Options) -> bool:
    """Check a scene or a study without a run, from a file or shipped, and print a summary of it."""
    from multiphi_exudyn.study.scene import load_scene, read_toml
    from multiphi_exudyn.study.setup import prepare
    from multiphi_exudyn.study.study_file import load_study, shipped_studies

    source = options.file
    if source in shipped_studies() or (Path(source).is_file() and "scene" in read_toml(Path(source))):
        study = load_study(source)
        axes = " x ".join(f"{len(values)} of {axis}" for axis, values in study.file.axes.items()) or "no axes"
        runs = sum(1 + len(study.runs(at)) for at in study.points)
        print(f"{source}: valid, a study of {len(study.points)} points ({axes}), {runs} runs")
        return True
    setup = prepare(load_scene(source))
    contacts = ", ".join(contact.name for contact in setup.mechanics.contacts) or "none"
    models = ", ".join(setup.scene.models)
    freedom = f"{setup.structure.n} degrees of freedom"
    print(f"{source}: valid, a scene of {freedom}; contacts: {contacts}; models: {models}")
    return True


def _schema(options: Options) -> bool:
    """Print the JSON schema of a file, for editors."""
    from multiphi_exudyn.study.scene import SceneFile
    from multiphi_exudyn.study.study_file import StudyFile

    schema = json.dumps((SceneFile if options.kind == "scene" else StudyFile).model_json_schema())
    print(json.dumps(json.loads(schema, parse_constant=lambda infinite: "rigid"), indent=1))
    return True


def _scenes(options: Options) -> bool:
    from multiphi_exudyn.study.scene import shipped_scenes

    return _print_titles(shipped_scenes())


def _studies(options: Options) -> bool:
    from multiphi_exudyn.study.study_file import shipped_studies

    return _print_titles(shipped_studies())


def _print_titles(titles: Mapping[str, str]) -> bool:
    width = max(map(len, titles))
    for name, title in titles.items():
        print(f"{name:{width}}  {title}")
    return True
