"""A study's error against run time as a plot that zooms, every point with its setting."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from multiphi_exudyn.study.accuracy.analysis import front, settings_at, uncertainty, words
from multiphi_exudyn.study.accuracy.figure_style import styles
from multiphi_exudyn.study.accuracy.study_result import Setting, StudyResult
from multiphi_exudyn.study.comparison.zoom import zoom_line, zoom_plot

__all__ = ["error_against_time"]

FAINT, STRONG, WIDTH = 5, 8, 2  # pixels: marks of all settings and of the fronts, their line


def error_against_time(result: StudyResult, at: Mapping[str, Any], number: int) -> dict[str, Any]:
    """At one point of the scene's axes, the ``number``-th of the page: every setting, and each method's front."""
    label = f"NRMSE to {result.window:g} s [%], worst of {', '.join(result.judged_points)}"
    x = {"label": "online time of one run, median [ms]", "group": f"time at {number}", "log": True}
    own = uncertainty(result, at)
    lines = list(_lines(result, at))
    return zoom_plot(label, x, lines, log=True, below=None if own is None else 100 * own)


def _lines(result: StudyResult, at: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    known = [setting for setting in settings_at(result, at) if setting.error and setting.online_s]
    for name, style in styles(result).items():
        own = [setting for setting in known if setting.method == name]
        if own:
            notes = [words(setting.setting) or name for setting in own]
            yield _line(name, style.colour, own, mark=FAINT, faint=True, notes=notes)
            yield _line(name, style.colour, front(own), mark=STRONG, width=WIDTH)


def _line(name: str, colour: str, settings: Sequence[Setting], **more: Any) -> dict[str, Any]:
    errors = [100 * (setting.error or 0.0) for setting in settings]
    return zoom_line(name, colour, errors, [1e3 * (setting.online_s or 0.0) for setting in settings], **more)
