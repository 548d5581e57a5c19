"""What a report tells beside the comparison: losses of contact, modes, initial shape, maps, the motion long after.

The paper saw its beam leave the support twice inside the first contact. Such counts hang on small rebounds, so they are
given by height, over modes and initial displacement, and for rigid and compliant levels, not as one number.

Beams that meet are drawn over each other, as far apart as their gap: a contact g = c (w_a - w_b) + gap is closed where
w_a - w_b = -gap / c, so b is drawn gap / c below a, and lines that touch are beams that touch. Points that are tied to
each other have one height. The mechanics know no such places.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pandas as pd
import scipy.signal

from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.study import measures
from multiphi_exudyn.study.compare import HIGH, MOST_LISTED, Comparison
from multiphi_exudyn.study.measures import FEWEST, FREQUENCIES, Map, level_durations, wavelet_map
from multiphi_exudyn.study.model_kinds import ReducedModel
from multiphi_exudyn.study.runs import ModelRun, in_turns, interval_array, timed, undisturbed
from multiphi_exudyn.study.scene_elements import DisplacedStart
from multiphi_exudyn.study.setup import ELEMENTS, LinearBeams, Setup, start_configuration, start_equilibrium
from multiphi_exudyn.study.wording import percent, seconds
from multiphi_exudyn.time.model_warnings import kept_back
from multiphi_exudyn.time.simulate import simulate
from multiphi_exudyn.time.trajectory import Trajectory
from reference_models.beams import NAMELESS, Beams
from reference_models.rig import PublishedLevel, published_frequencies

__all__ = [
    "BeamShapes",
    "Course",
    "Details",
    "Intervals",
    "LevelModes",
    "MapPair",
    "beam_places",
    "coefficients",
    "details_of",
    "initial_shape",
    "level_modes",
    "long_motions",
    "loss_tables",
    "map_pairs",
]

MODES = (4, 6, 8, 12, 24)
FACTORS = (0.25, 0.5, 1.0, 1.5, 2.0, 3.0)  # of the scene's own start
MODE_COUNT = 4  # modes, as many as the paper's tables list
STATIONS = 101  # places along a beam
MOST_LEVELS = 4  # the open one, and those held longest
MOST_NAMED = 3  # closed contacts that a level's name lists
LOSS_SAMPLES = 50  # of the gap in every opening
BASIS_MODES = (4, 6, 8, 12, 16)
BASIS_TIME_S = 0.1  # for a pair of models in turns
PERIODS = 32  # of the open structure's longest, in a motion long after: 8 s of the paper's rig

Intervals = Sequence[Sequence[float]]


def coefficients(contact: UnilateralContact) -> dict[str, float]:
    """The points a contact acts on, and c of each; none where it acts on a row of coordinates."""
    given = contact.direction
    if isinstance(given, str):
        return {given: 1.0}
    return dict(given) if isinstance(given, Mapping) else {}


def beam_places(beams: Beams, contacts: Sequence[UnilateralContact]) -> dict[str, float]:
    """The beams from top to bottom, and by how much the x of each is shifted [m].

    Beams that contacts or ties hold together stand together; where several link two beams, the first one counts.
    """
    links = list(_links(beams, contacts))
    places: dict[str, tuple[int, float, float]] = {}  # group, depth below its first beam [m], shift [m]
    for group, first in enumerate(beams.parts):
        places.setdefault(first, (group, 0.0, 0.0))
        waiting = [first]
        for beam in waiting:
            _, depth, shift = places[beam]
            for above, below, ahead, drop in links:
                if above == beam and below not in places:
                    places[below] = (group, depth + drop, shift + ahead)
                    waiting.append(below)
    return {name: places[name][2] for name in sorted(places, key=lambda name: places[name][:2])}


def _links(beams: Beams, contacts: Sequence[UnilateralContact]) -> Iterator[tuple[str, str, float, float]]:
    """Two beams, how far the second one's x is ahead of the first one's, and how far it lies below [m]; both ways."""
    met = [(coefficients(contact), contact.gap) for contact in contacts]
    for points, gap in [*met, *((dict(tie), 0.0) for tie in beams.ties)]:
        if len(points) == 2:
            (a, x_a), (b, x_b) = (beams.points[point] for point in points)
            drop = gap / next(iter(points.values()))
            yield from [(a, b, x_a - x_b, drop), (b, a, x_b - x_a, -drop)] if a != b else []


def loss_tables(setup: Setup) -> dict[str, pd.DataFrame]:
    """Kind of levels -> losses of contact inside the first phase by modes and start, those above HIGH first.

    "failed" where a run did. Of a scene with one contact; none where there is nothing to count, nor under loads, with
    force laws or friction: the tables are of a start that is scaled.
    """
    mechanics = setup.mechanics
    if setup.scene.file.loads or mechanics.force_laws or mechanics.frictions or len(mechanics.contacts) != 1:
        return {}
    (contact,) = mechanics.contacts
    modes = [r for r in MODES if r <= setup.structure.n - 1]
    start = start_configuration(setup, MultiPhiModel(setup.structure, [contact], modes=1))
    starts_closed = contact.gap + setup.structure.row(contact.direction) @ start <= 0
    if starts_closed or not modes or not np.isfinite(setup.longest_period):
        return {}
    kinds = {"rigid": True} if contact.rigid else {"compliant": False, "rigid": True}
    return {f"{kind} levels, {contact.name}": _table(setup, modes, rigid) for kind, rigid in kinds.items()}


def _table(setup: Setup, modes: list[int], rigid: bool) -> pd.DataFrame:
    model = MultiPhiModel(setup.structure, setup.contacts(rigid), modes=modes[0])
    start = start_configuration(setup, model)
    models = {f"r = {r}": replace(model, modes=r) for r in modes}
    counted = {
        _start_text(setup, factor): {name: _losses(setup, each, factor * start) for name, each in models.items()}
        for factor in FACTORS
    }
    return pd.DataFrame(counted, dtype=object)


def _start_text(setup: Setup, factor: float) -> str:
    start = setup.scene.file.start
    if isinstance(start, DisplacedStart):
        return f"{1e3 * factor * start.displacement:+g} mm"
    assert start is not None, "a scene without loads has a start"
    return f"{factor * start.force:+g} N"


def _losses(setup: Setup, model: MultiPhiModel, start: np.ndarray) -> str:
    """From a start that is scaled as a whole, which is exact for one off the contacts."""
    with kept_back():
        run = simulate(model, min(setup.t_end, setup.longest_period), displacement=start)
    if run.status != "ok":
        return "failed"
    (contact,) = model.contacts
    phase = measures.first_phase(interval_array(run.contact_intervals(contact.name)), setup.longest_period)
    heights = [
        np.max(run.gap(contact.name, np.linspace(opened, closed, LOSS_SAMPLES)))
        for opened, closed in zip(phase[:-1, 1], phase[1:, 0], strict=True)
    ]
    return f"{sum(height > HIGH for height in heights)} of {len(heights)}"


@dataclass(frozen=True)
class BeamShapes:
    """One beam in m modes: where it is drawn, x (k,) [m], shapes (m, k); masses, contacts (closed): their x [m]."""

    name: str
    x: np.ndarray
    shapes: np.ndarray
    masses: tuple[float, ...]
    contacts: tuple[float, ...]


@dataclass(frozen=True)
class LevelModes:
    """The lowest m modes of one level.

    closed: names of its closed contacts; of the paper's rig they are rigid, as in its tables, else as the scene has
    them. share: of the reference's run that it holds; None without one. frequencies: (m,) Hz, of the structure every
    reduced model of the scene has. beams: from top to bottom, the largest value of a mode on all of them is 1.
    published: what the paper prints for this level.
    """

    closed: tuple[str, ...]
    share: float | None
    frequencies: np.ndarray
    beams: tuple[BeamShapes, ...]
    published: tuple[PublishedLevel, ...]

    @property
    def name(self) -> str:
        """ "open", or what is closed."""
        if len(self.closed) > MOST_NAMED:
            return f"{len(self.closed)} contacts closed, {self.closed[0]} to {self.closed[-1]}"
        return " and ".join(self.closed) + " closed" if self.closed else "open"


def level_modes(comparison: Comparison) -> tuple[LevelModes, ...]:
    """The open level, a lone contact's closed one, and those the reference held longest; none for matrices."""
    setup, beams = comparison.setup, comparison.setup.mechanics.beams
    if beams is None:
        return ()
    contacts = setup.contacts(rigid=setup.mechanics.parameter_set is not None)
    held = level_durations(comparison.reference.contact_intervals, setup.t_end) if comparison.reference.ok else {}
    longest = sorted(held, key=lambda closed: -held[closed])
    alone = [(contacts[0].name,)] if len(contacts) == 1 else []
    model, (stations, rows) = MultiPhiModel(setup.structure, contacts, modes=MODE_COUNT), _stations(beams)
    drawn = MultiPhiModel(stations.structure, contacts, modes=MODE_COUNT)
    published = published_frequencies().values() if setup.mechanics.parameter_set else ()
    return tuple(
        LevelModes(
            closed=closed,
            share=held.get(closed, 0.0) / setup.t_end if held else None,
            frequencies=model.level(closed).frequencies[:MODE_COUNT],
            beams=_drawn(beams, contacts, closed, _scaled(rows @ drawn.level(closed).shapes[:, :MODE_COUNT])),
            published=tuple(column for column in published if column.level == closed),
        )
        for closed in list(dict.fromkeys([(), *alone, *longest]))[:MOST_LEVELS]
    )


