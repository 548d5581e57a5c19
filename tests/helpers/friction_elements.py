"""Dry friction |T| <= F as an element made of states alone: a test of what elements can say, not a part of the package.

stick   T = k (h.x - w), rigid: the reaction of h.x = w;   slip +-   T = +-F
"""

import math
from dataclasses import dataclass
from typing import ClassVar

from multiphi_exudyn.mechanics.element import ALWAYS_TAKEN, ElementState, Exit


@dataclass(frozen=True, eq=False)
class Slider:
    """A block with a constant Coulomb limit [N] (rigid), or a Jenkins element (a spring [N/m] in series).

    static_limit: at which it begins to slip, None for the same.
    """

    name: str
    direction: object
    limit: float
    stiffness: float = math.inf
    static_limit: float | None = None
    gap: ClassVar[float] = 0.0
    damping: ClassVar[float] = 0.0
    held: ClassVar[bool] = True

    @property
    def rigid(self) -> bool:
        return math.isinf(self.stiffness)

    @property
    def states(self) -> tuple[ElementState, ...]:
        most = self.static_limit or self.limit
        exits = tuple(Exit(f"slip{s}", force=float(f"{s}1"), constant=most, firmness=ALWAYS_TAKEN) for s in "+-")
        return ElementState("stick", "stick", exits, holds=True), self._slip("+"), self._slip("-")

    def _slip(self, sign: str) -> ElementState:
        s = float(f"{sign}1")
        back = Exit("stick", rate=s, firmness=ALWAYS_TAKEN)
        stretch = 0.0 if self.rigid else s * self.limit / self.stiffness
        return ElementState(f"slip{sign}", "slip", (back,), push=-s * self.limit, stretch=stretch)

    def first_state(self, q: float, rate: float) -> str:
        if not self.rigid or rate == 0:
            return "stick"
        return "slip+" if rate > 0 else "slip-"
