"""The lowest modes of sparse matrices, and a small space beside them for the response at a few rows.

    x = V eta + sum_j W_j zeta_j,   W_0 = A^-1 R^T,   W_j = A^-1 M W_j-1,   A = K + s M

V are exact modes, by shift-invert Lanczos. The block Krylov vectors W_j of the rows R represent the response
to forces there, static (j = 0) and dynamic: a level with those rows fixed moves, at omega^2, as sum_j omega^2j W_j f
beside V. They are made orthogonal to V in M and in K, so that the frequencies of V stay as accurate as Lanczos gives
them, and as many blocks as the modes of sample levels need: with omega^2 and x those of a level in this space, and f
the forces on its rows,

    r = omega^2 M x + R^T f - K x,   error of omega^2 = r.A^-1 r

is the error of the space, to first order.
Source: P. Koutsovasilis, M. Beitelschmidt, Comparison of model reduction techniques for large mechanical systems,
Multibody Syst. Dyn. 20 (2008) 111; the error of a Ritz value: B. N. Parlett, The Symmetric Eigenvalue Problem, ch. 11.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import scipy.linalg
import scipy.sparse
import scipy.sparse.linalg

from multiphi_exudyn.errors import NumericalFailure
from multiphi_exudyn.mathematics.massless_motions import not_definite
from multiphi_exudyn.mathematics.modes import (
    NEAR,
    ROUND_OFF,
    Modes,
    first_shift,
    indefinite,
    modes_from_squares,
    rigid_modes,
)

__all__ = [
    "ACCURATE",
    "HeldRows",
    "LowestModes",
    "Vectors",
    "check_mass",
    "definite_factor",
    "lanczos",
    "lanczos_iteration",
    "lowest_modes",
    "missing_flexibility",
    "orthonormal_complement",
    "ritz",
]

ACCURATE = 1e-9  # error of omega^2 of sample levels, up to which Krylov vectors are added
DEEPEST = 8  # blocks of Krylov vectors at most
CHECKED = 4  # highest modes of a sample level, which have the largest errors
ROUGH, FEW = 1e-7, 10  # error of omega^2, and size of the Krylov space, to check whether a mode was missed
CLEAR = 1e-2  # of omega^2: a mode so far above the last is another one, with little of a missed mode in it
BAR_DELAY = 2.0  # s before a progress bar appears
DEPENDENT = 1e-12  # of a vector's square: a smaller remainder beside others is round-off
Vectors: TypeAlias = tuple[np.ndarray, np.ndarray]  # shapes C (n, k), C^T A C = I, and A C


@dataclass(frozen=True)
class HeldRows:
    """A sample level: closed rows by their positions, each with its stiffness [N/m], inf for a rigid one.

    modes: number of modes of the level whose omega^2 have to be accurate.
    """

    rows: Sequence[int]
    stiffness: np.ndarray
    modes: int


@dataclass(frozen=True)
class LowestModes:
    """A space of modes. exact: number of the lowest ones that are modes of the structure. error: of omega^2 of samples.

    The others are Ritz modes of static shapes and Krylov vectors.
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
    known_modes: Modes | None = None,
    least: int = 1,
) -> LowestModes:
    """Return the ``count`` lowest modes and the Krylov vectors of ``rows`` (k, n), for sparse matrices.

    One block of Krylov vectors, the static shapes, then as many as ``samples`` need. Where ``count`` would part modes
    of one frequency there are fewer, but at least ``least``. known_modes: the lowest modes, which are not
    computed again.

    The stiffness is factorised once (s = 0); for a structure with rigid-body modes three times: it is singular,
    then s is small, then the first elastic omega^2. A mass that is not diagonal is factorised for its definiteness.

    Raises MultiPhiValueError for an indefinite mass or stiffness, NumericalFailure if Lanczos does not converge.
    """
    from tqdm import tqdm

    mass, stiffness = scipy.sparse.csc_array(mass), scipy.sparse.csc_array(stiffness)
    with tqdm(desc="modes", unit="solve", disable=None, leave=False, delay=BAR_DELAY) as bar:
        search = _Lowest(mass, stiffness, least, bar)
        search.find(count, known_modes)
        modes, error = search.with_krylov_vectors(rows, samples)
    return LowestModes(modes, len(search.values), error)