def _stations(beams: Beams) -> tuple[LinearBeams, np.ndarray]:
    """The beams as linear elements with points at their stations, and the rows (beams, stations, n) of these."""
    parts = {
        name: replace(beam, points=dict(beam.points) | {f"{i}": x for i, x in enumerate(_along(beams, name).tolist())})
        for name, beam in beams.parts.items()
    }
    linear = LinearBeams(replace(beams, parts=parts), ELEMENTS)
    prefixes = ["" if name == NAMELESS else f"{name}." for name in parts]
    rows = [[linear.structure.row(f"{prefix}{i}") for i in range(STATIONS)] for prefix in prefixes]
    return linear, np.array(rows)


def _along(beams: Beams, name: str) -> np.ndarray:
    return np.linspace(beams.parts[name].start, beams.parts[name].end, STATIONS)


def _scaled(deflections: np.ndarray) -> np.ndarray:
    """Modes (beams, stations, m), the largest value of each 1, the tip that moves most above zero."""
    tips = deflections[:, -1]
    most = np.take_along_axis(tips, np.argmax(np.abs(tips), axis=0)[None], axis=0)[0]
    return np.asarray(deflections * np.where(most < 0, -1.0, 1.0) / np.max(np.abs(deflections), axis=(0, 1)))


def _drawn(
    beams: Beams, contacts: Sequence[UnilateralContact], closed: Sequence[str], shapes: np.ndarray
) -> tuple[BeamShapes, ...]:
    """Every beam, from top to bottom, in its shapes (beams, stations, m), beams in the scene's order."""
    of: Mapping[str, np.ndarray] = dict(zip(beams.parts, shapes, strict=True))
    met = [beams.points[point] for c in contacts if c.name in closed for point in coefficients(c)]
    return tuple(
        BeamShapes(
            name=name,
            x=_along(beams, name) + shift,
            shapes=of[name].T,
            masses=tuple(mass.at + shift for mass in beams.parts[name].masses),
            contacts=tuple(x + shift for beam, x in met if beam == name),
        )
        for name, shift in beam_places(beams, contacts).items()
    )


