"""Segment: the motion in one level between two events, as a sum of exponentials (eq. 38.4).

    eta(t) = Re V (c exp(lambda (t - t_k)))   on [t_k, t_k+1]

Gaps, contact forces, energies and their integrals follow in closed form.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.events.state import Phase
from multiphi_exudyn.events.transition import LoadedLevel
from multiphi_exudyn.mathematics.exponentials import Exponentials

__all__ = ["Batch", "Segment", "batched", "batches"]

MOST_SAMPLES = 10_000  # of a gap in one segment: what looking for its smallest value may cost


@dataclass(frozen=True)
class Segment:
    """Motion in one level from ``start`` to ``end`` [s]: coefficients c (p,) of the level's exponentials.

    phases: of every contact at the start; armed_at: when after it [s] the last of them was armed.
    """

    start: float
    end: float
    level: LoadedLevel
    coefficients: np.ndarray
    phases: tuple[Phase, ...]
    armed_at: float

    def modal(self, t: np.ndarray, derivative: int = 0) -> np.ndarray:
        """eta or its first or second derivative, (r, k) at times (k,)."""
        rows = self.rows
        for _ in range(derivative):
            rows = self.basis.derivative(rows)
        return np.asarray((rows @ self.basis.at(t - self.start).T).real)

    @property
    def basis(self) -> Exponentials:
        """The exponentials phi (p,) of the motion."""
        return self.level.level.response.basis

    @property
    def shapes(self) -> np.ndarray:
        """V (r, p)."""
        return self.level.level.response.shapes

    @property
    def amplitudes(self) -> np.ndarray:
        """c (p,) of the exponentials ``basis``."""
        return self.coefficients

    @property
    def rows(self) -> np.ndarray:
        """eta = Re rows phi(t - start), (r, p)."""
        return self.shapes * self.amplitudes

    def gaps(self, contact: int, t: np.ndarray) -> np.ndarray:
        """Gap (k,) [m] of a contact at times (k,)."""
        return np.asarray(self.level.level.gap_rows[contact] @ self.modal(t) + self.level.gap_constants[contact])

    def force(self, contact: int, t: np.ndarray) -> np.ndarray:
        """Contact force (k,) [N] at times (k,), zero where the contact is open."""
        own = self.level.level
        if contact not in own.indices:
            return np.zeros(len(t))
        k = own.indices.index(contact)
        moving = own.force_rows[k] @ self.modal(t) + own.force_rate_rows[k] @ self.modal(t, 1)
        return np.asarray(moving + self.level.asymptotic.forces[k])

    def force_integral(self, contact: int, start: float, end: float) -> float:
        """Integral of the force of a closed contact [N s], exact: a sum of exponentials plus a constant."""
        own = self.level.level
        k, response = own.indices.index(contact), own.response
        c = response.basis.shifted(self.coefficients, start - self.start)
        terms = (own.force_rows[k] @ response.shapes) * c
        terms = terms + (own.force_rate_rows[k] @ response.shapes) * response.basis.derivative(c)
        integral = float((terms @ response.basis.integrals(end - start)).real)
        return integral + float(self.level.asymptotic.forces[k]) * (end - start)

    def energy(self, t: np.ndarray) -> np.ndarray:
        """Kinetic + strain energy (k,) [J] at times (k,)."""
        return np.asarray(self.level.kinetic(self.modal(t, 1)) + self.level.strain(self.modal(t)))

    def damping_work(self) -> float:
        """Integral of eta'^T D eta' [J], in closed form pair by pair of exponentials."""
        own = self.level.level
        if not np.any(own.damping):
            return 0.0
        return own.response.dissipated(self.coefficients, own.damping, self.end - self.start)

    def varying_work(self) -> float:
        """Work [J] of loads and stops that vary in time."""
        return 0.0

    def unarmed_times(self, samples: int) -> np.ndarray:
        """Times (k,) until the only unarmed contact is armed; to the end where it is not, or where there are several.

        ``samples`` in the shortest period of the level and at least as many in all.
        """
        waiting = sum(phase is not Phase.ARMED for phase in self.phases)
        end = self.start + self.armed_at if waiting == 1 and self.armed_at > 0 else self.end
        periods = self.level.level.highest_frequency * (end - self.start)
        return np.linspace(self.start, end, samples + math.ceil(min(samples * periods, MOST_SAMPLES)))


@dataclass(frozen=True)
class Batch:
    """k segments with the same level and exponentials, in arrays.

    places: (k,) among all segments. starts, ends: (k,) [s]. basis, shapes: phi (p,) and V (r, p). coefficients: (k, p).
    """

    level: LoadedLevel
    places: np.ndarray
    starts: np.ndarray
    ends: np.ndarray
    basis: Exponentials
    shapes: np.ndarray
    coefficients: np.ndarray

    def states(self, rows: np.ndarray | slice, after: np.ndarray) -> np.ndarray:
        """eta and eta' (2, j, r) of the segments ``rows`` (j,), times ``after`` (j,) [s] their starts."""
        c, phi = self.coefficients[rows], self.basis.at(after)
        if self.basis.pure:
            both = np.concatenate([c * phi, self.basis.derivative(c) * phi]) @ self.shapes.T
            return both.real.reshape(2, len(phi), len(self.shapes))
        moved = self.shapes * c[:, None, :]  # a power of time and the next lower one have shapes of their own
        return np.array([np.einsum("jrp,jp->jr", x, phi).real for x in (moved, self.basis.derivative(moved))])


def batches(segments: Sequence[Segment]) -> list[Batch]:
    """Segments by level and exponentials; some are kept in arrays (time/record.py)."""
    kept = getattr(segments, "batches", None)
    return batched(dict(enumerate(segments))) if kept is None else kept()


def batched(segments: Mapping[int, Segment]) -> list[Batch]:
    """Segments, by their places, by level and exponentials."""
    alike: dict[int, list[int]] = {}
    for place, segment in segments.items():
        alike.setdefault(id(segment.basis), []).append(place)
    return [_batch(places, [segments[place] for place in places]) for places in alike.values()]


def _batch(places: list[int], segments: list[Segment]) -> Batch:
    first = segments[0]
    starts, ends = np.array([(segment.start, segment.end) for segment in segments]).T
    coefficients = np.array([segment.amplitudes for segment in segments])
    return Batch(first.level, np.array(places), starts, ends, first.basis, first.shapes, coefficients)
