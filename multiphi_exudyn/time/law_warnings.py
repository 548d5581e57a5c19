"""Law warnings: what the straight segments of a force law do to the motion of a run, and laws driven out of their span.

A law is known to a share of its largest force on the span. Its motion is not known to that share: e = F - segments has
mostly one sign at one amplitude, so it changes the frequency, and the phase drifts for the whole run. For an
oscillation the balance of the first harmonic gives

    d omega / omega = <e q> / (2 <F q>) = <e q> / (4 <kinetic energy>),   omega^2 = <q'^2> / <q^2>

with q less its mean. The phase is off by d omega t, and displacements, as a root mean square over the run, by
d omega T / sqrt(3). Against 152 random runs of the exact laws (cubic, Hertz, magnets, softening, one to four degrees of
freedom) the ratio of this estimate to the error was 1.1 in the middle, and 0.5 to 2.3 for eight of ten.

Beyond its span the last segment of a law is continued. That is an extrapolation unless it is no force at all, and where
the segment is falling the motion may grow without limit.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from scipy.optimize import brentq

from multiphi_exudyn.display import per_cent
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mechanics.force_law import ForceLaw
from multiphi_exudyn.time.segments import Segments
from multiphi_exudyn.time.trajectory import Trajectory

__all__ = ["LawPlaces", "approximated_laws", "law_times", "law_warnings", "laws_at_an_end", "span_warnings"]

OFF = 0.02  # of the motion: threshold of the estimate; no run that was wrong by 5 % was below
AIM = 0.005  # of the motion, of the tolerance that the warning names
SAMPLES = 256  # of the motion
BEYOND = 1e-6  # of the span's width: a law is not left by less, as by a start at its end
FEWEST, PER_PERIOD = 9, 8  # samples of a segment of the motion, and of a period of its level's highest frequency
MOST = 20_000  # samples of a run


def approximated_laws(model: MultiPhiModel) -> tuple[ForceLaw, ...]:
    """The force laws whose segments are not the law itself."""
    return tuple(law for law in model.contacts if isinstance(law, ForceLaw) and law.error > 0)


def law_warnings(trajectory: Trajectory) -> Iterator[str]:
    """One sentence on the law that moves a run most by what its segments leave out."""
    found = [(_motion_error(trajectory, law), law.name, law) for law in approximated_laws(trajectory.model)]
    if found and (worst := max(found, key=lambda entry: entry[:2]))[0] > OFF:
        error, name, law = worst
        yield (
            f"force law: {name!r} is approximated to {per_cent(law.error)} of its largest force on its span, which may "
            f"move this run by {per_cent(min(error, 1.0))} of its motion; give it "
            f"tolerance={law.error * AIM / error:.1g}"
        )


@np.errstate(over="ignore", invalid="ignore")  # of a run that grew without end
def _motion_error(trajectory: Trajectory, law: ForceLaw) -> float:
    """Estimate of the relative error of displacements."""
    times = np.linspace(trajectory.t_start, trajectory.t_end, SAMPLES + 1)[1:]
    q = law.centre + np.asarray(trajectory.gap(law.name, times))
    x_t = trajectory.velocity(times)
    speed = trajectory.model.structure.row(law.at) @ x_t
    y_t = trajectory.model.base.coordinates(x_t)
    kinetic, swing = 0.5 * float(np.mean(np.sum(y_t**2, axis=0))), q - np.mean(q)
    if not (0 < kinetic < math.inf and np.any(swing)):
        return 0.0
    omega = math.sqrt(float(np.mean(speed**2)) / float(np.mean(swing**2)))
    shift = abs(float(np.mean(law.deviation(q) * swing))) / (4 * kinetic)
    return shift * omega * (trajectory.t_end - trajectory.t_start) / math.sqrt(3)


def laws_at_an_end(model: MultiPhiModel, visited: Iterable[Sequence[int]]) -> list[ForceLaw]:
    """Return the force laws that are in a last segment of theirs in one of the levels, given by their states."""
    laws = [(i, law) for i, law in enumerate(model.contacts) if isinstance(law, ForceLaw)]
    if not laws:
        return []
    levels = list(visited)
    return [law for i, law in laws if any(law.is_last(states[i]) for states in levels)]


def span_warnings(trajectory: Trajectory) -> Iterator[str]:
    """Yield a warning of every law that leaves its span, with the time and the farthest place reached."""
    for law in laws_at_an_end(trajectory.model, trajectory.segments.visited):
        yield from _left_span(trajectory, law)


def _left_span(trajectory: Trajectory, law: ForceLaw) -> Iterator[str]:
    low, high = float(law.knots[0]), float(law.knots[-1])
    times = law_times(trajectory.segments, trajectory.model.index(law.name), law)
    places = law.centre + np.asarray(trajectory.gap(law.name, times))
    beyond = _beyond(law, places)
    if not np.any(beyond > BEYOND):
        return
    first = int(np.argmax(beyond > BEYOND))
    farthest = int(np.argmax(beyond))
    time = float(times[first])
    if first > 0 and beyond[first - 1] <= 0:
        edge = high if places[first] > high else low
        time = brentq(lambda t: law.centre + float(trajectory.gap(law.name, t)) - edge, times[first - 1], times[first])
    yield _sentence(law, "leaves" if first else "starts outside", time, places[farthest], times[farthest])


def _beyond(law: ForceLaw, places: np.ndarray) -> np.ndarray:
    """Return how far places (k,) are beyond a law's span, in widths of it; negative inside, and 0 where it is free.

    A law whose last segment is no force goes on as it is, so beyond that end nothing is extrapolated.
    """
    low, high = float(law.knots[0]), float(law.knots[-1])
    sides = [
        np.minimum(side, 0.0) if not np.any(law.forces[ends]) else side
        for side, ends in ((places - high, slice(-2, None)), (low - places, slice(2)))
    ]
    return np.asarray(np.maximum(*sides) / (high - low))


def _sentence(law: ForceLaw, how: str, time: float, farthest: float, when: float) -> str:
    return (
        f"law span: force law {law.name!r} {how} its span ({law.knots[0]:g}, {law.knots[-1]:g}) at t = {time:.6g} s "
        f"and reaches {farthest:.6g} at t = {when:.6g} s, where its last segment is continued; give it a span that "
        "holds the motion, or end the run before"
    )


class LawPlaces:
    """Places of force laws beyond their spans in a run whose motion is not kept, each with its time."""

    def __init__(self) -> None:
        self._left: dict[str, tuple[ForceLaw, float, float, float, float]] = {}

    def include(self, law: ForceLaw, times: np.ndarray, places: np.ndarray) -> None:
        """Include places (k,) at ascending times (k,) [s]; the time of leaving is interpolated between two of them."""
        beyond = _beyond(law, places)
        if not np.any(beyond > BEYOND):
            return
        k, i = int(np.argmax(beyond)), int(np.argmax(beyond > BEYOND))
        first = float(np.interp(0.0, beyond[i - 1 : i + 1], times[i - 1 : i + 1]) if i else times[0])
        _, earlier, most, place, when = self._left.get(law.name, (law, first, -math.inf, 0.0, 0.0))
        if beyond[k] > most:
            most, place, when = float(beyond[k]), float(places[k]), float(times[k])
        self._left[law.name] = law, min(first, earlier), most, place, when

    @property
    def warnings(self) -> Iterator[str]:
        """A warning of every law that was seen beyond its span, with the first time and the farthest place."""
        for law, first, _, place, when in self._left.values():
            yield _sentence(law, "leaves", first, place, when)


def law_times(segments: Segments, index: int, law: ForceLaw) -> np.ndarray:
    """Return times (k,) [s] at which a law, the ``index``-th element, is in a last segment, in order."""
    is_last = np.array([law.is_last(level.states[index]) for level in segments.levels])
    fastest = np.array([level.modal.highest_frequency for level in segments.levels])
    chosen = np.flatnonzero(is_last[segments.numbers])
    if not len(chosen):
        return np.zeros(0)
    starts, ends = segments.starts[chosen], segments.ends[chosen]
    counts = np.ceil(PER_PERIOD * fastest[segments.numbers[chosen]] * (ends - starts)) + FEWEST
    share = min(1.0, MOST / float(np.sum(counts)))
    parts = [
        np.linspace(start, end, max(3, math.ceil(share * count)))
        for start, end, count in zip(starts, ends, counts.tolist(), strict=True)
    ]
    return np.unique(np.concatenate(parts))