def initial_shape(setup: Setup) -> tuple[BeamShapes, ...]:
    """The beams as the start's load holds them [m], one "mode" each; none for matrices, and for a start at rest."""
    beams, contacts = setup.mechanics.beams, setup.mechanics.contacts
    if beams is None or setup.scene.file.start is None:
        return ()
    stations, rows = _stations(beams)
    model = MultiPhiModel(stations.structure, setup.nonlinearities(rigid=False), modes=1)
    shape = rows @ start_configuration(replace(setup, structure=stations.structure), model)
    return _drawn(beams, contacts, [contact.name for contact in contacts], shape[:, :, None])


@dataclass(frozen=True)
class MapPair:
    """One point's time-frequency maps, of the reference and of a reduced model.

    label: the reduced model, in words. contacts: the intervals [s] in contact, of any contact.
    frequencies: level -> its natural frequencies [Hz].
    """

    point: str
    label: str
    full: Map
    reduced: Map
    full_contacts: Intervals
    reduced_contacts: Intervals
    frequencies: Mapping[str, Sequence[float]]


def map_pairs(setup: Setup, full: ModelRun, run: ModelRun) -> tuple[MapPair, ...]:
    """The maps of every point of a run beside the reference; none where its samples are too far apart."""
    frequencies = FREQUENCIES[FREQUENCIES * FEWEST * setup.scene.file.outputs.interval <= 1]
    if not len(frequencies):
        return ()
    contacts = setup.contacts(setup.scene.models[run.name].rigid)
    model = MultiPhiModel(setup.structure, contacts, modes="all", overrides=setup.overrides)
    levels = {"open": model.level(())} | {f"{c.name} closed": model.level((c.name,)) for c in model.contacts}
    lowest, highest = FREQUENCIES[0], FREQUENCIES[-1]
    natural = {name: [float(f) for f in level.frequencies if lowest <= f <= highest] for name, level in levels.items()}
    return tuple(
        MapPair(
            point=point,
            label=run.label,
            full=wavelet_map(full.points[point], full.time, frequencies),
            reduced=wavelet_map(run.points[point], run.time, frequencies),
            full_contacts=measures.union(full.contact_intervals.values()).tolist(),
            reduced_contacts=measures.union(run.contact_intervals.values()).tolist(),
            frequencies=natural,
        )
        for point in setup.points
    )


