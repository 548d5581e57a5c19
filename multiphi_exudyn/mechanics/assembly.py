"""Several structures as one: side by side, tied to each other or to the ground.

    M = T^T blockdiag(M_a, M_b, ...) T,   K and C alike,   (x_a, x_b, ...) = T z,   G T = 0

A *tie* is a linear combination of points that is held at zero, one row of G (t, N); T (N, N - t) solves the ties for t
of the N displacements of the parts, so they hold exactly and need neither multipliers nor stiffness. z [m, rad] are the
displacements that are left. The point "tip" of the part "a" is "a.tip" of the assembly.
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

Tie = Mapping[str, float]  # {point: coefficient, ...}, their sum held at zero

DEPENDENT = 1e-10  # of a tie's largest coefficient: what elimination leaves of one that follows from the others
TIES_HOLD = 1e-9  # of the terms of a tie: above the round-off of displacements computed part by part


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Assembly(LinearStructure):
    """One structure made of parts, tied to each other or to the ground; made by ``assemble``.

        M = T^T blockdiag(M_a, M_b, ...) T,   K and C alike,   (x_a, x_b, ...) = T z,   G T = 0

    It is a LinearStructure in z, those of the N displacements of the parts that the t ties leave free; the point "tip"
    of the part "a" is "a.tip".

    Attributes
    ----------
    mass, stiffness : array (n, n)
        M [kg, kg m2] and K [N/m, N m], sparse if those of any part are.
    damping : array (n, n), ModalDamping, RayleighDamping or None
        C [N s/m, N m s], or how it is made.
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
        Which of the N displacements z are.

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
        given = real_array("displacement", displacement, f"an ({self.n},) or ({self.n}, k) array of real numbers")
        if given.ndim not in (1, 2) or given.shape[0] != self.n:
            raise MultiPhiValueError(f"displacement: got shape {given.shape}, need ({self.n},) or ({self.n}, k)")
        return np.asarray(self.transformation[first:after] @ given)

    def together(self, displacements: Mapping[str, np.ndarray]) -> np.ndarray:
        """Displacements (or velocities) of the assembly, (n,), from those of its parts, (n_a,) each; absent ones rest.

        MultiPhiValueError where they break a tie, and for a part that there is not.
        """
        united = np.zeros(self.ties.shape[1])
        for name, given in _mapping("displacements", displacements).items():
            if name not in self.parts:
                raise MultiPhiValueError(f"displacements: got part {name!r}, need one of: {', '.join(self.parts)}")
            first, after = self.parts[name]
            united[first:after] = _finite(f"displacements[{name!r}]", given, after - first)
        _check_ties_hold(self.ties, united)
        return united[self.free]


def assemble(
    parts: Mapping[str, LinearStructure],
    ties: Sequence[Tie] = (),
    damping: Matrix | ModalDamping | RayleighDamping | None = None,
) -> Assembly:
    """One structure out of several, side by side, tied to each other or to the ground.

        M = T^T blockdiag(M_a, M_b, ...) T,   K and C alike,   (x_a, x_b, ...) = T z,   G T = 0

    A tie is a linear combination of points that is held at zero, one row of G. T solves the ties for as many
    displacements, so they hold exactly and need neither multipliers nor stiffness.

    Parameters
    ----------
    parts : mapping of str to LinearStructure
        By names without a dot; the point "tip" of the part "a" becomes "a.tip".
    ties : sequence of mapping, default ()
        Each {point: coefficient, ...}, a sum that is held at zero: {"a.tip": 1.0, "b.tip": -1.0} ties two points,
        {"a.tip": 1.0} one to the ground.
    damping : array (n, n), ModalDamping, RayleighDamping or None, default None
        None keeps what the parts have; anything else takes its place, ratios being of the modes of the assembly.

    Returns
    -------
    Assembly
        A LinearStructure; sparse if any part is.

    Raises
    ------
    MultiPhiTypeError
        For parts that are no structures, and ties that are no mappings.
    MultiPhiValueError
        For no parts, names with a dot, unknown points, ties that follow from one another or hold everything, and ratios
        of a sparse part.

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
    transformation, free = _solved(rows)
    return Assembly(
        mass=_between(united.mass, transformation),
        stiffness=_between(united.stiffness, transformation),
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


def _between(matrix: Matrix, transformation: Matrix) -> Matrix:
    return transformation.T @ matrix @ transformation


def _damping(parts: Mapping[str, LinearStructure], transformation: Matrix) -> Matrix | None:
    """C of the parts' own damping, None if no part has any."""
    own = {name: _damping_of(name, part) for name, part in parts.items()}
    if all(matrix is None for matrix in own.values()):
        return None
    filled = [0 * part.mass if own[name] is None else own[name] for name, part in parts.items()]
    return _between(_blocks(filled), transformation)


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


def _solved(ties: np.ndarray) -> tuple[Matrix, np.ndarray]:
    """T (N, N - t) sparse and which displacements are left, by Gauss-Jordan elimination with complete pivoting."""
    scale = np.max(np.abs(ties), axis=1, keepdims=True, initial=0.0)
    rows = ties / np.where(scale > 0, scale, 1.0)
    count, total = rows.shape
    pivots = np.full(count, -1)
    for _ in range(count):
        waiting = np.flatnonzero(pivots < 0)
        i, j = np.unravel_index(np.argmax(np.abs(rows[waiting])), (len(waiting), total))
        row = waiting[i]
        if abs(rows[row, j]) < DEPENDENT:
            raise MultiPhiValueError(f"ties[{row}]: follows from the others, need ties independent of each other")
        pivots[row] = j
        rows[row] /= rows[row, j]
        others = np.arange(count) != row
        rows[others] -= np.outer(rows[others, j], rows[row])
    free = np.setdiff1d(np.arange(total), pivots)
    if not len(free):
        raise MultiPhiValueError(f"ties: got {count}, which hold every degree of freedom, need fewer")
    solved = scipy.sparse.coo_array(-rows[:, free])
    entries = np.r_[np.ones(len(free)), solved.data]
    places = np.r_[free, pivots[solved.row]], np.r_[np.arange(len(free)), solved.col]
    return scipy.sparse.csr_array((entries, places), shape=(total, len(free))), free


def _check_ties_hold(ties: np.ndarray, united: np.ndarray) -> None:
    """Each tie against the size of its own terms."""
    broken = np.abs(ties @ united) > TIES_HOLD * (np.abs(ties) @ np.abs(united))
    if np.any(broken):
        worst = int(np.argmax(broken))
        raise MultiPhiValueError(
            f"displacements: got {ties[worst] @ united:g} for ties[{worst}], need displacements that make it 0"
        )


def _finite(name: str, given: Any, n: int) -> np.ndarray:
    vector = np.asarray(real_array(name, given, f"an ({n},) array of real numbers"))
    if vector.shape != (n,) or not np.all(np.isfinite(vector)):
        raise MultiPhiValueError(f"{name}: got shape {vector.shape}, need ({n},) finite numbers")
    return vector


def _mapping(name: str, given: Any) -> Mapping[str, Any]:
    if not isinstance(given, Mapping):
        raise MultiPhiTypeError(f"{name}: got {type(given).__name__}, need a mapping by name")
    return given
