"""A film as an animated GIF: the shapes of two models under each other, a point's history growing below.

What does not move is drawn once; of every frame only the lines, stops and texts that move. All frames share one
palette: the few colours there are, in shades towards white for the edges of lines.
"""

from __future__ import annotations

import io
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.path import Path
from matplotlib.text import Text
from PIL import Image

from multiphi_exudyn.study.comparison.film import FRAME_RATE, Film, Line, Stop, Take
from multiphi_exudyn.study.comparison.plots import COLOURS, CONTACT, FULL, REFERENCE, greyed, panels
from multiphi_exudyn.study.comparison.wording import seconds

__all__ = ["frame_count", "frames", "gif"]

HEIGHT = 7.4  # inches
RATIOS = (1.0, 1.0, 1.1)  # heights of the panels
RESOLUTION = 76  # dots per inch: 700 pixels wide
MARGIN = 0.12  # of the range of the heights, above and below
HELD = 1500  # ms, of the last frame
SHADES = 9  # of every colour, from itself to white
CLOSED, AXIS, TEXT = "#D55E00", "#BBBBBB", "#555555"
SHAPES: dict[str, Path | str] = {
    "below": Path([(0, 0), (-1, -1.5), (1, -1.5)]),  # tips touch the beam
    "above": Path([(0, 0), (-1, 1.5), (1, 1.5)]),
    "between": "o",
}
STOP_SIZE, BEAM_WIDTH = 13.0, 3.0  # points
ROW_WIDTH = 400.0  # points, that a row of stops may take: many stops are drawn smaller
SMALLEST_STOP, BETWEEN_SIZE = 4.0, 9.0  # points
LIGHTEST = 0.65  # share of white in the last of several beams' colour
WALL = 14.0  # points, height of the mark where a beam is clamped
HISTORY_WIDTHS = (1.2, 2.6)  # points, of the model and of the reference below it


@dataclass(frozen=True)
class _Shape:
    """Artists of a model: a line for each beam, a marker for each stop, its history and the history's last point."""

    take: Take
    beams: tuple[tuple[Line, Line2D], ...]
    stops: tuple[tuple[Stop, Line2D], ...]
    history: Line2D
    head: Line2D

    @property
    def artists(self) -> Iterator[Artist]:
        """All that moves."""
        yield from (artist for _, artist in (*self.beams, *self.stops))
        yield from (self.history, self.head)

    def show(self, frame: int, time: np.ndarray) -> None:
        """Put everything where it is in a frame."""
        for line, artist in self.beams:
            artist.set_ydata(1e3 * (line.height + line.deflection[:, frame]))
        for stop, artist in self.stops:
            artist.set_ydata([1e3 * stop.z[frame]])
            artist.set_color(CLOSED if stop.closed[frame] else FULL)
            artist.set_visible(bool(stop.closed[frame]) or stop.side != "between")
        shown = slice(0, frame + 1)
        self.history.set_data(time[shown], 1e3 * self.take.history[shown])
        self.head.set_data(time[frame : frame + 1], 1e3 * self.take.history[frame : frame + 1])


def frame_count(film: Film) -> int:
    """Number of frames that are drawn; the GIF joins those that look alike."""
    return len(film.time)


def frames(film: Film) -> Iterator[Image.Image]:
    """The frames, all with the same palette."""
    figure, (*upper, lower) = panels(HEIGHT, 3, RATIOS)
    figure.set_dpi(RESOLUTION)
    given = zip(film.takes, upper, (COLOURS[0], REFERENCE), HISTORY_WIDTHS, strict=True)
    shapes = [_shape(take, axes, colour, lower, width) for take, axes, colour, width in given]
    clock = lower.text(1.0, 1.03, "", transform=lower.transAxes, ha="right", fontsize=10, animated=True)
    _frame_shapes(film, upper)
    _frame_history(film, lower)
    _titles(film, figure, shapes)
    palette = _palette((COLOURS[0], REFERENCE, FULL, CONTACT, CLOSED, AXIS, TEXT))
    for image in _drawn(film, figure, shapes, clock):
        yield image.quantize(palette=palette, dither=Image.Dither.NONE)


def gif(images: Iterable[Image.Image], count: int) -> bytes:
    """``count`` images as a GIF that starts again at its end."""
    rest = iter(images)
    first = next(rest)
    durations = [round(1e3 / FRAME_RATE)] * (count - 1) + [HELD]
    buffer = io.BytesIO()
    first.save(buffer, "GIF", save_all=True, append_images=rest, duration=durations, loop=0)
    return buffer.getvalue()


def _palette(colours: Iterable[str]) -> Image.Image:
    """An image that has every colour, in shades towards white."""
    shares = np.linspace(0.0, 1.0, SHADES)[:, None]
    shades = [np.array(to_rgb(colour)) * (1 - shares) + shares for colour in colours]
    palette = Image.new("P", (1, 1))
    palette.putpalette(np.rint(255 * np.concatenate(shades)).astype(np.uint8).tobytes())
    return palette


