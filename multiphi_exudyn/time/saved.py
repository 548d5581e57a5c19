"""Saved trajectory: a motion in a NumPy file, for later evaluation; it cannot be continued.

The file is an .npz archive without pickled objects. Of s segments, e events, and for every visited level l:

    header                         JSON: names, status, warnings, statistics, ledger, states of the levels
    segment_start, _end, _level    (s,) [s], [s], number of the level
    term_count, unit, free         (s,): p terms of each, T [s] of their powers, terms of the free response
    rate, power                    (sum p,) complex [1/s], int: phi = (t / T)^power exp(rate t), t from the start
    coefficient                    (sum (r + q) p,) complex, row by row: xi = Re coefficient phi
    event_time                     (e,) [s]
    event_kind, _element, _state   (e,): places in the header's kinds, elements and names of states
    event_loss, event_impulse      (e, 6) [J], (e,) [N s]
    shared                         (k, 3): place of the event, place of the element, impulse [N s]
    level{l}_shapes, _centre       (n, r + q), (n,): x = shapes xi + centre
    level{l}_rows                  (questions, 2 (r + q) + 1) of (xi, xi', 1), in the order of the header's questions
    level{l}_holds                 (questions,), whether a contact is closed, or a friction sticks
    level{l}_moving, _strain_*     kinetic energy 1/2 |moving xi'|^2, and the terms of a StrainForm

It has n numbers for each mode of each visited level.
"""

from __future__ import annotations

import dataclasses
import io
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise
from pathlib import Path
from typing import Any

import numpy as np

from multiphi_exudyn.display import kinds
from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.files import write_whole
from multiphi_exudyn.mathematics.exponentials import Exponentials
from multiphi_exudyn.mechanics.structure import At
from multiphi_exudyn.time.histories import Histories
from multiphi_exudyn.time.ledger import Ledger, Statistics
from multiphi_exudyn.time.loaded_level import StrainForm
from multiphi_exudyn.time.segments import Segment, Segments
from multiphi_exudyn.time.state import Event, Loss

__all__ = [
    "KINDS",
    "SavedLevel",
    "SavedTrajectory",
    "elements_of",
    "event_arrays",
    "events_from",
    "level_arrays",
    "level_from",
    "levels_of",
    "load_trajectory",
    "questions_of",
    "save",
    "segment_arrays",
    "segments_from",
]

FORMAT = 1
CONTACT, FRICTION = ("gap", "contact_force"), ("friction_force", "slip")

KINDS = ("close", "open", "stick", "slip", "segment")
LOSSES = len(Loss._fields)
STRAIN = tuple(field.name for field in dataclasses.fields(StrainForm))


