"""The reduced model: a structure, its contacts, and the levels they make, built as they are needed."""

from __future__ import annotations

import functools
import math
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

import multiphi_exudyn._core as core
from multiphi_exudyn.display import Shown, names
from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError, MultiPhiWarning
from multiphi_exudyn.levels.base.stiffness_warnings import stiffness_warnings
from multiphi_exudyn.levels.equilibrium.equilibrium_under_forces import equilibrium_under_forces
from multiphi_exudyn.levels.equilibrium.static_equilibrium import Equilibrium
from multiphi_exudyn.levels.level.level import Level
from multiphi_exudyn.levels.level.level_override import LevelOverride
from multiphi_exudyn.levels.model.level_store import LevelStore
from multiphi_exudyn.levels.model.mode_choice import Tolerance, UpTo
from multiphi_exudyn.levels.model.model_arguments import (
    check_directions,
    check_modes,
    check_overrides,
    checked_contacts,
    on_boundaries,
)
from multiphi_exudyn.levels.model.shared_base import SharedBase
from multiphi_exudyn.mathematics.bounded_cache import BoundedCache
from multiphi_exudyn.mechanics.element import Element
from multiphi_exudyn.mechanics.residual_contact import ResidualContact
from multiphi_exudyn.mechanics.structure import LinearStructure

__all__ = ["MultiPhiModel"]

CALLER = 3  # level of the stack: the line that asks for an equilibrium
WIDER = 2  # cached models with a base for other loads, each with n numbers for every coordinate
MODAL_LEVELS = "modal_levels"  # the name of what a copy does not take along
ENTRIES = 64  # cached results that other modules derive from a model, such as sentences on its levels
LOADS = 16  # cached sets of levels under loads, one for each key; static loads have two


