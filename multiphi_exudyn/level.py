"""Level: the linear system that holds while a set of contacts is closed, in its own modes (eqs. 38.2 to 38.5).

    x = Phi_l eta + x_inf,l                                                           (38.4)
    eta'' + Phi_l^T C Phi_l eta' + diag(omega_l^2) eta = Phi_l^T (f - f_static)       (38.3)

Every level lives in one :class:`Base`: coordinates y of the open structure's own modes, x = Phi y, in which the
mass is the identity and the stiffness diag(Omega^2). A level is then a small dense problem whatever n is:

    closed rigid contacts      H_r^T y = -gap           modes in the null space of H_r^T
    closed compliant contacts  K_l = diag(Omega^2) + H_c diag(k) H_c^T,   C_l = C + H_c diag(c) H_c^T

Closed springs of one direction p, the chain of a force law or compliant contacts at one place, are one spring
K q + G, q = p.y; beside a closed rigid contact of that direction they are a constant force. The total stiffness of
a law may be negative, and the level indefinite: then omega^2 < 0, the square of a rate of growth
(eta ~ exp(+-|omega| t)).

The omega of springs K > 0 are singular values of [diag(Omega) Z; sqrt(K) P^T Z], Z an orthonormal null space: as
accurate as the base's own (see modes.py). Springs K < 0 follow on these modes, w = sqrt|K| Phi^T p, as

    omega^2 + mu - W W^T = (R B)^T R B,   B = diag(omega^2 + mu)^1/2,   R^T R = I - (B^-1 W)(B^-1 W)^T

again by singular values; mu = 0 unless the level is indefinite or nearly so.

Where a quarter of the modes or fewer are asked for, in a base without rigid-body modes and with no K < 0, they are the
largest eigenvectors of the level's compliance, a matrix of rank d away from the base's,

    A = Omega^-2 - Omega^-2 P (1/K + P^T Omega^-2 P)^-1 P^T Omega^-2            (rigid: 1/K = 0)

and their omega the singular values in the space of these few: the cost is that of a few vectors, the accuracy stays.

The asymptotic configuration x_inf,l
holds gaps and static loads (38.5, completed by the static force), with the forces f along the directions:

    y_e = Omega_e^-2 (f_e + P_e f),   f + K p.y = -G  (rigid: p.y = -gap),   P_0 f + f_0 = 0

(e elastic, 0 rigid-body coordinates). Where no closed contact resists a rigid-body motion, the load on it drives
the level's zero-frequency modes.

Each direction of positive stiffness added interlaces: omega_i(open) <= omega_i(level) <= omega_i+c(open), one of
negative stiffness downwards; asserted when a level is built.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
import scipy.sparse

from multiphi_exudyn.errors import MultiPhiValueError, NumericalFailure
from multiphi_exudyn.first_root import DescentFinder
from multiphi_exudyn.force_law import Contact, ForceLaw, LawSpring
from multiphi_exudyn.modal_response import ModalResponse, modal_response
from multiphi_exudyn.modes import Modes, complete_modes, lowest_modes, right_singular_vectors
from multiphi_exudyn.root_search import ZERO
from multiphi_exudyn.structure import LinearStructure, Matrix, ModalDamping, RayleighDamping, real_array

__all__ = [
    "BASE_MARGIN",
    "Asymptotic",
    "Base",
    "Level",
    "LevelOverride",
    "Supports",
    "build_base",
    "build_level",
    "cleared",
    "independent",
    "rays_of",
    "rest",
]

BASE_MARGIN = 4  # modes of an incomplete base for each mode of a level taken from it
COMPLETE = 600  # DoFs up to which the base holds every mode; above, the lowest ones and static shapes
ORTHONORMAL = 1e-10  # |Phi^T M Phi - I| a level may show
INTERLACING = 1e-8  # relative violation of the interlacing theorem that is still round-off
UNDAMPED = 1e-12  # of the largest damping: round-off of projecting it
INDEPENDENT = 1e-10  # of the largest: singular values of contact directions below it are dependent contacts
PARALLEL = 1e-14  # of the largest component: directions that differ by less differ by round-off
CANCELLED = 1e-13  # of sum |k|: a total stiffness of a chain below it is round-off of zero
NEARLY_INDEFINITE = 0.5  # share of a stiffness that negative springs may take before mu is needed
FEW = 4  # modes of the base for each mode asked for: from there on the compliance is the cheaper way to them
NEUTRAL = 1e-12  # of mu: an |omega^2| below it is round-off of zero


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
    contacts: as given. complete: whether m = n. mass: M (n, n), the structure's own.
    """

    modes: Modes
    damping: np.ndarray
    directions: np.ndarray
    contacts: tuple[Contact, ...]
    complete: bool
    mass: Matrix

    def coordinates(self, x: np.ndarray) -> np.ndarray:
        """y = Phi^T M x (m,) or (m, k) of configurations (n,) or (n, k)."""
        return np.asarray(self.modes.shapes.T @ (self.mass @ x))

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

    @functools.cached_property
    def dampings(self) -> np.ndarray:
        """Contact dampings (c,) [N s/m]."""
        return np.array([contact.damping for contact in self.contacts])

    @functools.cached_property
    def rays(self) -> list[int]:
        """``rays_of`` the contacts, all others of one direction up to its sign taken together as well."""
        first = rays_of(self.contacts)
        plain = [i for i, c in enumerate(self.contacts) if not isinstance(c, LawSpring)]
        for k, i in enumerate(plain):
            before = [j for j in plain[:k] if first[j] == j]
            first[i] = next((before[same] for same in self._parallel(i, before)), i)
        return first

    def _parallel(self, i: int, others: list[int]) -> np.ndarray:
        """Which of these contacts have the direction of one up to its sign, and the same measure of a gap along it."""
        one, other = self.directions[:, [i]], self.directions[:, others]
        apart = np.minimum(np.max(np.abs(one - other), axis=0), np.max(np.abs(one + other), axis=0))
        return np.flatnonzero(apart <= PARALLEL * np.max(np.abs(other), axis=0))

    @functools.cached_property
    def signs(self) -> np.ndarray:
        """Sign (c,) of every contact's direction to the one of its ray."""
        along = np.sum(self.directions * self.directions[:, self.rays], axis=0)
        return np.where(along < 0, -1, 1)

    @functools.cached_property
    def laws(self) -> dict[int, ForceLaw]:
        """Every force law by the position of its first spring."""
        given = ((i, self.contacts[i]) for i in sorted(set(self.rays)))
        return {i: contact.law for i, contact in given if isinstance(contact, LawSpring)}

    @functools.cached_property
    def preload(self) -> np.ndarray:
        """Load (m,) of the constant forces of all force laws."""
        total = np.zeros(self.modes.count)
        for i, law in self.laws.items():
            total += law.constant * law.springs[0].side * self.directions[:, i]
        return total

    @functools.cached_property
    def datum(self) -> float:
        """Strain energy [J] of the constant forces of all force laws at q = 0: a law has none at its centre."""
        return -sum(law.constant * law.centre for law in self.laws.values())

    def strain(self, configuration: np.ndarray, closed: Sequence[int], gaps: np.ndarray | None = None) -> float:
        """Strain energy [J] of y (m,), of the compliant ones among these closed contacts, and of constant forces.

        gaps: (c,) of all contacts, None for their own.
        """
        index = list(closed)
        closing = (self.gaps if gaps is None else gaps)[index] + self.directions[:, index].T @ configuration
        springs = np.where(np.isinf(self.stiffnesses[index]), 0.0, self.stiffnesses[index])
        bent = 0.5 * float(np.sum((self.modes.omega * configuration) ** 2) + np.sum(springs * closing**2))
        return bent - float(self.preload @ configuration) + self.datum

    def resistance(self, closed: Sequence[int]) -> np.ndarray:
        """C_l (m, m) in these coordinates: the structure's damping and that of closed viscous contacts."""
        viscous = [i for i in closed if self.dampings[i]]
        if not viscous:
            return self.damping
        directions = self.directions[:, viscous]
        return np.asarray(self.damping + (directions * self.dampings[viscous]) @ directions.T)

    def supports(self, closed: Sequence[int], gaps: np.ndarray) -> Supports:
        """Closed contacts with their gaps (k,), those of one direction taken together, but two rigid ones never."""
        along = [self.rays[i] for i in closed]
        if len(set(along)) == len(along):
            index, alone = list(closed), tuple((i,) for i in closed)
            return Supports(alone, self.directions[:, along], self.stiffnesses[index], self.signs[index] * gaps)
        rays: dict[int, list[int]] = {}
        given = dict(zip(closed, gaps.tolist(), strict=True))
        for i in closed:
            rays.setdefault(self.rays[i], []).append(i)
        together = [part for members in rays.values() for part in self._held_once(members)]
        stiffness, offsets = np.zeros((2, len(together)))
        for j, members in enumerate(together):
            k, signed = self.stiffnesses[members], self.signs[members] * [given[i] for i in members]
            stiffness[j] = np.sum(k)
            rigid = np.isinf(k)
            if len(members) == 1 or np.any(rigid):
                offsets[j] = signed[np.argmax(rigid)]
                continue
            if abs(stiffness[j]) <= CANCELLED * np.sum(np.abs(k)):
                stiffness[j] = 0.0
            offsets[j] = np.sum(k * signed) / (stiffness[j] or 1.0)
        directions = self.directions[:, [self.rays[members[0]] for members in together]]
        return Supports(tuple(map(tuple, together)), directions, stiffness, offsets)

    def _held_once(self, members: list[int]) -> list[list[int]]:
        """Contacts of one direction, every rigid one but the first on its own."""
        further = [i for i in members if math.isinf(self.stiffnesses[i])][1:]
        return [[i for i in members if i not in further], *([i] for i in further)]

    def contact_forces(self, supports: Supports, along: np.ndarray, closing: np.ndarray) -> np.ndarray:
        """lambda (c,) [N] from the forces (d,) along supports and the gaps (c,) there; zero where open.

        Springs of one direction have what their gaps say, and a rigid contact among them the rest.
        """
        forces = np.zeros(len(self.contacts))
        for members, force in zip(supports.members, along.tolist(), strict=True):
            index, held = list(members), [i for i in members if math.isinf(self.stiffnesses[i])]
            if len(index) > 1:
                springs = [i for i in index if i not in held]
                moved = self.signs[held[0]] * closing[held[0]] if held else 0.0  # round-off of zero
                forces[springs] = -self.stiffnesses[springs] * (closing[springs] - self.signs[springs] * moved)
                force -= self.signs[springs] @ forces[springs]
                index = held
            forces[index] = self.signs[index] * force
        return forces


