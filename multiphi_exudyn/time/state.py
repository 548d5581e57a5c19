"""State of the reduced model at an instant, the events that change it, and the linear functions of it."""

from __future__ import annotations

import functools
import operator
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

import numpy as np

from multiphi_exudyn.display import Shown
from multiphi_exudyn.mathematics.round_off import sign_of
from multiphi_exudyn.time.loaded_level import LoadedLevel

__all__ = ["Event", "Loss", "Phase", "Row", "State", "event_table", "total_impulse", "total_loss"]


class Phase(Enum):
    """What a contact waits for; see core/law/law.hpp."""

    ARMED = "armed"
    RECOVERING = "recovering"
    REFUSED = "refused"
    HELD_BACK = "held back"
    LANDING = "landing"


@dataclass(frozen=True, repr=False)
class State(Shown):
    """level, displacement xi and velocity xi' (r + q,), phase of every exit."""

    level: LoadedLevel
    displacement: np.ndarray
    velocity: np.ndarray
    phases: tuple[Phase, ...]

    def _facts(self) -> Iterator[tuple[str, str]]:
        yield "states", str(self.states)
        yield "coordinates", str(len(self.displacement))

    @property
    def states(self) -> tuple[int, ...]:
        """The number of every element's state."""
        return self.level.states

    @functools.cached_property
    def held(self) -> np.ndarray:
        """Displacements (h,) [m] that links hold."""
        return self.displacement[self.level.modal.modes + self.level.excitation.prescribed :]

    @functools.cached_property
    def kinetic(self) -> float:
        """Kinetic energy [J]."""
        return float(self.level.kinetic(self.velocity))

    @functools.cached_property
    def potential(self) -> float:
        """Strain energy less the potential of the loads [J]; a transition can only lower it."""
        return self.level.potential(self.displacement)

    @functools.cached_property
    def reach(self) -> np.ndarray:
        """Displacements (r + q,) that the velocities lead to: |eta'| / omega, zero on zero-frequency modes."""
        omega = self.level.level.omega
        return np.divide(np.abs(self.velocity), omega, out=np.zeros(len(omega)), where=omega > 0)


class Loss(NamedTuple):
    """Energies [J] that left the model at an event: by plastic impact, and by truncated bases.

    stop_work: put in by impulses of moving stops, or of bodies attached in Exudyn; no loss. damping: of the springs of
    viscous contacts that change inside their stop (contact.py). friction: of springs that begin to slip, by the drop of
    their force (friction.py).
    """

    impact: float = 0.0
    truncation_kinetic: float = 0.0
    truncation_strain: float = 0.0
    stop_work: float = 0.0
    damping: float = 0.0
    friction: float = 0.0

    def __add__(self, other: Loss) -> Loss:  # type: ignore[override]
        return Loss(*map(operator.add, self, other))

    @property
    def total(self) -> float:
        """Sum of all that was lost [J]."""
        return self.impact + self.truncation_kinetic + self.truncation_strain + self.damping + self.friction


@dataclass(frozen=True)
class Event:
    """A contact or a friction changed its state at an instant.

    A rebound within one instant is a "close" and an "open" of equal time.

    Attributes
    ----------
    time : float
        When [s].
    contact : str
        Name of the contact or the friction.
    kind : str
        "close" or "open"; of friction "stick" or "slip"; of a force law "segment".
    loss : Loss
        The energies [J] that the whole instant has taken, carried by its first event: ``impact``,
        ``truncation_kinetic``, ``truncation_strain``, ``damping``, ``friction``, and ``stop_work``, which is what
        moving stops put in by impulses and no loss.
    impulse : float
        Of the impact [N s], 0 without one.
    shared : tuple of (str, float)
        Name and impulse [N s] of contacts that are closed and stay so in the impact, carried by its first event.
    state : str
        The state that is entered, as a contact that closes may stick or slip; of a force law the segment.

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
    >>> first = tr.events[0]
    >>> first.contact, first.kind, round(first.time, 4)
    ('stop', 'close', 0.0197)
    """

    time: float
    contact: str
    kind: str
    loss: Loss
    impulse: float = 0.0
    shared: tuple[tuple[str, float], ...] = ()
    state: str = ""

    @property
    def energy_loss(self) -> float:
        """Total energy lost [J]."""
        return self.loss.total


def event_table(events: Sequence[Event], index: Callable[[str], int]) -> np.ndarray:
    """Return time [s], index of the contact, impulse [N s] and energy lost to truncation [J] of every event, (k, 4).

    Some events are kept in arrays (recorded_segments.py).
    """
    kept = getattr(events, "table", None)
    if kept is not None:
        return np.asarray(kept())
    lost = ((e.loss.truncation_kinetic + e.loss.truncation_strain, e) for e in events)
    return np.array([(e.time, index(e.contact), e.impulse, energy) for energy, e in lost]).reshape(-1, 4)


def total_loss(events: Sequence[Event]) -> Loss:
    """Return the sum of the losses of all events, some of which are kept in arrays (recorded_segments.py)."""
    kept = getattr(events, "loss", None)
    return sum((event.loss for event in events), Loss()) if kept is None else kept


def total_impulse(events: Sequence[Event], contact: str, first: float, last: float) -> float:
    """Return the impulse [N s] on a contact in [first, last] [s]; some events are kept in arrays."""
    kept = getattr(events, "impulse", None)
    if kept is not None:
        return float(kept(contact, first, last))
    within = [event for event in events if first <= event.time <= last]
    struck = sum(event.impulse for event in within if event.contact == contact)
    return struck + sum(impulse for event in within for name, impulse in event.shared if name == contact)


@dataclass(frozen=True)
class Row:
    """A linear function of a level's modal state: position.eta + rate.eta' + constant."""

    position: np.ndarray
    rate: np.ndarray
    constant: float

    def sign(self, displacement: np.ndarray, velocity: np.ndarray, reach: np.ndarray) -> int:
        """Return the sign of the value, zero if it is round-off of its terms; reach: displacements (r,) of the motion.

        At the root of a signal all displacements may be round-off of what they were before.
        """
        terms, size = self.position * displacement, float(self._sizes.dot(reach))
        return sign_of(terms + self.rate * velocity if self._rated else terms, self.constant, size)

    @functools.cached_property
    def _rated(self) -> bool:
        return bool(np.any(self.rate))

    @functools.cached_property
    def _sizes(self) -> np.ndarray:
        return np.abs(self.position)
