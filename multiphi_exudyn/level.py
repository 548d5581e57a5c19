"""Level: the linear system that holds while a set of contacts is closed, in its own modes (eqs. 38.2 to 38.5).

    x = Phi_l eta + x_inf,l                                                           (38.4)
    eta'' + Phi_l^T C Phi_l eta' + diag(omega_l^2) eta = Phi_l^T (f - f_static)       (38.3)

Every level lives in one :class:`Base`: coordinates y of the open structure's own modes, x = Phi y, in which the
mass is the identity and the stiffness diag(Omega^2). A level is then a small dense problem whatever n is:

    closed rigid contacts      H_r^T y = -gap           modes in the null space of H_r^T
    closed compliant contacts  K_l = diag(Omega^2) + H_c diag(k) H_c^T

Its omega are singular values of [diag(Omega) Z; sqrt(k) H_c^T Z], Z an orthonormal null space: as accurate as the
base's own (see modes.py). The asymptotic configuration x_inf,l holds gaps and static loads (38.5, completed by
the static force), with the contact forces lambda_inf:

    y_e = Omega_e^-2 (f_e + H_e lambda),   H^T y + lambda / k = -gap,   H_0 lambda + f_0 = 0

(e elastic, 0 rigid-body coordinates). Where no closed contact resists a rigid-body motion, the load on it drives
the level's zero-frequency modes.

Each added contact interlaces: omega_i(open) <= omega_i(level) <= omega_i+c(open); asserted when a level is built.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
import scipy.sparse

from multiphi_exudyn.contact import UnilateralContact
from multiphi_exudyn.errors import MultiPhiValueError, NumericalFailure
from multiphi_exudyn.first_root import ZERO, DescentFinder
from multiphi_exudyn.modal_response import ModalResponse, modal_response
from multiphi_exudyn.modes import Modes, complete_modes, lowest_modes, right_singular_vectors
from multiphi_exudyn.structure import LinearStructure, Matrix, ModalDamping, RayleighDamping, real_array

__all__ = ["BASE_MARGIN", "Asymptotic", "Base", "Level", "LevelOverride", "build_base", "build_level", "cleared"]

BASE_MARGIN = 4  # modes of an incomplete base for each mode of a level taken from it
COMPLETE = 600  # DoFs up to which the base holds every mode; above, the lowest ones and static shapes
ORTHONORMAL = 1e-10  # |Phi^T M Phi - I| a level may show
INTERLACING = 1e-8  # relative violation of the interlacing theorem that is still round-off
UNDAMPED = 1e-12  # of the largest damping: round-off of projecting it
INDEPENDENT = 1e-10  # of the largest: singular values of contact directions below it are dependent contacts


@dataclass(frozen=True)
class LevelOverride:
    """Frequencies [Hz] and damping ratios that replace the computed ones of a level's lowest modes.

    The paper's own way of giving measured modal data per level. What is overridden is no longer one physical
    (M, C, K): such a level does not interlace, and a transition into it need not lower the energy.
    """

    frequencies: Sequence[float] | None = None
    ratios: Sequence[float] | None = None

    def __post_init__(self) -> None:
        for name in ("frequencies", "ratios"):
            if (given := getattr(self, name)) is not None:
                values = real_array(f"level override {name}", given, "a list of numbers")
                if values.ndim != 1:
                    raise MultiPhiValueError(f"level override {name}: got shape {values.shape}, need a list of numbers")
                object.__setattr__(self, name, tuple(values.tolist()))


@dataclass(frozen=True)
class Base:
    """The structure and its contacts in coordinates y of its own modes, x = Phi y.

    modes: of the open structure, (n, m). damping: (m, m), C in these coordinates. directions: H (m, c).
    contacts: as given. complete: whether m = n. weights: Phi^T M (m, n), takes x to y.
    """

    modes: Modes
    damping: np.ndarray
    directions: np.ndarray
    contacts: tuple[UnilateralContact, ...]
    complete: bool
    weights: np.ndarray

    @functools.cached_property
    def gaps(self) -> np.ndarray:
        """Initial gaps (c,) [m]."""
        return np.array([contact.gap for contact in self.contacts])

    @functools.cached_property
    def magnitudes(self) -> tuple[np.ndarray, np.ndarray]:
        """|H| (m, c) and |gaps| (c,): with them a gap's round-off is judged."""
        return np.abs(self.directions), np.abs(self.gaps)

    @functools.cached_property
    def stiffnesses(self) -> np.ndarray:
        """Contact stiffnesses (c,) [N/m], inf where rigid."""
        return np.array([contact.stiffness for contact in self.contacts])

    def strain(self, configuration: np.ndarray, closed: Sequence[int]) -> float:
        """Strain energy [J] of y (m,) and of the compliant ones among these closed contacts."""
        index = list(closed)
        closing = self.gaps[index] + self.directions[:, index].T @ configuration
        springs = np.where(np.isinf(self.stiffnesses[index]), 0.0, self.stiffnesses[index])
        return 0.5 * float(np.sum((self.modes.omega * configuration) ** 2) + np.sum(springs * closing**2))