def _drawn(film: Film, figure: Figure, shapes: list[_Shape], clock: Text) -> Iterator[Image.Image]:
    """Every frame on the one background."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    background = canvas.copy_from_bbox(figure.bbox)
    for frame, now in enumerate(film.time):
        canvas.restore_region(background)
        clock.set_text(f"t = {now:.3f} s")
        for shape in reversed(shapes):
            shape.show(frame, film.time)
            for artist in shape.artists:
                figure.draw_artist(artist)
        figure.draw_artist(clock)
        yield Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")


def _shape(take: Take, axes: Axes, colour: str, lower: Axes, width: float) -> _Shape:
    shades = _shades(colour, len(take.lines))
    beams = tuple(
        (line, axes.plot(line.x, np.zeros(len(line.x)), "-", color=shade, lw=BEAM_WIDTH, animated=True)[0])
        for line, shade in zip(take.lines, shades, strict=True)
    )
    for line, shade in zip(take.lines, shades, strict=True):
        z = 1e3 * line.height
        axes.plot(line.x[[0, -1]], [z, z], color=AXIS, lw=0.8, zorder=0)
        axes.plot(line.x[:1], [z], marker="|", ms=WALL, mew=BEAM_WIDTH, color=shade, zorder=1)
    size = _stop_size(len(take.stops))
    return _Shape(
        take=take,
        beams=beams,
        stops=tuple((stop, _stop(axes, stop, size)) for stop in take.stops),
        history=lower.plot([], [], "-", color=colour, lw=width, animated=True)[0],
        head=lower.plot([], [], "o", color=colour, ms=5, animated=True)[0],
    )


def _shades(colour: str, count: int) -> list[tuple[float, float, float]]:
    """The colour for the first beam, lighter ones for the others, (r, g, b) each."""
    shares = np.linspace(0.0, LIGHTEST, count) if count > 1 else np.zeros(1)
    red, green, blue = to_rgb(colour)
    return [(red + (1 - red) * s, green + (1 - green) * s, blue + (1 - blue) * s) for s in shares.tolist()]


def _stop_size(count: int) -> float:
    """Points; of so many stops that they fit beside each other."""
    return min(STOP_SIZE, max(SMALLEST_STOP, ROW_WIDTH / max(count, 1)))


def _stop(axes: Axes, stop: Stop, size: float) -> Line2D:
    size = min(size, BETWEEN_SIZE) if stop.side == "between" else size
    shape = SHAPES[stop.side]
    return axes.plot([stop.x], [0.0], marker=shape, ms=size, ls="none", mec="none", zorder=3, animated=True)[0]


def _frame_shapes(film: Film, upper: list[Axes]) -> None:
    """The same axes for both models, room for everything at any time."""
    drawn = [line.height + line.deflection for take in film.takes for line in take.lines]
    z = 1e3 * np.concatenate([*map(np.ravel, drawn), *(stop.z for take in film.takes for stop in take.stops)])
    x = np.concatenate([line.x for take in film.takes for line in take.lines])
    room = MARGIN * np.ptp(z) or 1.0
    several = len(film.takes[0].lines) > 1
    for axes in upper:
        axes.set_xlim(np.min(x) - 0.02 * np.ptp(x), np.max(x) + 0.02 * np.ptp(x))
        axes.set_ylim(np.min(z) - room, np.max(z) + room)
        axes.set_ylabel("z [mm]" if several else "w [mm]")
    upper[0].set_xticklabels([])
    upper[-1].set_xlabel("x [m]")


def _frame_history(film: Film, lower: Axes) -> None:
    """Grey where the reference is in contact, or sticks where there are no contacts."""
    spans, grey = greyed(film.takes[1].run)
    for start, end in spans:
        lower.axvspan(start, end, color=CONTACT, lw=0, zorder=0)
    values = 1e3 * np.concatenate([take.history for take in film.takes])
    room = MARGIN * np.ptp(values) or 1.0
    lower.set_xlim(0.0, film.time[-1] + film.time[1])
    lower.set_ylim(np.min(values) - room, np.max(values) + room)
    lower.set_xlabel("time [s]")
    lower.set_ylabel(f"{film.point} [mm]")
    if grey:
        lower.set_title(f"grey: {grey}", fontsize=9, color=TEXT, loc="left")


def _titles(film: Film, figure: Figure, shapes: list[_Shape]) -> None:
    figure.suptitle(f"{film.title}\n{film.slow:g} times slower than it happens", fontsize=10)
    for shape in shapes:
        axes, run = shape.beams[0][1].axes, shape.take.run
        assert isinstance(axes, Axes), "the beam has been drawn"
        axes.set_title(f"{run.label}: computed in {seconds(run.online_s)}", fontsize=10, loc="left")
    _name_beams(shapes)
    beams = [Line2D([], [], color=shape.history.get_color(), lw=BEAM_WIDTH) for shape in shapes]
    names = [shape.take.run.name for shape in shapes]
    stops, states = _legend_of_contacts(shapes[0].take.stops)
    figure.legend([*beams, *stops], [*names, *states], loc="outside lower center", ncols=4, fontsize=9, frameon=False)


def _name_beams(shapes: list[_Shape]) -> None:
    """Names of several beams, in the colours that each model's have."""
    for shape in shapes:
        if len(shape.beams) > 1:
            handles = [Line2D([], [], color=artist.get_color(), lw=BEAM_WIDTH) for _, artist in shape.beams]
            axes, names = shape.beams[0][1].axes, [line.name for line, _ in shape.beams]
            assert isinstance(axes, Axes), "the beam has been drawn"
            axes.legend(handles, names, loc="lower left", fontsize=8, frameon=False, ncols=len(names))


def _legend_of_contacts(stops: tuple[Stop, ...]) -> tuple[list[Line2D], list[str]]:
    """What stops look like, open and closed, and a closed contact between two beams; an open one is not drawn."""
    looks = {"open stop": ("below", FULL), "closed stop": ("below", CLOSED), "beams in contact": ("between", CLOSED)}
    between = {stop.side == "between" for stop in stops}
    shown = {name: look for name, look in looks.items() if (look[0] == "between") in between}
    handles = [
        Line2D(
            [],
            [],
            marker=SHAPES[side],
            ms=STOP_SIZE if side == "below" else BETWEEN_SIZE,
            ls="none",
            mec="none",
            color=colour,
        )
        for side, colour in shown.values()
    ]
    return handles, list(shown)
