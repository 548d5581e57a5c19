"""Contacts of an Exudyn system, as mp.UnilateralContact: gaps, and rows of their derivatives by the coordinates.

    gap = gap_0 + row . (q - q_0)

This is exact for ObjectContactCoordinate and limit stops. A contact of spheres keeps the direction of the current
state: n (d x_1 / d q - d x_0 / d q), n the normal and x_0, x_1 the centres; its rotation is checked after every run
(linear_range.py).
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any

import exudyn as exu
import numpy as np

from multiphi_exudyn.exudyn_plugin.convert.contacts.point_rows import coordinate_row, gap_row
from multiphi_exudyn.exudyn_plugin.convert.items.items import has_limit_stops, is_sphere_contact
from multiphi_exudyn.exudyn_plugin.convert.linearisation.full_system import sphere_gap
from multiphi_exudyn.exudyn_plugin.convert.linearisation.linearisation import Sphere
from multiphi_exudyn.mechanics.elements.contact import UnilateralContact

__all__ = ["contact_distance", "contacts_of", "spheres_of"]


def contact_distance(mbs: Any, index: int, item: Mapping[str, Any]) -> float:
    """Gap [m] of a contact, or the displacement [m] of a limit stop."""
    outputs = exu.OutputVariableType
    variable = outputs.Displacement if has_limit_stops(item) else outputs.Distance
    variable = outputs.DisplacementLocal if is_sphere_contact(item) else variable
    return float(mbs.GetObjectOutput(exu.ObjectIndex(index), variable))


def contacts_of(mbs: Any, index: int, item: Mapping[str, Any], distance: float) -> Iterator[UnilateralContact]:
    """Contacts of an object, their directions as rows (n_full,)."""
    if not has_limit_stops(item):
        law = float(item["contactStiffness"]), float(item["contactDamping"])
        yield UnilateralContact(item["name"], _direction(mbs, index, item), distance, *law)
        return
    first, second = (coordinate_row(mbs, exu.MarkerIndex(m)) for m in item["markerNumbers"])
    row = item["factor1"] * second - item["factor0"] * first
    law = float(item["limitStopsStiffness"]), float(item["limitStopsDamping"])
    yield UnilateralContact(f"{item['name']}.upper", -row, item["limitStopsUpper"] - distance, *law)
    yield UnilateralContact(f"{item['name']}.lower", row, distance - item["limitStopsLower"], *law)


def _direction(mbs: Any, index: int, item: Mapping[str, Any]) -> np.ndarray:
    """Row (n_full,) of the gap of a contact."""
    if is_sphere_contact(item):
        return gap_row(mbs, exu.ObjectIndex(index))
    first, second = (coordinate_row(mbs, exu.MarkerIndex(m)) for m in item["markerNumbers"])
    return second - first


def spheres_of(mbs: Any, objects: Sequence[Mapping[str, Any]], contacts: Collection[str]) -> dict[str, Sphere]:
    """Contacts of spheres that are part of the model, by name, at the current state."""
    indices = {
        item["name"]: i for i, item in enumerate(objects) if is_sphere_contact(item) and item["name"] in contacts
    }
    return {name: Sphere(i, *sphere_gap(mbs, i)) for name, i in indices.items()}