@dataclass(frozen=True)
class Supports:
    """What closed contacts are along each of their d directions p.

    members: the contacts of each. directions: (m, d). stiffness: K (d,) [N/m], inf where rigid.
    offsets: (d,) G / K [m], the gap of a single contact; G [N] where K is zero.
    """

    members: tuple[tuple[int, ...], ...]
    directions: np.ndarray
    stiffness: np.ndarray
    offsets: np.ndarray

    @property
    def rigid(self) -> np.ndarray:
        """(d,) bool."""
        return np.isinf(self.stiffness)

    @property
    def resisting(self) -> np.ndarray:
        """Directions (m, .) in which there is a stiffness."""
        return self.directions[:, self.stiffness != 0]

    @property
    def constants(self) -> np.ndarray:
        """G (d,) [N], zero where rigid."""
        finite = np.where(self.rigid | (self.stiffness == 0), 1.0, self.stiffness)
        return np.where(self.rigid, 0.0, finite * self.offsets)


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
    squares: omega^2 (r,) [rad2/s2], ascending, negative for growing modes. vectors: modes in base coordinates (m, r),
    orthonormal. damping: (r, r) [1/s].
    gap_rows: (c, r), gap_i = gap_rows[i].eta + ... for every contact of the model.
    force_rows, force_rate_rows: (k, r), contact force of the closed contacts from eta and eta'.
    neutral: (m, z), the zero-frequency modes if negative springs have cancelled the stiffness of one, else z = 0.
    """

    closed: tuple[str, ...]
    indices: tuple[int, ...]
    base: Base
    squares: np.ndarray
    vectors: np.ndarray
    damping: np.ndarray
    gap_rows: np.ndarray
    force_rows: np.ndarray
    force_rate_rows: np.ndarray
    neutral: np.ndarray

    @property
    def modes(self) -> int:
        """Number of modes r."""
        return len(self.squares)

    @functools.cached_property
    def omega(self) -> np.ndarray:
        """Rates (r,) [rad/s] of oscillation, or of growth where ``squares`` is negative."""
        return np.sqrt(np.abs(self.squares))

    @property
    def frequencies(self) -> np.ndarray:
        """Undamped natural frequencies (r,) [Hz]; for a growing mode minus its rate of growth over 2 pi."""
        return np.sign(self.squares) * self.omega / (2 * math.pi)

    @functools.cached_property
    def highest_frequency(self) -> float:
        """The highest of them [Hz], zero where there is none."""
        return float(np.max(self.frequencies, initial=0.0))

    @property
    def ratios(self) -> np.ndarray:
        """Damping ratios (r,), diagonal of the projected damping over 2 |omega|; zero for rigid-body modes."""
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
        return modal_response(self.squares, self.damping)

    @functools.cached_property
    def finder(self) -> DescentFinder:
        """Certified event location on the level's exponentials."""
        return DescentFinder(self.response.basis)

    def forget_samples(self) -> None:
        """Let go of the samples for event location, most of what a level takes; they are made again when needed."""
        vars(self).pop("finder", None)

    def truncated(self, modes: int) -> Level:
        """The same level with its lowest ``modes`` modes."""
        return replace(
            self,
            squares=self.squares[:modes],
            vectors=self.vectors[:, :modes],
            damping=self.damping[:modes, :modes],
            gap_rows=self.gap_rows[:, :modes],
            force_rows=self.force_rows[:, :modes],
            force_rate_rows=self.force_rate_rows[:, :modes],
        )

    def overridden(self, override: LevelOverride) -> Level:
        """The same mode shapes with given frequencies and ratios."""
        squares, damping = self.squares.copy(), self.damping.copy()
        if override.frequencies is not None:
            given = 2 * math.pi * np.asarray(override.frequencies, dtype=float)[: self.modes]
            squares[: len(given)] = given**2
        if override.ratios is not None:
            ratios = np.asarray(override.ratios, dtype=float)[: self.modes]
            damping[: len(ratios), :] = damping[:, : len(ratios)] = 0.0
            doubled = 2 * np.sqrt(np.abs(squares[: len(ratios)]))
            damping[np.arange(len(ratios)), np.arange(len(ratios))] = ratios * doubled
        return replace(self, squares=squares, damping=damping)

    def asymptotic(self, load: np.ndarray) -> Asymptotic:
        """State of rest under a static load (m,) in base coordinates, and the constant forces of force laws."""
        base, gaps = self.base, self.base.gaps[list(self.indices)]
        supports = base.supports(self.indices, gaps)
        along, configuration, pushing = self._rest(supports, load + base.preload)
        strain = base.strain(configuration, self.indices)
        return Asymptotic(
            configuration=configuration,
            forces=self._forces(supports, along, configuration, gaps),
            drive=np.where(self.squares != 0, 0.0, self.vectors.T @ pushing),
            load=self.vectors.T @ load,
            strain=strain,
            potential=strain - float(load @ configuration),
        )

    def rest(self, load: np.ndarray, gaps: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Contact forces (k,) and configuration y (m,) at rest, from a load (m,) and the closed contacts' gaps (k,)."""
        supports = self.base.supports(self.indices, gaps)
        along, configuration, _ = self._rest(supports, load)
        return self._forces(supports, along, configuration, gaps), configuration

    def _rest(self, supports: Supports, total: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(f, y, what drives zero-frequency modes) under a load (m,)."""
        if self.neutral.size:
            return self._neutral_rest(supports, total)
        along, configuration = rest(self.base, supports, total)
        return along, configuration, total + supports.directions @ along

    def _neutral_rest(self, supports: Supports, total: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(f, y, what drives zero-frequency modes) where springs cancel the stiffness of some mode exactly."""
        if np.any(supports.rigid):
            raise NumericalFailure(
                f"level {', '.join(self.closed)}: negative stiffness cancels that of a mode beside closed rigid "
                "contacts, so there is no state of rest"
            )
        pushing = total - supports.directions @ supports.constants
        _, found = rest(self.base, supports, total - self.neutral @ (self.neutral.T @ pushing))
        configuration = found - self.neutral @ (self.neutral.T @ found)
        return (
            -supports.constants - supports.stiffness * (supports.directions.T @ configuration),
            configuration,
            pushing,
        )

    def _forces(self, supports: Supports, along: np.ndarray, configuration: np.ndarray, gaps: np.ndarray) -> np.ndarray:
        """lambda (k,) of the closed contacts from the forces along their directions."""
        index, closing = list(self.indices), np.zeros(len(self.base.contacts))
        closing[index] = self.base.directions[:, index].T @ configuration + gaps
        return self.base.contact_forces(supports, along, closing)[index]


def build_base(structure: LinearStructure, contacts: Sequence[Contact], modes: int | str) -> Base:
    """The base of a structure: all its modes where that is affordable, else enough for ``modes`` of any level."""
    rows = np.array([structure.row(contact.direction) for contact in contacts]).reshape(-1, structure.n)
    complete = structure.n <= COMPLETE or modes == "all"
    if complete:
        found = complete_modes(_dense(structure.mass), _dense(structure.stiffness))
    else:
        points = np.array([structure.row(name) for name in structure.points]).reshape(-1, structure.n)
        count = min(structure.n - 2, BASE_MARGIN * int(modes) + 40)
        distinct = rows[sorted(set(rays_of(contacts)))]
        found = lowest_modes(structure.mass, structure.stiffness, count, np.vstack([distinct, points]))
    return Base(
        modes=found,
        damping=_base_damping(structure, found),
        directions=cleared(found.shapes.T @ rows.T, np.abs(found.shapes.T) @ np.abs(rows.T)),
        contacts=tuple(contacts),
        complete=complete,
        mass=structure.mass,
    )


def rays_of(contacts: Sequence[Contact]) -> list[int]:
    """For every contact itself, or its law's first spring, which has the same direction up to its sign."""
    first: dict[ForceLaw, int] = {}
    return [first.setdefault(c.law, i) if isinstance(c, LawSpring) else i for i, c in enumerate(contacts)]


def build_level(base: Base, indices: tuple[int, ...], modes: int | None = None) -> Level:
    """The level with these contacts closed, with its lowest ``modes`` modes at least, None for all that it has."""
    closed = list(indices)
    supports = base.supports(closed, base.gaps[closed])
    pinned = supports.directions[:, supports.rigid]
    if not independent(base, held := [i for i in closed if base.contacts[i].rigid]):
        names = ", ".join(base.contacts[i].name for i in held)
        raise NumericalFailure(f"level: rigid contacts {names} are not independent of each other")
    if not closed:
        squares, vectors, accuracy = base.modes.omega[:modes] ** 2, np.eye(base.modes.count, modes), 0.0
    elif modes is not None and _few(base, supports, modes):
        squares, vectors, accuracy = _lowest(base, supports, modes)
    else:
        squares, vectors, accuracy = _modes(base, supports, _null_space(pinned))
    rigid_body = _rigid_body_modes(base, supports)
    squares[np.argsort(np.abs(squares), kind="stable")[:rigid_body]] = 0.0
    squares[np.abs(squares) <= NEUTRAL * accuracy] = 0.0
    zero = squares == 0
    _check(base, squares, vectors, supports, accuracy)
    damping = base.resistance(closed)
    gap_rows = cleared(base.directions.T @ vectors, base.magnitudes[0].T @ np.abs(vectors))
    forces, rates = _force_rows(base, closed, squares, vectors, damping, gap_rows[closed])
    return Level(
        closed=tuple(base.contacts[i].name for i in closed),
        indices=indices,
        base=base,
        squares=squares,
        vectors=vectors,
        damping=_projected_damping(damping, squares, vectors),
        gap_rows=gap_rows,
        force_rows=forces,
        force_rate_rows=rates,
        neutral=vectors[:, zero if np.sum(zero) > rigid_body else np.zeros_like(zero)],
    )


def cleared(sums: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Sums with zero where they are round-off of their terms, which add up to ``sizes`` without their signs.

    The gap of a contact that another one holds does not move; what is left of it has no sign.
    """
    return np.where(np.abs(sums) <= ZERO * sizes, 0.0, sums)


def _modes(base: Base, supports: Supports, free: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """omega^2 ascending, modes (m, r) in the motions ``free`` (m, r), and the mu that limits their accuracy."""
    directions, stiffness = supports.directions, supports.stiffness
    stiffening, softening = (stiffness > 0) & ~supports.rigid, stiffness < 0
    springs = np.sqrt(stiffness[stiffening])[:, None] * (directions[:, stiffening].T @ free)
    omega, rotation = right_singular_vectors(np.vstack([base.modes.omega[:, None] * free, springs]))
    squares, vectors = omega**2, free @ rotation
    if not np.any(softening):
        return squares, vectors, 0.0
    return _softened(squares, vectors, (vectors.T @ directions[:, softening]) * np.sqrt(-stiffness[softening]))


def _few(base: Base, supports: Supports, modes: int) -> bool:
    """Whether the compliance gives that many modes cheaply."""
    left = base.modes.count - int(np.sum(supports.rigid))
    few = modes <= left and FEW * modes <= base.modes.count
    return few and not base.modes.rigid and bool(np.all(supports.stiffness >= 0))


def _lowest(base: Base, supports: Supports, modes: int) -> tuple[np.ndarray, np.ndarray, float]:
    """``_modes``, the lowest ones only, by way of the level's compliance."""
    sprung = supports.stiffness != 0
    directions, stiffness = supports.directions[:, sprung], supports.stiffness[sprung]
    compliance = base.modes.omega**-2.0
    lengths = np.linalg.norm(directions / base.modes.omega[:, None], axis=0)
    bent = compliance[:, None] * directions / lengths
    flexibility = directions.T @ bent / lengths[:, None] + np.diag(1 / stiffness / lengths**2)
    taken = scipy.linalg.solve_triangular(np.linalg.cholesky(flexibility), bent.T, lower=True)
    own, count = -(taken.T @ taken), base.modes.count
    own.flat[:: count + 1] += compliance
    wanted = [count - modes, count - 1]
    _, vectors = scipy.linalg.eigh(own.T, subset_by_index=wanted, overwrite_a=True, check_finite=False)
    pinned = directions[:, np.isinf(stiffness)]
    if pinned.shape[1]:
        held = np.linalg.qr(pinned)[0]
        vectors = vectors - held @ (held.T @ vectors)
    return _modes(base, supports, np.linalg.qr(vectors)[0])


def _softened(squares: np.ndarray, vectors: np.ndarray, pull: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """``_modes`` of diag(squares) - W W^T, W = ``pull`` (r, s)."""
    shift = 0.0 if _share(squares, pull) <= NEARLY_INDEFINITE else 2 * float(np.linalg.norm(pull, 2)) ** 2
    while shift and _share(squares + shift / 2, pull) <= NEARLY_INDEFINITE:
        shift /= 2
    root = np.sqrt(squares + shift)
    left, taken, _ = np.linalg.svd(_divided(pull, root), full_matrices=False)
    factor = np.diag(root) - (left * (1 - np.sqrt(1 - taken**2))) @ (left.T * root)
    omega, rotation = right_singular_vectors(factor)
    return (omega - math.sqrt(shift)) * (omega + math.sqrt(shift)), vectors @ rotation, shift


def _share(squares: np.ndarray, pull: np.ndarray) -> float:
    """Largest eigenvalue of B^-1 W W^T B^-1, B^2 = diag(squares): above 1 negative springs win."""
    if np.any((squares <= 0)[:, None] & (pull != 0)):
        return math.inf
    return float(np.linalg.norm(_divided(pull, np.sqrt(squares)), 2)) ** 2


def _divided(pull: np.ndarray, root: np.ndarray) -> np.ndarray:
    return pull / np.where(root > 0, root, 1.0)[:, None]


def _force_rows(
    base: Base, closed: list[int], squares: np.ndarray, vectors: np.ndarray, damping: np.ndarray, gap_rows: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Contact forces of the closed contacts from eta and eta', (k, r) each; gap_rows (k, r): theirs."""
    rigid = np.isinf(base.stiffnesses[closed])
    forces = np.zeros((len(closed), len(squares)))
    rates = np.zeros_like(forces)
    pinned, sprung = base.directions[:, closed][:, rigid], base.directions[:, closed][:, ~rigid]
    forces[~rigid] = -base.stiffnesses[closed][~rigid][:, None] * gap_rows[~rigid]
    rates[~rigid] = -base.dampings[closed][~rigid][:, None] * gap_rows[~rigid]
    if np.any(rigid):
        forces[rigid] = _reaction_rows(base, pinned, squares, vectors, sprung @ forces[~rigid])
        rates[rigid] = np.linalg.lstsq(pinned, damping @ vectors, rcond=None)[0]
    return forces, rates


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


def _projected_damping(damping: np.ndarray, squares: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """D (r, r); on a zero-frequency mode round-off of no damping would be a damping of its own."""
    projected: np.ndarray = vectors.T @ damping @ vectors
    free = squares == 0
    if not np.any(free):
        return projected
    negligible = np.abs(projected) <= UNDAMPED * np.max(np.abs(damping), initial=0.0)
    projected[negligible & (free[:, None] | free[None, :])] = 0.0
    return projected


def independent(base: Base, rigid: Sequence[int]) -> bool:
    """Whether none of these rigid contacts follows from the others, so that they can be closed together."""
    pinned = base.directions[:, list(rigid)]
    if pinned.shape[1] == 0:
        return True
    diagonal = np.abs(np.diagonal(np.linalg.qr(pinned, mode="r")))
    return pinned.shape[1] <= base.modes.count and bool(np.min(diagonal) > INDEPENDENT * np.max(diagonal))


def _null_space(pinned: np.ndarray) -> np.ndarray:
    """Orthonormal basis (m, m - c) of the motions that leave the gaps of rigid contacts (m, c) unchanged."""
    if pinned.shape[1] == 0:
        return np.eye(len(pinned))
    return np.asarray(scipy.linalg.qr(pinned)[0][:, pinned.shape[1] :])


def _rigid_body_modes(base: Base, supports: Supports) -> int:
    """Rigid-body motions that no closed contact resists."""
    rigid = supports.resisting[: base.modes.rigid]
    if rigid.size == 0:
        return base.modes.rigid
    singular = np.linalg.svd(rigid, compute_uv=False)
    return base.modes.rigid - int(np.sum(singular > INDEPENDENT * _largest_norm(supports.resisting)))


def _reaction_rows(
    base: Base, pinned: np.ndarray, squares: np.ndarray, vectors: np.ndarray, spring_forces: np.ndarray
) -> np.ndarray:
    """Reaction of every mode: (Omega^2 - omega^2) psi - (force of the springs) = H_r rho, solved for rho (c, r).

    Weighted by 1 / (Omega^2 + |omega^2|), in which no mode of the base outweighs the others.
    """
    squared = base.modes.omega[:, None] ** 2
    total = squared + np.abs(squares)
    smallest = np.min(np.where(total > 0, total, np.inf), axis=0, initial=np.inf)
    weights = 1 / np.where(total > 0, total, np.where(np.isinf(smallest), 1.0, smallest))
    residuals = (squared - squares) * vectors - spring_forces
    grams = (pinned.T * weights.T[:, None, :]) @ pinned
    given = (pinned.T @ (weights * residuals)).T
    return np.asarray(np.linalg.solve(grams, given[:, :, None])[:, :, 0].T)


def _check(base: Base, squares: np.ndarray, vectors: np.ndarray, supports: Supports, accuracy: float) -> None:
    """Mass normalisation and interlacing."""
    error = np.max(np.abs(vectors.T @ vectors - np.eye(len(squares))), initial=0.0)
    stiffening, softening = int(np.sum(supports.stiffness > 0)), int(np.sum(supports.stiffness < 0))
    given = base.modes.omega**2
    slack = INTERLACING * (given + accuracy) + np.finfo(float).eps * np.max(given, initial=0.0)
    below, above = (given - slack)[: len(squares) - softening], (given + slack)[stiffening:]
    count = min(len(above), len(squares))
    interlaced = np.all(squares[softening:] >= below) and np.all(squares[:count] <= above[:count])
    if not (error <= ORTHONORMAL and interlaced):
        raise NumericalFailure(
            f"level: its modes fail their invariants (mass normalisation off by {error:g}, "
            f"interlacing {'holds' if interlaced else 'violated'})"
        )


def rest(base: Base, supports: Supports, load: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Forces (d,) along the supports and configuration y (m,) at rest, motion nobody resists left out."""
    elastic, free = slice(base.modes.rigid, None), slice(base.modes.rigid)
    compliance = base.modes.omega[elastic] ** -2.0
    touching = supports.directions[elastic]
    sprung = supports.stiffness != 0  # the others push with G, whatever y is
    own = np.where(sprung, 1 / np.where(sprung, supports.stiffness, 1.0), 1.0)
    flexibility = sprung[:, None] * (touching.T @ (compliance[:, None] * touching)) + np.diag(own)
    carried = _range(supports.resisting[free], INDEPENDENT * _largest_norm(supports.resisting))
    coupling = supports.directions[free].T @ carried
    none = np.zeros((carried.shape[1],) * 2)
    matrix = np.block([[flexibility, sprung[:, None] * coupling], [coupling.T, none]])
    pressed = -supports.offsets - sprung * (touching.T @ (compliance * load[elastic]))
    solution = _solved(matrix, np.concatenate([pressed, -carried.T @ load[free]]))
    forces = solution[: len(own)]
    total = cleared(load[elastic] + touching @ forces, np.abs(load[elastic]) + np.abs(touching) @ np.abs(forces))
    configuration = np.concatenate([carried @ solution[len(own) :], compliance * total])
    left = supports.offsets + own * forces + sprung * (supports.directions.T @ configuration)
    further = _solved(matrix, np.concatenate([-left, np.zeros(len(none))]))  # what soft modes magnified
    added = np.concatenate([carried @ further[len(own) :], compliance * (touching @ further[: len(own)])])
    return forces + further[: len(own)], configuration + added


def _solved(matrix: np.ndarray, given: np.ndarray) -> np.ndarray:
    """The solution, the smallest one where the matrix is singular: springs that cancel, under a load they allow."""
    try:
        return np.linalg.solve(matrix, given)
    except np.linalg.LinAlgError:
        return np.linalg.lstsq(matrix, given, rcond=None)[0]


def _range(matrix: np.ndarray, negligible: float) -> np.ndarray:
    """Orthonormal basis of the column space, singular values up to ``negligible`` taken for zero."""
    if matrix.size == 0:
        return np.zeros((matrix.shape[0], 0))
    left, singular, _ = np.linalg.svd(matrix, full_matrices=False)
    return left[:, singular > negligible]


def _largest_norm(directions: np.ndarray) -> float:
    return float(np.linalg.norm(directions, axis=0).max(initial=0.0))
