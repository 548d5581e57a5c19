"""Assembly of several structures into one: side by side, tied to each other or to the ground.

    M = T^T blockdiag(M_a, M_b, ...) T,   K and C alike,   (x_a, x_b, ...) = T z,   G T = 0

A *tie* is a linear combination of points that is kept at zero, one row of G (t, N). T (N, N - t) solves the ties for t
of the N displacements of the parts, so the ties are exact without multipliers or stiffness. z [m, rad] are the other
displacements. The point "tip" of the part "a" is "a.tip" of the assembly.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.mechanics.arguments import Matrix, real_array
from multiphi_exudyn.mechanics.damping import ModalDamping, RayleighDamping
from multiphi_exudyn.mechanics.dofs import Place
from multiphi_exudyn.mechanics.structure import LinearStructure, damping_matrix

__all__ = ["Assembly", "Tie", "assemble"]

Tie = Mapping[str, float]  # {point: coefficient, ...}, whose sum is kept at zero

DEPENDENT = 1e-10  # of a tie's largest coefficient: round-off of the elimination of a tie that follows from others
TIES_HOLD = 1e-9  # of the terms of a tie: larger than the round-off of displacements computed part by part


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Assembly(LinearStructure):
    """One structure of several parts, tied to each other or to the ground; the result of ``assemble``.

        M = T^T blockdiag(M_a, M_b, ...) T,   K and C alike,   (x_a, x_b, ...) = T z,   G T = 0

    It is a LinearStructure in z, the displacements of the parts that are not eliminated by the t ties; the point "tip"
    of the part "a" is "a.tip".

    Attributes
    ----------
    mass, stiffness : array (n, n)
        M [kg, kg m2] and K [N/m, N m], sparse if any part is.
    damping : array (n, n), ModalDamping, RayleighDamping or None
        C [N s/m, N m s], or its definition by ratios.
    points : mapping of str to array (n,)
        Rows of the parts' points in z.
    dofs : None
        Rows of an assembly have no nodes.
    parts : mapping of str to (int, int)
        Name to (first, last + 1) of its degrees of freedom among the N of all parts.
    ties : array (t, N)
        Rows G.
    transformation : sparse array (N, n)
        T.
    free : array (n,)
        Indices of z among the N displacements.

    Examples
    --------
    >>> import numpy as np
    >>> import multiphi_exudyn as mp
    >>> K = 4e4 * np.array([[2, -1, 0], [-1, 2, -1], [0, -1, 1]])  # N/m
    >>> chain = mp.LinearStructure(np.eye(3), K, mp.ModalDamping(0.01), {"tip": 2})
    >>> pair = mp.assemble({"a": chain, "b": chain}, ties=[{"a.tip": 1.0, "b.tip": -1.0}])
    >>> pair.n, list(pair.points)
    (5, ['a.tip', 'b.tip'])
    >>> x = mp.MultiPhiModel(pair).static_equilibrium({"a.tip": 100.0})
    >>> print(1e3 * pair.part("b", x).round(6))  # mm: each carries half
    [1.25 2.5  3.75]
    """

    parts: Mapping[str, tuple[int, int]]
    ties: np.ndarray
    transformation: Matrix

    def __post_init__(self, fixed: Iterable[Place]) -> None:
        if tuple(fixed):
            raise MultiPhiValueError(
                'fixed: got degrees of freedom of an assembly, need ties to the ground: ties=[{"a.tip": 1.0}]'
            )
        super().__post_init__(())

    def part(self, name: str, displacement: np.ndarray) -> np.ndarray:
        """Displacements (or velocities) of one part, (n_a,) or (n_a, k), from those of the assembly, (n,) or (n, k)."""
        if name not in self.parts:
            raise MultiPhiValueError(f"part: got {name!r}, need one of: {', '.join(self.parts)}")
        first, after = self.parts[name]
        values = real_array("displacement", displacement, f"an ({self.n},) or ({self.n}, k) array of real numbers")
        if values.ndim not in (1, 2) or values.shape[0] != self.n:
            raise MultiPhiValueError(f"displacement: got shape {values.shape}, need ({self.n},) or ({self.n}, k)")
        return np.asarray(self.transformation[first:after] @ values)

    def together(self, displacements: Mapping[str, np.ndarray]) -> np.ndarray:
        """Displacements (or velocities) of the assembly (n,) from those of its parts (n_a,); zero for other parts.

        MultiPhiValueError if they violate a tie, and for a part that does not exist.
        """
        united = np.zeros(self.ties.shape[1])
        for name, values in _mapping("displacements", displacements).items():
            if name not in self.parts:
                raise MultiPhiValueError(f"displacements: got part {name!r}, need one of: {', '.join(self.parts)}")
            first, after = self.parts[name]
            united[first:after] = _finite(f"displacements[{name!r}]", values, after - first)
        _check_ties_hold(self.ties, united)
        return united[self.free]


def assemble(
    parts: Mapping[str, LinearStructure],
    ties: Sequence[Tie] = (),
    damping: Matrix | ModalDamping | RayleighDamping | None = None,
) -> Assembly:
    """Assemble several structures into one, side by side, tied to each other or to the ground.

        M = T^T blockdiag(M_a, M_b, ...) T,   K and C alike,   (x_a, x_b, ...) = T z,   G T = 0

    A tie is a linear combination of points that is kept at zero, one row of G. T solves the ties for as many
    displacements, so they are exact without multipliers or stiffness.

    Parameters
    ----------
    parts : mapping of str to LinearStructure
        By names without a dot; the point "tip" of the part "a" becomes "a.tip".
    ties : sequence of mapping, default ()
        Each {point: coefficient, ...}, a sum that is kept at zero: {"a.tip": 1.0, "b.tip": -1.0} ties two points,
        {"a.tip": 1.0} one to the ground.
    damping : array (n, n), ModalDamping, RayleighDamping or None, default None
        None keeps the damping of the parts; anything else replaces it, with ratios of the modes of the assembly.

    Returns
    -------
    Assembly
        A LinearStructure; sparse if any part is.

    Raises
    ------
    MultiPhiTypeError
        For parts that are not structures, and ties that are not mappings.
    MultiPhiValueError
        For no parts, names with a dot, unknown points, ties that follow from one another or leave no displacement free,
        and ratios of a sparse part.

    Examples
    --------
    Two chains whose free ends are joined:

    >>> import numpy as np
    >>> import multiphi_exudyn as mp
    >>> K = 4e4 * np.array([[2, -1, 0], [-1, 2, -1], [0, -1, 1]])  # N/m
    >>> chain = mp.LinearStructure(np.eye(3), K, mp.ModalDamping(0.01), {"tip": 2})
    >>> pair = mp.assemble({"a": chain, "b": chain}, ties=[{"a.tip": 1.0, "b.tip": -1.0}])
    >>> print(mp.MultiPhiModel(pair).level(()).frequencies[:2].round(1))
    [14.2 31.8]
    """
    _check_parts(parts)
    united = _side_by_side(parts)
    rows = _tie_rows(united, ties)
    transformation, free = _elimination(rows)
    return Assembly(
        mass=_project(united.mass, transformation),
        stiffness=_project(united.stiffness, transformation),
        damping=_damping(parts, transformation) if damping is None else damping,
        points={name: transformation.T @ row for name, row in united.points.items()},
        parts=_spans(parts),
        ties=rows,
        transformation=transformation,
        free=free,
    )


def _check_parts(parts: Any) -> None:
    if not _mapping("parts", parts):
        raise MultiPhiValueError("parts: got none, need at least one {name: LinearStructure}")
    for name, part in parts.items():
        if not isinstance(name, str) or not name or "." in name:
            raise MultiPhiValueError(f"parts: got the name {name!r}, need a non-empty string without a dot")
        if not isinstance(part, LinearStructure):
            raise MultiPhiTypeError(f"parts[{name!r}]: got {type(part).__name__}, need a LinearStructure")


def _spans(parts: Mapping[str, LinearStructure]) -> dict[str, tuple[int, int]]:
    after = np.cumsum([part.n for part in parts.values()]).tolist()
    return {name: (end - part.n, end) for (name, part), end in zip(parts.items(), after, strict=True)}


def _side_by_side(parts: Mapping[str, LinearStructure]) -> LinearStructure:
    """The parts without ties and without damping, in one structure of N degrees of freedom."""
    points: dict[str, int | np.ndarray] = {}
    total = sum(part.n for part in parts.values())
    for name, (first, after) in _spans(parts).items():
        for point, row in parts[name].points.items():
            points[f"{name}.{point}"] = np.r_[np.zeros(first), row, np.zeros(total - after)]
    mass, stiffness = ([getattr(part, of) for part in parts.values()] for of in ("mass", "stiffness"))
    return LinearStructure(_blocks(mass), _blocks(stiffness), points=points)


def _blocks(matrices: Sequence[Matrix]) -> Matrix:
    united = scipy.sparse.block_diag(matrices, format="csr")
    return united if any(map(scipy.sparse.issparse, matrices)) else united.toarray()


def _project(matrix: Matrix, transformation: Matrix) -> Matrix:
    return transformation.T @ matrix @ transformation


def _damping(parts: Mapping[str, LinearStructure], transformation: Matrix) -> Matrix | None:
    """C of the parts' damping, None if no part has any."""
    matrices = {name: _damping_of(name, part) for name, part in parts.items()}
    if all(matrix is None for matrix in matrices.values()):
        return None
    blocks = [0 * part.mass if matrices[name] is None else matrices[name] for name, part in parts.items()]
    return _project(_blocks(blocks), transformation)


