"""The reduced model: a structure, its contacts, and the levels they make, built as they are needed."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from multiphi_exudyn.display import Shown, names
from multiphi_exudyn.errors import MultiPhiTypeError
from multiphi_exudyn.levels.equilibrium_under_forces import at_rest
from multiphi_exudyn.levels.level import Level
from multiphi_exudyn.levels.level_override import LevelOverride
from multiphi_exudyn.levels.level_store import LevelStore
from multiphi_exudyn.levels.mode_choice import Tolerance, UpTo
from multiphi_exudyn.levels.model_arguments import check_directions, check_modes, check_overrides, checked_contacts
from multiphi_exudyn.levels.shared_base import SharedBase
from multiphi_exudyn.levels.sliding import sliding
from multiphi_exudyn.levels.static_equilibrium import Equilibrium
from multiphi_exudyn.mathematics.bounded_cache import BoundedCache
from multiphi_exudyn.mechanics.element import Element
from multiphi_exudyn.mechanics.structure import LinearStructure

__all__ = ["MultiPhiModel"]

WIDER = 2  # models with a base for other loads that a model keeps, each with n numbers for every coordinate
ENTRIES = 64  # of what others have made of a model: sentences on its levels
LOADS = 16  # keys of loads for which a model keeps what simulations have made of its levels; static ones have two


@dataclass(frozen=True, repr=False)
class MultiPhiModel(SharedBase, Shown):
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
    _store: LevelStore | None = field(default=None, repr=False, compare=False)
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
        object.__setattr__(self, "contacts", checked_contacts(self.contacts))
        check_directions(self.structure, self.links)
        check_modes(self.modes)
        check_overrides(self.overrides)
        ordered = {tuple(sorted(self.index(name) for name in key)): value for key, value in self.overrides.items()}
        object.__setattr__(
            self, "overrides", {tuple(self.contacts[i].name for i in key): value for key, value in ordered.items()}
        )
        if not self._can_share():
            self._begin_anew()

    def push(self, states: Sequence[int]) -> np.ndarray:
        """Load (m,) of the constant forces of elements in these states."""
        pushes = [pushed[state] for pushed, state in zip(self.pushes_of_states, states, strict=True)]
        return np.asarray(self.base.directions[:, : len(pushes)] @ pushes)

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

    def _widened(self, further: np.ndarray) -> MultiPhiModel:
        """This model with a base that holds further rows (k, n)."""
        wider = replace(self)
        store = wider._begin_anew()
        store.further, store.first, store.narrow = further, self.base.served, self._shared.narrow or self
        return wider

    def widened_to(self, other: MultiPhiModel) -> bool:
        """Whether another model is this one, but for rows of loads that its base holds."""
        return other._shared.narrow is self

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
        """Number of levels that are kept: those of its size that a store holds."""
        modes = self.most_modes or self.base.modes.count
        self._shared_base()
        return self._shared.most_kept(modes)

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
        chosen = f"{self.most_modes or 'all'}, chosen" if self.levels_built else "chosen at first use"
        yield "modes", chosen if self.modes is None else str(self.modes)
        yield "levels built", f"{self.levels_built} of {self.levels_possible}"

    def level(self, closed: Iterable[str] | Mapping[str, str] = ()) -> Level:
        """The level with these contacts closed, or with elements in these states, built on first use.

        Parameters
        ----------
        closed : iterable of str, or mapping of str to str, default ()
            Names of the closed contacts, all others open, force laws in segment "0". Or {name: state}: "closed" of a
            contact, "stick", "slip+" or "slip-" of friction, "idle" where it gives way and others stick for it, "+1",
            "-1", ... of a force law; the others are in their first state, contacts open. States that differ by constant
            forces alone have one level.

        Raises
        ------
        MultiPhiTypeError
            For what is neither.
        MultiPhiValueError
            For a name or a state that there is not.
        """
        if isinstance(closed, Mapping):
            return self.level_at(self.active_links(self.states_named(closed)))
        if isinstance(closed, str) or not isinstance(closed, Iterable):
            raise MultiPhiTypeError(f"closed: got {closed!r}, need a tuple of contact names, or {{name: state}}")
        return self.level_at(self.links_named(closed))

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
        modes = self.most_modes or self.base.modes.count
        self._shared_base()
        return self._shared.level(indices, modes)

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
        base, load = self.base, self._force_row(forces)
        size = np.abs(base.modes.shapes.T) @ np.abs(load)
        y, stretches = at_rest(base, base.modes.shapes.T @ load, size, inertia_relief)
        named = {self.links[k].name: float(stretches[k]) for k in self.held}
        return Equilibrium(base.modes.shapes @ y, named)

    def base_load(self, forces: Mapping[str, float]) -> np.ndarray:
        """Forces [N] at points as a load (m,) in base coordinates."""
        return self.base.modes.shapes.T @ self._force_row(forces)

    def _force_row(self, forces: Mapping[str, float]) -> np.ndarray:
        """Forces [N] at points as a load (n,)."""
        if not isinstance(forces, Mapping):
            raise MultiPhiTypeError(f"forces: got {type(forces).__name__}, need {{point: force in N}}")
        return self.structure.row(forces) if forces else np.zeros(self.structure.n)

    def _modes_of(self, full: Level) -> int:
        """Number of modes that are asked for of a level that has been built with all it may have."""
        most = min(self.most_modes or full.modes, full.modes)
        if not isinstance(self.modes, UpTo):
            return most
        return min(max(1, int(np.searchsorted(full.frequencies, self.modes.frequency, side="right"))), most)
