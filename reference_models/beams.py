"""Planar beams side by side: along x, bending along z, each clamped on its own, some tied to each other.

The point "tip" of the beam "a" is "a.tip"; a beam that is alone may go without a name, its points then keep theirs.
Where the beams lie in space plays no part: contacts and ties see deflections only.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.mechanics.assembly import Tie
from multiphi_exudyn.mechanics.beam import Beam

__all__ = ["NAMELESS", "Beams", "as_beams"]

NAMELESS = ""
TIED = 2  # points of a tie at most: one to the ground, or two to each other


@dataclass(frozen=True)
class Beams:
    """parts: beams by name. ties: each {point: coefficient} of one or two points, whose sum is held at zero."""

    parts: Mapping[str, Beam]
    ties: tuple[Tie, ...] = field(default=())

    def __post_init__(self) -> None:
        if not self.parts or (NAMELESS in self.parts and len(self.parts) > 1):
            raise MultiPhiValueError(f"beams: got the names {list(self.parts)}, need one or more, none empty")
        for i, tie in enumerate(self.ties):
            self._check_tie(f"ties[{i}]", tie)

    @property
    def only(self) -> Beam | None:
        """The beam without a name, if there is one."""
        return self.parts.get(NAMELESS)

    @property
    def points(self) -> dict[str, tuple[str, float]]:
        """Name -> (beam, x [m])."""
        return {
            f"{name}.{point}" if name else point: (name, x)
            for name, beam in self.parts.items()
            for point, x in beam.points.items()
        }

    def check_point(self, what: str, point: object) -> str:
        """The name of a point there is; raises MultiPhiValueError that calls it ``what`` for any other."""
        if not isinstance(point, str) or point not in self.points:
            known = ", ".join(sorted(self.points)) or "none"
            raise MultiPhiValueError(f"{what}: got {point!r}, need one of: {known}")
        return point

    def _check_tie(self, what: str, tie: Tie) -> None:
        for point in tie:
            self.check_point(what, point)
        if not 1 <= len(tie) <= TIED or not all(math.isfinite(c) and c != 0 for c in tie.values()):
            raise MultiPhiValueError(f"{what}: got {dict(tie)}, need one or two points, coefficients finite, not zero")


def as_beams(given: Beam | Beams) -> Beams:
    """A beam alone as beams; beams as they are."""
    return given if isinstance(given, Beams) else Beams({NAMELESS: given})
