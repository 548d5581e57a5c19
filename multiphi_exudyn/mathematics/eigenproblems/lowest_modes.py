"""The lowest modes of sparse matrices, and a small space beside them that holds what happens at a few rows.

    x = V eta + sum_j W_j zeta_j,   W_0 = A^-1 R^T,   W_j = A^-1 M W_j-1,   A = K + s M

V are exact modes, by shift-invert Lanczos. The block Krylov vectors W_j of the rows R hold how the structure answers
forces there, at rest (j = 0) and in motion: a level with those rows held moves, at omega^2, as sum_j omega^2j W_j f
beside V. They are taken orthogonal to V in M and in K, so that the frequencies of V stay as accurate as Lanczos gives
them, and as many blocks as the modes of sample levels need: with omega^2 and x those of a level in this space, and f
the forces on its rows,

    r = omega^2 M x + R^T f - K x,   error of omega^2 = r.A^-1 r

is what the space leaves out, to first order.
Source: P. Koutsovasilis, M. Beitelschmidt, Comparison of model reduction techniques for large mechanical systems,
Multibody Syst. Dyn. 20 (2008) 111; the error of a Ritz value: B. N. Parlett, The Symmetric Eigenvalue Problem, ch. 11.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg
import scipy.sparse
import scipy.sparse.linalg

from multiphi_exudyn.errors import MultiPhiValueError, NumericalFailure
from multiphi_exudyn.mathematics.eigenproblems.inner_products import Vectors, orthonormal_beside, ritz
from multiphi_exudyn.mathematics.eigenproblems.lanczos import check_mass, definite_factor, iterated, lanczos
from multiphi_exudyn.mathematics.eigenproblems.modes import (
    FIRST_SHIFT,
    NEAR,
    Modes,
    classified,
    largest_ratio,
    round_off_energy,
)

__all__ = ["ACCURATE", "HeldRows", "LowestModes", "lowest_modes", "missing_flexibility"]

ACCURATE = 1e-9  # error of omega^2 of sample levels, up to which Krylov vectors are added
DEEPEST = 8  # blocks of Krylov vectors at most
CHECKED = 4  # highest modes of a sample level that are looked at: they have the largest errors
ROUGH, FEW = 1e-7, 10  # error of omega^2, and vectors at a time, where it is only asked whether a mode was missed
CLEAR = 1e-2  # of omega^2: a mode so far above the last is another one, and what came out holds little of a missed one
BAR_DELAY = 2.0  # s before a progress bar appears


@dataclass(frozen=True)
class HeldRows:
    """A sample level: rows by their positions, each with its stiffness [N/m], inf where it is held rigidly.

    modes: of the level whose omega^2 are to be accurate.
    """

    rows: Sequence[int]
    stiffness: np.ndarray
    modes: int


@dataclass(frozen=True)
class LowestModes:
    """A space of modes. exact: how many of them, the lowest, are modes of the structure. error: of omega^2 of samples.

    The others are the space's own, and hold static shapes and Krylov vectors.
    """

    modes: Modes
    exact: int
    error: float


def lowest_modes(
    mass: Any,
    stiffness: Any,
    count: int,
    rows: np.ndarray,
    samples: Sequence[HeldRows] = (),
    known: Modes | None = None,
    least: int = 1,
) -> LowestModes:
    """The ``count`` lowest modes and the Krylov vectors of ``rows`` (k, n), for sparse matrices.

    One block of Krylov vectors, the static shapes, then as many as ``samples`` need. Where ``count`` would part modes
    of one frequency there are fewer, but at least ``least``. known: the lowest modes, which are not computed again.

    The stiffness is factorised once (s = 0); for a structure with rigid-body modes three times: it is singular,
    then s is small, then the first elastic omega^2. A mass that is not diagonal is factorised for its definiteness.

    Raises MultiPhiValueError for an indefinite mass or stiffness, NumericalFailure if Lanczos does not converge.
    """
    from tqdm import tqdm

    mass, stiffness = scipy.sparse.csc_array(mass), scipy.sparse.csc_array(stiffness)
    with tqdm(desc="modes", unit="solve", disable=None, leave=False, delay=BAR_DELAY) as bar:
        found = _Lowest(mass, stiffness, least, bar)
        found.look_for(count, known)
        modes, error = found.completed(rows, samples)
    return LowestModes(modes, len(found.values), error)


def missing_flexibility(mass: Any, stiffness: Any, modes: Modes, rows: np.ndarray) -> np.ndarray:
    """Share (k,) of the static flexibility h.K^-1 h, or h.A^-1 h, of rows (k, n) that modes do not hold."""
    mass, stiffness = scipy.sparse.csc_array(mass), scipy.sparse.csc_array(stiffness)
    shift = float(modes.omega[modes.rigid]) ** 2 if modes.rigid else 0.0
    factor = definite_factor(scipy.sparse.csc_array(stiffness + shift * mass))
    if factor is None:
        raise NumericalFailure("static response: K is singular to round-off")
    whole = np.einsum("ij,ji->i", rows, factor.solve(np.ascontiguousarray(rows.T)))
    held = np.sum((rows @ modes.shapes) ** 2 / (modes.omega**2 + shift), axis=1)
    return np.asarray(np.maximum(whole - held, 0.0) / np.where(whole > 0, whole, 1.0))


class _Lowest:
    """The lowest modes under way. values, vectors: omega^2 and shapes of those found. shift: s; factor: of A."""

    def __init__(self, mass: Any, stiffness: Any, least: int, bar: Any) -> None:
        check_mass(mass)
        self.mass, self.stiffness, self._least, self._bar = mass, stiffness, least, bar
        self.values, self.vectors = np.zeros(0), np.zeros((mass.shape[0], 0))
        self.shift, self._factor = 0.0, definite_factor(stiffness)

    def solve(self, given: np.ndarray) -> np.ndarray:
        """A^-1 of vectors (n,) or (n, k)."""
        assert self._factor is not None, "look_for has looked"
        self._bar.update(1 if given.ndim == 1 else given.shape[1])
        return np.asarray(self._factor.solve(np.ascontiguousarray(given)))

    def look_for(self, count: int, known: Modes | None) -> None:
        """Find so many modes; what is ``known`` of them is taken."""
        if known is not None:
            self.values, self.vectors = known.omega**2, known.shapes
            if known.rigid:
                self._move(float(known.omega[known.rigid]) ** 2)
            self._find(count)
            return
        if self._factor is not None:
            self._find(count)
        if self._factor is None or np.any(self.values <= round_off_energy(self.stiffness, self.vectors)):
            self._find_with_rigid_ones(count)

    def _find_with_rigid_ones(self, count: int) -> None:
        self._move(FIRST_SHIFT * largest_ratio(self.mass, self.stiffness))
        self._find_anew(count)
        elastic = self.values > round_off_energy(self.stiffness, self.vectors)
        if np.any(elastic):
            self._move(float(np.min(self.values[elastic])))
            self._find_anew(count)

    def _find_anew(self, count: int) -> None:
        self.values, self.vectors = np.zeros(0), np.zeros((self.mass.shape[0], 0))
        self._find(count)

    def _move(self, shift: float) -> None:
        self.shift = shift
        self._factor = definite_factor(scipy.sparse.csc_array(self.stiffness + shift * self.mass))
        if self._factor is None:
            raise MultiPhiValueError(
                f"stiffness: indefinite, lowest eigenvalue omega^2 below {-shift:g}; need a positive semidefinite "
                "matrix"
            )

    def _find(self, count: int) -> None:
        """Further modes up to ``count``; twice as many where a cluster at their end leaves fewer than ``least``."""
        further = count - len(self.values)
        while further > 0:
            self._add(further)
            while self._add_missed():
                pass
            most = self.mass.shape[0] - 2 - len(self.values)
            further = min(2 * further, most) if len(self.values) < self._least and further < most else 0

    def _add(self, further: int) -> None:
        """So many more, by the compliance without those that are there."""
        values, vectors = lanczos(self.mass, self.stiffness, further, self.shift, self._beyond, self._start())
        self._take(values, vectors)

    def _start(self) -> np.ndarray:
        """Where an iteration for modes beside those that are there starts (n,): at random, and anew for each number.

        All that the start of an earlier iteration holds of modes of one frequency is there, so only another one sees
        the others. A start with a symmetry would not see all modes.
        """
        return np.random.default_rng(len(self.values)).uniform(-1, 1, self.mass.shape[0])

    def _add_missed(self) -> bool:
        """Whether there was one more below the last: of modes of one frequency an iteration may see a part alone.

        No step of an iteration lessens the share of the lowest mode that is left, and in a result that is clearly above
        the last it is at most ROUGH / CLEAR. So it is missed only by a start that holds of it less than 1e-5 of what it
        holds of the result.
        """
        if not len(self.values) or len(self.values) >= self.mass.shape[0] - 1:
            return False
        given = self.mass, self.stiffness, 1, self.shift, self._beyond, self._start()
        last = self.values[-1] + self.shift
        value, _ = iterated(*given, tolerance=ROUGH, vectors=FEW)
        if value[0] + self.shift > (1 + CLEAR) * last:
            return False
        value, vector = iterated(*given)
        missed = bool(value[0] + self.shift <= (1 + NEAR) * last)
        if missed:
            self._take(value, vector)
            order = np.argsort(self.values, kind="stable")
            self.values, self.vectors = self.values[order], self.vectors[:, order]
        return missed

    def _beyond(self, x: np.ndarray) -> np.ndarray:
        """A^-1 of a vector (n,) without the modes that are there."""
        known = self.vectors
        return np.asarray(self.solve(x) - known @ ((known.T @ x) / (self.values + self.shift)))

    def _take(self, values: np.ndarray, vectors: np.ndarray) -> None:
        """Modes beside those that are there."""
        known = self.vectors
        vectors = vectors - known @ (known.T @ (self.mass @ vectors))
        self.values, self.vectors = np.concatenate([self.values, values]), np.hstack([known, vectors])

    def completed(self, rows: np.ndarray, samples: Sequence[HeldRows]) -> tuple[Modes, float]:
        """The modes with the Krylov vectors of ``rows``, and the largest error of omega^2 of the samples."""
        added, shapes, error = np.zeros(0), np.zeros((len(self.vectors), 0)), 0.0
        for vectors in self._krylov(rows):
            added, rotation = ritz(self.mass, vectors[0])
            shapes = vectors[0] @ rotation
            error = max((self._error(added, rotation, vectors, rows, sample) for sample in samples), default=0.0)
            if error <= ACCURATE:
                break
        upper = scipy.linalg.cholesky(shapes.T @ (self.mass @ shapes))  # once more: orthonormal to round-off
        shapes = np.hstack([self.vectors, scipy.linalg.solve_triangular(upper, shapes.T, trans="T").T])
        squares = np.concatenate([self.values, added - self.shift])
        return classified(self.stiffness, squares, shapes, self.shift), error

    def _krylov(self, rows: np.ndarray) -> Iterator[Vectors]:
        """A-orthonormal bases of one, two and more blocks of Krylov vectors, until nothing is added."""
        forces = rows[np.any(rows, axis=1)].T
        if not forces.size:
            return
        sizes = np.sqrt(np.einsum("ij,ij->j", forces, self.solve(forces)))  # each row's own flexibility becomes 1
        block = self._beside(forces / sizes)
        vectors = np.zeros((len(forces), 0)), np.zeros((len(forces), 0))
        for _ in range(DEEPEST):
            block = orthonormal_beside(block, vectors)
            if not block[0].shape[1]:
                return
            vectors = np.hstack([vectors[0], block[0]]), np.hstack([vectors[1], block[1]])
            yield vectors
            shapes, forces = self._beside(self.mass @ block[0])
            sizes = np.sqrt(np.einsum("ij,ij->j", shapes, forces))
            block = shapes / sizes, forces / sizes

    def _beside(self, forces: np.ndarray) -> Vectors:
        """What V leaves of A^-1 F, orthogonal to V in M and in K, and of F."""
        shapes, taken = self.solve(forces), self.vectors.T @ forces
        shapes -= self.vectors @ (taken / (self.values + self.shift)[:, None])
        shapes -= self.vectors @ (self.vectors.T @ (self.mass @ shapes))
        return shapes, forces - self.mass @ (self.vectors @ taken)

    def _error(
        self, added: np.ndarray, rotation: np.ndarray, vectors: Vectors, rows: np.ndarray, sample: HeldRows
    ) -> float:
        """Largest relative error of omega^2 among the highest modes of a sample level.

        added, rotation: eigenvalues of A (k,) in the space of ``vectors``, and what makes its modes of them (k, k).
        """
        held, (own, pushed), values = rows[list(sample.rows)], vectors, self.values + self.shift
        directions = np.hstack([held @ self.vectors, (held @ own) @ rotation])
        squares, y, forces = _sample_modes(np.concatenate([self.values, added - self.shift]), directions, sample)
        first, beside = y[: len(values)], rotation @ y[len(values) :]
        left = (squares + self.shift) * (self.mass @ (self.vectors @ first + own @ beside)) + held.T @ forces
        left -= self.mass @ (self.vectors @ (values[:, None] * first)) + pushed @ beside
        known = self.vectors.T @ left, rotation.T @ (own.T @ left)  # round-off of the small problem
        energy = np.einsum("ij,ij->j", left, self.solve(left))
        energy -= sum(
            np.sum(part**2 / given[:, None], axis=0) for part, given in zip(known, (values, added), strict=True)
        )
        return float(np.max(np.abs(energy) / np.maximum(np.abs(squares), self.shift), initial=0.0))


def _sample_modes(
    squares: np.ndarray, directions: np.ndarray, sample: HeldRows
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """omega^2 (k,), modes (m, k) and forces on its rows (l, k) of the highest modes of a sample level.

    squares: (m,) of the space. directions: (l, m), the rows in it.
    """
    rigid = np.isinf(sample.stiffness)
    stiffness = np.where(rigid, 0.0, sample.stiffness)
    units = directions[rigid] / np.linalg.norm(directions[rigid], axis=1, keepdims=True)
    free = scipy.linalg.null_space(units) if np.any(rigid) else np.eye(len(squares))
    springs = np.sqrt(stiffness)[:, None] * directions
    whole = np.diag(squares) + springs.T @ springs
    last = min(sample.modes, free.shape[1])
    wanted = [max(last - CHECKED, 0), last - 1]
    found, y = scipy.linalg.eigh(free.T @ whole @ free, subset_by_index=wanted)
    y = free @ y
    forces = -stiffness[:, None] * (directions @ y)
    forces[rigid] = np.linalg.lstsq(directions[rigid].T, whole @ y - found * y, rcond=None)[0]
    return found, y, forces
