"""Unilateral contact: a gap that may not close further than zero, or only against a stiffness.

    g(x) = h.x + gap,   open where g > 0;   the contact force lambda >= 0 [N] acts along +h.

    rigid      0 <= lambda, g >= 0, lambda g = 0
    compliant  lambda = k max(0, -g)

A stop 1.35 mm below a beam that bends along +z has h = +e_c and gap = 1.35e-3; a stop above it has
h = -e_c; two bodies facing each other have one coefficient each.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.structure import At, is_real

__all__ = ["UnilateralContact"]


@dataclass(frozen=True, eq=False)
class UnilateralContact:
    """One unilateral contact; see the module's docstring for its law.

    name: how levels, events and results refer to it.
    direction: h as a point name, {point: coefficient} or an (n,) row.
    gap: distance [m] in the undeformed structure; negative is a preload.
    stiffness: k [N/m], infinite for a rigid contact.

    Two contacts are equal only if they are the same object.
    """

    name: str
    direction: At
    gap: float
    stiffness: float = math.inf

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name:
            raise MultiPhiTypeError(f"contact name: got {self.name!r}, need a non-empty string")
        for field in ("gap", "stiffness"):
            value = getattr(self, field)
            if not is_real(value):
                raise MultiPhiTypeError(f"contact {self.name!r} {field}: got {value!r}, need a number")
            object.__setattr__(self, field, float(value))
        if not math.isfinite(self.gap):
            raise MultiPhiValueError(f"contact {self.name!r} gap: got {self.gap!r}, need a finite distance")
        if not self.stiffness > 0:
            received = f"contact {self.name!r} stiffness: got {self.stiffness!r}"
            raise MultiPhiValueError(f"{received}, need a value > 0 (or inf, rigid)")

    @property
    def rigid(self) -> bool:
        """True for an infinite stiffness."""
        return math.isinf(self.stiffness)
