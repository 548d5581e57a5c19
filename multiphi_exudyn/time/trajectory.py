"""Trajectory: the result of a simulation, analytic segments that are evaluated at any time (eq. 38.4).

Its histories are those of histories.py; points, contacts and frictions are rows of the model's levels by their names.
Energies come from two independent sides: the ledger adds the losses (impacts, truncation, damping, the last in closed
form) and the work of loads; its residual is the difference to kinetic + strain energy.
"""

from __future__ import annotations

import dataclasses
import functools
import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from multiphi_exudyn.display import kinds, names
from multiphi_exudyn.errors import MultiPhiValueError, NumericalFailure
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mechanics.arguments import is_real
from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.friction import Friction
from multiphi_exudyn.mechanics.structure import At
from multiphi_exudyn.time.histories import INSTANTS, Histories
from multiphi_exudyn.time.ledger import FinalState, Ledger, Statistics, ledger_of
from multiphi_exudyn.time.loaded_level import LoadedLevel
from multiphi_exudyn.time.mesh_output import write_vtu
from multiphi_exudyn.time.model_warnings import issue, row_warnings
from multiphi_exudyn.time.saved import save
from multiphi_exudyn.time.segments import Segments, force_row, gap_row, patch_row, point_row, pressing_row
from multiphi_exudyn.time.start import Start
from multiphi_exudyn.time.state import Event, Loss, Phase, State, event_table

__all__ = ["ModelHistories", "Rerun", "Trajectory"]

ROWS = {  # of a level, for an element's position
    "gap": gap_row,
    "contact_force": pressing_row,
    "contact_impulse": pressing_row,
    "friction_force": force_row,
    "slip": patch_row,
}
PERTURBATION = 1e-12  # of the largest velocity: above round-off, below the accuracy of a start
GAP_CHANGE = 1e-10  # of a gap and of the motion there: above what counts as one instant where stops move
STILL = 1e-6  # of the smallest gap: a smaller motion is none, and distances are judged by the gap
FRAMES = 101  # of mesh output where no times are given
SEED = 1  # of the directions of perturbations
Rerun: TypeAlias = "Callable[[np.ndarray, np.ndarray, Mapping[str, float]], Trajectory]"


class ModelHistories(Histories):
    """Histories of a motion of ``model`` by names."""

    model: MultiPhiModel

    @property
    def points(self) -> tuple[str, ...]:
        """Names of the structure's points."""
        return tuple(self.model.structure.points)

    @property
    def contacts(self) -> tuple[str, ...]:
        """Names of the model's contacts."""
        return tuple(contact.name for contact in self.model.contacts if isinstance(contact, UnilateralContact))

    @property
    def frictions(self) -> tuple[str, ...]:
        """Names of the model's frictions."""
        return tuple(contact.name for contact in self.model.contacts if isinstance(contact, Friction))

    @property
    def rubbing(self) -> tuple[str, ...]:
        """Names of the model's contacts that have friction."""
        names = [self.model.contacts[i].name for i in self.model.rubbing]
        return tuple(name for name in names if name in self.contacts)

    def _row(self, quantity: str, name: At) -> Callable[[LoadedLevel], np.ndarray]:
        if quantity == "at":
            if not isinstance(name, (str, Mapping)):
                issue(row_warnings(self.model, self.model.structure.row(name)))
            return functools.partial(point_row, self.model.base.modes.shapes.T @ self.model.structure.row(name))
        row = ROWS[quantity]
        place = self._friction if quantity in ("friction_force", "slip") else self._contact
        return functools.partial(row, place(quantity, str(name)))

    def _holds(self, quantity: str, name: str) -> Callable[[LoadedLevel], bool]:
        if quantity == "stick_intervals":
            places = self.model.link_indices[self._friction(quantity, name)]
            links = [k for k in places if self.model.links[k].held]
        else:
            links = self.model.pressing_links(self._contact(quantity, name))
        return lambda level: not set(links).isdisjoint(level.level.indices)

    def _motion(self, level: LoadedLevel, xi: np.ndarray) -> np.ndarray:
        return np.linalg.multi_dot([self.model.base.modes.shapes, level.level.vectors, xi])

    def _asymptotic(self, level: LoadedLevel) -> np.ndarray:
        return np.asarray(self.model.base.modes.shapes @ level.asymptotic.configuration)

    def _contact(self, quantity: str, name: str) -> int:
        """Index of a contact or force law."""
        i = self.model.index(name)
        if isinstance(self.model.contacts[i], Friction):
            raise MultiPhiValueError(
                f"{quantity}: got the friction {name!r}, need a contact (friction_force, slip, stick_intervals)"
            )
        return i

    def _friction(self, quantity: str, name: str) -> int:
        """Index of an element with friction."""
        i = self.model.index(name)
        if not any(self.model.links[k].held for k in self.model.link_indices[i]):
            raise MultiPhiValueError(f"{quantity}: got {name!r}, which has no friction, need the name of one that has")
        return i


