"""Saved arrays: levels, segments and events of a saved run as plain arrays, and back (saved.py lists them)."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise
from typing import Any

import numpy as np

from multiphi_exudyn.events.excitation.loaded_level import StrainForm
from multiphi_exudyn.events.transitions.state import Event, Loss
from multiphi_exudyn.mathematics.exponentials import Exponentials
from multiphi_exudyn.time.segments.segment import Segment
from multiphi_exudyn.time.segments.segment_flow import Flow
from multiphi_exudyn.time.trajectory.histories import Histories

__all__ = [
    "KINDS",
    "SavedLevel",
    "elements_of",
    "event_arrays",
    "events_from",
    "level_arrays",
    "level_from",
    "levels_of",
    "questions_of",
    "segment_arrays",
    "segments_from",
]

CONTACT, FRICTION = ("gap", "contact_force"), ("friction_force", "slip")

KINDS = ("close", "open", "stick", "slip", "segment")
LOSSES = len(Loss._fields)
STRAIN = tuple(field.name for field in dataclasses.fields(StrainForm))


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
        "free": np.array([segment.flow.free for segment in segments], np.int64),
        "rate": np.concatenate([np.zeros(0, complex), *(basis.rates for basis in bases)]),
        "power": np.concatenate([np.zeros(0, np.int64), *(basis.powers for basis in bases)]),
        "coefficient": np.concatenate([np.zeros(0, complex), *(segment.rows.ravel() for segment in segments)]),
    }


def segments_from(levels: Sequence[Any], arrays: Mapping[str, np.ndarray]) -> tuple[Segment, ...]:
    """Segments from the arrays."""
    counts, owners = arrays["term_count"].tolist(), arrays["segment_level"].tolist()
    terms = pairwise(accumulate(counts, initial=0))
    sizes = [levels[owner].width * count for owner, count in zip(owners, counts, strict=True)]
    blocks = pairwise(accumulate(sizes, initial=0))
    segments = []
    for k, ((first, last), (begin, end)) in enumerate(zip(terms, blocks, strict=True)):
        basis = Exponentials(arrays["rate"][first:last], arrays["power"][first:last], float(arrays["unit"][k]))
        shapes = arrays["coefficient"][begin:end].reshape(-1, counts[k])
        flow = Flow(basis, shapes, np.ones(counts[k]), int(arrays["free"][k]))
        spans = float(arrays["segment_start"][k]), float(arrays["segment_end"][k])
        segments.append(Segment(*spans, levels[owners[k]], flow, phases=(), armed_at=0.0))
    return tuple(segments)


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
