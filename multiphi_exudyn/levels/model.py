"""The reduced model: a structure, its contacts, and the levels they make, built as they are needed."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from multiphi_exudyn.display import Shown, names
from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.levels.build_base import build_base
from multiphi_exudyn.levels.build_level import build_level
from multiphi_exudyn.levels.level import Level
from multiphi_exudyn.levels.level_override import LevelOverride
from multiphi_exudyn.levels.modal_base import ModalBase
from multiphi_exudyn.levels.mode_choice import FIRST, SMALL, TRIED, Tolerance, UpTo, chosen_modes, is_count
from multiphi_exudyn.levels.sliding import sliding
from multiphi_exudyn.levels.static_equilibrium import Equilibrium, equilibrium, floating, pressing
from multiphi_exudyn.mathematics.bounded_cache import BoundedCache
from multiphi_exudyn.mathematics.lowest_modes import left_out
from multiphi_exudyn.mechanics.arguments import one_of
from multiphi_exudyn.mechanics.element import AnyLink, Element
from multiphi_exudyn.mechanics.element_table import ElementTable
from multiphi_exudyn.mechanics.force_law import ForceLaw
from multiphi_exudyn.mechanics.structure import LinearStructure

__all__ = ["MultiPhiModel"]

CACHE_BYTES = 2**30  # that the levels of a model may take, with what is kept beside them: 1 GiB leaves room on a laptop
FEWEST_LEVELS = 8  # kept whatever they take: a run that goes to and fro between a few would build them at every event
WIDER = 2  # models with a base for other loads that a model keeps, each with n numbers for every coordinate
ENTRIES = 64  # of what others have made of a model: sentences on its levels
LOADS = 16  # keys of loads for which a model keeps what simulations have made of its levels; static ones have two


@dataclass(frozen=True, repr=False)
class MultiPhiModel(ElementTable, Shown):
    """Piecewise-linear modal model of a structure with contacts (the Multi-Phi method).

    With c contacts there are 2^c levels; every friction makes three times as many, every force law as many times as it
    has segments. Only those that a run comes to are built, and kept up to 1 GiB, those used most recently. Levels are
    truncated from one larger base: ``dataclasses.replace(model, modes=12)`` builds nothing anew. Where a number of
    modes, or a cut-off, would part modes of one frequency, a level keeps all of them (``Level.kept_beyond``), and a run
    says so.

    Parameters
    ----------
    structure : LinearStructure
        M, C, K and points.
    contacts : sequence of UnilateralContact, Friction and ForceLaw, default ()
        Any number, each with its own name.
    modes : int, "all", UpTo, Tolerance or None, default None
        Number r of modes of every level, all that it has where they are fewer. ``UpTo``: those up to a frequency.
        ``Tolerance``: the first run under ``simulate`` decides, once for this model. None: as many as hold the static
        response of contacts and points, chosen without a run; all of them up to 30 degrees of freedom. ``most_modes``
        tells the number.
    overrides : mapping of (name, ...) to LevelOverride, default empty
        Measured frequencies or ratios of single levels, by the names of their closed contacts.
    validity : callable, default None
        From a trajectory of this model to sentences "kind: ..." on where the linear structure does not hold, none where
        it does; ``simulate`` asks it at the end of a run. None: nothing is known.

    Attributes
    ----------
    loaded : BoundedCache
        Levels under loads, kept for later runs.
    entries : BoundedCache
        What others have made of it, by their keys.

    Raises
    ------
    MultiPhiTypeError
        For arguments of another kind.
    MultiPhiValueError
        For modes < 1, two contacts of one name, a direction that is zero, and points or contacts that there are not.

    Examples
    --------
    >>> import numpy as np
    >>> import multiphi_exudyn as mp
    >>> K = 4e4 * np.array([[2, -1, 0], [-1, 2, -1], [0, -1, 1]])  # N/m
    >>> chain = mp.LinearStructure(np.eye(3), K, mp.ModalDamping(0.01), {"tip": 2})
    >>> stop = mp.UnilateralContact("stop", "tip", gap=1e-3, stiffness=1e6)
    >>> model = mp.MultiPhiModel(chain, [stop])
    >>> model.levels_possible
    2
    >>> print(model.level(("stop",)).frequencies.round(1))
    [ 31.5  54.9 162.4]
    """

    structure: LinearStructure
    contacts: Sequence[Element] = ()
    modes: int | str | UpTo | Tolerance | None = None
    overrides: Mapping[tuple[str, ...], LevelOverride] = field(default_factory=dict)
    validity: Callable[[Any], Sequence[str]] | None = field(default=None, compare=False)
    _shared: dict[Any, Any] = field(default_factory=dict, repr=False, compare=False)
    loaded: BoundedCache[Any, Any] = field(
        init=False, default_factory=lambda: BoundedCache(LOADS), repr=False, compare=False
    )
    entries: BoundedCache[Any, Any] = field(
        init=False, default_factory=lambda: BoundedCache(ENTRIES), repr=False, compare=False
    )
    _decisions: list[MultiPhiModel] = field(init=False, default_factory=list, repr=False, compare=False)
    _wider: BoundedCache[bytes, MultiPhiModel] = field(
        init=False, default_factory=lambda: BoundedCache(WIDER), repr=False, compare=False
    )

    def __post_init__(self) -> None:
        if not isinstance(self.structure, LinearStructure):
            raise MultiPhiTypeError(f"structure: got {type(self.structure).__name__}, need a LinearStructure")
        object.__setattr__(self, "contacts", _contacts(self.contacts))
        names = [contact.name for contact in self.contacts]
        if len(set(names)) < len(names):
            raise MultiPhiValueError(f"contacts: got the names {names}, need each name once")
        for link in self.links:
            if not np.any(_row(self.structure, link)):
                raise MultiPhiValueError(f"contact {link.name!r} direction: got a zero row, need a direction")
        self._check_modes()
        _check_overrides(self.overrides)
        ordered = {tuple(sorted(self.index(name) for name in key)): value for key, value in self.overrides.items()}
        object.__setattr__(self, "overrides", {self._names(key): value for key, value in ordered.items()})
        if not self._can_share():
            object.__setattr__(self, "_shared", self._unbuilt)

    @functools.cached_property
    def base(self) -> ModalBase:
        """Coordinates common to all levels, built on first use."""
        _ = self._chosen if self.modes is None else None  # it may need a larger one
        return self._shared_base()

    def _shared_base(self) -> ModalBase:
        """The base of all models that share levels with this one."""
        if "base" not in self._shared:
            given = self._shared.get("first", FIRST) if self.modes is None else self.most_modes
            less, further = self._shared.pop("less", None), self._shared.get("further")
            self._shared["base"] = build_base(self.structure, self.contacts, given or "all", less, further)
        base: ModalBase = self._shared["base"]
        return base

    @property
    def _unbuilt(self) -> dict[str, Any]:
        """What is shared where levels begin anew: modes that are known of the same structure, and rows of loads."""
        known = {"structure": self.structure, "contacts": self.contacts}
        if self._shared.get("structure") is not self.structure:
            return known
        kept = {name: self._shared[name] for name in ("further", "narrow") if name in self._shared}
        return {**known, **kept, "less": self._shared.get("base", self._shared.get("less"))}

    @staticmethod
    def _serves(base: ModalBase, modes: int | None) -> bool:
        """Whether levels with so many modes may be taken from a base."""
        return base.complete or (modes is not None and modes <= base.served)

    def push(self, states: Sequence[int]) -> np.ndarray:
        """Load (m,) of the constant forces of elements in these states."""
        pushes = [pushed[state] for pushed, state in zip(self.pushes_of_states, states, strict=True)]
        return np.asarray(self.base.directions[:, : len(pushes)] @ pushes)

    @property
    def most_modes(self) -> int | None:
        """The largest number of modes that a level is asked for, chosen where none was given; None: it has all of them.

        Of a Tolerance that has not decided yet it is the number that its runs begin with.
        """
        if self.modes is None:
            return self._chosen
        if self.decided is not None:
            return self.decided.most_modes
        if isinstance(self.modes, str):
            return None
        most = self.modes.most if isinstance(self.modes, (UpTo, Tolerance)) else int(self.modes)
        most = min(most, TRIED) if isinstance(self.modes, Tolerance) else most
        return most if most < self.structure.n else None

    @property
    def _chosen(self) -> int | None:
        """The number of modes where none was given."""
        if self.structure.n <= SMALL:
            return None
        while "chosen" not in self._shared:
            base = self._shared_base()
            found = chosen_modes(self.structure, base, self._with_modes)
            if self._serves(base, found):
                self._shared["chosen"] = found
            else:
                object.__setattr__(self, "_shared", {**self._unbuilt, "first": found})
        chosen: int = self._shared["chosen"]
        return chosen

    @property
    def whole(self) -> bool:
        """Whether no level leaves out a mode of the structure."""
        return self.most_modes is None and not isinstance(self.modes, UpTo) and self.base.complete

    @property
    def decided(self) -> MultiPhiModel | None:
        """Of a model with a Tolerance: the same with the modes that its first run has decided on, None before."""
        return self._decisions[0] if self._decisions else None

    def decide(self, chosen: MultiPhiModel) -> None:
        """Keep what the first run of a model with a Tolerance has decided on."""
        self._decisions[:] = [chosen]

    def holding(self, rows: np.ndarray) -> MultiPhiModel:
        """The model whose base holds these rows (k, n) of loads too: itself, or one that it keeps for later runs."""
        new = self.lacking(rows)
        if not new:
            return self
        further = np.vstack([self.base.further, *new])
        return self._wider.get_or_build(np.array(new).tobytes(), lambda: self._widened(further))

    def lacking(self, rows: np.ndarray) -> list[np.ndarray]:
        """Those of some rows (k, n) for which an incomplete base has not been made, zero ones left out."""
        if self.base.complete:
            return []
        links = [self.structure.row(link.direction) for link in self.links]
        known = np.vstack([self.base.further, self.structure.point_rows, *links])
        return [row for row in rows if np.any(row) and not np.any(np.all(row == known, axis=1))]

    def _widened(self, further: np.ndarray) -> MultiPhiModel:
        """This model with a base that holds further rows (k, n)."""
        wider = replace(self)
        shared = {"further": further, "first": self.base.served, "narrow": self._shared.get("narrow", self)}
        object.__setattr__(wider, "_shared", {**self._unbuilt, **shared})
        return wider

    def widened_to(self, other: MultiPhiModel) -> bool:
        """Whether another model is this one, but for rows of loads that its base holds."""
        return other._shared.get("narrow") is self

    def outside(self, row: np.ndarray) -> float:
        """Share of the static flexibility at a row (n,) that the base does not hold."""
        if self.base.complete:
            return 0.0
        shares: dict[bytes, float] = self._shared.setdefault("outside", {})
        if row.tobytes() not in shares:
            given = self.structure.mass, self.structure.stiffness, self.base.modes
            shares[row.tobytes()] = float(left_out(*given, row[None, :])[0])
        return shares[row.tobytes()]

    @property
    def levels_built(self) -> int:
        """Number of levels built so far, those built again included."""
        return self._levels.kept

    @property
    def levels_kept(self) -> int:
        """Number of levels that are kept."""
        return len(self._levels)

    @property
    def highest_frequency(self) -> float:
        """The highest frequency [Hz] of the levels that are kept."""
        return max((level.highest_frequency for _, level in self._levels.items()), default=0.0)

    @functools.cached_property
    def most_levels(self) -> int:
        """Number of levels that are kept: what ``CACHE_BYTES`` hold, with what is kept beside them."""
        return self._most_kept(self.most_modes or self.base.modes.count)

    def _most_kept(self, r: int) -> int:
        """Number of levels with r modes that ``CACHE_BYTES`` hold."""
        of_a_mode = self._shared_base().modes.count + 30 * r + 2 * len(self.links)
        return max(FEWEST_LEVELS, CACHE_BYTES // (8 * r * of_a_mode))

    @functools.cached_property
    def _levels(self) -> BoundedCache[tuple[int, ...], Level]:
        return BoundedCache(self.most_levels, self._forget)

    def _forget(self, indices: tuple[int, ...], level: Level) -> None:
        """What is made of a level goes with it; a trajectory may still hold the level itself."""
        for _, loaded in self.loaded.items():
            loaded.forget(indices)

    def _facts(self) -> Iterator[tuple[str, str]]:
        yield "degrees of freedom", str(self.structure.n)
        yield "contacts", names([contact.name for contact in self.contacts])
        yield "modes", "to be chosen" if self.modes is None else str(self.modes)
        yield "levels built", f"{self.levels_built} of {self.levels_possible}"

    def index(self, name: str) -> int:
        """Position of a contact."""
        for i, contact in enumerate(self.contacts):
            if contact.name == name:
                return i
        raise MultiPhiValueError(f"contact: got {name!r}, need {one_of(name, (c.name for c in self.contacts))}")

    def level(self, closed: Iterable[str] | Mapping[str, str] = ()) -> Level:
        """The level with these contacts closed, or with elements in these states, built on first use.

        Parameters
        ----------
        closed : iterable of str, or mapping of str to str, default ()
            Names of the closed contacts, all others open, force laws in segment "0". Or {name: state}: "closed" of a
            contact, "stick", "slip+" or "slip-" of friction, "+1", "-1", ... of a force law; the others are in their
            first state, contacts open. States that differ by constant forces alone have one level.

        Raises
        ------
        MultiPhiTypeError
            For what is neither.
        MultiPhiValueError
            For a name or a state that there is not.
        """
        if isinstance(closed, Mapping):
            return self.level_at(self.links_held(self._states(closed)))
        if isinstance(closed, str) or not isinstance(closed, Iterable):
            raise MultiPhiTypeError(f"closed: got {closed!r}, need a tuple of contact names, or {{name: state}}")
        own = {i for i, element in enumerate(self.contacts) if isinstance(element, ForceLaw) and element.stiffness}
        return self.level_at(tuple(sorted({self._closed(name) for name in closed} | own)))

    def _closed(self, name: str) -> int:
        """Position of a contact that is closed, or friction that sticks."""
        i = self.index(name)
        if isinstance(self.contacts[i], ForceLaw):
            raise MultiPhiValueError(f"closed: got the force law {name!r}, need {{{name!r}: segment}}")
        return i

    def _states(self, given: Mapping[str, str]) -> tuple[int, ...]:
        """Numbers of the states of all elements."""
        states = [0] * len(self.contacts)
        for name, state in given.items():
            i = self.index(name)
            known = [own.name for own in self.contacts[i].states]
            if state not in known:
                raise MultiPhiValueError(f"state of {name!r}: got {state!r}, need one of: {', '.join(known)}")
            states[i] = known.index(state)
        return tuple(states)

    def level_at(self, indices: tuple[int, ...]) -> Level:
        """The level of closed contacts given by ascending positions."""
        found = self._levels.find(indices)
        if found is not None:
            return found
        level = self._full(indices)
        level = level.truncated(self._modes_of(level))
        override = self.overrides.get(level.closed)
        return self._levels.keep(indices, sliding(level if override is None else level.overridden(override)))

    def _full(self, indices: tuple[int, ...]) -> Level:
        """A level with at least the modes that this model needs; what other numbers of modes need is shared."""
        return self._with_modes(indices, self.most_modes or self.base.modes.count)

    def _with_modes(self, indices: tuple[int, ...], modes: int) -> Level:
        """A level with its lowest so many modes at least, or all that it has."""
        base = self._shared_base()
        if "levels" not in self._shared:
            self._shared["levels"] = BoundedCache(self._most_kept(modes))
        shared: BoundedCache[tuple[int, ...], Level] = self._shared["levels"]
        most = base.modes.count - sum(base.links[i].rigid for i in indices)
        needed, found, further = min(modes, most), shared.find(indices), 1
        while found is None or (found.modes < most and (found.modes < needed or found.apart(needed) is None)):
            wanted = needed + further
            found = shared.keep(indices, build_level(base, indices, wanted if wanted < most else None))
            further *= 2
        return found

    def static_equilibrium(self, forces: Mapping[str, float], inertia_relief: bool = False) -> np.ndarray:
        """Configuration x (n,) [m, rad] at rest under forces at points, with the right contacts closed.

        The configuration that the contacts admit nearest to the one without them, in the energy of structure and
        contact springs. With force laws or friction it is the equilibrium that is reached when the forces are applied
        slowly; a run that starts there with stretched springs of friction starts from ``equilibrium``.

        Parameters
        ----------
        forces : mapping of str to float
            Point to force [N], along the point's positive displacement.
        inertia_relief : bool, default False
            Of a structure with rigid-body modes: whether the forces may accelerate it. The answer is its deformation,
            M-orthogonal to those modes, with False under forces that balance each other.

        Raises
        ------
        MultiPhiTypeError
            For what is no mapping.
        MultiPhiValueError
            For forces that a structure with rigid-body modes does not balance, or beside its force laws, friction or
            contacts that close; rigid contacts that exclude each other, and points that there are not.
        NumericalFailure
            Where the structure snaps through on the way, friction lets go with a jump, or contacts wedge.

        Examples
        --------
        >>> import numpy as np
        >>> import multiphi_exudyn as mp
        >>> K = 4e4 * np.array([[2, -1, 0], [-1, 2, -1], [0, -1, 1]])  # N/m
        >>> chain = mp.LinearStructure(np.eye(3), K, mp.ModalDamping(0.01), {"tip": 2})
        >>> stop = mp.UnilateralContact("stop", "tip", gap=1e-3, stiffness=1e6)
        >>> model = mp.MultiPhiModel(chain, [stop])
        >>> x = model.static_equilibrium({"tip": 100.0})
        >>> print(1e3 * x)  # mm: three springs of 4e4 N/m in series
        [2.5 5.  7.5]
        """
        return self.equilibrium(forces, inertia_relief).displacement

    def equilibrium(self, forces: Mapping[str, float], inertia_relief: bool = False) -> Equilibrium:
        """``static_equilibrium`` with the stretches of friction's springs, as a start for ``simulate``.

        The arguments and errors are those of ``static_equilibrium``.
        """
        y, stretches = self._at_rest(forces, inertia_relief)
        named = {self.links[k].name: float(stretches[k]) for k in self.held}
        return Equilibrium(self.base.modes.shapes @ y, named)

    def _at_rest(self, forces: Mapping[str, float], inertia_relief: bool) -> tuple[np.ndarray, np.ndarray]:
        """y (m,) and stretches (l,) [m] of links at rest under forces [N] at points."""
        base = self.base
        load = self.base_load(forces)
        if base.modes.rigid:
            if self.force_laws or self.general:
                raise MultiPhiValueError(
                    f"static equilibrium: the open structure has {base.modes.rigid} rigid-body modes beside force laws "
                    "or friction, need none"
                )
            size = np.abs(base.modes.shapes.T) @ np.abs(self._force_row(forces))
            return floating(base, load, size, inertia_relief), np.zeros(len(base.contacts))
        if self.force_laws or self.general:
            return equilibrium(base, load)
        compliance = base.modes.omega**-2.0
        gaps = base.directions.T @ (compliance * load) + base.gaps
        bending = base.directions.T / base.modes.omega
        closed = pressing(np.hstack([bending, np.diag(base.stiffnesses**-0.5)]), -gaps)
        level = build_level(base, tuple(int(i) for i in np.flatnonzero(closed)))
        return level.asymptotic(load).configuration, np.zeros(len(base.contacts))

    def base_load(self, forces: Mapping[str, float]) -> np.ndarray:
        """Forces [N] at points as a load (m,) in base coordinates."""
        return self.base.modes.shapes.T @ self._force_row(forces)

    def _force_row(self, forces: Mapping[str, float]) -> np.ndarray:
        """Forces [N] at points as a load (n,)."""
        if not isinstance(forces, Mapping):
            raise MultiPhiTypeError(f"forces: got {type(forces).__name__}, need {{point: force in N}}")
        return self.structure.row(forces) if forces else np.zeros(self.structure.n)

    def _can_share(self) -> bool:
        """Whether the levels built for another number of modes serve this model too."""
        if self._shared.get("structure") is not self.structure or self._shared["contacts"] != self.contacts:
            return False
        base = self._shared.get("base")
        if base is None or self.modes is None:
            return base is not None
        return self._serves(base, self.most_modes)

    def _names(self, indices: tuple[int, ...]) -> tuple[str, ...]:
        return tuple(self.contacts[i].name for i in indices)

    def _modes_of(self, full: Level) -> int:
        """Number of modes that are asked for of a level that has been built with all it may have."""
        most = min(self.most_modes or full.modes, full.modes)
        if not isinstance(self.modes, UpTo):
            return most
        return min(max(1, int(np.searchsorted(full.frequencies, self.modes.frequency, side="right"))), most)

    def _check_modes(self) -> None:
        if self.modes is None or isinstance(self.modes, (UpTo, Tolerance)) or str(self.modes) == "all":
            return
        needed = "need an integer >= 1, 'all', UpTo, Tolerance or None"
        if not is_count(self.modes):
            raise MultiPhiTypeError(f"modes: got {self.modes!r}, {needed}")
        if int(self.modes) < 1:
            raise MultiPhiValueError(f"modes: got {self.modes}, {needed}")


def _row(structure: LinearStructure, link: AnyLink) -> np.ndarray:
    """The row (n,) of a link's direction; an error names the link."""
    try:
        return structure.row(link.direction)
    except (MultiPhiValueError, MultiPhiTypeError) as error:
        raise type(error)(f"contact {link.name!r}: {error}") from error


def _contacts(given: Any) -> tuple[Element, ...]:
    """Contacts as they are given."""
    needed = "UnilateralContact, Friction or ForceLaw"
    if not isinstance(given, Iterable):
        raise MultiPhiTypeError(f"contacts: got {type(given).__name__}, need a sequence of {needed}")
    items = tuple(given)
    for item in items:
        if not isinstance(item, Element):
            raise MultiPhiTypeError(f"contacts: got {type(item).__name__}, need {needed}")
    return items


def _check_overrides(given: Any) -> None:
    needed = "need {(names of closed contacts, ...): LevelOverride}"
    if not isinstance(given, Mapping):
        raise MultiPhiTypeError(f"overrides: got {type(given).__name__}, {needed}")
    for key, value in given.items():
        if not (isinstance(key, tuple) and isinstance(value, LevelOverride)):
            raise MultiPhiTypeError(f"overrides: got {key!r}: {type(value).__name__}, {needed}")
