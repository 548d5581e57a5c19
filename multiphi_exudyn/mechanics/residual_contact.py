"""Residual contact: a unilateral contact that acts through the flexibility of the modes left out."""

from __future__ import annotations

import functools
from dataclasses import dataclass, fields
from typing import Any

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.element import ElementState, Exit

__all__ = ["ResidualContact"]


@dataclass(frozen=True, eq=False)
class ResidualContact(UnilateralContact):
    """A contact on a residual boundary (core/residual_boundary.hpp): elastic, also where k is infinite.

    The modes left out have no inertia, so it takes no impact: where k is infinite its stiffness is theirs.
    """

    @classmethod
    def of(cls, contact: UnilateralContact) -> ResidualContact:
        """Return a contact on a residual boundary; raise an error for what it cannot have there."""
        refused = {"damping": contact.damping, "friction": contact.most, "restitution": contact.restitution}
        for name, value in refused.items():
            if value:
                raise MultiPhiValueError(
                    f"boundary of {contact.name!r}: got 'residual' beside its {name} {value!r}, need 'own', or none"
                )
        return cls(**_arguments(contact))

    @property
    def own(self) -> UnilateralContact:
        """The same contact with own modes."""
        return UnilateralContact(**_arguments(self))

    @property
    def rigid(self) -> bool:
        """False: it takes no direction from the motion."""
        return False

    @functools.cached_property
    def states(self) -> tuple[ElementState, ...]:
        """States open and closed."""
        closing, opening = Exit("closed", gap=1.0), Exit("open", force=1.0)
        return ElementState("open", "open", (closing,)), ElementState("closed", "close", (opening,), holds=(0,))


def _arguments(contact: UnilateralContact) -> dict[str, Any]:
    return {field.name: getattr(contact, field.name) for field in fields(UnilateralContact)}