@dataclass(frozen=True, repr=False)
class SavedTrajectory(Histories):
    """A trajectory from a file: all histories, events and energies of a run, but no model, and no way to continue it.

    Made by ``load_trajectory``; its histories are those of a Trajectory. Times [s] are scalars or (k,); at an event
    ``side`` chooses the limit from the "right" (default) or the "left".

    Attributes
    ----------
    segments : sequence of Segment
        The segments of the motion.
    events : sequence of Event
        In order of time.
    t_end : float
        End of the motion [s].
    status, message : str
        "ok", or "failed" and the cause.
    warnings : tuple of str
        What to distrust in it.
    ledger : Ledger
        Energies [J]; None for a run that failed at its start.
    stats : Statistics
        Work of the run.
    header : mapping
        Contents of the file: names of points, contacts and frictions, states of the levels.
    """

    segments: Segments
    events: Sequence[Event]
    t_end: float
    status: str
    message: str
    warnings: tuple[str, ...]
    ledger: Ledger | None
    stats: Statistics
    header: Mapping[str, Any]

    @property
    def t_start(self) -> float:
        """Start of the motion [s]."""
        return float(self.header["t_start"])

    @property
    def points(self) -> tuple[str, ...]:
        """Names of points."""
        return tuple(self.header["points"])

    @property
    def contacts(self) -> tuple[str, ...]:
        """Names of contacts."""
        return tuple(self.header["contacts"])

    @property
    def frictions(self) -> tuple[str, ...]:
        """Names of frictions."""
        return tuple(self.header["frictions"])

    @property
    def rubbing(self) -> tuple[str, ...]:
        """Names of contacts that have friction."""
        return tuple(self.header["rubbing"])

    def _facts(self) -> Iterator[tuple[str, str]]:
        yield "status", f"{self.status}{f', {self.message}' if self.message else ''}"
        yield "time", f"{self.t_start:g} to {self.t_end:g} s"
        yield "events", str(len(self.events))
        yield "warnings", kinds(self.warnings)

    def _row(self, quantity: str, name: At) -> Callable[[SavedLevel], np.ndarray]:
        if quantity == "at" and isinstance(name, Mapping):
            parts = [(factor, self._row(quantity, point)) for point, factor in name.items()]
            return lambda level: np.sum([factor * row(level) for factor, row in parts], axis=0)
        if quantity == "at" and not isinstance(name, str):
            return lambda level: np.concatenate([name @ level.shapes, np.zeros(level.width), [name @ level.centre]])
        key = ("contact_force" if quantity == "contact_impulse" else quantity, str(name))
        self._check(quantity, key)
        return lambda level: level.rows[key]

    def _holds(self, quantity: str, name: str) -> Callable[[SavedLevel], bool]:
        key = ("contact_force" if quantity == "contact_intervals" else "friction_force", name)
        self._check(quantity, key)
        return lambda level: level.holds[key]

    def _check(self, quantity: str, key: tuple[str, str]) -> None:
        names = [name for saved, name in self.header["questions"] if saved == key[0]]
        if key[1] not in names:
            raise MultiPhiValueError(f"{quantity}: got {key[1]!r}, need one of: {', '.join(names) or 'none'}")

    def _motion(self, level: SavedLevel, xi: np.ndarray) -> np.ndarray:
        return np.asarray(level.shapes @ xi)

    def _asymptotic(self, level: SavedLevel) -> np.ndarray:
        return level.centre


def save(run: Histories, path: Path, **facts: Any) -> None:
    """Write a run's motion; facts: status, message, warnings, ledger, stats for the header."""
    elements = tuple(dict.fromkeys([*run.contacts, *run.frictions, *elements_of(run.events)]))
    levels, numbers = levels_of(run.segments)
    header: dict[str, Any] = {
        "format": FORMAT,
        "t_start": run.t_start,
        "t_end": run.t_end,
        "points": run.points,
        "contacts": run.contacts,
        "frictions": run.frictions,
        "rubbing": run.rubbing,
        "elements": elements,
        "kinds": KINDS,
        "entered": sorted({event.state for event in run.events}),
        "questions": questions_of(run),
        "states": [level.states for level in levels],
        **facts,
    }
    arrays: dict[str, Any] = {"header": np.array(json.dumps(header))}
    arrays |= segment_arrays(run.segments, numbers) | event_arrays(run.events, elements, header["entered"])
    for number, level in enumerate(levels):
        arrays |= {f"level{number}_{name}": array for name, array in level_arrays(run, level).items()}
    content = io.BytesIO()
    np.savez_compressed(content, allow_pickle=False, **arrays)
    write_whole(path, content.getvalue())


def load_trajectory(path: str | Path) -> SavedTrajectory:
    """A trajectory that ``Trajectory.save`` has written, to be evaluated.

    Needs no model; the file holds no code.

    Parameters
    ----------
    path : str or path
        Of the .npz file.

    Returns
    -------
    SavedTrajectory
        With the histories, events, ledger and warnings of the run.

    Raises
    ------
    MultiPhiValueError
        For a file that is missing, incomplete or of another kind.

    Examples
    --------
    >>> import numpy as np
    >>> import multiphi_exudyn as mp
    >>> K = 4e4 * np.array([[2, -1, 0], [-1, 2, -1], [0, -1, 1]])  # N/m
    >>> chain = mp.LinearStructure(np.eye(3), K, mp.ModalDamping(0.01), {"tip": 2})
    >>> stop = mp.UnilateralContact("stop", "tip", gap=1e-3, stiffness=1e6)
    >>> model = mp.MultiPhiModel(chain, [stop])
    >>> pulled = model.static_equilibrium({"tip": 100.0})
    >>> tr = mp.simulate(model, 0.5, displacement=pulled)
    >>> tr.save("run.npz")
    >>> saved = mp.load_trajectory("run.npz")
    >>> round(1e3 * saved.at("tip", 0.0), 3)  # mm
    7.5
    """
    try:
        with Path(path).open("rb") as file, np.load(file, allow_pickle=False) as stored:
            arrays = {name: stored[name] for name in stored.files}
        header = json.loads(str(arrays["header"]))
        if header["format"] != FORMAT:
            raise ValueError(f"it has format {header['format']}, this version reads {FORMAT}")
        return _loaded(header, arrays)
    except Exception as error:  # any error of the reader of a file that is cut short or of another kind
        cause = " ".join(str(error).split()) or type(error).__name__
        raise MultiPhiValueError(f"path: got {str(path)!r}, need a file of Trajectory.save: {cause}") from error


