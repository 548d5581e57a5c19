"""Items of an Exudyn system, from GetObject and GetLoad, and functions that determine their kinds.

Contacts of a model are ObjectContactCoordinate and ObjectContactSphereSphere, -SphereTriangle and -SphereTorus with a
linear law without friction, and the limit stops of ObjectConnectorCoordinateSpringDamperExt. Friction of a model is
that of the latter object (frictions.py). Everything else is a part of the matrices, a constraint, a load, or left out
for a reason (item_fates.py).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

__all__ = [
    "DAMPER_EXT",
    "Item",
    "contact_parameters",
    "has_contact",
    "has_friction",
    "has_limit_stops",
    "has_own_coordinates",
    "is_active",
    "is_constraint",
    "is_contact",
    "is_nonlinear_constraint",
    "is_sphere_contact",
    "refusal_of",
    "user_function",
    "value_key",
]


DAMPER_EXT = "ConnectorCoordinateSpringDamperExt"
_FRICTION = ("dynamicFrictionForce", "staticFrictionOffsetForce", "viscousFrictionFactor")
_SPHERES = "ContactSphereSphere"  # Exudyn's type of a sphere on a sphere, on triangles and on a torus
_CONTACT_LAW = {  # of a linear spring on one side
    "impactModel": ("impact model", 0),
    "contactStiffnessExponent": ("stiffness exponent", 1),
    "dynamicFriction": ("friction coefficient", 0),
    "contactPlasticityRatio": ("plasticity ratio", 0),
}
_CONSTRAINTS = ("Joint", "ConnectorDistance")
_SLIDING = {"JointSliding", "JointSliding2D", "JointALEMoving2D"}  # joints with a place along cables of their own
_COORDINATE_CONSTRAINTS = {"ConnectorCoordinate", "ConnectorCoordinateVector"}


@dataclass(frozen=True)
class Item:
    """One item of an Exudyn system, and its part in the model of a reduction.

    Attributes
    ----------
    name : str
        Name of the item.
    index : int
        Index among objects or loads; 0 for the system.
    type : str
        Exudyn's type of the item.
    became : str
        Its part in the model; empty if it was left out.

    Examples
    --------
    >>> import exudyn as exu
    >>> import exudyn.itemInterface as eii
    >>> import multiphi_exudyn as mp
    >>> from multiphi_exudyn.exudyn_plugin import linear_structure_from, reduce
    >>> container = exu.SystemContainer()
    >>> mbs = container.AddSystem()  # 1 kg on a spring of 4e4 N/m, a stop 1 mm below
    >>> ground = mbs.AddNode(eii.NodePointGround())
    >>> node = mbs.AddNode(eii.Node1D(initialVelocities=[-0.5]))
    >>> mass = mbs.AddObject(eii.ObjectMass1D(name="mass", mass=1.0, nodeNumber=node))
    >>> ends = [
    ...     mbs.AddMarker(eii.MarkerNodeCoordinate(nodeNumber=n, coordinate=0))
    ...     for n in (ground, node)
    ... ]
    >>> spring = mbs.AddObject(
    ...     eii.CoordinateSpringDamper(name="spring", markerNumbers=ends, stiffness=4e4)
    ... )
    >>> data = mbs.AddNode(
    ...     eii.NodeGenericData(initialCoordinates=[1.0], numberOfDataCoordinates=1)
    ... )
    >>> law = {"contactStiffness": 1e6, "offset": -1e-3, "nodeNumber": data}
    >>> stop = mbs.AddObject(
    ...     eii.ObjectContactCoordinate(name="stop", markerNumbers=ends, **law)
    ... )
    >>> mbs.Assemble()
    >>> taken = reduce(mbs).taken
    >>> taken[1].name, taken[1].became
    ('spring', 'its matrices')
    """

    name: str
    index: int
    type: str
    became: str = ""


def has_limit_stops(item: Mapping[str, Any]) -> bool:
    """True for an object with limit stops in use."""
    return item["objectType"] == DAMPER_EXT and item["useLimitStops"] and item["limitStopsStiffness"] > 0


def has_contact(item: Mapping[str, Any]) -> bool:
    """True for an active object that becomes one or two contacts of the model."""
    return is_active(item) and (has_limit_stops(item) or (is_contact(item) and not refusal_of(item)))


def has_friction(item: Mapping[str, Any]) -> bool:
    """True for an active connector with friction of its own law."""
    frictional = item["objectType"] == DAMPER_EXT and any(float(item[name]) for name in _FRICTION)
    return frictional and is_active(item) and not user_function(item)


def is_constraint(item: Mapping[str, Any]) -> bool:
    """True for a joint or another connector that is a constraint."""
    kind = str(item["objectType"])
    return kind.startswith(_CONSTRAINTS) or kind in _COORDINATE_CONSTRAINTS


def has_own_coordinates(item: Mapping[str, Any]) -> bool:
    """True for an active joint whose place along cables is a coordinate of its own, which no linear structure has."""
    return item["objectType"] in _SLIDING and is_active(item)


def is_sphere_contact(item: Mapping[str, Any]) -> bool:
    """True for a contact of a sphere, which has the direction of its gap's gradient at the current state."""
    return bool(item["objectType"] == _SPHERES)


def is_nonlinear_constraint(item: Mapping[str, Any]) -> bool:
    """True for an active constraint that is not linear in the coordinates, so that its force gives stiffness."""
    terms = [item.get(key) for key in ("quadraticTermMarker0", "quadraticTermMarker1", "constraintUserFunction")]
    curved = str(item["objectType"]).startswith(_CONSTRAINTS) or any(np.any(term) for term in terms if term is not None)
    return is_constraint(item) and is_active(item) and curved


def contact_parameters(item: Mapping[str, Any]) -> list[tuple[str, Any]]:
    """Parameters of an object's contact and friction, with the values that switch them off."""
    if is_contact(item) and is_active(item):
        return [("activeConnector", False)]
    if item["objectType"] != DAMPER_EXT:
        return []
    return [("useLimitStops", False), *((name, 0.0) for name in _FRICTION)]


def user_function(item: Mapping[str, Any]) -> str:
    """Key of an item's first user function that is not for graphics, empty without one."""
    keys = (key for key in item if key.endswith(("UserFunction", "UserFunction_t")) and not key.startswith("V"))
    return next((key for key in keys if item[key]), "")


def value_key(load: Mapping[str, Any]) -> str:
    """Key of a load's value."""
    return "load" if "load" in load else "loadVector"


def is_active(item: Mapping[str, Any]) -> bool:
    return bool(item.get("activeConnector", True))


def is_contact(item: Mapping[str, Any]) -> bool:
    """True for a contact object of any law; limit stops are not contact objects."""
    return str(item["objectType"]).startswith("Contact")


def refusal_of(item: Mapping[str, Any]) -> str:
    """Reason why an active contact object is not a unilateral spring; empty if it is."""
    if item["objectType"] not in ("ContactCoordinate", _SPHERES):
        return "its point of contact moves over a surface, so that its gap is no linear function of coordinates"
    for key, (label, needed) in _CONTACT_LAW.items():
        if item.get(key, needed) != needed:
            return f"{label} {item[key]:g}, need {needed}"
    if not item["contactStiffness"] > 0:
        return f"contact stiffness {item['contactStiffness']:g}, need a value > 0"
    return ""