@dataclass(frozen=True, repr=False)
class MultiPhiModel(SharedBase, Shown):
    """Piecewise-linear modal model of a structure with contacts (the Multi-Phi method).

    With c contacts there are 2^c levels; every friction makes three times as many, every force law as many times as it
    has segments. Only those that a run enters are built; the most recently used are cached, up to 1 GiB. Levels are
    truncated from one larger base: ``dataclasses.replace(model, modes=12)`` builds nothing anew. Where a number of
    modes, or a cut-off, would part modes of one frequency, a level keeps all of them (``Level.kept_beyond``), and a run
    warns.

    Parameters
    ----------
    structure : LinearStructure
        M, C, K and points.
    contacts : sequence of UnilateralContact, Friction and ForceLaw, default ()
        Any number, each with its own name.
    modes : int, "all", UpTo, Tolerance or None, default None
        Number r of modes of every level, all of them where there are fewer. ``UpTo``: those up to a frequency.
        ``Tolerance``: the number is found by the first run under ``simulate``, once for this model. None: as many as
        represent the static response of contacts and points, chosen without a run; all of them up to 30 degrees of
        freedom. ``most_modes`` is the number.
    overrides : mapping of (name, ...) to LevelOverride, default empty
        Measured frequencies or ratios of single levels, by the names of their closed contacts.
    validity : callable, default None
        Function of a trajectory of this model that returns sentences "kind: ..." on where the linear structure is not
        valid, none where it is; ``simulate`` calls it at the end of a run. None: no check.
    boundary : "own", "residual", None, or mapping of contact name to one of these, default None
        How contacts act in levels. "own": every level has its own modes, for which a closed contact is a spring or a
        constraint. "residual": levels keep the modes of the level with these contacts open, and a closed contact acts
        through the flexibility of the modes left out, 1/k + F. Then statics are exact for any number of modes, a rigid
        contact is an elastic one of stiffness 1/F without impacts, and a level is an r x r change of one basis.
        Contacts without friction, damping and restitution can be "residual". None: "residual" where a structure of
        more than 600 degrees of freedom has 24 such contacts or more and its levels are truncated, else "own";
        ``boundaries`` is what was chosen.

    Attributes
    ----------
    loaded : BoundedCache
        Levels under loads, cached for later runs.
    entries : BoundedCache
        Results that other modules derive from the model, by key.

    Raises
    ------
    MultiPhiTypeError
        For arguments of another type.
    MultiPhiValueError
        For modes < 1, two contacts of one name, a zero direction, and unknown points or contacts.

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
    boundary: str | Mapping[str, str | None] | None = None
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
        object.__setattr__(
            self,
            "contacts",
            on_boundaries(checked_contacts(self.contacts), self.boundary, self.modes, self.structure.n),
        )
        if self.overrides and self.residual:
            raise MultiPhiValueError("overrides: got some beside a residual boundary, need own modes at all contacts")
        check_directions(self.structure, self.links)
        check_modes(self.modes)
        check_overrides(self.overrides)
        ordered = {tuple(sorted(self.index(name) for name in key)): value for key, value in self.overrides.items()}
        object.__setattr__(
            self, "overrides", {tuple(self.contacts[i].name for i in key): value for key, value in ordered.items()}
        )
        earlier = self._store
        if not self._can_share():
            store = self._new_store()
            if earlier is not None and self._differs_in_gaps_from(earlier):
                store.borrow(earlier)

    def push(self, states: Sequence[int]) -> np.ndarray:
        """Return the load (m,) of the constant forces of elements in these states."""
        pushes = [forces[state] for forces, state in zip(self.pushes_of_states, states, strict=True)]
        return np.asarray(self.base.directions[:, : len(pushes)] @ pushes)

    @property
    def boundaries(self) -> dict[str, str]:
        """How every contact acts in levels, "own" or "residual", by name."""
        return {c.name: "residual" if isinstance(c, ResidualContact) else "own" for c in self.contacts}

    @property
    def decided(self) -> MultiPhiModel | None:
        """For a model with a Tolerance the model with the modes that its first run has found, None before."""
        return self._decisions[0] if self._decisions else None

    def decide(self, chosen: MultiPhiModel) -> None:
        """Store the model that the first run of a model with a Tolerance has found."""
        self._decisions[:] = [chosen]

    def holding(self, rows: np.ndarray) -> MultiPhiModel:
        """Return the model whose base also represents load rows (k, n): this one, or a cached wider one."""
        missing = self.lacking(rows)
        if not missing:
            return self
        load_rows = np.vstack([self.base.load_rows, *missing])
        return self._wider.get_or_build(np.array(missing).tobytes(), lambda: self._widened(load_rows))

    def _widened(self, load_rows: np.ndarray) -> MultiPhiModel:
        """Return this model with a base that also represents load rows (k, n)."""
        wider = replace(self)
        store = wider._new_store()
        store.load_rows, store.first = load_rows, self.base.most_level_modes
        store.narrow = self._shared_store.narrow or self
        return wider

    def widened_to(self, other: MultiPhiModel) -> bool:
        """Return whether another model is this one with a base for further loads."""
        return other._shared_store.narrow is self

    @property
    def levels_built(self) -> int:
        """Number of levels built so far, including those built again."""
        return self.modal_levels.built if MODAL_LEVELS in vars(self) else 0  # no display of a model builds its base

    @property
    def levels_kept(self) -> int:
        """Number of levels that are kept."""
        return self.modal_levels.count if MODAL_LEVELS in vars(self) else 0

    @property
    def highest_frequency(self) -> float:
        """Highest frequency [Hz] of the levels that are kept."""
        return self.modal_levels.highest_frequency if MODAL_LEVELS in vars(self) else 0.0

    @functools.cached_property
    def most_levels(self) -> int:
        """Largest number of levels that are kept."""
        modes = self.most_modes or self.base.modes.count
        self._shared_base()
        return self._shared_store.cache_capacity(modes)

    @functools.cached_property
    def modal_levels(self) -> core.ModalLevels:
        """The levels in the core, each built on first use."""
        if self.overrides:
            return self._new_modal_levels()
        kept = self.most_modes, getattr(self.modes, "frequency", None)
        return self._shared_store.levels_of(kept, self._new_modal_levels)

    def _new_modal_levels(self) -> core.ModalLevels:
        highest = self.modes.frequency if isinstance(self.modes, UpTo) else math.inf
        measured = [(list(self.links_named(closed)), *given.arrays) for closed, given in self.overrides.items()]
        levels = core.ModalLevels(self.base.core_base, self.most_modes, highest, measured)
        levels.set_most(self.most_levels)
        return levels

    def __getstate__(self) -> dict[str, Any]:
        return {key: value for key, value in vars(self).items() if key != MODAL_LEVELS}  # a copy builds its own

    def _facts(self) -> Iterator[tuple[str, str]]:
        yield "degrees of freedom", str(self.structure.n)
        yield "contacts", names([contact.name for contact in self.contacts])
        chosen = f"{self.most_modes or 'all'}, chosen" if self.levels_built else "chosen at first use"
        yield "modes", chosen if self.modes is None else str(self.modes)
        yield "levels built", f"{self.levels_built} of {self.levels_possible}"

    def level(self, closed: Iterable[str] | Mapping[str, str] = ()) -> Level:
        """Return the level with these contacts closed, or with elements in these states, built on first use.

        Parameters
        ----------
        closed : iterable of str, or mapping of str to str, default ()
            Names of the closed contacts, all others open, force laws in segment "0". Or {name: state}: "closed" of a
            contact, "stick", "slip+" or "slip-" of friction, "idle" where it does not act and others stick in its
            place, "+1", "-1", ... of a force law; the others are in their first state, contacts open. States that
            differ by constant forces alone have one level.

        Raises
        ------
        MultiPhiTypeError
            For another type.
        MultiPhiValueError
            For an unknown name or state.
        """
        if isinstance(closed, Mapping):
            return self.level_at(self.active_links(self.states_named(closed)))
        if isinstance(closed, str) or not isinstance(closed, Iterable):
            raise MultiPhiTypeError(f"closed: got {closed!r}, need a tuple of contact names, or {{name: state}}")
        return self.level_at(self.links_named(closed))

    def level_at(self, indices: tuple[int, ...]) -> Level:
        """Return the level of closed contacts given by ascending positions."""
        return Level(self.base, self.modal_levels.level(list(indices)))

    def static_equilibrium(self, forces: Mapping[str, float], inertia_relief: bool = False) -> np.ndarray:
        """Return the equilibrium x (n,) [m, rad] under forces at points, with the contacts that close.

        With contacts alone it is the admissible configuration nearest to the one without contacts, in the energy of
        structure and contact springs. With force laws or friction it is the equilibrium that is reached when the forces
        are applied slowly; a run that starts there with stretched springs of friction starts from ``equilibrium``.

        Parameters
        ----------
        forces : mapping of str to float
            Point to force [N], along the point's positive displacement.
        inertia_relief : bool, default False
            For a structure with rigid-body modes: whether the forces may accelerate it; the result is its deformation,
            M-orthogonal to those modes. With False they have to balance each other, or its contacts have to carry them:
            then it rests on these, without moving in directions that neither forces nor contacts determine.

        Raises
        ------
        MultiPhiTypeError
            For forces that are no mapping.
        MultiPhiValueError
            For a structure with rigid-body modes under unbalanced forces that its contacts cannot carry, under balanced
            ones that press it on contacts, or with force laws or friction; for rigid contacts that exclude each other,
            and for unknown points.
        NumericalFailure
            Where the structure snaps through on the way, friction slips with a jump, or contacts wedge.

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
        return np.asarray(self.base.modes.shapes @ self._equilibrium(forces, inertia_relief)[0])

    def equilibrium(self, forces: Mapping[str, float], inertia_relief: bool = False) -> Equilibrium:
        """Return ``static_equilibrium`` with the stretches of friction springs, as a start for ``simulate``.

        The arguments and errors are those of ``static_equilibrium``.
        """
        y, stretches = self._equilibrium(forces, inertia_relief)
        return Equilibrium.of(self.base, y, {self.links[k].name: float(stretches[k]) for k in self.held})

    def _equilibrium(self, forces: Mapping[str, float], inertia_relief: bool) -> tuple[np.ndarray, np.ndarray]:
        """Return y (m,) and the stretches (l,) [m] of links in equilibrium under forces at points."""
        base, load = self.base, self._force_row(forces)
        if base.modes.rigid:
            for sentence in self.stiffness_warnings():
                warnings.warn(sentence, MultiPhiWarning, CALLER)
        size = np.abs(base.modes.shapes.T) @ np.abs(load)
        return equilibrium_under_forces(base, base.modes.shapes.T @ load, size, inertia_relief)

    def stiffness_warnings(self) -> tuple[str, ...]:
        """Return warnings of what the digits of the stiffness leave open of the structure's modes."""
        return tuple(stiffness_warnings(self.structure.stiffness, self.base.structure_modes))

    def base_load(self, forces: Mapping[str, float]) -> np.ndarray:
        """Return forces [N] at points as a load (m,) in base coordinates."""
        return self.base.modes.shapes.T @ self._force_row(forces)

    def _force_row(self, forces: Mapping[str, float]) -> np.ndarray:
        """Return forces [N] at points as a load (n,)."""
        if not isinstance(forces, Mapping):
            raise MultiPhiTypeError(f"forces: got {type(forces).__name__}, need {{point: force in N}}")
        return self.structure.row(forces) if forces else np.zeros(self.structure.n)
