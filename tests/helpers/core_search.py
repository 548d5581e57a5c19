"""The search of the core, with the sums of exponentials it searches, and random cases of them."""

from typing import NamedTuple

import numpy as np

from multiphi_exudyn import _core

KINDS = ("oscillating", "decaying", "growing", "overdamped", "polynomial", "loaded")


class Basis(NamedTuple):
    """phi_j(t) = (t / unit)^d_j exp(lambda_j t): rates lambda (p,), powers d (p,)."""

    rates: np.ndarray
    powers: np.ndarray
    unit: float = 1.0

    @property
    def pure(self):
        """Whether every power is zero."""
        return not np.any(self.powers)

    def at(self, t):
        """phi at t: (p,) for a scalar, (k, p) for (k,) times."""
        times = np.asarray(t, float)[..., None]
        return np.exp(times * self.rates) * (times / self.unit) ** self.powers

    def derivative(self, coefficients):
        """Coefficients (s, p) of the time derivative."""
        result, chained = coefficients * self.rates, np.flatnonzero(self.powers)
        result[..., chained - 1] += self.powers[chained] / self.unit * coefficients[..., chained]
        return result


class Signals(NamedTuple):
    """constants (s,) + Re coefficients (s, p) . phi(t), and how much of each is round-off (s,), None for none."""

    coefficients: np.ndarray
    constants: np.ndarray
    noise: np.ndarray | None = None


class Descent(NamedTuple):
    """When a signal falls, and which."""

    time: float
    signal: int


class Search:
    """The certified search for the signals of one basis; refine: factor on the density of the samples."""

    def __init__(self, basis, signals, refine=1.0):
        noise = np.zeros(len(signals.constants)) if signals.noise is None else signals.noise
        coefficients = np.ascontiguousarray(signals.coefficients, complex)
        self._core = _core.Search(
            [int(d) for d in basis.powers], [complex(rate) for rate in basis.rates], basis.unit, coefficients,
            signals.constants.tolist(), noise.tolist(), refine,
        )  # fmt: skip

    def first(self, horizon, start=0.0):
        """Outcome, signal, time, and if it is too long sample distance and remaining time."""
        return self._core.first(start, horizon)

    @property
    def samples(self):
        return self._core.evaluations

    def descent(self, horizon, start=0.0):
        """The first descent, None if there is none."""
        outcome, signal, time, *_ = self.first(horizon, start)
        assert outcome in (_core.SearchOutcome.none, _core.SearchOutcome.found)
        return None if outcome == _core.SearchOutcome.none else Descent(time, signal)

    def simultaneous(self, found):
        return self._core.simultaneous(found.signal, found.time)

    def signs(self, sizes, since=0):
        return self._core.first_signs(np.ascontiguousarray(sizes, float), since)


def random_basis(kind, random):
    """Some basis of a kind, in units of time between microseconds and weeks."""
    count = int(random.integers(1, 8))
    rates, powers, unit = 1j * random.uniform(0.3, 60, count), np.zeros(count, int), 1.0
    if kind == "decaying":
        rates = rates - random.random(count) * random.choice([0.02, 1.0, 20.0])
    elif kind == "growing":
        rates = rates + random.uniform(-1, 1, count) * random.choice([0.02, 1.0])
    elif kind == "overdamped":
        rates = -random.uniform(0.1, 60, count) + 0j
    elif kind == "polynomial":
        rates, powers, unit = np.zeros(count), np.arange(count), 10 ** random.uniform(-1, 1)
    elif kind == "loaded":
        degree, carrier = int(random.integers(1, 5)), random.choice([0, 7j, -1 + 2j])
        rates = np.concatenate([rates - random.random(count), np.full(degree, carrier), np.zeros(3)])
        powers = np.concatenate([powers, np.arange(degree), np.arange(3)])
        unit = 10 ** random.uniform(-1, 1)
    scale = 10 ** random.uniform(-6, 6)
    return Basis(np.asarray(rates / scale, complex), powers, unit * scale), scale


def random_signals(basis, start, random):
    """Some signals that are not negative at the start; of some it begins at zero, or a hair above it."""
    shape = int(random.integers(1, 6)), len(basis.rates)
    weights = random.normal(size=shape) + 1j * random.normal(size=shape)
    size, now = np.abs(weights).sum(axis=1), (weights @ basis.at(start)).real
    constants = np.maximum(size * random.uniform(-0.2, 1.0, shape[0]), -now)
    touching = random.random(shape[0]) < 0.2
    constants = np.where(touching, -now + size * random.choice([1e-14, 1e-12, 1e-9, 1e-6], shape[0]), constants)
    noise = size * random.choice([0.0, 1e-15, 1e-13, 1e-12], shape[0])
    return Signals(weights, constants, noise)


def random_case(kind, seed):
    """Basis, signals, start and horizon of a search."""
    random = np.random.default_rng([seed, *kind.encode()])
    basis, scale = random_basis(kind, random)
    horizon = scale * random.uniform(0.5, 20) * random.choice([0.01, 1.0, 10.0])
    if not basis.pure:
        horizon = min(horizon, 2 * basis.unit)  # the unit of powers is about as long as the motion
    start = float(random.choice([0.0, random.uniform(0, horizon)]))
    return basis, random_signals(basis, start, random), start, float(horizon)