def missing_flexibility(mass: Any, stiffness: Any, modes: Modes, rows: np.ndarray) -> np.ndarray:
    """Return the share (k,) of the static flexibility h.K^-1 h, or h.A^-1 h, of rows (k, n) that modes lack."""
    mass, stiffness = scipy.sparse.csc_array(mass), scipy.sparse.csc_array(stiffness)
    shift = float(modes.omega[modes.rigid]) ** 2 if modes.rigid else 0.0
    factor = definite_factor(scipy.sparse.csc_array(stiffness + shift * mass))
    if factor is None:
        raise NumericalFailure("static response: K is singular to round-off")
    whole = np.einsum("ij,ji->i", rows, factor.solve(np.ascontiguousarray(rows.T)))
    represented = np.sum((rows @ modes.shapes) ** 2 / (modes.omega**2 + shift), axis=1)
    return np.asarray(np.maximum(whole - represented, 0.0) / np.where(whole > 0, whole, 1.0))


class _Lowest:
    """Search for the lowest modes. values, vectors: omega^2 and shapes of the modes found. shift: s; factor: of A."""

    def __init__(self, mass: Any, stiffness: Any, least: int, bar: Any) -> None:
        check_mass(mass)
        self.mass, self.stiffness, self._least, self._bar = mass, stiffness, least, bar
        self.values, self.vectors = np.zeros(0), np.zeros((mass.shape[0], 0))
        self.shift, self._factor = 0.0, definite_factor(stiffness)

    def solve(self, vectors: np.ndarray) -> np.ndarray:
        """Return A^-1 times vectors (n,) or (n, k)."""
        assert self._factor is not None, "find sets the factor"
        self._bar.update(1 if vectors.ndim == 1 else vectors.shape[1])
        return np.asarray(self._factor.solve(np.ascontiguousarray(vectors)))

    def find(self, count: int, known_modes: Modes | None) -> None:
        """Find so many modes, starting with ``known_modes``."""
        if known_modes is not None:
            self.values, self.vectors = known_modes.omega**2, known_modes.shapes
            if known_modes.rigid:
                self._set_shift(float(known_modes.omega[known_modes.rigid]) ** 2)
            self._find(count)
            return
        if self._factor is not None:
            self._find(count)
        if self._factor is None or np.any(rigid_modes(self.stiffness, self.values, self.vectors)):
            self._find_with_rigid_ones(count)

    def _find_with_rigid_ones(self, count: int) -> None:
        self._set_shift(first_shift(self.mass, self.stiffness))
        self._find_anew(count)
        elastic = ~rigid_modes(self.stiffness, self.values, self.vectors)
        if np.any(elastic):
            self._set_shift(float(np.min(self.values[elastic])))
            self._find_anew(count)

    def _find_anew(self, count: int) -> None:
        self.values, self.vectors = np.zeros(0), np.zeros((self.mass.shape[0], 0))
        self._find(count)

    def _set_shift(self, shift: float) -> None:
        self.shift = shift
        self._factor = definite_factor(scipy.sparse.csc_array(self.stiffness + shift * self.mass))
        if self._factor is None:
            raise indefinite(self.stiffness, f"below {-shift:g}", is_small=True)

    def _find(self, count: int) -> None:
        """Find modes up to ``count``; twice as many where a cluster at their end leaves fewer than ``least``."""
        further = count - len(self.values)
        while further > 0:
            self._add_modes(further)
            while self._add_missed():
                pass
            most = self.mass.shape[0] - 2 - len(self.values)
            further = min(2 * further, most) if len(self.values) < self._least and further < most else 0

    def _add_modes(self, further: int) -> None:
        """Find further modes, from the compliance without the modes found before."""
        values, vectors = lanczos(self.mass, self.stiffness, further, self.shift, self._solve_beside, self._start())
        self._append(values, vectors)

    def _start(self) -> np.ndarray:
        """Return a random start (n,) of an iteration, a new one for each number of modes found.

        The component of an earlier start in a space of modes of one frequency is already found, so that only another
        start finds the others. A symmetric start would miss modes.
        """
        return np.random.default_rng(len(self.values)).uniform(-1, 1, self.mass.shape[0])

    def _add_missed(self) -> bool:
        """Add a mode below the last that was missed, as in a cluster of one frequency; return whether there was one.

        No step of an iteration reduces the share of the lowest remaining mode, and in a result clearly above the last
        it is at most ROUGH / CLEAR. So it is missed only if its share in the start is less than 1e-5 of that of the
        result.
        """
        if not len(self.values) or len(self.values) >= self.mass.shape[0] - 1:
            return False
        problem = self.mass, self.stiffness, 1, self.shift, self._solve_beside, self._start()
        last = self.values[-1] + self.shift
        value, _ = lanczos_iteration(*problem, tolerance=ROUGH, vectors=FEW)
        if value[0] + self.shift > (1 + CLEAR) * last:
            return False
        value, vector = lanczos_iteration(*problem)
        missed = bool(value[0] + self.shift <= (1 + NEAR) * last)
        if missed:
            self._append(value, vector)
            order = np.argsort(self.values, kind="stable")
            self.values, self.vectors = self.values[order], self.vectors[:, order]
        return missed

    def _solve_beside(self, x: np.ndarray) -> np.ndarray:
        """Return A^-1 times a vector (n,), without the modes found."""
        found = self.vectors
        return np.asarray(self.solve(x) - found @ ((found.T @ x) / (self.values + self.shift)))

    def _append(self, values: np.ndarray, vectors: np.ndarray) -> None:
        """Append modes, made orthogonal to those found."""
        found = self.vectors
        vectors = vectors - found @ (found.T @ (self.mass @ vectors))
        self.values, self.vectors = np.concatenate([self.values, values]), np.hstack([found, vectors])

    def with_krylov_vectors(self, rows: np.ndarray, samples: Sequence[HeldRows]) -> tuple[Modes, float]:
        """Return the modes with the Krylov vectors of ``rows``, and the largest error of omega^2 of the samples."""
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
        return modes_from_squares(self.stiffness, squares, shapes, self.shift), error

    def _krylov(self, rows: np.ndarray) -> Iterator[Vectors]:
        """A-orthonormal bases of one, two and more blocks of Krylov vectors, until none is added."""
        forces = rows[np.any(rows, axis=1)].T
        if not forces.size:
            return
        responses = self.solve(forces)
        sizes = np.sqrt(np.einsum("ij,ij->j", forces, responses))  # each row's own flexibility becomes 1
        block = self._beside(responses / sizes, forces / sizes)
        vectors = np.zeros((len(forces), 0)), np.zeros((len(forces), 0))
        for _ in range(DEEPEST):
            block = orthonormal_complement(block, vectors)
            if not block[0].shape[1]:
                return
            vectors = np.hstack([vectors[0], block[0]]), np.hstack([vectors[1], block[1]])
            yield vectors
            forces = self.mass @ block[0]
            shapes, forces = self._beside(self.solve(forces), forces)
            sizes = np.sqrt(np.einsum("ij,ij->j", shapes, forces))
            block = shapes / sizes, forces / sizes

    def _beside(self, responses: np.ndarray, forces: np.ndarray) -> Vectors:
        """Return the parts of A^-1 F and of F (n, k) beside V, orthogonal to V in M and in K."""
        components = self.vectors.T @ forces
        shapes = responses - self.vectors @ (components / (self.values + self.shift)[:, None])
        shapes -= self.vectors @ (self.vectors.T @ (self.mass @ shapes))
        return shapes, forces - self.mass @ (self.vectors @ components)

    def _error(
        self, added: np.ndarray, rotation: np.ndarray, vectors: Vectors, rows: np.ndarray, sample: HeldRows
    ) -> float:
        """Return the largest relative error of omega^2 among the highest modes of a sample level.

        added, rotation: eigenvalues of A (k,) in the space of ``vectors``, and the rotation to its modes (k, k).
        """
        closed_rows, (shapes, images), values = rows[list(sample.rows)], vectors, self.values + self.shift
        directions = np.hstack([closed_rows @ self.vectors, (closed_rows @ shapes) @ rotation])
        squares, y, forces = _sample_modes(np.concatenate([self.values, added - self.shift]), directions, sample)
        exact_part, further_part = y[: len(values)], rotation @ y[len(values) :]
        residual = (squares + self.shift) * (
            self.mass @ (self.vectors @ exact_part + shapes @ further_part)
        ) + closed_rows.T @ forces
        residual -= self.mass @ (self.vectors @ (values[:, None] * exact_part)) + images @ further_part
        components = self.vectors.T @ residual, rotation.T @ (shapes.T @ residual)  # round-off of the small problem
        energy = np.einsum("ij,ij->j", residual, self.solve(residual))
        energy -= sum(
            np.sum(part**2 / given[:, None], axis=0) for part, given in zip(components, (values, added), strict=True)
        )
        return float(np.max(np.abs(energy) / np.maximum(np.abs(squares), self.shift), initial=0.0))


