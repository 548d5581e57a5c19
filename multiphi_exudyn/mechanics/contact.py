"""Unilateral contact: a gap that may not close further than zero, or only against a stiffness.

    g(x) = h.x + gap,   open where g > 0;   the contact force lambda >= 0 [N] acts along +h.

    rigid      0 <= lambda, g >= 0, lambda g = 0, and where it strikes with g'- < 0: g'+ >= -e g'-  (Moreau)
    compliant  lambda = k max(0, -g)
    viscous    lambda = max(0, k (-g) + c (-g')) where g < 0, else 0

A viscous contact closes when its gap falls through zero and opens when its force returns to zero, which is before its
gap does: it never pulls. Inside its stop it closes again when k (-g) + c (-g') rises through zero. What its damper
takes is damping work, and so is the strain k g^2 / 2 that it still holds where it opens inside (the damper takes that
while the spring relaxes), less what it holds where it closes again inside.

A stop 1.35 mm below a beam that bends along +z has h = +e_c and gap = 1.35e-3; a stop above it has
h = -e_c; two bodies facing each other have one coefficient each.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.mechanics.arguments import is_real
from multiphi_exudyn.mechanics.element import ElementState, contact_states
from multiphi_exudyn.mechanics.structure import At

__all__ = ["UnilateralContact"]


@dataclass(frozen=True, eq=False)
class UnilateralContact:
    """One unilateral contact; see the module's docstring for its law.

    name: how levels, events and results refer to it.
    direction: h as a point name, {point: coefficient} or an (n,) row.
    gap: distance [m] in the undeformed structure; negative is a preload.
    stiffness: k [N/m], infinite for a rigid contact.
    damping: c [N s/m] beside a finite stiffness.
    restitution: e from 0 to 1 of a rigid contact. Those that are struck together, and are coupled, need one e.

    Two contacts are equal only if they are the same object.
    """

    name: str
    direction: At
    gap: float
    stiffness: float = math.inf
    damping: float = 0.0
    restitution: float = 0.0
    velocity: ClassVar[float] = 0.0
    held: ClassVar[bool] = False

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name:
            raise MultiPhiTypeError(f"contact name: got {self.name!r}, need a non-empty string")
        for name in ("gap", "stiffness", "damping", "restitution"):
            value = getattr(self, name)
            if not is_real(value):
                raise MultiPhiTypeError(f"contact {self.name!r} {name}: got {value!r}, need a number")
            object.__setattr__(self, name, float(value))
        if not math.isfinite(self.gap):
            raise MultiPhiValueError(f"contact {self.name!r} gap: got {self.gap!r}, need a finite distance")
        if not self.stiffness > 0:
            received = f"contact {self.name!r} stiffness: got {self.stiffness!r}"
            raise MultiPhiValueError(f"{received}, need a value > 0 (or inf, rigid)")
        if not (math.isfinite(self.damping) and self.damping >= 0):
            raise MultiPhiValueError(f"contact {self.name!r} damping: got {self.damping!r}, need a finite value >= 0")
        if self.rigid and self.damping:
            received = f"contact {self.name!r} damping: got {self.damping!r} beside an infinite stiffness"
            raise MultiPhiValueError(f"{received}, need a finite stiffness")

        if not 0 <= self.restitution <= 1:
            received = f"contact {self.name!r} restitution: got {self.restitution!r}"
            raise MultiPhiValueError(f"{received}, need a value from 0 to 1")
        if self.restitution and not self.rigid:
            received = f"contact {self.name!r} restitution: got {self.restitution!r} beside a finite stiffness"
            raise MultiPhiValueError(f"{received}, need an infinite one: a spring loses nothing, its damper does")

    @property
    def rigid(self) -> bool:
        """True for an infinite stiffness."""
        return math.isinf(self.stiffness)

    @property
    def states(self) -> tuple[ElementState, ...]:
        """Open and closed (element.py)."""
        return contact_states(self.rigid, self.damping > 0)

    def first_state(self, gap: float, rate: float) -> str:
        """The state in which a run starts that begins with a gap [m], zero where it is round-off, and its rate [m/s].

        A rigid contact starts open, and closes at once where it is pressed on; a viscous one never pulls.
        """
        pulls = self.damping > 0 and self.stiffness * gap + self.damping * rate > 0
        return "open" if gap >= 0 or self.rigid or pulls else "closed"
