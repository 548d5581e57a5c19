"""Primitives of the powers in a level: forms whose changes over a segment are the works in it (time/loop/work_sums.py).

y = (eta, eta') of the free response, y' = A y, and a (N,) the coefficients of the channels' carriers at an instant,

    w(t + s) = Re sum_j exp(mu_j s) sum_d a_jd s^d,   a' = M a

(M a)_jd = mu_j a_jd + (d + 1) a_j,d+1. The forced response is Re G a, with G M = A G + B. A power of both,

    Re(a.W y) + Re(a.Q a + a.Q~ conj(a)) / 2,   is d/dt of   Re(a.R y) + Re(a.P a + a.P~ conj(a)) / 2
    M^T R + R A = W,   M^T P + P M = Q,   M^T P~ + P~ conj(M) = Q~

is solved row by row for R, and element by element for P. If two rates cancel each other, the products of their a are
polynomials of time, which Gauss-Legendre quadrature integrates exactly.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from multiphi_exudyn.events.excitation.loaded_level import LoadedLevel
from multiphi_exudyn.mathematics.compiling.compiled import Numbers, Waves, compiled, entry

__all__ = ["MOST_COEFFICIENTS", "DrivenForms", "driven_forms", "primitive", "swings"]

LARGEST_PRIMITIVE = 1e3  # times the squared velocities: energies are of the size of these; larger ones are round-off
MOST_COEFFICIENTS = 16  # N: with more, quadrature is faster
NEARLY_CANCELLED = 1e-6  # of two rates: their sum, unless it is zero; primitives would be large differences


@dataclass(frozen=True)
class DrivenForms:
    """Real forms in u = (b, y), (s,); b (k,) holds Re a of each carrier, and Im a if its rate is not real.

    carriers: powers (D + 1) of time by their rates. response: G (2 r, k). changing: rows b of the primitives (k, s), of
    the powers of damping and of varying loads. lasting: powers without a primitive (k, k). nodes, weights: on [0, 1],
    for these.
    """

    carriers: Mapping[complex, int]
    response: np.ndarray
    changing: Sequence[np.ndarray]
    lasting: Sequence[np.ndarray]
    nodes: np.ndarray
    weights: np.ndarray


def primitive(level: LoadedLevel, damping: np.ndarray) -> np.ndarray | None:
    """Return F (2 r, 2 r), symmetric: y.F y grows by the work of damping in a free response.

    None if the response has powers of time. damping: D, symmetric, (r, r) or more. Of z = c exp(lambda t) (p,), with
    the velocities S = V Lambda, eta' = Re S z,

        eta'.D eta' = 1/2 Re (z.S^T D S z + z.S^T D conj(S z)) = d/dt 1/2 Re (z.A z + z.B conj(z))

    and A, B are S^T D S and S^T D conj(S) over the sums lambda_j + lambda_k and lambda_j + conj(lambda_k). In an
    undamped motion B is one round-off divided by another. The asymmetric part of F consists of that alone, and is
    removed, as y.F y changes by (y_1 + y_0).F (y_1 - y_0) only for a symmetric F.
    """
    response, r, p = level.response, level.modal.modes, len(level.response.basis.rates)
    if not response.basis.pure:
        return None
    given = [response.basis.rates, response.shapes.T, response.from_displacement, response.from_velocity]
    waves, numbers = np.concatenate(given, axis=None), np.empty((6 * r + 4 * p + 1) * p)
    rows, power = numbers[: 6 * r * p].reshape(2 * p, 3 * r), numbers[6 * r * p : -p].reshape(2 * p, 2 * p)
    unfold_response(numbers, waves, r, p)
    speeds, starts = rows[:, :r], rows[:, r:]
    speeds.dot(damping[:r, :r]).dot(speeds.T, out=power)
    if not integrate_power(numbers, waves, r, p):
        return None
    form = starts.T.dot(power.dot(starts))
    return np.asarray((form + form.T) / 2)


@compiled
def unfold(numbers: Numbers, waves: Waves, r: int, p: int) -> None:
    """Write S^T, A, B (p, 3 r), real parts, then imaginary ones, and |S_j|^2 (p,).

    waves: lambda (p,), V^T, A, B (p, r).
    """
    for j in range(p):
        real, imaginary, size = 3 * r * j, 3 * r * (p + j), 0.0
        for i in range(r):
            speed = waves[p + j * r + i] * waves[j]
            size += speed.real * speed.real + speed.imag * speed.imag
            numbers[real + i], numbers[imaginary + i] = speed.real, speed.imag
        numbers[(6 * r + 4 * p) * p + j] = size
        for part in range(1, 3):
            for i in range(r):
                value = waves[p + (part * p + j) * r + i]
                numbers[real + part * r + i], numbers[imaginary + part * r + i] = value.real, value.imag


@compiled
def integrate(numbers: Numbers, waves: Waves, r: int, p: int) -> int:
    """Replace the power [Re S, Im S]^T D [Re S, Im S] by its primitive in (Re z, Im z), (2 p, 2 p).

    Return 0 if the primitive is much larger than the velocities, else 1.
    """
    sizes = (6 * r + 4 * p) * p
    for j in range(p):
        for k in range(p):
            upper, lower = 6 * r * p + 2 * p * j + k, 6 * r * p + 2 * p * (p + j) + k
            one, crossed, back, other = numbers[upper], numbers[upper + p], numbers[lower], numbers[lower + p]
            a, b = complex(one - other, crossed + back), complex(one + other, back - crossed)
            sums, differences = waves[j] + waves[k], waves[j] + waves[k].conjugate()
            largest = LARGEST_PRIMITIVE * LARGEST_PRIMITIVE * numbers[sizes + j] * numbers[sizes + k]
            first = sums.real * sums.real + sums.imag * sums.imag
            second = differences.real * differences.real + differences.imag * differences.imag
            if a.real * a.real + a.imag * a.imag > largest * first:
                return 0
            if b.real * b.real + b.imag * b.imag > largest * second:
                return 0
            a *= sums.conjugate() * (0.5 / first) if first > 0.0 else 0j
            b *= differences.conjugate() * (0.5 / second) if second > 0.0 else 0j
            numbers[upper], numbers[upper + p] = b.real + a.real, b.imag - a.imag
            numbers[lower], numbers[lower + p] = -b.imag - a.imag, b.real - a.real
    return 1


unfold_response, integrate_power = entry(unfold), entry(integrate)


def swings(level: LoadedLevel, varying: np.ndarray) -> np.ndarray:
    """Return (p, r + 2 q) for each exponential of the free response: eta', and the forces that work on w and w'.

    varying: the power of varying loads (``powers``). The response must have no powers of time.
    """
    response, r, n = level.response, level.modal.modes, level.level.modes
    speeds = response.shapes * response.basis.rates
    held, place, speed, change = (varying[:, k * n : k * n + r] for k in range(4))
    moved = place @ response.shapes + speed @ speeds + change @ (speeds * response.basis.rates)
    return np.concatenate([speeds, held @ speeds, moved]).T


def driven_forms(
    level: LoadedLevel, damping: np.ndarray, varying: np.ndarray, carriers: Mapping[complex, int]
) -> DrivenForms | None:
    """Return the forms of a level, damping (n, n) and varying (q, 4 n + 1) as ``powers`` has them.

    None if a carrier meets a pole, or if there are too many carriers.
    """
    q, r, n = level.excitation.prescribed, level.modal.modes, level.level.modes
    if not 0 < sum(carriers.values()) * q <= MOST_COEFFICIENTS:
        return None
    chains, damped = _Chains(carriers, q), level.modal.damping_matrix
    stiffness = np.diag(level.modal.squares) + level.modal.coupling
    try:
        with np.errstate(all="ignore"):
            places = np.zeros((n, chains.count), complex)
            places[:r] = chains.response(level, stiffness, damped)
            places[r : r + q] = chains.values
            speeds, drives = places @ chains.motion, np.vstack([chains.values, chains.values @ chains.motion])
            a, b, c, d = (varying[:q, k * n : (k + 1) * n] for k in range(4))
            pushed = np.vstack([a @ speeds, b @ places + c @ speeds + d @ (speeds @ chains.motion)])
            on_place = np.vstack([np.zeros((q, r)), b[:, :r] - d[:, :r] @ stiffness])
            on_speed = np.vstack([a[:, :r], c[:, :r] - d[:, :r] @ damped])
            still = np.zeros((chains.count, r))
            crossed = [
                chains.crossed(still, 2 * speeds.T @ damping[:, :r], stiffness, damped),
                chains.crossed(drives.T @ on_place, drives.T @ on_speed, stiffness, damped),
            ]
            squared = [chains.squared(speeds, damping @ speeds), chains.squared(drives, pushed)]
    except np.linalg.LinAlgError:
        return None
    response = np.vstack([places[:r], speeds[:r]])
    kept = chains.kept
    of_channels = np.hstack([response.real, -response.imag])[:, kept]
    changing = [
        np.hstack([form[:, kept], np.vstack([rows.real, -rows.imag])])[kept]
        for (form, _), rows in zip(squared, crossed, strict=True)
    ]
    lasting = [rest[kept][:, kept] for _, rest in squared]
    if not all(np.all(np.isfinite(part)) for part in (of_channels, *changing, *lasting)):
        return None
    nodes, weights = np.polynomial.legendre.leggauss(max(carriers.values()))
    return DrivenForms(dict(carriers), of_channels, changing, lasting, (nodes + 1) / 2, weights / 2)


class _Chains:
    """Coefficients a (N,) of carriers with their powers of time, of q channels: carrier by carrier, power by power."""

    def __init__(self, carriers: Mapping[complex, int], q: int) -> None:
        self._q, self._carriers = q, carriers
        self._terms = [(rate, d) for rate, count in carriers.items() for d in range(count)]
        self.count = q * len(self._terms)
        one, motion = np.eye(q), np.zeros((len(self._terms), len(self._terms)), complex)
        for k, (rate, d) in enumerate(self._terms):
            motion[k, k] = rate
            if d:
                motion[k - 1, k] = d
        self.motion = np.kron(motion, one)  # M
        self.values = np.kron([float(d == 0) for _, d in self._terms], one)  # w = Re values a

    @property
    def kept(self) -> list[int]:
        """Indices of those of (Re a, Im a) that are in b, in their order there."""
        kept, first = list[int](), 0
        for rate, count in self._carriers.items():
            own = range(first, first + count * self._q)
            kept += [*own, *(self.count + k for k in own if rate.imag)]
            first += count * self._q
        return kept

    def _columns(self, k: int) -> slice:
        return slice(k * self._q, (k + 1) * self._q)

    def response(self, level: LoadedLevel, stiffness: np.ndarray, damped: np.ndarray) -> np.ndarray:
        """Return the upper half (r, N) of G: eta'' + D eta' + S eta = P w + Q w'."""
        r, channels = len(stiffness), level.channels
        drives = self.values @ self.motion
        pushes = channels.force[:, : self._q] @ self.values + channels.force_rate[:, : self._q] @ drives
        result = np.zeros((r, self.count), complex)
        for k, (rate, d) in enumerate(self._terms):
            force = pushes[:, self._columns(k)]
            if d:
                force = force - d * (2 * rate * np.eye(r) + damped) @ result[:, self._columns(k - 1)]
            if d > 1:
                force = force - d * (d - 1) * result[:, self._columns(k - 2)]
            result[:, self._columns(k)] = np.linalg.solve(_dynamic(rate, stiffness, damped), force)
        return result

    def crossed(
        self, on_place: np.ndarray, on_speed: np.ndarray, stiffness: np.ndarray, damped: np.ndarray
    ) -> np.ndarray:
        """Return R (N, 2 r) of W = (on_place, on_speed)."""
        r = len(stiffness)
        result = np.zeros((self.count, 2 * r), complex)
        for k, (rate, d) in enumerate(self._terms):
            own = self._columns(k)
            place, speed = on_place[own], on_speed[own]
            if d:
                before = d * result[self._columns(k - 1)]
                place, speed = place - before[:, :r], speed - before[:, r:]
            turned = np.linalg.solve(_dynamic(-rate, stiffness, damped).T, (rate * speed - place).T).T
            result[own, r:] = turned
            result[own, :r] = speed - turned @ (rate * np.eye(r) - damped)
        return result

    def squared(self, one: np.ndarray, other: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the primitive in (Re a, Im a) of Re(one a).Re(other a), (k, N) each, and the part without one."""
        result, rest = self._primitive(one.T @ other, np.asarray)
        mirrored, further = self._primitive(one.T @ other.conj(), np.conj)
        return _real(result, mirrored), _real(rest, further)

    def _primitive(self, power: np.ndarray, turned: Callable[[complex], Any]) -> tuple[np.ndarray, np.ndarray]:
        """Return P (N, N) of Q, the rates of its second index ``turned``, and the part of Q that has no primitive."""
        result, rest = np.zeros_like(power), np.zeros_like(power)
        for k, (rate, d) in enumerate(self._terms):
            for j, (other, e) in enumerate(self._terms):
                rows, columns, total = self._columns(k), self._columns(j), complex(rate + turned(other))
                if total == 0:
                    rest[rows, columns] = power[rows, columns]
                    continue
                if abs(total) < NEARLY_CANCELLED * (abs(rate) + abs(other)):
                    raise np.linalg.LinAlgError("rates that nearly cancel")
                form = power[rows, columns]
                if d:
                    form = form - d * result[self._columns(k - 1), columns]
                if e:
                    form = form - e * result[rows, self._columns(j - 1)]
                result[rows, columns] = form / total
        return result, rest


def _dynamic(rate: complex, stiffness: np.ndarray, damped: np.ndarray) -> np.ndarray:
    """Return rate^2 + D rate + S."""
    return np.asarray(rate * (rate * np.eye(len(stiffness)) + damped) + stiffness)


def _real(power: np.ndarray, conjugated: np.ndarray) -> np.ndarray:
    """Return the form of Re(a.P a + a.P~ conj(a)) / 2 in (Re a, Im a)."""
    upper = np.hstack([power.real + conjugated.real, conjugated.imag - power.imag])
    lower = np.hstack([-power.imag - conjugated.imag, conjugated.real - power.real])
    return 0.5 * np.vstack([upper, lower])