def _damping_of(name: str, part: LinearStructure) -> Matrix | None:
    try:
        return damping_matrix(part)
    except MultiPhiValueError as error:
        raise MultiPhiValueError(f"parts[{name!r}] {error}, or the assembly's own damping=") from error


def _tie_rows(united: LinearStructure, ties: Any) -> np.ndarray:
    if isinstance(ties, (str, Mapping)) or not isinstance(ties, Sequence):
        raise MultiPhiTypeError(f"ties: got {type(ties).__name__}, need a list of {{point: coefficient, ...}}")
    rows = np.zeros((len(ties), united.n))
    for i, tie in enumerate(ties):
        try:
            rows[i] = united.row(_mapping("tie", tie))
        except MultiPhiValueError as error:
            raise MultiPhiValueError(f"ties[{i}] {error}") from error
    return rows


def _elimination(ties: np.ndarray) -> tuple[Matrix, np.ndarray]:
    """T (N, N - t), sparse, and the indices of z, by Gauss-Jordan elimination with complete pivoting."""
    scale = np.max(np.abs(ties), axis=1, keepdims=True, initial=0.0)
    rows = ties / np.where(scale > 0, scale, 1.0)
    count, total = rows.shape
    pivots = np.full(count, -1)
    for _ in range(count):
        remaining = np.flatnonzero(pivots < 0)
        i, j = np.unravel_index(np.argmax(np.abs(rows[remaining])), (len(remaining), total))
        row = remaining[i]
        if abs(rows[row, j]) < DEPENDENT:
            raise MultiPhiValueError(f"ties[{row}]: follows from the others, need ties independent of each other")
        pivots[row] = j
        rows[row] /= rows[row, j]
        others = np.arange(count) != row
        rows[others] -= np.outer(rows[others, j], rows[row])
    free = np.setdiff1d(np.arange(total), pivots)
    if not len(free):
        raise MultiPhiValueError(f"ties: got {count}, which hold every degree of freedom, need fewer")
    eliminated = scipy.sparse.coo_array(-rows[:, free])
    entries = np.r_[np.ones(len(free)), eliminated.data]
    indices = np.r_[free, pivots[eliminated.row]], np.r_[np.arange(len(free)), eliminated.col]
    return scipy.sparse.csr_array((entries, indices), shape=(total, len(free))), free


def _check_ties_hold(ties: np.ndarray, united: np.ndarray) -> None:
    """Raise for a tie that is not zero, relative to its terms."""
    violated = np.abs(ties @ united) > TIES_HOLD * (np.abs(ties) @ np.abs(united))
    if np.any(violated):
        worst = int(np.argmax(violated))
        raise MultiPhiValueError(
            f"displacements: got {ties[worst] @ united:g} for ties[{worst}], need displacements that make it 0"
        )


def _finite(name: str, values: Any, n: int) -> np.ndarray:
    vector = np.asarray(real_array(name, values, f"an ({n},) array of real numbers"))
    if vector.shape != (n,) or not np.all(np.isfinite(vector)):
        raise MultiPhiValueError(f"{name}: got shape {vector.shape}, need ({n},) finite numbers")
    return vector


def _mapping(name: str, values: Any) -> Mapping[str, Any]:
    if not isinstance(values, Mapping):
        raise MultiPhiTypeError(f"{name}: got {type(values).__name__}, need a mapping by name")
    return values