@dataclass(frozen=True)
class Asymptotic:
    """What a level's modes cannot represent: its state of rest under gaps and static loads.

    configuration: y_inf (m,). forces: lambda_inf of the closed contacts (k,) [N]. drive: force (r,) on the
    zero-frequency modes. load: the static load's modal force Phi_l^T f (r,). strain, potential: strain energy of
    y_inf [J], and the same less f.y_inf.
    """

    configuration: np.ndarray
    forces: np.ndarray
    drive: np.ndarray
    load: np.ndarray
    strain: float
    potential: float


@dataclass(frozen=True)
class Level:
    """One level; see the module's docstring. Built by ``MultiPhiModel.level``.

    closed: names of its closed contacts. indices: the same as positions in the base. base: its coordinates.
    omega: (r,) rad/s. vectors: modes in base coordinates (m, r), orthonormal. damping: (r, r) [1/s].
    gap_rows: (c, r), gap_i = gap_rows[i].eta + ... for every contact of the model.
    force_rows, force_rate_rows: (k, r), contact force of the closed contacts from eta and eta'.
    """

    closed: tuple[str, ...]
    indices: tuple[int, ...]
    base: Base
    omega: np.ndarray
    vectors: np.ndarray
    damping: np.ndarray
    gap_rows: np.ndarray
    force_rows: np.ndarray
    force_rate_rows: np.ndarray

    @property
    def modes(self) -> int:
        """Number of modes r."""
        return len(self.omega)

    @property
    def frequencies(self) -> np.ndarray:
        """Undamped natural frequencies (r,) [Hz]."""
        return self.omega / (2 * math.pi)

    @functools.cached_property
    def highest_frequency(self) -> float:
        """The highest of them [Hz], zero where there is none."""
        return float(np.max(self.frequencies, initial=0.0))

    @property
    def ratios(self) -> np.ndarray:
        """Damping ratios (r,), diagonal of the projected damping over 2 omega; zero for rigid-body modes."""
        doubled = np.where(self.omega > 0, 2 * self.omega, np.inf)
        return np.diagonal(self.damping) / doubled

    @property
    def speed_rows(self) -> np.ndarray:
        """Gap velocities (c, r) from eta', as impacts see them."""
        return self.gap_rows

    @functools.cached_property
    def shapes(self) -> np.ndarray:
        """Mass-normalised mode shapes (n, r)."""
        return self.base.modes.shapes @ self.vectors

    @functools.cached_property
    def asymptotic_configuration(self) -> np.ndarray:
        """x_inf (n,) [m, rad] without loads."""
        unloaded = self.asymptotic(np.zeros(self.base.modes.count))
        return self.base.modes.shapes @ unloaded.configuration

    @functools.cached_property
    def response(self) -> ModalResponse:
        """Closed form of the level's motion."""
        return modal_response(self.omega, self.damping)

    @functools.cached_property
    def finder(self) -> DescentFinder:
        """Certified event location on the level's exponentials."""
        return DescentFinder(self.response.basis)

    def truncated(self, modes: int) -> Level:
        """The same level with its lowest ``modes`` modes."""
        return replace(
            self,
            omega=self.omega[:modes],
            vectors=self.vectors[:, :modes],
            damping=self.damping[:modes, :modes],
            gap_rows=self.gap_rows[:, :modes],
            force_rows=self.force_rows[:, :modes],
            force_rate_rows=self.force_rate_rows[:, :modes],
        )

    def overridden(self, override: LevelOverride) -> Level:
        """The same mode shapes with given frequencies and ratios."""
        omega, damping = self.omega.copy(), self.damping.copy()
        if override.frequencies is not None:
            given = 2 * math.pi * np.asarray(override.frequencies, dtype=float)[: self.modes]
            omega[: len(given)] = given
        if override.ratios is not None:
            ratios = np.asarray(override.ratios, dtype=float)[: self.modes]
            damping[: len(ratios), :] = damping[:, : len(ratios)] = 0.0
            damping[np.arange(len(ratios)), np.arange(len(ratios))] = 2 * ratios * omega[: len(ratios)]
        return replace(self, omega=omega, damping=damping)

    def asymptotic(self, load: np.ndarray) -> Asymptotic:
        """State of rest under a static load (m,) in base coordinates."""
        base, index = self.base, list(self.indices)
        forces, configuration = self.rest(load, base.gaps[index])
        projected = self.vectors.T @ load
        drive = np.where(self.omega > 0, 0.0, projected + self.vectors.T @ (base.directions[:, index] @ forces))
        strain = base.strain(configuration, index)
        return Asymptotic(configuration, forces, drive, projected, strain, strain - float(load @ configuration))

    def rest(self, load: np.ndarray, gaps: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Contact forces (k,) and configuration y (m,) at rest, from a load (m,) and the closed contacts' gaps (k,)."""
        base, index = self.base, list(self.indices)
        return _rest(base, base.directions[:, index], gaps, base.stiffnesses[index], load)


def build_base(structure: LinearStructure, contacts: Sequence[UnilateralContact], modes: int | str) -> Base:
    """The base of a structure: all its modes where that is affordable, else enough for ``modes`` of any level."""
    rows = np.array([structure.row(contact.direction) for contact in contacts]).reshape(-1, structure.n)
    complete = structure.n <= COMPLETE or modes == "all"
    if complete:
        found = complete_modes(_dense(structure.mass), _dense(structure.stiffness))
    else:
        points = np.array(list(structure.points.values())).reshape(-1, structure.n)
        count = min(structure.n - 2, BASE_MARGIN * int(modes) + 40)
        found = lowest_modes(structure.mass, structure.stiffness, count, np.vstack([rows, points]))
    return Base(
        modes=found,
        damping=_base_damping(structure, found),
        directions=found.shapes.T @ rows.T,
        contacts=tuple(contacts),
        complete=complete,
        weights=(structure.mass @ found.shapes).T,
    )


def build_level(base: Base, indices: tuple[int, ...]) -> Level:
    """The level with these contacts closed, with every mode the base can give."""
    closed = list(indices)
    rigid = np.isinf(base.stiffnesses[closed])
    directions = base.directions[:, closed]
    pinned, sprung = directions[:, rigid], directions[:, ~rigid]
    free = _null_space(base, pinned, [base.contacts[i].name for i in np.array(closed, int)[rigid]])
    stiffness = base.stiffnesses[closed][~rigid]
    stacked = np.vstack([base.modes.omega[:, None] * free, np.sqrt(stiffness)[:, None] * (sprung.T @ free)])
    omega, rotation = right_singular_vectors(stacked) if closed else (base.modes.omega, np.eye(base.modes.count))
    omega[: _rigid_body_modes(base, directions)] = 0.0
    vectors = free @ rotation if closed else rotation
    _check(base, omega, vectors, len(closed))
    forces = np.zeros((len(closed), len(omega)))
    rates = np.zeros_like(forces)
    forces[~rigid] = -stiffness[:, None] * (sprung.T @ vectors)
    if np.any(rigid):
        forces[rigid] = _reaction_rows(base, pinned, omega, vectors, sprung @ forces[~rigid])
        rates[rigid] = np.linalg.lstsq(pinned, base.damping @ vectors, rcond=None)[0]
    return Level(
        closed=tuple(base.contacts[i].name for i in closed),
        indices=indices,
        base=base,
        omega=omega,
        vectors=vectors,
        damping=_projected_damping(base, omega, vectors),
        gap_rows=cleared(base.directions.T @ vectors, np.abs(base.directions.T) @ np.abs(vectors)),
        force_rows=forces,
        force_rate_rows=rates,
    )


def cleared(sums: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Sums with zero where they are round-off of their terms, which add up to ``sizes`` without their signs.

    The gap of a contact that another one holds does not move; what is left of it has no sign.
    """
    return np.where(np.abs(sums) <= ZERO * sizes, 0.0, sums)


def _dense(matrix: Matrix) -> np.ndarray:
    return matrix.toarray() if scipy.sparse.issparse(matrix) else np.asarray(matrix)


def _base_damping(structure: LinearStructure, modes: Modes) -> np.ndarray:
    """Phi^T C Phi (m, m)."""
    given = structure.damping
    if given is None:
        return np.zeros((modes.count, modes.count))
    if isinstance(given, ModalDamping):
        return np.diag(2 * given.of(modes.count) * modes.omega)
    if isinstance(given, RayleighDamping):
        return np.diag(given.alpha + given.beta * modes.omega**2)
    projected = modes.shapes.T @ (given @ modes.shapes)
    return (projected + projected.T) / 2


def _projected_damping(base: Base, omega: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """D (r, r); on a zero-frequency mode round-off of no damping would be a damping of its own."""
    damping: np.ndarray = vectors.T @ base.damping @ vectors
    free = omega == 0
    negligible = np.abs(damping) <= UNDAMPED * np.max(np.abs(base.damping), initial=0.0)
    damping[negligible & (free[:, None] | free[None, :])] = 0.0
    return damping


def _null_space(base: Base, pinned: np.ndarray, names: list[str]) -> np.ndarray:
    """Orthonormal basis (m, m - c) of the motions that leave the rigid contacts' gaps unchanged."""
    if pinned.shape[1] == 0:
        return np.eye(base.modes.count)
    orthogonal, triangular = scipy.linalg.qr(pinned)
    diagonal = np.abs(np.diagonal(triangular))
    if pinned.shape[1] > base.modes.count or np.min(diagonal) <= INDEPENDENT * np.max(diagonal):
        raise NumericalFailure(f"level: rigid contacts {', '.join(names)} are not independent of each other")
    return orthogonal[:, pinned.shape[1] :]


def _rigid_body_modes(base: Base, directions: np.ndarray) -> int:
    """Rigid-body motions that no closed contact resists."""
    rigid = directions[: base.modes.rigid]
    if rigid.size == 0:
        return base.modes.rigid
    singular = np.linalg.svd(rigid, compute_uv=False)
    return base.modes.rigid - int(np.sum(singular > INDEPENDENT * _largest_norm(directions)))


def _reaction_rows(
    base: Base, pinned: np.ndarray, omega: np.ndarray, vectors: np.ndarray, spring_forces: np.ndarray
) -> np.ndarray:
    """Reaction of every mode: (Omega^2 - omega^2) psi - (force of the springs) = H_r rho, solved for rho (c, r).

    Weighted by 1 / (Omega^2 + omega^2), in which no mode of the base outweighs the others.
    """
    squared = base.modes.omega[:, None] ** 2
    rows = np.zeros((pinned.shape[1], len(omega)))
    for k in range(len(omega)):
        total = squared[:, 0] + omega[k] ** 2
        weight = 1 / np.where(total > 0, total, np.min(total[total > 0], initial=np.inf))
        weight = np.where(np.any(total > 0), weight, 1.0)
        residual = (squared[:, 0] - omega[k] ** 2) * vectors[:, k] - spring_forces[:, k]
        rows[:, k] = np.linalg.solve(pinned.T @ (weight[:, None] * pinned), pinned.T @ (weight * residual))
    return rows


def _check(base: Base, omega: np.ndarray, vectors: np.ndarray, closed: int) -> None:
    """Mass normalisation and interlacing."""
    error = np.max(np.abs(vectors.T @ vectors - np.eye(len(omega))), initial=0.0)
    open_omega = base.modes.omega
    slack = INTERLACING * open_omega + np.finfo(float).eps * np.max(open_omega, initial=0.0)
    below, above = (open_omega - slack)[: len(omega)], (open_omega + slack)[closed:]
    interlaced = np.all(omega >= below) and np.all(omega[: len(above)] <= above)
    if not (error <= ORTHONORMAL and interlaced):
        raise NumericalFailure(
            f"level: its modes fail their invariants (mass normalisation off by {error:g}, "
            f"interlacing {'holds' if interlaced else 'violated'})"
        )


def _rest(
    base: Base, directions: np.ndarray, gaps: np.ndarray, stiffness: np.ndarray, load: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Contact forces (k,) and configuration y (m,) at rest, rigid-body motion nobody resists left out."""
    elastic = slice(base.modes.rigid, None)
    compliance = base.modes.omega[elastic] ** -2.0
    touching = directions[elastic]
    flexibility = touching.T @ (compliance[:, None] * touching) + np.diag(1 / stiffness)
    carried = _range(directions[: base.modes.rigid], INDEPENDENT * _largest_norm(directions))
    coupling = directions[: base.modes.rigid].T @ carried
    matrix = np.block([[flexibility, coupling], [coupling.T, np.zeros((carried.shape[1],) * 2)]])
    given = np.concatenate([-gaps - touching.T @ (compliance * load[elastic]), -carried.T @ load[: base.modes.rigid]])
    solution = np.linalg.solve(matrix, given)
    forces, rigid = solution[: len(gaps)], solution[len(gaps) :]
    total = cleared(load[elastic] + touching @ forces, np.abs(load[elastic]) + np.abs(touching) @ np.abs(forces))
    configuration = np.concatenate([carried @ rigid, compliance * total])
    return forces, configuration


def _range(matrix: np.ndarray, negligible: float) -> np.ndarray:
    """Orthonormal basis of the column space, singular values up to ``negligible`` taken for zero."""
    if matrix.size == 0:
        return np.zeros((matrix.shape[0], 0))
    left, singular, _ = np.linalg.svd(matrix, full_matrices=False)
    return left[:, singular > negligible]


def _largest_norm(directions: np.ndarray) -> float:
    return float(np.linalg.norm(directions, axis=0).max(initial=0.0))