@dataclass(frozen=True)
class Course:
    """A reduced model's motion long after its release.

    time (k,) [s], displacement (k,) [m] of the last judged point. crossings (m,) [s]: its low-passed passages through
    zero; phase (m,): cycles until then beyond those of the open structure's first mode. last: end of the last contact.
    """

    label: str
    point: str
    time: np.ndarray
    displacement: np.ndarray
    crossings: np.ndarray
    phase: np.ndarray
    last: float

    def frequency(self, start: float, end: float) -> float:
        """Cycles a second between two times [s]; nan without two passages."""
        inside = self.crossings[(self.crossings >= start) & (self.crossings <= end)]
        return float((len(inside) - 1) / (2 * np.ptp(inside))) if len(inside) > 1 else np.nan


def long_motions(setup: Setup, names: Sequence[str]) -> tuple[Course, ...]:
    """Reduced models let run on for PERIODS of the open structure; none under loads, nor with rigid-body modes."""
    file = setup.scene.file
    if file.loads or not np.isfinite(setup.longest_period) or not setup.mechanics.contacts:
        return ()
    first, second = MultiPhiModel(setup.structure, modes=2).level(()).frequencies[:2]
    time = np.arange(0.0, PERIODS * setup.longest_period, file.outputs.interval)
    low_pass = scipy.signal.butter(4, np.sqrt(first * second), fs=1 / file.outputs.interval, output="sos")
    found = []
    for name in names:
        spec = setup.scene.models[name]
        assert isinstance(spec, ReducedModel), "the names are those of reduced models"
        model = setup.model(spec)
        with kept_back():
            run = simulate(model, time[-1], start=start_equilibrium(setup, model))
        if run.status == "ok":
            point = setup.judged_points[-1]
            values = np.asarray(run.at(point, time))
            low = scipy.signal.sosfiltfilt(low_pass, values)
            k = np.flatnonzero(low[:-1] * low[1:] < 0)
            crossings = time[k] + (time[1] - time[0]) * low[k] / (low[k] - low[k + 1])
            touched = measures.union(interval_array(run.contact_intervals(c.name)) for c in model.contacts)
            last = float(touched[-1, 1]) if len(touched) else 0.0
            phase = np.arange(len(k)) / 2 - first * (crossings - crossings[0])
            found.append(Course(name, point, time, values, crossings, phase, last))
    return tuple(found)


