"""Model histories: points, contacts and frictions of a model by their names, as rows of its levels."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping

import numpy as np

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.events.excitation.loaded_level import LoadedLevel
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mechanics.elements.contact import UnilateralContact
from multiphi_exudyn.mechanics.elements.friction import Friction
from multiphi_exudyn.mechanics.structures.structure import At
from multiphi_exudyn.time.segments.level_rows import force_row, gap_row, patch_row, point_row, pressing_row
from multiphi_exudyn.time.trajectory.histories import Histories
from multiphi_exudyn.time.warnings.base_warnings import row_warnings
from multiphi_exudyn.time.warnings.warning_groups import issue

__all__ = ["ModelHistories"]

ROWS = {  # of a level, for an element's position
    "gap": gap_row,
    "contact_force": pressing_row,
    "contact_impulse": pressing_row,
    "friction_force": force_row,
    "slip": patch_row,
}


class ModelHistories(Histories):
    """Histories of a motion of ``model`` by names."""

    model: MultiPhiModel

    @property
    def points(self) -> tuple[str, ...]:
        """Names of the structure's points."""
        return tuple(self.model.structure.points)

    @property
    def contacts(self) -> tuple[str, ...]:
        """Names of the model's contacts."""
        return tuple(contact.name for contact in self.model.contacts if isinstance(contact, UnilateralContact))

    @property
    def frictions(self) -> tuple[str, ...]:
        """Names of the model's frictions."""
        return tuple(contact.name for contact in self.model.contacts if isinstance(contact, Friction))

    @property
    def rubbing(self) -> tuple[str, ...]:
        """Names of the model's contacts that have friction."""
        names = [self.model.contacts[i].name for i in self.model.rubbing]
        return tuple(name for name in names if name in self.contacts)

    def _row(self, quantity: str, name: At) -> Callable[[LoadedLevel], np.ndarray]:
        if quantity == "at":
            if not isinstance(name, (str, Mapping)):
                issue(row_warnings(self.model, self.model.structure.row(name)))
            return functools.partial(point_row, self.model.base.modes.shapes.T @ self.model.structure.row(name))
        row = ROWS[quantity]
        place = self._friction if quantity in ("friction_force", "slip") else self._contact
        return functools.partial(row, place(quantity, str(name)))

    def _holds(self, quantity: str, name: str) -> Callable[[LoadedLevel], bool]:
        if quantity == "stick_intervals":
            places = self.model.link_indices[self._friction(quantity, name)]
            links = [k for k in places if self.model.links[k].held]
        else:
            links = self.model.pressing_links(self._contact(quantity, name))
        return lambda level: not set(links).isdisjoint(level.level.indices)

    def _motion(self, level: LoadedLevel, xi: np.ndarray) -> np.ndarray:
        return np.linalg.multi_dot([self.model.base.modes.shapes, level.level.vectors, xi])

    def _asymptotic(self, level: LoadedLevel) -> np.ndarray:
        return np.asarray(self.model.base.modes.shapes @ level.asymptotic.configuration)

    def _contact(self, quantity: str, name: str) -> int:
        """Index of a contact or force law."""
        i = self.model.index(name)
        if isinstance(self.model.contacts[i], Friction):
            raise MultiPhiValueError(
                f"{quantity}: got the friction {name!r}, need a contact (friction_force, slip, stick_intervals)"
            )
        return i

    def _friction(self, quantity: str, name: str) -> int:
        """Index of an element with friction."""
        i = self.model.index(name)
        if not any(self.model.links[k].held for k in self.model.link_indices[i]):
            raise MultiPhiValueError(f"{quantity}: got {name!r}, which has no friction, need the name of one that has")
        return i
