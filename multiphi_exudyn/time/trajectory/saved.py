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

import io
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from multiphi_exudyn.display import kinds
from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.events.transitions.state import Event
from multiphi_exudyn.files import write_whole
from multiphi_exudyn.mechanics.structures.structure import At
from multiphi_exudyn.time.segments.segment import Segment
from multiphi_exudyn.time.trajectory.histories import Histories
from multiphi_exudyn.time.trajectory.ledger import Ledger, Statistics
from multiphi_exudyn.time.trajectory.saved_arrays import (
    KINDS,
    SavedLevel,
    elements_of,
    event_arrays,
    events_from,
    level_arrays,
    level_from,
    levels_of,
    questions_of,
    segment_arrays,
    segments_from,
)

__all__ = ["SavedTrajectory", "load_trajectory", "save"]

FORMAT = 1


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
    >>> saved.points, saved.contacts, len(saved.events) == len(tr.events)
    (('tip',), ('stop',), True)
    """

    segments: Sequence[Segment]
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
