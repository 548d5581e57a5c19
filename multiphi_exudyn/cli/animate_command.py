"""``multiphi-exudyn animate``: a scene's reduced model and its reference in one animation, as a GIF in slow motion."""

from __future__ import annotations

import sys
from pathlib import Path

from tqdm import tqdm

from multiphi_exudyn.cli.options import results_folder
from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.files import write_whole
from multiphi_exudyn.study.comparison.animation import gif, prepare_animation
from multiphi_exudyn.study.scene import load_scene
from multiphi_exudyn.time.model_warnings import grouped

__all__ = ["run_animate"]

BAR_DELAY = 2.0  # s before a progress bar appears


def run_animate(
    source: str, t_end: float | None, model: str | None, reference: str | None, slow: float | None, out: Path | None
) -> bool:
    """Run two models of a scene and write the GIF; return True if both ran, else False without a file."""
    scene = load_scene(source, t_end=t_end)
    stage = prepare_animation(scene, model, reference, slow)
    file = _file(out or Path(f"multiphi-{scene.name}") / "animation.gif")
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


def _file(path: Path) -> Path:
    """Path of the GIF, in a folder that is created if necessary."""
    if path.suffix.lower() != ".gif" or path.is_dir():
        raise MultiPhiValueError(f"--out: got {str(path)!r}, need the name of a .gif file")
    return results_folder(path.parent) / path.name
