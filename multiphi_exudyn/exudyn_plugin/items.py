"""Items of an Exudyn system, their kinds, and what each of them becomes in a reduced model.

Contacts of a model are ObjectContactCoordinate and ObjectContactSphereSphere, -SphereTriangle and -SphereTorus with a
linear law without friction, and the limit stops of ObjectConnectorCoordinateSpringDamperExt. Friction of a model is
that of the latter object (contacts.py). Everything else is a part of the matrices, a constraint, a load, or left out
for a reason.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

__all__ = [
    "Item",
    "contact_parameters",
    "grouped",
    "has_contact",
    "has_friction",
    "has_limit_stops",
    "has_own_coordinates",
    "is_active",
    "is_constraint",
    "is_contact",
    "is_nonlinear_constraint",
    "is_sphere_contact",
    "left_out_directions",
    "left_out_functions",
    "left_out_objects",
    "linearised_functions",
    "load_item",
    "missing_parts",
    "taken_objects",
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
INACTIVE = "not active"
FIXED_GAP = "constraints hold its gap"
FIXED_GAPS = "constraints hold the gaps of its limit stops"
FIXED_FRICTION = "constraints hold the coordinate of its friction"
WITHOUT_EFFECT = (INACTIVE, FIXED_GAP, FIXED_GAPS, FIXED_FRICTION)  # reasons of items that have no effect on a motion
USER_FUNCTION = (
    "the difference of its user function from its tangent at the current state"  # evaluated by the check of a run
)
NAMES_SHOWN = 3  # names of items that are shown for a group
_LINEAR = {
    "GenericODE2",
    "Mass1D",
    "RotationalMass1D",
    "MassPoint",
    "MassPoint2D",
    "ConnectorCoordinateSpringDamper",
    DAMPER_EXT,
}
_ONE_SIDED = {
    "ConnectorRollingDiscPenalty": "its contact and its friction away from the current state",
    "ConnectorReevingSystemSprings": "slackening of its rope",
}


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


def taken_objects(objects: Sequence[Mapping[str, Any]], contacts: Collection[str]) -> Iterator[Item]:
    """Objects that are part of the model; contacts: names of its contacts and frictions."""
    for i, item in enumerate(objects):
        if is_active(item) and (not is_contact(item) or item["name"] in contacts):
            yield _object_item(i, item, _role(item, contacts))


def left_out_objects(
    objects: Sequence[Mapping[str, Any]],
    contacts: Collection[str],
    frictions: Mapping[int, str],
    motions: Mapping[int, str],
) -> Iterator[tuple[Item, str]]:
    """Objects that the model does not contain, or not completely, with the reason.

    frictions, motions: reasons why friction or a prescribed motion is left out, empty for a motion that is taken.
    """
    for i, item in enumerate(objects):
        reason = _reason(item, contacts, frictions.get(i, ""), motions.get(i))
        if reason:
            yield _object_item(i, item), reason


def left_out_functions(mbs: Any) -> Iterator[tuple[Item, str]]:
    """User functions of the system itself, whose effect on a run is unknown."""
    for kind in ("PreStep", "PostStep", "PostNewton", "PreNewtonResidual"):
        if getattr(mbs, f"Get{kind}UserFunction")():
            yield Item("mbs", 0, f"{kind}UserFunction"), "what it does in a run"


def left_out_directions(reason: str) -> Iterator[tuple[Item, str]]:
    """Directions that are left out because nothing moves the system there; reason: why a structure cannot have them."""
    yield Item("mbs", 0, "MainSystem"), f"directions in which nothing moves it, {reason}"


def grouped(items: Iterable[tuple[Item, str]]) -> list[str]:
    """Sentences "16 ObjectContactCircleCable2D ('a', 'b', ...): ...", one for each type of item and text."""
    groups: dict[tuple[str, str], list[str]] = {}
    for item, text in items:
        groups.setdefault((item.type, text), []).append(repr(item.name))
    return [f"{_members(kind, names)}: {text}" for (kind, text), names in groups.items()]


def _members(kind: str, names: Sequence[str]) -> str:
    if len(names) == 1:
        return f"{kind} {names[0]}"
    more = ["..."] if len(names) > NAMES_SHOWN else []
    return f"{len(names)} {kind} ({', '.join([*names[:NAMES_SHOWN], *more])})"


def missing_parts(left_out: Iterable[tuple[Item, str]]) -> list[str]:
    """Parts of the system that a run of the model lacks, grouped; without those that have no effect."""
    return grouped((item, reason) for item, reason in left_out if reason not in WITHOUT_EFFECT)


def linearised_functions(left_out: Iterable[tuple[Item, str]]) -> list[str]:
    """Those of the missing parts that can be evaluated in the system at any state, grouped."""
    return grouped((item, reason) for item, reason in left_out if reason == USER_FUNCTION)


def load_item(index: int, load: Mapping[str, Any], became: str = "") -> Item:
    return Item(load["name"], index, f"Load{load['loadType']}", became)


def _object_item(index: int, item: Mapping[str, Any], became: str = "") -> Item:
    return Item(item["name"], index, f"Object{item['objectType']}", became)


def _reason(item: Mapping[str, Any], contacts: Collection[str], friction: str, motion: str | None) -> str:
    """Reason why an object, or a part of it, is left out; empty if it is not."""
    if not is_active(item):
        return INACTIVE
    if is_contact(item) and item["name"] not in contacts:
        return refusal_of(item) or FIXED_GAP
    if has_limit_stops(item) and not _stops(item, contacts):
        return FIXED_GAPS
    if friction:
        return friction
    if has_friction(item) and item["name"] not in contacts:
        return FIXED_FRICTION
    if item["objectType"] in _ONE_SIDED:
        return _ONE_SIDED[item["objectType"]]
    if motion == "":
        return ""
    if motion is not None or (is_constraint(item) and _prescribes_velocity(item)):
        return f"the motion it prescribes{f', {motion}' if motion else ''}; its coordinate is held where it is"
    if user_function(item):
        return USER_FUNCTION
    return ""


def _prescribes_velocity(item: Mapping[str, Any]) -> bool:
    return bool(item.get("velocityLevel", False)) and bool(np.any(item.get("offset", 0.0)))


def _role(item: Mapping[str, Any], contacts: Collection[str]) -> str:
    if is_contact(item):
        present = ", in its present direction" if is_sphere_contact(item) else ""
        return f"contact, {item['contactStiffness']:g} N/m{_damper(item['contactDamping'])}{present}"
    if item["objectType"] == "Ground":
        return "ground"
    if is_constraint(item):
        return "constraint, its directions taken out"
    parts = [_matrices(item)]
    if stops := _stops(item, contacts):
        law = f"{item['limitStopsStiffness']:g} N/m{_damper(item['limitStopsDamping'])}"
        parts.append(f"contacts {', '.join(stops)}, {law}")
    if has_friction(item) and item["name"] in contacts:
        parts.append(f"friction, {item['dynamicFrictionForce']:g} N by a bristle of {item['stickingStiffness']:g} N/m")
    return "; ".join(parts)


def _stops(item: Mapping[str, Any], contacts: Collection[str]) -> list[str]:
    """Names of the contacts of the model from an object's limit stops."""
    return [name for name in (f"{item['name']}.upper", f"{item['name']}.lower") if name in contacts]


def _matrices(item: Mapping[str, Any]) -> str:
    if user_function(item):
        return "its user function linearised at the current state"
    return "its matrices" if item["objectType"] in _LINEAR else "linearised at the current state"


def _damper(damping: float) -> str:
    return f" and {damping:g} N s/m, which never pulls; Exudyn's pulls where the contact opens" if damping else ""