def basis_table(comparison: Comparison) -> pd.DataFrame | None:
    """Own modes of every level against the open level's with the flexibility of what they leave out, in the same loop.

    By number of modes, on the scene's stops and on rigid ones: largest NRMSE of the judged points in the headline's
    window, against all modes on the same stops and against stiff stops, and the CPU time of runs in turns. None without
    stiff stops to compare with, and where the scene has more than contacts.
    """
    setup, stiff, mechanics = comparison.setup, comparison.stiff, comparison.setup.mechanics
    if stiff is None or not stiff.ok or mechanics.force_laws or mechanics.friction_names or setup.overrides:
        return None
    time = setup.time[setup.time <= comparison.headline_window * (1 + 1e-9)]
    references = {"rigid stops": stiff.histories}
    if any(not contact.rigid for contact in mechanics.contacts):
        complete = _Windowed(setup, setup.contacts(rigid=False), time, modes="all", boundary="own")
        references = {"the scene's stops": (complete.histories(),), **references}
    rows: dict[str, dict[tuple[str, str], str]] = defaultdict(dict)
    for r in (r for r in BASIS_MODES if r <= setup.structure.n // 2):
        for stops, wanted in references.items():
            contacts = setup.contacts(rigid=stops == "rigid stops")
            pair = [_Windowed(setup, contacts, time, modes=r, boundary=boundary) for boundary in ("own", "residual")]
            errors = [percent(each.worst_error(wanted)) for each in pair]  # these runs build the levels
            times = in_turns([each.cpu_s for each in pair], BASIS_TIME_S)
            for name, error, taken in zip(("own modes", "one basis"), errors, times, strict=True):
                rows[f"r = {r}"][stops, name] = f"{error}, {seconds(undisturbed(taken))}"
    return pd.DataFrame(rows).T


class _Windowed:
    """A reduced model run to the end of a window."""

    def __init__(
        self, setup: Setup, contacts: Sequence[UnilateralContact], time: np.ndarray, modes: Any, boundary: str
    ) -> None:
        self.setup, self.time = setup, time
        self.model = MultiPhiModel(setup.structure, contacts, modes=modes, boundary=boundary)
        self.start = start_equilibrium(setup, self.model)

    def run(self) -> Trajectory:
        """The run."""
        with kept_back():
            return simulate(self.model, float(self.time[-1]), start=self.start, loads=self.setup.loads)

    def cpu_s(self) -> float:
        """Its time [s]."""
        return timed(self.run)[1]

    def histories(self) -> dict[str, np.ndarray]:
        """Displacements (k,) [m] of the judged points."""
        run = self.run()
        return {point: np.asarray(run.at(point, self.time)) for point in self.setup.judged_points}

    def worst_error(self, references: Sequence[Mapping[str, np.ndarray]]) -> float:
        """Largest NRMSE to any of these histories; nan where the run failed."""
        if self.run().status != "ok":
            return np.nan
        found, end, count = self.histories(), self.time[-1], len(self.time)
        pairs = [(found[point], each[point][:count]) for each in references for point in found]
        return max(measures.nrmse(values, wanted, self.time, end) for values, wanted in pairs)


@dataclass(frozen=True)
class Details:
    """All of it for one comparison; empty where there is nothing to tell."""

    levels: tuple[LevelModes, ...] = ()
    losses: Mapping[str, pd.DataFrame] = field(default_factory=dict)
    initial: tuple[BeamShapes, ...] = ()
    basis: pd.DataFrame | None = None
    maps: tuple[MapPair, ...] = ()
    courses: tuple[Course, ...] = ()


def details_of(comparison: Comparison) -> Details:
    """What there is: maps of the first reduced model that ran, long motions of it and of those with rigid levels."""
    setup, reference = comparison.setup, comparison.reference
    specs = setup.scene.models
    reduced = [name for name, run in comparison.runs.items() if run.ok and isinstance(specs[name], ReducedModel)]
    few = len(setup.points) <= MOST_LISTED and len(setup.mechanics.contacts) <= MOST_LISTED
    mapped = few and reduced and reference.ok and reduced[0] != reference.name
    lasting = dict.fromkeys([*reduced[:1], *(name for name in reduced if specs[name].rigid)])
    return Details(
        levels=level_modes(comparison),
        losses=loss_tables(setup),
        initial=initial_shape(setup),
        basis=basis_table(comparison) if few else None,
        maps=map_pairs(setup, reference, comparison.runs[reduced[0]]) if mapped else (),
        courses=long_motions(setup, list(lasting)) if few else (),
    )
