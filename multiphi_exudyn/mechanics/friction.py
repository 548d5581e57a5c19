"""Dry friction with a constant limit: a block on a counter-surface, or a Jenkins element, a spring in series with it.

    T = k (h.x - w - v t)   while it sticks, |T| <= static limit; without a spring h.x - w - v t = 0, T its reaction
    T = +-limit             while it slips, against the slip of the patch: s = sign of h.x' - v = sign of T

The force on the structure is -h T. w is the position of the contact patch on the counter-surface, which moves with the
velocity v along +h. Stick ends when |T| reaches the static limit; slip ends when its velocity falls to zero.

Source: W. D. Iwan, A distributed-element model for hysteresis and its steady-state dynamic response, Trans. ASME
J. Appl. Mech. 33 (1966).
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import ClassVar

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.mechanics.arguments import is_real
from multiphi_exudyn.mechanics.element import ALWAYS_TAKEN, TAKEN_ONCE, ElementState, Exit, Link
from multiphi_exudyn.mechanics.structure import At

__all__ = ["Friction"]


@dataclass(frozen=True, eq=False)
class Friction:
    """Dry friction with a constant limit: a block on a counter-surface, or with a spring in series a Jenkins element.

        stick   T = k (h.x - w - v t), or the reaction;  |T| <= static limit
        slip    T = s limit,  s the sign of h.x' - v

    The force on the structure is -h T; w is the position of the contact patch on the counter-surface. Without a spring
    the point sticks, h.x - w - v t = 0, and T is the reaction. Stick ends when |T| reaches the static limit, slip when
    its velocity falls to zero. Two frictions are equal only if they are the same object. Source: W. D. Iwan, Trans.
    ASME J. Appl. Mech. 33 (1966).

    Parameters
    ----------
    name : str
        Name in levels, events and results.
    direction : str, mapping or array (n,)
        h, direction of the friction: a point name, {point: coefficient} or a row.
    limit : float
        |T| [N] during slip, > 0.
    static_limit : float, default None
        |T| [N] at which slip begins, >= limit; None: limit.
    stiffness : float, default inf
        k [N/m] of the spring in series, > 0; infinite for none.
    velocity : float, default 0.0
        v [m/s] of the counter-surface along +h.

    Raises
    ------
    MultiPhiTypeError
        For a name that is not a string, and values that are not numbers.
    MultiPhiValueError
        For numbers out of these ranges.

    Examples
    --------
    >>> import numpy as np
    >>> import multiphi_exudyn as mp
    >>> K = 4e4 * np.array([[2, -1, 0], [-1, 2, -1], [0, -1, 1]])  # N/m
    >>> chain = mp.LinearStructure(np.eye(3), K, mp.ModalDamping(0.01), {"tip": 2})
    >>> model = mp.MultiPhiModel(chain, [mp.Friction("ring", "tip", limit=20.0)])
    >>> tr = mp.simulate(model, 0.5, displacement=np.array([2.5, 5.0, 7.5]) * 1e-3)
    >>> tr.events[-1].kind, round(1e3 * tr.slip("ring", 0.5), 1)  # mm from where it started
    ('stick', -6.9)
    """

    name: str
    direction: At
    limit: float
    static_limit: float | None = None
    stiffness: float = math.inf
    velocity: float = 0.0
    gap: ClassVar[float] = 0.0
    damping: ClassVar[float] = 0.0
    held: ClassVar[bool] = True
    further: ClassVar[tuple[Link, ...]] = ()

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name:
            raise MultiPhiTypeError(f"friction name: got {self.name!r}, need a non-empty string")
        for name in ("limit", "static_limit", "stiffness", "velocity"):
            value = getattr(self, name)
            if value is None and name == "static_limit":
                continue
            if not is_real(value):
                raise MultiPhiTypeError(f"friction {self.name!r} {name}: got {value!r}, need a number")
            object.__setattr__(self, name, float(value))
        if not (math.isfinite(self.limit) and self.limit > 0):
            raise MultiPhiValueError(f"friction {self.name!r} limit: got {self.limit!r}, need a finite force > 0")
        if not (math.isfinite(self.most) and self.most >= self.limit):
            received = f"friction {self.name!r} static_limit: got {self.static_limit!r}"
            raise MultiPhiValueError(f"{received}, need a finite force >= the limit {self.limit!r}")
        if not self.stiffness > 0:
            received = f"friction {self.name!r} stiffness: got {self.stiffness!r}"
            raise MultiPhiValueError(f"{received}, need a value > 0 (or inf, without a spring)")
        if not math.isfinite(self.velocity):
            raise MultiPhiValueError(f"friction {self.name!r} velocity: got {self.velocity!r}, need a finite speed")

    @property
    def most(self) -> float:
        """|T| [N] at which slip begins."""
        return self.limit if self.static_limit is None else self.static_limit

    @property
    def drop(self) -> float:
        """Part of the spring's energy that is lost when slip begins."""
        return 1 - (self.limit / self.most) ** 2

    @property
    def rigid(self) -> bool:
        """True without a spring in series."""
        return math.isinf(self.stiffness)

    @functools.cached_property
    def states(self) -> tuple[ElementState, ...]:
        """Stick, slip+ and slip-."""
        exits = tuple(Exit(f"slip{s}", force=float(f"{s}1"), constant=self.most, firmness=ALWAYS_TAKEN) for s in "+-")
        return ElementState("stick", "stick", exits, holds=(0,)), self._slip("+"), self._slip("-")

    def _slip(self, sign: str) -> ElementState:
        s = float(f"{sign}1")
        back = Exit("stick", rate=s, firmness=TAKEN_ONCE)
        stretch = 0.0 if self.rigid else s * self.limit / self.stiffness
        return ElementState(f"slip{sign}", "slip", (back,), push=-s * self.limit, stretch=stretch)

    def first_state(self, q: float, rate: float, *rates: float) -> str:
        """Stick with a spring or without relative velocity [m/s]; else slip, in the direction of this velocity."""
        if not self.rigid or rate == 0:
            return "stick"
        return "slip+" if rate > 0 else "slip-"
