"""Exact free response of modal equations, as sums of exponentials.

    eta'' + D eta' + diag(omega^2) eta = p,   p constant on modes with omega = 0, zero on the others
    eta(t) = Re sum_j V_j c_j t^d_j exp(lambda_j t),   c = A eta(0) + B eta'(0) + P p

omega^2 < 0 is a growing mode. D [1/s] is diagonal for proportional damping: then each mode has its own closed
form (underdamped, overdamped, nearly critical by a Taylor polynomial, zero frequency, growing). A zero-frequency mode
whose damping is slow compared with the duration of its motion has powers of time instead: exponentials would be large
terms, of eta' / D and p / D^2, with small differences. Modes that damping couples are in light_damping.py and
coupled_response.py. Constant forces on modes of non-zero frequency belong to the asymptotic configuration, not here.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.mathematics.compiling.compiled import Numbers, Waves, compiled, entry
from multiphi_exudyn.mathematics.response.exponentials import Exponentials
from multiphi_exudyn.mathematics.response.light_damping import iterate_pairs, pair_numbers
from multiphi_exudyn.mathematics.round_off import SLOW

__all__ = ["Chain", "ModalResponse", "is_slow", "lightly_coupled", "slow_powers"]

DIAGONAL = 1e-13  # of sqrt(D_ii D_jj): off-diagonal damping below it is round-off of a diagonal matrix
NEARLY_CRITICAL = 1e-2  # |zeta^2 - 1|^(1/2) below which the Taylor polynomial of degree 5 is more accurate
LIGHTLY_COUPLED, COUPLED = -1, -2  # in place of a number of modes
LAST_POWER = 1e-17  # of the first: powers of time below this, in the speed of slow motion, are truncated


@dataclass(frozen=True)
class Chain:
    """Components y (m,) of a motion, each driven by later ones only: y' = T y + B p, eta = ... + Re V y.

    mixing: T (m, m) upper triangular. shapes: V (r, m). pushes: B (m, r).
    """

    mixing: np.ndarray
    shapes: np.ndarray
    pushes: np.ndarray


@dataclass(frozen=True)
class ModalResponse:
    """The closed form of the module's equation.

    basis: the p exponentials. maps: A, B, P and V^T (4, p, r) complex. alone: (r,) modes with an equation of their own.
    In the motion of the other modes poles (p,) marks the exponentials of single poles; chains have the rest.
    """

    basis: Exponentials
    maps: np.ndarray
    alone: np.ndarray
    poles: np.ndarray
    chains: tuple[Chain, ...] = ()

    @property
    def shapes(self) -> np.ndarray:
        """V (r, p)."""
        return self.maps[3].T

    @property
    def from_displacement(self) -> np.ndarray:
        """A (p, r)."""
        return self.maps[0]

    @property
    def from_velocity(self) -> np.ndarray:
        """B (p, r)."""
        return self.maps[1]

    @property
    def from_force(self) -> np.ndarray:
        """P (p, r)."""
        return self.maps[2]

    def coefficients(
        self, displacement: np.ndarray, velocity: np.ndarray, force: np.ndarray | None = None
    ) -> np.ndarray:
        """Return c (p,) of the motion that starts at eta(0), eta'(0), both (r,)."""
        c: np.ndarray = (self._from_state @ np.concatenate([displacement, velocity])).view(complex)
        return c if force is None else c + self.from_force @ force

    def sizes(self, displacement: np.ndarray, velocity: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Return the sums of |terms| (p,) of the coefficients, from the sizes (r,) of eta(0), eta'(0) and p."""
        maps = np.abs(self.from_displacement), np.abs(self.from_velocity), np.abs(self.from_force)
        return np.asarray(maps[0] @ displacement + maps[1] @ velocity + maps[2] @ force)

    def state(self, coefficients: np.ndarray, t: float) -> tuple[np.ndarray, np.ndarray]:
        """Return eta(t), eta'(t), both (r,)."""
        r, values = len(self.shapes), self.basis.at(t)
        if not self.basis.pure:
            rate = self.basis.derivative(coefficients)
            return (self.shapes @ (coefficients * values)).real, (self.shapes @ (rate * values)).real
        both = self._to_state @ (coefficients * values).view(float)
        return both[:r], both[r:]

    @functools.cached_property
    def _from_state(self) -> np.ndarray:
        """[A, B] on real and imaginary parts, (2p, 2r): one real product instead of two complex ones."""
        both = np.hstack([self.from_displacement, self.from_velocity])
        return np.stack([both.real, both.imag], axis=1).reshape(2 * both.shape[0], both.shape[1])

    @functools.cached_property
    def _to_state(self) -> np.ndarray:
        """(eta, eta') from real and imaginary parts of c phi, (2r, 2p), for zero powers."""
        both = np.vstack([self.shapes, self.shapes * self.basis.rates])
        return np.stack([both.real, -both.imag], axis=2).reshape(both.shape[0], 2 * both.shape[1])


def is_slow(rates: np.ndarray | complex, duration: float) -> np.ndarray:
    """Return which rates [1/s] are slow for motions of at most ``duration`` [s]; only zero for an infinite duration."""
    return np.asarray(np.abs(rates) <= SLOW / duration)


def slow_powers(rate: complex, duration: float) -> list[complex]:
    """Return w_n = rate^n / (n + 2)!, n = 0, 1, ...; exp(rate t) integrated twice is t^2 sum_n w_n t^n."""
    weights, size = [0.5 + 0j], abs(rate) * duration
    speed = size / 2  # of the next power, in units of the first
    while speed > LAST_POWER:
        weights.append(weights[-1] * rate / (len(weights) + 2))
        speed *= size / (len(weights) + 1)
    return weights


def lightly_coupled(squares: np.ndarray, damping: np.ndarray, duration: float = math.inf) -> ModalResponse | None:
    """Return the closed form of modes that damping does not couple, or lightly (light_damping.py); None for others.

    squares: omega^2 (r,) [rad2/s2], negative for growing modes. damping: D (r, r) [1/s]. duration: of the longest
    motion [s].
    """
    r, powers = len(squares), np.zeros(len(squares), int)
    numbers = np.zeros((2 + r) * r + pair_numbers(r))
    numbers[:r], numbers[r : 2 * r], numbers[2 * r : (2 + r) * r] = squares, damping.diagonal(), damping.ravel()
    waves = np.zeros((1 + 4 * r, r), complex)
    rates, maps = waves[0], waves[1:].reshape(4, r, r)
    outcome = write_closed_form(numbers, waves.ravel(), r)
    if outcome == COUPLED:
        return None
    if outcome == LIGHTLY_COUPLED:
        return ModalResponse(Exponentials(rates, powers), maps, flags(r, False), flags(r, True))
    if outcome < r:
        oscillates = numbers[(2 + r) * r :][:r] == 1.0
        rates, powers, maps = _with_other_modes(squares, numbers[r : 2 * r], rates, maps, oscillates, duration)
    basis, poles = Exponentials(rates, powers), flags(len(rates), False)
    return ModalResponse(basis, maps, flags(r, True), poles)


@compiled
def closed_form(numbers: Numbers, waves: Waves, r: int) -> int:
    """Write rates and maps of the modes that oscillate, if D is diagonal, and return how many do.

    Or write those of all modes, and return LIGHTLY_COUPLED; or return COUPLED, for modes that damping couples more.
    numbers: omega^2, D_ii (r,), D (r, r), and memory of ``pair_numbers``, zero before. waves: rates (r,) and maps
    (4, r, r), zero before.
    """
    if is_diagonal(numbers, 2 * r, r) == 1:
        return oscillations(numbers, waves, (2 + r) * r, r)
    return LIGHTLY_COUPLED if iterate_pairs(numbers, waves, r) == 1 else COUPLED


write_closed_form = entry(closed_form)


def _with_other_modes(
    squares: np.ndarray,
    damping: np.ndarray,
    rates: np.ndarray,
    maps: np.ndarray,
    oscillates: np.ndarray,
    duration: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return rates, powers and maps of uncoupled modes, of which those with flags (r,) oscillate and are in ``maps``.

    damping: D_ii (r,).
    """
    r, further = len(squares), list[Term]()
    for k in np.flatnonzero(~oscillates).tolist():
        further += _mode_terms(k, float(squares[k]), float(damping[k]) / 2, duration)
    count = int(np.count_nonzero(oscillates))
    maps = np.concatenate([maps[:, oscillates], np.zeros((4, len(further), r))], axis=1)
    for at, (k, _, _, weights) in enumerate(further, start=count):
        maps[:, at, k] = *weights, 1.0
    rates = np.concatenate([rates[oscillates], [rate for _, rate, _, _ in further]])
    return rates, np.array([0] * count + [power for _, _, power, _ in further], int), maps


@compiled
def is_diagonal(damping: Numbers, start: int, r: int) -> int:
    """Return 1 where the off-diagonal elements of damping (r, r), from ``start`` on, are round-off, else 0."""
    largest = 0.0
    for i in range(r):
        largest = max(largest, abs(damping[start + i * (r + 1)]))
    for i in range(r):
        for j in range(r):
            product = damping[start + i * (r + 1)] * damping[start + j * (r + 1)]
            scale = max(math.sqrt(abs(product)), largest * DIAGONAL)
            if i != j and not abs(damping[start + i * r + j]) <= DIAGONAL * scale:
                return 0
    return 1


@compiled
def oscillations(numbers: Numbers, waves: Waves, marks: int, r: int) -> int:
    """Write rates and maps of the modes that oscillate, each in its place, and mark them; return how many do.

    numbers: omega^2, D_ii and, further on, marks (r,), zero before. waves: rates (r,) and maps (4, r, r), zero before.
    """
    count = 0
    for k in range(r):
        delta, omega = 0.5 * numbers[r + k], math.sqrt(abs(numbers[k]))
        difference = (delta - omega) * (delta + omega)
        root = math.sqrt(abs(difference))
        if numbers[k] > 0.0 and difference < 0.0 and root > NEARLY_CRITICAL * omega:
            place, size = r + k * (r + 1), r * r
            waves[k] = complex(-delta, root)
            waves[place] = complex(1.0, -delta / root)
            waves[place + size] = complex(0.0, -1.0 / root)
            waves[place + 3 * size] = 1.0 + 0j
            numbers[marks + k] = 1.0
            count += 1
    return count


@functools.lru_cache(maxsize=64)
def flags(count: int, value: bool) -> np.ndarray:
    """Return ``count`` equal flags, the same array each time."""
    return np.full(count, value)


Term = tuple[int, complex, int, tuple[complex, complex, complex]]  # mode, rate, power, weights of eta, eta', p


def _mode_terms(k: int, square: float, delta: float, duration: float) -> list[Term]:
    """Return the terms of one mode that does not oscillate: eta'' + 2 delta eta' + omega^2 eta = p."""
    if square == 0.0:
        return _free_terms(k, delta, duration)
    if square < 0:
        return _growing_terms(k, square, delta)
    omega = math.sqrt(square)
    difference = (delta - omega) * (delta + omega)
    root = math.sqrt(abs(difference))
    if root <= NEARLY_CRITICAL * omega:
        s = difference  # cosh, sinh(s t)/s of small s t, to t^5
        even, odd = (1.0, 0.0, s / 2, 0.0, s * s / 24, 0.0), (0.0, 1.0, 0.0, s / 6, 0.0, s * s / 120)
        return [(k, -delta, d, (e + delta * o, o, 0.0)) for d, (e, o) in enumerate(zip(even, odd, strict=True))]
    fast = -(delta + root)
    slow = square / fast
    return [
        (k, slow, 0, (-fast / (slow - fast), 1 / (slow - fast), 0.0)),
        (k, fast, 0, (slow / (slow - fast), -1 / (slow - fast), 0.0)),
    ]


def _growing_terms(k: int, square: float, delta: float) -> list[Term]:
    """Return the terms of omega^2 < 0, delta >= 0: a growing and a decaying rate, the smaller from their product."""
    decaying = -(delta + math.sqrt(delta * delta - square))
    growing = square / decaying
    difference = growing - decaying
    return [
        (k, growing, 0, (-decaying / difference, 1 / difference, 0.0)),
        (k, decaying, 0, (growing / difference, -1 / difference, 0.0)),
    ]


def _free_terms(k: int, delta: float, duration: float) -> list[Term]:
    """Return the terms of eta'' + 2 delta eta' = p; slow ones are p - 2 delta eta'(0) with decay, integrated twice."""
    rate, first = 2 * delta, [(k, 0.0, 0, (1.0, 0.0, 0.0)), (k, 0.0, 1, (0.0, 1.0, 0.0))]
    if delta == 0.0:
        return [*first, (k, 0.0, 2, (0.0, 0.0, 0.5))]
    if is_slow(rate, duration):
        further = enumerate(slow_powers(-rate, duration), start=2)
        return [*first, *((k, 0.0, n, (0.0, -rate * weight, weight)) for n, weight in further)]
    return [
        (k, 0.0, 0, (1.0, 1 / rate, -1 / (rate * rate))),
        (k, 0.0, 1, (0.0, 0.0, 1 / rate)),
        (k, -rate, 0, (0.0, -1 / rate, 1 / (rate * rate))),
    ]