def _sample_modes(
    squares: np.ndarray, directions: np.ndarray, sample: HeldRows
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return omega^2 (k,), modes (m, k) and forces on its rows (l, k) of the highest modes of a sample level.

    squares: (m,) of the space. directions: (l, m), the rows in it.
    """
    rigid = np.isinf(sample.stiffness)
    stiffness = np.where(rigid, 0.0, sample.stiffness)
    units = directions[rigid] / np.linalg.norm(directions[rigid], axis=1, keepdims=True)
    free = scipy.linalg.null_space(units) if np.any(rigid) else np.eye(len(squares))
    springs = np.sqrt(stiffness)[:, None] * directions
    total = np.diag(squares) + springs.T @ springs
    last = min(sample.modes, free.shape[1])
    indices = [max(last - CHECKED, 0), last - 1]
    highest, y = scipy.linalg.eigh(free.T @ total @ free, subset_by_index=indices)
    y = free @ y
    forces = -stiffness[:, None] * (directions @ y)
    forces[rigid] = np.linalg.lstsq(directions[rigid].T, total @ y - highest * y, rcond=None)[0]
    return highest, y, forces


def orthonormal_complement(block: Vectors, others: Vectors) -> Vectors:
    """Return A-orthonormal vectors of the space of a block, orthogonal to others; dependent ones are dropped."""
    shapes, images = block
    for _ in range(2):
        components = others[1].T @ shapes
        shapes, images = shapes - others[0] @ components, images - others[1] @ components
    for _ in range(2):  # once more: orthonormal to round-off
        products = shapes.T @ images
        squares, rotation = scipy.linalg.eigh((products + products.T) / 2)
        rotation = rotation[:, squares > DEPENDENT] / np.sqrt(squares[squares > DEPENDENT])
        shapes, images = shapes @ rotation, images @ rotation
    return shapes, images


def ritz(mass: Any, shapes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the eigenvalues of A (k,) in the space of A-orthonormal shapes, and the rotation (k, k) to its modes."""
    inverse, rotation = scipy.linalg.eigh(shapes.T @ (mass @ shapes))
    return 1 / inverse, rotation / np.sqrt(inverse)


def definite_factor(matrix: Any) -> Any | None:
    """Return sparse triangular factors of a symmetric matrix, None where it is not positive definite to round-off.

    Pivots are on the diagonal, so that the numbers of their signs are those of the eigenvalues (Sylvester).
    """
    try:
        factor = scipy.sparse.linalg.splu(
            matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
        )
    except RuntimeError:  # "Factor is exactly singular"
        return None
    pivots = factor.U.diagonal()[factor.perm_c]
    definite = np.array_equal(factor.perm_r, factor.perm_c) and np.all(pivots > ROUND_OFF * matrix.diagonal())
    return factor if definite else None


def check_mass(mass: Any) -> None:
    """Raise MultiPhiValueError for a sparse mass that is not positive definite."""
    diagonal = scipy.sparse.diags_array(mass.diagonal())
    if (mass != diagonal).nnz and definite_factor(mass) is None:
        raise not_definite(mass)


def lanczos(
    mass: Any, stiffness: Any, count: int, shift: float, solve: Any, start: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the ``count`` lowest omega^2, ascending, and their shapes, without a cluster that ``count`` would part.

    solve: A^-1 times a vector, or its part beside other modes. start: (n,), of the iteration.
    """
    values, vectors = lanczos_iteration(mass, stiffness, count + 1, shift, solve, start)
    gaps = np.flatnonzero(np.diff(values) > NEAR * np.abs(values[1:]))
    is_complete = count >= stiffness.shape[0] - 2  # no further modes to part them from
    size = count if is_complete and not gaps.size else (gaps[-1] + 1 if gaps.size else 0)
    return values[:size], vectors[:, :size]


def lanczos_iteration(
    mass: Any,
    stiffness: Any,
    count: int,
    shift: float,
    solve: Any,
    start: np.ndarray,
    tolerance: float = 0.0,
    vectors: int | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the ``count`` lowest omega^2 of a Lanczos iteration, ascending, and their shapes.

    Of modes of one frequency it finds the component of ``start`` (n,) in their space; others appear by round-off only.
    tolerance: of omega^2, zero for round-off. vectors: size of the Krylov space, None for twice ``count``.
    """
    n = stiffness.shape[0]
    operator = scipy.sparse.linalg.LinearOperator((n, n), solve, dtype=float)
    try:
        values, shapes = scipy.sparse.linalg.eigsh(
            stiffness,
            count,
            mass,
            sigma=-shift,
            OPinv=operator,
            v0=start,
            tol=tolerance,
            ncv=None if vectors is None else min(vectors, n),
        )
    except scipy.sparse.linalg.ArpackError as error:
        raise NumericalFailure(f"modes: Lanczos iteration for {count} of {n} modes failed: {error}") from error
    order = np.argsort(values)
    return values[order], shapes[:, order]
