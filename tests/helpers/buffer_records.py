"""Buffers filled from the objects whose meaning the functions on them share, to compare the two."""

import functools
from typing import NamedTuple
from unittest import mock

import numpy as np

from multiphi_exudyn.errors import NumericalFailure
from multiphi_exudyn.mathematics.compiling import compiled
from multiphi_exudyn.mathematics.complementarity import free_rows, principal_pivoting
from multiphi_exudyn.mathematics.complementarity.least_distance import Infeasible
from multiphi_exudyn.mathematics.response import basis_arrays, forced_arrays, response_arrays
from multiphi_exudyn.mathematics.search import signal_bounds, zero_crossing


class Signals(NamedTuple):
    """constants (s,) + Re coefficients (s, p) . phi(t), and how much of each is round-off (s,), None for none."""

    coefficients: np.ndarray
    constants: np.ndarray
    noise: np.ndarray | None = None


class Descent(NamedTuple):
    """When a signal falls, and which."""

    time: float
    signal: int


def as_they_are(function):
    """A function run as plain Python."""
    return function


fast = functools.cache(compiled.entry)  # a function compiled, once in a process


class Buffers:
    """Three growing buffers; every ``put`` says where its values begin."""

    def __init__(self):
        self.ints, self.numbers, self.waves = np.zeros(0, np.int64), np.zeros(0), np.zeros(0, complex)

    @property
    def all(self):
        return self.ints, self.numbers, self.waves

    def put_ints(self, values):
        self.ints, at = np.concatenate([self.ints, np.asarray(values, np.int64).ravel()]), len(self.ints)
        return at

    def put_numbers(self, values):
        self.numbers, at = np.concatenate([self.numbers, np.asarray(values, float).ravel()]), len(self.numbers)
        return at

    def put_waves(self, values):
        self.waves, at = np.concatenate([self.waves, np.asarray(values, complex).ravel()]), len(self.waves)
        return at

    def put_basis(self, basis):
        powers, rates = self.put_ints(basis.powers), self.put_waves(basis.rates)
        scales = self.put_numbers([basis.unit, 0.0, 0.0])
        record = self.put_ints([len(basis.rates), powers, rates, scales, -1, -1])
        basis_arrays.describe_basis(*self.all, record)
        return record

    def put_response(self, response, squares, damping):
        """``modal_response(squares, damping)``."""
        r = len(response.shapes)
        maps = (response.from_displacement, response.from_velocity, response.from_force, response.shapes.T)
        basis, reached = self.put_basis(response.basis), self.put_ints(response_arrays.reached_modes(maps))
        places = [self.put_waves(values) for values in maps]
        places += [self.put_numbers(squares), self.put_numbers(np.diagonal(damping) / 2)]
        chains = [len(response.chains)]
        for chain in response.chains:
            parts = chain.mixing, chain.shapes.T, chain.pushes
            chains += [len(chain.mixing), *(self.put_waves(part) for part in parts)]
        places += [self.put_ints(response.alone), self.put_ints(response.poles), self.put_ints(chains)]
        return self.put_ints([r, basis, reached, *places])