def _loaded(header: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> SavedTrajectory:
    questions = [tuple(quantity) for quantity in header["questions"]]
    levels = [level_from(tuple(states), questions, arrays, f"level{i}_") for i, states in enumerate(header["states"])]
    return SavedTrajectory(
        segments=segments_from(levels, arrays),
        events=events_from(header, arrays),
        t_end=header["t_end"],
        status=header["status"],
        message=header["message"],
        warnings=tuple(header["warnings"]),
        ledger=header["ledger"] and Ledger(**header["ledger"]),
        stats=Statistics(**header["stats"]),
        header=header,
    )


@dataclass(frozen=True)
class SavedLevel:
    """Level of a saved run, for histories: rows and holds by (quantity, name); saved.py lists its arrays."""

    states: tuple[int, ...]
    shapes: np.ndarray
    centre: np.ndarray
    rows: Mapping[tuple[str, str], np.ndarray]
    holds: Mapping[tuple[str, str], bool]
    moving: np.ndarray
    strain: StrainForm

    @property
    def width(self) -> int:
        """Number r + q of coordinates."""
        return self.shapes.shape[1]

    def kinetic(self, velocity: np.ndarray) -> np.ndarray:
        """Kinetic energy [J] of every column of xi' (r + q, k)."""
        return np.asarray(0.5 * np.sum((self.moving @ velocity) ** 2, axis=0))


def questions_of(run: Histories) -> list[tuple[str, str]]:
    """(quantity, name) of every saved row of a level."""
    return [
        *(("at", name) for name in run.points),
        *((quantity, name) for name in run.contacts for quantity in CONTACT),
        *((quantity, name) for name in (*run.frictions, *run.rubbing) for quantity in FRICTION),
    ]


def levels_of(segments: Sequence[Segment]) -> tuple[list[Any], list[int]]:
    """The levels of segments, each once, and the index of the level of every segment."""
    places: dict[tuple[int, ...], int] = {}
    levels, numbers = list[Any](), list[int]()
    for segment in segments:
        if segment.level.states not in places:
            places[segment.level.states] = len(levels)
            levels.append(segment.level)
        numbers.append(places[segment.level.states])
    return levels, numbers


def level_arrays(run: Histories, level: Any) -> dict[str, np.ndarray]:
    """Arrays of a level by their names, which follow the prefix with its number."""
    width, questions = level.width, questions_of(run)
    rows = [run._row(quantity, name)(level) for quantity, name in questions]
    closed = {"contact_force": "contact_intervals", "friction_force": "stick_intervals"}
    holds = [quantity in closed and run._holds(closed[quantity], name)(level) for quantity, name in questions]
    form = level.strain_form
    return {
        "shapes": run._motion(level, np.eye(width)),
        "centre": run._asymptotic(level),
        "rows": np.array(rows).reshape(-1, 2 * width + 1),
        "holds": np.array(holds, bool),
        "moving": level.motion(np.eye(width)),
        **{f"strain_{name}": np.asarray(getattr(form, name)) for name in STRAIN},
    }


def level_from(
    states: tuple[int, ...], questions: list[Any], arrays: Mapping[str, np.ndarray], prefix: str
) -> SavedLevel:
    """Level from the arrays whose names begin with ``prefix``."""

    def of(name: str) -> np.ndarray:
        return arrays[prefix + name]

    form: dict[str, Any] = {name: of(f"strain_{name}") for name in STRAIN}
    return SavedLevel(
        states=states,
        shapes=of("shapes"),
        centre=of("centre"),
        rows=dict(zip(questions, of("rows"), strict=True)),
        holds=dict(zip(questions, of("holds").tolist(), strict=True)),
        moving=of("moving"),
        strain=StrainForm(**form | {"constant": float(form["constant"])}),
    )


def segment_arrays(segments: Sequence[Segment], numbers: Sequence[int]) -> dict[str, np.ndarray]:
    """Arrays of segments; numbers: of their levels."""
    bases = [segment.basis for segment in segments]
    return {
        "segment_start": np.array([segment.start for segment in segments]),
        "segment_end": np.array([segment.end for segment in segments]),
        "segment_level": np.array(numbers, np.int64),
        "term_count": np.array([len(basis.rates) for basis in bases], np.int64),
        "unit": np.array([basis.unit for basis in bases]),
        "free": np.array([segment.free for segment in segments], np.int64),
        "rate": np.concatenate([np.zeros(0, complex), *(basis.rates for basis in bases)]),
        "power": np.concatenate([np.zeros(0, np.int64), *(basis.powers for basis in bases)]),
        "coefficient": np.concatenate([np.zeros(0, complex), *(segment.rows.ravel() for segment in segments)]),
    }


def segments_from(levels: Sequence[Any], arrays: Mapping[str, np.ndarray]) -> Segments:
    """Segments from the arrays."""
    counts, owners = arrays["term_count"].tolist(), arrays["segment_level"].tolist()
    terms = pairwise(accumulate(counts, initial=0))
    sizes = [levels[owner].width * count for owner, count in zip(owners, counts, strict=True)]
    blocks = pairwise(accumulate(sizes, initial=0))
    segments = []
    for k, ((first, last), (begin, end)) in enumerate(zip(terms, blocks, strict=True)):
        basis = Exponentials(arrays["rate"][first:last], arrays["power"][first:last], float(arrays["unit"][k]))
        rows = arrays["coefficient"][begin:end].reshape(-1, counts[k])
        spans = float(arrays["segment_start"][k]), float(arrays["segment_end"][k])
        segments.append(Segment(*spans, levels[owners[k]], basis, rows, int(arrays["free"][k])))
    return Segments(segments)


def elements_of(events: Sequence[Event]) -> Iterator[str]:
    """Names of the elements of events, force laws included."""
    for event in events:
        yield event.contact
        yield from (name for name, _ in event.shared)


def event_arrays(events: Sequence[Event], elements: Sequence[str], entered: Sequence[str]) -> dict[str, np.ndarray]:
    """Arrays of events; elements, entered: the names that they refer to by index."""
    place = {name: i for i, name in enumerate(elements)}
    shared = [(k, place[name], push) for k, event in enumerate(events) for name, push in event.shared]
    return {
        "event_time": np.array([event.time for event in events]),
        "event_kind": np.array([KINDS.index(event.kind) for event in events], np.int64),
        "event_element": np.array([place[event.contact] for event in events], np.int64),
        "event_state": np.array([entered.index(event.state) for event in events], np.int64),
        "event_loss": np.array([event.loss for event in events]).reshape(-1, LOSSES),
        "event_impulse": np.array([event.impulse for event in events]),
        "shared": np.array(shared).reshape(-1, 3),
    }


def events_from(header: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> tuple[Event, ...]:
    """Events from the arrays."""
    elements, shared = header["elements"], dict[int, list[tuple[str, float]]]()
    for k, place, push in arrays["shared"].tolist():
        shared.setdefault(int(k), []).append((elements[int(place)], push))
    columns = (arrays[f"event_{name}"].tolist() for name in ("time", "element", "kind", "loss", "impulse", "state"))
    return tuple(
        Event(
            time,
            elements[element],
            header["kinds"][kind],
            Loss(*loss),
            impulse,
            tuple(shared.get(k, ())),
            header["entered"][state],
        )
        for k, (time, element, kind, loss, impulse, state) in enumerate(zip(*columns, strict=True))
    )