@dataclass(frozen=True, repr=False)
class Trajectory(ModelHistories):
    """Result of ``simulate``: a motion in analytic segments, with its events, energies and warnings.

        x(t) = Phi_l eta(t) + x_inf,l,   eta(t) = Re V (c exp(lambda (t - t_k)))   on [t_k, t_k+1]

    Histories: ``displacement``, ``velocity``, ``acceleration``, ``at`` a point, ``gap``, ``contact_force``,
    ``contact_impulse``, ``contact_intervals``, ``friction_force``, ``slip``, ``stick_intervals``, ``energy``; a table
    by ``to_dataframe``, a figure by ``plot``, files for ParaView by ``to_vtu``. Times [s] are scalars or (k,); at an
    event ``side`` chooses the limit from the "right" (default) or the "left".

    Attributes
    ----------
    model : MultiPhiModel
        The model of the run, with the decided modes where it had a ``Tolerance``.
    segments : sequence of Segment
        The motion, each segment within one level.
    events : sequence of Event
        In order of time.
    t_end : float
        End of the motion [s].
    status : str
        "ok" or "failed".
    message : str
        The cause of a failure.
    start : Start
        Displacement, velocity and states at the start, in base coordinates.
    ending : FinalState
        State, sums and counts at the end.
    load : array (m,)
        The static load in base coordinates.
    warnings : tuple of str
        What to distrust in this result and what to do about it, one sentence each that begins with its kind and a
        colon: open ledger, truncated contact, truncated friction, backward slip, redundant contacts, redundant
        friction, friction in turn, force law, mesh impacts, several impacts, truncation, lost energy, digits, undamped
        modes, damping ratios, law span, missing modes, linear range, cluster, base, slow mode, load pieces, slow model.
    again : callable
        Function that repeats the run from other y, y' (m,) and with changed gaps, without warnings.

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
    >>> round(1e3 * tr.at("tip", 0.0), 3)  # mm
    7.5
    >>> tr.displacement(np.linspace(0.0, 0.5, 11)).shape
    (3, 11)
    >>> tr.warnings
    ()
    """

    model: MultiPhiModel
    segments: Segments
    events: Sequence[Event]
    t_end: float
    status: str
    message: str
    start: Start
    ending: FinalState
    load: np.ndarray
    warnings: tuple[str, ...] = ()
    again: Rerun | None = field(default=None, repr=False, compare=False)

    def _facts(self) -> Iterator[tuple[str, str]]:
        yield "status", f"{self.status}{f', {self.message}' if self.message else ''}"
        yield "time", f"{self.start.time:g} to {self.t_end:g} s"
        yield "events", str(len(self.events))
        struck = {event.contact for event in self.events}
        if idle := [name for name in self.contacts if name not in struck and not self.contact_intervals(name)]:
            yield "never closed", names(idle)
        yield "levels built", str(self.stats.levels_built)
        yield "warnings", kinds(self.warnings)

    @property
    def t_start(self) -> float:
        """Start of the motion [s]."""
        return self.start.time

    @property
    def start_loss(self) -> Loss:
        """Energies [J] lost at the start itself."""
        return self.ending.start_loss

    @functools.cached_property
    def final(self) -> State | None:
        """Final state, after the events at its instant; None for a run that failed at its start."""
        return self.ending.state if self.segments else None

    def ending_in(self, state: State) -> Trajectory:
        """Return a copy with another final state."""
        return dataclasses.replace(self, ending=self.ending.at(state))

    @property
    def stats(self) -> Statistics:
        """Levels built, transitions, events, segments, function evaluations, bytes."""
        return self.ending.statistics(len(self.segments), len(self.events), self.model.levels_possible)

    def to_vtu(self, path: str | Path, mesh: Any, dofs: np.ndarray, times: np.ndarray | None = None) -> list[Path]:
        """Write the motion on a mesh: a VTU file for each time, and a PVD file that lists them, as ParaView opens it.

        Every node has its displacement [m], its velocity [m/s] and the force of contacts and friction [N]. Needs
        meshio, the extra "mesh".

        Parameters
        ----------
        path : str or Path
            Name of the PVD file; the others stand beside it.
        mesh : meshio.Mesh or array (p, 1 to 3)
            Nodes [m] and cells, or nodes alone.
        dofs : array (p, 1 to 3)
            Degrees of freedom of the displacements of every node, in the numbering without supports, -1 for none.
        times : array (k,), default None
            Times [s], None for 101 that are evenly spaced.

        Returns
        -------
        list of Path
            What was written, the PVD file first.

        Raises
        ------
        MultiPhiError
            Without meshio.
        MultiPhiTypeError, MultiPhiValueError
            For a mesh or degrees of freedom of another shape, and a time outside of the motion.
        """
        at = self._times(np.linspace(self.t_start, self.t_end, FRAMES) if times is None else times)
        return write_vtu(self, self.model, path, mesh, dofs, at)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the motion to an .npz file without pickled objects, which ``load_trajectory`` reads.

        The loaded trajectory has all histories, events and energies; it cannot be continued. The file has n numbers for
        each mode of each visited level, and is written completely or not at all.

        Parameters
        ----------
        path : str or path
            Of the file.
        """
        status = {"status": self.status, "message": self.message, "warnings": self.warnings}
        ledger = dataclasses.asdict(self.ledger) if self.segments else None
        save(self, Path(path), **status, ledger=ledger, stats=self.stats._asdict())

    @property
    def ledger(self) -> Ledger:
        """Energy balance of the run [J], computed when it is read.

        Raises
        ------
        NumericalFailure
            For a run that failed at its start and has no motion.
        """
        if not self.segments:
            raise NumericalFailure(f"ledger: got a run without motion ({self.message}), need one that has started")
        ending = self.ending
        return ledger_of(ending.ledger, ending.record.works, self._static_work, self.initial_energy, ending.energy)

    @property
    def _static_work(self) -> float:
        """Work [J] of the static load."""
        level = self.ending.level
        if level is None or not level.excitation.pushes:
            return 0.0
        return float(self.load @ (level.configuration(self.ending.displacement) - self.start.displacement))

    @property
    def initial_energy(self) -> float:
        """Kinetic and strain energy [J] at the start."""
        state = self.start.state
        return self.ending.given_energy if state is None else state.level.energy(state.displacement, state.velocity)

    def deepest_gap(self, contact: str, samples: int = 20) -> float:
        """Smallest gap [m] of a contact while it is open, 0.0 where truncation leaves no gap below zero.

        Sampled where the event rule accepts a negative gap, ``samples`` in the shortest period of the level and at
        least as many in a segment.

        Raises
        ------
        MultiPhiValueError
            For a name that is no contact.
        """
        i = self._contact("deepest_gap", contact)
        depth = 0.0
        for segment in self.segments:
            exits = [k for k, (element, _) in enumerate(segment.level.exits) if element == i]
            unarmed = any(segment.phases[k] is not Phase.ARMED for k in exits)
            if unarmed and set(self.model.pressing_links(i)).isdisjoint(segment.level.level.indices):
                depth = min(depth, float(np.min(segment.gaps(i, segment.unarmed_times(samples)))))
        return depth

    def horizon(self, tolerance: float = 0.01) -> float:
        """Sensitivity horizon [s]: time until which perturbed runs stay within ``tolerance`` of this one.

        Beyond it motions cannot be compared point by point: round-off would change them as much. The perturbations are
        +-1e-12 of the velocities y' where the run is fastest, added to those at the start; as much in a direction that
        the motion need not have, fixed and random in all coordinates; and +-1e-10 of the gaps and of the motion there.
        The distance is that of y, in the norm of the mass matrix, relative to the largest |y| of the run, and for one
        at rest to the smallest gap. The horizon is t_end where the distance never exceeds the tolerance, and no later
        than the end of a perturbed run that fails. Costs six more runs, four without contacts or for a continued run.

        Parameters
        ----------
        tolerance : float, default 0.01
            Between 0 and 1; 0.01 is 1 %.

        Raises
        ------
        MultiPhiValueError
            For a tolerance out of range.
        NumericalFailure
            For a run that failed at its start.
        """
        if not (is_real(tolerance) and 0 < tolerance < 1):
            raise MultiPhiValueError(f"tolerance: got {tolerance!r}, need a number between 0 and 1")
        if not self.segments or self.again is None:
            raise NumericalFailure(f"horizon: got a run without motion ({self.message}), need one that has started")
        times = self._comparison_times
        y, speeds = self._coordinates(times), self.model.base.coordinates(self.velocity(times))
        fastest, reach = int(np.argmax(np.linalg.norm(speeds, axis=0))), float(np.max(np.linalg.norm(y, axis=0)))
        length, start = self._smallest_gap, self.start
        speed = max(float(np.linalg.norm(speeds[:, fastest])), length / (self.t_end - start.time))
        along, across = PERTURBATION * speeds[:, fastest], PERTURBATION * speed * self._random_direction
        runs = [
            self.again(start.displacement, start.velocity + sign * change, {})
            for change in (along, across)
            for sign in (1.0, -1.0)
        ]
        for sign in (1.0, -1.0) if (changes := self._random_gap_changes(y)) else ():
            gaps = {name: sign * change for name, change in changes.items()}
            runs.append(self.again(start.displacement, start.velocity, gaps))
        limit = tolerance * (reach if reach > STILL * length else length)
        completed = [run for run in runs if run.status == self.status] or runs
        return min(_first_distance_above(run, times, y, limit) for run in completed)

    @property
    def _smallest_gap(self) -> float:
        """Smallest |y| [m sqrt(kg)] that closes a gap which is not closed, zero without one."""
        base = self.model.base
        moved = (base.lengths > 0) & (base.gaps != 0)
        return float(np.min(np.abs(base.gaps[moved]) / base.lengths[moved], initial=math.inf)) if moved.any() else 0.0

    @property
    def _random_direction(self) -> np.ndarray:
        """A unit vector y (m,) with a part of every coordinate x_i of the structure, of its size 1 / sqrt(M_ii)."""
        mass = np.asarray(self.model.structure.mass.diagonal())
        x = np.random.default_rng(SEED).uniform(-1.0, 1.0, len(mass)) / np.sqrt(mass)
        y = self.model.base.coordinates(x)
        return np.asarray(y / np.linalg.norm(y))

    def _random_gap_changes(self, y: np.ndarray) -> dict[str, float]:
        """Changes [m] of gaps, relative to their sizes and to the motion y (m, k) at the contacts.

        A continued run keeps its gaps: its stops are where they are.
        """
        base, names = self.model.base, self.contacts if self.start.state is None else ()
        places = np.array([self.model.link_indices[self.model.index(name)][0] for name in names], int)
        sizes = np.max(np.abs(base.directions[:, places].T @ y), axis=1, initial=0.0) + np.abs(base.gaps[places])
        changes = GAP_CHANGE * sizes * np.random.default_rng(SEED).uniform(-1.0, 1.0, len(names))
        return {name: change for name, change in zip(names, changes.tolist(), strict=True) if change}

    @property
    def _comparison_times(self) -> np.ndarray:
        """Times (k,) [s] at which runs are compared: evenly spaced, and the events."""
        even = np.linspace(self.start.time, self.t_end, INSTANTS)
        return np.union1d(even, event_table(self.events, self.model.index)[:, 0])

    def _coordinates(self, times: np.ndarray) -> np.ndarray:
        """y (m, k)."""
        return self.model.base.coordinates(self.displacement(times))


def _first_distance_above(run: Trajectory, times: np.ndarray, expected: np.ndarray, limit: float) -> float:
    """First of the times (k,) [s] at which a run is over ``limit`` from y (m, k) or has ended; else the last."""
    count = int(np.sum(times <= run.t_end))
    distances = np.linalg.norm(run._coordinates(times[:count]) - expected[:, :count], axis=0)
    first = int(np.argmax(distances > limit)) if np.any(distances > limit) else min(count, len(times) - 1)
    return float(times[first])