class Search:
    """The certified search for the signals of one basis; run: ``fast``, or as they are.

    refine: factor on the density of the samples, of plain Python.
    """

    def __init__(self, basis, signals, run=fast, refine=1.0):
        self._run, self._refine = run if refine == 1.0 else as_they_are, refine
        self.count, self.p = signals.coefficients.shape
        self.buffers = Buffers()
        noise = np.zeros(self.count) if signals.noise is None else signals.noise
        self.basis = self.buffers.put_basis(basis)
        self.signals = self.buffers.put_waves(signals.coefficients)
        self.constants, self.noise = self.buffers.put_numbers(signals.constants), self.buffers.put_numbers(noise)
        self.result = self.buffers.put_numbers(np.zeros(zero_crossing.RESULT))
        self.scratch = self.buffers.put_numbers(np.full(zero_crossing.scratch_numbers(self.p, self.count), np.nan))
        self.scratch_wave = self.buffers.put_waves(np.full(zero_crossing.scratch_waves(self.p, self.count), np.nan))
        self.flags = self.buffers.put_ints(np.full(self.count, -1))

    def first(self, horizon, start=0.0):
        """The signal that falls first, or what is in its stead, and when."""
        resolution = signal_bounds.RESOLUTION / self._refine**4
        with np.errstate(all="ignore"), mock.patch.object(signal_bounds, "RESOLUTION", resolution):
            found = self._run(zero_crossing.first_descent)(
                *self.buffers.all, self.basis, self.signals, self.constants, self.noise, self.count, start, horizon,
                self.scratch, self.scratch_wave, self.result,
            )  # fmt: skip
        return found, float(self.buffers.numbers[self.result])

    @property
    def samples(self):
        return self.buffers.numbers[self.result + 1]

    def descent(self, horizon, start=0.0):
        """The first descent, None if there is none."""
        found, time = self.first(horizon, start)
        assert found >= zero_crossing.NONE
        return None if found == zero_crossing.NONE else Descent(time, found)

    def simultaneous(self, found):
        total = self._run(zero_crossing.simultaneous)(
            *self.buffers.all, self.basis, self.signals, self.constants, self.count, found.signal, found.time,
            self.scratch_wave, self.flags,
        )  # fmt: skip
        flags = self.buffers.ints[self.flags : self.flags + self.count]
        assert total == np.sum(flags)
        return np.flatnonzero(flags).tolist()

    def signs(self, sizes, since=0):
        return [self._sign(s, self.buffers.put_numbers(sizes[s]), since) for s in range(self.count)]

    def _sign(self, s, sizes, since):
        constant = float(self.buffers.numbers[self.constants + s])
        return self._run(zero_crossing.first_sign)(
            *self.buffers.all, self.basis, self.signals + s * self.p, constant, abs(constant), sizes, since,
            self.scratch, self.scratch_wave,
        )  # fmt: skip


def complementary(rows, pushes, values, sizes, low, high, leaders=None, ties=None, in_turn=0, run=fast):
    """(x, z, answer, rows that exclude each other) of principal_pivoting.py; pushes None: the rows themselves."""
    (k, r), buffers = rows.shape, Buffers()
    given = [buffers.put_numbers(rows)]
    given.append(given[0] if pushes is None else buffers.put_numbers(pushes))
    given += [buffers.put_numbers(each) for each in (values, sizes, low, high)]
    led = buffers.put_ints(np.full(k, -1) if leaders is None else leaders)
    tied = buffers.put_numbers(np.zeros(k) if ties is None else ties)
    x, z = buffers.put_numbers(np.zeros(r)), buffers.put_numbers(np.zeros(k))
    scratch = buffers.put_numbers(np.full(principal_pivoting.problem_numbers(k, r), np.nan))
    problem = buffers.put_ints(np.full(principal_pivoting.problem_ints(k), -1))
    principal_pivoting.lay_out(buffers.ints, problem, k, r, scratch)
    principal_pivoting.pose(buffers.ints, problem, k, r, r, *given, led, tied, x, z)
    answer = run(principal_pivoting.solve)(*buffers.all[:2], problem, in_turn)
    listed = buffers.ints[problem + free_rows.EXCLUDED_ROWS]
    excluded = buffers.ints[listed:][: buffers.ints[problem + free_rows.EXCLUDING]].tolist()
    return buffers.numbers[x : x + r].copy(), buffers.numbers[z : z + k].copy(), answer, excluded


def distance_in_buffers(rows, least, sizes, run=fast):
    """``least_distance`` in buffers, with its failures."""
    zero = np.zeros(len(least))
    x, p, answer, excluded = complementary(rows, None, -least, sizes, zero, zero + np.inf, run=run)
    if answer == principal_pivoting.EXCLUDED:
        raise Infeasible(excluded)
    if answer == principal_pivoting.UNDECIDED:
        raise NumericalFailure("least distance: round-off decides which inequalities push")
    return x, p


def in_buffers(response, squares, damping, rate, forces, horizon):
    """``particular`` by the functions of the loop: x (K + 1, r)."""
    buffers, (degree, r), most = Buffers(), (len(forces) - 1, len(squares)), 200
    record = buffers.put_response(response, squares, damping)
    carrier, given = buffers.put_waves([rate]), buffers.put_waves(forces)
    scratch, result = buffers.put_waves(np.zeros(8 * most)), buffers.put_waves(np.zeros(most * r))
    still = buffers.put_numbers(np.zeros(len(squares)))
    rows = forced_arrays.forced_response(
        *buffers.all, record, carrier, given, degree, horizon, still, still, most, scratch, result
    )
    return buffers.waves[result : result + rows * r].reshape(rows, r)
